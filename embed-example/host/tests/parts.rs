//! Pictures in parts: `render --part` and `merge`.
#![cfg(feature = "program")]

mod common;

use common::{croupier, text};
use croupier::unstable::Sampler;
use croupier::{Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::checkpoint::Schedule;
use croupier_host::description::{Model, Reflectance};
use croupier_host::drive::{DriveError, Options, Part, PartError, Rendered, Target, Unobserved, drive_scene};
use croupier_host::image::Picture;
use croupier_host::part::{FileError, MergeError, merge, write};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::process::Command;

/// Diffuse blocks in a box, and a mirror that no triangle has, so that there may be highlights.
fn cornell() -> AlignedBytes {
    let mut scene = builtin::cornell_blocks();
    scene.add_material("mirror", Model::Mirror { reflectance: Reflectance::Constant([1.0; 3]) });
    bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap().bytes
}

fn settings(scene: &Scene<'_>, strategy: &str) -> Settings {
    let mut settings = Settings { size: [20, 12], shards: 3, aovs: true.into(), ..Settings::for_scene(scene) };
    for (name, text) in [("rrs", strategy), ("cache-bytes", "1MiB")] {
        settings.set(name, text).unwrap();
    }
    settings
}

fn part(number: u32, of: u32) -> Option<Part> {
    Part::new(number, of)
}

fn render(scene: Scene<'_>, settings: Settings, target: Target, part: Option<Part>) -> Rendered {
    let save_cache = settings.strategy.name() == "ears";
    let options = Options { threads: 1, part, save_cache, ..Options::new(settings, target) };
    drive_scene(scene, &options, &Unobserved).unwrap()
}

/// Renders and writes a part of a picture.
fn save(path: &Path, scene: Scene<'_>, settings: Settings, target: Target, part: Part) {
    write(path, &scene, &settings, part, target, &render(scene, settings, target, Some(part)), None).unwrap();
}

/// Renders and writes all parts; their files.
fn parts(folder: &Path, scene: Scene<'_>, settings: Settings, spp: u32, of: u32) -> Vec<PathBuf> {
    let one = |number: u32| {
        let path = folder.join(format!("{number}.crpart"));
        let part = Part::new(number, of).unwrap();
        save(&path, scene, settings, Target::Spp(spp), part);
        path
    };
    (1..=of).map(one).collect()
}

/// Without roulette, hashed samples do not depend on combs: parts have those of one render, each once. Killed by: ranges with
/// gaps or samples in common, sums, differences of halves, spreads, rays or auxiliary
/// values that are lost or added with other weights, a sum that knows of no highlight.
#[test]
fn parts_have_the_samples_of_one_render() {
    let (bytes, folder) = (cornell(), tempfile::tempdir().unwrap());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let settings = Settings { sampler: Sampler::Hashed, ..settings(&scene, "none") };
    let whole = render(scene, settings, Target::Spp(17), None);
    for of in [1, 5, 17] {
        let merged = merge(&parts(folder.path(), scene, settings, 17, of)).unwrap().rendered;
        assert_eq!((merged.spp, merged.counters.rays()), (17, whole.counters.rays()));
        let near = |x: f64, y: f64, tolerance: f64| assert!((x - y).abs() <= tolerance * (x.abs() + 1e-9), "{x} {y}");
        for (a, b) in whole.pixels.iter().zip(&merged.pixels) {
            assert_eq!((a.samples, a.rays, a.ahead), (b.samples, b.rays, b.ahead));
            // other iterations divide the same samples otherwise into halves
            let same = (a.difference - b.difference).abs() <= 1e-6 * (a.sum[0] + a.sum[1] + a.sum[2]);
            assert!(if of == 1 { same } else { (a.difference == 0.0) == (b.difference == 0.0) });
            for c in 0..3 {
                near(a.sum[c], b.sum[c], 1e-12);
                near(a.spread[c], b.spread[c], 1e-5);
            }
        }
        assert_eq!(whole.planes.len(), merged.planes.len());
        for ((aov, a), (_, b)) in whole.planes.iter().zip(&merged.planes) {
            for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
                assert!((x - y).abs() <= 1e-4 * (x.abs() + 1e-3), "{aov:?}: {x} {y}");
            }
        }
        assert!(whole.error.highlight > 0.0);
        near(whole.error.highlight, merged.error.highlight, 1e-4);
        assert!((merged.error.rel_mse_all / merged.error.independence > 0.0) && merged.error.high > merged.error.low);
    }
}

/// With what each part has learned for itself the mean is that of a long render, within the stated error, and the error
/// falls as the samples say. Killed by: parts weighed by their variance, samples of one part in another, parts that draw the
/// same numbers.
#[test]
fn the_mean_of_learning_parts_is_unbiased() {
    let (bytes, folder) = (cornell(), tempfile::tempdir().unwrap());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let settings = settings(&scene, "ears");
    let reference = render(scene, Settings { seed: 99, ..settings }, Target::Spp(2048), None);
    let merged = merge(&parts(folder.path(), scene, settings, 128, 8)).unwrap().rendered;
    let mean = |r: &Rendered| r.pixels.iter().flat_map(|p| p.mean()).sum::<f64>() / (3 * r.pixels.len()) as f64;
    let squares: f64 = [&reference, &merged]
        .iter()
        .flat_map(|r| r.pixels.iter())
        .map(|p| (p.variance_of_mean().iter().map(|v| v.sqrt()).sum::<f64>() / 3.0).powi(2))
        .sum();
    let error = squares.sqrt() / merged.pixels.len() as f64;
    let difference = mean(&merged) - mean(&reference);
    assert!(difference.abs() < 4.0 * error, "{difference} with an error of {error}");
    // against the reference, whose own error is a sixteenth
    let square = |(a, b): (f64, f64)| (a - b) * (a - b) / (b * b + 0.01);
    let pairs = merged.pixels.iter().zip(&reference.pixels).flat_map(|(a, b)| a.mean().into_iter().zip(b.mean()));
    let found = pairs.map(square).sum::<f64>() / (3 * merged.pixels.len()) as f64;
    let stated = merged.error.rel_mse + reference.error.rel_mse;
    // few pixels cause most of it, which the interval knows
    let (low, high) = (merged.error.low, merged.error.high + reference.error.high);
    assert!((low..high).contains(&found), "relMSE {found}, stated {stated}: {low} to {high}");
}

/// Killed by: iterations that two parts have in common, which would have the same combs; a share that depends on
/// another part.
#[test]
fn parts_are_told_apart_by_samples_and_iterations() {
    for target in [Target::Spp(37), Target::Seconds(1.0), Target::Rays(1000)] {
        let shares: Vec<_> = (1..=16).map(|k| part(k, 16).unwrap().share(target).unwrap()).collect();
        assert_eq!(shares.iter().map(|s| s.iterations >> 32).collect::<HashSet<_>>().len(), 16);
        assert!(shares.is_sorted_by(|a, b| a.first < b.first) && shares[0].first == 0);
    }
    let spp = |k, n, spp| part(k, n).unwrap().share(Target::Spp(spp)).map(|s| (s.first, s.target));
    assert_eq!(spp(2, 3, 10), Ok((3, Target::Spp(3))));
    assert_eq!(spp(3, 3, 10), Ok((6, Target::Spp(4))));
    assert_eq!(spp(1, 3, 2), Err(PartError::Samples { samples: 2, of: 3 }));
    assert_eq!(part(1, 1).unwrap().share(Target::Error(0.1)), Err(PartError::Error));
    for text in ["0/3", "4/3", "3", "1/65537", "a/b", "-1/2", "1/0", ""] {
        assert_eq!(text.parse::<Part>(), Err(PartError::Text), "{text}");
    }
    assert_eq!("3/16".parse::<Part>().unwrap().to_string(), "3/16");
}

/// A part that was interrupted goes on with the bits that it would have had, and takes no checkpoint of another part.
/// Killed by: a range that begins anew after a break, a checkpoint of another part or of a whole picture that is taken.
#[test]
fn parts_go_on_from_their_own_checkpoints() {
    let (bytes, folder) = (cornell(), tempfile::tempdir().unwrap());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let settings = settings(&scene, "ears");
    let path = folder.path().join("checkpoint");
    let schedule = Schedule { path: path.clone(), every: 1e9 };
    // part 2 of 4 of 32 and of 48 samples begin with samples 8 and 12: three of eight, up to 16 and up to 24
    let of = |spp, part| Options { threads: 1, part, ..Options::new(settings, Target::Spp(spp)) };
    let seconds = Options { checkpoint: Some(&schedule), ..of(32, part(2, 4)) };
    drive_scene(scene, &seconds, &Unobserved).unwrap();
    let resume = |o: Options<'_>| drive_scene(scene, &Options { resume: Some(&path), ..o }, &Unobserved);
    let again = resume(of(32, part(2, 4))).unwrap();
    let straight = drive_scene(scene, &of(32, part(2, 4)), &Unobserved).unwrap();
    assert!(again.pixels == straight.pixels && again.first_sample == 8 && again.spp == 8);
    for (other, first) in [(of(32, part(3, 4)), 16), (of(48, part(2, 4)), 12), (of(32, None), 0)] {
        match resume(other) {
            Err(DriveError::OtherPart(8, here)) => assert_eq!(here, first),
            other => panic!("{:?}", other.map(|r| r.spp)),
        }
    }
}

/// Killed by: any check left out, an error that does not say which file.
#[test]
fn parts_that_do_not_fit_are_refused_by_name() {
    let (bytes, folder) = (cornell(), tempfile::tempdir().unwrap());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let plain = settings(&scene, "classic");
    let files = parts(folder.path(), scene, plain, 6, 3);
    let other = |name: &str, scene: Scene<'_>, settings: Settings, spp: u32, number: u32, of: u32| {
        let path = folder.path().join(name);
        save(&path, scene, settings, Target::Spp(spp), Part::new(number, of).unwrap());
        path
    };
    let refused = |files: &[PathBuf]| merge(files).map(|_| ()).unwrap_err().to_string();
    let with = |path: PathBuf| refused(&[files[0].clone(), path, files[2].clone()]);
    let seed = Settings { seed: 5, ..plain };
    let e = with(other("seed", scene, seed, 6, 2, 3));
    assert!(e.contains("1.crpart was rendered with --seed 0, ") && e.ends_with("seed with 5"), "{e}");
    assert!(refused(&files[1..]).contains("part 1 of 3 is missing"));
    assert!(refused(&files[..1]).contains("2 of 3 parts are missing, the first of them is part 2"));
    assert!(with(files[0].clone()).contains("both hold part 1"));
    let n = with(other("four", scene, plain, 6, 2, 4));
    assert!(n.contains("--part 1/3") && n.contains("with 2/4"), "{n}");
    // totals with which parts have samples in common, or leave some out
    for spp in [3, 12] {
        let e = with(other("spp", scene, plain, spp, 2, 3));
        assert!(e.contains("1.crpart was rendered with --spp 6, ") && e.ends_with(&format!("spp with {spp}")), "{e}");
    }
    let rays = folder.path().join("rays");
    save(&rays, scene, plain, Target::Rays(1000), Part::new(2, 3).unwrap());
    for order in [[&files[0], &rays], [&rays, &files[0]]] {
        let e = refused(&order.map(Clone::clone));
        assert!(e.contains("1.crpart was rendered with --spp 6, ") && e.ends_with("with another target"), "{e}");
    }
    // parts that end by rays have room for 65535 samples where there are 65536 of them
    let long = [1, 2].map(|number| {
        let path = folder.path().join(format!("long-{number}"));
        let (part, target) = (Part::new(number, 1 << 16).unwrap(), Target::Rays(1));
        let rendered = Rendered { spp: 1 << 16, ..render(scene, plain, target, Some(part)) };
        write(&path, &scene, &plain, part, target, &rendered, None).unwrap();
        path
    });
    let overlap = refused(&long);
    assert!(overlap.contains("both hold sample 65535"), "{overlap}");
    let mut description = builtin::cornell_blocks();
    description.camera.vfov_deg += 1.0;
    let moved = bake(&description, &BakeOptions::default(), |_, _| {}).unwrap().bytes;
    let scenes = with(other("moved", Scene::from_bytes(&moved).unwrap(), plain, 6, 2, 3));
    assert!(scenes.contains("are of different scenes"), "{scenes}");
    assert!(matches!(merge(&[]), Err(MergeError::Nothing)));
}

/// A program may have fewer files open than a picture has parts. Killed by: files that stay open until all are added.
#[test]
#[cfg(unix)]
fn many_parts_need_few_open_files() {
    let (bytes, folder) = (cornell(), tempfile::tempdir().unwrap());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let settings = Settings { size: [4, 4], shards: 1, ..settings(&scene, "none") };
    parts(folder.path(), scene, settings, 64, 64);
    let merge = ["-c", "ulimit -n 32 && exec \"$0\" merge *.crpart", env!("CARGO_BIN_EXE_croupier")];
    let done = Command::new("sh").args(merge).current_dir(folder.path()).output().unwrap();
    assert!(done.status.success(), "{}", text(&done.stderr));
    assert!(text(&done.stdout).contains("64 parts: 64.0 samples per pixel"), "{}", text(&done.stdout));
}

/// Killed by: a length that is believed, bytes that no hash covers.
#[test]
fn damaged_parts_are_refused() {
    let (bytes, folder) = (cornell(), tempfile::tempdir().unwrap());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let files = parts(folder.path(), scene, settings(&scene, "ears"), 4, 1);
    let whole = fs::read(&files[0]).unwrap();
    let error = |bytes: &[u8]| {
        fs::write(&files[0], bytes).unwrap();
        match merge(&files) {
            Err(MergeError::File(path, e)) => {
                assert_eq!(path, files[0]);
                e
            }
            other => panic!("{:?}", other.map(|_| ())),
        }
    };
    for n in [0, 7, 100, whole.len() / 2, whole.len() - 1] {
        let e = error(&whole[..n]);
        assert!(if n < 8 { matches!(e, FileError::Kind) } else { matches!(e, FileError::Length(..)) }, "{n}: {e}");
    }
    assert!(matches!(error(&[&whole[..], &[0]].concat()), FileError::Length(..)));
    for at in (0..whole.len()).step_by(1 + whole.len() / 400) {
        let mut changed = whole.clone();
        changed[at] ^= 0x40;
        let e = error(&changed);
        assert_eq!(matches!(e, FileError::Kind), at < 8, "byte {at}: {e}");
    }
    let e = error(&{
        let mut other = whole.clone();
        other[8] = 9;
        other
    });
    assert!(matches!(e, FileError::Version(..)), "{e}");
    fs::write(&files[0], &whole).unwrap();
    merge(&files).unwrap();
}

/// The program: any order gives the same bytes, statistics of all parts can be gone on with. Killed by: an order that
/// matters, a cache that is not that of the scene, guides that are left out, files that are overwritten.
#[test]
fn the_program_renders_and_merges_parts() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| croupier(folder.path(), arguments);
    let base = ["render", "cornell", "--size", "24x16", "--spp", "6", "--aovs=albedo,alpha,object_coverage"];
    for k in 1..=3 {
        let done = run(&[&base[..], &["--part", &format!("{k}/3"), "--json"]].concat());
        assert!(done.status.success(), "{}", text(&done.stderr));
        let out = text(&done.stdout);
        assert!(out.contains(&format!("\"part\":{k}")) && out.contains(&format!("part-{k}-of-3.crpart")), "{out}");
    }
    let [a, b, c] = ["part-1-of-3.crpart", "part-2-of-3.crpart", "part-3-of-3.crpart"];
    for (out, order) in [("x.exr", [a, b, c]), ("y.exr", [c, a, b])] {
        let done = run(&[&["merge", "-o", out, "--cache-out", "all.cache", "--denoise"], &order[..]].concat());
        assert!(done.status.success(), "{}", text(&done.stderr));
    }
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("x.png") == bytes("y.png"));
    // attributes have no order
    let [picture, other] = ["x.exr", "y.exr"].map(|name| Picture::read_exr(&folder.path().join(name)).unwrap());
    assert!(picture.layers == other.layers);
    let samples = &picture.layer("samples").unwrap().channels[0].values;
    assert!(samples.iter().all(|n| *n == 6.0) && picture.layer("CryptoObject00").is_some());
    // names of objects come from the parts
    assert!(String::from_utf8_lossy(&bytes("x.exr")).contains("glass sphere"));
    // the parts' guides became one, behind the cache
    assert_eq!(bytes("all.cache").windows(8).filter(|w| w == b"CRPGUIDE").count(), 1);
    let done = run(&["render", "cornell", "--size", "24x16", "--spp", "1", "--cache-in", "all.cache"]);
    assert!(done.status.success(), "{}", text(&done.stderr));

    let fails = |arguments: &[&str], status: i32, why: &str| {
        let done = run(arguments);
        assert_eq!(done.status.code(), Some(status), "{arguments:?}");
        assert!(text(&done.stderr).contains(why), "{}", text(&done.stderr));
    };
    fails(&["merge", a, c], 1, "part 2 of 3 is missing");
    fails(&["merge", a, b, c, "-o", "x.exr", "--cache-out", a], 1, "which was read");
    fails(&["merge", a, b, "x.exr"], 1, "x.exr: not a part of a picture");
    fails(&["merge"], 2, "PART");
    fails(&["render", "cornell", "-o", "a.crpart"], 2, "needs --part");
    fails(&["render", "cornell", "-o", "a.exr", "--part", "1/2"], 2, "ends in .crpart");
    fails(&["render", "cornell", "--part", "3/2"], 2, "such as 3/16");
    fails(&["render", "cornell", "--part", "1/2", "--denoise"], 2, "cannot be used with");
    fails(&["render", "cornell", "--part", "1/2", "--spp", "1"], 1, "cannot be divided into 2 parts");
    fails(&["render", "cornell", "--part", "1/2", "--until-error", "1"], 1, "not --until-error");
    fails(&["render", "cornell", "--part", "1/2", "--adaptive"], 1, "without bias");
}

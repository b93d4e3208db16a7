//! Renders that go on from a checkpoint: the same bits as without the break; files that are refused.
#![cfg(feature = "program")]

mod common;

use common::{croupier, text};
use croupier::{Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::checkpoint::{CheckpointError, Schedule, read};
use croupier_host::drive::{DriveError, Observer, Options, Progress, Rendered, Target, drive_scene};
use croupier_host::image::Picture;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

/// Ends a render after so many asks.
struct After {
    asks: AtomicU32,
    most: u32,
}

impl After {
    fn new(most: u32) -> Self {
        Self { asks: AtomicU32::new(0), most }
    }
}

impl Observer for After {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        self.asks.fetch_add(1, Ordering::Relaxed) >= self.most
    }
}

fn everything(r: &Rendered) -> (Vec<u8>, String) {
    let bytes =
        [bytemuck::cast_slice(&r.pixels), bytemuck::cast_slice::<_, u8>(&r.aovs), r.cache.as_deref().unwrap_or(&[])];
    let counts: Vec<_> = r.iterations.iter().map(|i| (i.work.samples, i.counters, i.picture, i.cache)).collect();
    (bytes.concat(), format!("{} {:?} {:?} {counts:?}", r.spp, r.counters, r.error))
}

/// Film, auxiliary sums, statistics of the scene, counters and the figures of each iteration, for strategies that learn
/// and that do not, stopped between iterations and within one, any number of times. Killed by: work, statistics or an
/// iteration under way that is lost or counted twice, samples per iteration that depend on the break.
#[test]
fn resumed_renders_have_the_same_bits() {
    let baked = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap();
    let scene = Scene::from_bytes(&baked.bytes).unwrap();
    let dir = tempfile::tempdir().unwrap();
    for (strategy, adaptive, sampler, guiding) in [
        ("classic", false, "hashed", "off"),
        ("ears", false, "hashed", "off"),
        ("ears", true, "hashed", "off"),
        ("bolin-meyer", false, "hashed", "off"),
        ("classic", false, "sobol", "off"),
        ("ears", true, "sobol", "off"),
        ("classic", false, "hashed", "on"),
        ("ears", false, "sobol", "auto"),
    ] {
        let mut settings =
            Settings { size: [40, 30], shards: 3, aovs: true.into(), adaptive, ..Settings::for_scene(&scene) };
        settings.set("rrs", strategy).unwrap();
        settings.set("sampler", sampler).unwrap();
        settings.set("cache-bytes", "1MiB").unwrap();
        settings.set("guiding", guiding).unwrap();
        settings.set("guide-bytes", "300000").unwrap();
        let learns = strategy == "ears" || guiding != "off";
        let plain = Options { threads: 1, save_cache: learns, ..Options::new(settings, Target::Spp(37)) };
        let whole = drive_scene(scene, &plain, &After::new(u32::MAX)).unwrap();
        let mut breaks = 0;
        for asks in [1, 2, 5, 11] {
            let path = dir.path().join(format!("{strategy}{adaptive}{sampler}{guiding}{asks}"));
            let schedule = Schedule { path: path.clone(), every: 1e9 };
            let mut resume = None;
            // The more asks are left, the further it comes before the next break.
            let found = (1..).find_map(|round| {
                let options = Options { checkpoint: Some(&schedule), resume, ..plain };
                let r = drive_scene(scene, &options, &After::new(asks * round)).unwrap();
                assert_eq!(r.checkpoint_error, None);
                resume = Some(path.as_path());
                breaks += u32::from(r.stopped_early);
                (!r.stopped_early).then_some(r)
            });
            assert!(everything(&found.unwrap()) == everything(&whole), "{strategy} {adaptive} {guiding}: {asks}");
        }
        assert!(breaks > 0, "{strategy}");
    }
}

fn error(r: Result<Rendered, DriveError>) -> String {
    r.map(|_| ()).unwrap_err().to_string()
}

/// Killed by: a difference that goes unnoticed, is not named, or panics; any byte of a file that does not count.
#[test]
fn other_files_are_refused_by_name() {
    let baked = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap();
    let scene = Scene::from_bytes(&baked.bytes).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.check");
    let settings = Settings { size: [8, 6], shards: 2, ..Settings::for_scene(&scene) };
    let schedule = Schedule { path: path.clone(), every: 1e9 };
    let options = Options { threads: 1, ..Options::new(settings, Target::Spp(4)) };
    drive_scene(scene, &Options { checkpoint: Some(&schedule), ..options }, &After::new(u32::MAX)).unwrap();
    let good = fs::read(&path).unwrap();
    let resume = |bytes: &[u8], o: &Options<'_>, scene: Scene<'_>| {
        fs::write(&path, bytes).unwrap();
        drive_scene(scene, &Options { resume: Some(&path), ..*o }, &After::new(u32::MAX))
    };
    assert_eq!(resume(&good, &options, scene).unwrap().spp, 4);
    let with = |name: &str, value: &str| {
        let mut settings = settings;
        settings.set(name, value).unwrap();
        Options { settings, ..options }
    };
    for (name, value, said) in [
        ("seed", "7", "rendered with --seed 0, not 7"),
        ("shards", "3", "rendered with --shards 2, not 3"),
        ("size", "6x8", "rendered with --size 8x6, not 6x8"),
        ("rrs", "fixed:2", "rendered with --rrs"),
        ("ring", "64", "rendered with --ring"),
    ] {
        let said_of = error(resume(&good, &with(name, value), scene));
        assert!(said_of.contains(said), "{name}: {said_of}");
    }
    let mut other = builtin::cornell_box();
    other.max_depth = 3;
    let other = bake(&other, &BakeOptions::default(), |_, _| {}).unwrap();
    let other = Scene::from_bytes(&other.bytes).unwrap();
    let same_depth = with("max-depth", &settings.max_depth.to_string());
    assert!(error(resume(&good, &same_depth, other)).contains("of another scene (hash "));
    let own = [("statistics of the scene", Some(&good[..]), None), ("pixel estimate", None, Some(&[[1.0; 3]; 48][..]))];
    for (what, cache, pixel_estimate) in own {
        let said = error(resume(&good, &Options { cache, pixel_estimate, ..options }, scene));
        assert!(said.contains(&format!("a checkpoint has its own {what}")), "{said}");
    }
    let missing = Options { resume: Some(Path::new("missing")), ..options };
    assert!(error(drive_scene(scene, &missing, &After::new(0))).contains("No such file"));

    for n in [0, 7, 8, 50, 200, good.len() / 2, good.len() - 1] {
        let said = error(resume(&good[..n], &options, scene));
        assert!(said.contains(if n < 8 { "not a checkpoint" } else { "cut off" }), "{n} bytes: {said}");
    }
    assert!(error(resume(&[&good[..], &[0]].concat(), &options, scene)).contains("it states"));
    assert!(error(resume(b"CROUPIER and more than a hundred bytes, which are needed to fill a head of a file, so that it can be read", &options, scene)).contains("not a checkpoint"));
    let version = format!("version={}", env!("CARGO_PKG_VERSION"));
    let at = good.windows(version.len()).position(|w| w == version.as_bytes()).unwrap();
    for i in (0..good.len()).step_by(97).chain([at + 8, 8, 12]) {
        let mut damaged = good.clone();
        damaged[i] ^= 4;
        assert!(resume(&damaged, &options, scene).is_err(), "byte {i}");
    }
    // the layout's version
    let mut newer = good.clone();
    newer[8] += 1;
    assert!(error(resume(&newer, &options, scene)).contains("written by version 6 of the file's layout"));
    let mut small = vec![0; 10];
    fs::write(&path, &good).unwrap();
    assert!(matches!(read(&path, scene.hash, &settings, &mut small), Err(CheckpointError::Block(_, 10))));
}

/// From outside: a render in two parts, and a file that cannot be gone on from. Killed by: a flag that is ignored, a
/// checkpoint that is not written or not said, an error without the name of the file.
#[test]
fn the_program_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| {
        let out = croupier(dir.path(), &[&["render", "--size", "24x20", "--shards", "2"], more].concat());
        (out.status.code(), text(&out.stdout), text(&out.stderr))
    };
    let (status, said, _) = run(&["--spp", "4", "--checkpoint", "a.check", "-o", "a.exr"]);
    assert!(status == Some(0) && said.ends_with("wrote a.exr, a.png, a.check\n"), "{said}");
    let (status, said, _) = run(&["--spp", "16", "--resume", "a.check", "--checkpoint", "a.check", "-o", "b.exr"]);
    assert!(status == Some(0) && said.contains("16.0 samples per pixel"), "{said}");
    let (status, _, error) = run(&["--spp", "16", "--resume", "a.check", "--seed", "9", "-o", "c.exr"]);
    assert_eq!(status, Some(1));
    assert!(error.contains("a.check: the checkpoint was rendered with --seed 0, not 9"), "{error}");
    assert!(!dir.path().join("c.exr").exists());
    // with a target in samples that both parts reach at the end of an iteration
    let plain = ["--rrs", "classic"];
    assert_eq!(run(&[&plain[..], &["--spp", "8", "--checkpoint", "p.check", "-o", "p.exr"]].concat()).0, Some(0));
    assert_eq!(run(&[&plain[..], &["--spp", "32", "--resume", "p.check", "-o", "p.exr"]].concat()).0, Some(0));
    assert_eq!(run(&[&plain[..], &["--spp", "32", "-o", "q.exr"]].concat()).0, Some(0));
    let read = |name: &str| Picture::read_exr(&dir.path().join(name)).unwrap();
    assert!(read("p.exr") == read("q.exr"));
}

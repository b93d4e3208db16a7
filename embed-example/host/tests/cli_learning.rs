//! The program's flags about learning, denoising, false colours and statistics, from outside.
#![cfg(feature = "program")]

mod common;

use common::{croupier, text};
use croupier::unstable::SettingRange;
use croupier::{Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::image::Picture;
use std::path::Path;
use std::process::Output;

/// A render of the built-in box, as small as can be.
fn render(folder: &Path, arguments: &[&str]) -> Output {
    let small = ["render", "cornell", "--size", "24x20", "--threads", "1", "--shards", "2"];
    croupier(folder, &[&small, arguments].concat())
}

fn json(out: &Output) -> serde_json::Value {
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert_eq!(text(&out.stdout).lines().count(), 1);
    serde_json::from_slice(&out.stdout).unwrap()
}

/// Width and height of a PNG file, all of which must decode.
fn png_size(path: &Path) -> (u32, u32) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    (info.width, info.height)
}

/// Killed by: no command taken for a mistake, another scene, names or a folder other than those that README promises.
#[test]
fn without_a_command_the_built_in_scene_is_rendered_here() {
    let dir = tempfile::tempdir().unwrap();
    let found = json(&croupier(dir.path(), &["--spp", "1", "--json"]));
    assert_eq!(found["written"], serde_json::json!(["croupier.exr", "croupier.png"]));
    let exr = Picture::read_exr(&dir.path().join("croupier.exr")).unwrap();
    assert_eq!((exr.width, exr.height), (640, 432));
    assert_eq!(png_size(&dir.path().join("croupier.png")), (640, 432));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
}

/// Killed by: a strategy that the help leaves out.
#[test]
fn help_lists_every_strategy() {
    let dir = tempfile::tempdir().unwrap();
    let help = text(&croupier(dir.path(), &["render", "--help"]).stdout);
    let words = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for (name, what) in croupier::Strategy::TABLE {
        assert!(words.contains(&format!("{name}: {what}")), "{name}: {help}");
    }
}

/// Killed by: a setting that is no flag, a default that is not the one rendered with, help that leaves out the range.
#[test]
fn every_setting_is_a_flag_with_help_and_default() {
    let dir = tempfile::tempdir().unwrap();
    let scene = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap();
    let s = Settings::for_scene(&Scene::from_bytes(&scene.bytes).unwrap());
    // what the program chooses itself, or narrows
    let own_default = [
        ("size", "scene"),
        ("max-depth", "scene"),
        ("rrs", "ears"),
        ("shards", "16, as many as --cache-bytes has room for if that is fewer"),
        ("aovs", "true"),
        ("shadow-roulette", "true with ear and ears"),
        ("guiding", "auto with ear and ears"),
        ("guide-bytes", "8MiB, at most a third of --cache-bytes"),
    ];
    let own_range = [("size", "at most 2^30 pixels"), ("max-depth", "from 1 to 200")];
    let of = |list: &[(&str, &str)], name: &str| list.iter().find(|x| x.0 == name).map(|x| x.1.to_string());
    for command in ["render", "info"] {
        let help = text(&croupier(dir.path(), &[command, "-h"]).stdout);
        for row in Settings::TABLE {
            let name = row.name;
            let about = help.split_once(&format!("\n      --{name}")).unwrap_or_else(|| panic!("no {name}: {help}")).1;
            // up to the next flag
            let about = about.split("\n      --").next().unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(about.contains(row.value_name) && about.contains(row.help), "{name}: {about}");
            let default = of(&own_default, name).unwrap_or_else(|| s.get(name).unwrap().to_string());
            assert!(about.contains(&format!("[default: {default}]")), "{name}: {about}");
            let says_range = !matches!(row.range, SettingRange::Flag | SettingRange::Words(_) | SettingRange::Strategy);
            let range = of(&own_range, name).unwrap_or_else(|| row.range.to_string());
            assert!(about.contains(&range) || !says_range, "{name}: {about}");
        }
        // every default is a value that the flag takes
        let given = Settings::TABLE.iter().map(|row| match row.name {
            "rrs" | "shards" | "shadow-roulette" | "guiding" | "guide-bytes" => {
                format!("--{}={}", row.name, s.get(row.name).unwrap())
            }
            name => format!("--{name}={}", of(&own_default, name).unwrap_or_else(|| s.get(name).unwrap().to_string())),
        });
        let given: Vec<String> = given.collect();
        let arguments: Vec<&str> =
            [command, "missing.crp"].into_iter().chain(given.iter().map(String::as_str)).collect();
        let out = croupier(dir.path(), &arguments);
        assert!(text(&out.stderr).contains("cannot read missing.crp"), "{}", text(&out.stderr));
    }
}

/// Killed by: an argument that goes unchecked.
#[test]
fn usage_errors_are_status_2() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, said) in [
        (["--control-variate", "on"], "off, cached or a finite number"),
        (["--control-variate", "nan"], "off, cached or a finite number"),
        (["--objective", "both"], "relative or absolute"),
        (["--norm", "median"], "mean, luminance or max"),
        (["--cache-bytes", "24MB"], "24MiB"),
        (["--cache-bytes", "1.5MiB"], "24MiB"),
        (["--ring", "15"], "a whole number from 16 to 16777216"),
        (["--ring", "16777217"], "a whole number from 16 to 16777216"),
        (["--split-budget", "4294967296"], "--split-budget"),
        (["--ledger", "0"], "a whole number from 1 to 16777216"),
        (["--ledger", "16777217"], "a whole number from 1 to 16777216"),
        (["--learn-samples", "0"], "'--learn-samples <N>': need a whole number from 1 to 4294967295"),
        (["--seed", "-1"], "from 0 to 18446744073709551615"),
        (["--adaptive=1", "--json"], "true or false"),
        (["--subdivide-count", "0"], "finite number above 0"),
        (["--subdivide-count", "-5"], "finite number above 0"),
        (["--subdivide-count", "nan"], "finite number above 0"),
        (["--decay", "-0.1"], "from 0 to 1"),
        (["--decay", "1.1"], "from 0 to 1"),
        (["--decay", "nan"], "from 0 to 1"),
        (["--factors", "0.5"], "from 0.05 to 1 and from 1 to 20"),
        (["--factors", "0.04:20"], "from 0.05 to 1 and from 1 to 20"),
        (["--factors", "0.05:21"], "from 0.05 to 1 and from 1 to 20"),
        (["--factors", "1.1:2"], "from 0.05 to 1 and from 1 to 20"),
        (["--factors", "nan:2"], "from 0.05 to 1 and from 1 to 20"),
        (["--pixel-estimator", "guessed"], "denoised or blocks"),
    ] {
        for command in ["render", "info"] {
            let out = croupier(dir.path(), &[&[command], &arguments[..]].concat());
            let error = text(&out.stderr);
            assert_eq!(out.status.code(), Some(2), "{arguments:?}: {error}");
            assert!(error.contains(said) && out.stdout.is_empty(), "{arguments:?}: {error}");
        }
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// Flags that do not fit together are refused before the scene is loaded. Killed by: a check that waits for the
/// scene, or that takes other choices than the render does.
#[test]
fn flags_that_do_not_fit_together_are_status_1() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, said) in [
        (&["--cache-bytes", "60KiB", "--shards", "16"][..], "cache of 61440 bytes: with so many shards it needs"),
        (&["--cache-bytes", "17KiB"], "cache of 17408 bytes: with so many shards it needs"),
        (&["--shards", "65536"], "cache of 25165824 bytes: with so many shards it needs"),
        (&["--control-variate", "0.5", "--rrs", "threshold"], "cannot serve threshold"),
        (&["--control-variate", "cached", "--rrs", "classic"], "cached mean needs"),
    ] {
        for command in ["render", "info"] {
            let out = croupier(dir.path(), &[&[command, "missing.crp"], arguments].concat());
            let error = text(&out.stderr);
            assert_eq!(out.status.code(), Some(1), "{arguments:?}: {error}");
            assert!(error.contains(said) && error.lines().count() == 1, "{arguments:?}: {error}");
        }
    }
    for fit in [&["--cache-bytes", "60KiB", "--shards", "8"][..], &["--cache-bytes", "32KiB"]] {
        let out = croupier(dir.path(), &[&["info", "missing.crp"], fit].concat());
        assert!(text(&out.stderr).contains("cannot read missing.crp"), "{fit:?}: {}", text(&out.stderr));
    }
}

/// Killed by: an error after rendering instead of before, without the file's name, or none.
#[test]
fn wrong_files_are_named_before_rendering() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let fails = |arguments: &[&str], parts: &[&str]| {
        let out = render(dir, &[&["--spp", "1"], arguments].concat());
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{arguments:?}: {error}");
        assert!(
            error.lines().count() == 1 && !text(&out.stdout).contains("samples per pixel"),
            "{arguments:?}: {error}"
        );
        assert!(parts.iter().all(|p| error.contains(p)), "{arguments:?}: {error}");
    };
    let ears = |more: &[&str], parts: &[&str]| fails(&[&["--rrs", "ears"], more].concat(), parts);
    std::fs::write(
        dir.join("words.cache"),
        "this is no cache at all, but it has more than sixty-four bytes, to be sure",
    )
    .unwrap();
    std::fs::create_dir(dir.join("folder")).unwrap();
    ears(&["--cache-in", "missing.cache"], &["cannot read missing.cache", "No such file"]);
    ears(&["--cache-in", "words.cache"], &["words.cache: no saved statistics"]);
    ears(&["--cache-out", "no/where.cache"], &["cannot write no/where.cache", "not a folder"]);
    ears(&["--cache-out", "folder"], &["cannot write folder", "it is a folder"]);
    ears(&["--cache-bytes", "1KiB"], &["cache of 1024 bytes"]);
    // beside the file that is named
    let beside = ["b.png", "c.cost.png"].map(|name| dir.join(name));
    beside.iter().for_each(|name| std::fs::create_dir(name).unwrap());
    fails(&["-o", "b.exr"], &["cannot write b.png", "it is a folder"]);
    fails(&["-o", "c.exr", "--false-color"], &["cannot write c.cost.png", "it is a folder"]);
    let long = format!("{}.exr", "x".repeat(250));
    fails(&["-o", &long], &["cannot write ...xxx", "too long"]);
    ears(&["-o", "d.exr", "--cache-out", "d.png"], &["cannot write d.png", "share"]);
    beside.iter().for_each(|name| std::fs::remove_dir(name).unwrap());
    fails(&["--rrs", "classic", "--cache-out", "x.cache"], &["`classic`", "no statistics"]);
    fails(&["--rrs", "bolin-meyer", "--cache-in", "words.cache"], &["`bolin-meyer`", "no statistics"]);
    fails(&["--rrs", "classic", "--control-variate", "cached"], &["control variate", "ears"]);

    // of a scene with other bounds: a triangle
    std::fs::write(dir.join("t.obj"), "v 0 0 0\nv 7 0 0\nv 0 7 0\nf 1 2 3\n").unwrap();
    let out = croupier(
        dir,
        &["render", "t.obj", "--size", "8x8", "--spp", "2", "--rrs", "ears", "-o", "t.exr", "--cache-out", "t.cache"],
    );
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    ears(&["--cache-in", "t.cache"], &["t.cache: statistics of another scene"]);
    let names = std::fs::read_dir(dir).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    assert_eq!(names, ["folder", "t.cache", "t.exr", "t.obj", "t.png", "words.cache"]);
}

/// Killed by: files that are not written or not said, layers that are missing, a PNG of the noisy picture, statistics
/// unasked.
#[test]
fn everything_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let flags =
        ["--rrs", "ears", "--spp", "6", "--adaptive", "--shadow-roulette", "--control-variate", "cached", "--json"];
    let more = ["--objective", "absolute", "--norm", "luminance", "--denoise", "--false-color", "--stats"];
    let caches = ["--cache-out", "a.cache", "-o", "a.exr"];
    let found = json(&render(dir, &[&flags[..], &more, &caches].concat()));
    assert_eq!(found["cache_out"], "a.cache");
    let images = ["factor1", "factor2", "factor3", "factor4", "cost", "paths", "guide"].map(|n| format!("a.{n}.png"));
    assert_eq!(found["false_color"], serde_json::json!(images));
    assert_eq!(found["written"].as_array().unwrap().len(), 10);
    for name in images.iter().map(String::as_str).chain(["a.png", "a.exr", "a.cache"]) {
        assert!(std::fs::metadata(dir.join(name)).unwrap().len() > 100, "{name}");
    }
    assert!(found["iterations"].as_array().unwrap().len() >= 3);
    assert!(found["iterations"][2]["efficiency"].as_f64().unwrap() > 0.0);
    assert!(found["paths"]["path_length"].as_f64().unwrap() > 1.0);
    assert_eq!(found["time"].as_array().unwrap().len(), 6);
    let picture = Picture::read_exr(&dir.join("a.exr")).unwrap();
    for layer in ["", "denoised", "paths", "cost", "factor1", "factor4", "albedo", "guide", "guide_direction"] {
        assert!(picture.layer(layer).is_some(), "{layer}");
    }

    // begun with its own statistics; without the other flags
    let begun = ["--rrs", "ears", "--spp", "2", "--cache-in", "a.cache", "-o", "b.exr", "--json"];
    let refused = render(dir, &begun);
    let error = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{error}");
    assert!(
        error.contains("a.cache: saved statistics have values for the objective absolute, need relative"),
        "{error}"
    );
    let plain = json(&render(dir, &[&begun[..], &["--objective", "absolute"]].concat()));
    assert!(["iterations", "time", "false_color", "cache_out"].iter().all(|k| plain.get(*k).is_none()), "{plain}");
    assert!(Picture::read_exr(&dir.join("b.exr")).unwrap().layer("denoised").is_none());
    assert!(!dir.join("b.factor1.png").exists());
    let unguided = ["--rrs", "ears", "--spp", "2", "--guiding", "off", "--false-color", "--json", "-o", "g.exr"];
    assert_eq!(json(&render(dir, &unguided))["false_color"].as_array().unwrap().len(), 6);
    assert!(!dir.join("g.guide.png").exists());
    assert!(Picture::read_exr(&dir.join("b.exr")).unwrap().layer("guide").is_none());

    let noisy = ["--spp", "4", "--json"];
    json(&render(dir, &[&noisy[..], &["-o", "noisy.exr"]].concat()));
    json(&render(dir, &[&noisy[..], &["-o", "clean.exr", "--denoise"]].concat()));
    let read = |name: &str| std::fs::read(dir.join(name)).unwrap();
    assert_ne!(read("noisy.png"), read("clean.png"));
    let rgb = |name: &str| Picture::read_exr(&dir.join(name)).unwrap().rgb("").unwrap();
    assert_eq!(rgb("noisy.exr"), rgb("clean.exr"));

    let words = text(&render(dir, &["--rrs", "ears", "--spp", "4", "--stats", "-o", "w.exr"]).stdout);
    let learned = ["looking up (approximate)", "recording samples (approximate)", "building the tree"];
    for part in ["paths per sample", "factor at first hit", "efficiency"].iter().chain(&learned) {
        assert!(words.contains(part), "{words}");
    }
    let crowded =
        ["--rrs", "ears", "--spp", "200", "--learn-samples", "64", "--stats", "--cache-bytes", "25KiB", "-o", "w.exr"];
    let words = text(&render(dir, &crowded).stdout);
    assert!(words.contains(" subdivisions refused so far for lack of memory"), "{words}");
}

/// Killed by: a flag that is read and forgotten, or taken for another.
#[test]
fn every_flag_changes_the_picture() {
    let dir = tempfile::tempdir().unwrap();
    // enough samples that the small cache is too small
    let flags: [&[&str]; 18] = [
        &[],
        &["--adaptive"],
        &["--shadow-roulette=false"],
        &["--control-variate", "cached"],
        &["--control-variate", "0.25"],
        &["--objective", "absolute"],
        &["--norm", "luminance"],
        &["--norm", "max"],
        &["--cache-bytes", "25KiB"],
        // which splits more
        &["--guiding", "on"],
        &["--ring", "16", "--guiding", "on"],
        &["--split-budget", "0"],
        &["--ledger", "16"],
        // what is guided is learned from more often
        &["--learn-samples", "1", "--guiding", "off"],
        &["--subdivide-count", "1000"],
        &["--decay", "0"],
        &["--factors", "1:1"],
        &["--pixel-estimator", "blocks"],
    ];
    let mut found = Vec::new();
    let pictures = flags.map(|flags| {
        let more = ["--rrs", "ears", "--spp", "300", "-o", "f.exr", "--stats", "--json"];
        // with so few pixels there are too few samples to learn from otherwise
        let samples: &[&str] = if flags.contains(&"--learn-samples") { &[] } else { &["--learn-samples", "16"] };
        found.push(json(&render(dir.path(), &[&more, samples, flags].concat())));
        Picture::read_exr(&dir.path().join("f.exr")).unwrap().rgb("").unwrap()
    });
    let of = |flag: &str| &found[flags.iter().position(|f| f.first() == Some(&flag)).unwrap()];
    let counter = |json: &serde_json::Value, name: &str| json["counters"][name].as_u64().unwrap();
    let learning = |json: &serde_json::Value| json["plan"]["learning_bytes"].as_u64().unwrap();
    let leaves =
        |json: &serde_json::Value| json["iterations"].as_array().unwrap().last().unwrap()["leaves"].as_u64().unwrap();
    let base = &found[0];
    let (guided, ring) = (of("--guiding"), of("--ring"));
    assert!(counter(guided, "ring_peak") > 16 && counter(base, "splits") > 1000, "{guided} {base}");
    assert_eq!((counter(base, "ledger_full"), counter(base, "splits_limited_by_budget")), (0, 0), "{base}");
    assert!(
        counter(ring, "ring_peak") <= 16
            && counter(ring, "splits_limited_by_ring") > counter(guided, "splits_limited_by_ring"),
        "{ring}"
    );
    let budget = of("--split-budget");
    assert!(counter(budget, "splits") == 0 && counter(budget, "splits_limited_by_budget") > 1000, "{budget}");
    let ledger = of("--ledger");
    assert!(counter(ledger, "ledger_full") > 1000, "{ledger}");
    // 68 bytes a record and 36 for path guiding, in two shards
    assert_eq!((learning(base) - learning(ledger)) / (2 * (2048 - 16)), 68 + 36, "{ledger}");
    let samples = of("--learn-samples");
    assert!(counter(samples, "samples_logged") < counter(base, "samples_logged") / 2, "{samples}");
    assert!(leaves(of("--subdivide-count")) > 2 * leaves(base));
    // the samples of the last iteration alone are too few to subdivide as much
    assert!(2 * leaves(of("--decay")) < leaves(base));
    let idle = of("--factors");
    assert!(
        counter(idle, "splits") == 0 && counter(idle, "paths_terminated") < counter(base, "paths_terminated") / 10,
        "{idle}"
    );
    // 140 bytes a pixel, or 12 for 64
    let blocks = of("--pixel-estimator");
    assert!((100..200).contains(&((learning(base) - learning(blocks)) / (24 * 20))), "{blocks}");
    let cache = of("--cache-bytes");
    assert!(learning(base) - learning(cache) > 23 << 20, "{cache}");
    for i in 0..pictures.len() {
        for j in 0..i {
            assert!(pictures[i] != pictures[j], "{:?} and {:?}", flags[i], flags[j]);
        }
    }
}

/// Killed by: flags that are not there together, memory that is planned for other choices than the render's.
#[test]
fn all_that_is_learned_fits_in_256_kib() {
    let dir = tempfile::tempdir().unwrap();
    let small =
        ["--shards", "1", "--ring", "128", "--cache-bytes", "152KiB", "--ledger", "256", "--pixel-estimator", "blocks"];
    let size = ["--size", "96x80", "--rrs", "ears"];
    let run =
        |command: &str, more: &[&str]| croupier(dir.path(), &[&[command, "cornell"], &small[..], &size, more].concat());
    let found = json(&run("render", &["--spp", "32", "--threads", "1", "--json"]));
    let plan = &found["plan"];
    let bytes = |name: &str| plan[name].as_u64().unwrap();
    assert_eq!(bytes("shards"), 1);
    assert!((150 << 10..256 << 10).contains(&bytes("learning_bytes")), "{plan}");
    let counter = |name: &str| found["counters"][name].as_u64().unwrap();
    assert!(counter("splits") > 1000 && counter("samples_logged") > 10_000 && counter("ring_peak") <= 128, "{found}");
    let picture = Picture::read_exr(&dir.path().join("croupier.exr")).unwrap().rgb("").unwrap();
    let mean = |i: usize| picture.pixels.iter().map(|p| f64::from(p[i])).sum::<f64>() / (96.0 * 80.0);
    assert!((0..3).all(|i| (0.01..10.0).contains(&mean(i))));

    // known before rendering, and as text
    assert_eq!(json(&run("info", &["--json"]))["plan"], *plan);
    let said = format!(
        "{} bytes shared + 1 shards of {} bytes, of which {} bytes for learning",
        bytes("shared_bytes"),
        bytes("shard_bytes"),
        bytes("learning_bytes")
    );
    for out in [run("info", &[]), run("render", &["--spp", "1", "--stats"])] {
        assert!(text(&out.stdout).contains(&said), "{said}: {}", text(&out.stdout));
    }
    // nothing is learned
    let plain = json(&croupier(dir.path(), &["info", "cornell", "--rrs", "classic", "--json"]));
    assert_eq!(plain["plan"]["learning_bytes"], 0);
}

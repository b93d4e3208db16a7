//! Learned statistics as part of a session: saved and loaded, decayed, counted, of another scene, in little memory, and
//! with numbers that are not finite.

use croupier::unstable::film::PixelStats;
use croupier::unstable::learn::cache::{BIN_LIMIT, CacheError, CacheSize};
use croupier::unstable::learn::{ControlVariate, Learning, Objective, PixelEstimator};
use croupier::unstable::rrs::Norm;
use croupier::{Counters, Plan, Settings, SettingsError, Strategy};
use croupier_host::description::*;
use croupier_tests::cache::{FIELDS, Oracle, Sums, overwrite};
use croupier_tests::runner::{Learned, Schedule, learning, render, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::equivalent;

const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);

fn learns(scene: &[u8], strategy: &str, max_depth: u32) -> Settings {
    let s = settings(scene, strategy);
    let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 500.0, ..s.learning };
    Settings { max_depth, learning, ..s }
}

/// Bytes of the statistics of a few iterations.
fn taught(scene: &[u8], s: &Settings, iterations: &[u32]) -> Vec<u8> {
    let mut bytes = None;
    let iterations = [iterations, &[0]].concat();
    learning(scene, s, &iterations, IN_ORDER, &mut |_, l: &mut dyn Learned| bytes = l.saved());
    bytes.unwrap()
}

/// A cache that is saved and loaded between two iterations gives the same factors: the picture has the same bits.
/// Killed by: a sum that is not saved, sums of subdivided leaves that are distributed again, look-ups that depend on
/// the numbers of leaves.
#[test]
fn loading_what_was_saved_changes_nothing() {
    for scene in [blob(&cornell([24, 16])), blob(&everything([24, 16]))] {
        for strategy in ["ears", "adrrs"] {
            let s = Settings { shards: 2, shadow_roulette: true, ..learns(&scene, strategy, 6) };
            let run = |load: bool| {
                let mut leaves = 0;
                let image = learning(&scene, &s, &[64, 64, 8, 8], IN_ORDER, &mut |_, l: &mut dyn Learned| {
                    let bytes = l.saved().unwrap();
                    leaves = Oracle::new(&bytes).leaves.len();
                    if load {
                        l.load(&bytes).unwrap();
                        assert!(l.saved().unwrap() == bytes);
                    }
                });
                (image, leaves)
            };
            let ((image, leaves), (loaded, _)) = (run(false), run(true));
            assert!(leaves > 15, "{strategy}: {leaves} leaves test nothing");
            assert!(image.bits() == loaded.bits() && image.counters == loaded.counters, "{strategy}");
        }
    }
}

/// Statistics loaded before the first iteration change its successors, and with them the picture. Killed by: a first
/// iteration that forgets them.
#[test]
fn loaded_statistics_are_used() {
    let scene = blob(&cornell([16, 16]));
    let s = Settings { max_depth: 6, ..learns(&scene, "ears", 6) };
    let bytes = taught(&scene, &s, &[16, 16]);
    let run = |load: bool| {
        learning(&scene, &s, &[1, 2], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if load && i == 0 {
                l.load(&bytes).unwrap();
            }
        })
    };
    let (without, with) = (run(false), run(true));
    assert!(without.bits() != with.bits());
}

/// Counts of the cache are those of the counters, and the part that an iteration keeps is `decay`. Killed by: samples
/// that are counted and not logged, shards left out, statistics that decay once per shard.
#[test]
fn counts_agree_and_decay() {
    let scene = blob(&cornell([16, 16]));
    for shards in [1, 3] {
        let decay = 0.75;
        let mut s = Settings { shards, ..learns(&scene, "ears", 6) };
        s.learning.decay = decay as f32;
        let mut seen = Vec::new();
        learning(&scene, &s, &[8, 4, 16, 0, 0], IN_ORDER, &mut |_, l: &mut dyn Learned| {
            let c = l.counters();
            seen.push((Oracle::new(&l.saved().unwrap()).total(0), c.samples_logged - c.samples_refused));
        });
        let (mut expected, mut before) = (0.0, 0);
        for (i, (count, logged)) in seen.into_iter().enumerate() {
            if i > 0 {
                expected = decay * expected + (logged - before) as f64;
            }
            before = logged;
            assert!((count - expected).abs() <= 1e-9 * expected, "after {i} iterations: {count} for {expected}");
            assert!(i == 0 || count > 1000.0);
        }
    }
}

/// A bin takes so many samples of a shard in an iteration and no more; the others are counted. Killed by: a limit that
/// looks at anything but the count, refusals that are not counted.
#[test]
fn full_bins_refuse_and_count() {
    let scene = blob(&cornell([16, 16]));
    let mut s = learns(&scene, "ears", 3);
    s.learning.cache_bytes = 20_000;
    // so that first vertices are logged in the first iteration
    s.learning.objective = Objective::Absolute;
    s.learning.samples = u32::MAX;
    let limit = f64::from(BIN_LIMIT);
    let mut seen = Vec::new();
    learning(&scene, &s, &[600, 0], IN_ORDER, &mut |_, l: &mut dyn Learned| {
        let counts: Vec<f64> = Oracle::new(&l.saved().unwrap()).leaves.iter().flatten().map(|b| b[0]).collect();
        seen.push((counts, l.counters()));
    });
    let (counts, c) = &seen[1];
    assert!(counts.iter().all(|n| *n <= limit) && counts.contains(&limit), "{counts:?}");
    assert!(c.samples_refused > 10_000);
    assert_eq!(counts.iter().sum::<f64>(), (c.samples_logged - c.samples_refused) as f64);
}

/// Of 16 samples of a pixel the first 3 give the statistics of 3 samples, and all of them make the picture. Killed by:
/// a limit that is not looked at, one too many or too few, the last samples instead of the first, pictures without the
/// others.
#[test]
fn the_first_samples_of_a_pixel_are_learned_from() {
    let scene = blob(&cornell([16, 16]));
    let mut s = learns(&scene, "ears", 4);
    s.learning.objective = Objective::Absolute;
    let mut run = |samples: u32, spp: u32| {
        s.learning.samples = samples;
        let mut saved = Vec::new();
        let image = learning(&scene, &s, &[spp, 0], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if i == 1 {
                saved = l.saved().unwrap();
            }
        });
        (saved, image.counters.samples_logged, image.counters.camera_samples)
    };
    let (some, logged, paths) = run(3, 16);
    let (few, of_few, _) = run(u32::MAX, 3);
    let (_, of_all, all) = run(u32::MAX, 16);
    assert!(logged == of_few && of_all > 4 * logged, "{logged} of {of_all}, {of_few} of 3 samples");
    // in another order
    let bins = |bytes: &[u8]| Oracle::new(bytes).leaves.into_iter().flatten().flatten().collect::<Vec<f64>>();
    let (some, few) = (bins(&some), bins(&few));
    assert!(some.len() == few.len() && some.iter().any(|x| *x > 10.0));
    for (a, b) in some.iter().zip(&few) {
        assert!((a - b).abs() <= 1e-5 * b.abs(), "{a} for {b}");
    }
    assert_eq!(paths, all);
}

/// A bright emitter behind a wall, and one before the open side of the box: roulette terminates most shadow rays after
/// the first iteration where they are always occluded, and few where they are not. Both pictures agree with those
/// without this roulette. Killed by: visibility that is not learned, that is learned for the vertices' own directions,
/// that counts terminated rays as occluded, that is not used; next event estimation that is used whatever it
/// contributes.
#[test]
fn occluded_lights_get_few_shadow_rays() {
    // the box is open in front
    let [hidden, open] = [[3.0, 0.0, 0.0], [0.0, 0.0, 3.0]].map(|position| {
        let mut s = cornell([16, 16]);
        s.emitters.push(Emitter::Point { position, intensity: [300.0; 3] });
        let scene = blob(&s);
        let mut seen = Vec::new();
        let s = Settings { shadow_roulette: true, ..learns(&scene, "ears", 4) };
        let image =
            learning(&scene, &s, &[16, 64, 256, 0], IN_ORDER, &mut |_, l: &mut dyn Learned| seen.push(l.counters()));
        let full = render(&scene, &Settings { shadow_roulette: false, seed: 1, ..s }, 400);
        let ratio = image.mean() / full.mean();
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        let of = |f: fn(&Counters) -> u64| (f(&seen[3]) - f(&seen[1])) as f64;
        [
            of(|c| c.shadow_rays) / of(|c| c.shadow_rays + c.shadow_rays_terminated),
            of(|c| c.light_samples_skipped) / of(|c| c.vertex_samples),
        ]
    });
    println!("behind the wall {hidden:?}, in front of the box {open:?} of shadow rays traced, of light samples spared");
    assert!(hidden[0] < 0.4 && open[0] > 0.8 && hidden[1] > 0.2 && open[1] < 0.1, "{hidden:?} {open:?}");
}

/// A cache from renders without roulette for next event estimation, most of it towards an occluded emitter, holds what
/// it contributes: roulette skips as much as with a cache from renders with it. Killed by: next event estimation that
/// is learned only if it plays roulette.
#[test]
fn nee_is_learned_with_and_without_its_roulette() {
    let mut s = cornell([16, 16]);
    s.emitters.push(Emitter::Point { position: [3.0, 0.0, 0.0], intensity: [300.0; 3] });
    let scene = blob(&s);
    let spared = |shadow_roulette: bool| {
        let s = Settings { shadow_roulette: true, ..learns(&scene, "ears", 4) };
        let bytes = taught(&scene, &Settings { shadow_roulette, ..s }, &[16, 64, 64]);
        let mut seen = Vec::new();
        learning(&scene, &s, &[16, 64, 0], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            seen.push(l.counters());
            if i == 1 {
                l.load(&bytes).unwrap();
            }
        });
        let of = |f: fn(&Counters) -> u64| (f(&seen[2]) - f(&seen[1])) as f64;
        of(|c| c.light_samples_skipped) / of(|c| c.vertex_samples)
    };
    let (off, on) = (spared(false), spared(true));
    println!("{off} and {on} of the light samples spared");
    assert!(on > 0.1 && (off / on - 1.0).abs() < 0.2, "{off} {on}");
}

/// Statistics of other bounds are refused with the number that differs, and nothing has changed. Statistics of another
/// scene with the same bounds are taken: they change the noise, no mean (`learn_unbiased.rs` loads random ones). Killed
/// by: bounds that are not looked at, a cache that is emptied before the bytes are checked.
#[test]
fn statistics_of_another_scene_are_refused() {
    let scene = blob(&cornell([16, 16]));
    let mut wide = cornell([16, 16]);
    let grey_wall = wide.add_material("far", grey(0.5));
    add_quad(&mut wide, "far", grey_wall, facing_z(1.0, -3.0, 1.0));
    let wide = blob(&wide);
    let foreign = taught(&wide, &learns(&wide, "ears", 5), &[8]);
    let s = learns(&scene, "ears", 5);
    let run = |load: bool| {
        learning(&scene, &s, &[8, 8], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if load && i == 1 {
                let before = l.saved();
                assert!(matches!(l.load(&foreign), Err(CacheError::Bounds { .. })));
                assert!(l.saved() == before);
            }
        })
    };
    assert!(run(true).bits() == run(false).bits());
}

/// Values of first vertices are in units of their pixel or not, as the objective requires: statistics state which, and
/// a session with the other refuses them. What else differs is no reason to. Killed by: a cache that is told a fixed
/// objective.
#[test]
fn statistics_of_another_objective_are_refused() {
    let scene = blob(&cornell([16, 16]));
    let relative = learns(&scene, "ears", 5);
    let of = |objective| Settings { learning: Learning { objective, ..relative.learning }, ..relative };
    let absolute = of(Objective::Absolute);
    let norm = Settings { learning: Learning { norm: Norm::Max, ..absolute.learning }, max_depth: 3, ..absolute };
    for (from, to, fits) in [(relative, absolute, false), (absolute, relative, false), (absolute, norm, true)] {
        let bytes = taught(&scene, &from, &[8]);
        learning(&scene, &to, &[1], IN_ORDER, &mut |_, l: &mut dyn Learned| {
            let refused =
                CacheError::Objective { expected: to.learning.objective, found: from.learning.objective as u32 };
            assert_eq!(l.load(&bytes), if fits { Ok(()) } else { Err(refused) });
        });
    }
}

/// Statistics over the picture are of no use to another session: they are not offered. Killed by: bytes that say they
/// are a tree and are none.
#[test]
fn statistics_of_the_picture_are_not_saved() {
    let scene = blob(&cornell([16, 16]));
    for (strategy, there) in [("bolin-meyer", false), ("none", false), ("classic:5:relative", false), ("ear", true)] {
        let s = learns(&scene, strategy, 4);
        learning(&scene, &s, &[4, 4], IN_ORDER, &mut |_, l: &mut dyn Learned| {
            assert_eq!(l.saved().is_some(), there, "{strategy}");
        });
    }
}

/// Radiance that overflows in f32: the film leaves it out, and so do the statistics, whose sums stay finite. Killed by:
/// a value that is logged before it is looked at, an infinity whose pair is a NaN.
#[test]
fn overflowing_radiance_is_not_learned() {
    let mut s =
        SceneDescription { camera: camera([0.0, 0.3, 0.4], [0.0; 3], 0.01, [12, 8]), ..SceneDescription::default() };
    let floor = s.add_material("floor", grey(0.8));
    let reflectance = Reflectance::Constant([1.0; 3]);
    let metal = s.add_material("metal", Model::RoughConductor { eta: [0.2; 3], k: [3.0; 3], reflectance, alpha: 1e-4 });
    let half = |x: f32| [[x - 1.0, 0.0, 1.0], [x, 0.0, 1.0], [x, 0.0, -1.0], [x - 1.0, 0.0, -1.0]];
    add_quad(&mut s, "left", floor, half(0.0));
    add_quad(&mut s, "right", metal, half(1.0));
    let scale = 2f32.powi(-24);
    place(&mut s, scale, 0.0);
    s.emitters.push(Emitter::Point { position: [0.0, 0.6 * scale, -0.8 * scale], intensity: [1e18, 1.0, 0.0] });
    let scene = blob(&s);
    for (strategy, control_variate) in
        [("ears", ControlVariate::Cached), ("ears:plain", ControlVariate::Off), ("adrrs", ControlVariate::Cached)]
    {
        let s = Settings { control_variate, shadow_roulette: true, adaptive: true, ..learns(&scene, strategy, 3) };
        let mut last = None;
        let image = learning(&scene, &s, &[16, 16, 16, 0], IN_ORDER, &mut |_, l: &mut dyn Learned| {
            let bytes = l.saved().unwrap();
            let sums = Oracle::new(&bytes);
            assert!(sums.leaves.iter().flatten().flatten().all(|x| x.is_finite() && *x >= 0.0), "{strategy}");
            // as if it came from a file, which is checked
            l.load(&bytes).unwrap();
            last = Some((sums.total(0), l.statistics()));
        });
        let (count, statistics) = last.unwrap();
        assert!(image.counters.non_finite > 100 && count > 100.0, "{strategy}: {:?}", image.counters);
        assert!(statistics.iter().all(|p| p.variance.is_finite() && p.cost.is_finite()), "{statistics:?}");
        assert!(image.pixels.iter().all(|p| p.sum.iter().chain(&p.spread).all(|x| x.is_finite())));
    }
}

/// Statistics as large as bytes may say, all of them, in every bin. Killed by: an overflow on the way to a factor.
#[test]
fn extreme_statistics_do_no_harm() {
    let scene = blob(&everything([16, 12]));
    let only = |fields: &[usize], x: f64| std::array::from_fn(|k| if fields.contains(&k) { x } else { 0.0 });
    let [hidden, mut bright]: [Sums; 2] = [only(&[0, 3, 6, 12], 1e100), only(&[0, 3, 6, 13], 1e100)];
    bright[12] = 1e-300;
    let lit = only(&[0, 3, 6, 14], 1e100);
    for sums in [[1e100; FIELDS], [0.0; FIELDS], [1e-300; FIELDS], only(&[0, 3, 6], 1e100), hidden, bright, lit] {
        for control_variate in [ControlVariate::Off, ControlVariate::Cached] {
            let s = Settings { control_variate, shadow_roulette: true, ..learns(&scene, "ears:plain", 4) };
            let image = learning(&scene, &s, &[1, 1, 1], IN_ORDER, &mut |_, l: &mut dyn Learned| {
                let mut bytes = l.saved().unwrap();
                overwrite(&mut bytes, || sums);
                l.load(&bytes).unwrap();
            });
            assert_eq!(image.counters.camera_samples, 3 * 16 * 12);
            assert!(image.mean().is_finite() && image.mean() > 0.05, "{sums:?}: {}", image.mean());
            // a control variate of 1e16 is a factor's worth of noise, not an infinity
            assert!(control_variate == ControlVariate::Cached || image.counters.non_finite == 0, "{sums:?}");
        }
    }
}

/// Everything at once in 256 KiB besides the film, and the mean is right. Killed by: a slab that is too small for its
/// index, a cache that needs more than it was given.
#[test]
fn everything_fits_in_little_memory() {
    let scene = blob(&cornell([32, 32]));
    let mut s = learns(&scene, "ears", 6);
    (s.adaptive, s.shadow_roulette, s.control_variate, s.ring) = (true, true, ControlVariate::Cached, 128);
    let small = Learning { cache_bytes: 96 << 10, ledger: 256, pixel_estimator: PixelEstimator::Blocks, ..s.learning };
    let s = Settings { learning: small, ..s };
    let plan = Plan::new(&s).unwrap();
    let pixels = 32 * 32;
    // a shard has its own sums of its pixels, 64 bytes
    let film = pixels * (size_of::<PixelStats>() + 64);
    let rest = plan.session().size + plan.shard().size - film;
    println!("{rest} bytes");
    assert!(rest <= 256 << 10, "{rest} bytes besides the film");
    assert!(s.learning.cache_bytes < rest);
    let image = scheduled(&scene, &s, &[8, 8, 16, 32, 64, 128, 256, 256, 256, 256, 256, 256], IN_ORDER);
    let none = render(
        &scene,
        &Settings { strategy: Strategy::parse("none").unwrap(), seed: 9, ..learns(&scene, "none", 6) },
        3000,
    );
    let (d, error) =
        (image.mean() / none.mean() - 1.0, image.error_of_mean().hypot(none.error_of_mean()) / none.mean());
    println!("{:+.4} % +- {:.4} %", 100.0 * d, 100.0 * error);
    assert!(error < 0.0006 && equivalent(d, error, 0.002, 0.05), "{d} +- {error}");
    assert!(image.counters.samples_logged > 100_000);
}

/// Adaptive sampling allocates as many samples as were asked for, in pictures whose tiles differ in size and much in
/// error. Killed by: shares that are bounded after they were made to add up, a least sample of each pixel that comes on
/// top.
#[test]
fn adaptive_samples_are_as_many_as_were_asked_for() {
    let mut scene = mirror_and_glass();
    scene.camera.size = [67, 45];
    let scene = blob(&scene);
    for strategy in ["ears", "none"] {
        let s = Settings { adaptive: true, ..learns(&scene, strategy, 5) };
        let pixels = u64::from(s.size[0] * s.size[1]);
        let (mut before, mut differ) = (0, false);
        let iterations = [4, 1, 2, 3, 16, 100, 0];
        learning(&scene, &s, &iterations, IN_ORDER, &mut |i, l: &mut dyn Learned| {
            let n = l.counters().camera_samples - before;
            before += n;
            let asked = if i == 0 { 0 } else { u64::from(iterations[i - 1]) * pixels };
            // what is rounded is at most one sample for each pixel of the last tile
            assert!(n.abs_diff(asked) <= 64, "{strategy}, iteration {i}: {n} of {asked} samples");
            let counts: Vec<u64> = l.pixels().iter().map(|p| p.samples).collect();
            differ |= counts.iter().any(|n| *n > 3 * counts[0] || 3 * *n < counts[0]);
        });
        assert!(differ, "{strategy}");
    }
}

/// Killed by: a choice that is not checked, or checked where it does not matter.
#[test]
fn choices_that_make_no_sense_are_refused() {
    let scene = blob(&cornell([16, 16]));
    let with = |strategy: &str, change: &dyn Fn(&mut Settings)| {
        let mut s = learns(&scene, strategy, 4);
        change(&mut s);
        Plan::new(&s).err()
    };
    let l = Learning::default();
    let out_of_range = |strategy: &str, change: &dyn Fn(&mut Settings), name: &str| match with(strategy, change) {
        Some(SettingsError::Range { setting, .. }) => assert_eq!(setting.name, name),
        other => panic!("{name}: {other:?}"),
    };
    for (learning, name) in [
        (Learning { ledger: 0, ..l }, "ledger"),
        (Learning { samples: 0, ..l }, "learn-samples"),
        (Learning { ledger: (1 << 24) + 1, ..l }, "ledger"),
        (Learning { subdivide_count: 0.0, ..l }, "subdivide-count"),
        (Learning { decay: -0.1, ..l }, "decay"),
        (Learning { decay: 1.1, ..l }, "decay"),
        (Learning { factors: [0.04, 20.0], ..l }, "factors"),
        (Learning { factors: [0.05, 21.0], ..l }, "factors"),
        (Learning { factors: [1.1, 2.0], ..l }, "factors"),
        (Learning { factors: [0.5, 0.9], ..l }, "factors"),
        (Learning { subdivide_count: f32::NAN, ..l }, "subdivide-count"),
        (Learning { decay: f32::NAN, ..l }, "decay"),
        (Learning { factors: [f32::NAN, 1.0], ..l }, "factors"),
    ] {
        for strategy in ["ears", "classic"] {
            out_of_range(strategy, &|s| s.learning = learning, name);
        }
    }
    let nobody = Strategy::Fixed(croupier::unstable::rrs::Fixed { factor: f32::NAN });
    out_of_range("classic", &|s| s.strategy = nobody, "rrs");
    let needed = CacheSize::SMALLEST.bytes(1).unwrap();
    let few = SettingsError::Cache { needed, given: needed - 1 };
    assert_eq!(with("ears", &|s| s.learning.cache_bytes = needed - 1), Some(few));
    assert!(few.to_string().contains(&needed.to_string()));
    assert_eq!(with("ears", &|s| s.learning.cache_bytes = needed), None);
    assert_eq!(with("classic", &|s| s.learning.cache_bytes = 0), None);
    for strategy in ["classic", "bolin-meyer", "fixed:2"] {
        assert_eq!(
            with(strategy, &|s| s.control_variate = ControlVariate::Cached),
            Some(SettingsError::ControlVariate),
            "{strategy}"
        );
        assert_eq!(with(strategy, &|s| s.control_variate = ControlVariate::Number(-1.0)), None);
    }
    for number in [f32::INFINITY, f32::NAN] {
        out_of_range("ears", &|s| s.control_variate = ControlVariate::Number(number), "control-variate");
    }
}

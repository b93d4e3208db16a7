//! Input and output of renders that learn: saved statistics, denoised pictures, figures.

use croupier::unstable::cost::COST_SHADOW;
use croupier::unstable::denoise::{Planes, scratch_len};
use croupier::unstable::learn::cache::CacheSize;
use croupier::unstable::learn::{ControlVariate, Guiding, Learning, Objective};
use croupier::unstable::rrs::Norm;
use croupier::{Scene, Settings, Strategy};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::drive::{DriveError, Options, Unobserved, drive};
use croupier_host::image::Picture;
use croupier_host::render::{Observer, Progress, RenderOptions, RenderResult, Target, render};
use croupier_tests::scenes::{blob, everything};
use std::sync::OnceLock;

/// The program's own scene, small.
fn scene() -> &'static [u8] {
    static SCENE: OnceLock<croupier_host::blob::AlignedBytes> = OnceLock::new();
    SCENE.get_or_init(|| {
        let mut scene = builtin::cornell_box();
        scene.camera.size = [48, 40];
        bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap().bytes
    })
}

fn options(strategy: &str, spp: u32) -> RenderOptions {
    let o = RenderOptions::new(Strategy::parse(strategy).unwrap());
    let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 1000.0, ..o.settings.learning };
    let settings = Settings { shards: 2, learning, ..o.settings };
    RenderOptions { settings, target: Target::Spp(spp), threads: 1, ..o }
}

/// The options with other settings.
fn with(mut options: RenderOptions, change: impl Fn(&mut Settings)) -> RenderOptions {
    change(&mut options.settings);
    options
}

/// Size of a cache that cannot subdivide, bytes.
fn smallest() -> usize {
    CacheSize::SMALLEST.bytes(2).unwrap()
}

/// Observer that stops the render at once, or never.
struct Stop(bool);

impl Observer for Stop {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        self.0
    }
}

fn rendered(options: &RenderOptions) -> RenderResult {
    render(scene(), options, &Stop(false)).unwrap()
}

fn plane<'a>(p: &'a Picture, layer: &str) -> &'a [f32] {
    &p.layer(layer).unwrap_or_else(|| panic!("no layer {layer}")).channels[0].values
}

fn mean(values: impl Iterator<Item = f32>) -> f64 {
    let (sum, n) = values.fold((0.0, 0u32), |(sum, n), x| (sum + f64::from(x), n + 1));
    sum / f64::from(n.max(1))
}

/// Killed by: a cache that is saved before the last iteration or not loaded, another one loaded, one that is lost when
/// the observer stops the render.
#[test]
fn statistics_are_saved_and_begun_with() {
    let save = RenderOptions { save_cache: true, ..options("ears", 12) };
    let first = rendered(&save);
    let bytes = first.cache.clone().unwrap();
    assert_eq!(first.statistics.iterations.last().unwrap().leaves.map(|n| n as usize * 1536 < bytes.len()), Some(true));
    assert!(bytes.len() > 20_000 && bytes.starts_with(b"CRPCACHE"));
    assert_eq!(rendered(&save).cache.unwrap(), bytes);
    assert_eq!(rendered(&options("ears", 12)).cache, None);

    let begin = RenderOptions { cache: Some(bytes.clone()), ..save.clone() };
    let second = rendered(&begin);
    let leaves = |r: &RenderResult| r.statistics.iterations[0].leaves.unwrap();
    assert!(leaves(&second) > leaves(&first) && second.picture != first.picture);
    assert_eq!(rendered(&begin).picture, second.picture);

    let stopped = render(scene(), &RenderOptions { target: Target::Seconds(1e5), ..begin }, &Stop(true)).unwrap();
    assert!(stopped.stopped_early && stopped.cache.unwrap().starts_with(b"CRPCACHE"));
    assert_eq!(stopped.statistics.iterations.len(), 1);
}

/// Killed by: rendering with bytes that are no cache or another scene's, without a word; ignoring that there is no
/// cache.
#[test]
fn wrong_statistics_are_errors() {
    let good = rendered(&RenderOptions { save_cache: true, ..options("ears", 12) }).cache.unwrap();
    let refused = |scene: &[u8], options: &RenderOptions| render(scene, options, &Stop(false)).expect_err("an error");
    let begun = |cache: &[u8]| RenderOptions { cache: Some(cache.to_vec()), ..options("ears", 2) };
    let mut flipped = good.clone();
    flipped[1000] ^= 1;
    for (bytes, said) in [
        (&b""[..], "have 64 bytes, 0 given"),
        (b"no cache", "have 64 bytes, 8 given"),
        (scene(), "no saved statistics"),
        (&good[..good.len() - 1], "bytes"),
        (&flipped, "hash"),
    ] {
        let e = refused(scene(), &begun(bytes));
        assert!(matches!(e, DriveError::Cache(_)), "{e}");
        assert!(e.to_string().contains(said), "{e} does not say {said:?}");
    }
    let e = refused(&blob(&everything([24, 16])), &begun(&good));
    assert!(e.to_string().starts_with("statistics of another scene"), "{e}");
    let e = refused(scene(), &with(begun(&good), |s| s.learning.cache_bytes = smallest()));
    assert!(e.to_string().contains("there is room for"), "{e}");
    // bolin-meyer learns, but from the picture
    for strategy in ["classic", "none", "bolin-meyer"] {
        for o in [begun(&good), RenderOptions { save_cache: true, ..options(strategy, 2) }] {
            // a guide would be saved alone
            let learns_nothing = |s: &mut Settings| {
                s.strategy = Strategy::parse(strategy).unwrap();
                s.learning.guiding = Guiding::Off;
            };
            let e = refused(scene(), &with(o, learns_nothing));
            assert!(matches!(e, DriveError::NoCache(_)) && e.to_string().contains(strategy), "{e}");
        }
    }
    let e = refused(scene(), &with(options("classic", 2), |s| s.control_variate = ControlVariate::Cached));
    assert!(matches!(e, DriveError::Settings(_)) && e.to_string().contains("ears"), "{e}");
}

/// Killed by: an option that does not reach the core's settings.
#[test]
fn every_option_changes_the_picture() {
    let base = options("ears", 6);
    let changed = |change: fn(&mut Settings)| with(base.clone(), change);
    let variants = [
        base.clone(),
        changed(|s| s.adaptive = true),
        changed(|s| s.shadow_roulette = false),
        changed(|s| s.control_variate = ControlVariate::Cached),
        changed(|s| s.control_variate = ControlVariate::Number(0.25)),
        changed(|s| s.learning.objective = Objective::Absolute),
        changed(|s| s.learning.norm = Norm::Max),
        changed(|s| s.learning.cache_bytes = smallest()),
    ];
    let pictures = variants.each_ref().map(|o| rendered(o).picture.rgb("").unwrap());
    for i in 0..pictures.len() {
        for j in 0..i {
            assert!(pictures[i] != pictures[j], "variants {i} and {j}");
        }
    }
}

/// Killed by: a denoised layer that is a copy or of another picture, features left out or wrong, a strategy for which
/// it is forgotten, a layer that is there unasked.
#[test]
fn denoised_pictures_are_nearer_the_truth() {
    let truth = rendered(&options("classic", 600)).picture.rgb("").unwrap();
    let error = |p: &croupier_host::image::Rgb| {
        let parts = p.pixels.iter().flatten().zip(truth.pixels.iter().flatten());
        mean(parts.map(|(x, t)| (x - t) * (x - t) / (t * t + 0.01)))
    };
    for strategy in ["classic", "none", "ears"] {
        let r = rendered(&RenderOptions { denoise: true, ..options(strategy, 8) });
        let [noisy, denoised] = ["", "denoised"].map(|l| r.picture.rgb(l).unwrap());
        assert!(error(&denoised) < 0.5 * error(&noisy), "{strategy}: {} {}", error(&denoised), error(&noisy));
        let [a, b] = [&noisy, &denoised].map(|p| mean(p.pixels.iter().flatten().copied()));
        assert!((a - b).abs() < 0.01 * a, "{strategy}: {a} {b}");
        let without = rendered(&options(strategy, 8));
        assert!(without.picture.layer("denoised").is_none());
        assert_eq!(without.picture.rgb("").unwrap(), noisy);
    }
}

/// Killed by: a denoiser without albedo and normals, or with those of other pixels.
#[test]
fn the_denoiser_knows_what_the_first_hits_look_like() {
    let o = RenderOptions { denoise: true, ..options("classic", 5) };
    let base = Settings::for_scene(&Scene::from_bytes(scene()).unwrap());
    let settings = Settings { aovs: true.into(), shards: o.settings.shards, ..base };
    let driven = drive(scene(), &Options { threads: 1, ..Options::new(settings, o.target) }, &Unobserved).unwrap();
    let size = driven.size;
    let mut memory = vec![0.0; Planes::len(size, true)];
    let mut planes = Planes::carve(size, true, &mut memory).unwrap();
    for (i, (p, a)) in driven.pixels.iter().zip(&driven.aovs).enumerate() {
        planes.set(i, p, Some(a));
    }
    planes.denoise(&mut vec![0.0; scratch_len(size)]).unwrap();
    let out = planes.out.map(|p| p.to_vec());
    let picture = rendered(&o).picture;
    let layer = picture.layer("denoised").unwrap();
    assert_eq!(["R", "G", "B"].map(|c| layer.channel(c).unwrap().to_vec()), out);
}

/// Figures against the counts that they are derived from. Killed by: paths over vertices instead of camera samples, a layer of the wrong
/// sums, the factor of another depth, an efficiency that is not the inverse product, parts of the time counted twice.
#[test]
fn figures_fit_together() {
    for (strategy, factor) in [("none", Some(1.0)), ("fixed:2", Some(2.0)), ("ears", None), ("bolin-meyer", None)] {
        let o = with(RenderOptions { calibrate: true, ..options(strategy, 10) }, |s| s.max_depth = 5);
        let RenderResult { picture, stats, statistics: s, .. } = rendered(&o);
        let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-5 * b.abs(), "{strategy}: {a} {b}");
        near(s.paths.spp, 10.0);
        near(mean(plane(&picture, "paths").iter().copied()), s.paths.paths_per_sample);
        assert!((1.0..=5.0).contains(&s.paths.path_length), "{s}");
        match factor {
            // every camera ray of the open box that hits something has it
            Some(f) => near(s.paths.first_factor.unwrap(), f),
            None => assert!(s.paths.first_factor.unwrap() != 1.0),
        }
        assert_eq!(strategy == "none", (s.paths.paths_per_sample - 1.0).abs() < 1e-9, "{s}");
        assert_eq!(s.iterations.iter().map(|i| i.samples).sum::<u32>(), 10);
        let cost: f64 = s.iterations.iter().map(|i| i.cost * f64::from(i.samples)).sum();
        let shadow_rays = stats.counters["shadow_rays"] as f64;
        // light paths are no part of a camera sample's cost
        let of_samples = (stats.rays - stats.counters["light_path_rays"]) as f64;
        near(cost * 48.0 * 40.0, of_samples - (1.0 - f64::from(COST_SHADOW)) * shadow_rays);
        let learns = factor.is_none();
        for i in &s.iterations {
            assert_eq!(i.variance.is_some(), learns);
            if let (Some(v), Some(e)) = (i.variance, i.efficiency) {
                near(v * i.cost * e, 1.0);
            }
            assert_eq!(i.leaves.is_some(), strategy == "ears");
        }
        assert!(s.iterations[0].relmse_estimate.is_none() && s.iterations[1].relmse_estimate.is_some());
        near(s.iterations.last().unwrap().relmse_estimate.unwrap(), stats.relmse_estimate.unwrap());
        let (within, whole): (Vec<_>, Vec<_>) = s.time.iter().partition(|p| p.within_tracing);
        assert_eq!(within.len(), if strategy == "ears" { 2 } else { 0 }, "{s}");
        let sum = |parts: &[&croupier_host::statistics::Part]| parts.iter().map(|p| p.share).sum::<f64>();
        assert!(sum(&whole) <= 1.0 && sum(&whole) > 0.5, "{s}");
        assert!(within.iter().all(|p| p.seconds > 0.0) && sum(&within) < 1.0, "{s}");
        // a look-up for every vertex at which roulette is played
        let counter = |name: &str| stats.counters[name];
        assert_eq!(counter("look_ups") > 0, learns);
        if learns {
            let played = counter("vertex_samples") - counter("splits") + counter("paths_terminated");
            assert_eq!(counter("look_ups"), played);
            assert!(counter("samples_logged") <= counter("vertex_samples"));
        }
        let text = s.to_string();
        assert!(text.contains("path length") && text.contains("estimating pixels"), "{text}");
        assert_eq!(text.contains("looking up"), strategy == "ears");
    }
    // these learn from the picture, not from the scene
    let picture_alone = [with(options("classic", 3), |s| s.adaptive = true), options("classic:2:relative", 3)];
    for o in picture_alone {
        let s = rendered(&o).statistics;
        assert!(s.iterations.iter().all(|i| i.variance > Some(0.0) && i.leaves.is_none()), "{s}");
    }
    let plain = rendered(&options("ears", 3)).statistics;
    assert!(plain.time.iter().all(|p| !p.within_tracing));
}

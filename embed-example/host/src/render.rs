//! From a scene blob to a picture with named layers and figures.

pub use crate::drive::{DriveError as RenderError, Observer, Progress, Target};

use crate::checkpoint::Schedule;
use crate::cryptomatte;
use crate::drive::{self, Options, Part, Rendered, drive_scene};
use crate::image::{Channel, Picture};
use crate::part::{Merged, Names};
use crate::statistics::Statistics;
use croupier::unstable::STACK_BYTES;
use croupier::unstable::denoise::{Planes, scratch_len};
use croupier::unstable::film::{Aov, PixelStats};
use croupier::unstable::learn::cache::CacheSize;
use croupier::unstable::learn::guiding::GuideSize;
use croupier::unstable::learn::{ControlVariate, Guiding, Learning};
use croupier::unstable::profile::AnyProfile;
use croupier::unstable::rrs;
use croupier::unstable::rrs::Ears;
use croupier::{Plan, Scene, Settings, SettingsError, Strategy};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// Options of a render, besides the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Settings of the core. What they leave open is the scene's own ([`Settings::with_scene`]).
    pub settings: Settings,
    /// Stop condition.
    pub target: Target,
    /// The part of a picture to be rendered; all of it if absent.
    pub part: Option<Part>,
    /// Threads; 0 is one per processor. The image does not depend on them.
    pub threads: usize,
    /// Saved cache to begin with. Needs a strategy that learns from the scene.
    pub cache: Option<Vec<u8>>,
    /// Return of the cache in the end. Needs a strategy that learns from the scene.
    pub save_cache: bool,
    /// Layer `denoised` besides the others.
    pub denoise: bool,
    /// Measurement of look-ups and of recording samples, for [`Statistics::time`].
    pub calibrate: bool,
    /// Layers of what path guiding has learned, where it is on.
    pub guide_view: bool,
    /// Checkpoints to write while the render runs.
    pub checkpoint: Option<Schedule>,
    /// Checkpoint of a render of the same scene and settings to go on from.
    pub resume: Option<PathBuf>,
}

impl RenderOptions {
    /// Defaults with this strategy: roulette of light samples, and path guiding where it pays, with those that are
    /// efficiency-aware ([`Strategy::is_efficiency_aware`]), 16 shards, all layers, 64 samples per pixel.
    pub fn new(strategy: Strategy) -> Self {
        let mut settings = Settings {
            strategy,
            shards: 16,
            aovs: true.into(),
            shadow_roulette: strategy.is_efficiency_aware(),
            ..Settings::default()
        };
        if strategy.is_efficiency_aware() {
            settings.learning.guiding = Guiding::Auto;
        }
        Self {
            settings,
            target: Target::Spp(64),
            part: None,
            threads: 0,
            cache: None,
            save_cache: false,
            denoise: false,
            calibrate: false,
            guide_view: false,
            checkpoint: None,
            resume: None,
        }
    }

    /// Takes as many shards as their statistics have room for, at most as many as there are. If there is no room for
    /// one, [`check`] says what one needs.
    pub fn fit_shards(&mut self) {
        let s = &mut self.settings;
        let learns = s.strategy.space().is_some();
        let fits = |shards: &u32| !learns || CacheSize::within(s.learning.cache_bytes, *shards).is_some();
        s.shards = (1..=s.shards).rev().find(fits).unwrap_or(1);
    }

    /// Gives path guiding where it pays a third of the bytes of the cache, at most those that it has; guides nothing if
    /// these are too few for so many shards.
    pub fn fit_guide(&mut self) {
        let Settings { shards, learning, .. } = &mut self.settings;
        if learning.guiding == Guiding::Auto {
            learning.guide_bytes = learning.guide_bytes.min(learning.cache_bytes / 3);
            if GuideSize::within(learning.guide_bytes, *shards).is_none() {
                learning.guiding = Guiding::Off;
            }
        }
    }
}

/// Settings for kernels that contain no path guiding, those with ray sources of their own: what would be guided where it
/// pays is not.
pub(crate) fn unguided(mut settings: Settings) -> Settings {
    if settings.learning.guiding == Guiding::Auto {
        settings.learning.guiding = Guiding::Off;
    }
    settings
}

/// With efficiency-aware roulette and splitting.
impl Default for RenderOptions {
    fn default() -> Self {
        Self::new(Strategy::Ears(Ears::default()))
    }
}

/// Figures of a finished render: work, speed, error.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RenderStats {
    /// Mean samples per pixel.
    pub spp: f64,
    /// Rays of all kinds.
    pub rays: u64,
    /// Wall-clock seconds of rendering.
    pub seconds: f64,
    /// Rays of all kinds per second, in millions.
    pub mrays_per_s: f64,
    /// Estimated relMSE of the whole image; `None` below two samples per pixel.
    pub relmse_estimate: Option<f64>,
    /// 95 % confidence interval of the estimated relMSE; `None` below two samples per pixel, and where the samples do not
    /// tell ([`croupier::ErrorEstimate::is_resolved`]).
    pub relmse_interval: Option<[f64; 2]>,
    /// What the relMSE is at least, where the samples do not tell it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relmse_at_least: Option<f64>,
    /// Figure of merit, 1 / (estimated relMSE x million rays) ([`croupier::ErrorEstimate::figure_of_merit`]): it tells
    /// renders of a scene from each other, on any machine and whatever their length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub figure_of_merit: Option<f64>,
    /// Share of the eight lanes that did work, 0 to 1, by stage.
    pub lane_utilisation: BTreeMap<&'static str, f64>,
    /// Counts of work and of limits that were met (full rings, contributions that are not finite, ...), by their names
    /// in [`croupier::Counters`].
    pub counters: BTreeMap<&'static str, u64>,
    /// Column and row of the pixel with the first contribution that was not finite, if there was one. Such contributions
    /// are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_non_finite: Option<[u32; 2]>,
}

/// A rendered picture.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderResult {
    /// Picture with all layers.
    pub picture: Picture,
    /// Figures of work, speed and error.
    pub stats: RenderStats,
    /// Figures of paths, iterations and time.
    pub statistics: Statistics,
    /// Memory of the render.
    pub plan: PlanSummary,
    /// Saved cache, if asked for.
    pub cache: Option<Vec<u8>>,
    /// Whether the observer ended the render before its target.
    pub stopped_early: bool,
    /// Error of the first checkpoint that could not be written.
    pub checkpoint_error: Option<String>,
}

/// Memory that a render of a scene takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanSummary {
    /// Name of the kernel profile that holds the scene's effects.
    pub profile: String,
    /// Bytes that all shards share.
    pub shared_bytes: u64,
    /// Bytes of each shard.
    pub shard_bytes: u64,
    /// Number of shards.
    pub shards: u32,
    /// Bytes among all these that learning needs.
    pub learning_bytes: u64,
    /// Bytes that grow with the picture, per pixel: of what the shards share, and of the shards together.
    pub bytes_per_pixel: [f64; 2],
    /// Stack that each thread needs for the core, bytes.
    pub stack_bytes: usize,
}

impl PlanSummary {
    fn new(scene: &Scene<'_>, settings: &Settings) -> Result<Self, SettingsError> {
        let plan = Plan::new(settings)?;
        let bytes = |p: &Plan| p.session().size as u64 + p.shard().size as u64 * u64::from(settings.shards);
        let without_learning = Settings {
            learning: Learning { guiding: Guiding::Off, ..settings.learning },
            strategy: Strategy::None(rrs::None),
            adaptive: false,
            shadow_roulette: false,
            control_variate: ControlVariate::Off,
            ..*settings
        };
        Ok(Self {
            profile: AnyProfile::smallest(scene.effects).name().into(),
            shared_bytes: plan.session().size as u64,
            shard_bytes: plan.shard().size as u64,
            shards: settings.shards,
            bytes_per_pixel: plan.bytes_per_pixel(),
            stack_bytes: STACK_BYTES,
            learning_bytes: bytes(&plan).saturating_sub(bytes(&Plan::new(&without_learning)?)),
        })
    }
}

/// The memory in words.
impl fmt::Display for PlanSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            shared_bytes, shards, shard_bytes, learning_bytes, bytes_per_pixel: [shared, own], stack_bytes, ..
        } = self;
        write!(
            f,
            "{shared_bytes} bytes shared + {shards} shards of {shard_bytes} bytes, of which {learning_bytes} bytes for learning; \
             {shared} + {own} bytes a pixel, {stack_bytes} bytes of stack a thread"
        )
    }
}

/// Checks what can be checked before a scene is loaded.
///
/// # Errors
/// Options that no scene can be rendered with.
pub fn check(options: &RenderOptions) -> Result<(), RenderError> {
    let mut settings = options.settings;
    // the least that a scene could choose
    if settings.size == [0, 0] {
        settings.size = [1, 1];
    }
    if settings.max_depth == 0 {
        settings.max_depth = 1;
    }
    Plan::new(&settings)?;
    drive::share(&settings, options.part, options.target)?;
    drive::resumes_alone(options.resume.as_deref(), options.cache.is_some(), false)?;
    if options.cache.is_some() || options.save_cache { drive::needs_cache(&settings) } else { Ok(()) }
}

/// Renders a scene blob.
pub fn render(scene: &[u8], options: &RenderOptions, observer: &dyn Observer) -> Result<RenderResult, RenderError> {
    render_scene(Scene::from_bytes(scene)?, options, observer)
}

/// Renders a validated scene.
pub fn render_scene(
    scene: Scene<'_>,
    options: &RenderOptions,
    observer: &dyn Observer,
) -> Result<RenderResult, RenderError> {
    let (rendered, plan) = render_part(scene, options, observer)?;
    let names = Names::of(&scene, options.settings.aovs);
    Ok(RenderResult {
        picture: picture(&rendered, &names, options.denoise),
        stats: stats(&rendered),
        statistics: Statistics::of(&rendered).with_forecasts(&rendered, options.target, &options.settings),
        plan,
        cache: rendered.cache,
        stopped_early: rendered.stopped_early,
        checkpoint_error: rendered.checkpoint_error,
    })
}

/// Renders the part of a picture that the options ask for, as sums: for [`part::write`](crate::part::write).
pub fn render_part(
    scene: Scene<'_>,
    options: &RenderOptions,
    observer: &dyn Observer,
) -> Result<(Rendered, PlanSummary), RenderError> {
    let settings = options.settings.with_scene(&scene);
    let plan = PlanSummary::new(&scene, &settings)?;
    let o = Options {
        part: options.part,
        threads: options.threads,
        cache: options.cache.as_deref(),
        save_cache: options.save_cache,
        calibrate: options.calibrate,
        guide_view: options.guide_view,
        checkpoint: options.checkpoint.as_ref(),
        resume: options.resume.as_deref(),
        ..Options::new(settings, options.target)
    };
    Ok((drive_scene(scene, &o, observer)?, plan))
}

/// Picture of parts that were merged, with all layers, and its figures.
pub fn merged(parts: &Merged, denoise: bool) -> (Picture, RenderStats) {
    (picture(&parts.rendered, &parts.names, denoise), stats(&parts.rendered))
}

/// Memory that [`render_scene`] would take.
pub fn plan(scene: &Scene<'_>, options: &RenderOptions) -> Result<PlanSummary, RenderError> {
    Ok(PlanSummary::new(scene, &options.settings.with_scene(scene))?)
}

const RGB: [&str; 3] = ["R", "G", "B"];

/// Picture denoised by the built-in denoiser, with albedo and normals of the first hits.
fn denoised(r: &Rendered) -> Vec<[f32; 3]> {
    let features = !r.aovs.is_empty();
    let mut memory = vec![0.0; Planes::len(r.size, features)];
    let mut scratch = vec![0.0; scratch_len(r.size)];
    let done = Planes::carve(r.size, features, &mut memory).and_then(|mut planes| {
        r.pixels.iter().enumerate().for_each(|(i, p)| planes.set(i, p, r.aovs.get(i)));
        planes.denoise(&mut scratch)?;
        let [red, green, blue] = planes.out;
        Ok(red.iter().zip(green).zip(blue).map(|((r, g), b)| [*r, *g, *b]).collect())
    });
    done.expect("memory of the sizes asked for")
}

/// Picture with all layers that the film holds, and the denoised one if it is wanted.
fn picture(r: &Rendered, names: &Names, denoise: bool) -> Picture {
    let mut picture = Picture::new(r.size[0] as usize, r.size[1] as usize);
    picture.add3("", RGB, &r.image());
    picture.add3("stderr", RGB, &r.stderr());
    if r.pixels.iter().any(|p| p.rays > 0) {
        let per_sample = |p: &PixelStats| (p.rays as f64 / p.samples.max(1) as f64) as f32;
        picture.add1("cost", "rays", &r.pixels.iter().map(per_sample).collect::<Vec<_>>());
    }
    picture.add1("samples", "N", &r.pixels.iter().map(|p| p.samples as f32).collect::<Vec<_>>());
    for (aov, channels) in &r.planes {
        add_aov(&mut picture, names, r, *aov, channels);
    }
    if let Some(view) = &r.guide_view {
        picture.add1("guide", "share", &view.share);
        picture.add3("guide_direction", ["X", "Y", "Z"], &view.direction);
    }
    if denoise {
        picture.add3("denoised", RGB, &denoised(r));
    }
    picture
}

/// Adds the layers of an auxiliary value. What is known of first hits becomes the mean over the camera samples that hit, if
/// their share is known.
fn add_aov(picture: &mut Picture, names: &Names, r: &Rendered, aov: Aov, channels: &[Vec<f32>]) {
    let ranks = <&[Vec<f32>; 4]>::try_from(channels);
    let named = |names: &[String], what: &str, i: u32| match names.get(i as usize).filter(|n| !n.is_empty()) {
        Some(name) => name.clone(),
        None => format!("{what} {i}"),
    };
    match (aov, ranks) {
        (Aov::MaterialCoverage, Ok(ranks)) => {
            return cryptomatte::add(picture, "CryptoMaterial", ranks, |i| named(&names.materials, "material", i));
        }
        (Aov::ObjectCoverage, Ok(ranks)) => {
            return cryptomatte::add(picture, "CryptoObject", ranks, |i| named(&names.objects, "object", i));
        }
        _ => {}
    }
    let quotients = |over: &[f32], values: &[f32]| -> Vec<f32> {
        values.iter().zip(over).map(|(x, n)| if *n > 0.0 { x / n } else { 0.0 }).collect()
    };
    let mut layer = |name: &str, channel: &str, values: Vec<f32>| {
        picture.layer_mut(name.into()).channels.push(Channel { name: channel.into(), values });
    };
    match (aov, channels) {
        (Aov::Factors, [s1, s2, s3, s4, n1, n2, n3, n4]) => {
            let means = [(s1, n1), (s2, n2), (s3, n3), (s4, n4)];
            for (name, (sums, counts)) in ["factor1", "factor2", "factor3", "factor4"].into_iter().zip(means) {
                layer(name, "s", quotients(counts, sums));
            }
        }
        _ => {
            let of_hits = matches!(aov, Aov::Albedo | Aov::Normal | Aov::Depth | Aov::Motion);
            let alpha = r.channels(Aov::Alpha).and_then(<[_]>::first).filter(|_| of_hits);
            for (name, values) in aov.channels().iter().zip(channels) {
                layer(aov.name(), name, alpha.map_or_else(|| values.clone(), |a| quotients(a, values)));
            }
        }
    }
}

fn stats(r: &Rendered) -> RenderStats {
    let c = &r.counters;
    let lanes = [("scatter", c.scatter), ("trace", c.trace), ("occlude", c.occlude), ("surface", c.surface)];
    let counters = [
        ("camera_rays", c.camera_rays),
        ("scatter_rays", c.scatter_rays),
        ("shadow_rays", c.shadow_rays),
        ("light_path_rays", c.light_path_rays),
        ("vertex_samples", c.vertex_samples),
        ("paths_terminated", c.paths_terminated),
        ("splits", c.splits),
        ("splits_limited_by_ring", c.splits_limited_by_ring),
        ("splits_limited_by_budget", c.splits_limited_by_budget),
        ("ring_peak", c.ring_peak),
        ("shadow_rays_terminated", c.shadow_rays_terminated),
        ("light_samples_skipped", c.light_samples_skipped),
        ("look_ups", c.look_ups.lanes),
        ("samples_logged", c.samples_logged),
        ("samples_refused", c.samples_refused),
        ("shadows_refused", c.shadows_refused),
        ("ledger_full", c.ledger_full),
        ("factors_not_finite", c.factors_not_finite),
        ("max_length_reached", c.max_length_reached),
        ("distances_clamped", c.distances_clamped),
        ("non_finite", c.non_finite),
    ];
    RenderStats {
        spp: c.camera_samples as f64 / (f64::from(r.size[0]) * f64::from(r.size[1])),
        rays: c.rays(),
        seconds: r.seconds,
        mrays_per_s: r.mrays_per_s(),
        relmse_estimate: (r.spp > 1).then_some(r.error.rel_mse),
        relmse_interval: r.error.interval().filter(|_| r.spp > 1),
        relmse_at_least: (r.spp > 1 && !r.error.is_resolved()).then_some(r.error.at_least),
        figure_of_merit: Some(r.error.figure_of_merit(c.rays() as f64 * 1e-6)).filter(|f| r.spp > 1 && f.is_finite()),
        lane_utilisation: lanes.iter().map(|(n, u)| (*n, u.share())).collect(),
        counters: counters.into_iter().collect(),
        first_non_finite: first_non_finite(c.first_non_finite, r.size),
    }
}

/// Column and row of the core's number of a pixel, which is its index plus 1, or 0 for none.
fn first_non_finite(number: u64, [width, _]: [u32; 2]) -> Option<[u32; 2]> {
    let (index, width) = (number.checked_sub(1)?, u64::from(width));
    Some([(index % width) as u32, (index / width) as u32])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a number that is taken for an index, rows taken for columns, a pixel where there is none.
    #[test]
    fn pixels_of_numbers() {
        let found = [0, 1, 5, 6, 15].map(|n| first_non_finite(n, [5, 3]));
        assert_eq!(found, [None, Some([0, 0]), Some([4, 0]), Some([0, 1]), Some([4, 2])]);
    }

    /// Killed by: a pixel that the core finds and the figures leave out.
    #[test]
    fn the_first_pixel_that_is_not_finite_is_reported() {
        let scene = crate::bake::bake(&crate::builtin::cornell_box(), &Default::default(), |_, _| ()).unwrap();
        let scene = Scene::from_bytes(&scene.bytes).unwrap();
        let settings = Settings { size: [5, 3], ..Settings::for_scene(&scene) };
        let o = Options::new(settings, Target::Spp(1));
        let mut r = drive_scene(scene, &o, &drive::Unobserved).unwrap();
        assert_eq!(stats(&r).first_non_finite, None);
        r.counters.first_non_finite = 8;
        assert_eq!(stats(&r).first_non_finite, Some([2, 1]));
    }
}

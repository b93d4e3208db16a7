//! Drives the core: memory, threads, iterations and when to stop. The core has no clock; time lives here.
//! [`crate::render`] is the same with pictures and names.

mod calibrate;
pub mod schedule;

pub use calibrate::Calibration;

use crate::blob::AlignedBytes;
use crate::render::{Observer, Progress, Target};
use croupier::accel::Intersector;
use croupier::film::{PixelAov, PixelStats};
use croupier::learn::PictureStatistics;
use croupier::learn::cache::{Cache, CacheError};
use croupier::profile::{AnyProfile, DiffuseOnly, Full, Profile};
use croupier::rrs::Space;
use croupier::{
    Budget, Counters, ErrorEstimate, Phase, Plan, Scene, SceneError, Session, SessionError, Settings, SettingsError,
    Shard, ShardError, StepResult,
};
use rayon::prelude::*;
use schedule::Work;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Rays of a shard between two calls of [`Observer::progress`] and [`Observer::stop`].
const STEP_RAYS: u64 = 1 << 16;

/// How to render.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The core's settings.
    pub settings: Settings,
    /// When to stop.
    pub target: Target,
    /// Threads; 0 takes one per core. The picture does not depend on it.
    pub threads: usize,
    /// Pixels that strategies which learn take for the true ones, instead of the denoised picture: efficiency, not the
    /// expectation, hangs on them.
    pub estimate: Option<&'a [[f32; 3]]>,
    /// A saved cache to begin with. Needs a strategy that learns from the scene.
    pub cache: Option<&'a [u8]>,
    /// Return the cache of the scene's statistics as bytes. Needs such a strategy too.
    pub save_cache: bool,
    /// Measure in the end what looking up statistics and entering samples take.
    pub calibrate: bool,
}

impl Options<'_> {
    /// One thread per core, the built-in estimate, an empty cache that is not saved.
    pub fn new(settings: Settings, target: Target) -> Self {
        Self { settings, target, threads: 0, estimate: None, cache: None, save_cache: false, calibrate: false }
    }
}

/// Watches nothing.
#[derive(Clone, Copy, Debug)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        false
    }
}

/// One finished iteration.
#[derive(Clone, Copy, Debug)]
pub struct IterationRecord {
    /// Camera samples per pixel, rays, and seconds with all phases.
    pub work: Work,
    /// What happened in it.
    pub counters: Counters,
    /// Seconds of tracing.
    pub tracing: f64,
    /// Seconds of merging the shards' pixels and measuring the picture's variance.
    pub merging: f64,
    /// Seconds of estimating the pixels (denoising).
    pub estimating: f64,
    /// Seconds of merging the scene's statistics and rebuilding their tree.
    pub learning: f64,
    /// Error and cost of a camera sample; `None` unless something learns from the picture.
    pub picture: Option<PictureStatistics>,
    /// Leaves of the cache after it, and splits for which there was no room until then.
    pub cache: Option<CacheRecord>,
    /// Estimated error of the picture after it.
    pub error: ErrorEstimate,
}

/// The cache's size after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheRecord {
    /// Leaves in use.
    pub leaves: u32,
    /// Splits for which there was no room, in all iterations so far. A leaf that remains too large counts again in
    /// each.
    pub subdivisions_refused: u64,
}

/// A finished render.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Sums per pixel, row by row.
    pub pixels: Vec<PixelStats>,
    /// Auxiliary sums; empty if not asked for.
    pub aovs: Vec<PixelAov>,
    /// What happened.
    pub counters: Counters,
    /// Estimated error.
    pub error: ErrorEstimate,
    /// Camera samples per pixel of the finished iterations.
    pub spp: u32,
    /// Wall time of rendering alone.
    pub seconds: f64,
    /// Name of the kernel profile.
    pub profile: &'static str,
    /// Bytes of the shared block and of all shards.
    pub memory: [usize; 2],
    /// The observer asked to stop before the target.
    pub stopped_early: bool,
    /// Threads that traced.
    pub threads: usize,
    /// Every iteration, the one that was stopped too.
    pub iterations: Vec<IterationRecord>,
    /// The saved cache, if asked for.
    pub cache: Option<Vec<u8>>,
    /// What look-ups take, if asked for and anything is looked up.
    pub calibration: Option<Calibration>,
}

impl Rendered {
    /// Mean radiance, row by row, rgb.
    pub fn image(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|p| p.mean().map(|x| x as f32)).collect()
    }

    /// Standard error of the mean.
    pub fn stderr(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|p| p.variance_of_mean().map(|v| v.sqrt() as f32)).collect()
    }

    /// Rays per second, in millions.
    pub fn mrays_per_s(&self) -> f64 {
        self.counters.rays() as f64 / self.seconds.max(1e-9) * 1e-6
    }

    /// Order-sensitive hash of the picture's bits: equal for any number of threads and any instruction set.
    pub fn hash(&self) -> u64 {
        let image = self.image();
        croupier::scene::blob::content_hash(bytemuck::cast_slice(&image))
    }
}

/// Why nothing could be rendered.
#[derive(Debug)]
#[non_exhaustive]
pub enum DriveError {
    /// The bytes are not a scene.
    Scene(SceneError),
    /// A setting cannot be used.
    Settings(SettingsError),
    /// The session cannot start.
    Session(SessionError),
    /// A shard cannot be made.
    Shard(ShardError),
    /// The saved cache cannot be loaded, or the cache not be saved.
    Cache(CacheError),
    /// A cache is to be loaded or saved with this strategy, which learns nothing of the scene.
    NoCache(&'static str),
    /// A block of so many bytes is not to be had.
    Memory(usize),
    /// The thread pool cannot start.
    Threads(rayon::ThreadPoolBuildError),
}

impl fmt::Display for DriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(e) => e.fmt(f),
            Self::Settings(e) => e.fmt(f),
            Self::Session(e) => e.fmt(f),
            Self::Shard(e) => e.fmt(f),
            Self::Cache(e @ CacheError::Bounds { .. }) => write!(f, "statistics of another scene: {e}"),
            Self::Cache(e) => e.fmt(f),
            Self::NoCache(strategy) => {
                write!(
                    f,
                    "roulette strategy `{strategy}` learns nothing of the scene: there is no cache to load or save"
                )
            }
            Self::Memory(bytes) => write!(f, "no memory for a block of {bytes} bytes"),
            Self::Threads(e) => write!(f, "cannot start threads: {e}"),
        }
    }
}

impl std::error::Error for DriveError {}

macro_rules! from {
    ($($t:ty => $v:ident),*) => {$(
        impl From<$t> for DriveError {
            fn from(e: $t) -> Self {
                Self::$v(e)
            }
        }
    )*};
}
from!(SceneError => Scene, SettingsError => Settings, SessionError => Session, ShardError => Shard, CacheError => Cache,
      rayon::ThreadPoolBuildError => Threads);

/// Renders a scene blob.
pub fn drive(scene: &[u8], options: &Options<'_>, observer: &dyn Observer) -> Result<Rendered, DriveError> {
    drive_scene(Scene::from_bytes(scene)?, options, observer)
}

/// Renders a validated scene with the smallest profile that holds its effects.
pub fn drive_scene(scene: Scene<'_>, options: &Options<'_>, observer: &dyn Observer) -> Result<Rendered, DriveError> {
    match AnyProfile::smallest(scene.effects) {
        AnyProfile::DiffuseOnly => drive_with::<DiffuseOnly>(scene, options, observer),
        AnyProfile::Full => drive_with::<Full>(scene, options, observer),
    }
}

/// Renders a validated scene with profile `P`.
pub fn drive_with<P: Profile + Send + Sync>(
    scene: Scene<'_>,
    options: &Options<'_>,
    observer: &dyn Observer,
) -> Result<Rendered, DriveError> {
    let settings = &options.settings;
    let space = settings.strategy.space();
    if (options.cache.is_some() || options.save_cache) && space != Some(Space::Scene) {
        return Err(DriveError::NoCache(settings.strategy.name()));
    }
    let plan = Plan::new(settings)?;
    let block = |size: usize| AlignedBytes::try_zeroed(size).ok_or(DriveError::Memory(size));
    let mut shared = block(plan.session().size)?;
    let mut blocks = (0..settings.shards).map(|_| block(plan.shard().size)).collect::<Result<Vec<_>, _>>()?;
    let mut session = Session::builder(scene).profile::<P>().build(&plan, shared.as_mut())?;
    let mut shards = Vec::with_capacity(blocks.len());
    for (i, b) in blocks.iter_mut().enumerate() {
        shards.push(Shard::new(&plan, i as u32, b.as_mut())?);
    }
    if let Some(rgb) = options.estimate {
        session.give_estimate(rgb)?;
    }
    if let Some((bytes, cache)) = options.cache.zip(session.cache_mut()) {
        cache.load(bytes)?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build()?;

    // later by every pause for the observer
    let mut start = Instant::now();
    let mut iterations: Vec<IterationRecord> = Vec::new();
    let mut all = Work::default();
    let mut stopped_early = false;
    while !stopped_early {
        let (last, error) = iterations.last().map_or((Work::default(), None), |i| (i.work, Some(i.error)));
        let now = Work { seconds: observer.seconds().unwrap_or_else(|| start.elapsed().as_secs_f64()), ..all };
        let samples = schedule::next(options.target, learns(settings), &now, &last, error);
        if samples == 0 {
            break;
        }
        // the shards of a small picture finish in a single step, and do not ask
        if all.samples > 0 && observer.stop() {
            stopped_early = true;
            break;
        }
        let begun = Instant::now();
        session.begin_iteration(samples);
        let run = Run { session: &session, observer, start, all, last, samples, error, rays: AtomicU64::new(0) };
        stopped_early = pool.install(|| run.all(&mut shards));
        let mut record = end_iteration(&mut session, &shards, begun)?;
        record.work.samples = samples;
        if let Some(seconds) = observer.seconds() {
            record.work.seconds = seconds - now.seconds;
        }
        record.picture = learns(settings).then(|| session.picture_statistics()[0]);
        iterations.push(record);
        if stopped_early {
            break;
        }
        all.samples = all.samples.saturating_add(samples);
        all.rays += record.work.rays;
        let pause = Instant::now();
        observer.iteration(session.film(), (pause - start).as_secs_f64());
        start += pause.elapsed();
    }
    let seconds = start.elapsed().as_secs_f64();
    let film = session.film();
    let used = session.cache();
    Ok(Rendered {
        size: film.size(),
        pixels: film.pixels().to_vec(),
        aovs: film.aovs().to_vec(),
        counters: *session.counters(),
        error: film.error_estimate(),
        spp: all.samples,
        seconds,
        profile: P::NAME,
        memory: [plan.session().size, plan.shard().size * shards.len()],
        stopped_early,
        threads: pool.current_num_threads().min(shards.len()),
        iterations,
        cache: used.filter(|_| options.save_cache).map(save).transpose()?,
        calibration: used.filter(|_| options.calibrate).and_then(|c| calibrate::calibrate(c, &scene)),
    })
}

/// Does anything learn between iterations, so that the cost of a camera sample changes?
fn learns(s: &Settings) -> bool {
    s.strategy.needs_image() || s.shadow_roulette || s.adaptive
}

fn save(cache: &Cache<'_>) -> Result<Vec<u8>, CacheError> {
    let mut bytes = vec![0; cache.saved_len()];
    cache.save(&mut bytes)?;
    Ok(bytes)
}

/// Ends an iteration that has begun at `begun` and is traced.
fn end_iteration<P: Profile, I: Intersector>(
    session: &mut Session<'_, '_, P, I>,
    shards: &[Shard<'_>],
    begun: Instant,
) -> Result<IterationRecord, SessionError> {
    let traced = Instant::now();
    let [mut merged, mut estimated, mut learned] = [traced; 3];
    session.end_iteration_in_phases(shards, |phase| {
        let passed = match phase {
            Phase::Merged => &mut merged,
            Phase::Estimated => &mut estimated,
            Phase::Learned => &mut learned,
        };
        *passed = Instant::now();
    })?;
    let mut counters = Counters::default();
    shards.iter().for_each(|s| counters.merge(s.counters()));
    let error = session.film().error_estimate();
    let cache =
        session.cache().map(|c| CacheRecord { leaves: c.leaves(), subdivisions_refused: c.subdivisions_refused() });
    let seconds = |from: Instant, to: Instant| (to - from).as_secs_f64();
    Ok(IterationRecord {
        work: Work { samples: 0, rays: counters.rays(), seconds: begun.elapsed().as_secs_f64() },
        counters,
        tracing: seconds(begun, traced),
        merging: seconds(traced, merged),
        estimating: seconds(merged, estimated),
        learning: seconds(estimated, learned),
        picture: None,
        cache,
        error,
    })
}

/// One iteration over all shards.
struct Run<'a, 's, 'm, P: Profile, I: Intersector> {
    session: &'a Session<'s, 'm, P, I>,
    observer: &'a dyn Observer,
    start: Instant,
    /// Iterations before this one, and the last of them.
    all: Work,
    last: Work,
    samples: u32,
    error: Option<ErrorEstimate>,
    rays: AtomicU64,
}

impl<P: Profile + Sync, I: Intersector + Sync> Run<'_, '_, '_, P, I> {
    /// `true` if the observer stopped it.
    fn all(&self, shards: &mut [Shard<'_>]) -> bool {
        let stopped: Vec<bool> = shards.par_iter_mut().map(|s| self.one(s)).collect();
        stopped.contains(&true)
    }

    fn one(&self, shard: &mut Shard<'_>) -> bool {
        let mut stopped = false;
        loop {
            let before = shard.counters().rays();
            let progress = shard.step(self.session, Budget { rays: STEP_RAYS });
            let worked = shard.counters().rays().saturating_sub(before);
            let rays = self.rays.fetch_add(worked, Ordering::Relaxed) + worked;
            self.observer.progress(&self.progress(rays));
            if progress == StepResult::Done {
                return stopped;
            }
            if !stopped && self.observer.stop() {
                shard.stop();
                stopped = true;
            }
        }
    }

    fn progress(&self, rays: u64) -> Progress {
        // the share of this iteration, guessed from the rays that the last one took per sample
        let samples = f64::from(self.samples);
        let expected = self.last.rays as f64 / f64::from(self.last.samples.max(1)) * samples;
        let share = if self.last.samples == 0 { 0.0 } else { (rays as f64 / expected.max(1.0)).min(1.0) };
        Progress {
            spp: f64::from(self.all.samples) + share * samples,
            rays: self.all.rays + rays,
            seconds: self.start.elapsed().as_secs_f64(),
            relmse_estimate: self.error.map(|e| e.rel_mse),
        }
    }
}

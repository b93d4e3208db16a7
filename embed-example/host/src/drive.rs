//! Drives the core: memory, threads, iterations and when to stop. The core has no clock; time lives here. [`crate::render`]
//! is the same with pictures and names.

use crate::blob::AlignedBytes;
use crate::render::{Observer, Progress, Target};
use croupier::accel::WideBvh;
use croupier::film::{PixelAov, PixelStats};
use croupier::profile::{AnyProfile, Full, Matte, Profile};
use croupier::{
    Budget, Counters, ErrorEstimate, Plan, Progress as Step, Scene, SceneError, Session, SessionError, Settings,
    SettingsError, Shard, ShardError,
};
use rayon::prelude::*;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Rays between two looks at the clock and at [`Observer::stop`].
const STEP_RAYS: u64 = 1 << 16;

/// Iterations grow to this many samples per pixel.
const LARGEST_ITERATION: u32 = 64;

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
    /// There is no such roulette strategy.
    Strategy(croupier::rrs::ParseError),
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
            Self::Strategy(e) => e.fmt(f),
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
from!(SceneError => Scene, SettingsError => Settings, SessionError => Session, ShardError => Shard,
      rayon::ThreadPoolBuildError => Threads);

/// Renders a scene blob.
pub fn drive(scene: &[u8], options: &Options<'_>, observer: &dyn Observer) -> Result<Rendered, DriveError> {
    drive_scene(Scene::from_bytes(scene)?, options, observer)
}

/// Renders a validated scene with the smallest profile that holds its effects.
pub fn drive_scene(scene: Scene<'_>, options: &Options<'_>, observer: &dyn Observer) -> Result<Rendered, DriveError> {
    match AnyProfile::smallest(scene.effects) {
        AnyProfile::Matte => drive_with::<Matte>(scene, options, observer),
        AnyProfile::Full => drive_with::<Full>(scene, options, observer),
    }
}

/// Renders a validated scene with profile `P`.
pub fn drive_with<P: Profile + Send + Sync>(
    scene: Scene<'_>,
    options: &Options<'_>,
    observer: &dyn Observer,
) -> Result<Rendered, DriveError> {
    let plan = Plan::new(&options.settings)?;
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let count = options.settings.shards;
    let mut blocks: Vec<_> = (0..count).map(|_| AlignedBytes::zeroed(plan.shard().size)).collect();
    let mut session = Session::<P, _>::new(scene, WideBvh::new(&scene), &plan, shared.as_mut())?;
    let mut shards = Vec::with_capacity(blocks.len());
    for (i, b) in blocks.iter_mut().enumerate() {
        shards.push(Shard::new(&plan, i as u32, b.as_mut())?);
    }
    if let Some(rgb) = options.estimate {
        session.give_estimate(rgb)?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build()?;

    // later by every pause for the observer
    let mut start = Instant::now();
    let mut spp = 0u32;
    let mut error = None;
    let mut stopped_early = false;
    loop {
        let samples = next_iteration(options.target, spp, start.elapsed().as_secs_f64(), session.counters(), error);
        if samples == 0 {
            break;
        }
        session.begin_iteration(samples);
        let run = Run { session: &session, observer, start, spp, samples, error, rays: AtomicU64::new(0) };
        stopped_early = pool.install(|| run.all(&mut shards));
        session.end_iteration(&shards)?;
        if std::env::var_os("CR_DEBUG").is_some() {
            eprintln!("{samples} {:?} leaves {:?}", session.picture_statistics()[0], session.cache().map(|c| (c.leaves(), c.splits_refused())));
        }
        if stopped_early {
            break;
        }
        spp = spp.saturating_add(samples);
        error = Some(session.film().error_estimate());
        let pause = Instant::now();
        observer.iteration(session.film(), (pause - start).as_secs_f64());
        start += pause.elapsed();
    }
    let film = session.film();
    Ok(Rendered {
        size: film.size(),
        pixels: film.pixels().to_vec(),
        aovs: film.aovs().to_vec(),
        counters: *session.counters(),
        error: film.error_estimate(),
        spp,
        seconds: start.elapsed().as_secs_f64(),
        profile: P::NAME,
        memory: [plan.session().size, plan.shard().size * count as usize],
        stopped_early,
    })
}

/// One iteration over all shards.
struct Run<'a, 's, 'm, P: Profile, I: croupier::accel::Intersector> {
    session: &'a Session<'s, 'm, P, I>,
    observer: &'a dyn Observer,
    start: Instant,
    spp: u32,
    samples: u32,
    error: Option<ErrorEstimate>,
    rays: AtomicU64,
}

impl<P: Profile + Sync, I: croupier::accel::Intersector + Sync> Run<'_, '_, '_, P, I> {
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
            if progress == Step::Done {
                return stopped;
            }
            if !stopped && self.observer.stop() {
                shard.stop();
                stopped = true;
            }
        }
    }

    fn progress(&self, rays: u64) -> Progress {
        let finished = self.session.counters().rays();
        // the share of this iteration, guessed from the rays that earlier ones took per sample
        let expected = finished as f64 / f64::from(self.spp.max(1)) * f64::from(self.samples);
        let share = if self.spp == 0 { 0.0 } else { (rays as f64 / expected.max(1.0)).min(1.0) };
        Progress {
            spp: f64::from(self.spp) + share * f64::from(self.samples),
            rays: finished + rays,
            seconds: self.start.elapsed().as_secs_f64(),
            relmse_estimate: self.error.map(|e| e.rel_mse),
        }
    }
}

/// Samples per pixel of the next iteration, 0 when the target is reached. With a target in samples it depends on nothing
/// but the samples so far, so that the picture is a pure function of its inputs.
fn next_iteration(target: Target, spp: u32, seconds: f64, counters: &Counters, error: Option<ErrorEstimate>) -> u32 {
    let grow = spp.clamp(1, LARGEST_ITERATION);
    let per_sample = |spent: f64| spent / f64::from(spp.max(1));
    // at least one iteration, then only whole ones that fit
    let fit = |left: f64, cost: f64| -> u32 {
        if spp == 0 { 1 } else { ((left / cost.max(1e-12)).floor().max(0.0) as u32).min(grow) }
    };
    match target {
        Target::Spp(n) => grow.min(n.saturating_sub(spp)),
        Target::Seconds(s) => fit(s - seconds, per_sample(seconds)),
        Target::Rays(n) => fit(n as f64 - counters.rays() as f64, per_sample(counters.rays() as f64)),
        Target::Error(e) => match error {
            None => 1,
            // a few samples cannot judge their own error
            Some(x) if x.rel_mse <= e && spp >= 4 => 0,
            Some(x) => {
                let needed = f64::from(spp) * (x.rel_mse / e.max(1e-30) - 1.0);
                (needed.ceil().max(1.0) as u32).min(grow)
            }
        },
    }
}

//! Memory, threads, iterations and stop conditions around the core. The core has no clock: time is measured here.
//! [`crate::render`] is the same with pictures and names.

mod calibrate;
mod error;
mod forecast;
mod guide_view;
mod observe;
mod part;
mod result;

pub use calibrate::Calibration;
pub use croupier::unstable::schedule::{self, Target};
pub use error::DriveError;
pub use forecast::{Forecast, UNKNOWN, forecast};
pub use guide_view::GuideView;
pub use observe::{Observer, Progress, Unobserved};
pub use part::{Part, PartError, Share};
pub use result::{CacheRecord, GuideRecord, IterationRecord, Rendered};

use crate::blob::AlignedBytes;
use crate::checkpoint::{self, Schedule};
use croupier::unstable::Phase;
use croupier::unstable::accel::WideBvh;
use croupier::unstable::extension::Extension;
use croupier::unstable::film::Aov;
use croupier::unstable::learn::cache::{Cache, CacheError};
use croupier::unstable::learn::guiding::Guide;
use croupier::unstable::learn::saved;
use croupier::unstable::light::TreeSelector;
use croupier::unstable::profile::{AnyProfile, Profile, ProfileVisitor};
use croupier::unstable::rrs::Space;
use croupier::{
    Budget, Counters, ErrorEstimate, Film, Plan, Scene, Session, SessionError, SessionState, Settings, Shard,
    StepResult,
};
use rayon::prelude::*;
use schedule::Work;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Rays of a shard between two calls of [`Observer::progress`] and [`Observer::stop`].
const STEP_RAYS: u64 = 1 << 16;

/// Options of the driver.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Settings of the core.
    pub settings: Settings,
    /// Stop condition.
    pub target: Target,
    /// The part of a picture to be rendered; all of it if absent.
    pub part: Option<Part>,
    /// Threads; 0 is one per processor. The image does not depend on them.
    pub threads: usize,
    /// Pixel estimate that strategies which learn use instead of the denoised picture, rgb, row by row: efficiency
    /// depends on it, the expectation does not.
    pub pixel_estimate: Option<&'a [[f32; 3]]>,
    /// Saved statistics to begin with. Needs a strategy that learns from the scene, or path guiding.
    pub cache: Option<&'a [u8]>,
    /// Return of the statistics in the end. Needs a strategy that learns from the scene, or path guiding.
    pub save_cache: bool,
    /// Measurement, in the end, of look-ups and of recording samples.
    pub calibrate: bool,
    /// [`Rendered::guide_view`], in the end.
    pub guide_view: bool,
    /// Checkpoints to write while the render runs.
    pub checkpoint: Option<&'a Schedule>,
    /// Checkpoint of a render of the same scene and settings to go on from. It holds pixel estimate and cache, so that
    /// neither can be given as well.
    pub resume: Option<&'a Path>,
}

impl Options<'_> {
    /// Defaults: one thread per processor, the built-in pixel estimate, an empty cache that is not saved.
    pub fn new(settings: Settings, target: Target) -> Self {
        Self {
            settings,
            target,
            part: None,
            threads: 0,
            pixel_estimate: None,
            cache: None,
            save_cache: false,
            calibrate: false,
            guide_view: false,
            checkpoint: None,
            resume: None,
        }
    }
}

/// Renders a scene blob.
pub fn drive(scene: &[u8], options: &Options<'_>, observer: &dyn Observer) -> Result<Rendered, DriveError> {
    drive_scene(Scene::from_bytes(scene)?, options, observer)
}

/// Renders a validated scene with the smallest profile that holds its effects.
pub fn drive_scene(scene: Scene<'_>, options: &Options<'_>, observer: &dyn Observer) -> Result<Rendered, DriveError> {
    AnyProfile::smallest(scene.effects).dispatch_guided(options.settings.guides(), Drive { scene, options, observer })
}

/// A render whose profile is to be chosen.
struct Drive<'a, 's> {
    scene: Scene<'s>,
    options: &'a Options<'a>,
    observer: &'a dyn Observer,
}

impl ProfileVisitor for Drive<'_, '_> {
    type Out = Result<Rendered, DriveError>;

    fn visit<P: Profile + Send + Sync>(self) -> Self::Out {
        drive_with::<P>(self.scene, self.options, self.observer)
    }
}

/// Renders a validated scene with profile `P`.
pub fn drive_with<P: Profile + Send + Sync>(
    scene: Scene<'_>,
    options: &Options<'_>,
    observer: &dyn Observer,
) -> Result<Rendered, DriveError> {
    drive_extended::<P, ()>(scene, (), options, observer)
}

/// Renders a validated scene with profile `P` and an extension: from other rays or points than the camera's, for
/// instance. A checkpoint does not know the extension: it must be that of the render that wrote it.
pub fn drive_extended<P: Profile + Send + Sync, X: Extension + Copy + Sync>(
    scene: Scene<'_>,
    extension: X,
    options: &Options<'_>,
    observer: &dyn Observer,
) -> Result<Rendered, DriveError> {
    let settings = &options.settings;
    let share = share(settings, options.part, options.target)?;
    resumes_alone(options.resume, options.cache.is_some(), options.pixel_estimate.is_some())?;
    if options.cache.is_some() || options.save_cache {
        needs_cache(settings)?;
    }
    let plan = Plan::new(settings)?;
    let block = |size: usize| AlignedBytes::try_zeroed(size).ok_or(DriveError::Memory(size));
    let mut shared = block(plan.session().size)?;
    let mut blocks = (0..settings.shards).map(|i| block(plan.shard_of(i).size)).collect::<Result<Vec<_>, _>>()?;
    let saved = options.resume.map(|path| checkpoint::read(path, scene.hash, settings, shared.as_mut())).transpose()?;
    let builder = || Session::builder(scene).profile::<P>().extension(extension);
    let mut session = match &saved {
        Some(_) => builder().resume(&plan, shared.as_mut())?,
        None => builder().build(&plan, shared.as_mut())?,
    };
    match &saved {
        Some(saved) => same_part(&session, saved, share)?,
        None => session.skip(share.iterations, share.first),
    }
    let mut shards = Vec::with_capacity(blocks.len());
    for (i, b) in blocks.iter_mut().enumerate() {
        shards.push(Shard::new(&plan, i as u32, b.as_mut())?);
    }
    if let Some(rgb) = options.pixel_estimate {
        session.give_estimate(rgb)?;
    }
    if let Some(bytes) = options.cache {
        session.load_statistics(bytes)?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(options.threads, shards.len())).build()?;

    let checkpoint::Progress { work: mut all, mut begun, mut iterations } = saved.unwrap_or_default();
    // later by every pause for the observer, earlier by the work before a break
    let mut start = Instant::now();
    let before = Duration::try_from_secs_f64(all.seconds).unwrap_or_default();
    start = start.checked_sub(before).unwrap_or(start);
    let mut saver = Saver { options, scene: scene.hash, last: Instant::now(), saved: 0, error: None };
    let mut stopped_early = false;
    while !stopped_early {
        let (last, error) = iterations.last().map_or((Work::default(), None), |i| (i.work, Some(i.error)));
        let now = Work { seconds: observer.seconds().unwrap_or_else(|| start.elapsed().as_secs_f64()), ..all };
        let next =
            begun.unwrap_or_else(|| schedule::next_iteration(share.target, settings.learns(), &now, &last, error));
        // shards of a small picture finish in a single step and never ask the observer
        stopped_early = next > 0 && all.samples > 0 && observer.stop();
        let done = next == 0 || stopped_early;
        if begun.is_none() && saver.due(all.samples, done) {
            let pause = Instant::now();
            session.suspend();
            let progress = checkpoint::Progress { work: now, begun, iterations: iterations.clone() };
            saver.save(&progress, &shared);
            session = builder().resume(&plan, shared.as_mut())?;
            start += pause.elapsed();
        }
        if done {
            break;
        }
        let iteration_start = Instant::now();
        let samples = next;
        if begun.take().is_none() {
            session.begin_iteration(samples);
        }
        let end = match share.target {
            Target::Error(e) => forecast(e, settings.learns(), &iterations),
            _ => None,
        };
        let run = Run { session: &session, observer, start, all, last, samples, error, end, rays: AtomicU64::new(0) };
        stopped_early = pool.install(|| run.all(&mut shards));
        if stopped_early && saver.wanted() {
            // The iteration under way, as it was before anything of it was merged: resumed, it is traced anew.
            session.suspend();
            let progress = checkpoint::Progress { work: now, begun: Some(samples), iterations: iterations.clone() };
            saver.save(&progress, &shared);
            session = builder().resume(&plan, shared.as_mut())?;
        }
        let mut record = end_iteration(&mut session, &shards, iteration_start)?;
        record.work.samples = samples;
        if let Some(seconds) = observer.seconds() {
            record.work.seconds = seconds - now.seconds;
        }
        record.picture = settings.learns().then(|| session.picture_statistics()[0]);
        iterations.push(record);
        if stopped_early {
            break;
        }
        all.samples = all.samples.saturating_add(samples);
        all.rays = all.rays.saturating_add(record.work.rays);
        let pause = Instant::now();
        observer.iteration(session.film(), (pause - start).as_secs_f64());
        start += pause.elapsed();
    }
    let seconds = start.elapsed().as_secs_f64();
    let film = session.film();
    let used = session.cache();
    Ok(Rendered {
        size: film.size(),
        pixels: film.pixels().collect(),
        aovs: film.aovs().collect(),
        planes: planes(film),
        counters: *session.counters(),
        error: film.error_estimate(),
        variance_factors: film.variance_factors(),
        first_sample: share.first,
        spp: all.samples,
        seconds,
        profile: P::NAME,
        memory: [plan.session().size, (0..settings.shards).map(|i| plan.shard_of(i).size).sum()],
        stopped_early,
        checkpoint_error: saver.error,
        threads: pool.current_num_threads().min(shards.len()),
        iterations,
        guide: session.guide().map(|g| GuideRecord {
            leaves: g.leaves(),
            nodes: g.nodes(),
            share: g.mean_fraction(),
            watched: session.guide_use(),
        }),
        guide_view: session.guide().filter(|_| options.guide_view).map(|g| GuideView::new(&scene, g, film.size())),
        cache: options.save_cache.then(|| save(session.cache(), session.guide())).transpose()?,
        calibration: used.filter(|_| options.calibrate).and_then(|c| calibrate::calibrate(c, &scene)),
    })
}

/// What a part renders; all of the picture without one.
pub(crate) fn share(settings: &Settings, part: Option<Part>, target: Target) -> Result<Share, PartError> {
    match part {
        Some(_) if settings.adaptive => Err(PartError::Adaptive),
        Some(part) => part.share(target),
        None => Ok(Share::whole(target)),
    }
}

/// Fails if a session that was resumed has taken other samples than those of this share of the picture.
fn same_part(session: &SessionState<'_>, saved: &checkpoint::Progress, share: Share) -> Result<(), DriveError> {
    let i = session.iteration();
    let before = i.first_sample.wrapping_add(i.samples);
    let first = before.wrapping_sub(saved.work.samples).wrapping_sub(saved.begun.unwrap_or(0));
    // parts are further apart than a part has iterations
    let part = |n: u64| n >> 32;
    let same = first == share.first && part(i.number) == part(share.iterations);
    if same { Ok(()) } else { Err(DriveError::OtherPart(first, share.first)) }
}

/// Fails if a checkpoint is to be resumed together with what would replace a part of it.
pub(crate) fn resumes_alone(resume: Option<&Path>, cache: bool, pixel_estimate: bool) -> Result<(), DriveError> {
    match resume {
        Some(_) if cache => Err(DriveError::Resumed("statistics of the scene")),
        Some(_) if pixel_estimate => Err(DriveError::Resumed("pixel estimate")),
        _ => Ok(()),
    }
}

/// Threads of a render with so many shards: more would have nothing to do.
fn threads(wanted: usize, shards: usize) -> usize {
    let wanted = if wanted == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { wanted };
    wanted.min(shards).max(1)
}

/// All planes of auxiliary values that a film has.
pub(crate) fn planes(film: &Film<'_>) -> Vec<(Aov, Vec<Vec<f32>>)> {
    let of = |aov: Aov| {
        let channels = (0..aov.channels().len()).map(|c| film.plane(aov, c).map(<[f32]>::to_vec));
        Some((aov, channels.collect::<Option<Vec<_>>>()?)).filter(|(_, channels)| !channels.is_empty())
    };
    Aov::ALL.into_iter().filter_map(of).collect()
}

/// Fails unless something is learned of the scene, by the strategy or for path guiding.
pub(crate) fn needs_cache(settings: &Settings) -> Result<(), DriveError> {
    let strategy = settings.strategy;
    let learns = strategy.space() == Some(Space::Scene) || settings.guide_size().is_some();
    if learns { Ok(()) } else { Err(DriveError::NoCache(strategy.name())) }
}

/// Checkpoints of a render.
struct Saver<'a> {
    options: &'a Options<'a>,
    /// Content hash of the scene.
    scene: u64,
    last: Instant,
    /// Samples per pixel of the last checkpoint.
    saved: u32,
    /// First error of writing one. The render goes on.
    error: Option<String>,
}

impl Saver<'_> {
    fn wanted(&self) -> bool {
        self.options.checkpoint.is_some() && self.error.is_none()
    }

    /// Is it time for one, with so many samples per pixel? At the end if anything is new.
    fn due(&self, samples: u32, done: bool) -> bool {
        let every = self.options.checkpoint.map_or(f64::INFINITY, |c| c.every);
        self.wanted() && samples > self.saved && (done || self.last.elapsed().as_secs_f64() >= every)
    }

    fn save(&mut self, progress: &checkpoint::Progress, block: &AlignedBytes) {
        let Some(schedule) = self.options.checkpoint else { return };
        let written = checkpoint::write(&schedule.path, self.scene, &self.options.settings, progress, block);
        self.error = written.err().map(|e| e.to_string());
        self.last = Instant::now();
        self.saved = progress.work.samples;
    }
}

/// What was learned of the scene as bytes.
pub(crate) fn save(cache: Option<&Cache<'_>>, guide: Option<&Guide<'_>>) -> Result<Vec<u8>, CacheError> {
    let mut bytes = vec![0; saved::saved_len(cache, guide)];
    saved::save(cache, guide, &mut bytes)?;
    Ok(bytes)
}

/// Ends an iteration that has begun at `begun` and is traced.
fn end_iteration<'s, P: Profile, X: Extension>(
    session: &mut Session<'s, '_, P, WideBvh<'s>, TreeSelector<'s>, X>,
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
struct Run<'a, 's, 'm, P: Profile, X: Extension> {
    session: &'a Session<'s, 'm, P, WideBvh<'s>, TreeSelector<'s>, X>,
    observer: &'a dyn Observer,
    start: Instant,
    /// Iterations before this one, and the last of them.
    all: Work,
    last: Work,
    samples: u32,
    error: Option<ErrorEstimate>,
    end: Option<Forecast>,
    rays: AtomicU64,
}

impl<P: Profile + Sync, X: Extension + Sync> Run<'_, '_, '_, P, X> {
    /// `true` if the observer stopped it.
    fn all(&self, shards: &mut [Shard<'_>]) -> bool {
        let stopped: Vec<bool> = shards.par_iter_mut().map(|s| self.one(s)).collect();
        stopped.contains(&true)
    }

    fn one(&self, shard: &mut Shard<'_>) -> bool {
        // counters begin anew with the first step of an iteration
        let (mut stopped, mut before) = (false, 0);
        loop {
            let progress = shard.step(self.session, Budget { rays: STEP_RAYS });
            let now = shard.counters().rays();
            let worked = now.saturating_sub(before);
            before = now;
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
            forecast: self.end,
        }
    }
}

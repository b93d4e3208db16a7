//! Drives the core by hand, in any order of shards and steps; compiled once for all tests.

use croupier::unstable::Sampler;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::film::{PixelAov, PixelStats};
use croupier::unstable::learn::cache::CacheError;
use croupier::unstable::learn::guiding::GuideUse;
use croupier::unstable::learn::{Learning, PictureStatistics, PixelEstimator};
use croupier::unstable::profile::{AnyProfile, Profile, ProfileVisitor};
use croupier::{
    Budget, Counters, ErrorEstimate, Plan, Scene, Session, SessionError, SessionState, Settings, Shard, StepResult,
    Strategy,
};
use croupier_host::blob::AlignedBytes;

use crate::cache::{overwrite, random_sums};
use crate::stats::SplitMix;

/// How the steps of an iteration are dealt out.
#[derive(Clone, Copy, Debug)]
pub enum Schedule {
    /// One shard after the other, steps of that many rays.
    InOrder(u64),
    /// The last shard first.
    Reversed(u64),
    /// A step for each in turn.
    InTurn(u64),
    /// A random shard makes a step of a random number of rays up to this; the number seeds.
    Shuffled(u64, u64),
    /// That many threads, shards dealt out among them, steps of that many rays.
    Threads(usize, u64),
}

/// What a render leaves behind.
#[derive(Clone, Debug)]
pub struct Image {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Sums per pixel.
    pub pixels: Vec<PixelStats>,
    /// Auxiliary sums.
    pub aovs: Vec<PixelAov>,
    /// What happened.
    pub counters: Counters,
    /// The film's own estimate.
    pub error: ErrorEstimate,
}

impl Image {
    /// Mean over pixels and channels.
    pub fn mean(&self) -> f64 {
        self.pixels.iter().flat_map(|p| p.mean()).sum::<f64>() / (3 * self.pixels.len()) as f64
    }

    /// Standard error of [`Self::mean`] from the film's variances; channels of a pixel count as fully correlated.
    pub fn error_of_mean(&self) -> f64 {
        let pixel = |p: &PixelStats| (p.variance_of_mean().iter().map(|v| v.sqrt()).sum::<f64>() / 3.0).powi(2);
        self.pixels.iter().map(pixel).sum::<f64>().sqrt() / self.pixels.len() as f64
    }

    /// Mean over pixels of one channel.
    pub fn channel(&self, c: usize) -> f64 {
        self.pixels.iter().map(|p| p.mean()[c]).sum::<f64>() / self.pixels.len() as f64
    }

    /// Its standard error.
    pub fn error_of_channel(&self, c: usize) -> f64 {
        self.pixels.iter().map(|p| p.variance_of_mean()[c]).sum::<f64>().sqrt() / self.pixels.len() as f64
    }

    /// Every bit of the film.
    pub fn bits(&self) -> Vec<u8> {
        let pixels: &[u8] = bytemuck::cast_slice(&self.pixels);
        [pixels, bytemuck::cast_slice(&self.aovs)].concat()
    }
}

/// Samples of iterations that double up to 256 samples, `spp` in all.
pub fn doubling(spp: u32) -> Vec<u32> {
    let (mut all, mut left) = (vec![], spp);
    while left > 0 {
        let n = (spp - left).clamp(8, 256).min(left);
        all.push(n);
        left -= n;
    }
    all
}

/// Settings for a scene's own camera, `strategy` in the words of the program. Numbers are hashed, not the default, so
/// that samples are independent, as [`PixelStats::variance_of_mean`] assumes; what is the program's own
/// default is tested by those who ask for it.
pub fn settings(scene: &[u8], strategy: &str) -> Settings {
    let scene = Scene::from_bytes(scene).expect("a valid scene");
    let strategy = Strategy::parse(strategy).expect("a known strategy");
    Settings { strategy, sampler: Sampler::Hashed, ..Settings::for_scene(&scene) }
}

/// Renders one iteration of `spp` samples, shard by shard.
pub fn render(scene: &[u8], settings: &Settings, spp: u32) -> Image {
    scheduled(scene, settings, &[spp], Schedule::InOrder(1 << 20))
}

/// Renders iterations of the given numbers of samples with the smallest profile.
pub fn scheduled(scene: &[u8], settings: &Settings, iterations: &[u32], schedule: Schedule) -> Image {
    learning(scene, settings, iterations, schedule, &mut |_, _| ())
}

/// As [`scheduled`]; `before` sees what was learned before each iteration, and may change it.
pub fn learning(
    scene: &[u8],
    settings: &Settings,
    iterations: &[u32],
    schedule: Schedule,
    before: &mut dyn FnMut(usize, &mut dyn Learned),
) -> Image {
    let scene = Scene::from_bytes(scene).expect("a valid scene");
    let smallest = AnyProfile::smallest(scene.effects);
    smallest.dispatch_guided(settings.guides(), Render { scene, settings, iterations, schedule, before })
}

/// A render whose profile is to be chosen.
struct Render<'a, 's> {
    scene: Scene<'s>,
    settings: &'a Settings,
    iterations: &'a [u32],
    schedule: Schedule,
    before: &'a mut dyn FnMut(usize, &mut dyn Learned),
}

impl ProfileVisitor for Render<'_, '_> {
    type Out = Image;

    fn visit<P: Profile + Send + Sync>(self) -> Image {
        let bvh = WideBvh::new(&self.scene);
        learning_with::<P, _>(self.scene, bvh, self.settings, self.iterations, self.schedule, self.before)
    }
}

/// What a session has learned, whatever its profile.
pub trait Learned {
    /// The statistics of the scene as bytes, if there are any.
    fn saved(&self) -> Option<Vec<u8>>;

    /// Loads saved statistics.
    fn load(&mut self, bytes: &[u8]) -> Result<(), CacheError>;

    /// All that was learned of the scene as bytes, if there is anything.
    fn saved_statistics(&self) -> Option<Vec<u8>>;

    /// Loads all that was saved.
    fn load_statistics(&mut self, bytes: &[u8]) -> Result<(), CacheError>;

    /// Adds what was saved.
    fn merge_statistics(&mut self, bytes: &[u8]) -> Result<(), CacheError>;

    /// The distributions of path guiding as bytes, the mean share of guided samples, and the directions that logs had
    /// no room for; `None` if it is off.
    fn guide(&self) -> Option<(Vec<u8>, f64, u64)>;

    /// Whether path guiding pays, if the settings leave that open.
    fn guide_use(&self) -> Option<GuideUse>;

    /// Loads saved distributions.
    fn load_guide(&mut self, bytes: &[u8]) -> Result<(), CacheError>;

    /// Gives an estimate of the pixels.
    fn give(&mut self, rgb: &[[f32; 3]]) -> Result<(), SessionError>;

    /// What is known of the picture: of the last iteration, and blended.
    fn statistics(&self) -> [PictureStatistics; 2];

    /// Counts of the finished iterations.
    fn counters(&self) -> Counters;

    /// Pixels of the finished iterations.
    fn pixels(&self) -> Vec<PixelStats>;
}

/// Puts random sums in place of all statistics of the scene.
pub fn poison(l: &mut dyn Learned, rng: &mut SplitMix) {
    let mut bytes = l.saved().expect("a strategy with a cache");
    overwrite(&mut bytes, || random_sums(rng));
    l.load(&bytes).expect("statistics of this scene");
}

impl<P: Profile, I: Intersector> Learned for Session<'_, '_, P, I> {
    fn saved(&self) -> Option<Vec<u8>> {
        let cache = self.cache()?;
        let mut bytes = vec![0; cache.saved_len()];
        cache.save(&mut bytes).expect("room for the cache");
        Some(bytes)
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        self.cache_mut().expect("a cache").load(bytes)
    }

    fn saved_statistics(&self) -> Option<Vec<u8>> {
        let mut bytes = vec![0; self.saved_statistics_len()];
        let saved = self.save_statistics(&mut bytes);
        assert_eq!(saved, if bytes.is_empty() { Err(CacheError::Absent) } else { Ok(bytes.len()) });
        Some(bytes).filter(|b| !b.is_empty())
    }

    fn load_statistics(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        SessionState::load_statistics(self, bytes)
    }

    fn merge_statistics(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        SessionState::merge_statistics(self, bytes)
    }

    fn guide(&self) -> Option<(Vec<u8>, f64, u64)> {
        let guide = SessionState::guide(self)?;
        let mut bytes = vec![0; guide.saved_len()];
        guide.save(&mut bytes).expect("room for the guide");
        Some((bytes, guide.mean_fraction(), guide.thinned()))
    }

    fn guide_use(&self) -> Option<GuideUse> {
        SessionState::guide_use(self)
    }

    fn load_guide(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        self.guide_mut().expect("a guide").load(bytes)
    }

    fn give(&mut self, rgb: &[[f32; 3]]) -> Result<(), SessionError> {
        self.give_estimate(rgb)
    }

    fn statistics(&self) -> [PictureStatistics; 2] {
        self.picture_statistics()
    }

    fn counters(&self) -> Counters {
        *SessionState::counters(self)
    }

    fn pixels(&self) -> Vec<PixelStats> {
        self.film().pixels().collect()
    }
}

/// Renders with an intersector and a profile.
pub fn render_with<P: Profile + Sync, I: Intersector + Sync>(
    scene: Scene<'_>,
    intersector: I,
    settings: &Settings,
    iterations: &[u32],
    schedule: Schedule,
) -> Image {
    learning_with::<P, I>(scene, intersector, settings, iterations, schedule, &mut |_, _| ())
}

fn learning_with<P: Profile + Sync, I: Intersector + Sync>(
    scene: Scene<'_>,
    intersector: I,
    settings: &Settings,
    iterations: &[u32],
    schedule: Schedule,
    before: &mut dyn FnMut(usize, &mut dyn Learned),
) -> Image {
    let plan = Plan::new(settings).expect("settings that can be used");
    let mut shared = used_memory(plan.session().size);
    let mut blocks: Vec<_> = (0..settings.shards).map(|_| used_memory(plan.shard().size)).collect();
    let mut session = Session::builder(scene)
        .profile::<P>()
        .intersector(intersector)
        .build(&plan, shared.as_mut())
        .expect("a session");
    let shards = blocks.iter_mut().enumerate().map(|(i, b)| Shard::new(&plan, i as u32, b.as_mut()));
    let mut shards: Vec<_> = shards.collect::<Result<_, _>>().expect("shards");
    for (i, spp) in iterations.iter().enumerate() {
        before(i, &mut session);
        session.begin_iteration(*spp);
        run(&session, &mut shards, schedule);
        session.end_iteration(&shards).expect("all shards are done");
    }
    let film = session.film();
    Image {
        size: film.size(),
        pixels: film.pixels().collect(),
        aovs: film.aovs().collect(),
        counters: session.counters(),
        error: film.error_estimate(),
    }
}

/// A block as a host's pool may give it: NaNs, and indices beyond everything. Nothing may depend on what it holds.
fn used_memory(bytes: usize) -> AlignedBytes {
    let mut block = AlignedBytes::zeroed(bytes);
    block.as_mut().fill(0xff);
    block
}

/// Steps a shard until it is done.
pub fn finish<P: Profile, I: Intersector>(session: &Session<'_, '_, P, I>, shard: &mut Shard<'_>, rays: u64) {
    while shard.step(session, Budget { rays }) == StepResult::More {}
}

fn run<P: Profile + Sync, I: Intersector + Sync>(
    session: &Session<'_, '_, P, I>,
    shards: &mut [Shard<'_>],
    schedule: Schedule,
) {
    match schedule {
        Schedule::InOrder(rays) => shards.iter_mut().for_each(|s| finish(session, s, rays)),
        Schedule::Reversed(rays) => shards.iter_mut().rev().for_each(|s| finish(session, s, rays)),
        Schedule::InTurn(rays) => {
            let mut more = true;
            while more {
                more = false;
                for s in shards.iter_mut() {
                    more |= s.step(session, Budget { rays }) == StepResult::More;
                }
            }
        }
        Schedule::Shuffled(seed, rays) => {
            let mut rng = SplitMix(seed);
            let mut left: Vec<&mut Shard<'_>> = shards.iter_mut().collect();
            while !left.is_empty() {
                let i = (rng.bits() % left.len() as u64) as usize;
                if left[i].step(session, Budget { rays: 1 + rng.bits() % rays }) == StepResult::Done {
                    left.swap_remove(i);
                }
            }
        }
        Schedule::Threads(threads, rays) => std::thread::scope(|scope| {
            for chunk in shards.chunks_mut(shards.len().div_ceil(threads)) {
                scope.spawn(move || chunk.iter_mut().for_each(|s| finish(session, s, rays)));
            }
        }),
    }
}

/// A block in which every byte is `byte`.
pub fn memory(bytes: usize, byte: u8) -> AlignedBytes {
    let mut block = AlignedBytes::zeroed(bytes);
    block.as_mut().fill(byte);
    block
}

/// Strategies and settings with all kinds of statistics; the second has auxiliary values and learns.
pub fn kinds_of_statistics(scene: &[u8], shards: u32) -> Vec<Settings> {
    let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 300.0, ..Learning::default() };
    let blocks = Learning { pixel_estimator: PixelEstimator::Blocks, ..learning };
    let of = |strategy: &str, aovs: bool, adaptive, learning| Settings {
        aovs: aovs.into(),
        adaptive,
        learning,
        shards,
        ..settings(scene, strategy)
    };
    vec![
        of("classic", false, false, learning),
        of("ears", true, false, learning),
        of("ears", true, true, learning),
        of("ears", false, true, blocks),
        of("bolin-meyer", true, true, learning),
        Settings { sampler: Sampler::Sobol, ..of("ears", true, false, learning) },
    ]
}

/// All that a session shows, as bytes.
pub fn shown<P: Profile, I: Intersector>(session: &Session<'_, '_, P, I>) -> Vec<u8> {
    let film = session.film();
    let mut all = format!("{:?} {:?} {:?}", session.counters(), film.error_estimate(), session.picture_statistics());
    all += &format!("{:?}", session.estimate());
    let mut all = all.into_bytes();
    all.extend_from_slice(bytemuck::cast_slice(&film.pixels().collect::<Vec<_>>()));
    all.extend_from_slice(bytemuck::cast_slice(&film.aovs().collect::<Vec<_>>()));
    if let Some(cache) = session.cache() {
        let mut saved = vec![0; cache.saved_len()];
        cache.save(&mut saved).expect("room for it");
        all.extend(saved);
    }
    all
}

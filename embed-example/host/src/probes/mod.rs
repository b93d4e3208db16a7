//! Light probes: incident radiance at points, projected to spherical harmonics ([`Harmonics`]), rendered by a session with
//! all that sessions have: strategies that learn, shards, iterations.
//!
//! The picture of the session has a square of cells for each probe, of equal solid angle. A cell has one sample in each
//! iteration; after it, what the sample brought is weighted with the functions in its direction, so that every ray serves
//! all coefficients and their means are exact: `c_i = 4 pi / cells * sum L Y_i`. Standard errors are those of the
//! iterations' means.
//!
//! Rays do not meet point, spot and parallel lights, nor the sun: what surfaces scatter of their light is in the probes,
//! their direct light is not. Probes are in the media in which the scene's camera is.
//!
//! ```
//! use croupier::Scene;
//! use croupier_host::bake::{BakeOptions, bake};
//! use croupier_host::builtin;
//! use croupier_host::drive::Unobserved;
//! use croupier_host::probes::{ProbeOptions, render_probes};
//!
//! let description = builtin::cornell_box();
//! let blob = bake(&description, &BakeOptions::default(), |_, _| {})?.bytes;
//! let options = ProbeOptions { rays: 64, ..ProbeOptions::default() };
//! let scene = Scene::from_bytes(&blob)?;
//! let probes = render_probes(scene, &description, &[[0.0, 1.0, 0.0]], &options, &Unobserved)?;
//! // from the red wall on the left more red
//! let towards = |x: f64| probes[0].radiance.irradiance([x, 0.0, 0.0]);
//! assert!(towards(-1.0)[0] / towards(-1.0)[1] > towards(1.0)[0] / towards(1.0)[1]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod harmonics;
mod source;

pub use harmonics::{COEFFICIENTS, Harmonics, basis};

use crate::blob::AlignedBytes;
use crate::description::SceneDescription;
use crate::drive::{DriveError, Observer, Progress};
use crate::sides::{Sides, opaque};
use croupier::unstable::film::AovSet;
use croupier::unstable::profile::Full;
use croupier::unstable::rng::Key8;
use croupier::unstable::simd::{Mask8, U32x8, Vec3x8};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use rayon::prelude::*;
use serde::Serialize;
use source::ProbeSource;
use std::fmt;
use std::time::Instant;

/// Most cells of all probes together.
const MAX_CELLS: u64 = 1 << 28;
/// Rays of a shard between two calls of the observer.
const STEP_RAYS: u64 = 1 << 16;
/// Rays that look for backs, per probe.
const SIDE_RAYS: u32 = 64;

/// Options of probes.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeOptions {
    /// Settings of the core. Size, AOVs and adaptive sampling are the probes' own.
    pub settings: Settings,
    /// Directions of each probe, at least 2; rounded up to whole iterations.
    pub rays: u32,
    /// Threads; 0 is one per processor. Probes do not depend on them.
    pub threads: usize,
    /// Share of directions that may first meet the back of an opaque surface, 0 to 1; a probe with more is not valid: it
    /// is inside of something.
    pub most_backs: f32,
}

/// 1024 rays with the strategy and the settings of [`crate::render::RenderOptions`]; not valid if more backs are seen than
/// fronts.
impl Default for ProbeOptions {
    fn default() -> Self {
        let settings = crate::render::unguided(crate::render::RenderOptions::default().settings);
        Self { settings, rays: 1024, threads: 0, most_backs: 0.5 }
    }
}

/// A rendered probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// World space.
    pub position: [f32; 3],
    /// Incident radiance, linear Rec. 709.
    pub radiance: Harmonics,
    /// Standard errors of the coefficients.
    pub stderr: Harmonics,
    /// Share of directions that first meet the back of an opaque surface.
    pub backs: f32,
    /// Not inside of anything.
    pub valid: bool,
}

/// Why there are no probes.
#[derive(Debug)]
#[non_exhaustive]
pub enum ProbeError {
    /// No positions, or too many for one render.
    Count {
        /// Positions given.
        probes: usize,
    },
    /// A position that is not finite.
    Position {
        /// Number of the probe.
        probe: usize,
    },
    /// The render failed.
    Drive(DriveError),
}

impl fmt::Display for ProbeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { probes } => write!(f, "{probes} probes: there must be at least one, and 2^28 cells in all"),
            Self::Position { probe } => write!(f, "the position of probe {probe} is not finite"),
            Self::Drive(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for ProbeError {}

impl<E: Into<DriveError>> From<E> for ProbeError {
    fn from(e: E) -> Self {
        Self::Drive(e.into())
    }
}

/// Positions of a grid in a box: the middles of `counts` equal cells along each axis, x fastest, then y.
pub fn grid([lo, hi]: [[f32; 3]; 2], counts: [u32; 3]) -> Vec<[f32; 3]> {
    let [nx, ny, nz] = counts;
    let at = |axis: usize, i: u32| lo[axis] + (hi[axis] - lo[axis]) * (i as f32 + 0.5) / counts[axis] as f32;
    let plane = |z: u32| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]));
    (0..nz).flat_map(plane).map(|[x, y, z]| [at(0, x), at(1, y), at(2, z)]).collect()
}

/// Columns and rows of cells of a probe.
fn side(rays: u32) -> u32 {
    match rays {
        0..256 => 4,
        256..1024 => 8,
        _ => 16,
    }
}

/// Columns and rows of the picture that a session renders for so many probes of so many rays: what its memory depends on.
pub fn picture_size(probes: usize, rays: u32) -> [u32; 2] {
    source::size(probes, side(rays))
}

/// Renders probes at world positions. `description` is that of the scene: it tells which materials are opaque.
///
/// Probes depend on scene, positions and options, never on threads. If the observer stops them, they have fewer rays.
///
/// # Errors
/// No positions or too many, one that is not finite, and what [`crate::drive`] refuses.
pub fn render_probes(
    scene: Scene<'_>,
    description: &SceneDescription,
    positions: &[[f32; 3]],
    options: &ProbeOptions,
    observer: &dyn Observer,
) -> Result<Vec<Probe>, ProbeError> {
    let side = side(options.rays);
    let cells = u64::from(side * side);
    if positions.is_empty() || positions.len() as u64 > MAX_CELLS / cells / 2 {
        return Err(ProbeError::Count { probes: positions.len() });
    }
    if let Some(probe) = positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(ProbeError::Position { probe });
    }
    let source = ProbeSource::new(positions, side, options.settings.seed);
    let settings = Settings {
        size: source.size(),
        aovs: AovSet::NONE,
        adaptive: false,
        ..crate::render::unguided(options.settings.with_scene(&scene))
    };
    let plan = Plan::new(&settings)?;
    let block = |size: usize| AlignedBytes::try_zeroed(size).ok_or(DriveError::Memory(size));
    let mut shared = block(plan.session().size)?;
    let mut blocks = (0..settings.shards).map(|i| block(plan.shard_of(i).size)).collect::<Result<Vec<_>, _>>()?;
    let mut session = Session::builder(scene).profile::<Full>().extension(&source).build(&plan, shared.as_mut())?;
    let mut shards = Vec::with_capacity(blocks.len());
    for (i, b) in blocks.iter_mut().enumerate() {
        shards.push(Shard::new(&plan, i as u32, b.as_mut())?);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build()?;

    let iterations = u64::from(options.rays).div_ceil(cells).max(2);
    let start = Instant::now();
    let mut sums = vec![[0.0; 3]; source.pixels()];
    let mut moments = vec![Moments::default(); positions.len()];
    for iteration in 0..iterations {
        source.begin(iteration as u32);
        session.begin_iteration(1);
        let stopped = pool.install(|| {
            let step = |shard: &mut Shard<'_>| {
                while shard.step(&session, Budget { rays: STEP_RAYS }) == StepResult::More {}
                let seconds = start.elapsed().as_secs_f64();
                let rays = session.counters().rays();
                let spp = (iteration * cells) as f64;
                observer.progress(&Progress { spp, rays, seconds, ..Progress::default() });
                observer.stop()
            };
            shards.par_iter_mut().map(step).collect::<Vec<_>>().contains(&true)
        });
        session.end_iteration(&shards)?;
        let mut estimates = vec![[[0.0; 3]; COEFFICIENTS]; positions.len()];
        for (pixel, before) in sums.iter_mut().enumerate() {
            let sum = session.film().pixel(pixel).sum;
            let Some((probe, direction)) = source.of_pixel(pixel as u32) else { continue };
            let scale = 4.0 * std::f64::consts::PI / cells as f64;
            for (estimate, y) in estimates[probe].iter_mut().zip(basis(direction)) {
                (0..3).for_each(|c| estimate[c] += scale * y * (sum[c] - before[c]));
            }
            *before = sum;
        }
        moments.iter_mut().zip(&estimates).for_each(|(m, e)| m.add(e));
        if stopped {
            break;
        }
    }
    let opaque = opaque(description);
    let backs = pool.install(|| back_shares(&scene, &opaque, positions));
    let probe = |((position, moments), backs): ((&[f32; 3], &Moments), f32)| {
        let [radiance, stderr] = moments.result();
        Probe { position: *position, radiance, stderr, backs, valid: backs <= options.most_backs }
    };
    Ok(positions.iter().zip(&moments).zip(backs).map(probe).collect())
}

/// Mean and spread of the iterations' estimates of all coefficients.
#[derive(Clone, Debug, Default)]
struct Moments {
    count: f64,
    mean: [[f64; 3]; COEFFICIENTS],
    spread: [[f64; 3]; COEFFICIENTS],
}

impl Moments {
    fn add(&mut self, estimate: &[[f64; 3]; COEFFICIENTS]) {
        self.count += 1.0;
        for (i, estimate) in estimate.iter().enumerate() {
            for (c, x) in estimate.iter().enumerate() {
                let d = x - self.mean[i][c];
                self.mean[i][c] += d / self.count;
                self.spread[i][c] += d * (x - self.mean[i][c]);
            }
        }
    }

    /// Means, and their standard errors: of a single estimate, itself.
    fn result(&self) -> [Harmonics; 2] {
        let n = self.count;
        let error = |i: usize, c: usize| match n > 1.0 {
            true => (self.spread[i][c] / (n * (n - 1.0))).sqrt(),
            false => self.mean[i][c].abs(),
        };
        let errors = std::array::from_fn(|i| std::array::from_fn(|c| error(i, c)));
        [Harmonics(self.mean), Harmonics(errors)]
    }
}

/// For each position the share of uniform directions that first meet the back of an opaque surface.
fn back_shares(scene: &Scene<'_>, opaque: &[bool], positions: &[[f32; 3]]) -> Vec<f32> {
    let sides = Sides::new(scene, opaque);
    let share = |probe: usize| {
        let [x, y, z] = positions[probe];
        let o = Vec3x8::splat(x, y, z);
        let backs = |packet: u32| {
            let sample = U32x8::from_fn(|i| 8 * packet + i as u32);
            let [u, v, ..] = Key8::camera(source::SEED, U32x8::splat(probe as u32), sample).uniforms(1);
            sides.backs(o, source::directions([u, v]), Mask8::all_lanes()).count()
        };
        (0..SIDE_RAYS / 8).map(backs).sum::<u32>() as f32 / SIDE_RAYS as f32
    };
    (0..positions.len()).into_par_iter().map(share).collect()
}

/// Probes as they are saved.
#[derive(Clone, Debug, Serialize)]
pub struct ProbeFile {
    convention: &'static str,
    probes: Vec<SavedProbe>,
}

#[derive(Clone, Debug, Serialize)]
struct SavedProbe {
    position: [f32; 3],
    valid: bool,
    backs: f32,
    coefficients: [[f32; 3]; COEFFICIENTS],
    stderr: [[f32; 3]; COEFFICIENTS],
}

/// What the coefficients in a file are.
const CONVENTION: &str = "incident radiance, linear Rec. 709, in real spherical harmonics of world directions: \
    index l (l + 1) + m, without the Condon-Shortley phase (Ramamoorthi and Hanrahan 2001, equation 3)";

impl ProbeFile {
    /// Of these probes, as numbers of single precision.
    pub fn new(probes: &[Probe]) -> Self {
        let short = |h: &Harmonics| h.0.map(|rgb| rgb.map(|x| x as f32));
        let save = |p: &Probe| SavedProbe {
            position: p.position,
            valid: p.valid,
            backs: p.backs,
            coefficients: short(&p.radiance),
            stderr: short(&p.stderr),
        };
        Self { convention: CONVENTION, probes: probes.iter().map(save).collect() }
    }
}

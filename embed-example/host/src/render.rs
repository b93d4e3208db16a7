//! Rendering a scene blob to a picture: what the program asks for and gets.

use crate::image::Picture;
use croupier::SceneError;
use serde::Serialize;
use std::collections::BTreeMap;
use std::{error, fmt};

/// When a render is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Samples per pixel, >= 1.
    Spp(u32),
    /// Wall-clock seconds, > 0. The image then depends on the machine.
    Seconds(f64),
    /// Rays of all kinds, >= 1; passed by at most one iteration.
    Rays(u64),
    /// Estimated relMSE of the whole image, > 0.
    Error(f64),
}

impl Target {
    /// Seconds left, from what has been done so far: work goes on at the same speed, and the squared error falls as 1 /
    /// work. `None` while nothing is known.
    pub fn seconds_left(&self, p: &Progress) -> Option<f64> {
        let by_part = |part: f64| p.seconds * (1.0 / part - 1.0);
        let left = match *self {
            Self::Spp(n) => by_part(p.spp / f64::from(n)),
            Self::Seconds(s) => s - p.seconds,
            Self::Rays(n) => by_part(p.rays as f64 / n as f64),
            Self::Error(e) => by_part(e / p.relmse_estimate?),
        };
        left.is_finite().then(|| left.max(0.0))
    }
}

/// What to render, besides the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Name of a roulette strategy that [`check_strategy`] accepts.
    pub strategy: String,
    /// When to stop.
    pub target: Target,
    /// Path segments from the camera; the scene's own if absent.
    pub max_depth: Option<u32>,
    /// Columns and rows; the camera's own if absent.
    pub size: Option<[u32; 2]>,
    /// Seed: another number gives another, independent image.
    pub seed: u64,
    /// Threads; 0 is one per processor. Does not change the image.
    pub threads: usize,
    /// Units of parallel work, >= 1. Part of what determines the image.
    pub shards: u32,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            strategy: "throughput".into(),
            target: Target::Spp(64),
            max_depth: None,
            size: None,
            seed: 0,
            threads: 0,
            shards: 16,
        }
    }
}

/// State of a render on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Mean samples per pixel so far.
    pub spp: f64,
    /// Rays so far.
    pub rays: u64,
    /// Wall-clock seconds so far.
    pub seconds: f64,
    /// Estimated relMSE of the image so far, as soon as there are two iterations to compare.
    pub relmse_estimate: Option<f64>,
}

/// Watches a render, and may end it. Called from the thread that renders and, [`Observer::stop`], from its workers.
pub trait Observer: Sync {
    /// Called a few times a second.
    fn progress(&self, progress: &Progress);
    /// True ends the render soon; what was rendered is still returned.
    fn stop(&self) -> bool;
}

/// Figures of a finished render.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RenderStats {
    /// Mean samples per pixel.
    pub spp: f64,
    /// Rays of all kinds.
    pub rays: u64,
    /// Wall-clock seconds of rendering.
    pub seconds: f64,
    /// 1e-6 rays / second.
    pub mrays_per_s: f64,
    /// Estimated relMSE of the whole image.
    pub relmse_estimate: Option<f64>,
    /// Its 95 % interval.
    pub relmse_interval: Option<[f64; 2]>,
    /// Part of the eight lanes that did work, by stage.
    pub lane_utilisation: BTreeMap<&'static str, f64>,
    /// Events that cost quality or were mended (full rings, bad samples, ...), by name.
    pub counters: BTreeMap<&'static str, u64>,
}

/// A rendered picture.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderResult {
    /// All layers.
    pub picture: Picture,
    /// Figures.
    pub stats: RenderStats,
    /// The observer ended it before its target.
    pub stopped_early: bool,
}

/// What a render of a scene takes.
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
}

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RenderError {
    /// The bytes are not a scene.
    Scene(SceneError),
    /// The integrator is not part of this build.
    NotAvailable,
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(e) => e.fmt(f),
            Self::NotAvailable => write!(f, "rendering is not part of this build"),
        }
    }
}

impl error::Error for RenderError {}

impl From<SceneError> for RenderError {
    fn from(e: SceneError) -> Self {
        Self::Scene(e)
    }
}

/// No strategy has this name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownStrategy;

impl fmt::Display for UnknownStrategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "known are {}, and fixed:S with a factor S from 0.05 to 20", STRATEGIES.join(", "))
    }
}

impl error::Error for UnknownStrategy {}

const STRATEGIES: &[&str] = &["none", "threshold", "contribution", "throughput", "albedo", "classic"];

/// Is `name` a strategy?
pub fn check_strategy(name: &str) -> Result<(), UnknownStrategy> {
    let factor = name.strip_prefix("fixed:").and_then(|s| s.parse::<f32>().ok());
    let fixed = factor.is_some_and(|s| (0.05..=20.0).contains(&s));
    if fixed || STRATEGIES.contains(&name) { Ok(()) } else { Err(UnknownStrategy) }
}

/// Renders a scene blob.
pub fn render(scene: &[u8], options: &RenderOptions, observer: &dyn Observer) -> Result<RenderResult, RenderError> {
    croupier::Scene::from_bytes(scene)?;
    let _ = (options, observer);
    Err(RenderError::NotAvailable)
}

/// What [`render`] would take, without rendering.
pub fn plan(scene: &[u8], options: &RenderOptions) -> Result<PlanSummary, RenderError> {
    croupier::Scene::from_bytes(scene)?;
    let _ = options;
    Err(RenderError::NotAvailable)
}

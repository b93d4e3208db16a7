//! Figures of paths, iterations and time, to compare roulette strategies with (EARS, SIGGRAPH 2022, Table 1, Fig. 9 and
//! section 6.2).

use crate::drive::{self, Forecast, GuideRecord, IterationRecord, Rendered, Target};
use croupier::Settings;
use serde::Serialize;
use std::fmt;

/// Figures of a render to compare roulette strategies with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Figures of the paths of the whole render.
    pub paths: Paths,
    /// Figures of every iteration.
    pub iterations: Vec<IterationFigures>,
    /// Figures of path guiding; absent if it is off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guiding: Option<GuidingFigures>,
    /// Time by part of the work.
    pub time: Vec<Part>,
}

/// Figures of the paths of a render (a row of Table 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Paths {
    /// Camera samples per pixel.
    pub spp: f64,
    /// Mean number of segments of a path from the camera to its end.
    pub path_length: f64,
    /// Mean number of paths that a camera sample becomes.
    pub paths_per_sample: f64,
    /// Mean roulette factor at the first hit; absent if nothing was hit.
    pub first_factor: Option<f64>,
}

/// Figures of an iteration (a point of Fig. 9). Costs are counted and do not depend on the machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IterationFigures {
    /// Camera samples per pixel that were asked for.
    pub samples: u32,
    /// Error of the picture made of one sample per pixel, by the objective; absent unless something is learned.
    pub variance: Option<f64>,
    /// Error in the worst pixels, which `variance` leaves out.
    pub outliers: Option<f64>,
    /// Mean counted cost of a camera sample ([`croupier::Counters::cost`]).
    pub cost: f64,
    /// Efficiency, 1 / (variance x cost).
    pub efficiency: Option<f64>,
    /// Leaves of the cache after the iteration.
    pub leaves: Option<u32>,
    /// Subdivisions of leaves for which there was no room so far. A leaf that remains too large counts again in each
    /// iteration.
    pub subdivisions_refused: Option<u64>,
    /// Estimated relMSE of the picture after the iteration; absent after a single sample.
    pub relmse_estimate: Option<f64>,
    /// Seconds, on the wall or by [`Observer::seconds`](crate::drive::Observer::seconds).
    pub seconds: f64,
    /// When the render was to end, as predicted after the iteration ([`drive::forecast`]); absent unless an error is the
    /// target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forecast: Option<Forecast>,
}

/// What path guiding has learned in the end, and whether it pays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GuidingFigures {
    /// Whether all pixels are guided; else some blocks of them are, to see whether it pays.
    pub enabled: bool,
    /// Predicted gain: squared error of the picture without guiding over that with it, at equal samples; absent if it was
    /// not asked for, or before enough samples.
    pub gain: Option<f64>,
    /// Relative standard error of the gain.
    pub gain_error: Option<f64>,
    /// Mean share of guided samples where the guide is asked, over the contributions that it learned from, 0 to 1.
    pub share: f64,
    /// Leaves of the octrees of places.
    pub leaves: u32,
    /// Nodes of the trees of directions.
    pub nodes: u32,
}

/// Time of a part of the work.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Name of the part.
    pub name: &'static str,
    /// Wall-clock seconds; of work that all threads share, CPU seconds over the number of threads.
    pub seconds: f64,
    /// Share of the whole render, 0 to 1.
    pub share: f64,
    /// Whether the time is contained in that of `tracing`. Such times are counts times the seconds of one operation in a
    /// loop of nothing else. `recording samples` is adding finished samples to the statistics, without the ledger.
    pub within_tracing: bool,
}

impl Statistics {
    /// Statistics of a finished render, with parts of tracing if it was calibrated.
    pub fn of(r: &Rendered) -> Self {
        let c = &r.counters;
        let over = |a: u64, b: u64| a as f64 / b.max(1) as f64;
        let first = |f: fn(&croupier::unstable::film::PixelAov) -> f64| r.aovs.iter().map(f).sum::<f64>();
        let hits = first(|a| a.vertices[0]);
        let pixels = u64::from(r.size[0]) * u64::from(r.size[1]);
        // the error is unknown until a pixel has two samples
        let mut samples = 0;
        let iterations = r.iterations.iter().map(|i| {
            samples += i.work.samples;
            IterationFigures::of(i, samples > 1)
        });
        Self {
            paths: Paths {
                spp: over(c.camera_samples, pixels),
                path_length: over(c.path_segments, c.paths()),
                paths_per_sample: over(c.paths(), c.camera_samples),
                first_factor: (hits > 0.0).then(|| first(|a| a.factor[0]) / hits),
            },
            iterations: iterations.collect(),
            guiding: r.guide.map(GuidingFigures::of),
            time: time(r),
        }
    }

    /// The statistics with what was predicted after every iteration, if the render was to stop at an error.
    #[must_use]
    pub fn with_forecasts(mut self, r: &Rendered, target: Target, settings: &Settings) -> Self {
        if let Target::Error(e) = target {
            for (n, figures) in self.iterations.iter_mut().enumerate() {
                figures.forecast = drive::forecast(e, settings.learns(), &r.iterations[..=n]);
            }
        }
        self
    }
}

impl GuidingFigures {
    fn of(g: GuideRecord) -> Self {
        let gain = g.watched.and_then(|w| w.gain);
        Self {
            enabled: g.watched.is_none_or(|w| w.enabled),
            gain: gain.map(|g| g.gain),
            gain_error: gain.map(|g| g.error),
            share: g.share,
            leaves: g.leaves,
            nodes: g.nodes,
        }
    }
}

impl IterationFigures {
    fn of(i: &IterationRecord, judged: bool) -> Self {
        // an iteration that was stopped may have measured nothing
        let picture = i.picture.filter(|p| p.cost > 0.0);
        let cost = i.counters.cost() / i.counters.camera_samples.max(1) as f64;
        let variance = picture.map(|p| p.variance);
        Self {
            samples: i.work.samples,
            variance,
            outliers: picture.map(|p| p.outliers),
            cost,
            efficiency: variance.map(|v| 1.0 / (v * cost)).filter(|e| e.is_finite()),
            leaves: i.cache.map(|c| c.leaves),
            subdivisions_refused: i.cache.map(|c| c.subdivisions_refused),
            relmse_estimate: judged.then_some(i.error.rel_mse),
            seconds: i.work.seconds,
            forecast: None,
        }
    }
}

fn time(r: &Rendered) -> Vec<Part> {
    let sum = |f: fn(&IterationRecord) -> f64| r.iterations.iter().map(f).sum::<f64>();
    let part = |name, seconds: f64, within_tracing| {
        let share = if r.seconds > 0.0 { seconds / r.seconds } else { 0.0 };
        Part { name, seconds, share, within_tracing }
    };
    let mut parts = vec![part("tracing", sum(|i| i.tracing), false)];
    if let Some(one) = r.calibration {
        let threads = r.threads.max(1) as f64;
        let (packets, samples) = (r.counters.look_ups.packets as f64, r.counters.samples_logged as f64);
        parts.push(part("looking up", packets * one.look_up / threads, true));
        parts.push(part("recording samples", samples * one.log / threads, true));
    }
    parts.push(part("merging pixels", sum(|i| i.merging), false));
    parts.push(part("estimating pixels", sum(|i| i.estimating), false));
    parts.push(part("building the tree", sum(|i| i.learning), false));
    parts
}

/// Tables of text.
impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = &self.paths;
        let mut table =
            vec![["spp", "path length", "paths per sample", "factor at first hit"].map(String::from).to_vec()];
        table.push(vec![digits(p.spp), digits(p.path_length), digits(p.paths_per_sample), optional(p.first_factor)]);
        write_table(f, &table)?;
        writeln!(f)?;
        let head =
            ["iteration", "samples", "variance", "outliers", "cost", "efficiency", "leaves", "relMSE so far", "s"];
        let mut table = vec![head.map(String::from).to_vec()];
        for (n, i) in self.iterations.iter().enumerate() {
            table.push(vec![
                (n + 1).to_string(),
                i.samples.to_string(),
                optional(i.variance),
                optional(i.outliers),
                digits(i.cost),
                optional(i.efficiency),
                i.leaves.map_or("-".into(), |n| n.to_string()),
                optional(i.relmse_estimate),
                digits(i.seconds),
            ]);
        }
        write_table(f, &table)?;
        if let Some(n) = self.iterations.last().and_then(|i| i.subdivisions_refused).filter(|n| *n > 0) {
            writeln!(f, "{n} subdivisions refused so far for lack of memory")?;
        }
        if let Some(g) = &self.guiding {
            let head = ["guiding", "predicted gain", "its relative error", "guided share", "leaves", "nodes"];
            let mut table = vec![head.map(String::from).to_vec()];
            let pixels = if g.enabled { "all pixels" } else { "some blocks" };
            table.push(vec![
                pixels.into(),
                optional(g.gain),
                optional(g.gain_error),
                format!("{:.1} %", 100.0 * g.share),
                g.leaves.to_string(),
                g.nodes.to_string(),
            ]);
            writeln!(f)?;
            write_table(f, &table)?;
        }
        writeln!(f)?;
        let mut table = vec![["part", "s", "share"].map(String::from).to_vec()];
        for p in &self.time {
            let name = if p.within_tracing { format!("of it {} (approximate)", p.name) } else { p.name.into() };
            table.push(vec![name, digits(p.seconds), format!("{:.2} %", 100.0 * p.share)]);
        }
        write_table(f, &table)
    }
}

/// Table with columns as wide as their widest cell, aligned to the right.
fn write_table(f: &mut fmt::Formatter<'_>, rows: &[Vec<String>]) -> fmt::Result {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|x| x.chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..columns).map(width).collect();
    for row in rows {
        let cells: Vec<_> = row.iter().zip(&widths).map(|(x, &w)| format!("{x:>w$}")).collect();
        writeln!(f, "{}", cells.join("  "))?;
    }
    Ok(())
}

fn optional(x: Option<f64>) -> String {
    x.map_or("-".into(), digits)
}

/// Number with three significant digits.
fn digits(x: f64) -> String {
    let size = x.abs();
    if size == 0.0 || !x.is_finite() {
        format!("{x}")
    } else if !(1e-3..1e6).contains(&size) {
        format!("{x:.2e}")
    } else {
        let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
        format!("{x:.decimals$}")
    }
}

//! Pictures: error over core-seconds by strategy, stated errors against true ones, predicted times, knobs, path
//! lengths.

use super::effort::Effort;
use super::ledger::{Curve, Depth, ForecastRecord, ForecastRun, Knob, Run, SceneRecord, Stated, StatedError};
use super::renders::{Reference, Subject, Watched, render};
use super::sums::{mean, quantile};
use super::timing::in_parallel;
use croupier::unstable::rrs::ParseError;
use croupier::{Settings, Strategy};
use croupier_host::drive::{self, DriveError};
use croupier_host::render::{RenderOptions, Target};

/// Strategies of short reports, of those in the core's table.
const FEW: [&str; 7] = ["none", "threshold:0.1", "classic", "albedo", "throughput", "adrrs", "ears"];

/// Path lengths to which a curve and a knob cut paths.
const CUT: u32 = 4;

/// Strategies whose stated errors are checked, and those that are run to an error.
const STATED: [&str; 3] = ["none", "classic", "ears"];
const FORECAST: [&str; 2] = ["classic", "ears"];

/// Path lengths of [`Depth`].
const DEPTHS: [u32; 12] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32];

/// Changes of one setting each: name and value. What this build does not have, or not with this value, is left out.
const KNOBS: [[&str; 2]; 23] = [
    ["rrs", "none"],
    ["rrs", "classic"],
    ["rrs", "adrrs"],
    ["rrs", "threshold:0.1"],
    ["max-depth", "4"],
    ["max-depth", "8"],
    ["shadow-roulette", "false"],
    ["control-variate", "cached"],
    ["adaptive", "true"],
    ["sampler", "hashed"],
    ["guiding", "off"],
    ["guiding", "on"],
    ["pixel-estimator", "blocks"],
    ["objective", "absolute"],
    ["cache-bytes", "128KiB"],
    ["cache-bytes", "1MiB"],
    ["ledger", "64"],
    ["learn-samples", "1"],
    ["factors", "0.05:1"],
    ["split-budget", "8"],
    ["ring", "16"],
    ["ring", "64"],
    ["shards", "1"],
];

/// Numbers from which seeds are counted, so that no two kinds of renders share any.
const REFERENCE_SEED: u64 = 1 << 40;
const STATED_SEED: u64 = 2 << 40;
const FORECAST_SEED: u64 = 3 << 40;

/// Options of the program with a strategy, with the size and depth of the subject.
fn settings_of(subject: &Subject<'_>, strategy: &str) -> Result<Settings, ParseError> {
    let Settings { size, max_depth, .. } = subject.settings;
    Ok(Settings { size, max_depth, ..RenderOptions::new(Strategy::parse(strategy)?).settings })
}

/// Variants of the curves: name, settings, and whether they change the expectation.
fn variants(subject: &Subject<'_>, effort: &Effort) -> Vec<(String, Settings, bool)> {
    let all = Strategy::TABLE.iter().map(|row| row.0).filter(|name| !name.starts_with("fixed"));
    let names: Vec<String> = if effort.all_strategies {
        // of the biased one two, so that a floor can be seen
        all.map(|name| name.split(['[', ':']).next().unwrap_or(name).to_string())
            .chain(["threshold:0.1".into()])
            .collect()
    } else {
        FEW.map(String::from).to_vec()
    };
    let of = |name: String| {
        let settings = settings_of(subject, &name).ok()?;
        Some((name, settings, settings.strategy.is_biased()))
    };
    let mut variants: Vec<_> = names.into_iter().filter_map(of).collect();
    if subject.settings.max_depth > CUT {
        let cut = Settings { max_depth: CUT, ..subject.settings };
        variants.push((format!("ears, at most {CUT} segments"), cut, true));
    }
    variants
}

/// How many curves, knobs and strategies with stated errors there are: for the time to state.
pub(super) fn counts(subject: &Subject<'_>, effort: &Effort) -> [usize; 3] {
    [variants(subject, effort).len(), knobs(subject).len(), STATED.len()]
}

/// Knobs that this build has: name, settings, whether they change the expectation.
fn knobs(subject: &Subject<'_>) -> Vec<(String, Settings, bool)> {
    let of = |[name, value]: [&str; 2]| {
        let mut settings = if name == "rrs" { settings_of(subject, value).ok()? } else { subject.settings };
        if name != "rrs" {
            settings.set(name, value).ok()?;
        }
        let cut = name == "max-depth";
        let changed = settings != subject.settings && (!cut || settings.max_depth < subject.settings.max_depth);
        changed.then(|| (format!("{name} {value}"), settings, cut || settings.strategy.is_biased()))
    };
    KNOBS.into_iter().filter_map(of).collect()
}

/// Core-seconds of a sample per pixel with the default strategy, from a short render.
pub(super) fn pilot(subject: &Subject<'_>) -> Result<f64, DriveError> {
    let watched = render(subject, subject.settings, REFERENCE_SEED - 1, Target::Spp(4), None)?;
    Ok(watched.core_seconds() / 4.0)
}

/// A render to be done.
struct Job {
    settings: Settings,
    seed: u64,
    target: Target,
    referenced: bool,
}

/// Measures everything about a scene. `done` gets the share of the renders that are finished.
pub(super) fn measure(
    subject: &Subject<'_>,
    effort: &Effort,
    sample: f64,
    done: impl Fn(f64) + Sync,
) -> Result<SceneRecord, DriveError> {
    let [width, height] = subject.settings.size;
    let mut record = SceneRecord {
        name: subject.name.clone(),
        triangles: subject.scene.triangles.len(),
        lights: subject.scene.lights.len(),
        size: [width, height],
        max_depth: subject.settings.max_depth,
        ..SceneRecord::default()
    };
    // the references first: everything else is measured by them
    let halves = [0, 1].map(|n| REFERENCE_SEED + n);
    let render_half = |seed: &u64| render(subject, subject.settings, *seed, Target::Seconds(effort.reference), None);
    let halves = in_parallel(&halves, render_half, |_| ()).into_iter().collect::<Result<Vec<_>, _>>()?;
    let spp: Vec<f64> = halves.iter().map(|h| f64::from(h.rendered.spp)).collect();
    let pictures: Vec<_> = halves.iter().map(Watched::picture).collect();
    let [a, b] = <[Vec<f64>; 2]>::try_from(pictures).unwrap_or_default();
    let reference = Reference::new([a, b]);
    (record.reference_spp, record.reference_error) = (mean(&spp), reference.error());

    let variants = variants(subject, effort);
    let knobs = knobs(subject);
    let jobs = jobs(subject, effort, sample, &variants, &knobs);
    let total = jobs.len();
    let run = |job: &Job| {
        render(subject, job.settings, job.seed, job.target, job.referenced.then_some(&reference)).map(|w| (job.seed, w))
    };
    let results = in_parallel(&jobs, run, |n| done(n as f64 / total as f64));
    let mut results = results.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter();
    let mut take = |n: usize| results.by_ref().take(n).collect::<Vec<_>>();

    // in the order of `jobs`: seed by seed
    let by_seed: Vec<_> = (0..effort.seeds).map(|_| take(variants.len())).collect();
    for (i, (name, _, biased)) in variants.iter().enumerate() {
        let runs: Vec<_> = by_seed.iter().map(|row| &row[i]).collect();
        let bias = bias(&runs.iter().map(|r| r.1.picture()).collect::<Vec<_>>(), &reference);
        record.curves.push(Curve {
            name: name.clone(),
            biased: *biased,
            bias: bias.0,
            bias_error: bias.1,
            runs: runs.iter().map(|(seed, watched)| Run { seed: *seed, ..watched.run() }).collect(),
        });
    }
    let by_seed: Vec<_> = (0..effort.seeds).map(|_| take(knobs.len() + 1)).collect();
    for (i, (name, _, biased)) in knobs.iter().enumerate() {
        let of = |i: usize| by_seed.iter().map(|row| [row[i].1.core_seconds(), row[i].1.rel_mse()]).collect();
        record.knobs.push(Knob { name: name.clone(), biased: *biased, default: of(0), changed: of(i + 1) });
    }
    for spp in effort.stated {
        for strategy in STATED {
            let renders = take(effort.stated_seeds as usize).into_iter().map(|(_, w)| StatedError {
                measured: w.rel_mse(),
                estimate: w.rendered.error.rel_mse,
                low: w.rendered.error.low,
                high: w.rendered.error.high,
                resolved: w.rendered.error.is_resolved(),
                at_least: w.rendered.error.at_least,
            });
            record.stated.push(Stated { strategy: strategy.into(), spp: *spp, renders: renders.collect() });
        }
    }
    for (max_depth, (_, w)) in depths(subject).zip(take(depths(subject).count())) {
        let picture = w.picture();
        let luminance = picture.chunks_exact(3).map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]);
        record.depths.push(Depth {
            max_depth,
            luminance: luminance.sum::<f64>() / (picture.len() / 3).max(1) as f64,
            core_seconds: w.core_seconds(),
            rays: w.rendered.counters.rays(),
        });
    }
    record.forecasts = forecasts(subject, effort, &record)?;
    Ok(record)
}

/// Depths that make a difference in the scene.
fn depths(subject: &Subject<'_>) -> impl Iterator<Item = u32> {
    let deepest = subject.settings.max_depth;
    let last = (!DEPTHS.contains(&deepest)).then_some(deepest).filter(|d| *d <= 64);
    DEPTHS.into_iter().filter(move |d| *d <= deepest).chain(last)
}

/// All renders but references and those to an error, interleaved: variants take turns for every seed.
fn jobs(
    subject: &Subject<'_>,
    effort: &Effort,
    sample: f64,
    variants: &[(String, Settings, bool)],
    knobs: &[(String, Settings, bool)],
) -> Vec<Job> {
    let spp = ((effort.knob / sample.max(1e-9)).round() as u32).clamp(4, 1024);
    let mut jobs = Vec::new();
    for seed in 1..=effort.seeds {
        let target = Target::Seconds(effort.curve);
        jobs.extend(variants.iter().map(|v| Job { settings: v.1, seed, target, referenced: true }));
    }
    for seed in 1..=effort.seeds {
        let all = [subject.settings].into_iter().chain(knobs.iter().map(|k| k.1));
        jobs.extend(all.map(|settings| Job { settings, seed, target: Target::Spp(spp), referenced: true }));
    }
    for spp in effort.stated {
        for strategy in STATED {
            let settings = settings_of(subject, strategy).unwrap_or(subject.settings);
            let seeds = (1..=effort.stated_seeds).map(|n| STATED_SEED + n);
            jobs.extend(seeds.map(|seed| Job { settings, seed, target: Target::Spp(*spp), referenced: true }));
        }
    }
    let classic = settings_of(subject, "classic").unwrap_or(subject.settings);
    jobs.extend(depths(subject).map(|max_depth| {
        let settings = Settings { max_depth, ..classic };
        Job { settings, seed: 1, target: Target::Spp(2 * spp), referenced: false }
    }));
    jobs
}

/// Squared relative bias: the product of the differences of two independent pictures from the reference, over all
/// pairs; and its standard error, by leaving one of three pictures or more out after the other.
fn bias(pictures: &[Vec<f64>], reference: &Reference) -> (f64, Option<f64>) {
    let n = pictures.len();
    let product = |i: usize, j: usize| {
        let (a, b) = (&pictures[i], &pictures[j]);
        // both halves in both places
        0.5 * (reference.product(a, b) + reference.product(b, a))
    };
    let pairs: Vec<_> = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| (i, j, product(i, j))).collect();
    let without = |k: usize| {
        let rest: Vec<_> = pairs.iter().filter(|p| p.0 != k && p.1 != k).map(|p| p.2).collect();
        mean(&rest)
    };
    let all = mean(&pairs.iter().map(|p| p.2).collect::<Vec<_>>());
    if n < 3 {
        return (all, None);
    }
    let deviations: f64 = (0..n).map(|k| (without(k) - all).powi(2)).sum();
    (all, Some(((n - 1) as f64 / n as f64 * deviations).sqrt()))
}

/// Renders to the error that the curves reached in the seconds asked for, with what they predicted.
fn forecasts(subject: &Subject<'_>, effort: &Effort, record: &SceneRecord) -> Result<Vec<ForecastRun>, DriveError> {
    let mut jobs = Vec::new();
    for strategy in FORECAST {
        let Some(curve) = record.curves.iter().find(|c| c.name == strategy) else { continue };
        let ends: Vec<f64> =
            curve.runs.iter().filter_map(|r| r.points.last()).map(|p| p.rel_mse * p.core_seconds).collect();
        let target = quantile(&ends, 0.5) / effort.forecast;
        if target > 0.0 {
            jobs.extend((1..=effort.forecasts).map(|n| (strategy, target, FORECAST_SEED + n)));
        }
    }
    let run = |&(strategy, target, seed): &(&str, f64, u64)| {
        let settings = settings_of(subject, strategy).unwrap_or(subject.settings);
        let rendered = render(subject, settings, seed, Target::Error(target), None)?.rendered;
        let learns = settings.learns();
        let mut passed = 0.0;
        let made = rendered.iterations.iter().enumerate().filter_map(|(n, i)| {
            passed += i.work.seconds;
            let f = drive::forecast(target, learns, &rendered.iterations[..=n])?;
            Some((passed, ForecastRecord { seconds: f.seconds, interval: f.interval }))
        });
        let made = made.collect();
        let seconds = rendered.iterations.iter().map(|i| i.work.seconds).sum();
        Ok(ForecastRun { strategy: strategy.into(), target, seconds, made })
    };
    in_parallel(&jobs, run, |_| ()).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a setting that is renamed, a value that has become the default or is out of its range.
    #[test]
    fn every_change_of_a_setting_is_one() {
        let default = RenderOptions::default().settings;
        for [name, value] in KNOBS {
            let mut settings = default;
            match name {
                "rrs" => settings = RenderOptions::new(Strategy::parse(value).unwrap()).settings,
                _ => settings.set(name, value).unwrap_or_else(|e| panic!("{name} {value}: {e}")),
            }
            assert!(settings != default, "{name} {value} is the default");
        }
    }

    /// Pictures of a bias and noise that is known. Killed by: pairs of a picture with itself, a standard error without
    /// the factor of the jackknife.
    #[test]
    fn bias_is_told_from_noise() {
        let n = 3000;
        let noise = |seed: u64| {
            let mut x = seed;
            move || {
                x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (x >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            }
        };
        let picture = |seed, bias: f64, scale: f64| {
            let mut noise = noise(seed);
            (0..n).map(|_| 1.0 + bias + scale * noise()).collect::<Vec<f64>>()
        };
        let reference = Reference::new([picture(1, 0.0, 0.1), picture(2, 0.0, 0.1)]);
        let pictures: Vec<_> = (10..18).map(|seed| picture(seed, 0.2, 1.0)).collect();
        let (found, error) = bias(&pictures, &reference);
        let error = error.unwrap();
        assert!((found - 0.04 / 1.01).abs() < 4.0 * error && error < 0.01, "{found} +- {error}");
        let pictures: Vec<_> = (10..18).map(|seed| picture(seed, 0.0, 1.0)).collect();
        let (found, error) = bias(&pictures, &reference);
        assert!(found.abs() < 4.0 * error.unwrap(), "{found} +- {error:?}");
        assert_eq!(bias(&pictures[..2], &reference).1, None);
    }
}

//! What the ledger says, in few numbers: for tables, figures and CSV files.

use super::ledger::{Curve, ForecastRun, Knob, Ledger, Spread};
use super::sums::{bootstrap, geometric_mean, log_interpolate, mean, share_interval};
use std::error::Error;

/// Number with three significant digits; `-` if there is none.
pub(super) fn number(x: f64) -> String {
    let size = x.abs();
    if !x.is_finite() {
        return if x.is_nan() { "-".into() } else { format!("{x}") };
    }
    if size == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{x:.1e}");
    }
    let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
    let text = format!("{x:.decimals$}");
    // 0.100 is an interval's end, 0.1 the label of an axis: zeros behind the point say nothing here
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Core-seconds to an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reached {
    /// Mean over the seeds, with 95 % interval.
    In {
        seconds: f64,
        interval: [f64; 2],
        /// The renders end before.
        extrapolated: bool,
    },
    /// The bias alone is as large.
    Never,
}

/// When the mean error of a curve's renders comes down to `level`: where it does, or where it would as bias² + V /
/// time.
pub(super) fn reached(curve: &Curve, level: f64) -> Reached {
    let bias = if curve.biased { curve.bias.max(0.0) } else { 0.0 };
    if bias >= level {
        return Reached::Never;
    }
    // V of each seed, at its end
    let ends: Vec<_> = curve.runs.iter().filter_map(|r| r.points.last()).collect();
    let v: Vec<f64> = ends.iter().map(|p| (p.rel_mse - bias) * p.core_seconds).collect();
    let time = |drawn: &[usize]| mean(&drawn.iter().map(|i| v[*i]).collect::<Vec<_>>()) / (level - bias);
    let all: Vec<usize> = (0..v.len()).collect();
    let last = mean(&ends.iter().map(|p| p.core_seconds).collect::<Vec<_>>());
    let extrapolated = last_error(curve) > level;
    let by_end = time(&all);
    let interval = bootstrap(v.len(), time).map(|t| t.max(0.0));
    if extrapolated {
        return Reached::In { seconds: by_end, interval, extrapolated };
    }
    let seconds = crossing(curve, level).unwrap_or(by_end).min(last);
    // as wide, in proportion, as that at the end
    Reached::In { seconds, interval: interval.map(|t| t / by_end * seconds), extrapolated }
}

/// Mean over the seeds of the last relMSE of a curve.
pub(super) fn last_error(curve: &Curve) -> f64 {
    mean(&curve.runs.iter().filter_map(|r| r.points.last()).map(|p| p.rel_mse).collect::<Vec<_>>())
}

/// First time at which the mean error of all runs is `level`.
fn crossing(curve: &Curve, level: f64) -> Option<f64> {
    let lines: Vec<Vec<_>> =
        curve.runs.iter().map(|r| r.points.iter().map(|p| (p.core_seconds, p.rel_mse)).collect()).collect();
    let first = lines.iter().filter_map(|l| l.first()).map(|p| p.0).fold(0.0, f64::max);
    let last = lines.iter().filter_map(|l| l.last()).map(|p| p.0).fold(f64::INFINITY, f64::min);
    let error = |t: f64| mean(&lines.iter().filter_map(|l| log_interpolate(l, t)).collect::<Vec<_>>());
    let times = (0..=400).map(|i| first * (last / first).powf(f64::from(i) / 400.0).min(last / first));
    times.into_iter().find(|t| error(*t) <= level)
}

/// Ratios of time, error and their product of a changed setting over the default, with 95 % intervals.
pub(super) fn change(knob: &Knob) -> [Spread; 3] {
    let n = knob.default.len().min(knob.changed.len());
    let sum = |rows: &[[f64; 2]], drawn: &[usize], c: usize| drawn.iter().map(|i| rows[*i][c]).sum::<f64>();
    let ratio = |drawn: &[usize], c: usize| sum(&knob.changed, drawn, c) / sum(&knob.default, drawn, c);
    let of = |f: &dyn Fn(&[usize]) -> f64| {
        let all: Vec<usize> = (0..n).collect();
        let [low, high] = bootstrap(n, f);
        Spread { low, middle: f(&all), high }
    };
    [of(&|d| ratio(d, 0)), of(&|d| ratio(d, 1)), of(&|d| ratio(d, 0) * ratio(d, 1))]
}

/// How often intervals of a level hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Calibrated {
    pub(super) level: f64,
    pub(super) share: f64,
    pub(super) interval: [f64; 2],
}

/// Levels, and half the width of their intervals in standard deviations.
const LEVELS: [(f64, f64); 6] =
    [(0.5, 0.674_490), (0.68, 0.994_458), (0.8, 1.281_552), (0.9, 1.644_854), (0.95, 1.959_964), (0.99, 2.575_829)];

/// By strategy, over all scenes and lengths; of the intervals that are given.
pub(super) fn calibration(ledger: &Ledger) -> Vec<(String, Vec<Calibrated>)> {
    let mut strategies: Vec<&str> = Vec::new();
    let stated = || ledger.scenes.iter().flat_map(|s| &s.stated);
    stated().for_each(|s| {
        if !strategies.contains(&&*s.strategy) {
            strategies.push(&s.strategy)
        }
    });
    let of = |strategy: &str, z: f64| {
        let (mut held, mut n) = (0, 0);
        for s in stated().filter(|s| s.strategy == strategy) {
            for r in s.renders.iter().filter(|r| r.resolved) {
                // the interval is normal
                held += usize::from((r.measured - r.estimate).abs() <= z / 1.96 * (r.high - r.estimate));
                n += 1;
            }
        }
        (held, n)
    };
    let line = |strategy: &str| {
        let point = |(level, z): (f64, f64)| {
            let (held, n) = of(strategy, z);
            Calibrated { level, share: held as f64 / n.max(1) as f64, interval: share_interval(held, n) }
        };
        LEVELS.map(point).to_vec()
    };
    // renders without any interval say nothing of intervals
    let given = |s: &&str| of(s, 1.0).1 > 0;
    strategies.into_iter().filter(given).map(|s| (s.to_string(), line(s))).collect()
}

/// Expected relMSE of renders of one length: their mean.
pub(super) fn expected(s: &super::ledger::Stated) -> f64 {
    mean(&s.renders.iter().map(|r| r.measured).collect::<Vec<_>>())
}

/// What renders of one length say of their error, and whether it is so. By the error of each picture: what a strategy
/// learns, and with it the expected error, differs from seed to seed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Verdicts {
    /// Renders that give an interval, and those whose interval holds the picture's error.
    pub(super) given: usize,
    pub(super) held: usize,
    /// Of the intervals given, those that hold the mean error of all seeds.
    pub(super) held_mean: usize,
    /// Renders that give a lower bound only: unresolved.
    pub(super) unresolved: usize,
    /// Of these, where the picture's error is not below the bound.
    pub(super) at_least: usize,
    /// Of these, where an interval would not have held it: it was needed to give none.
    pub(super) would_miss: usize,
}

impl Verdicts {
    pub(super) fn of<'a>(stated: impl IntoIterator<Item = &'a super::ledger::Stated>) -> Self {
        let mut v = Self::default();
        for s in stated {
            let mean = expected(s);
            for r in &s.renders {
                let holds = (r.low..=r.high).contains(&r.measured);
                if r.resolved {
                    v.given += 1;
                    v.held += usize::from(holds);
                    v.held_mean += usize::from((r.low..=r.high).contains(&mean));
                } else {
                    v.unresolved += 1;
                    v.at_least += usize::from(r.measured >= r.at_least);
                    v.would_miss += usize::from(!holds);
                }
            }
        }
        v
    }

    /// Renders of which what they say is true: the interval holds, or the error is not below the bound.
    pub(super) fn right(&self) -> usize {
        self.held + self.at_least
    }

    pub(super) fn renders(&self) -> usize {
        self.given + self.unresolved
    }
}

/// The last prediction before a third of the time had passed, or the first: over the time it took, and whether the
/// interval held it.
pub(super) fn at_a_third(run: &ForecastRun) -> Option<(f64, bool)> {
    let before = run.made.iter().rev().find(|m| m.0 <= run.seconds / 3.0);
    let (_, f) = before.or(run.made.first())?;
    Some((f.seconds / run.seconds, f.interval[0] <= run.seconds && run.seconds <= f.interval[1]))
}

/// Predictions at a third: how many, within 25 %, with intervals that held.
pub(super) fn forecast_quality<'a>(runs: impl Iterator<Item = &'a ForecastRun>) -> [usize; 3] {
    let found: Vec<_> = runs.filter_map(at_a_third).collect();
    let near = found.iter().filter(|(ratio, _)| (ratio - 1.0).abs() <= 0.25).count();
    [found.len(), near, found.iter().filter(|f| f.1).count()]
}

/// How many times less time one strategy needs than another to the level, in the geometric mean over scenes.
pub(super) fn saved(ledger: &Ledger, less: &str, more: &str, level: f64) -> f64 {
    let seconds = |scene: &super::ledger::SceneRecord, name: &str| {
        let curve = scene.curves.iter().find(|c| c.name == name)?;
        if let Reached::In { seconds, .. } = reached(curve, level) { Some(seconds) } else { None }
    };
    geometric_mean(ledger.scenes.iter().filter_map(|s| Some(seconds(s, more)? / seconds(s, less)?)))
}

/// All tables as CSV: name and text.
pub(super) fn csv(ledger: &Ledger) -> Result<Vec<(String, String)>, Box<dyn Error>> {
    let table = |name: &str, head: &[&str], rows: Vec<Vec<String>>| -> Result<(String, String), Box<dyn Error>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(head)?;
        for row in rows {
            writer.write_record(row)?;
        }
        Ok((name.into(), String::from_utf8(writer.into_inner()?)?))
    };
    let kernels = ledger.kernels.iter().map(|k| {
        let worst = k.worst.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" ");
        let texts = [&k.function, &k.variant, &k.instruction_set].map(String::clone).to_vec();
        let count = |n: usize| k.missed.map_or(String::new(), |m| m[n].to_string());
        let counts = vec![k.instructions.map_or(String::new(), |x| x.to_string()), count(0), count(1)];
        let numbers = [k.max_ulp, k.mean_ulp, k.ns.low, k.ns.middle, k.ns.high].map(|x| x.to_string());
        [texts, vec![k.arguments.to_string(), k.exhaustive.to_string(), worst], numbers.to_vec(), counts].concat()
    });
    let components = ledger.components.iter().map(|c| {
        let optional = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        let numbers = [c.ns.low, c.ns.middle, c.ns.high].map(|x| x.to_string()).to_vec();
        let (eval, twin) = (c.against_eval, c.against_twin);
        let errors =
            [c.instructions, eval.map(|e| e[0]), eval.map(|e| e[1]), twin.map(|t| t.max), twin.map(|t| t.mean)];
        let noise = twin.and_then(|t| t.noise);
        let errors = errors.into_iter().chain([noise, twin.map(|t| t.count as f64)]).map(optional).collect();
        let texts = [&c.group, &c.name, &c.operation, &c.arithmetic, &c.instruction_set];
        [texts.map(String::clone).to_vec(), numbers, errors].concat()
    });
    let (mut errors, mut stated, mut knobs, mut forecasts, mut depths) = (vec![], vec![], vec![], vec![], vec![]);
    for s in &ledger.scenes {
        for c in &s.curves {
            for r in &c.runs {
                errors.extend(r.points.iter().map(|p| {
                    let numbers = [p.core_seconds, p.spp, p.rays as f64, p.rel_mse].map(|x| x.to_string());
                    [vec![s.name.clone(), c.name.clone(), r.seed.to_string()], numbers.to_vec()].concat()
                }));
            }
        }
        for t in &s.stated {
            stated.extend(t.renders.iter().map(|r| {
                let numbers = [r.measured, r.estimate, r.low, r.high].map(|x| x.to_string()).to_vec();
                let names = vec![s.name.clone(), t.strategy.clone(), t.spp.to_string()];
                [names, numbers, vec![r.resolved.to_string()]].concat()
            }));
        }
        for k in &s.knobs {
            let numbers = change(k).into_iter().flat_map(|r| [r.low, r.middle, r.high]).map(|x| x.to_string());
            knobs.push(vec![s.name.clone(), k.name.clone(), k.biased.to_string()].into_iter().chain(numbers).collect());
        }
        for f in &s.forecasts {
            forecasts.extend(f.made.iter().map(|(passed, m)| {
                let numbers = [f.target, f.seconds, *passed, m.seconds, m.interval[0], m.interval[1]];
                let texts = vec![s.name.clone(), f.strategy.clone()];
                [texts, numbers.map(|x| x.to_string()).to_vec()].concat()
            }));
        }
        depths.extend(s.depths.iter().map(|d| {
            let numbers = [f64::from(d.max_depth), d.luminance, d.core_seconds, d.rays as f64];
            [vec![s.name.clone()], numbers.map(|x| x.to_string()).to_vec()].concat()
        }));
    }
    let function =
        ["function", "variant", "instruction set", "arguments", "exhaustive", "worst at", "max ULP", "mean ULP"];
    let times = ["ns low", "ns", "ns high", "instructions", "missed", "of"];
    let ratios = ["time low", "time", "time high", "error low", "error", "error high", "both low", "both", "both high"];
    Ok(vec![
        table("kernels", &[&function[..], &times].concat(), kernels.collect())?,
        table(
            "components",
            &[
                "group",
                "name",
                "operation",
                "arithmetic",
                "instruction set",
                "ns low",
                "ns",
                "ns high",
                "instructions",
                "max against eval",
                "median against eval",
                "max against f64",
                "mean against f64",
                "standard error",
                "results",
            ],
            components.collect(),
        )?,
        table("errors", &["scene", "variant", "seed", "core-seconds", "spp", "rays", "relMSE"], errors)?,
        table(
            "stated",
            &["scene", "strategy", "spp", "measured relMSE", "stated relMSE", "low", "high", "resolved"],
            stated,
        )?,
        table("settings", &[&["scene", "setting", "biased"], &ratios[..]].concat(), knobs)?,
        table(
            "forecasts",
            &["scene", "strategy", "target", "seconds", "passed", "predicted", "low", "high"],
            forecasts,
        )?,
        table("depths", &["scene", "max depth", "luminance", "core-seconds", "rays"], depths)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::super::ledger::{ForecastRecord, Point, Run, Stated, StatedError};
    use super::*;

    fn curve(biased: bool, bias: f64, v: f64, end: f64) -> Curve {
        let point = |t: f64| Point { core_seconds: t, spp: 100.0 * t, rays: 1, rel_mse: bias + v / t };
        let run = |seed| Run { seed, points: [0.01, 0.1, 1.0].map(|t| point(t * end)).to_vec() };
        Curve { name: "x".into(), biased, runs: (0..4).map(run).collect(), bias, bias_error: None }
    }

    /// Killed by: a floor that is crossed, V of the whole error, a crossing on linear scales.
    #[test]
    fn times_to_an_error() {
        let Reached::In { seconds, extrapolated: false, .. } = reached(&curve(false, 0.0, 0.02, 10.0), 0.01) else {
            panic!("reached")
        };
        assert!((seconds / 2.0 - 1.0).abs() < 0.02, "{seconds}");
        let Reached::In { seconds, extrapolated: true, interval } = reached(&curve(true, 0.005, 0.02, 1.0), 0.01)
        else {
            panic!("extrapolated")
        };
        assert!((seconds - 4.0).abs() < 1e-9 && interval.iter().all(|t| (t - 4.0).abs() < 1e-9));
        assert_eq!(reached(&curve(true, 0.02, 0.02, 1.0), 0.01), Reached::Never);
    }

    /// Killed by: a prediction after the third, an interval that is not looked at, the mean of all renders in place of a
    /// picture's error or the reverse.
    #[test]
    fn qualities() {
        let record = |seconds, low, high| ForecastRecord { seconds, interval: [low, high] };
        let made = vec![(0.1, record(5.0, 4.0, 6.0)), (0.3, record(1.2, 0.9, 1.4)), (0.5, record(1.0, 0.9, 1.1))];
        let run = ForecastRun { strategy: "ears".into(), target: 0.1, seconds: 1.0, made };
        assert_eq!(at_a_third(&run), Some((1.2, true)));
        let late = ForecastRun { made: vec![(0.6, record(2.0, 1.5, 3.0))], ..run.clone() };
        assert_eq!(forecast_quality([run, late].iter()), [2, 1, 1]);
        let render = |measured, estimate, by, resolved| StatedError {
            measured,
            estimate,
            low: estimate - by,
            high: estimate + by,
            resolved,
            at_least: estimate,
        };
        let renders = vec![
            render(0.5, 0.55, 0.1, true),
            render(1.4, 1.05, 0.1, true),
            render(1.1, 1.05, 0.1, true),
            render(1.0, 0.9, 0.05, false),
            render(1.0, 1.1, 0.2, false),
            render(1.0, 0.95, 0.1, false),
        ];
        let stated = Stated { strategy: "ears".into(), spp: 4, renders };
        let verdicts = Verdicts::of([&stated]);
        assert_eq!(expected(&stated), 1.0);
        assert_eq!(verdicts, Verdicts { given: 3, held: 2, held_mean: 2, unresolved: 3, at_least: 2, would_miss: 1 });
        assert_eq!((verdicts.right(), verdicts.renders()), (4, 6));
    }

    /// Killed by: digits that are lost, zeros that pretend digits.
    #[test]
    fn numbers() {
        let texts = [0.0123456, 1.0, 0.1, 123456.0, 42.42, 0.0, f64::NAN, 1e-5, 100.0].map(number);
        assert_eq!(texts, ["0.0123", "1", "0.1", "1.2e5", "42.4", "0", "-", "1.0e-5", "100"]);
    }
}

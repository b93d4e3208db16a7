//! The page: one file without anything from elsewhere.

use super::figures::{Figure, LEVEL, series_of};
use super::ledger::{Component, Group, Kernel, Ledger, SceneRecord};
use super::sums::share_interval;
use super::tables::{
    Reached, Verdicts, calibration, change, expected, forecast_quality, last_error, number, reached, saved,
};
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Value, context};
use std::error::Error;

/// The page of a ledger, with its figures.
pub(super) fn html(ledger: &Ledger, figures: &[Figure]) -> Result<String, Box<dyn Error>> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
    environment.add_template("page", include_str!("page.html"))?;
    let figure = |f: &Figure| {
        let inline = Value::from_safe_string(f.inline());
        context! { name => &*f.name, title => &*f.title, caption => &*f.caption, svg => inline }
    };
    let of = |names: &[String]| -> Vec<Value> {
        names.iter().filter_map(|name| figures.iter().find(|f| f.name == *name)).map(figure).collect()
    };
    let named = |names: &[&str]| of(&names.iter().map(|n| (*n).to_string()).collect::<Vec<_>>());
    let scenes: Vec<_> = ledger
        .scenes
        .iter()
        .enumerate()
        .map(|(n, s)| {
            let curves = of(&[format!("error-{n}"), format!("times-{n}")]);
            let more = of(&[format!("settings-{n}"), format!("depth-{n}")]);
            let about = format!(
                "{}x{} pixels, {} triangles, {} lights, paths of at most {} segments. Reference: two halves of {} \
                 samples per pixel, relMSE {} each.",
                s.size[0],
                s.size[1],
                s.triangles,
                s.lights,
                s.max_depth,
                number(s.reference_spp),
                number(s.reference_error)
            );
            context! { name => &*s.name, about, curves, more, rows => curve_rows(s) }
        })
        .collect();
    let page = environment.get_template("page")?.render(context! {
        css => Value::from_safe_string(include_str!("page.css").into()),
        made => Value::from(Serde(ledger.made.clone())),
        title_date => &*ledger.made.date,
        headlines => headlines(ledger),
        legend => legend(ledger),
        scenes,
        seeds => ledger.scenes.iter().flat_map(|s| &s.curves).map(|c| c.runs.len()).max().unwrap_or(0),
        reliability => named(&["reliability"]),
        stated => stated_rows(ledger),
        verdicts => verdict_rows(ledger),
        flagged => Verdicts::of(ledger.scenes.iter().flat_map(|s| &s.stated)).unresolved,
        forecasts => named(&["forecasts"]),
        forecast_rows => forecast_rows(ledger),
        kernels => named(&["kernels"]),
        kernel_rows => kernel_rows(ledger, Group::Function),
        exhaustive => ledger.kernels.iter().any(|k| k.exhaustive),
        primitives => named(&["primitives"]),
        primitive_rows => kernel_rows(ledger, Group::Primitive),
        components => named(&[
            "components-scattering",
            "twins-scattering",
            "components-lights",
            "twins-lights",
            "components-media",
            "twins-media",
        ]),
        component_rows => ledger.components.iter().map(component_row).collect::<Vec<_>>(),
        limits => limits(ledger),
    })?;
    Ok(page)
}

/// A number with what it says.
fn headline(figure: String, says: String) -> Value {
    context! { figure, says }
}

/// What the page says in a minute.
fn headlines(ledger: &Ledger) -> Vec<Value> {
    let mut found = Vec::new();
    let ratio = saved(ledger, "ears", "classic", LEVEL);
    if ratio.is_finite() {
        let n = ledger.scenes.len();
        let scenes = if n == 1 { "one scene".into() } else { format!("{n} scenes, geometric mean") };
        let says = format!("times as long as ears does classic take to 1 % relMSE: {scenes}");
        found.push(headline(number(ratio), says));
    }
    for (strategy, line) in calibration(ledger).into_iter().filter(|c| c.0 == "ears") {
        if let Some(p) = line.iter().find(|p| p.level == 0.95) {
            let [low, high] = p.interval.map(|x| 100.0 * x);
            let says =
                format!("of the 95 % intervals of {strategy} hold the picture's error ({low:.0} to {high:.0} %)");
            found.push(headline(format!("{:.0} %", 100.0 * p.share), says));
        }
    }
    let [n, near, _] = forecast_quality(ledger.scenes.iter().flat_map(|s| &s.forecasts));
    if n > 0 {
        let says = "of the durations predicted after a third of the time are right within 25 %".into();
        found.push(headline(format!("{near} of {n}"), says));
    }
    let leaks = |ours: bool| {
        let of =
            ledger.kernels.iter().filter(|k| k.function == "triangle" && k.variant.starts_with("croupier") == ours);
        of.filter_map(|k| k.missed).find(|[_, aimed]| *aimed > 0)
    };
    if let Some([missed, aimed]) = leaks(true) {
        let other = leaks(false).map_or(String::new(), |[n, of]| {
            format!("; a plain test loses {} %", number(100.0 * n as f64 / of as f64))
        });
        let says = format!("of {} rays at shared edges pass between the triangles{other}", number(aimed as f64));
        found.push(headline(missed.to_string(), says));
    }
    let functions = ledger.kernels.iter().filter(|k| k.group == Group::Function);
    let worst = functions.filter(|k| k.variant.starts_with("croupier") && k.max_ulp.is_finite());
    if let Some(k) = worst.max_by(|a, b| a.max_ulp.total_cmp(&b.max_ulp)) {
        let bound = if k.exhaustive { "over all arguments" } else { "over the arguments tried" };
        let says = format!("ULP is the largest error of any elementary function ({}), {bound}", k.function);
        found.push(headline(number(k.max_ulp), says));
    }
    found
}

/// Names of the curves with their colours.
fn legend(ledger: &Ledger) -> Vec<Value> {
    let mut names: Vec<(&str, bool)> = Vec::new();
    for c in ledger.scenes.iter().flat_map(|s| &s.curves) {
        if !names.iter().any(|n| n.0 == c.name) {
            names.push((&c.name, c.biased));
        }
    }
    names.into_iter().map(|(name, biased)| context! { name, biased, series => series_of(name) }).collect()
}

fn between([low, high]: [f64; 2]) -> String {
    format!("{} to {}", number(low), number(high))
}

/// Table beside the curves of a scene.
fn curve_rows(scene: &SceneRecord) -> Vec<Value> {
    let row = |c: &super::ledger::Curve| {
        let (time, interval) = match reached(c, LEVEL) {
            Reached::In { seconds, interval, extrapolated } => {
                let about = if extrapolated { "about " } else { "" };
                (format!("{about}{} s", number(seconds)), between(interval))
            }
            Reached::Never => ("not reached: bias floor".into(), "-".into()),
        };
        let known = c.bias_error.is_some_and(|error| c.bias > 2.0 * error);
        let floor = if known { number(c.bias) } else { "none found".into() };
        let ends: Vec<f64> = c.runs.iter().filter_map(|r| r.points.last()).map(|p| p.rel_mse).collect();
        let last = c.runs.first().and_then(|r| r.points.last());
        context! {
            name => &*c.name,
            series => series_of(&c.name),
            time,
            interval,
            bias => if c.biased { floor } else { "unbiased".into() },
            end => number(last_error(c)),
            largest => number(ends.iter().copied().fold(f64::NAN, f64::max)),
            spp => number(last.map_or(f64::NAN, |p| p.spp)),
        }
    };
    scene.curves.iter().map(row).collect()
}

fn stated_rows(ledger: &Ledger) -> Vec<Value> {
    let rows = ledger.scenes.iter().flat_map(|scene| scene.stated.iter().map(move |s| (scene, s)));
    rows.map(|(scene, s)| {
        let truth = expected(s);
        let stated = s.renders.iter().map(|r| r.estimate).sum::<f64>() / s.renders.len().max(1) as f64;
        let v = Verdicts::of([s]);
        let interval = share_interval(v.held, v.given).map(|x| 100.0 * x);
        context! {
            scene => &*scene.name,
            strategy => &*s.strategy,
            spp => s.spp,
            truth => number(truth),
            ratio => number(stated / truth),
            held => if v.given > 0 { format!("{} of {}", v.held, v.given) } else { "none given".into() },
            held_mean => if v.given > 0 { format!("{} of {}", v.held_mean, v.given) } else { "-".into() },
            interval => if v.given > 0 { format!("{:.0} to {:.0} %", interval[0], interval[1]) } else { "-".into() },
            unresolved => v.unresolved,
            // 95 is outside of what the renders allow
            fails => v.given > 0 && interval[1] < 95.0,
        }
    })
    .collect()
}

/// How right it is what renders say of their error, interval or lower bound, by scene and strategy.
fn verdict_rows(ledger: &Ledger) -> Vec<Value> {
    let mut rows = Vec::new();
    for scene in &ledger.scenes {
        let mut strategies: Vec<&str> = scene.stated.iter().map(|s| &*s.strategy).collect();
        strategies.dedup();
        strategies.sort_unstable();
        strategies.dedup();
        for strategy in strategies {
            let v = Verdicts::of(scene.stated.iter().filter(|s| s.strategy == strategy));
            let of = |n: usize, all: usize| if all > 0 { format!("{n} of {all}") } else { "-".into() };
            rows.push(context! {
                scene => &*scene.name,
                strategy,
                unresolved => of(v.unresolved, v.renders()),
                at_least => of(v.at_least, v.unresolved),
                would_miss => of(v.would_miss, v.unresolved),
                held => of(v.held, v.given),
                right => format!("{:.0} %", 100.0 * v.right() as f64 / v.renders().max(1) as f64),
            });
        }
    }
    rows
}

fn forecast_rows(ledger: &Ledger) -> Vec<Value> {
    let mut rows = Vec::new();
    for scene in &ledger.scenes {
        for strategy in ["classic", "ears"] {
            let of = || scene.forecasts.iter().filter(|f| f.strategy == strategy);
            let [n, near, held] = forecast_quality(of());
            let Some(first) = of().next() else { continue };
            let seconds: Vec<f64> = of().map(|f| f.seconds).collect();
            rows.push(context! {
                scene => &*scene.name,
                strategy,
                target => number(first.target),
                seconds => number(super::sums::quantile(&seconds, 0.5)),
                near => format!("{near} of {n}"),
                held => format!("{held} of {n}"),
            });
        }
    }
    rows
}

fn kernel_rows(ledger: &Ledger, group: Group) -> Vec<Value> {
    ledger.kernels.iter().filter(|k| k.group == group).map(kernel_row).collect()
}

fn kernel_row(k: &Kernel) -> Value {
    context! {
        function => &*k.function,
        variant => &*k.variant,
        max => number(k.max_ulp),
        bound => k.exhaustive,
        mean => number(k.mean_ulp),
        worst => k.worst.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(", "),
        arguments => number(k.arguments as f64),
        ns => number(k.ns.middle),
        quarters => between([k.ns.low, k.ns.high]),
        instructions => k.instructions.map_or("-".into(), number),
        missed => k.missed.map_or("-".into(), |[n, of]| format!("{n} of {}", number(of as f64))),
    }
}

fn component_row(c: &Component) -> Value {
    let against = |n: usize| c.against_eval.map_or("-".into(), |e| format!("{:.1e}", e[n]));
    context! {
        group => &*c.group,
        name => &*c.name,
        operation => &*c.operation,
        ns => number(c.ns.middle),
        quarters => between([c.ns.low, c.ns.high]),
        largest => against(0),
        median => against(1),
        arithmetic => &*c.arithmetic,
        instructions => c.instructions.map_or("-".into(), number),
        twin => c.against_twin.map_or("-".into(), |t| format!("{:.1e}", t.max)),
        mean => c.against_twin.map_or("-".into(), |t| match t.noise {
            Some(noise) => format!("{:.1e} of means, standard error {noise:.1e}", t.mean),
            None => format!("{:.1e}", t.mean),
        }),
    }
}

/// What the page cannot say.
fn limits(ledger: &Ledger) -> Vec<String> {
    let mut limits = vec![];
    let renders = ledger.scenes.iter().flat_map(|s| &s.curves).map(|c| c.runs.len()).min().unwrap_or(0);
    if renders < 10 {
        limits.push(format!(
            "Curves and changes are of {renders} seeds: intervals from so few are themselves rough, and tend to be too \
             narrow."
        ));
    }
    if !ledger.kernels.iter().any(|k| k.exhaustive) {
        limits.push(
            "Functions were tried at a part of all arguments: largest errors are the largest found, no bounds.".into(),
        );
    }
    let [components, twins] = [false, true]
        .map(|any| ledger.components.iter().filter(|c| any <= c.against_twin.is_some()).collect::<Vec<_>>());
    let without = components.iter().filter(|c| c.against_twin.is_none() && c.operation != "gather").count();
    if twins.is_empty() {
        limits.push("This ledger has no errors of components against f64.".into());
    } else if without > 0 {
        limits.push(format!(
            "{without} of {} operations of components have no f64 twin: albedos, which only steer roulette, and \
             flights and transmittances that are random by design are compared by their means or not at all.",
            components.len()
        ));
    }
    if ledger.made.commit.contains("uncommitted") || ledger.made.commit == "unknown" {
        limits.push("The program was not built from a commit alone.".into());
    }
    if ledger.scenes.iter().flat_map(|s| &s.knobs).any(|k| change(k).iter().any(|r| !r.middle.is_finite())) {
        limits.push("Some changes of settings have no ratio: a picture was without error.".into());
    }
    limits.push(
        "What has no setting has no row among the settings: there is one triangle test, which is watertight; lights \
         are chosen by power, from 32 lights on by the tree of lights, and both kinds of sampling are weighted by the \
         power heuristic (MIS). Arithmetic is compiled in: its row comes from the ledger of another build, measured \
         apart and not in turns."
            .into(),
    );
    limits.push("Pictures are small, so that statistics of the scene learn from few samples in an iteration.".into());
    limits
}

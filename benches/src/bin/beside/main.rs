//! Croupier beside Mitsuba 3: error times cost of both, by one yardstick.
//!
//! Sides are strategies of this library and the two samplers of Mitsuba's path tracer, with its own roulette
//! (`benches/mitsuba/render.py`, in a process of its own). Each renders every scene with the same number of seeds for
//! the same core-seconds: the CPU time of one thread, without loading, baking and compiling. For a seed all sides
//! render in turn, in an order that is rotated from seed to seed, so that what else the machine does hits all of them.
//!
//! The error needs no reference, whose noise would be in it: it is the variance of a pixel between the pictures of a
//! side, over the square of its mean (plus 0.01), which is that over all pictures of all sides ([`Measured::of`]). It
//! is the mean over channels and pixels without the worst ones of the side itself; how many are left out matters where
//! a few bright samples carry the error, so there is a table for each of three shares. The figure is this error x the
//! mean core-seconds, and does not depend on where a render ended as long as its error falls as 1 / cost. Ratios are
//! the figure of the better one of Mitsuba's samplers over that of a strategy, with the interval of the jackknife over
//! the seeds ([`gains`]); above 1 the strategy is better.
//!
//! Errors mean nothing if the sides render different pictures. A table compares the mean picture of each with that of
//! the other renderer, in blocks of 16x16 pixels: their mean relative difference, and z-scores as in `references`,
//! which has notes about where Mitsuba's pictures are known to be wrong.
//!
//! `--write` puts a run of all scenes of the folder into `benches/results/beside.md`.

mod mitsuba;
mod yardstick;

use clap::Parser;
use croupier_benches::exit::exit_code;
use croupier_benches::measure;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::digits;
use croupier_benches::subject::Subject;
use croupier_benches::variant::Variant;
use croupier_host::render::Target;
use mitsuba::{Mitsuba, SAMPLERS};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use yardstick::{LogRatio, Measured, Side, TRIMS, gains, mean};

const NAME: &str = "beside";

/// Not in the means over the scenes: Mitsuba's picture lacks light, so the two do not render the same (`NOTES` of the
/// benchmark `references`).
const DIFFERENT: [&str; 1] = ["volumetric_caustic"];

#[derive(Parser)]
#[command(about = "Table of error times cost beside Mitsuba 3")]
struct Args {
    /// Folder of the scenes, with `tools/convert.py`.
    #[arg(long, default_value = "../shared/scenes")]
    scenes: PathBuf,
    /// Only these scenes; several with commas.
    #[arg(long = "scene", value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Strategies of ours, written as in `efficiency`; several with commas. `ears+shadow+auto` is the program's default.
    #[arg(
        long = "strategy",
        value_name = "NAME",
        value_delimiter = ',',
        default_values = ["classic", "adrrs", "ears+shadow+auto"]
    )]
    strategies: Vec<String>,
    /// Independent seeds, at least 2; intervals need 3.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(2..))]
    seeds: u32,
    /// Core-seconds of each render.
    #[arg(long, default_value_t = 20.0, value_parser = positive)]
    seconds: f64,
    /// A Python that has the packages `mitsuba` and `numpy`.
    #[arg(long, value_name = "PATH", default_value = "python3")]
    python: PathBuf,
    /// Write benches/results/beside.md; needs everything.
    #[arg(long, conflicts_with_all = ["only", "strategies"])]
    write: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite()).ok_or_else(|| "not a time above 0".into())
}

/// All renders of a scene: strategies in the order of the options, then Mitsuba's samplers.
struct Group {
    scene: String,
    sides: Vec<Side>,
    measured: Measured,
    /// Of the strategies over Mitsuba, by [`TRIMS`].
    gains: Vec<[LogRatio; 3]>,
}

struct Report<'a> {
    args: &'a Args,
    strategies: Vec<Variant>,
    groups: Vec<Group>,
}

impl Report<'_> {
    fn ours(&self) -> Vec<usize> {
        (0..self.strategies.len()).collect()
    }

    fn theirs(&self) -> Vec<usize> {
        (self.strategies.len()..self.strategies.len() + SAMPLERS.len()).collect()
    }

    fn names(&self) -> Vec<String> {
        let samplers = SAMPLERS.map(|s| format!("Mitsuba {s}"));
        self.strategies.iter().map(|s| s.name.clone()).chain(samplers).collect()
    }

    /// Renders a scene; what Mitsuba says of itself.
    fn render(&mut self, scene: &str) -> Result<String, Box<dyn Error>> {
        let subject = Subject::open(&self.args.scenes, scene)?;
        let mut mitsuba = Mitsuba::start(&self.args.python, &self.args.scenes.join(scene))?;
        let names = self.names();
        let mut sides: Vec<Side> = names.iter().map(|_| Side::default()).collect();
        for seed in 0..self.args.seeds as usize {
            for i in 0..names.len() {
                let k = (i + seed) % names.len();
                self.render_one(&subject, &mut mitsuba, k, seed as u64, &mut sides[k])
                    .map_err(|e| format!("{}, seed {seed}: {e}", names[k]))?;
                let side = &sides[k];
                let [spp, seconds] = [&side.samples, &side.core_seconds].map(|v| digits(v[seed]));
                eprintln!("{scene}, {}, seed {seed}: {spp} spp, {seconds} core-s", names[k]);
            }
        }
        let measured = Measured::of(&sides)?;
        let gains = gains(&sides, &measured, &self.ours(), &self.theirs())?;
        self.groups.push(Group { scene: scene.into(), sides, measured, gains });
        Ok(mitsuba.about.clone())
    }

    fn render_one(
        &self,
        subject: &Subject,
        mitsuba: &mut Mitsuba,
        k: usize,
        seed: u64,
        side: &mut Side,
    ) -> Result<(), Box<dyn Error>> {
        let seconds = self.args.seconds;
        let (picture, samples, core_seconds) = match self.strategies.get(k) {
            Some(variant) => {
                let run = measure::render(subject, variant, seed, Target::Seconds(seconds), TRIMS[0])?;
                let samples = run.spp();
                (run.picture, samples, run.end.core_seconds)
            }
            None => {
                let r = mitsuba.render(SAMPLERS[k - self.strategies.len()], seed, seconds)?;
                if r.not_finite > 0 {
                    eprintln!("Mitsuba: {} values of its passes are not finite, counted as 0", r.not_finite);
                }
                (r.picture, r.samples, r.core_seconds)
            }
        };
        side.pictures.push(picture);
        side.samples.push(samples);
        side.core_seconds.push(core_seconds);
        Ok(())
    }

    /// What holds for all tables.
    fn facts(&self, about: String) -> Vec<(String, String)> {
        let renders = format!("{} seeds of {} core-seconds, one thread each", self.args.seeds, self.args.seconds);
        let mean = format!("of ratios, geometric, without {}", DIFFERENT.join(", "));
        let facts = [
            ("renders", renders),
            ("Mitsuba", format!("{about}, its default roulette (rr_depth 5)")),
            ("figures", "relative variance of a pixel x core-seconds".into()),
            ("ratios", "Mitsuba's better sampler over the strategy [95 % interval by the jackknife over seeds]".into()),
            ("mean over the scenes", mean),
        ];
        facts.map(|(key, value)| (key.into(), value)).into()
    }

    /// Figures and ratios without the worst pixels: scenes in rows.
    fn table(&self, trim: usize) -> Table {
        let over = self.strategies.iter().map(|s| format!("Mitsuba / {}", s.name));
        let columns: Vec<String> = ["scene".into()].into_iter().chain(self.names()).chain(over).collect();
        let title = format!("Without the worst {} % of the pixels", 100.0 * TRIMS[trim]);
        let mut table = Table::new(&title, &columns.join(", "));
        for g in &self.groups {
            let figures = g.measured.figures.iter().map(|f| digits(f[trim]));
            let ratios = g.gains.iter().map(|gain| ratio(gain[trim]));
            table.add([g.scene.clone()].into_iter().chain(figures).chain(ratios));
        }
        let counted: Vec<&Group> = self.groups.iter().filter(|g| !DIFFERENT.contains(&&*g.scene)).collect();
        if counted.len() > 1 {
            let none = self.names().into_iter().map(|_| String::new());
            let of = |i: usize| combined(&counted.iter().map(|g| g.gains[i][trim]).collect::<Vec<_>>());
            let means = (0..self.strategies.len()).map(|i| ratio(of(i)));
            table.add(["mean".into()].into_iter().chain(none).chain(means));
        }
        table
    }

    /// What was rendered, and whether it is the same.
    fn renders(&self) -> Result<Table, Box<dyn Error>> {
        let columns = "scene, side, samples per pixel, core-seconds, mean difference from the other renderer, rms z, \
                       beyond 3, largest z";
        let mut table = Table::new("Renders", columns);
        let (ours, theirs) = (self.ours(), self.theirs());
        for g in &self.groups {
            for (k, name) in self.names().into_iter().enumerate() {
                let side = &g.sides[k];
                let agreement = g.measured.agreement(k, if k < ours.len() { &theirs } else { &ours })?;
                table.add([
                    g.scene.clone(),
                    name,
                    digits(mean(&side.samples)),
                    digits(mean(&side.core_seconds)),
                    format!("{:+.2} %", 100.0 * agreement.difference),
                    format!("{:.2}", agreement.scores.rms),
                    format!("{:.1} %", 100.0 * agreement.scores.beyond3),
                    format!("{:.1}", agreement.scores.max),
                ]);
            }
        }
        Ok(table)
    }

    fn tables(&self) -> Result<Vec<Table>, Box<dyn Error>> {
        Ok((0..TRIMS.len()).map(|trim| self.table(trim)).chain([self.renders()?]).collect())
    }
}

/// The geometric mean of ratios, whose errors are independent.
fn combined(ratios: &[LogRatio]) -> LogRatio {
    let n = ratios.len() as f64;
    let squares: Option<f64> = ratios.iter().map(|r| r.1.map(|half| half * half)).sum();
    LogRatio(ratios.iter().map(|r| r.0).sum::<f64>() / n, squares.map(|s| s.sqrt() / n))
}

fn ratio(LogRatio(ratio, half): LogRatio) -> String {
    let interval = half.map_or(String::new(), |h| format!(" [{:.2}, {:.2}]", (ratio - h).exp(), (ratio + h).exp()));
    format!("{:.2}x{interval}", ratio.exp())
}

/// All scenes of a folder that Mitsuba can render.
fn scenes(folder: &Path) -> Result<Vec<String>, Box<dyn Error>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))? {
        let entry = entry?;
        if entry.path().join("mitsuba.xml").is_file() {
            names.extend(entry.file_name().into_string().ok());
        }
    }
    if names.is_empty() {
        return Err(format!("{}: no folder in it has a file mitsuba.xml", folder.display()).into());
    }
    names.sort();
    Ok(names)
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    let names = if args.only.is_empty() { scenes(&args.scenes)? } else { args.only.clone() };
    if let Some(name) = names.iter().find(|name| !args.scenes.join(name).is_dir()) {
        return Err(format!("there is no scene {name} in {}", args.scenes.display()).into());
    }
    let strategies = args.strategies.iter().map(|s| Variant::parse(s)).collect::<Result<_, _>>()?;
    let mut report = Report { args, strategies, groups: Vec::new() };
    let mut about = String::new();
    for name in &names {
        about = report.render(name).map_err(|e| format!("{name}: {e}"))?;
        // long runs print what they have
        for table in (0..TRIMS.len()).map(|trim| report.table(trim)) {
            println!("{}: {}", table.title, table.row(&[name]).unwrap_or_default().join(" | "));
        }
    }
    results.header.extend(report.facts(about));
    results.tables = report.tables()?;
    results.header.iter().for_each(|(key, value)| println!("- {key}: {value}"));
    results.tables.iter().for_each(|t| print!("\n{t}"));
    if args.write {
        eprintln!("wrote {}", results.write(NAME)?.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()).map(|()| true))
}

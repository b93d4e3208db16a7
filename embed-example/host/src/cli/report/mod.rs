//! `croupier report`: what accuracy costs in time, as one page.
//!
//! | file | does | must not know |
//! |---|---|---|
//! | `ledger` | every number of a report | how it is measured or shown |
//! | `effort` | how much is measured | |
//! | `timing` | CPU time, work for all processors | what is measured |
//! | `sums` | medians, intervals | |
//! | `made` | date, commit, machine | |
//! | `kernels`, `primitives` | elementary functions; tests of triangles and boxes, sums | the page |
//! | `components` | scattering models, lights, media | the page |
//! | `twins` | errors against f64 and instructions, as the benchmarks found them | the page |
//! | `renders`, `images` | pictures and their errors | the page |
//! | `figures` | plots of the ledger as SVG | how it was measured |
//! | `tables` | the ledger as CSV, numbers as text | how it was measured |
//! | `page` | the page, of figures and tables | how it was measured |

mod components;
mod effort;
mod figures;
mod images;
mod kernels;
mod ledger;
mod made;
mod page;
mod primitives;
mod renders;
mod sums;
mod tables;
mod timing;
mod twins;

use super::console::{Outcome, note, say};
use super::progress::Measuring;
use super::scene::{self, CORNELL, SceneBytes, SceneFlags};
use super::values::json_path;
use croupier::{Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::render::RenderOptions;
use croupier_host::text;
use effort::Effort;
use ledger::{FORMAT, Format, Ledger};
use renders::Subject;
use serde_json::{Number, Value};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;
use twins::Twins;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Scenes, as of `render`; three built-in ones if absent
    scenes: Vec<PathBuf>,
    /// Measure less: three minutes on two cores with the built-in scenes
    #[arg(long, conflicts_with = "ledger")]
    quick: bool,
    /// Folder for the page, its figures, tables and the ledger; it is made
    #[arg(short, long, value_name = "DIR", default_value = "report")]
    out: PathBuf,
    /// Measure nothing: make the page from this ledger
    #[arg(long, value_name = "LEDGER.json", value_parser = json_path, conflicts_with = "scenes")]
    ledger: Option<PathBuf>,
    /// Add functions and components of another ledger, of a build with the feature `fast` or for another instruction
    /// set, and what its arithmetic changes in scenes that both have; may be repeated
    #[arg(long, value_name = "LEDGER.json", value_parser = json_path)]
    join: Vec<PathBuf>,
    /// Measure next to nothing, to see whether a page can be made
    #[arg(long, hide = true, conflicts_with_all = ["ledger", "quick"])]
    tiny: bool,
    #[command(flatten)]
    flags: SceneFlags,
}

impl Args {
    fn effort(&self) -> Effort {
        if self.tiny {
            Effort::TINY
        } else if self.quick {
            Effort::QUICK
        } else {
            Effort::FULL
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Outcome {
    std::fs::create_dir_all(&args.out).map_err(|e| format!("cannot make {}: {e}", text::path(&args.out)))?;
    let mut ledger = match &args.ledger {
        Some(path) => read(path)?,
        None => measure(args)?,
    };
    for path in &args.join {
        if !ledger.join(read(path)?) {
            note(&format!("{} has no function that is not there yet", text::path(path)));
        }
    }
    let mut value = serde_json::to_value(&ledger)?;
    shorten(&mut value);
    let written = write(args, &serde_json::from_value(value)?)?;
    say(&format!("wrote {}", written.iter().map(|p| text::path(p)).collect::<Vec<_>>().join(", ")))
}

/// Nine digits: as many as tell numbers of `f32` apart; others are below what is measured.
fn shorten(value: &mut Value) {
    match value {
        Value::Number(n) if n.is_f64() => {
            let short = n.as_f64().and_then(|x| Number::from_f64(format!("{x:.8e}").parse().ok()?));
            *n = short.unwrap_or_else(|| n.clone());
        }
        Value::Array(all) => all.iter_mut().for_each(shorten),
        Value::Object(all) => all.values_mut().for_each(shorten),
        _ => (),
    }
}

fn read(path: &Path) -> Result<Ledger, Box<dyn Error>> {
    let name = || text::path(path);
    let bytes = std::fs::read(path).map_err(|e| format!("cannot read {}: {e}", name()))?;
    let format: Format = serde_json::from_slice(&bytes).map_err(|e| format!("{}: no ledger: {e}", name()))?;
    if format.format != FORMAT {
        let (found, by) = (format.format, format.made.commit);
        let what = format!("a ledger of format {found}, this program reads {FORMAT}");
        return Err(format!("{}: {what}; the program of commit {by} has made it, and reads it", name()).into());
    }
    Ok(serde_json::from_slice(&bytes).map_err(|e| format!("{}: no ledger: {e}", name()))?)
}

/// Writes ledger, page, figures and tables; the files, the page first. What was read is never written over: a page that
/// is made again beside its ledger leaves that as it is.
fn write(args: &Args, ledger: &Ledger) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let given = args.ledger.iter().chain(&args.join).chain(&args.scenes);
    let read: Vec<_> = given.filter_map(|p| p.canonicalize().ok()).collect();
    let own = args.ledger.as_ref().filter(|_| args.join.is_empty()).and_then(|p| p.canonicalize().ok());
    let figures = figures::all(ledger)?;
    let mut files = vec![("index.html".to_string(), page::html(ledger, &figures)?)];
    files.push(("ledger.json".into(), serde_json::to_string(ledger)?));
    files.extend(tables::csv(ledger)?.into_iter().map(|(name, text)| (format!("{name}.csv"), text)));
    files.extend(figures.iter().map(|f| (format!("{}.svg", f.name), f.file())));
    let mut written = Vec::new();
    for (name, text) in files {
        let path = args.out.join(name);
        let there = path.canonicalize().ok();
        if there.is_some() && there == own {
            continue;
        }
        if there.is_some_and(|p| read.contains(&p)) {
            return Err(format!("{} was read, and would be written over: give another --out", text::path(&path)).into());
        }
        std::fs::write(&path, text).map_err(|e| format!("cannot write {}: {e}", text::path(&path)))?;
        written.push(path);
    }
    Ok(written)
}

/// A scene by name.
struct Source {
    name: String,
    bytes: SceneBytes,
}

fn sources(args: &Args, effort: &Effort) -> Result<Vec<Source>, Box<dyn Error>> {
    if args.scenes.is_empty() {
        let scenes = [
            ("box with blocks", builtin::cornell_blocks()),
            ("box with spheres", builtin::cornell_box()),
            ("still life", builtin::showcase()),
        ];
        let baked = |(name, scene): (&str, _)| {
            let baked = bake(&scene, &BakeOptions::default(), |_, _| {})?;
            Ok(Source { name: name.into(), bytes: SceneBytes::Baked(baked) })
        };
        return scenes.into_iter().take(effort.scenes).map(baked).collect();
    }
    let open = |path: &PathBuf| {
        let opened = scene::open(Some(path), &args.flags)?;
        // no path: reports are shown around
        let stem = path.file_stem().map_or_else(|| CORNELL.into(), |s| s.to_string_lossy().into_owned());
        Ok(Source { name: stem, bytes: opened.bytes })
    };
    args.scenes.iter().map(open).collect()
}

/// A size of about so many pixels with the shape of the scene's picture.
fn size_of(scene: &Scene<'_>, pixels: u32) -> [u32; 2] {
    let [w, h] = scene.camera.size.map(f64::from);
    let scale = (f64::from(pixels) / (w * h)).sqrt();
    [w, h].map(|x| ((x * scale).round() as u32).max(8))
}

fn measure(args: &Args) -> Result<Ledger, Box<dyn Error>> {
    let effort = args.effort();
    let begun = Instant::now();
    let mut ledger = Ledger { format: FORMAT, made: made::here(effort.name), ..Ledger::default() };
    let bar = Measuring::start();
    let sources = sources(args, &effort)?;
    let mut subjects = Vec::new();
    for source in &sources {
        let scene = Scene::from_bytes(&source.bytes).map_err(|e| format!("{}: {e}", source.name))?;
        let settings = Settings { size: size_of(&scene, effort.pixels), ..RenderOptions::default().settings };
        subjects.push(Subject { name: source.name.clone(), scene, settings: settings.with_scene(&scene) });
    }
    bar.show("pilot", 0.0);
    let samples = subjects.iter().map(images::pilot).collect::<Result<Vec<f64>, _>>()?;
    let [curves, knobs, stated] = subjects.first().map_or([0; 3], |s| images::counts(s, &effort));
    let functions = effort.functions();
    let images = effort.core_seconds(curves, knobs, stated, &samples);
    let seconds = (images + functions) / timing::threads() as f64 + 10.0;
    ledger.made.seconds_stated = seconds;
    // all of it, of the same scenes with more pixels
    let larger: Vec<_> =
        samples.iter().map(|s| s * f64::from(Effort::FULL.pixels) / f64::from(effort.pixels)).collect();
    let [curves, knobs, stated] = subjects.first().map_or([0; 3], |s| images::counts(s, &Effort::FULL));
    let all = Effort::FULL.core_seconds(curves, knobs, stated, &larger) + Effort::FULL.functions();
    ledger.made.seconds_of_all = all / timing::threads() as f64 + 10.0;
    let whole = match effort.name == Effort::FULL.name {
        true => String::new(),
        false => format!("; the full one: about {}", duration(ledger.made.seconds_of_all)),
    };
    say(&format!(
        "{} scenes, {} report: about {} on {} cores that do nothing else{whole}",
        subjects.len(),
        effort.name,
        duration(seconds),
        timing::threads()
    ))?;
    let twins = Twins::of_this_build();
    let share = functions / (functions + images);
    ledger.kernels = kernels::measure(&effort, &twins, |n, of| bar.show("functions", share * n as f64 / of as f64));
    bar.show("components", share);
    ledger.kernels.extend(primitives::measure(&effort, &twins)?);
    ledger.components = components::measure(&effort, &twins)?;
    let part = (1.0 - share) / subjects.len().max(1) as f64;
    for (n, (subject, sample)) in subjects.iter().zip(&samples).enumerate() {
        let before = share + part * n as f64;
        let scene = images::measure(subject, &effort, *sample, |done| bar.show(&subject.name, before + part * done));
        ledger.scenes.push(scene.map_err(|e| format!("{}: {e}", subject.name))?);
    }
    drop(bar);
    ledger.made.seconds_taken = begun.elapsed().as_secs_f64();
    say(&format!("measured in {}", duration(ledger.made.seconds_taken)))?;
    Ok(ledger)
}

/// Duration in words.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{s:.0} seconds"),
        s if s < 6000.0 => format!("{:.0} minutes", s / 60.0),
        s => format!("{:.1} hours", s / 3600.0),
    }
}

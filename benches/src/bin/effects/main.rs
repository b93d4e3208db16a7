//! What each effect costs: instructions per ray where it is absent, present and used, and bytes of machine code.
//!
//! An effect is *absent* where a scene that does not call for it is traced by kernels without it, *present* where the
//! same scene is traced by kernels with it, and *used* where a scene that calls for it is. Each row has its own
//! profile, compiled into this program: what the base scene calls for, and the effect. The second table shows the
//! profiles that hosts choose from, the third real scenes: in a profile of exactly their effects, in the one that a
//! host chooses, in that of all effects, and as they were before media existed
//! (`results/instructions-before-media.md`), where their paths are still the same.
//!
//! Instructions are counted by callgrind in stepping, without ending iterations. Text is the machine code of these
//! crates that stepping leads to. `--check` counts the base scenes and compares with `results/effects.md`: what is
//! absent must cost nothing, so no figure may rise by more than 0.5 %, nor text.

mod instance;
mod rows;
mod text;

use clap::Parser;
use croupier::unstable::profile::{AnyProfile, Custom};
use croupier::unstable::{BYTES_PER_PATH, Effects};
use croupier::{Plan, Scene, Settings};
use croupier_benches::callgrind::{self, Counted, Folder};
use croupier_benches::exit::exit_code;
use croupier_benches::provenance;
use croupier_benches::results::{Results, Table};
use croupier_benches::variant::Variant;
use instance::Instance;
use rows::{Base, ROWS};
use serde_json::json;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use text::Text;

#[derive(Parser)]
#[command(about = "What each effect costs: absent, present, used")]
struct Args {
    /// Folder with the scenes of the third table; what is not there is skipped.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Count the base scenes and compare with benches/results/effects.md; exit status 1 if a figure has risen by more
    /// than 0.5 %.
    #[arg(long)]
    check: bool,
    /// Write benches/results/effects.md.
    #[arg(long, conflicts_with = "check")]
    write: bool,
    /// Render this blob by the profile of these effects' bits, with `--strategy`, about `--pixels`: what the program
    /// runs under valgrind.
    #[arg(long, hide = true, requires = "effects")]
    blob: Option<PathBuf>,
    #[arg(long, hide = true)]
    effects: Option<u32>,
    #[arg(long, hide = true, default_value = "classic")]
    strategy: String,
    #[arg(long, hide = true, default_value_t = SMALL)]
    pixels: u32,
}

const NAME: &str = "effects";
/// Per cent by which a figure may rise.
const TOLERANCE: f64 = 0.5;
/// Iterations and pixels of `instructions`, so that its figures compare; all other scenes are smaller.
const ITERATIONS: [u32; 4] = [1, 1, 2, 4];
const PIXELS: u32 = 9216;
const SMALL: u32 = 2304;
const SHARDS: u32 = 2;
const EFFECTS: &str = "What each effect costs";
const PROFILES: &str = "Profiles";
const SCENES: &str = "Scenes in their profiles";

/// Scenes with profiles of exactly their effects.
const EXACT: [(&str, Instance); 6] = [
    ("built-in", Instance::of::<Custom<{ BUILT_IN.0 }>>()),
    ("cbox", Instance::of::<Custom<{ CBOX.0 }>>()),
    ("kitchen", Instance::of::<Custom<{ KITCHEN.0 }>>()),
    ("pool", Instance::of::<Custom<{ POOL.0 }>>()),
    ("volumetric_caustic", Instance::of::<Custom<{ FOG.0 }>>()),
    ("smoke", Instance::of::<Custom<{ SMOKE.0 }>>()),
];
const CBOX: Effects = Effects::DIFFUSE.with(Effects::AREA_LIGHTS);
const BUILT_IN: Effects = CBOX.with(Effects::CONDUCTOR).with(Effects::DIELECTRIC).with(Effects::SMOOTH_NORMALS);
const KITCHEN: Effects = Effects::DIFFUSE
    .with(Effects::MIRROR)
    .with(Effects::ROUGH_CONDUCTOR)
    .with(Effects::DIELECTRIC)
    .with(Effects::THIN_DIELECTRIC)
    .with(Effects::PLASTIC)
    .with(Effects::ROUGH_PLASTIC)
    .with(Effects::TEXTURES)
    .with(Effects::ENVIRONMENT)
    .with(Effects::SMOOTH_NORMALS);

const POOL: Effects = Effects::DIFFUSE
    .with(Effects::ROUGH_CONDUCTOR)
    .with(Effects::DIELECTRIC)
    .with(Effects::ROUGH_PLASTIC)
    .with(Effects::TEXTURES)
    .with(Effects::ENVIRONMENT)
    .with(Effects::SMOOTH_NORMALS);
const FOG: Effects =
    CBOX.with(Effects::DIELECTRIC).with(Effects::NULL).with(Effects::SMOOTH_NORMALS).with(Effects::MEDIA);
const SMOKE: Effects = CBOX.with(Effects::NULL).with(Effects::CONSTANT).with(Effects::MEDIA).with(Effects::GRID_MEDIA);

/// Every profile of the program.
fn instances() -> Vec<Instance> {
    let mut all: Vec<Instance> = Base::ALL.into_iter().map(Base::instance).collect();
    if cfg!(feature = "effects-rows") {
        all.extend(AnyProfile::ALL.iter().map(|p| Instance::of_set(*p)));
        all.extend(ROWS.iter().map(|r| r.instance));
        all.extend(EXACT.map(|(_, instance)| instance));
    }
    all
}

/// Renders a blob and prints its rays.
fn render(blob: &Path, args: &Args) -> Result<(), Box<dyn Error>> {
    let bytes = callgrind::read(blob)?;
    let scene = Scene::from_bytes(&bytes)?;
    let wanted = instances().into_iter().find(|i| Some(i.effects.0) == args.effects).ok_or("no such profile")?;
    let [width, height] = scene.camera.size.map(f64::from);
    let scale = (f64::from(args.pixels) / (width * height)).sqrt();
    let size = [width, height].map(|x| (x * scale).round() as u32);
    let settings = Settings { size, shards: SHARDS, aovs: true.into(), ..Settings::for_scene(&scene) };
    let plan = Plan::new(&Variant::parse(&args.strategy)?.apply(settings))?;
    let (counters, _) = (wanted.render)(scene, &plan, &ITERATIONS)?;
    println!("{}", json!({ "rays": counters.rays() }));
    Ok(())
}

/// Counts a render of a blob by a profile.
fn count(
    folder: &Folder,
    blob: &Path,
    instance: &Instance,
    strategy: &str,
    pixels: u32,
) -> Result<Counted, Box<dyn Error>> {
    let (blob, effects) = (blob.to_string_lossy(), instance.effects.0.to_string());
    let pixels = pixels.to_string();
    let args = ["--blob", &blob, "--effects", &effects, "--strategy", strategy, "--pixels", &pixels];
    callgrind::count(folder, &format!("{blob}, effects {effects}"), &args)
}

fn percent(new: f64, old: f64) -> String {
    format!("{:+.2} %", 100.0 * (new / old - 1.0))
}

/// A base scene: its blob, what was counted, and the text of its profile.
struct Counts {
    base: Base,
    blob: PathBuf,
    counted: Counted,
    text: u64,
}

fn bases(folder: &Folder, text: &Text) -> Result<Vec<Counts>, Box<dyn Error>> {
    let count = |base: Base| {
        let blob = folder.bake(base.name(), &base.scene())?;
        let counted = count(folder, &blob, &base.instance(), "classic", SMALL)?;
        Ok(Counts { base, blob, counted, text: text.bytes((base.instance().step)())? })
    };
    Base::ALL.into_iter().map(count).collect()
}

/// The first table.
fn effects(folder: &Folder, text: &Text, bases: &[Counts]) -> Result<Table, Box<dyn Error>> {
    let columns = "effect, base, absent, present, used, present over absent, text absent, text present, text more";
    let mut table = Table::new(EFFECTS, columns);
    // what a host's own scattering model costs is the host's
    for (effect, name) in Effects::NAMES.iter().filter(|(e, _)| *e != Effects::OWN) {
        let row = ROWS.iter().find(|r| r.effect == *effect).ok_or_else(|| format!("no row for {name}"))?;
        let base = bases.iter().find(|b| b.base == row.base).ok_or("no such base")?;
        let present = count(folder, &base.blob, &row.instance, "classic", SMALL)?;
        if present.rays != base.counted.rays {
            return Err(format!("{name}: the paths differ where it is not used").into());
        }
        let mut scene = row.base.scene();
        (row.used)(&mut scene);
        let blob = folder.bake("used", &scene)?;
        let bytes = callgrind::read(&blob)?;
        if !Scene::from_bytes(&bytes)?.effects.contains(*effect) {
            return Err(format!("{name}: its scene does not use it").into());
        }
        let used = count(folder, &blob, &row.instance, "classic", SMALL)?.per_ray()[0];
        let [absent, present] = [base.counted, present].map(|c| c.per_ray()[0]);
        let with = text.bytes((row.instance.step)())?;
        let more = with as i64 - base.text as i64;
        let [absent_text, present_text, used_text] = [absent, present, used].map(|x| format!("{x:.2}"));
        table.add(
            [(*name).into(), row.base.name().into(), absent_text, present_text, used_text, percent(present, absent)]
                .into_iter()
                .chain([base.text.to_string(), with.to_string(), more.to_string()]),
        );
        eprintln!("{}", table.last());
    }
    Ok(table)
}

/// The second table.
fn profiles(text: &Text) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(PROFILES, "profile, effects, text, bytes per path");
    for profile in AnyProfile::ALL {
        let instance = Instance::of_set(*profile);
        let effects = instance.effects.names().count();
        let bytes = text.bytes((instance.step)())?;
        table.add([instance.name.into(), effects.to_string(), bytes.to_string(), BYTES_PER_PATH.to_string()]);
        eprintln!("{}", table.last());
    }
    Ok(table)
}

/// The third table; with all scenes or without.
fn scenes(folder: &Folder, args: &Args) -> Result<Table, Box<dyn Error>> {
    let columns =
        "scene, strategy, profile, before media, exact, smallest, full, smallest over before, full over smallest";
    let mut table = Table::new(SCENES, columns);
    let before = Results::read("instructions-before-media")?;
    let before = before.tables.first().ok_or("no table of the counts before")?;
    let column = |name: &str| before.column(name).ok_or_else(|| format!("no column '{name}' in the counts before"));
    let [rays, per_ray] = [column("rays")?, column("step per ray")?];
    for (scene, exact) in EXACT {
        let Some(description) = callgrind::description(scene, &args.scenes)? else { continue };
        let blob = folder.bake(scene, &description)?;
        let bytes = callgrind::read(&blob)?;
        let called_for = Scene::from_bytes(&bytes)?.effects;
        if called_for != exact.effects {
            let names: Vec<_> = called_for.names().collect();
            return Err(format!("{scene} calls for {}", names.join(", ")).into());
        }
        let smallest = Instance::of_set(AnyProfile::smallest(called_for));
        let full = Instance::of_set(AnyProfile::Full);
        for strategy in ["classic", "ears"] {
            let old = before.row(&[scene, strategy]);
            let pixels = if old.is_some() { PIXELS } else { SMALL };
            let mut counted = Vec::new();
            for instance in [exact, smallest, full] {
                counted.push(count(folder, &blob, &instance, strategy, pixels)?);
            }
            if counted.iter().any(|c| c.rays != counted[0].rays) {
                return Err(format!("{scene}, {strategy}: the paths depend on the profile").into());
            }
            // other paths are another picture
            let old: Option<f64> = match old.filter(|row| row[rays] == counted[0].rays.to_string()) {
                Some(row) => Some(row[per_ray].parse()?),
                None => None,
            };
            let [exact, smaller, full] = [0, 1, 2].map(|i: usize| counted[i].per_ray()[0]);
            let known = |text: Option<String>| text.unwrap_or("-".into());
            let figures = [exact, smaller, full].map(|x| format!("{x:.2}"));
            let figures = [known(old.map(|x| format!("{x:.2}")))].into_iter().chain(figures);
            let ratios = [known(old.map(|old| percent(smaller, old))), percent(full, smaller)];
            let names = [scene, strategy, smallest.name].map(String::from);
            table.add(names.into_iter().chain(figures).chain(ratios));
            eprintln!("{}", table.last());
        }
    }
    Ok(table)
}

/// Compares the base scenes with the committed results; how many figures have risen.
fn check(bases: &[Counts], committed: &Results) -> Result<usize, Box<dyn Error>> {
    let table = committed.table(EFFECTS).ok_or("no table of effects in the committed results")?;
    let column = |name: &str| table.column(name).ok_or_else(|| format!("no column '{name}' in the committed results"));
    let (base, absent, text) = (column("base")?, column("absent")?, column("text absent")?);
    let mut risen = 0;
    for counts in bases {
        let name = counts.base.name();
        let row = table.rows.iter().find(|r| r[base] == name).ok_or_else(|| format!("{name}: not in the results"))?;
        let figures = [
            ("instructions per ray", counts.counted.per_ray()[0], row[absent].parse::<f64>()?),
            ("bytes of text", counts.text as f64, row[text].parse()?),
        ];
        for (what, new, old) in figures {
            let too_much = new > old * (1.0 + TOLERANCE / 100.0) + 0.005;
            risen += usize::from(too_much);
            println!(
                "{name}: {what} {old:.2} -> {new:.2} ({}){}",
                percent(new, old),
                if too_much { " RISEN" } else { "" }
            );
        }
    }
    Ok(risen)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if let Some(blob) = &args.blob {
        render(blob, args)?;
        return Ok(true);
    }
    callgrind::note_profile(args.write)?;
    let mut results = Results::of_this_run(NAME);
    if args.check
        && let Some(difference) = results.differs_in(&Results::read(NAME)?, &["instruction set", "arithmetic"])
    {
        println!("skipped: the {difference}");
        return Ok(true);
    }
    let (folder, text) = (Folder::new(NAME)?, Text::of_this_program()?);
    let bases = bases(&folder, &text)?;
    if args.check {
        let risen = check(&bases, &Results::read(NAME)?)?;
        if risen > 0 {
            let command =
                "cargo run --profile embed -p croupier-benches --features effects-rows --bin effects -- --write";
            println!("if that is meant: {command}");
        }
        return Ok(risen == 0);
    }
    if !cfg!(feature = "effects-rows") {
        return Err("only `--check` works without `--features effects-rows`".into());
    }
    results.tables = vec![effects(&folder, &text, &bases)?, profiles(&text)?, scenes(&folder, args)?];
    if args.write {
        if results.tables[2].rows.len() < 2 * EXACT.len() {
            return Err("only a run of all scenes may replace the committed results".into());
        }
        results.header.push(("valgrind".into(), provenance::version_of("valgrind")));
        println!("wrote {}", results.write(NAME)?.display());
    } else {
        results.tables.iter().for_each(|t| println!("{t}"));
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}

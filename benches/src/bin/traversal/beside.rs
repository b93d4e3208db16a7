//! The comparison with Embree, for `benches/results/traversal-embree.md`: speed of every way to trace, hits ray by ray,
//! and rays aimed at edges and vertices of closed meshes.
//!
//! Embree runs in a process of its own and is told when to trace which set, so that it takes turns with the kernels of
//! this one: in each round all kernels trace a set before the next set's turn, ours several times in between. Ratios
//! are of one round; the table has their median. Rays of both are copied from an array, packet by packet, and hits are
//! counted.
//!
//! Embree asks the system for pages of 2 MB. So does this process, by a setting of the GNU C library that is read when
//! a process starts: hence it starts itself again with it.

use crate::embree::{Embree, Hit, Mode, compile};
use crate::kernels::{Kernels, NAMES, Subject, median, vectors};
use crate::rays::{self, Set};
use crate::truth::{Finding, Near, Oracle};
use crate::{Args, NAME, scene_of};
use croupier::unstable::accel::Intersector;
use croupier_benches::results::{Results, Table};
use croupier_tests::geometry::Ray;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What a measurement of a set takes, or one pass.
const SECONDS: f64 = 0.04;
/// Differences that are listed, of each scene.
const LISTED: usize = 10;
/// Rays of each kind that are aimed at each closed mesh.
const AIMED: usize = 250_000;

/// Closed meshes: name, middle, size.
const CLOSED: [(&str, [f32; 3], f32); 4] = [
    ("star", [0.0; 3], 1.0),
    ("star of size 1e-4", [0.0; 3], 1e-4),
    ("star at 1e5", [148_376.0, 1234.0, -223_423.0], 1.0),
    ("star of size 1e3 at 1e7", [1e7, 1e7, -1e7], 1e3),
];

const PAGES: (&str, &str) = ("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1");

/// Everything; `false` if the process that was started has failed.
pub(crate) fn run(args: &Args, library: &Path) -> Result<bool, Box<dyn Error>> {
    if std::env::var_os(PAGES.0).is_none() {
        let mut again = Command::new(std::env::current_exe()?);
        return Ok(again.args(std::env::args_os().skip(1)).env(PAGES.0, PAGES.1).status()?.success());
    }
    let mut results = Results::of_this_run(NAME);
    let program = compile()?;
    let scenes: Vec<Option<PathBuf>> = match &args.scene {
        Some(scene) => vec![Some(scene.clone())],
        None => {
            let scenes: Vec<PathBuf> = ["kitchen", "cbox"].into_iter().filter_map(scene_of).collect();
            if args.write && scenes.len() < 2 {
                return Err("--write: kitchen and cbox are not both there".into());
            }
            scenes.into_iter().map(Some).chain([None]).collect()
        }
    };
    let mut tables = Tables::new();
    for scene in &scenes {
        let subject = Subject::new(scene.as_deref());
        let kernels = subject.kernels();
        let sets = rays::sets(&kernels.wide, &subject.triangles, &subject.camera, args.width);
        let sets: Vec<Set> = sets.into_iter().filter(|s| s.name.contains(&args.only)).collect();
        let mut embree = Embree::start(&program, library, &subject.triangles, &sets)?;
        if tables.facts.is_empty() {
            tables.facts.push(("Embree".into(), format!("{}, build quality high, one thread", embree.version)));
        }
        tables.scene(&subject, &embree);
        let differences = Differences::of(&subject, &kernels, &sets, &mut embree)?;
        differences.add_to(&mut tables);
        let times = Times::measured(&kernels, &sets, &mut embree, args.rounds)?;
        times.add_to(&mut tables, &subject, &sets);
    }
    tables.leaks(&program, library)?;
    let rounds = args.rounds.max(1);
    tables.facts.push(("obvhs".into(), vectors().into()));
    tables.facts.push((
        "figures".into(),
        format!("Mrays/s and ratios, medians of {rounds} rounds (spread between the quartiles)"),
    ));
    for (key, value) in &tables.facts {
        println!("- {key}: {value}");
    }
    results.header.append(&mut tables.facts);
    results.tables = tables.all();
    results.tables.iter().for_each(|t| print!("\n{t}"));
    if args.write {
        println!("wrote {}", results.write("traversal-embree")?.display());
    }
    Ok(true)
}

/// What is written.
struct Tables {
    facts: Vec<(String, String)>,
    speed: Table,
    modes: Table,
    hits: Table,
    differences: Table,
    leaks: Table,
}

impl Tables {
    fn new() -> Self {
        let embree = "default 1, default 8, default 16, ROBUST 1, ROBUST 8, ROBUST 16";
        let speed = format!("scene, rays, {}, {embree}, over default, over ROBUST", NAMES.join(", "));
        let sides = "misses clearly, misses at an edge, adds clearly, adds at an edge";
        let side = |name: &str| sides.split(", ").map(|s| format!("{name} {s}")).collect::<Vec<_>>().join(", ");
        let hits = format!(
            "scene, Embree, rays, same, of these t 1e-4 apart, croupier's nearer, another triangle as near, {}, {}",
            side("Embree"),
            side("croupier")
        );
        Self {
            facts: Vec::new(),
            speed: Table::new("Speed", &speed),
            modes: Table::new("Ways to trace", "scene, Embree, primary, bounce 1, bounce 3, shadow 1, shadow 2"),
            hits: Table::new("Hits", &hits),
            differences: Table::new(
                "Differences",
                "scene, rays, number, origin, direction, tmax, croupier, Embree, f64, reason",
            ),
            leaks: Table::new(
                "Leaks",
                "mesh, rays, number, croupier, default 1, default 8, default 16, ROBUST 1, ROBUST 8, ROBUST 16",
            ),
        }
    }

    /// Rays that leave closed meshes.
    fn leaks(&mut self, program: &Path, library: &Path) -> Result<(), Box<dyn Error>> {
        for (name, offset, scale) in CLOSED {
            let (triangles, camera, sets) = rays::aimed(offset, scale, AIMED);
            let subject = Subject::of(name.into(), triangles, camera);
            let kernels = subject.kernels();
            let mut embree = Embree::start(program, library, &subject.triangles, &sets)?;
            for (i, set) in sets.iter().enumerate() {
                let leaks = |hits: Vec<Hit>| hits.iter().filter(|h| h.is_none()).count();
                let mut cells = vec![name.to_string(), set.name.into(), set.single.len().to_string()];
                cells.push(leaks(hits(&kernels, set)).to_string());
                for (robust, width) in [false, true].into_iter().flat_map(|r| [1, 8, 16].map(|w| (r, w))) {
                    let mode = Mode { device: 0, robust, width, coherent: false };
                    cells.push(leaks(embree.hits(mode, i)?).to_string());
                }
                self.leaks.add(cells);
            }
        }
        Ok(())
    }

    fn all(self) -> Vec<Table> {
        vec![self.speed, self.modes, self.hits, self.differences, self.leaks]
    }

    fn scene(&mut self, subject: &Subject, embree: &Embree) {
        let build = embree.build.iter().flatten().map(|s| format!("{s:.1}")).collect::<Vec<_>>().join(", ");
        let (ours, theirs) = (large_pages("self"), large_pages(&embree.id().to_string()));
        self.facts.push((
            subject.name.clone(),
            format!(
                "{} triangles; tree built in {:.2} s, Embree's in {build} s (default, ROBUST; by instruction set, on \
                 one thread); memory in pages of 2 MB: {ours}, Embree's {theirs}",
                subject.triangles.len(),
                subject.build_seconds,
            ),
        ));
    }
}

/// The share of a process's memory that is in pages of 2 MB.
fn large_pages(process: &str) -> String {
    let text = std::fs::read_to_string(format!("/proc/{process}/smaps_rollup")).unwrap_or_default();
    let field = |name: &str| {
        let line = text.lines().find_map(|l| l.strip_prefix(name))?;
        line.trim_start_matches(':').trim().split(' ').next()?.parse::<f64>().ok()
    };
    let share = field("AnonHugePages").zip(field("Anonymous")).map(|(large, all)| 100.0 * large / all);
    share.map_or("unknown".into(), |s| format!("{s:.0} %"))
}

/// Seconds by set, kernel and round.
struct Times {
    /// obvhs has no modes.
    own: Vec<[Vec<f64>; 3]>,
    embree: Vec<Vec<Vec<f64>>>,
}

impl Times {
    fn measured(
        kernels: &Kernels<'_>,
        sets: &[Set],
        embree: &mut Embree,
        rounds: usize,
    ) -> Result<Self, Box<dyn Error>> {
        let modes = Mode::all();
        let passes = kernels.passes(sets, SECONDS);
        let mut theirs = vec![vec![1; modes.len()]; sets.len()];
        for (i, k) in (0..sets.len()).flat_map(|i| (0..modes.len()).map(move |k| (i, k))) {
            theirs[i][k] = (SECONDS / embree.seconds(modes[k], i, 1)?.max(1e-6)).ceil().clamp(1.0, 1e4) as u32;
        }
        let mut times =
            Self { own: vec![Default::default(); sets.len()], embree: vec![vec![Vec::new(); modes.len()]; sets.len()] };
        for round in 0..rounds.max(1) {
            for (i, set) in sets.iter().enumerate() {
                let mut ours = Vec::new();
                for k in 0..modes.len() {
                    let k = (k + 7 * round) % modes.len();
                    if k.is_multiple_of(5) {
                        ours.push(kernels.seconds(0, set, passes[i][0]));
                    }
                    if k % 10 == 2 {
                        let kernel = 1 + k / 10 % 2;
                        times.own[i][kernel].push(kernels.seconds(kernel, set, passes[i][kernel]));
                    }
                    times.embree[i][k].push(embree.seconds(modes[k], i, theirs[i][k])?);
                }
                times.own[i][0].push(median(ours).0);
            }
        }
        Ok(times)
    }

    fn add_to(&self, tables: &mut Tables, subject: &Subject, sets: &[Set]) {
        let modes = Mode::all();
        let figure = |set: &Set, times: &[f64]| {
            let (t, spread) = median(times.to_vec());
            format!("{:.2} ({:.0} %)", set.single.len() as f64 / t * 1e-6, 100.0 * spread)
        };
        for (i, set) in sets.iter().enumerate() {
            let fastest = |of: &dyn Fn(Mode) -> bool| {
                let ways = modes.iter().zip(&self.embree[i]).filter(|(m, _)| of(**m)).map(|(_, t)| t);
                ways.min_by(|a, b| median(a.to_vec()).0.total_cmp(&median(b.to_vec()).0)).map_or(&[][..], |t| t)
            };
            let ratio = |robust: bool| {
                let theirs = fastest(&|m| m.robust == robust);
                let (r, spread) = median(theirs.iter().zip(&self.own[i][0]).map(|(e, o)| e / o).collect());
                format!("{r:.2} ({:.0} %)", 100.0 * spread)
            };
            let mut cells = vec![subject.name.clone(), set.name.into()];
            cells.extend(self.own[i].iter().map(|t| figure(set, t)));
            for robust in [false, true] {
                cells.extend([1, 8, 16].map(|w| figure(set, fastest(&|m| m.robust == robust && m.width == w))));
            }
            tables.speed.add(cells.into_iter().chain([ratio(false), ratio(true)]));
        }
        for (k, mode) in modes.iter().enumerate() {
            let cells = [subject.name.clone(), mode.to_string()];
            let speeds = sets.iter().zip(&self.embree).map(|(set, times)| figure(set, &times[k]));
            tables.modes.add(cells.into_iter().chain(speeds));
        }
    }
}

/// Numbers of rays by what their hits are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Tally {
    rays: usize,
    same: usize,
    /// Of these, with another t.
    apart: usize,
    /// Of these, with ours nearer to that of f64.
    nearer: usize,
    level: usize,
    /// Embree's errors, ours: misses clearly, at an edge, adds clearly, at an edge.
    errors: [[usize; 4]; 2],
}

/// One that is listed.
struct Difference {
    clear: bool,
    cells: Vec<String>,
}

/// Where Embree's hits differ from ours.
struct Differences {
    scene: String,
    by_mode: Vec<(Mode, Tally)>,
    listed: Vec<Difference>,
}

impl Differences {
    fn of(subject: &Subject, kernels: &Kernels<'_>, sets: &[Set], embree: &mut Embree) -> Result<Self, Box<dyn Error>> {
        let oracle = Oracle::new(&subject.triangles);
        let mut found = Self {
            scene: subject.name.clone(),
            by_mode: Mode::all().into_iter().map(|m| (m, Tally::default())).collect(),
            listed: Vec::new(),
        };
        for (i, set) in sets.iter().enumerate() {
            let ours = hits(kernels, set);
            // the oracle's answers
            let mut known: BTreeMap<usize, Vec<Near>> = BTreeMap::new();
            for (m, (mode, tally)) in found.by_mode.iter_mut().enumerate() {
                let theirs = embree.hits(*mode, i)?;
                tally.rays += ours.len();
                for (n, (a, b)) in ours.iter().zip(&theirs).enumerate() {
                    let same = if set.any { a.is_some() == b.is_some() } else { a.map(|h| h.1) == b.map(|h| h.1) };
                    if same {
                        tally.same += 1;
                        let Some(((s, triangle), (t, _))) = a.zip(*b).filter(|_| !set.any) else { continue };
                        if (s - t).abs() > 1e-4 * t {
                            tally.apart += 1;
                            tally.nearer += usize::from(oracle.nearer(&set.ray(n), triangle, s, t));
                        }
                        continue;
                    }
                    let ray = set.ray(n);
                    if !set.any && a.zip(*b).is_some_and(|(a, b)| oracle.level(&ray, a.1, b.1)) {
                        tally.level += 1;
                        continue;
                    }
                    let new = !known.contains_key(&n);
                    let near = known.entry(n).or_insert_with(|| oracle.near(&ray));
                    let findings = [*b, *a].map(|hit| match set.any {
                        true => Oracle::any(near, hit.is_some()),
                        false => oracle.closest(&ray, near, hit),
                    });
                    if findings == [Finding::Right; 2] {
                        tally.level += 1;
                    }
                    for (errors, finding) in tally.errors.iter_mut().zip(findings) {
                        match finding {
                            Finding::Right => (),
                            Finding::Misses { edge } => errors[usize::from(edge)] += 1,
                            Finding::Adds { edge } => errors[2 + usize::from(edge)] += 1,
                        }
                    }
                    if new {
                        let clear = findings
                            .iter()
                            .any(|f| matches!(f, Finding::Misses { edge: false } | Finding::Adds { edge: false }));
                        found.listed.push(Difference {
                            clear,
                            cells: describe(subject, set, n, (*a, *b), near, Mode::all()[m], findings),
                        });
                    }
                }
            }
        }
        Ok(found)
    }

    fn add_to(mut self, tables: &mut Tables) {
        // ways with the same numbers share a row
        let mut rows: Vec<(Vec<Mode>, Tally)> = Vec::new();
        for (mode, tally) in self.by_mode {
            match rows.iter_mut().find(|(modes, t)| *t == tally && modes[0].robust == mode.robust) {
                Some((modes, _)) => modes.push(mode),
                None => rows.push((vec![mode], tally)),
            }
        }
        for (modes, t) in rows {
            let names = match modes.len() == Mode::all().len() / 2 {
                true => format!("{}, all ways", modes[0].flags()),
                false => modes.iter().map(Mode::to_string).collect::<Vec<_>>().join("; "),
            };
            let [embree, ours] = t.errors;
            let numbers = [t.rays, t.same, t.apart, t.nearer, t.level].into_iter().chain(embree).chain(ours);
            tables.hits.add([self.scene.clone(), names].into_iter().chain(numbers.map(|n| n.to_string())));
        }
        self.listed.sort_by_key(|d| !d.clear);
        self.listed.into_iter().take(LISTED).for_each(|d| tables.differences.add(d.cells));
    }
}

/// Cells of the list of differences.
fn describe(
    subject: &Subject,
    set: &Set,
    n: usize,
    (ours, theirs): (Hit, Hit),
    near: &[Near],
    mode: Mode,
    [embree, croupier]: [Finding; 2],
) -> Vec<String> {
    let ray = set.ray(n);
    let hit = |h: Hit| match h {
        Some(_) if set.any => "blocked".into(),
        Some((t, triangle)) => format!("{t} {triangle}"),
        None => "none".into(),
    };
    let numbers = |v: [f32; 3]| v.map(|x| x.to_string()).join(" ");
    let reason = |who: &str, f: Finding| {
        let at = |edge: bool| if edge { "at an edge, within rounding" } else { "clearly" };
        match f {
            Finding::Right => String::new(),
            Finding::Misses { edge } => format!("{who} misses {}", at(edge)),
            Finding::Adds { edge } => format!("{who} adds {}", at(edge)),
        }
    };
    let reasons = [reason("Embree", embree), reason("croupier", croupier)];
    let reasons: Vec<String> = reasons.into_iter().filter(|r| !r.is_empty()).collect();
    vec![
        subject.name.clone(),
        set.name.into(),
        n.to_string(),
        numbers(ray.o),
        numbers(ray.d),
        ray.tmax.to_string(),
        hit(ours),
        format!("{} ({mode})", hit(theirs)),
        Oracle::nearest(near),
        if reasons.is_empty() { "f64 cannot tell".into() } else { reasons.join("; ") },
    ]
}

/// Our hits; t and triangle 0 where any hit is enough.
fn hits(kernels: &Kernels<'_>, set: &Set) -> Vec<Hit> {
    let mut out = Vec::with_capacity(set.single.len());
    for (rays, active) in &set.packets {
        let lanes = active.count() as usize;
        if set.any {
            let met = kernels.wide.occluded(rays, *active);
            out.extend((0..lanes).map(|i| met.lane(i).then_some((0.0, 0))));
        } else {
            let h = kernels.wide.closest(rays, *active);
            out.extend((0..lanes).map(|i| h.hit.lane(i).then(|| (h.t.lane(i), h.triangle.lane(i)))));
        }
    }
    out
}

impl Set {
    /// Ray `n`, as the oracle has it.
    fn ray(&self, n: usize) -> Ray {
        let r = &self.single[n];
        Ray { o: r.origin.to_array(), d: r.direction.to_array(), tmin: r.tmin, tmax: r.tmax }
    }
}

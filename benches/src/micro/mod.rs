//! Kernels one at a time: what `cargo bench` times (`benches/micro.rs`) and what callgrind counts (`src/bin/micro.rs`).
//!
//! [`all`] makes the kernels with their inputs and compares each with its expected answer first: a closed form or an
//! independent oracle in f64, mostly that of a test. So a kernel that has become fast because it no longer computes
//! what it should is an error, and not a record.
//!
//! A kernel is called with some hundred inputs that stay in the first cache. Its result is made visible to the
//! compiler, all of it unless the name says otherwise. Inputs and results of a call are read and written, as in the
//! tracer between stages. Figures are per *unit*: packets of eight lanes where there are lanes.

mod bsdf;
mod camera;
mod learn;
mod light;
mod math;
mod media;
mod picture;
mod tree;

use std::collections::BTreeMap;
use std::fmt::Display;
use std::hint::black_box;

/// One kernel, ready to be called.
pub struct Kernel {
    /// What it belongs to: `math`, `bsdf eval`.
    pub group: &'static str,
    /// Which one.
    pub name: String,
    /// What figures are per: `8 lanes`, `8 pixels`.
    pub unit: &'static str,
    /// Units of one call.
    pub units: usize,
    /// Lanes of eight that have a result, on average; `None` where there are no lanes.
    pub lanes: Option<f64>,
    /// Calls it with all its inputs.
    pub call: Box<dyn FnMut()>,
}

/// Packets of a kernel's inputs.
const PACKETS: usize = 64;

/// How far a kernel's results are from those of its f64 twin, relative to the twin's, or to [`FLOOR`] where that is
/// larger.
#[derive(Clone, Debug, Default)]
pub struct Deviation {
    /// Largest one.
    pub max: f64,
    /// Sum of all.
    pub sum: f64,
    /// How many results were compared.
    pub count: u64,
    /// Largest relative standard error of what is random on purpose, such as the share of light that passes a cloud:
    /// means are compared there, and are off by some of these.
    pub noise: f64,
}

/// Size of an exact value below which errors are no longer relative to it.
pub const FLOOR: f64 = 1e-3;

/// Kernels so far.
pub struct Kernels {
    list: Vec<Kernel>,
    /// By group and name.
    deviations: BTreeMap<(&'static str, String), Deviation>,
    /// Packets that scattering models and lights are compared with their twins for, [`PACKETS`] at least.
    compared: usize,
}

/// An answer that is not the expected one, as text.
pub type Outcome = Result<(), String>;

impl Kernels {
    /// Adds the kernel `f` over `inputs`, one packet each; `lanes` lanes have a result.
    fn packets<T: 'static, R>(
        &mut self,
        (group, name): (&'static str, &str),
        lanes: f64,
        inputs: Vec<T>,
        f: impl Fn(&T) -> R + 'static,
    ) {
        let units = inputs.len();
        let call = move || {
            for input in black_box(&inputs) {
                black_box(f(input));
            }
        };
        self.list.push(Kernel {
            group,
            name: name.into(),
            unit: "8 lanes",
            units,
            lanes: Some(lanes),
            call: Box::new(call),
        });
    }

    /// Adds a call that is `units` times `unit`.
    fn whole(
        &mut self,
        (group, name): (&'static str, &str),
        (unit, units): (&'static str, usize),
        call: impl FnMut() + 'static,
    ) {
        self.list.push(Kernel { group, name: name.into(), unit, units, lanes: None, call: Box::new(call) });
    }

    /// Notes a result of a kernel beside the exact one.
    fn note(&mut self, (group, name): (&'static str, &str), got: f64, want: f64) {
        let d = self.deviations.entry((group, name.into())).or_default();
        let off = (got - want).abs() / want.abs().max(FLOOR);
        d.max = d.max.max(off);
        d.sum += off;
        d.count += 1;
    }

    /// Notes a mean of random results with its standard error.
    fn note_mean(&mut self, kernel: (&'static str, &str), mean: f64, error: f64, want: f64) {
        self.note(kernel, mean, want);
        if let Some(d) = self.deviations.get_mut(&(kernel.0, kernel.1.to_string())) {
            d.noise = d.noise.max(error / want.abs().max(FLOOR));
        }
    }
}

/// All kernels, each compared with its expected answer.
pub fn all() -> Result<Vec<Kernel>, String> {
    let mut kernels = Kernels { list: vec![], deviations: BTreeMap::new(), compared: PACKETS };
    let groups = [math::add, bsdf::add, light::add, media::add, camera::add, tree::add, learn::add, picture::add];
    each(groups, |add| add(&mut kernels))?;
    Ok(kernels.list)
}

/// How far scattering models, lights and media are from their f64 twins over so many packets, by group and name of the
/// kernels.
pub fn deviations(packets: usize) -> Result<BTreeMap<(&'static str, String), Deviation>, String> {
    let mut kernels = Kernels { list: vec![], deviations: BTreeMap::new(), compared: packets.max(PACKETS) };
    each([bsdf::add, light::add, media::add], |add| add(&mut kernels))?;
    Ok(kernels.deviations)
}

/// Calls `f` with all `items`, also behind one that fails; the errors, one a line.
fn each<T>(items: impl IntoIterator<Item = T>, f: impl FnMut(T) -> Outcome) -> Outcome {
    let errors: Vec<String> = items.into_iter().map(f).filter_map(Result::err).collect();
    if errors.is_empty() { Ok(()) } else { Err(errors.join("\n")) }
}

/// `got` is `want` within `tolerance`, relative where `want` is above 1 in size.
fn close(what: impl Display, got: f64, want: f64, tolerance: f64) -> Outcome {
    // a NaN is not close to anything
    if (got - want).abs() <= tolerance * want.abs().max(1.0) {
        Ok(())
    } else {
        Err(format!("{what}: {got}, expected {want}"))
    }
}

/// An error unless `holds`.
fn expect(holds: bool, what: impl Display) -> Outcome {
    if holds { Ok(()) } else { Err(what.to_string()) }
}

/// A value that lives as long as the program.
fn leak<T>(x: T) -> &'static T {
    Box::leak(Box::new(x))
}

/// Mean number of lanes over packets.
fn mean_lanes(lanes: impl IntoIterator<Item = usize>) -> f64 {
    let (mut sum, mut n) = (0, 0);
    for l in lanes {
        (sum, n) = (sum + l, n + 1);
    }
    sum as f64 / f64::from(n.max(1))
}

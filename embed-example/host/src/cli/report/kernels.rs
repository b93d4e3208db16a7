//! Elementary functions of eight lanes beside those of the platform: errors against f64, and time.

use super::effort::Effort;
use super::ledger::{Group, Kernel, Spread};
use super::timing::{in_parallel, nanoseconds};
use super::twins::Twins;
use croupier::INSTRUCTION_SET;
use croupier::unstable::simd::{F32x8, REPRODUCIBLE};
use std::f64::consts::TAU;

/// A function of one argument.
struct Unary {
    name: &'static str,
    lanes: fn(F32x8) -> F32x8,
    platform: fn(f32) -> f32,
    exact: fn(f64) -> f64,
    /// Arguments that are timed.
    range: [f32; 2],
}

/// A function of two arguments.
struct Binary {
    name: &'static str,
    lanes: fn(F32x8, F32x8) -> F32x8,
    platform: fn(f32, f32) -> f32,
    exact: fn(f64, f64) -> f64,
    range: [[f32; 2]; 2],
}

/// Sine and cosine of whole turns: f64 holds the fraction of every f32.
fn turns(x: f64) -> f64 {
    (x - x.round()) * TAU
}

fn sin_turns(x: f64) -> f64 {
    // sin(pi) of f64 is not the 0 that it is here
    if (x - x.round()).abs() == 0.5 { 0.0 } else { turns(x).sin() }
}

fn cos_turns(x: f64) -> f64 {
    if (x - x.round()).abs() == 0.25 { 0.0 } else { turns(x).cos() }
}

const UNARY: [Unary; 7] = [
    Unary { name: "exp", lanes: F32x8::exp, platform: f32::exp, exact: f64::exp, range: [-80.0, 80.0] },
    Unary { name: "ln", lanes: F32x8::ln, platform: f32::ln, exact: f64::ln, range: [1e-6, 1e6] },
    Unary {
        name: "sin(2 pi x)",
        lanes: |x| x.sin_cos_2pi().0,
        platform: |x| ((x - x.round()) * std::f32::consts::TAU).sin(),
        exact: sin_turns,
        range: [-1.0, 1.0],
    },
    Unary {
        name: "cos(2 pi x)",
        lanes: |x| x.sin_cos_2pi().1,
        platform: |x| ((x - x.round()) * std::f32::consts::TAU).cos(),
        exact: cos_turns,
        range: [-1.0, 1.0],
    },
    Unary {
        name: "acos",
        lanes: F32x8::acos,
        platform: |x| x.clamp(-1.0, 1.0).acos(),
        exact: |x| x.clamp(-1.0, 1.0).acos(),
        range: [-1.0, 1.0],
    },
    Unary {
        name: "asin",
        lanes: F32x8::asin,
        platform: |x| x.clamp(-1.0, 1.0).asin(),
        exact: |x| x.clamp(-1.0, 1.0).asin(),
        range: [-1.0, 1.0],
    },
    Unary { name: "sqrt", lanes: F32x8::sqrt, platform: f32::sqrt, exact: f64::sqrt, range: [1e-6, 1e6] },
];

const BINARY: [Binary; 2] = [
    Binary {
        name: "powf",
        lanes: F32x8::powf,
        platform: f32::powf,
        exact: f64::powf,
        range: [[1e-3, 1e3], [-4.0, 4.0]],
    },
    Binary {
        name: "atan2",
        lanes: F32x8::atan2,
        platform: f32::atan2,
        exact: f64::atan2,
        range: [[-4.0, 4.0], [-4.0, 4.0]],
    },
];

/// Spacing of f32 at `y`, at least the smallest subnormal.
fn ulp(y: f64) -> f64 {
    let e = ((y.abs().to_bits() >> 52) as i32 - 1023).clamp(-126, 127);
    f64::from_bits(((e - 23 + 1023) as u64) << 52)
}

/// Error of `got` in ULP; what is beyond the largest float counts as that, and a NaN in one of them only as infinite.
fn error(got: f32, exact: f64) -> f64 {
    if got.is_nan() || exact.is_nan() {
        return if got.is_nan() && exact.is_nan() { 0.0 } else { f64::INFINITY };
    }
    let top = f64::from(f32::MAX);
    (f64::from(got).clamp(-top, top) - exact.clamp(-top, top)).abs() / ulp(exact.clamp(-top, top))
}

/// Errors of one variant.
#[derive(Clone, Default)]
pub(super) struct Errors {
    count: u64,
    sum: f64,
    pub(super) max: f64,
    worst: Vec<f32>,
}

impl Errors {
    pub(super) fn see(&mut self, e: f64, arguments: &[f32]) {
        self.count += 1;
        self.sum += e;
        if e > self.max || self.count == 1 {
            (self.max, self.worst) = (e, arguments.to_vec());
        }
    }

    fn merge(mut self, o: Self) -> Self {
        let worse = o.max > self.max || self.worst.is_empty();
        let (max, worst) = if worse { (o.max, o.worst) } else { (self.max, self.worst) };
        self.count += o.count;
        Self { count: self.count, sum: self.sum + o.sum, max, worst }
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }

    /// Row of a variant with these errors.
    pub(super) fn row(self, group: Group, function: &str, variant: &str, exhaustive: bool, ns: Spread) -> Kernel {
        Kernel {
            group,
            function: function.into(),
            variant: variant.into(),
            instruction_set: INSTRUCTION_SET.into(),
            arguments: self.count,
            exhaustive,
            // a ledger has no infinities
            max_ulp: self.max.min(f64::MAX),
            mean_ulp: self.mean().min(f64::MAX),
            worst: self.worst,
            ns,
            ..Kernel::default()
        }
    }
}

/// Bit patterns of a part of all floats: the `stride` of the effort apart, all if it is 1.
fn sweep(f: &Unary, part: u64, parts: u64, stride: u64) -> [Errors; 2] {
    let mut errors = [Errors::default(), Errors::default()];
    let size = (1u64 << 32) / parts;
    // eight patterns of each block of eight strides, at offsets that change
    let (first, block) = (part * size, 8 * stride);
    for n in 0..size / block {
        let shift = if stride == 1 { 0 } else { (n * 0x9e37_79b9) % stride };
        let x = std::array::from_fn(|i| f32::from_bits((first + n * block + i as u64 * stride + shift) as u32));
        let y = (f.lanes)(F32x8::new(x)).to_array();
        for (x, y) in x.into_iter().zip(y) {
            let exact = (f.exact)(f64::from(x));
            errors[0].see(error(y, exact), &[x]);
            errors[1].see(error((f.platform)(x), exact), &[x]);
        }
    }
    errors
}

/// Even numbers, always the same.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// In [0, 1), a whole number of 2^-24.
    pub(super) fn number(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, [low, high]: [f32; 2]) -> f32 {
        let u = self.number();
        // over magnitudes where the range has many
        if low > 0.0 && high / low > 100.0 { low * (high / low).powf(u) } else { low + (high - low) * u }
    }
}

/// Pairs within the range that is timed.
fn sweep_pairs(f: &Binary, packets: u64) -> [Errors; 2] {
    let mut errors = [Errors::default(), Errors::default()];
    let mut random = Random(1);
    for _ in 0..packets {
        let x: [f32; 8] = std::array::from_fn(|_| random.between(f.range[0]));
        let y: [f32; 8] = std::array::from_fn(|_| random.between(f.range[1]));
        let z = (f.lanes)(F32x8::new(x), F32x8::new(y)).to_array();
        for i in 0..8 {
            let exact = (f.exact)(f64::from(x[i]), f64::from(y[i]));
            errors[0].see(error(z[i], exact), &[x[i], y[i]]);
            errors[1].see(error((f.platform)(x[i], y[i]), exact), &[x[i], y[i]]);
        }
    }
    errors
}

/// Arithmetic of this build.
pub(super) const ARITHMETIC: &str = if REPRODUCIBLE { "reproducible" } else { "fast" };

/// Packets that are timed: they lie in the nearest cache.
const TIMED: usize = 256;

/// Parts of a sweep.
const PARTS: u64 = 64;

/// All functions. Errors take all processors; times are measured afterwards, on one.
pub(super) fn measure(effort: &Effort, twins: &Twins, done: impl Fn(usize, usize) + Sync) -> Vec<Kernel> {
    let jobs: Vec<(usize, u64)> = (0..UNARY.len()).flat_map(|f| (0..PARTS).map(move |p| (f, p))).collect();
    let total = jobs.len();
    let swept = in_parallel(&jobs, |&(f, p)| sweep(&UNARY[f], p, PARTS, effort.stride), |n| done(n, total));
    let mut kernels = Vec::new();
    let mut random = Random(7);
    for (i, f) in UNARY.iter().enumerate() {
        let parts = jobs.iter().zip(&swept).filter(|(job, _)| job.0 == i).map(|(_, e)| e.clone());
        let [ours, platform] =
            parts.fold([Errors::default(), Errors::default()], |[a, b], [c, d]| [a.merge(c), b.merge(d)]);
        let packets: Vec<F32x8> = (0..TIMED).map(|_| F32x8::from_fn(|_| random.between(f.range))).collect();
        let times = [
            nanoseconds(&packets, effort.repeats, f.lanes),
            nanoseconds(&packets, effort.repeats, |x| F32x8::new(x.to_array().map(f.platform))),
        ];
        let exhaustive = effort.stride == 1;
        kernels.extend(rows(f.name, exhaustive, [ours, platform], times, twins));
    }
    for f in &BINARY {
        let errors = sweep_pairs(f, (1 << 25) / effort.stride.clamp(64, 1 << 16));
        let packets: Vec<[F32x8; 2]> =
            (0..TIMED).map(|_| f.range.map(|r| F32x8::from_fn(|_| random.between(r)))).collect();
        let platform = |[x, y]: [F32x8; 2]| {
            let (x, y) = (x.to_array(), y.to_array());
            F32x8::from_fn(|i| (f.platform)(x[i], y[i]))
        };
        let times = [
            nanoseconds(&packets, effort.repeats, |[x, y]| (f.lanes)(x, y)),
            nanoseconds(&packets, effort.repeats, platform),
        ];
        kernels.extend(rows(f.name, false, errors, times, twins));
    }
    kernels
}

fn rows(name: &str, exhaustive: bool, errors: [Errors; 2], times: [Spread; 2], twins: &Twins) -> [Kernel; 2] {
    let ours = format!("croupier, {ARITHMETIC}");
    let [computed, platform] = errors;
    let row = |errors: Errors, variant: &str, ns| errors.row(Group::Function, name, variant, exhaustive, ns);
    let counted = match name {
        "sin(2 pi x)" => "sin_2pi",
        "cos(2 pi x)" => "cos_2pi",
        same => same,
    };
    let ours = Kernel { instructions: twins.instructions("math", counted), ..row(computed, &ours, times[0]) };
    [ours, row(platform, "platform, f32 x 8", times[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: an error in units of the result's own float, patterns that are left out, a NaN that passes.
    #[test]
    fn errors_are_in_units_of_the_exact_value() {
        assert_eq!(error(1.0, 1.0 + f64::from(f32::EPSILON)), 1.0);
        assert_eq!(error(f32::INFINITY, 1e300), 0.0);
        assert_eq!(error(0.0, f64::from(f32::from_bits(3))), 3.0);
        assert_eq!(error(f32::NAN, 1.0), f64::INFINITY);
        assert_eq!(error(f32::NAN, f64::NAN), 0.0);
        let [ours, platform] =
            (0..4).map(|p| sweep(&UNARY[0], p, 4, 1 << 20)).reduce(|[a, b], [c, d]| [a.merge(c), b.merge(d)]).unwrap();
        assert_eq!((ours.count, platform.count), (4096, 4096));
        assert!(ours.max > 0.3 && ours.max <= 1.02, "exp: {} ULP", ours.max);
        assert!(platform.max <= 1.0, "the platform's exp: {} ULP", platform.max);
    }
}

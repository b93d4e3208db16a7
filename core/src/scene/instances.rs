//! What the transforms of an instance determine: its inverse, its box, how much worse rounding gets.
//!
//! *Time.* At time t in [0, 1] the map has the entries `(1 - t) a + t b` of the two keys: each point moves on a straight
//! line. So the boxes of both keys together hold it at all times.
//!
//! *Condition.* Rounding of a ray's transformation is bounded by `K = |A| |A^-1|` (entrywise; see the pad below). Over time,
//! with the adjugate: `|A^-1| = |adj A| / |det A|`, where adj A is quadratic and det A cubic in t. Bernstein coefficients
//! bound both: of adj A they are adj A0, (adj (A0 + A1) - adj A0 - adj A1) / 2, adj A1; of det A they are det A0,
//! tr(adj A0 A1) / 3, tr(adj A1 A0) / 3, det A1. Unless all four have one sign the map may be singular on the way, and is
//! refused: rotations by 120 degrees or more between the keys are.
//!
//! *Pad.* With u = 2^-24: a ray o + t d becomes `o' = I (o - T)`, `d' = I d` with I the rounded inverse: one rounding of the
//! difference, one of I's entries, three of the sum. Back in the space around the instance this moves a point w of the ray
//! by at most u K (5.1 |o - T| + 4.1 |w - o|). The walk of the object's tree finds what lies within 4 u (|o'| + S') of the
//! ray, S' the object's largest coordinates: at most u K (4 |o - T| + 4 |w - T|) around the instance. Together below
//! `u K (14 |o| + 14 |T| + 9 |w|)`. The part with o depends on the ray, and is added to the boxes as they are met
//! (`accel/instances.rs`); here the box grows by `16 u K (|T| + W)`, W the box's largest coordinates, and by `8 u |A| S'` for
//! interpolated entries and rounded corners.

use super::blob::{INSTANCE_MIRRORED, INSTANCE_MOVING, MAX_CONDITION, MAX_COORDINATE};

/// Unit roundoff of `f32`.
const U: f64 = 1.0 / 16_777_216.0;

/// A 3 x 3 matrix by rows.
type Matrix = [[f64; 3]; 3];

/// What follows from an instance's transforms and its object's bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derived {
    /// See [`super::blob::Instance::inverse`].
    pub inverse: [[f32; 3]; 3],
    /// See [`super::blob::Instance::condition`].
    pub condition: f32,
    /// [`INSTANCE_MIRRORED`] and [`INSTANCE_MOVING`].
    pub flags: u32,
    /// Smallest and largest coordinates that rays must be tested against, in the space around the instance.
    pub bounds: [[f32; 3]; 2],
}

/// Fault of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum InstanceFault {
    /// An entry of a transform that is not finite, or beyond [`MAX_COORDINATE`].
    Entry(f32),
    /// A map that is singular, too close to it, or may be on its way between the keys: its condition.
    Singular(f32),
    /// A box that reaches a coordinate beyond [`MAX_COORDINATE`].
    Outside(f32),
    /// An object that does not exist, is the world, or nests too deep.
    Object(u32),
    /// Inverse, condition or flags that do not follow from the transforms.
    Derived,
    /// Lights that are not those of the object's emitting triangles.
    Lights(u32),
}

fn adjugate([[a, b, c], [d, e, f], [g, h, i]]: Matrix) -> Matrix {
    [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ]
}

/// Each pair of entries combined.
fn combine(a: Matrix, b: Matrix, f: impl Fn(f64, f64) -> f64) -> Matrix {
    let row = |[a, b, c]: [f64; 3], [x, y, z]: [f64; 3]| [f(a, x), f(b, y), f(c, z)];
    let ([a0, a1, a2], [b0, b1, b2]) = (a, b);
    [row(a0, b0), row(a1, b1), row(a2, b2)]
}

fn dot([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> f64 {
    a * x + b * y + c * z
}

fn times(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| dot(row, v))
}

fn transpose([[a, b, c], [d, e, f], [g, h, i]]: Matrix) -> Matrix {
    [[a, d, g], [b, e, h], [c, f, i]]
}

/// Trace of the product.
fn trace(a: Matrix, b: Matrix) -> f64 {
    let [b0, b1, b2] = transpose(b);
    let [a0, a1, a2] = a;
    dot(a0, b0) + dot(a1, b1) + dot(a2, b2)
}

fn each(a: [f64; 3], b: [f64; 3], f: impl Fn(f64, f64) -> f64) -> [f64; 3] {
    let ([a, b, c], [x, y, z]) = (a, b);
    [f(a, x), f(b, y), f(c, z)]
}

fn linear(m: [[f32; 4]; 3]) -> Matrix {
    m.map(|[a, b, c, _]| [a, b, c].map(f64::from))
}

fn translation(m: [[f32; 4]; 3]) -> [f64; 3] {
    m.map(|[_, _, _, t]| f64::from(t))
}

/// Largest `f32` up to `x`.
fn down(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

/// Smallest `f32` from `x` on.
fn up(x: f64) -> f32 {
    -down(-x)
}

/// Box of `m` applied to the box `lo` to `hi`; exact up to `f64`.
fn around(m: [[f32; 4]; 3], lo: [f64; 3], hi: [f64; 3]) -> [[f64; 3]; 2] {
    let pick = |f: fn(f64, f64) -> f64| {
        let row = |row: [f64; 3]| {
            let [x, y, z] = each(each(row, lo, |a, b| a * b), each(row, hi, |a, b| a * b), f);
            x + y + z
        };
        each(linear(m).map(row), translation(m), |a, t| a + t)
    };
    [pick(f64::min), pick(f64::max)]
}

/// Whether the blob may hold the number.
fn fits(x: f32) -> bool {
    (-MAX_COORDINATE..=MAX_COORDINATE).contains(&x)
}

/// Inverse of a matrix: computed in `f64`, each entry rounded once. Not finite if the matrix is singular.
pub(crate) fn inverse(m: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    let m = m.map(|row| row.map(f64::from));
    let adjugate = adjugate(m);
    let det = trace(adjugate, m) / 3.0;
    adjugate.map(|row| row.map(|x| (x / det) as f32))
}

/// What `to_world` (both keys) determines for an object of the given bounds.
///
/// # Errors
/// [`InstanceFault::Entry`], [`InstanceFault::Singular`], [`InstanceFault::Outside`].
pub fn derive(to_world: &[[[f32; 4]; 3]; 2], [lo, hi]: [[f32; 3]; 2]) -> Result<Derived, InstanceFault> {
    for x in to_world.as_flattened().as_flattened() {
        if !fits(*x) {
            return Err(InstanceFault::Entry(*x));
        }
    }
    let [open, close] = *to_world;
    let (a, b) = (linear(open), linear(close));
    let sum = combine(a, b, |x, y| x + y);
    let (adj_a, adj_b) = (adjugate(a), adjugate(b));
    let mixed = combine(adjugate(sum), combine(adj_a, adj_b, |x, y| x + y), |s, ab| (s - ab) / 2.0);
    let det = [trace(adj_a, a), trace(adj_a, b), trace(adj_b, a), trace(adj_b, b)].map(|d| d / 3.0);
    let [first, ..] = det;
    let smallest = det.iter().fold(f64::INFINITY, |m, d| m.min(d * first.signum()));
    let larger = |x: f64, y: f64| x.abs().max(y.abs());
    let most = combine(a, b, larger);
    let adjugates = combine(combine(adj_a, adj_b, larger), mixed, larger);
    let columns = transpose(adjugates);
    let k: Matrix = most.map(|row| columns.map(|column| dot(row, column) / smallest));
    let condition = k.iter().map(|[x, y, z]| x + y + z).fold(0.0, f64::max);
    if !(smallest > 0.0 && condition <= f64::from(MAX_CONDITION)) {
        return Err(InstanceFault::Singular(if smallest > 0.0 { condition as f32 } else { f32::INFINITY }));
    }
    let inverse = inverse(open.map(|[a, b, c, _]| [a, b, c]));
    if let Some(x) = inverse.as_flattened().iter().find(|x| !fits(**x)) {
        return Err(InstanceFault::Singular(*x));
    }
    let (lo, hi) = (lo.map(f64::from), hi.map(f64::from));
    let ([lo_a, hi_a], [lo_b, hi_b]) = (around(open, lo, hi), around(close, lo, hi));
    let (low, high) = (each(lo_a, lo_b, f64::min), each(hi_a, hi_b, f64::max));
    let reach = each(each(low, high, larger), each(translation(open), translation(close), larger), |w, t| w + t);
    let pad = each(times(k, reach), times(most, each(lo, hi, larger)), |p, q| 16.0 * U * p + 8.0 * U * q);
    let bounds = [each(low, pad, |x, p| x - p).map(down), each(high, pad, |x, p| x + p).map(up)];
    if let Some(x) = bounds.as_flattened().iter().find(|x| !fits(**x)) {
        return Err(InstanceFault::Outside(*x));
    }
    let mirrored = if first < 0.0 { INSTANCE_MIRRORED } else { 0 };
    let moving =
        if open.map(|r| r.map(f32::to_bits)) == close.map(|r| r.map(f32::to_bits)) { 0 } else { INSTANCE_MOVING };
    Ok(Derived { inverse, condition: up(condition), flags: mirrored | moving, bounds })
}

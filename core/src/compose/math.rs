//! Functions in f64 that `core` lacks, and the few formulas of vectors that composing needs.

use crate::film::SqrtNewton;

/// Square root, sine and cosine in f64. The formulas of baking take them from here, so that a host with a mathematical
/// library uses that and a host without one has [`Portable`].
pub trait Math {
    /// Square root of a number from 0 on.
    fn sqrt(x: f64) -> f64;

    /// Sine and cosine of an angle in radians, as a magnitude up to 1e5.
    fn sin_cos(x: f64) -> (f64, f64);

    /// Tangent, as [`Self::sin_cos`].
    fn tan(x: f64) -> f64 {
        let (sin, cos) = Self::sin_cos(x);
        sin / cos
    }
}

/// The functions by the four operations alone, with the same bits on every target: within 1 ulp (square root) and
/// within
/// 4e-16 (sine and cosine).
#[derive(Clone, Copy, Debug)]
pub struct Portable;

impl Math for Portable {
    fn sqrt(x: f64) -> f64 {
        x.sqrt_newton()
    }

    fn sin_cos(x: f64) -> (f64, f64) {
        // pi / 2 in three parts, the first two short enough for exact products with quarter turns
        const PARTS: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_711_166_5e-21];
        let turns = x / core::f64::consts::FRAC_PI_2;
        let quarter = (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i64;
        let r = PARTS.iter().fold(x, |r, part| r - quarter as f64 * part);
        // Taylor series up to the power 19 for |r| <= pi / 4, the last terms first
        let square = r * r;
        let (mut sin, mut cos) = (1.0, 1.0);
        for k in (1..10u32).rev() {
            let n = f64::from(2 * k);
            sin = 1.0 - square / (n * (n + 1.0)) * sin;
            cos = 1.0 - square / (n * (n - 1.0)) * cos;
        }
        let sin = r * sin;
        match quarter.rem_euclid(4) {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

pub(super) fn wide(v: [f32; 3]) -> [f64; 3] {
    v.map(f64::from)
}

pub(super) fn narrow(v: [f64; 3]) -> [f32; 3] {
    v.map(|x| x as f32)
}

pub(super) fn sub([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ax - bx, ay - by, az - bz]
}

pub(super) fn dot([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> f64 {
    ax * bx + ay * by + az * bz
}

pub(super) fn cross([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ay * bz - by * az, az * bx - bz * ax, ax * by - bx * ay]
}

pub(super) fn scaled(v: [f64; 3], s: f64) -> [f64; 3] {
    v.map(|x| x * s)
}

/// Unit vector along `v`; `None` if it is 0, not finite, or so short that it has no direction.
pub(super) fn normalized<M: Math>(v: [f64; 3]) -> Option<[f64; 3]> {
    let reciprocal = 1.0 / M::sqrt(dot(v, v));
    (reciprocal.is_finite() && reciprocal > 0.0).then(|| scaled(v, reciprocal))
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    /// Killed by: a quadrant with a wrong sign, a series that ends too early, a constant with a wrong digit.
    #[test]
    fn sines_are_those_of_the_standard_library() {
        for i in -40_000..40_000 {
            let x = f64::from(i) * 0.001_7;
            let (sin, cos) = Portable::sin_cos(x);
            assert!((sin - x.sin()).abs() < 4e-16 && (cos - x.cos()).abs() < 4e-16, "{x}: {sin} {cos}");
        }
        assert!((Portable::tan(0.3) - 0.3f64.tan()).abs() < 1e-15);
        assert_eq!(Portable::sqrt(2.25), 1.5);
    }
}

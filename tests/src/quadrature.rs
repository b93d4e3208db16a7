//! Quadrature for oracles.

use crate::stats::SplitMix;

/// Midpoint rule with `n` points.
pub fn midpoint(n: usize, a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let h = (b - a) / n as f64;
    (0..n).map(|i| f(a + (i as f64 + 0.5) * h)).sum::<f64>() * h
}

/// Tanh-sinh rule (Takahasi & Mori 1974) over `a..b`: tolerates integrable singularities at the ends. About 15 digits
/// for functions analytic inside.
pub fn tanh_sinh(a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let h = 1.0 / 64.0;
    let (mid, half) = (0.5 * (a + b), 0.5 * (b - a));
    let mut sum = 0.0;
    for i in -256..=256 {
        let t = f64::from(i) * h;
        let u = std::f64::consts::FRAC_PI_2 * t.sinh();
        let x = u.tanh();
        let w = std::f64::consts::FRAC_PI_2 * t.cosh() / u.cosh().powi(2);
        if w > 1e-300 && x.abs() < 1.0 {
            sum += w * f(mid + half * x);
        }
    }
    sum * h * half
}

/// One random point (fixed seed) in each cell of an `n` x `m` grid over the unit square, with the cell's numbers: for
/// integrands with creases and jumps, along which a regular grid would alias. The weight of each point is 1 / (n m).
pub fn jittered(n: usize, m: usize) -> impl Iterator<Item = ([usize; 2], [f64; 2])> {
    let mut rng = SplitMix(n as u64 * 0x1_0000_0001 + m as u64);
    (0..n * m).map(move |c| {
        let cell = [c / m, c % m];
        (cell, [(cell[0] as f64 + rng.f64()) / n as f64, (cell[1] as f64 + rng.f64()) / m as f64])
    })
}

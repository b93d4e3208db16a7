//! A numerical minimum, for tests of what claims to be optimal.

/// Minimum of `f` over positive numbers in `low..high` by cyclic golden-section search along the logarithm of each; for
/// functions with one valley along every coordinate.
pub fn minimise(f: impl Fn(&[f64]) -> f64, start: &[f64], [low, high]: [f64; 2]) -> Vec<f64> {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let mut x = start.to_vec();
    for _ in 0..1000 {
        let before = x.clone();
        for i in 0..x.len() {
            let (mut a, mut b) = (low.ln(), high.ln());
            let mut at = |t: f64| {
                x[i] = t.exp();
                f(&x)
            };
            while b - a > 1e-6 {
                let (c, d) = (b - ratio * (b - a), a + ratio * (b - a));
                if at(c) < at(d) { b = d } else { a = c }
            }
            x[i] = (0.5 * (a + b)).exp();
        }
        if x.iter().zip(&before).all(|(x, y)| (x / y - 1.0).abs() < 1e-5) {
            break;
        }
    }
    x
}

//! Jacobians of sampling maps by finite differences of the f32 code under test.

/// A point in up to three dimensions.
pub type V = [f64; 3];

/// |d x / du x d x / dv| of a map of the unit square at (u, v), `None` where the map is not smooth there (seams of the
/// square's mapping to a disk, cells, clamps): central differences with `h` and `h / 2`, one Richardson step, error
/// O(h^4) plus rounding of about 1e-7 / h.
pub fn area_ratio(map: &dyn Fn(f64, f64) -> V, u: f64, v: f64, h: f64) -> Option<f64> {
    let partial = |f: &dyn Fn(f64) -> V, h: f64| -> V {
        let (a, b) = (f(h), f(-h));
        std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * h))
    };
    let (coarse, fine) = {
        let du = |h: f64| partial(&|d| map(u + d, v), h);
        let dv = |h: f64| partial(&|d| map(u, v + d), h);
        ([du(h), dv(h)], [du(h / 2.0), dv(h / 2.0)])
    };
    let best: [V; 2] = std::array::from_fn(|k| std::array::from_fn(|i| (4.0 * fine[k][i] - coarse[k][i]) / 3.0));
    let area = |[a, b]: [V; 2]| {
        let c = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        c.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let (rough, result) = (area(fine), area(best));
    ((rough - result).abs() <= 0.004 * result && result > 0.0).then_some(result)
}

/// Worst relative deviation of `density * area ratio` from 1 over an n x n grid, and the share of points that were
/// smooth enough to judge.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deviation {
    /// Largest |density * ratio - 1|.
    pub worst: f64,
    /// Judged points over all points with a sample.
    pub judged: f64,
}

/// Runs over the grid; `density(u, v)` is `None` where there is no sample.
pub fn deviation(
    n: usize,
    h: f64,
    map: &dyn Fn(f64, f64) -> V,
    density: &dyn Fn(f64, f64) -> Option<f64>,
) -> Deviation {
    let (mut worst, mut judged, mut all) = (0.0f64, 0usize, 0usize);
    for i in 0..n {
        for j in 0..n {
            // off the symmetric places, where seams lie
            let (u, v) = ((i as f64 + 0.437) / n as f64, (j as f64 + 0.561) / n as f64);
            let near = |x: f64| x < 1.5 * h || x > 1.0 - 1.5 * h;
            let Some(p) = density(u, v).filter(|_| !near(u) && !near(v)) else { continue };
            all += 1;
            if let Some(ratio) = area_ratio(map, u, v, h) {
                judged += 1;
                worst = worst.max((p * ratio - 1.0).abs());
            }
        }
    }
    Deviation { worst, judged: judged as f64 / all.max(1) as f64 }
}

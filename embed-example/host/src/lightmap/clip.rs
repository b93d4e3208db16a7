//! Convex polygons in the plane of the map, and what of them lies in a texel or in another.

/// Corners of a convex polygon, in units of texels.
pub(super) type Polygon = Vec<[f64; 2]>;

/// Twice the signed area of a triangle, positive if it runs from +x to +y.
pub(super) fn doubled_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Area of a polygon.
pub(super) fn area(polygon: &[[f64; 2]]) -> f64 {
    let Some((first, rest)) = polygon.split_first() else { return 0.0 };
    rest.windows(2).map(|w| doubled_area([*first, w[0], w[1]])).sum::<f64>().abs() / 2.0
}

/// The part of the polygon where `side`, which is linear, is not negative (Sutherland and Hodgman, Reentrant Polygon
/// Clipping, CACM 1974).
fn half(polygon: &[[f64; 2]], side: impl Fn([f64; 2]) -> f64) -> Polygon {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (a, b) = (side(*p), side(q));
        if a >= 0.0 {
            out.push(*p);
        }
        if (a > 0.0) != (b > 0.0) && a != 0.0 && b != 0.0 {
            let t = a / (a - b);
            out.push([p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t]);
        }
    }
    out
}

/// The part of a triangle in the texel of column `x` and row `y`; empty, or with at least three corners.
pub(super) fn in_texel(triangle: &[[f64; 2]; 3], x: u32, y: u32) -> Polygon {
    let [x, y] = [x, y].map(f64::from);
    let mut polygon = half(triangle, |p| p[0] - x);
    polygon = half(&polygon, |p| x + 1.0 - p[0]);
    polygon = half(&polygon, |p| p[1] - y);
    polygon = half(&polygon, |p| y + 1.0 - p[1]);
    if polygon.len() < 3 { Vec::new() } else { polygon }
}

/// Area that two convex polygons share.
pub(super) fn shared_area(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    if b.len() < 3 {
        return 0.0;
    }
    let signed: f64 = b.windows(2).skip(1).map(|w| doubled_area([b[0], w[0], w[1]])).sum();
    let mut polygon = a.to_vec();
    for (i, p) in b.iter().enumerate() {
        let q = b[(i + 1) % b.len()];
        polygon = half(&polygon, |r| doubled_area([*p, q, r]) * signed.signum());
    }
    area(&polygon)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a side that is left out, clipped away or clipped twice; an orientation that matters.
    #[test]
    fn parts_of_triangles_add_up() {
        for triangle in [[[0.3, 0.2], [4.7, 1.1], [1.6, 3.9]], [[1.6, 3.9], [4.7, 1.1], [0.3, 0.2]]] {
            let whole = doubled_area(triangle).abs() / 2.0;
            let parts: Vec<Polygon> = (0..25).map(|i| in_texel(&triangle, i % 5, i / 5)).collect();
            let sum: f64 = parts.iter().map(|p| area(p)).sum();
            assert!((sum - whole).abs() < 1e-12, "{sum} of {whole}");
            assert!(parts.iter().any(|p| (area(p) - 1.0).abs() < 1e-12), "none is full");
            for part in &parts {
                assert!((shared_area(part, &triangle) - area(part)).abs() < 1e-12);
                assert!((shared_area(&triangle, part) - area(part)).abs() < 1e-12);
            }
            assert!(shared_area(&parts[6], &parts[7]) < 1e-12);
        }
        // a corner in the middle of an edge adds nothing
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let diamond = [[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]];
        assert!((shared_area(&square, &diamond) - 0.5).abs() < 1e-12);
    }
}

//! Triangles of polygons, which files give as loops of corners.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;
use glam::{DVec2, DVec3};
use std::collections::BTreeSet;

/// Polygons of more corners become fans: the time of ear clipping can grow with their square.
const MOST_CORNERS: usize = 1 << 14;

/// Splits a polygon into triangles of its corners, which run the way that the polygon runs: always `points.len() - 2`
/// of them, none below three corners.
///
/// A fan around the first corner if all its triangles face the way of the polygon (every convex polygon), else ears are
/// clipped (Eberly, Triangulation by Ear Clipping) after a projection along the polygon's area vector. Corners on a
/// straight line stay corners, so that the neighbours along an edge see the same vertices. A polygon that no plane
/// shows without crossings, or without area, becomes a fan as well.
pub(crate) fn triangulate(points: &[[f32; 3]]) -> Vec<[u32; 3]> {
    let fan = || (2..points.len() as u32).map(|i| [0, i - 1, i]).collect();
    if points.len() <= 3 || points.len() > MOST_CORNERS || fan_faces_forwards(points) {
        return fan();
    }
    clip(points).unwrap_or_else(fan)
}

/// Whether every triangle of the fan around the first corner has the direction of the polygon's area vector.
fn fan_faces_forwards(points: &[[f32; 3]]) -> bool {
    let origin = position(points[0]);
    let areas = || points[1..].windows(2).map(|w| (position(w[0]) - origin).cross(position(w[1]) - origin));
    let whole: DVec3 = areas().sum();
    areas().all(|area| area.dot(whole) > 0.0)
}

fn position(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Ears of the polygon; `None` if they do not cover it.
fn clip(points: &[[f32; 3]]) -> Option<Vec<[u32; 3]>> {
    let finite = points.iter().flatten().all(|x| x.is_finite());
    // relative to a corner, so that the projection does not lose what is far from the origin
    let relative: Vec<[f64; 3]> = points.iter().map(|p| (position(*p) - position(points[0])).to_array()).collect();
    let mut flat = Vec::with_capacity(points.len());
    if !finite || !project3d_to_2d(&relative, points.len(), &mut flat) {
        return None;
    }
    let mut corners: Vec<u32> = Vec::new();
    Earcut::new().earcut_slice(&flat, &[], &mut corners);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| flat[i as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    // The projection shows the polygon counter-clockwise.
    let forwards = |t: &[u32; 3]| if area(t) < 0.0 { [t[0], t[2], t[1]] } else { *t };
    let mut triangles: Vec<[u32; 3]> = corners.as_chunks().0.iter().map(forwards).collect();
    let covered: f64 = triangles.iter().map(area).sum();
    let whole: f64 = (2..flat.len() as u32).map(|i| area(&[0, i - 1, i])).sum();
    if (covered - whole).abs() > 1e-6 * whole {
        return None;
    }
    keep_straight_corners(&mut triangles, &flat);
    (triangles.len() == points.len() - 2).then_some(triangles)
}

/// Ear clipping leaves out corners on a straight line. There, sides of triangles and of the polygon face each other that
/// have not the same ends: each triangle whose side passes a corner of those is split at the corner.
fn keep_straight_corners(triangles: &mut Vec<[u32; 3]>, flat: &[[f64; 2]]) {
    let n = flat.len() as u32;
    if triangles.len() + 2 == flat.len() {
        return;
    }
    // Rounding makes triangles of straight corners; the others' sides say what is there.
    triangles.retain(|t| (0..3).all(|i| along([t[i], t[(i + 1) % 3], t[(i + 2) % 3]], flat).is_none()));
    // Sides of the polygon and, backwards, of triangles, as far as they do not cancel.
    let mut open: BTreeSet<[u32; 2]> = BTreeSet::new();
    let add = |open: &mut BTreeSet<[u32; 2]>, [a, b]: [u32; 2]| {
        if !open.remove(&[b, a]) {
            open.insert([a, b]);
        }
    };
    (0..n).for_each(|i| add(&mut open, [i, (i + 1) % n]));
    triangles.iter().flat_map(|t| [[t[1], t[0]], [t[2], t[1]], [t[0], t[2]]]).for_each(|side| add(&mut open, side));
    let mut waiting: Vec<[u32; 2]> = open.iter().copied().collect();
    while let Some([from, to]) = waiting.pop() {
        let turned =
            |t: &[u32; 3]| [*t, [t[1], t[2], t[0]], [t[2], t[0], t[1]]].into_iter().find(|t| t[..2] == [to, from]);
        let owner = triangles.iter().enumerate().find_map(|(i, t)| Some((i, turned(t)?[2])));
        let nearest = open.iter().filter_map(|[corner, _]| Some((*corner, along([from, to, *corner], flat)?)));
        let nearest = nearest.min_by(|a, b| a.1.total_cmp(&b.1));
        if let (true, Some((owner, apex)), Some((middle, _))) = (open.contains(&[from, to]), owner, nearest) {
            triangles.swap_remove(owner);
            triangles.extend([[to, middle, apex], [middle, from, apex]]);
            open.remove(&[from, to]);
            for side in [[from, middle], [middle, to]] {
                add(&mut open, side);
                waiting.push(side);
            }
        }
    }
}

/// Position of the third corner on the straight line between the first two, above 0 and below 1.
fn along(corners: [u32; 3], flat: &[[f64; 2]]) -> Option<f64> {
    let [a, b, c] = corners.map(|i| DVec2::from_array(flat[i as usize]));
    let (side, to_corner) = (b - a, c - a);
    let length = side.length_squared();
    let position = side.dot(to_corner) / length;
    (side.perp_dot(to_corner).abs() <= 1e-7 * length && position > 0.0 && position < 1.0).then_some(position)
}

#[cfg(test)]
mod tests {
    use super::triangulate;
    use glam::DVec3;
    use std::collections::HashMap;

    fn at(points: &[[f32; 3]], i: u32) -> DVec3 {
        DVec3::from_array(points[i as usize].map(f64::from))
    }

    /// Triangles that cover the polygon once: n - 2 of them, the whole area, none turned over, every side of the polygon
    /// once and every other side once each way.
    fn check(points: &[[f32; 3]], name: &str) {
        let n = points.len() as u32;
        let triangles = triangulate(points);
        assert_eq!(triangles.len(), points.len() - 2, "{name}");
        let area = |t: [u32; 3]| {
            let [a, b, c] = t.map(|i| at(points, i));
            (b - a).cross(c - a) / 2.0
        };
        let whole: DVec3 = (2..n).map(|i| area([0, i - 1, i])).sum();
        let sum: f64 = triangles.iter().map(|t| area(*t).length()).sum();
        assert!((sum - whole.length()).abs() < 1e-5 * sum, "{name}: area {sum}, not {}", whole.length());
        assert!(triangles.iter().all(|t| area(*t).dot(whole) > -1e-12), "{name}: {triangles:?}");
        let mut runs: HashMap<[u32; 2], i32> = HashMap::new();
        for [a, b, c] in triangles {
            for [p, q] in [[a, b], [b, c], [c, a]] {
                *runs.entry([p, q]).or_default() += 1;
                *runs.entry([q, p]).or_default() -= 1;
            }
        }
        for i in 0..n {
            *runs.entry([i, (i + 1) % n]).or_default() -= 1;
            *runs.entry([(i + 1) % n, i]).or_default() += 1;
        }
        assert!(runs.values().all(|sum| *sum == 0), "{name}: {runs:?}");
    }

    /// Killed by: a fan (the C loses its notch); triangles the way that the crate gives them; corners on straight lines
    /// left out; a projection along an axis.
    #[test]
    fn polygons_are_covered_once() {
        let shapes: &[(&str, &[[f32; 2]])] = &[
            ("square", &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
            ("dart", &[[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]]),
            ("dart from its notch", &[[0.5, 0.0], [2.0, 1.0], [0.0, 0.0], [2.0, -1.0]]),
            ("C", &[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [3.0, 2.0], [3.0, 3.0], [0.0, 3.0]]),
            ("straight corners", &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]]),
            (
                "straight corners in a notch",
                &[
                    [0.0, 0.0],
                    [4.0, 0.0],
                    [4.0, 3.0],
                    [3.0, 3.0],
                    [3.0, 2.0],
                    [3.0, 1.0],
                    [2.0, 1.0],
                    [1.0, 1.0],
                    [1.0, 2.0],
                    [1.0, 3.0],
                    [0.5, 3.0],
                    [0.0, 3.0],
                    [0.0, 1.5],
                ],
            ),
        ];
        let star: Vec<[f32; 2]> = (0..40)
            .map(|i| {
                let (angle, radius) = (i as f32 * 0.157_079_63, if i % 2 == 0 { 1.0 } else { 0.4 });
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        let comb: Vec<[f32; 2]> = [[200.0, -1.0], [0.0, -1.0]]
            .into_iter()
            .chain((0..200).map(|i| [i as f32, if i % 3 == 0 { 5.0 } else { 0.0 }]))
            .rev()
            .collect();
        let all = shapes.iter().copied().chain([("star", star.as_slice()), ("comb", comb.as_slice())]);
        for (name, shape) in all {
            // upright, turned over, slanted far from the origin
            let places: [fn([f32; 2]) -> [f32; 3]; 4] = [
                |[x, y]| [x, y, 0.0],
                |[x, y]| [0.0, x, y],
                |[x, y]| [y, x, 0.0],
                |[x, y]| [1000.0 + x, y - 500.0, 0.5 * x - 2.0 * y],
            ];
            for (k, place) in places.iter().enumerate() {
                for turn in 0..shape.len() {
                    let mut points: Vec<[f32; 3]> = shape.iter().map(|p| place(*p)).collect();
                    points.rotate_left(turn);
                    check(&points, &format!("{name} {k} {turn}"));
                }
            }
        }
    }

    /// Killed by: a panic, or other than n - 2 triangles, where ears do not exist.
    #[test]
    fn what_is_no_polygon_becomes_a_fan() {
        let line: Vec<[f32; 3]> = (0..9).map(|i| [i as f32, 0.0, 0.0]).collect();
        let bow_tie = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-3.0, 0.5, 0.0]];
        let bad = [[f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [0.0; 3], [1.0, 1.0, 0.0]];
        let huge = [[-3e38, 0.0, 0.0], [3e38, -3e38, 0.0], [-1e38, 0.0, 0.0], [3e38, 3e38, 0.0]];
        let cases: [&[[f32; 3]]; 7] = [&line, &bow_tie, &bad, &huge, &[[1.0; 3]; 12], &line[..3], &[[0.0; 3]; 20_000]];
        for points in cases {
            let triangles = triangulate(points);
            assert_eq!(triangles.len(), points.len() - 2);
            assert!(triangles.iter().flatten().all(|i| (*i as usize) < points.len()));
        }
        assert!((0..3).all(|n| triangulate(&line[..n]).is_empty()));
    }
}

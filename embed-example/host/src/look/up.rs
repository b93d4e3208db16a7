//! The guess which axis points up.

use super::axes::{Axes, Up, corners, cross, dot, sub};
use super::room::Surroundings;
use crate::description::SceneDescription;

/// The axes of a choice, and whether they were guessed.
///
/// Files do not say which way is up, apart from a few formats. Signs, by weight: the thin axis of a sheet; floor and
/// ceiling of a room; the side to
/// which an open surface faces as a whole (a terrain); that what touches the lowest plane across an axis spreads wider
/// than what touches the highest one (feet, a base, roofs of different heights); that there is more area in the lowest
/// plane than in the highest one. Without a clear sign it is the `fallback`: most OBJ and all glTF files have y up.
pub(super) fn axes(scene: &SceneDescription, choice: Up, fallback: Up) -> (Axes, bool) {
    let z = match choice {
        Up::Y => return (Axes::Y, false),
        Up::Z => return (Axes::Z, false),
        Up::Auto => guess(scene).unwrap_or(fallback == Up::Z),
    };
    (if z { Axes::Z } else { Axes::Y }, true)
}

/// A plane across an axis at one end of a mesh.
#[derive(Clone, Copy)]
struct Plane {
    /// Smallest and largest coordinates, across the axis, of the vertices near it.
    bounds: Option<[[f64; 2]; 2]>,
    /// Area of the triangles in it that face outwards.
    area: f64,
}

/// Whether z is up; `None` without a clear sign.
fn guess(scene: &SceneDescription) -> Option<bool> {
    let [lo, hi] = scene.bounds()?.map(|p| p.map(f64::from));
    let size: [f64; 3] = std::array::from_fn(|i| hi[i] - lo[i]);
    let largest = size.into_iter().fold(0.0, f64::max);
    let thin = |i: usize| size[i] < 0.02 * largest;
    match (thin(1), thin(2)) {
        (true, false) => return Some(false),
        // a card that faces the viewer, or a floor that lies: nothing tells
        (false, true) => return None,
        _ => {}
    }
    let room = |axes: &Axes| Surroundings::of(scene, axes).is_some_and(|s| s.room);
    match (room(&Axes::Y), room(&Axes::Z)) {
        (true, false) => return Some(false),
        (false, true) => return Some(true),
        _ => {}
    }
    let (mut total, mut net) = (0.0, [0.0f64; 3]);
    // of y and z: lowest, highest
    let mut planes = [[Plane { bounds: None, area: 0.0 }; 2]; 2];
    for t in &scene.triangles {
        let Some(p) = corners(scene, t.vertices) else { continue };
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0])).map(|x| x / 2.0);
        let area = dot(n, n).sqrt();
        total += area;
        (0..3).for_each(|i| net[i] += n[i]);
        for (axis, ends) in [1, 2].into_iter().zip(&mut planes) {
            for (plane, end) in ends.iter_mut().zip([lo[axis], hi[axis]]) {
                let near = |q: &[f64; 3]| (q[axis] - end).abs() <= 0.01 * size[axis];
                for q in p.iter().filter(|q| near(q)) {
                    let [a, b] = plane.bounds.unwrap_or([[f64::MAX; 2], [f64::MIN; 2]]);
                    let q = [q[0], q[3 - axis]];
                    plane.bounds = Some([[a[0].min(q[0]), a[1].min(q[1])], [b[0].max(q[0]), b[1].max(q[1])]]);
                }
                // outside of it
                if p.iter().all(near) && n[axis] * (end - lo[axis] - 0.5 * size[axis]) > 0.0 {
                    plane.area += area;
                }
            }
        }
    }
    let faces = |i: usize| {
        let flat = (0..3).filter(|k| *k != i).all(|k| size[i] <= 0.5 * size[k]);
        flat && net[i].abs() > 0.5 * total
    };
    if faces(1) != faces(2) {
        return Some(faces(2));
    }
    let across = |i: usize| size[0] * size[3 - i];
    let spread = |p: &Plane| p.bounds.map_or(0.0, |[a, b]| (b[0] - a[0]) * (b[1] - a[1]));
    let share = |axis: usize, of: &dyn Fn(&Plane) -> f64| {
        let [low, high] = planes[axis - 1];
        if across(axis) > 0.0 { (of(&low) - of(&high)) / across(axis) } else { 0.0 }
    };
    let clear = |of: &dyn Fn(&Plane) -> f64, least: f64| {
        let [y, z] = [1, 2].map(|axis| share(axis, of).max(0.0));
        let differ = (y - z).abs() > least;
        (y.max(z) > least).then_some(differ.then_some(z > y))
    };
    clear(&spread, 0.3).or_else(|| clear(&|p| p.area, 0.25)).flatten()
}

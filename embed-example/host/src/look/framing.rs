//! A camera that shows what there is.

use super::axes::{Axes, cross, dot, sub};
use crate::description::Camera;

/// Share of the picture's half width or height that what is framed reaches to.
const FILL: f64 = 0.86;
/// Direction from the target to the camera, right, up, front: from the front, the right and above (20 degrees).
const VIEW: [f64; 3] = [0.48, 0.35, 0.80];
/// Vertical field of view, degrees, unless the caller has one.
pub(super) const VFOV_DEG: f64 = 35.0;

/// A perspective camera that looks along [`VIEW`] and frames the points: they fill the picture and none is outside. All
/// points at one place are framed as a sphere of radius 1.
pub(super) fn frame(points: impl Iterator<Item = [f64; 3]> + Clone, axes: &Axes, base: &Camera) -> Camera {
    let length = dot(VIEW, VIEW).sqrt();
    let back = axes.vector(VIEW.map(|x| x / length));
    let right = {
        let r = cross(axes.up, back);
        let length = dot(r, r).sqrt();
        r.map(|x| x / length)
    };
    let above = cross(back, right);
    let down_reach = FILL * (base.vfov_deg.to_radians() / 2.0).tan();
    let right_reach = down_reach * f64::from(base.size[0]) / f64::from(base.size[1]);
    // The middle of the box as the origin keeps precision far from that of the world.
    let Some(first) = points.clone().next() else { return *base };
    let bounds = points.clone().fold([first; 2], |[lo, hi], p| {
        [std::array::from_fn(|i| lo[i].min(p[i])), std::array::from_fn(|i| hi[i].max(p[i]))]
    });
    let middle: [f64; 3] = std::array::from_fn(|i| (bounds[0][i] + bounds[1][i]) / 2.0);
    let diagonal = sub(bounds[1], bounds[0]);
    let size = dot(diagonal, diagonal).sqrt();
    // A point at (x, y), z behind the middle, is in the picture of a camera at (X, Y), Z before it if |x - X| <= reach
    // (z + Z): two half planes for each axis, whose largest offsets meet where the camera is.
    let mut offsets = [f64::NEG_INFINITY; 4];
    let seen = |p: [f64; 3]| {
        let d = sub(p, middle);
        [dot(d, right), dot(d, above), -dot(d, back)]
    };
    for [x, y, z] in points.clone().map(seen) {
        let found = [x - right_reach * z, -x - right_reach * z, y - down_reach * z, -y - down_reach * z];
        (0..4).for_each(|i| offsets[i] = offsets[i].max(found[i]));
    }
    let [r, l, u, d] = offsets;
    let needed = ((r + l) / (2.0 * right_reach)).max((u + d) / (2.0 * down_reach));
    // a point, or a line along the axis: no size to go by
    let distance = if size > 0.0 { needed.max(0.6 * size) } else { 1.0 / down_reach };
    let (mut x, mut y) = ((r - l) / 2.0, (u - d) / 2.0);
    // Across the picture's other direction there is room: as much on either side.
    for _ in 0..4 {
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for p in points.clone().map(seen) {
            let depth = (p[2] + distance).max(1e-9 * distance);
            let found = [(p[0] - x) / depth, (p[1] - y) / depth];
            (lo, hi) = ([0, 1].map(|i| lo[i].min(found[i])), [0, 1].map(|i| hi[i].max(found[i])));
        }
        x += (lo[0] + hi[0]) / 2.0 * distance;
        y += (lo[1] + hi[1]) / 2.0 * distance;
    }
    let target: [f64; 3] = std::array::from_fn(|i| middle[i] + right[i] * x + above[i] * y);
    let origin = std::array::from_fn(|i| target[i] + back[i] * distance);
    Camera { origin, target, up: axes.up, ..*base }
}

/// A camera in a closed room of a box `[smallest, largest]` in coordinates right, up, front: near the front right edge
/// at eye height, looking across.
pub(super) fn inside([lo, hi]: [[f64; 3]; 2], axes: &Axes, base: &Camera) -> Camera {
    let at = |share: [f64; 3]| -> [f64; 3] { axes.vector(std::array::from_fn(|i| lo[i] + (hi[i] - lo[i]) * share[i])) };
    Camera { origin: at([0.82, 0.58, 0.88]), target: at([0.36, 0.38, 0.2]), up: axes.up, vfov_deg: 65.0, ..*base }
}

/// A camera before the open side of a room (axis 0 or 2; smallest or largest coordinate), which it shows whole.
pub(super) fn through((axis, end): (usize, usize), [lo, hi]: [[f64; 3]; 2], axes: &Axes, base: &Camera) -> Camera {
    let middle: [f64; 3] = std::array::from_fn(|i| (lo[i] + hi[i]) / 2.0);
    let half = |i: usize| (hi[i] - lo[i]) / 2.0;
    let reach = (base.vfov_deg.to_radians() / 2.0).tan() * 0.95;
    let aspect = f64::from(base.size[0]) / f64::from(base.size[1]);
    let distance = (half(1) / reach).max(half(2 - axis) / (reach * aspect));
    let (mut origin, mut target) = (middle, middle);
    (origin[axis], target[axis]) =
        if end == 1 { (hi[axis] + distance, lo[axis]) } else { (lo[axis] - distance, hi[axis]) };
    Camera { origin: axes.vector(origin), target: axes.vector(target), up: axes.up, ..*base }
}

//! What a mesh brings along: a ground of its own, or the walls of a room.

use super::axes::{Axes, corners, cross, dot, sub};
use crate::description::SceneDescription;

/// Share of the side of the bounding box that a wall must cover.
const WALL: f64 = 0.5;
/// Share below which a side is open.
const OPEN: f64 = 0.2;
/// Share of the height, from the bottom, in which a ground lies.
const BOTTOM: f64 = 0.06;
/// Share of the box, from a side, in which a wall lies.
const SLAB: f64 = 0.15;
/// Cosine of the angle to the axis below which a triangle is not part of a wall or ground.
const LEVEL: f64 = 0.9;

/// Surroundings that a mesh has of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct Surroundings {
    /// Smallest and largest coordinates: right, up, front.
    pub bounds: [[f64; 3]; 2],
    /// A level surface at the bottom, facing up, as large as what stands on it.
    pub ground: bool,
    /// Height below which triangles belong to that ground.
    pub ground_top: f64,
    /// A ceiling, a floor and three walls at least that face inwards.
    pub room: bool,
    /// Side of the room without a wall: axis (0 or 2), smallest or largest coordinate.
    pub open_side: Option<(usize, usize)>,
}

impl Surroundings {
    /// Looks at the triangles of a scene; `None` without any.
    pub(super) fn of(scene: &SceneDescription, axes: &Axes) -> Option<Self> {
        let triangles = || {
            let all = scene.triangles.iter().filter_map(|t| corners(scene, t.vertices));
            all.map(|t| t.map(|p| axes.coordinates(p)))
        };
        let first = triangles().next()?[0];
        let bounds = triangles().flatten().fold([first; 2], |[lo, hi], p| {
            [std::array::from_fn(|i| lo[i].min(p[i])), std::array::from_fn(|i| hi[i].max(p[i]))]
        });
        let [lo, hi] = bounds;
        let size: [f64; 3] = std::array::from_fn(|i| hi[i] - lo[i]);
        // Area that faces inwards near each side: two sides of three axes; and level area at the very bottom.
        // Area on either side of a wall closes it.
        let (mut walls, mut any, mut level) = ([[0.0f64; 2]; 3], [[0.0f64; 2]; 3], 0.0);
        for [a, b, c] in triangles() {
            let n = cross(sub(b, a), sub(c, a)).map(|x| x / 2.0);
            let area = dot(n, n).sqrt();
            for i in 0..3 {
                if n[i].abs() < LEVEL * area {
                    continue;
                }
                let middle = (a[i] + b[i] + c[i]) / 3.0;
                for (end, sum) in [lo[i], hi[i]].into_iter().zip(&mut any[i]) {
                    *sum += if (middle - end).abs() < 2.0 * SLAB * size[i] { area } else { 0.0 };
                }
                if n[i] > 0.0 && middle - lo[i] < SLAB * size[i] {
                    walls[i][0] += area;
                }
                if n[i] < 0.0 && hi[i] - middle < SLAB * size[i] {
                    walls[i][1] += area;
                }
                if i == 1 && n[1] > 0.0 && middle - lo[1] <= BOTTOM * size[1] {
                    level += area;
                }
            }
        }
        let across = |i: usize| -> f64 { (0..3).filter(|k| *k != i).map(|k| size[k]).product() };
        let covered = |i: usize, side: usize| across(i) > 0.0 && walls[i][side] >= WALL * across(i);
        // the front first
        let sides = [(2, 1), (2, 0), (0, 1), (0, 0)];
        let standing = sides.into_iter().filter(|(i, s)| covered(*i, *s)).count();
        let room = covered(1, 0) && covered(1, 1) && standing >= 3;
        let open = |(i, s): &(usize, usize)| any[*i][*s] < OPEN * across(*i);
        let open_side = sides.into_iter().find(|side| room && open(side));
        let ground = across(1) > 0.0 && level >= 0.6 * across(1);
        let ground_top = lo[1] + BOTTOM * size[1];
        Some(Self { bounds, ground, ground_top, room, open_side })
    }

    /// Radius of a sphere around the box.
    pub(super) fn radius(&self) -> f64 {
        let [lo, hi] = self.bounds;
        let d = sub(hi, lo);
        dot(d, d).sqrt() / 2.0
    }

    /// Middle of the box: right, up, front.
    pub(super) fn middle(&self) -> [f64; 3] {
        std::array::from_fn(|i| (self.bounds[0][i] + self.bounds[1][i]) / 2.0)
    }
}

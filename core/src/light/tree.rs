//! Light choice by a tree: for scenes with many emitters, of which each point sees few well.
//!
//! For a point p with normal n, from the root on:
//!
//! ```text
//! loop
//!     I[k] = importance of child k for p, n
//!     child k with probability I[k] / sum of I
//! until it is a light
//! ```
//!
//! The importance bounds the irradiance that a child's lights can bring (Conty Estevez and Kulla, "Importance
//! Sampling of Many Lights with Adaptive Tree Splitting", PACMCGIT 1(2) 2018, section 4.2; Pharr, Jakob and
//! Humphreys, *Physically Based Rendering*, 4th ed., section 12.6.3): weight cos theta' cos theta_i' / d^2, where
//! theta' is the least angle between a normal of the lights and the direction to p, theta_i' the least one between n
//! and a direction to the lights. It is 0 where all lights turn their backs to p; those in one plane are asked for
//! exactly that. What differs from there:
//!
//! 1. Nodes have eight children, so that a lane is a child: no gathers, and eight lights at once are weighed by what
//!    they bring. Depth falls to a third, and 10,000 lights take five nodes. To choose, importances are transposed, so
//!    that a lane is a point.
//! 2. Balls bound places, not boxes: all that is asked of a box is a ball around it.
//! 3. Lights at infinity are children like others, with an importance that is the same everywhere.
//! 4. The cosine at the surface has a floor ([`SURFACE_FLOOR`]): n is the geometric normal, shading normals see lights
//!    below its horizon.
//!
//! The random number is stretched after each choice, so that a light is picked by the numbers of one interval; the
//! density of a hit light repeats the products in the same order along its trail, and is the same to the bit. A point
//! for which no light of a chosen child has importance gets no light sample: that is part of the probabilities.

mod build;
mod extent;

pub use build::{LightTree, build_light_tree, light_node_of};

use super::LightSelector;
use super::power::PowerSelector;
use crate::scene::Scene;
use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, LightNode, MAX_LIGHT_DEPTH, NONE};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Least share of a light's importance that remains at the horizon of a surface.
pub const SURFACE_FLOOR: f32 = 0.1;

/// Least square of a distance: keeps importances finite.
const MIN_SQUARE: f32 = 1e-18;

/// Choice by the scene's light tree; by power ([`PowerSelector`]) where it has none.
#[derive(Clone, Copy, Debug)]
pub struct TreeSelector<'s>(pub Scene<'s>);

impl LightSelector for TreeSelector<'_> {
    #[inline(always)]
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8) {
        if self.0.light_nodes.is_empty() {
            return PowerSelector(self.0).select(point, normal, r, mask);
        }
        select(self.0.light_nodes, point, normal, r, mask)
    }

    #[inline(always)]
    fn probability(&self, point: Vec3x8, normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
        if self.0.light_nodes.is_empty() {
            return PowerSelector(self.0).probability(point, normal, light, mask);
        }
        probability(&self.0, point, normal, light, mask)
    }

    #[inline(always)]
    fn without_tree(&self) -> impl LightSelector {
        PowerSelector(self.0)
    }
}

/// cos(max(0, a - b)) and its sine, for angles in [0, pi] given by sine and cosine.
#[inline(always)]
fn subtract(sin_a: F32x8, cos_a: F32x8, sin_b: F32x8, cos_b: F32x8) -> (F32x8, F32x8) {
    let none = cos_a.gt(cos_b);
    let sin = none.select(F32x8::ZERO, sin_a * cos_b - cos_a * sin_b);
    let cos = none.select(F32x8::ONE, cos_a * cos_b + sin_a * sin_b);
    (sin, cos)
}

/// Importances of the eight children of a node for the point `p` with unit normal `n`, or 0 in media: finite, not
/// negative.
#[inline(always)]
pub fn light_importance(node: &LightNode, p: [f32; 3], n: [f32; 3]) -> F32x8 {
    importance(node, p, n, Mask8::splat(n == [0.0; 3]))
}

/// [`light_importance`] for callers that know whether `n` is 0: `in_media` holds in all lanes then, else in none.
#[inline(always)]
fn importance(node: &LightNode, p: [f32; 3], n: [f32; 3], in_media: Mask8) -> F32x8 {
    let rows = |r: &[[f32; 8]; 3]| {
        let [x, y, z] = r.map(F32x8::new);
        Vec3x8::new(x, y, z)
    };
    let splat = |v: [f32; 3]| Vec3x8::splat(v[0], v[1], v[2]);
    let (axis, radius, weight) = (rows(&node.axis), F32x8::new(node.radius), F32x8::new(node.weight));
    let d = rows(&node.middle) - splat(p);
    let (square, radius_square) = (d.dot(d), radius * radius);
    let inside = square.le(radius_square);
    // sqrt(1 - x^2 / d^2) and x / d: roots that depend on the division alone, not on each other; within the ball both are
    // replaced below
    let inv_square = F32x8::ONE / square.max(radius_square).max(F32x8::splat(MIN_SQUARE));
    let inv = inv_square.sqrt();
    let over_distance = |x: F32x8| ((1.0 - x * x * inv_square).safe_sqrt(), x * inv);
    // of the ball
    let (cos_ball, sin_ball) = over_distance(radius);
    let (cos_ball, sin_ball) = (inside.select(-F32x8::ONE, cos_ball), inside.select(F32x8::ZERO, sin_ball));
    // at the lights
    let along = -axis.dot(d);
    let (sin, cos) = over_distance(along);
    let (sin, cos) = subtract(sin, cos, F32x8::new(node.sin), F32x8::new(node.cos));
    let (_, cos) = subtract(sin, cos, sin_ball, cos_ball);
    let at_light = inside.select(F32x8::ONE, cos);
    let seen = along.gt(F32x8::new(node.front)) & at_light.gt(F32x8::ZERO);
    // at the surface, whatever its side
    let (sin, cos) = over_distance(splat(n).dot(d).abs());
    let (_, cos) = subtract(sin, cos, sin_ball, cos_ball);
    let any_side = inside | in_media;
    let at_surface = any_side.select(F32x8::ONE, cos) * (1.0 - SURFACE_FLOOR) + SURFACE_FLOOR;
    let near = weight * at_light * at_surface * inv_square;
    let infinite = !radius.is_finite();
    let importance = infinite.select(weight, seen.zero_unless(near));
    (importance.gt(F32x8::ZERO) & importance.is_finite()).zero_unless(importance)
}

/// Largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A child for each lane.
struct Choice {
    /// Its slot.
    slot: [u32; 8],
    /// Its probability, 0 where no child has importance.
    share: F32x8,
    /// The random number that is left.
    rest: [f64; 8],
}

impl Choice {
    /// The children that the random numbers `u` pick, by the importances of the eight children of every lane's node.
    #[inline(always)]
    fn of(children: [F32x8; 8], u: &[f64; 8]) -> Self {
        let rows = children.map(|c| c.to_array());
        let total: [f64; 8] = core::array::from_fn(|i| total(rows.iter().map(|row| row[i])));
        let at: [f64; 8] = core::array::from_fn(|i| u[i] * total[i]);
        let (mut sum, mut before, mut own, mut slot) = ([0.0; 8], [0.0; 8], [0.0; 8], [0u64; 8]);
        for (k, row) in (0..).zip(&rows) {
            for i in 0..8 {
                let x = f64::from(row[i]);
                // the last child whose interval begins at `at` or before; that of one without importance is empty, so that a
                // later child is taken
                let taken = sum[i] <= at[i];
                (before[i], own[i], slot[i]) = if taken { (sum[i], x, k) } else { (before[i], own[i], slot[i]) };
                sum[i] += x;
            }
        }
        Self {
            slot: slot.map(|k| k as u32),
            share: F32x8::from_fn(|i| if total[i] > 0.0 { share(own[i], total[i]) } else { 0.0 }),
            rest: core::array::from_fn(|i| ((at[i] - before[i]) / own[i]).clamp(0.0, BELOW_ONE)),
        }
    }
}

/// Sum of the importances of a node's children, in their order.
#[inline(always)]
fn total(importances: impl Iterator<Item = f32>) -> f64 {
    importances.fold(0.0, |sum, x| sum + f64::from(x))
}

/// The probability of a child.
#[inline(always)]
fn share(importance: f64, total: f64) -> f32 {
    (importance / total) as f32
}

/// A light per lane of `mask` and its probability; [`NONE`] and 0 where no light has importance. All lanes go down a level
/// together: first the importances of every lane's children, which do not depend on each other, so that the processor works
/// on several while it waits for roots and divisions, then the choices of all lanes at once.
#[inline(never)]
fn select(nodes: &[LightNode], point: Vec3x8, normal: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8) {
    let [points, normals] = [point, normal].map(|v| [v.x.to_array(), v.y.to_array(), v.z.to_array()]);
    let in_media = normal.x.eq(F32x8::ZERO) & normal.y.eq(F32x8::ZERO) & normal.z.eq(F32x8::ZERO);
    // borrowed: to map the rows themselves copies all eight lanes for one
    let of = |rows: &[[f32; 8]; 3], i: usize| rows.each_ref().map(|row| row[i]);
    let mut u = r.to_array().map(|r| f64::from(r) / 4_294_967_296.0);
    let mut node = U32x8::select(mask, U32x8::splat(0), U32x8::splat(NONE)).to_array();
    let mut probability = mask.zero_unless(F32x8::ONE);
    for _ in 0..MAX_LIGHT_DEPTH {
        let left = (U32x8::new(node) & U32x8::splat(LEAF_BIT)).eq(U32x8::splat(0));
        if left.none() {
            break;
        }
        let mut rows = [F32x8::ZERO; 8];
        for i in left.lanes() {
            if let Some(node) = nodes.get(node[i] as usize) {
                rows[i] = importance(node, of(&points, i), of(&normals, i), Mask8::splat(in_media.lane(i)));
            }
        }
        let choice = Choice::of(F32x8::transpose(rows), &u);
        let found = choice.share.gt(F32x8::ZERO);
        for i in left.lanes() {
            let child = nodes.get(node[i] as usize).map_or(NONE, |node| node.child[choice.slot[i] as usize & 7]);
            node[i] = if found.lane(i) { child } else { NONE };
        }
        probability = left.select(probability * choice.share, probability);
        u = choice.rest;
    }
    let node = U32x8::new(node);
    // a tree that is too deep ends in no light
    let none = node.eq(U32x8::splat(NONE)) | (node & U32x8::splat(LEAF_BIT)).eq(U32x8::splat(0));
    (U32x8::select(none, U32x8::splat(NONE), node & U32x8::splat(CHILD_INDEX)), none.select(F32x8::ZERO, probability))
}

/// The probabilities of lights along their trails.
#[inline(never)]
fn probability(scene: &Scene<'_>, point: Vec3x8, normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
    let (light, mut out) = (light.to_array(), [0.0; 8]);
    for i in mask.lanes() {
        let trail = scene.light_trails.get(light[i] as usize).copied().unwrap_or(NONE);
        out[i] = along_trail(scene.light_nodes, point.lane(i), normal.lane(i), trail, light[i]);
    }
    F32x8::new(out)
}

/// Probability of the light at the end of a trail.
#[inline(always)]
fn along_trail(nodes: &[LightNode], p: [f32; 3], n: [f32; 3], trail: u32, light: u32) -> f32 {
    let mut probability = 1.0f32;
    let (mut index, mut rest) = (0, trail);
    for _ in 0..MAX_LIGHT_DEPTH {
        let Some(node) = nodes.get(index as usize).filter(|_| trail != NONE) else { return 0.0 };
        let importance = light_importance(node, p, n);
        let total = total(importance.to_array().into_iter());
        let slot = rest as usize & 7;
        let own = importance.lane(slot);
        if own == 0.0 {
            return 0.0;
        }
        probability *= share(own.into(), total);
        let child = node.child[slot];
        if child & LEAF_BIT != 0 {
            return if child & CHILD_INDEX == light { probability } else { 0.0 };
        }
        (index, rest) = (child, rest >> 3);
    }
    0.0
}

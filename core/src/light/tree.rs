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
//!    they bring. Depth falls to a third, and 10,000 lights take five nodes.
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
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8) -> (U32x8, F32x8) {
        if self.0.light_nodes.is_empty() {
            return PowerSelector(self.0).select(point, normal, r);
        }
        select(self.0.light_nodes, point, normal, r)
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
    let rows = |r: &[[f32; 8]; 3]| {
        let [x, y, z] = r.map(F32x8::new);
        Vec3x8::new(x, y, z)
    };
    let splat = |v: [f32; 3]| Vec3x8::splat(v[0], v[1], v[2]);
    let (axis, radius, weight) = (rows(&node.axis), F32x8::new(node.radius), F32x8::new(node.weight));
    let d = rows(&node.middle) - splat(p);
    let (square, radius_square) = (d.dot(d), radius * radius);
    let inside = square.le(radius_square);
    let distance = square.sqrt();
    // of the ball
    let sin_ball = inside.select(F32x8::ZERO, radius / distance);
    let cos_ball = inside.select(-F32x8::ONE, (1.0 - sin_ball * sin_ball).safe_sqrt());
    // at the lights
    let along = -axis.dot(d);
    let cos = (along / distance).clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).safe_sqrt();
    let (sin, cos) = subtract(sin, cos, F32x8::new(node.sin), F32x8::new(node.cos));
    let (_, cos) = subtract(sin, cos, sin_ball, cos_ball);
    let at_light = inside.select(F32x8::ONE, cos);
    let seen = along.gt(F32x8::new(node.front)) & at_light.gt(F32x8::ZERO);
    // at the surface, whatever its side
    let at_surface = if n == [0.0; 3] {
        F32x8::ONE
    } else {
        let cos = (splat(n).dot(d).abs() / distance).min(F32x8::ONE);
        let sin = (1.0 - cos * cos).safe_sqrt();
        let (_, cos) = subtract(sin, cos, sin_ball, cos_ball);
        inside.select(F32x8::ONE, cos) * (1.0 - SURFACE_FLOOR) + SURFACE_FLOOR
    };
    let near = weight * at_light * at_surface / square.max(radius_square).max(F32x8::splat(MIN_SQUARE));
    let infinite = !radius.is_finite();
    let importance = infinite.select(weight, seen.zero_unless(near));
    (importance.gt(F32x8::ZERO) & importance.is_finite()).zero_unless(importance)
}

/// Largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A light for one point, and its probability.
#[inline(always)]
fn select_one(nodes: &[LightNode], p: [f32; 3], n: [f32; 3], r: u32) -> (u32, f32) {
    let mut u = f64::from(r) / 4_294_967_296.0;
    let mut probability = 1.0f32;
    let mut index = 0;
    for _ in 0..MAX_LIGHT_DEPTH {
        let Some(node) = nodes.get(index as usize) else { break };
        let importance = light_importance(node, p, n);
        let (upto, total) = sums(importance);
        if total == 0.0 {
            break;
        }
        let at = u * total;
        // the first child that reaches beyond, all of which have importance; the last one that has if none does by rounding
        let below = upto.iter().skip(1).filter(|sum| **sum <= at).count();
        let last = importance.gt(F32x8::ZERO).bits().checked_ilog2().unwrap_or(0) as usize;
        let k = below.min(last) & 7;
        let (chosen, before, own) = (node.child[k], upto[k], importance.lane(k));
        probability *= share(own, total);
        if chosen & LEAF_BIT != 0 {
            return (if chosen == NONE { NONE } else { chosen & CHILD_INDEX }, probability);
        }
        u = ((at - before) / f64::from(own)).clamp(0.0, BELOW_ONE);
        index = chosen;
    }
    (NONE, 0.0)
}

/// Sums of the importances before each child, in their order, and of all.
#[inline(always)]
fn sums(importance: F32x8) -> ([f64; 9], f64) {
    let (mut upto, mut total) = ([0.0; 9], 0.0);
    for (sum, x) in upto.iter_mut().skip(1).zip(importance.to_array()) {
        total += f64::from(x);
        *sum = total;
    }
    (upto, total)
}

/// The probability of a child.
#[inline(always)]
fn share(importance: f32, total: f64) -> f32 {
    (f64::from(importance) / total) as f32
}

/// A light per lane and its probability; [`NONE`] and 0 where no light has importance.
#[inline(never)]
fn select(nodes: &[LightNode], point: Vec3x8, normal: Vec3x8, r: U32x8) -> (U32x8, F32x8) {
    let (r, mut light, mut probability) = (r.to_array(), [NONE; 8], [0.0; 8]);
    for i in 0..8 {
        (light[i], probability[i]) = select_one(nodes, point.lane(i), normal.lane(i), r[i]);
    }
    (U32x8::new(light), F32x8::new(probability))
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
        let (_, total) = sums(importance);
        let slot = rest as usize & 7;
        let own = importance.lane(slot);
        if own == 0.0 {
            return 0.0;
        }
        probability *= share(own, total);
        let child = node.child[slot];
        if child & LEAF_BIT != 0 {
            return if child & CHILD_INDEX == light { probability } else { 0.0 };
        }
        (index, rest) = (child, rest >> 3);
    }
    0.0
}

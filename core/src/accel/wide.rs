//! The built-in [`Intersector`]: grouping of rays.
//!
//! Rays are grouped by direction octant and major axis; groups of more than [`FEW`] walk the tree as a packet, which
//! doubles the throughput of coherent rays; the others go one by one, which is best for incoherent ones.

use super::blocking::{Asked, Blocking, Everything};
use super::packet::{FEW, walk_packet};
use super::setup::Setup;
use super::single::{Hits, Keys, STACK, walk};
use super::{Intersector, Occlusion8};
use crate::geometry::{Hit8, Ray8};
use crate::scene::Scene;
use crate::scene::blob::{Leaf, NONE, Node};
use croupier_simd::{F32x8, Mask8, U32x8};

/// Built-in intersector: the scene's own tree of 8-wide nodes and 8-triangle leaves.
///
/// Watertight: no ray passes between triangles that share an edge or a vertex. A hit is the closest by computed t,
/// among equal ones the triangle with the lowest index; which rays share a packet never changes a bit of the result.
/// `tmin` below 0 counts as 0. Calls need about 9 KiB of stack.
#[derive(Clone, Copy, Debug)]
pub struct WideBvh<'s> {
    nodes: &'s [Node],
    leaves: &'s [Leaf],
    /// Largest |coordinate|.
    extent: f32,
}

impl<'s> WideBvh<'s> {
    /// Intersector for the tree of a validated scene.
    pub fn new(scene: &Scene<'s>) -> Self {
        Self::from_parts(scene.nodes, scene.leaves)
    }

    /// Intersector for a tree outside a scene; the root is node 0, the rules of [`crate::scene::blob`] hold. Wrong
    /// indices and boxes give wrong hits and nothing worse, but nodes that form a cycle make traversal endless.
    pub fn from_parts(nodes: &'s [Node], leaves: &'s [Leaf]) -> Self {
        let mut extent = 0.0f32;
        if let Some(root) = nodes.first() {
            for x in root.bounds.as_flattened() {
                let x = x.abs();
                if x > extent && x < f32::INFINITY {
                    extent = x;
                }
            }
        }
        Self { nodes, leaves, extent }
    }

    /// Traces the valid rays of `s`. Closest: improves `hits`. Any: returns the lanes with a hit
    /// that blocks.
    #[inline(always)]
    fn trace<const ANY: bool, B: Blocking>(&self, s: &Setup, hits: &mut Hits, blocking: &mut B) -> u32 {
        let tree = (self.nodes, self.leaves);
        let mut stack: Keys = [0; STACK];
        let (mut left, mut single, mut occluded) = (s.valid, 0, 0);
        while left != 0 {
            let group = s.alike(left.trailing_zeros() as usize & 7, left);
            left &= !group;
            if group.count_ones() <= FEW {
                single |= group;
            } else {
                occluded |= walk_packet::<ANY, B>(tree, s, group, hits, &mut stack, blocking);
            }
        }
        if single != 0 {
            occluded |= walk::<ANY, B>(tree, (0, &s.tmin), (s, single), hits, &mut stack, blocking);
        }
        occluded
    }
}

impl Intersector for WideBvh<'_> {
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let s = Setup::new(rays, active, self.extent);
        let mut hits = Hits::none(s.limit);
        if !self.nodes.is_empty() && s.valid != 0 {
            self.trace::<false, _>(&s, &mut hits, &mut Everything);
        }
        let triangle = U32x8::new(hits.triangle);
        let hit = !triangle.eq(U32x8::splat(NONE));
        Hit8 {
            hit,
            t: hit.select(F32x8::new(hits.t), rays.tmax),
            triangle,
            u: hit.zero_unless(F32x8::new(hits.u)),
            v: hit.zero_unless(F32x8::new(hits.v)),
        }
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        let s = Setup::new(rays, active, self.extent);
        if self.nodes.is_empty() || s.valid == 0 {
            return Mask8::NONE;
        }
        Mask8::from_bits(self.trace::<true, _>(&s, &mut Hits::none(s.limit), &mut Everything))
    }

    fn occluded_by(&self, rays: &Ray8, active: Mask8, blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        let s = Setup::new(rays, active, self.extent);
        let mut asked = Asked { blocks, passed: [0; 8] };
        let mut blocked = 0;
        if !self.nodes.is_empty() && s.valid != 0 {
            blocked = self.trace::<true, _>(&s, &mut Hits::none(s.limit), &mut asked);
        }
        Occlusion8 { blocked: Mask8::from_bits(blocked), passed: U32x8::new(asked.passed) }
    }
}

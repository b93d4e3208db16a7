//! The built-in [`Intersector`].

use super::blocking::{Asked, Blocking, Everything};
use super::grouping::trace;
use super::instances::{Forest, Found};
use super::setup::Setup;
use super::single::{Hits, STACK};
use super::{Intersector, Occlusion8};
use crate::geometry::{Hit8, NO_INSTANCE, Ray8};
use crate::scene::Scene;
use crate::scene::blob::{Instance, Leaf, NONE, Node, Object};
use croupier_simd::{F32x8, Mask8, U32x8};

/// Built-in intersector: the scene's own tree of 8-wide nodes and 8-triangle leaves.
///
/// Watertight: no ray passes between triangles that share an edge or a vertex. A hit is the closest by computed t,
/// among equal ones the triangle with the lowest index; which rays share a packet never changes a bit of the result.
/// `tmin` below 0 counts as 0. Calls need about 9 KiB of stack, with instances 16.
///
/// Instances: each object is watertight, whatever the transforms; among hits at equal t that of the lower instance (the
/// world's, then the one within it) counts, those of no instance last.
#[derive(Clone, Copy, Debug)]
pub struct WideBvh<'s> {
    nodes: &'s [Node],
    leaves: &'s [Leaf],
    /// Largest |coordinate| of a scene without instances.
    extent: f32,
    /// Empty without instances.
    objects: &'s [Object],
    instances: &'s [Instance],
}

impl<'s> WideBvh<'s> {
    /// Intersector for the tree of a validated scene.
    pub fn new(scene: &Scene<'s>) -> Self {
        Self { objects: scene.objects, instances: scene.instances, ..Self::from_parts(scene.nodes, scene.leaves) }
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
        Self { nodes, leaves, extent, objects: &[], instances: &[] }
    }

    /// Searches everything in the world of a scene with instances.
    #[inline(never)]
    fn search<const ANY: bool, B: Blocking>(&self, rays: &Ray8, active: Mask8, blocking: &mut B) -> (Found, u32) {
        let Some(world) = self.objects.first() else { return (Found::none([0.0; 8]), 0) };
        let Self { nodes, leaves, objects, instances, .. } = *self;
        let forest = Forest { nodes, leaves, objects, instances };
        let s = Forest::setup(world, rays, active);
        let (mut found, mut stack) = (Found::none(s.limit), [0; STACK]);
        let occluded = match s.valid {
            0 => 0,
            lanes => forest.walk::<ANY, B>((0, world), (&s, rays, lanes), &mut found, &mut stack, blocking),
        };
        (found, occluded)
    }

    #[inline(never)]
    fn closest_placed(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let (found, _) = self.search::<false, _>(rays, active, &mut Everything);
        hit8(&found.hits, found.instance.map(U32x8::new), rays)
    }
}

/// Hits as packets have them.
#[inline(always)]
fn hit8(hits: &Hits, instance: [U32x8; 2], rays: &Ray8) -> Hit8 {
    let triangle = U32x8::new(hits.triangle);
    let hit = !triangle.eq(U32x8::splat(NONE));
    Hit8 {
        hit,
        t: hit.select(F32x8::new(hits.t), rays.tmax),
        triangle,
        u: hit.zero_unless(F32x8::new(hits.u)),
        v: hit.zero_unless(F32x8::new(hits.v)),
        instance,
    }
}

impl Intersector for WideBvh<'_> {
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        if self.objects.is_empty() { Flat(self).closest(rays, active) } else { self.closest_placed(rays, active) }
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        if self.objects.is_empty() {
            return Flat(self).occluded(rays, active);
        }
        Mask8::from_bits(self.search::<true, _>(rays, active, &mut Everything).1)
    }

    fn occluded_by(&self, rays: &Ray8, active: Mask8, blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        if self.objects.is_empty() {
            return Flat(self).occluded_by(rays, active, blocks);
        }
        let mut asked = Asked { blocks, passed: [0; 8] };
        let (_, blocked) = self.search::<true, _>(rays, active, &mut asked);
        Occlusion8 { blocked: Mask8::from_bits(blocked), passed: U32x8::new(asked.passed) }
    }

    fn flat(&self) -> impl Intersector {
        Flat(self)
    }
}

/// The tree of a scene without instances.
struct Flat<'a, 's>(&'a WideBvh<'s>);

impl Flat<'_, '_> {
    #[inline(always)]
    fn setup(&self, rays: &Ray8, active: Mask8) -> Setup {
        Setup::new(rays, active, F32x8::splat(self.0.extent))
    }

    /// Traces the valid rays of `s`. Closest: improves `hits`. Any: returns the lanes with a hit that blocks.
    #[inline(always)]
    fn trace<const ANY: bool, B: Blocking>(&self, s: &Setup, hits: &mut Hits, blocking: &mut B) -> u32 {
        if self.0.nodes.is_empty() || s.valid == 0 {
            return 0;
        }
        trace::<ANY, B>((self.0.nodes, self.0.leaves), 0, (s, s.valid), hits, &mut [0; STACK], blocking)
    }
}

impl Intersector for Flat<'_, '_> {
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let s = self.setup(rays, active);
        let mut hits = Hits::none(s.limit);
        self.trace::<false, _>(&s, &mut hits, &mut Everything);
        hit8(&hits, NO_INSTANCE, rays)
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        let s = self.setup(rays, active);
        Mask8::from_bits(self.trace::<true, _>(&s, &mut Hits::none(s.limit), &mut Everything))
    }

    fn occluded_by(&self, rays: &Ray8, active: Mask8, blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        let s = self.setup(rays, active);
        let mut asked = Asked { blocks, passed: [0; 8] };
        let blocked = self.trace::<true, _>(&s, &mut Hits::none(s.limit), &mut asked);
        Occlusion8 { blocked: Mask8::from_bits(blocked), passed: U32x8::new(asked.passed) }
    }
}

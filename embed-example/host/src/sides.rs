//! Points that are inside of closed geometry: most rays from there first meet the backs of surfaces.

use crate::description::SceneDescription;
use croupier::Scene;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Ray8, SurfaceHit8};
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};

/// Materials whose backs nobody should see: no light passes them.
pub(crate) fn opaque(scene: &SceneDescription) -> Vec<bool> {
    scene.materials.iter().map(|m| !m.model.is_transmissive() && !m.cutout).collect()
}

/// Looks along rays for the sides of surfaces that they first meet.
pub(crate) struct Sides<'a, 's> {
    scene: &'a Scene<'s>,
    tree: WideBvh<'s>,
    /// Materials of the scene whose backs count.
    opaque: &'a [bool],
}

impl<'a, 's> Sides<'a, 's> {
    /// `opaque` tells, by material index, of which surfaces the backs count: nobody should see those.
    pub(crate) fn new(scene: &'a Scene<'s>, opaque: &'a [bool]) -> Self {
        Self { scene, tree: WideBvh::new(scene), opaque }
    }

    /// Lanes whose ray from `o` along the unit vector `d` first meets the back of an opaque surface, when the shutter
    /// opens.
    pub(crate) fn backs(&self, o: Vec3x8, d: Vec3x8, active: Mask8) -> Mask8 {
        let ray = Ray8::unbounded(o, d);
        let hit = self.tree.closest(&ray, active);
        let mut hit = SurfaceHit8::gather(self.scene, &hit);
        let point = hit.place(self.scene, ray.time);
        let opaque = |i: &usize| self.opaque.get(hit.material[*i] as usize).is_some_and(|o| *o);
        let opaque = hit.mask.lanes().filter(opaque).fold(0, |bits, i| bits | 1 << i);
        hit.mask & Mask8::from_bits(opaque) & d.dot(point.ng).gt(F32x8::ZERO)
    }
}

//! What auxiliary values say of the surfaces that camera rays hit first: indices, and motion across the image. Computed
//! only if it is asked for.

use super::shading::moves;
use crate::camera;
use crate::geometry::{Hit8, OwnHits8, SurfaceHit8, place};
use crate::scene::Scene;
use crate::scene::blob::{CameraKind, NONE};
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Surfaces of eight first hits.
pub(crate) struct FirstSurfaces8 {
    /// Material indices, [`NONE`] in other lanes.
    pub material: U32x8,
    /// Indices of objects ([`Scene::object_of`]), [`NONE`] in other lanes.
    pub object: U32x8,
    /// Motion across the image, pixels, see [`Aov::Motion`](crate::film::Aov::Motion).
    pub motion: [F32x8; 2],
}

/// The surfaces that the rays of `lanes` hit, in an image of so many columns and rows.
#[cold]
#[inline(never)]
pub(crate) fn first_surfaces<W: World>(
    world: &W,
    size: [u32; 2],
    (hit, surface, own): (&Hit8, &SurfaceHit8, Option<&OwnHits8>),
    lanes: Mask8,
    with_motion: bool,
) -> FirstSurfaces8 {
    let scene = world.scene();
    let (triangle, instance) = (hit.triangle.to_array(), hit.instance[0].to_array());
    let object = |i: usize| match own.filter(|own| own.lanes.lane(i)) {
        Some(own) => own.surface.object.lane(i),
        None => scene.object_of(triangle[i], instance[i]),
    };
    let of = |index: &dyn Fn(usize) -> u32| U32x8::from_fn(|i| if lanes.lane(i) { index(i) } else { NONE });
    let motion = match with_motion && moves::<W>(scene) {
        true => motion(scene, size, hit, lanes),
        false => [F32x8::ZERO; 2],
    };
    FirstSurfaces8 { material: of(&|i| surface.material[i]), object: of(&object), motion }
}

/// How far the image points of `hit` move between the two times of the shutter, pixels.
fn motion(scene: &Scene<'_>, size: [u32; 2], hit: &Hit8, lanes: Mask8) -> [F32x8; 2] {
    let lanes = lanes.and_not(hit.instance[0].eq(U32x8::splat(NONE)));
    if lanes.none() {
        return [F32x8::ZERO; 2];
    }
    // a point of the object, in its own space: mirrored maps exchange no corners here
    let own = SurfaceHit8::gather(scene, hit).point().p;
    let seen_at = |time: F32x8| {
        let [p, ..]: [Vec3x8; 3] = place(scene, hit.instance, time, [own; 3], lanes).corners;
        camera::image_point(scene.camera, size, p)
    };
    let (([x0, y0], open), ([x1, y1], close)) = (seen_at(F32x8::ZERO), seen_at(F32x8::ONE));
    let seen = lanes & open & close;
    let dx = x1 - x0;
    let across = match CameraKind::from_u32(scene.camera.kind) {
        // the shorter way around
        Some(CameraKind::Panoramic) => dx - (dx / size[0] as f32).round() * size[0] as f32,
        _ => dx,
    };
    [across, y1 - y0].map(|d| seen.zero_unless(d))
}

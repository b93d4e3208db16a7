//! Rays through pixels: perspective (pinhole and thin lens), orthographic and panoramic projection. The formulas of all
//! three are at [`Camera`].
//!
//! A pixel sample is a point (x, y) of the image in pixels, x to the right and y down from the upper left corner; the
//! box filter is a sample uniform in the pixel's square, which the caller chooses. With x and y scaled to [-1, 1] the
//! ray runs through `forward + right x + down y` at distance 1 along the axis.
//!
//! A thin lens (Kolb, Mitchell, Hanrahan, SIGGRAPH 1995, section 2) spreads the origins over a disk of radius
//! `lens_radius` across the axis; all rays of an image point meet in the plane at `focus_distance` along the axis.

use crate::scene::blob::{Camera, CameraKind};
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Eight rays of a perspective camera: origins and unit directions, world space.
///
/// `size` is the image in pixels, (x, y) points of it, `u_lens` uniform in [0, 1)^2 (unused by a pinhole). An image of
/// another shape than the camera's own `size` keeps the vertical field of view: `right` is scaled by the ratio of the
/// two aspects, so pixels stay square if they were.
#[inline(always)]
pub fn generate(camera: &Camera, size: [u32; 2], x: F32x8, y: F32x8, u_lens: [F32x8; 2]) -> (Vec3x8, Vec3x8) {
    let v = |a: [f32; 3]| Vec3x8::splat(a[0], a[1], a[2]);
    let (right, down) = (v(camera.right), v(camera.down));
    let ([sx, sy], stretch) = scaled(camera, size, x, y);
    let sx = sx * stretch;
    // Reaches the plane at distance 1 along the axis.
    let through = v(camera.forward) + right * sx + down * sy;
    let origin = v(camera.origin);
    if camera.lens_radius <= 0.0 {
        return (origin, through.normalize_fast());
    }
    let [a, b] = concentric_disk(u_lens).map(|c| c * camera.lens_radius);
    let offset = right.normalize() * a + down.normalize() * b;
    (origin + offset, (through * camera.focus_distance - offset).normalize_fast())
}

/// Points of the image scaled to [-1, 1], and what `right` is scaled by for an image of another shape than the camera's
/// own: exactly 1 for its own size.
#[inline(always)]
fn scaled(camera: &Camera, size: [u32; 2], x: F32x8, y: F32x8) -> ([F32x8; 2], f32) {
    let [width, height] = size.map(|s| s.max(1) as f32);
    let [own_width, own_height] = camera.size.map(|s| s.max(1) as f32);
    let stretch = (width * own_height) / (height * own_width);
    ([x * 2.0 / F32x8::splat(width) - 1.0, y * 2.0 / F32x8::splat(height) - 1.0], stretch)
}

/// As [`generate`], for a camera of any projection. An orthographic image of another shape keeps its height, a
/// panoramic one always shows the whole sphere.
#[inline(never)]
pub fn project(camera: &Camera, size: [u32; 2], x: F32x8, y: F32x8, u_lens: [F32x8; 2]) -> (Vec3x8, Vec3x8) {
    let v = |a: [f32; 3]| Vec3x8::splat(a[0], a[1], a[2]);
    let (origin, forward, right, down) = (v(camera.origin), v(camera.forward), v(camera.right), v(camera.down));
    let ([sx, sy], stretch) = scaled(camera, size, x, y);
    match CameraKind::from_u32(camera.kind) {
        Some(CameraKind::Orthographic) => (origin + right * (sx * stretch) + down * sy, forward.normalize_fast()),
        Some(CameraKind::Panoramic) => {
            let ((sin, cos), (below, level)) = ((sx * 0.5).sin_cos_2pi(), (sy * 0.25).sin_cos_2pi());
            let through = (forward * cos + right * sin) * level + down * below;
            (origin, through.normalize_fast())
        }
        Some(CameraKind::Perspective) | None => generate(camera, size, x, y, u_lens),
    }
}

/// Points of the image, in pixels, at which the camera sees points of the world, and the lanes that it can see: the inverse
/// of [`project`], of a pinhole if there is a lens. The points may lie outside of the image.
#[inline(never)]
pub fn image_point(camera: &Camera, size: [u32; 2], p: Vec3x8) -> ([F32x8; 2], Mask8) {
    let v = |a: [f32; 3]| Vec3x8::splat(a[0], a[1], a[2]);
    let (forward, right, down) = (v(camera.forward), v(camera.right), v(camera.down));
    let q = p - v(camera.origin);
    // coordinates along the three axes, by Cramer's rule
    let volume = F32x8::ONE / right.cross(down).dot(forward);
    let (x, y, z) = (q.dot(down.cross(forward)), q.dot(forward.cross(right)), q.dot(right.cross(down)));
    let (x, y, z) = (x * volume, y * volume, z * volume);
    let (_, stretch) = scaled(camera, size, F32x8::ZERO, F32x8::ZERO);
    let (sx, sy, seen) = match CameraKind::from_u32(camera.kind) {
        Some(CameraKind::Orthographic) => (x / stretch, y, Mask8::all_lanes()),
        Some(CameraKind::Panoramic) => {
            let level = (x * x + z * z).sqrt();
            (
                x.atan2(z) * core::f32::consts::FRAC_1_PI,
                y.atan2(level) * core::f32::consts::FRAC_2_PI,
                q.length().gt(F32x8::ZERO),
            )
        }
        Some(CameraKind::Perspective) | None => (x / (z * stretch), y / z, z.gt(F32x8::ZERO)),
    };
    let [width, height] = size.map(|s| s.max(1) as f32);
    let at = [(sx + 1.0) * (0.5 * width), (sy + 1.0) * (0.5 * height)];
    (at, seen & at[0].is_finite() & at[1].is_finite())
}

/// Area-preserving map of the unit square to the unit disk (Shirley and Chiu, JGT 2(3) 1997): squares around the centre
/// become circles. The centre maps to the centre; on the diagonals both branches agree.
#[inline(always)]
pub fn concentric_disk(u: [F32x8; 2]) -> [F32x8; 2] {
    let [a, b] = u.map(|c| c * 2.0 - 1.0);
    let wide = a.abs().gt(b.abs());
    let (radius, across) = (wide.select(a, b), wide.select(b, a));
    // 1/8 of a turn per unit of across / radius; 0 / 0 is the centre.
    let turn = radius.eq(F32x8::ZERO).select(F32x8::ZERO, across / radius) * 0.125;
    let turn = wide.select(turn, 0.25 - turn);
    let (sin, cos) = turn.sin_cos_2pi();
    [radius * cos, radius * sin]
}

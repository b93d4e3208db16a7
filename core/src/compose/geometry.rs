//! Vertices and triangles of a blob.

use super::math::{Math, cross, dot, narrow, normalized, sub, wide};

/// Area of a triangle as lights state it: in `f64`, rounded once.
pub fn area<M: Math>(corners: &[[f32; 3]; 3]) -> f32 {
    let [a, b, c] = corners.map(wide);
    let normal = cross(sub(b, a), sub(c, a));
    (0.5 * M::sqrt(dot(normal, normal))) as f32
}

/// Does a triangle have an area that `f32` can hold? One without is hit by no ray and has no normal: it is left out.
pub fn has_area<M: Math>(corners: &[[f32; 3]; 3]) -> bool {
    area::<M>(corners) >= f32::MIN_POSITIVE
}

/// Unit normal of a vertex; zero if it has no direction.
pub fn vertex_normal<M: Math>(normal: [f32; 3]) -> [f32; 3] {
    normalized::<M>(wide(normal)).map_or([0.0; 3], narrow)
}

//! Which way is up, and which side is the front.

use crate::description::SceneDescription;

/// Choice of the axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Guessed from the geometry.
    #[default]
    Auto,
    /// +y, front +z.
    Y,
    /// +z, front -y.
    Z,
}

/// Orthonormal directions of a scene, right x up = front: the front is the side that looks at the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// To the right, seen from the front.
    pub right: [f64; 3],
    /// Up.
    pub up: [f64; 3],
    /// To the viewer.
    pub front: [f64; 3],
}

impl Axes {
    /// +y up.
    pub const Y: Self = Self { right: [1.0, 0.0, 0.0], up: [0.0, 1.0, 0.0], front: [0.0, 0.0, 1.0] };
    /// +z up.
    pub const Z: Self = Self { right: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0], front: [0.0, -1.0, 0.0] };

    /// Coordinates of a vector: right, up, front.
    pub fn coordinates(&self, v: [f64; 3]) -> [f64; 3] {
        [self.right, self.up, self.front].map(|a| dot(a, v))
    }

    /// The vector of coordinates right, up, front.
    pub fn vector(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.right[i] * x + self.up[i] * y + self.front[i] * z)
    }
}

/// Positions of a triangle's corners.
pub(super) fn corners(scene: &SceneDescription, vertices: [u32; 3]) -> Option<[[f64; 3]; 3]> {
    let at = |v: u32| scene.vertices.get(v as usize).map(|v| v.position.map(f64::from));
    let [a, b, c] = vertices.map(at);
    Some([a?, b?, c?])
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

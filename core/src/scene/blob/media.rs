//! Participating media and their density grids.
//!
//! A medium fills the inside of the boundaries that refer to it ([`Material::medium`](super::Material::medium)), front
//! sides outwards. Where several overlap, the first record wins: a path carries the set of media that it is inside of,
//! and the lowest index in it is the medium that it meets. A boundary inside a medium of lower index is passed as if it
//! were not there, though it emits if it is a light. Boundaries of one and the same medium must not overlap each other.

use bytemuck::{Pod, Zeroable};

/// Most media of a scene: a path vertex keeps its set of media and its depth in one word.
pub const MAX_MEDIA: usize = 24;
/// Largest coefficient of a medium, and largest density of a grid.
pub const MAX_COEFFICIENT: f32 = 1e18;
/// Largest majorant: room for [`MAJORANT_MARGIN`] times the largest density. Its product with the sum of two largest
/// coefficients is 4e36, so extinction stays finite in `f32`.
pub const MAX_MAJORANT: f32 = 2.0 * MAX_COEFFICIENT;
/// Mean cosines of phase functions, as magnitudes.
pub const MAX_ANISOTROPY: f32 = 0.99;
/// Edge of a brick of the majorant grid, in cells.
pub const BRICK: u32 = 4;
/// Factor on majorants that covers the rounding of the interpolation (NUMERICS MED-5).
pub const MAJORANT_MARGIN: f32 = 1.0 + 1.0 / 1_048_576.0;

kinds! {
    /// How the density of a medium varies.
    MediumKind {
        /// Density 1 everywhere.
        Homogeneous = 0, "homogeneous";
        /// Density from a grid; 0 outside its box.
        Grid = 1, "grid";
    }
}

/// One medium. Coefficients are per unit length at density 1, linear Rec. 709. A medium of zeros is clear.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Medium {
    /// [`MediumKind`].
    pub kind: u32,
    /// Absorption coefficient.
    pub sigma_a: [f32; 3],
    /// Scattering coefficient.
    pub sigma_s: [f32; 3],
    /// Emitted radiance: the source per unit length is `sigma_a * emission * density`.
    pub emission: [f32; 3],
    /// Mean cosine of the Henyey-Greenstein phase function, positive forwards.
    pub g: f32,
    /// Smallest corner of the grid's box, world space.
    pub bounds_min: [f32; 3],
    /// Largest corner.
    pub bounds_max: [f32; 3],
    /// Cells along x, y, z; densities are those of cell centres, trilinear between them, clamped towards the box.
    pub cells: [u32; 3],
    /// First of the grid's values in the section of densities; cell (x, y, z) is value `(z * ny + y) * nx + x`.
    pub first_density: u32,
    /// First of the grid's values in the section of majorants: one per brick of [`BRICK`]^3 cells, in the same order,
    /// at least [`MAJORANT_MARGIN`] times every density within the brick and one cell around it.
    pub first_majorant: u32,
    /// Zero.
    pub reserved: [u32; 2],
}

impl Medium {
    /// Bricks along x, y, z.
    pub fn bricks(&self) -> [u32; 3] {
        self.cells.map(|n| n.div_ceil(BRICK))
    }
}

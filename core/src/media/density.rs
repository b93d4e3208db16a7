//! Densities of grid media: trilinear between cell centres.
//!
//! Cell i of n has its centre at (i + 1/2) / n of the box; between the outermost centres and the box the density is that
//! of the border cells, outside it is 0. A blend of two values is `a (1 - f) + b f`, so that it exceeds the larger one by
//! roundings only, three times over: less than [`MAJORANT_MARGIN`](crate::scene::blob::MAJORANT_MARGIN).

use crate::scene::Scene;
use crate::scene::blob::Medium;
use bytemuck::Zeroable;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// The grids of eight lanes. Positions inside are in cells from the smallest corner of the box.
#[derive(Clone, Copy, Debug)]
pub struct Grids8 {
    /// Smallest corners, world space.
    pub min: Vec3x8,
    /// Largest corners.
    pub max: Vec3x8,
    /// Cells per unit length.
    pub scale: Vec3x8,
    /// Cells along the axes.
    pub size: Vec3x8,
    /// The same as integers, `[axis][lane]`.
    pub cells: [[u32; 8]; 3],
    /// First density of each lane's grid.
    pub first_density: [u32; 8],
    /// First majorant.
    pub first_majorant: [u32; 8],
}

impl Grids8 {
    /// Grids of the media of the lanes in `active`, which must have one; others get one without cells.
    #[inline(always)]
    pub fn gather(scene: &Scene<'_>, medium: U32x8, active: Mask8) -> Self {
        let nothing = Medium::zeroed();
        let (index, bits) = (medium.to_array(), active.bits());
        let of = |i: usize| {
            let m = if bits >> i & 1 == 1 { scene.media.get(index[i] as usize) } else { None };
            m.unwrap_or(&nothing)
        };
        let media = [of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)];
        let (min, max) = (Vec3x8::from_fn(|i| media[i & 7].bounds_min), Vec3x8::from_fn(|i| media[i & 7].bounds_max));
        let size = Vec3x8::from_fn(|i| media[i & 7].cells.map(|n| n as f32));
        let extent = max - min;
        let scale = Vec3x8::new(size.x / extent.x, size.y / extent.y, size.z / extent.z);
        Self {
            min,
            max,
            scale,
            size,
            cells: core::array::from_fn(|a| core::array::from_fn(|i| media[i & 7].cells[a])),
            first_density: core::array::from_fn(|i| media[i & 7].first_density),
            first_majorant: core::array::from_fn(|i| media[i & 7].first_majorant),
        }
    }

    /// Density at positions in cells; those outside are taken to the border.
    #[inline(always)]
    pub fn at(&self, scene: &Scene<'_>, x: Vec3x8, active: Mask8) -> F32x8 {
        let axis = |x: F32x8, size: F32x8| {
            // a NaN becomes 0
            let x = F32x8::ZERO.max(x - 0.5).min(size - 1.0);
            let lower = x.floor();
            (lower.to_i32().to_u32().to_array(), x - lower)
        };
        let (i, fx) = axis(x.x, self.size.x);
        let (j, fy) = axis(x.y, self.size.y);
        let (k, fz) = axis(x.z, self.size.z);
        let mut corner = [[0.0f32; 8]; 8];
        for l in active.lanes() {
            let [nx, ny, nz] = [self.cells[0][l], self.cells[1][l], self.cells[2][l]];
            // distance to the next cell along each axis, 0 from the last one
            let next = |i: u32, n: u32, stride: u32| if i.wrapping_add(1) < n { stride } else { 0 };
            let row = nx.wrapping_mul(ny);
            let first = self.first_density[l]
                .wrapping_add(k[l].wrapping_mul(row))
                .wrapping_add(j[l].wrapping_mul(nx))
                .wrapping_add(i[l]);
            let (dx, dy, dz) = (next(i[l], nx, 1), next(j[l], ny, nx), next(k[l], nz, row));
            let value = |at: u32| scene.densities.get(at as usize).copied().unwrap_or(0.0);
            for (c, out) in corner.iter_mut().enumerate() {
                let step = |bit: usize, d: u32| if c >> bit & 1 == 1 { d } else { 0 };
                let at = first.wrapping_add(step(0, dx)).wrapping_add(step(1, dy)).wrapping_add(step(2, dz));
                out[l] = value(at);
            }
        }
        let v = corner.map(F32x8::new);
        let blend = |a: F32x8, b: F32x8, f: F32x8| a * (1.0 - f) + b * f;
        let along_x = |c: usize| blend(v[c & 7], v[(c + 1) & 7], fx);
        let along_y = |c: usize| blend(along_x(c), along_x(c + 2), fy);
        blend(along_y(0), along_y(4), fz)
    }
}

/// Density of the grids of the media `medium` at world points; 0 outside their boxes and outside `active`.
pub fn density(scene: &Scene<'_>, medium: U32x8, p: Vec3x8, active: Mask8) -> F32x8 {
    let grids = Grids8::gather(scene, medium, active);
    let within = |p: F32x8, lo: F32x8, hi: F32x8| p.ge(lo) & p.le(hi);
    let inside = within(p.x, grids.min.x, grids.max.x)
        & within(p.y, grids.min.y, grids.max.y)
        & within(p.z, grids.min.z, grids.max.z)
        & active;
    inside.zero_unless(grids.at(scene, (p - grids.min) * grids.scale, inside))
}

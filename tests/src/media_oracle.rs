//! Media for tests: scenes of media alone, put together without baking, and their f64 oracles, written from the formulas
//! without looking at the vector code.

use crate::records::none;
use bytemuck::Zeroable;
use croupier::Scene;
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Effects, Records};
use std::f64::consts::PI;

/// A vector or colour.
pub type V = [f64; 3];

/// Owns what a [`Scene`] borrows.
#[derive(Debug)]
pub struct MediaScene {
    info: SceneInfo,
    camera: Camera,
    /// Media.
    pub media: Vec<Medium>,
    /// Densities of all grids.
    pub densities: Vec<f32>,
    /// Majorants of all grids.
    pub majorants: Vec<f32>,
}

impl Default for MediaScene {
    fn default() -> Self {
        Self {
            info: SceneInfo::zeroed(),
            camera: Camera::zeroed(),
            media: vec![],
            densities: vec![],
            majorants: vec![],
        }
    }
}

/// A homogeneous medium.
pub fn homogeneous(sigma_a: [f32; 3], sigma_s: [f32; 3], emission: [f32; 3]) -> Medium {
    Medium { kind: MediumKind::Homogeneous as u32, sigma_a, sigma_s, emission, ..Medium::zeroed() }
}

impl MediaScene {
    /// Adds a medium.
    pub fn with(mut self, medium: Medium) -> Self {
        self.media.push(medium);
        self
    }

    /// Adds a medium with a density of `cells`, in the order of the blob, in the box; its majorants are exactly those
    /// that the blob asks for at least.
    pub fn with_grid(mut self, medium: Medium, bounds: [[f32; 3]; 2], cells: [u32; 3], densities: &[f32]) -> Self {
        assert_eq!(densities.len() as u32, cells.iter().product::<u32>());
        let medium = Medium {
            kind: MediumKind::Grid as u32,
            bounds_min: bounds[0],
            bounds_max: bounds[1],
            cells,
            first_density: self.densities.len() as u32,
            first_majorant: self.majorants.len() as u32,
            ..medium
        };
        let [bx, by, bz] = medium.bricks();
        let around = |b: u32, n: u32| (b * BRICK).saturating_sub(1)..=((b + 1) * BRICK).min(n - 1);
        for z in 0..bz {
            for y in 0..by {
                for x in 0..bx {
                    let mut largest = 0.0f32;
                    for k in around(z, cells[2]) {
                        for j in around(y, cells[1]) {
                            for i in around(x, cells[0]) {
                                largest = largest.max(densities[((k * cells[1] + j) * cells[0] + i) as usize]);
                            }
                        }
                    }
                    self.majorants.push(largest * MAJORANT_MARGIN);
                }
            }
        }
        self.densities.extend_from_slice(densities);
        self.media.push(medium);
        self
    }

    /// The scene. Nothing validates it: tests may hand over nonsense.
    pub fn scene(&self) -> Scene<'_> {
        Scene::assume_valid(Records {
            media: &self.media,
            densities: &self.densities,
            majorants: &self.majorants,
            effects: Effects::MEDIA.with(Effects::GRID_MEDIA),
            ..none(&self.info, &self.camera)
        })
    }

    /// Density of medium `m` at a point: a sum over all cells of their values times hat functions around their centres,
    /// the point held to the box of the centres; 0 outside the grid's box.
    pub fn density(&self, m: usize, p: V) -> f64 {
        let medium = &self.media[m];
        let mut hats: [Vec<(usize, f64)>; 3] = Default::default();
        for a in 0..3 {
            let (lo, hi) = (f64::from(medium.bounds_min[a]), f64::from(medium.bounds_max[a]));
            if p[a] < lo || p[a] > hi {
                return 0.0;
            }
            let n = f64::from(medium.cells[a]);
            let x = ((p[a] - lo) / (hi - lo) * n).clamp(0.5, n - 0.5);
            let weight = |i: usize| (1.0 - (x - (i as f64 + 0.5)).abs()).max(0.0);
            hats[a] = (0..medium.cells[a] as usize).map(|i| (i, weight(i))).filter(|h| h.1 > 0.0).collect();
        }
        let [nx, ny, _] = medium.cells.map(|n| n as usize);
        let mut sum = 0.0;
        for &(k, wz) in &hats[2] {
            for &(j, wy) in &hats[1] {
                for &(i, wx) in &hats[0] {
                    let value = self.densities[medium.first_density as usize + (k * ny + j) * nx + i];
                    sum += f64::from(value) * wx * wy * wz;
                }
            }
        }
        sum
    }

    /// Integral of the density of medium `m` along `o + t d` for t in `a..b`, in lengths of the world: midpoint rule with
    /// `n` points.
    pub fn thickness(&self, m: usize, o: V, d: V, [a, b]: [f64; 2], n: usize) -> f64 {
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        let at = |t: f64| self.density(m, std::array::from_fn(|i| o[i] + t * d[i]));
        crate::quadrature::midpoint(n, a, b, at) * length
    }
}

/// Henyey-Greenstein density of a cosine, 1/sr.
pub fn henyey_greenstein(g: f64, cos: f64) -> f64 {
    // 1 + g^2 - 2 g cos, grouped so that it is 0 only at the peak of |g| = 1
    let d = (1.0 - g.abs()).powi(2) + 2.0 * g.abs() * (1.0 - cos * g.signum());
    (1.0 - g * g) / (4.0 * PI * d.powf(1.5))
}

/// P(cosine <= `cos`) of Henyey-Greenstein.
pub fn henyey_greenstein_cdf(g: f64, cos: f64) -> f64 {
    if g.abs() < 1e-5 {
        // the next term is of order g^2
        return (1.0 + cos) / 2.0 - g * (1.0 - cos * cos) * 0.75;
    }
    (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 + g * g - 2.0 * g * cos).sqrt() - 1.0 / (1.0 + g))
}

//! Cells of directions around points as camera samples of the core.

use croupier::Scene;
use croupier::unstable::bsdf::NoBsdf;
use croupier::unstable::extension::{Extension, PixelSamples8, SourceRays8};
use croupier::unstable::rng::Key8;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use std::sync::atomic::{AtomicU32, Ordering};

/// Part of the keys of directions: they have nothing to do with the numbers of the core.
pub(super) const SEED: u64 = 0x7072_6f62_6573;

/// Unit directions, uniform over the sphere for uniform numbers: z, and the angle about it.
pub(super) fn directions([u, v]: [F32x8; 2]) -> Vec3x8 {
    let z = 1.0 - v * 2.0;
    let r = (1.0 - z * z).safe_sqrt();
    let (sin, cos) = u.sin_cos_2pi();
    Vec3x8::new(r * cos, r * sin, z)
}

/// Probes in a row.
fn columns(probes: usize) -> u32 {
    (probes as f64).sqrt().ceil().max(1.0) as u32
}

/// Columns and rows of the picture of so many probes with so many cells in a row.
pub(super) fn size(probes: usize, side: u32) -> [u32; 2] {
    let columns = columns(probes);
    [columns, (probes as u32).div_ceil(columns)].map(|n| n.saturating_mul(side))
}

/// Rays from probes: a square of cells for each, in rows of probes.
pub(super) struct ProbeSource<'a> {
    positions: &'a [[f32; 3]],
    /// Columns and rows of cells of a probe.
    side: u32,
    /// Probes in a row.
    columns: u32,
    seed: u64,
    /// The iteration that runs: it has one direction in each cell.
    iteration: AtomicU32,
}

impl<'a> ProbeSource<'a> {
    pub(super) fn new(positions: &'a [[f32; 3]], side: u32, seed: u64) -> Self {
        Self { positions, side, columns: columns(positions.len()), seed: seed ^ SEED, iteration: AtomicU32::new(0) }
    }

    /// Columns and rows of the picture.
    pub(super) fn size(&self) -> [u32; 2] {
        size(self.positions.len(), self.side)
    }

    pub(super) fn pixels(&self) -> usize {
        self.size().map(|n| n as usize).into_iter().product()
    }

    /// Sets the iteration. None may be running.
    pub(super) fn begin(&self, iteration: u32) {
        self.iteration.store(iteration, Ordering::Relaxed);
    }

    /// Probe of a pixel; unused ones have none.
    fn probe(&self, column: u32, row: u32) -> Option<usize> {
        let probe = (row / self.side * self.columns + column / self.side) as usize;
        (probe < self.positions.len()).then_some(probe)
    }

    /// Directions of eight pixels in this iteration.
    fn directions(&self, column: U32x8, row: U32x8) -> Vec3x8 {
        let side = self.side;
        let pixel = U32x8::from_fn(|i| row.lane(i) * self.columns * side + column.lane(i));
        let iteration = U32x8::splat(self.iteration.load(Ordering::Relaxed));
        let [u, v, ..] = Key8::camera(self.seed, pixel, iteration).uniforms(0);
        let within = |at: U32x8, u: F32x8| (F32x8::from_fn(|i| (at.lane(i) % side) as f32) + u) * (1.0 / side as f32);
        directions([within(column, u), within(row, v)])
    }

    /// Probe and direction of a pixel's sample in this iteration.
    pub(super) fn of_pixel(&self, pixel: u32) -> Option<(usize, [f64; 3])> {
        let width = self.columns * self.side;
        let (column, row) = (pixel % width, pixel / width);
        let probe = self.probe(column, row)?;
        let d = self.directions(U32x8::splat(column), U32x8::splat(row)).lane(0).map(f64::from);
        Some((probe, d))
    }
}

impl Extension for &ProbeSource<'_> {
    type Bsdf = NoBsdf;
    const RAYS: bool = true;

    fn rays(&self, _: &Scene<'_>, s: &PixelSamples8) -> SourceRays8 {
        let mut origin = [[0.0; 3]; 8];
        let mut found = 0;
        for i in s.active.lanes() {
            if let Some(probe) = self.probe(s.column.lane(i), s.row.lane(i)) {
                origin[i] = self.positions[probe];
                found |= 1 << i;
            }
        }
        SourceRays8 {
            origin: Vec3x8::from_fn(|i| origin[i]),
            direction: self.directions(s.column, s.row),
            weight: Vec3x8::ONE,
            active: s.active & Mask8::from_bits(found),
        }
    }
}

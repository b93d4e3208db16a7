//! Counts of work, lane utilisation and every event in which a bound was reached.

use crate::cost::{COST_BOUNCE, COST_CAMERA, COST_SHADOW, COST_STRAIGHT, MEDIUM_STEPS_PER_RAY};
use bytemuck::{Pod, Zeroable};

/// Lane utilisation of a stage: lanes used of lanes offered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Utilisation {
    /// Number of packets run.
    pub packets: u64,
    /// Number of active lanes in them.
    pub lanes: u64,
}

impl Utilisation {
    /// Active share of all lanes, in [0, 1]; 1 when nothing ran.
    pub fn share(&self) -> f64 {
        if self.packets == 0 { 1.0 } else { self.lanes as f64 / (self.packets * 8) as f64 }
    }

    #[inline(always)]
    pub(crate) fn count(&mut self, lanes: u32) {
        self.packets += 1;
        self.lanes += u64::from(lanes);
    }

    fn merge(&mut self, o: &Self) {
        self.packets += o.packets;
        self.lanes += o.lanes;
    }
}

/// Counts of one shard or of a whole render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Counters {
    /// Closest-hit rays from the camera.
    pub camera_rays: u64,
    /// Closest-hit rays from scattering.
    pub scatter_rays: u64,
    /// Closest-hit rays that went on straight behind what a ray had passed or the point at which it had stopped.
    pub straight_rays: u64,
    /// Steps through media: tentative collisions and bricks of density grids, of rays of all kinds.
    pub medium_steps: u64,
    /// Shadow rays traced, counted again behind every surface that they passed.
    pub shadow_rays: u64,
    /// Camera samples finished.
    pub camera_samples: u64,
    /// Samples of vertices (scatter lanes).
    pub vertex_samples: u64,
    /// Vertices at which roulette ended the path.
    pub paths_terminated: u64,
    /// Samples of vertices that splitting added.
    pub splits: u64,
    /// Lanes whose splitting factor was limited to 1 because the ring was nearly full.
    pub splits_limited_by_ring: u64,
    /// Lanes whose splitting factor was limited to 1 because their camera sample had used up its split budget.
    pub splits_limited_by_budget: u64,
    /// Shadow rays terminated by roulette before they were traced.
    pub shadow_rays_terminated: u64,
    /// Light samples skipped: samples of vertices for which roulette left out next event estimation.
    pub light_samples_skipped: u64,
    /// Sum of the segments of all paths, shared ones counted for each.
    pub path_segments: u64,
    /// Samples that were offered to the statistics, the refused ones included.
    pub samples_logged: u64,
    /// Samples that were not learned from because their bin had enough of this iteration
    /// ([`crate::learn::cache::BIN_LIMIT`]), or because a number overflowed. If there are many, the statistics
    /// represent mainly the first tiles of each shard.
    pub samples_refused: u64,
    /// Shadow rays whose visibility was not learned from because their bin had enough of this
    /// iteration ([`crate::learn::cache::BIN_LIMIT`]).
    pub shadows_refused: u64,
    /// Samples without a ledger record because the slab was full: they, and those they are part of, were not learned
    /// from.
    pub ledger_full: u64,
    /// Vertices whose factor was not a finite number and became 1.
    pub factors_not_finite: u64,
    /// Hits at which a path ended because of the longest path length ([`crate::unstable::MAX_PATH_LENGTH`]) before its
    /// `max_depth`.
    pub max_length_reached: u64,
    /// Light samples so near to a point light that the distance was clamped to a larger one (NUMERICS SOL-5).
    pub distances_clamped: u64,
    /// Rays whose steps through a medium were so many that roulette decided whether they go on, and shadow rays that were
    /// cut after 4096 steps in spite of it.
    pub media_roulettes: u64,
    /// Shadow rays that were taken for blocked behind more surfaces than [`crate::unstable::MAX_PASSED`]: light that is
    /// lost.
    pub passages_cut: u64,
    /// Contributions or weights that were not finite and were not added.
    pub non_finite: u64,
    /// Film index of the pixel of the first of them, plus 1; 0 if there is none.
    pub first_non_finite: u64,
    /// Lane utilisation of the scatter stage.
    pub scatter: Utilisation,
    /// Lane utilisation of the closest-hit stage.
    pub trace: Utilisation,
    /// Lane utilisation of the shadow-ray stage.
    pub occlude: Utilisation,
    /// Lane utilisation of the shading stage (hits only).
    pub surface: Utilisation,
    /// Lane utilisation of look-ups in learned statistics.
    pub look_ups: Utilisation,
    /// Rays that passed surfaces straight on, by packets in which any did.
    pub passed: Utilisation,
    /// Largest number of vertices that waited at once.
    pub ring_peak: u64,
    /// Closest-hit rays of light paths, which path guiding learns from at first, and as many steps through media as cost
    /// the same. No part of [`Self::cost`]: camera samples do not take them.
    pub light_path_rays: u64,
}

impl Counters {
    /// Number of rays of all kinds.
    pub fn rays(&self) -> u64 {
        self.camera_rays + self.scatter_rays + self.straight_rays + self.light_path_rays + self.shadow_rays
    }

    /// Work in units of a ray: rays, and the steps through media ([`MEDIUM_STEPS_PER_RAY`] count as one).
    pub fn work(&self) -> u64 {
        self.rays() + self.medium_steps / MEDIUM_STEPS_PER_RAY
    }

    /// Counted cost, by which efficiency is computed: rays, each times its relative cost ([`crate::cost::COST_SHADOW`]
    /// and the like).
    pub fn cost(&self) -> f64 {
        let parts = [
            (self.camera_rays, COST_CAMERA),
            (self.scatter_rays, COST_BOUNCE),
            (self.straight_rays, COST_STRAIGHT),
            (self.shadow_rays, COST_SHADOW),
        ];
        let rays: f64 = parts.iter().map(|&(rays, cost)| rays as f64 * f64::from(cost)).sum();
        rays + self.medium_steps as f64 / MEDIUM_STEPS_PER_RAY as f64
    }

    /// Number of paths: camera samples and samples that splitting added.
    pub fn paths(&self) -> u64 {
        self.camera_samples + self.splits
    }

    /// Is there room for as many counts again in each of them, many times over?
    pub(crate) fn have_room(&self) -> bool {
        bytemuck::cast_slice::<_, u64>(core::slice::from_ref(self)).iter().all(|n| *n < 1 << 58)
    }

    /// Adds another shard's counts.
    pub fn merge(&mut self, o: &Self) {
        self.camera_rays += o.camera_rays;
        self.scatter_rays += o.scatter_rays;
        self.straight_rays += o.straight_rays;
        self.light_path_rays += o.light_path_rays;
        self.medium_steps += o.medium_steps;
        self.shadow_rays += o.shadow_rays;
        self.camera_samples += o.camera_samples;
        self.vertex_samples += o.vertex_samples;
        self.paths_terminated += o.paths_terminated;
        self.splits += o.splits;
        self.splits_limited_by_ring += o.splits_limited_by_ring;
        self.splits_limited_by_budget += o.splits_limited_by_budget;
        self.shadow_rays_terminated += o.shadow_rays_terminated;
        self.light_samples_skipped += o.light_samples_skipped;
        self.path_segments += o.path_segments;
        self.samples_logged += o.samples_logged;
        self.samples_refused += o.samples_refused;
        self.shadows_refused += o.shadows_refused;
        self.ledger_full += o.ledger_full;
        self.factors_not_finite += o.factors_not_finite;
        self.max_length_reached += o.max_length_reached;
        self.distances_clamped += o.distances_clamped;
        self.media_roulettes += o.media_roulettes;
        self.passages_cut += o.passages_cut;
        self.non_finite += o.non_finite;
        if self.first_non_finite == 0 {
            self.first_non_finite = o.first_non_finite;
        }
        self.scatter.merge(&o.scatter);
        self.trace.merge(&o.trace);
        self.occlude.merge(&o.occlude);
        self.surface.merge(&o.surface);
        self.look_ups.merge(&o.look_ups);
        self.passed.merge(&o.passed);
        self.ring_peak = self.ring_peak.max(o.ring_peak);
    }
}

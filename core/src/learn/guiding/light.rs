//! The first lesson: what light paths have found, before camera paths have found anything.
//!
//! An arrival of power says where light comes from, so the density of a cell is in proportion to the power in it, which is
//! the same as the contributions that [`super::rebuild`] adds up, but known sooner. Logs keep an arrival's place, not
//! its leaf: octrees are subdivided first, a level at a time, then the arrivals are distributed. In the end the sums of power
//! become sums of contributions, so that camera paths go on from there. Units do not agree: of power it is not known what it
//! contributes. Together the masses of a leaf's cells, and the squares that its share of guided samples is computed from,
//! become what a few contributions of the picture's camera paths would have been, so that the leaf's own soon outweigh them.
#![deny(clippy::unwrap_used, clippy::expect_used)]

use super::fraction::LeafSums;
use super::log::GuideHit;
use super::node::{self, LEVELS, UNIFORM};
use super::shared::{Guide, Rebuild, SeenSums, UNIFORM_PDF};

/// What is learned from: contributions of camera paths.
pub(super) const CAMERA: u32 = 0;
/// Arrivals of light paths, of which leaves are subdivided.
pub(super) const COUNT: u32 = 1;
/// Arrivals of light paths, of which directions are learned.
pub(super) const LIGHT: u32 = 2;

/// Times that leaves are subdivided by arrivals.
pub(super) const SUBDIVISIONS: u32 = 4;
/// Arrivals of a leaf that is subdivided.
pub(super) const SUBDIVIDE_ARRIVALS: f32 = 256.0;
/// With fewer arrivals nothing is learned from them.
const FEWEST: f32 = 64.0;
/// Contributions that the directions of a leaf count for.
const CONTRIBUTIONS: f32 = 256.0;
/// Least share of a density in the sum of both, that of a log's camera paths.
const LEAST_SHARE: f32 = 0.5 / 255.0;
/// Mean of what camera paths contribute, if they have not contributed anything.
const UNKNOWN: f32 = 1e-15;

impl Guide<'_> {
    /// Has it learned nothing?
    pub(crate) fn is_new(&self) -> bool {
        self.scalars.used == 1 && !self.has_learned_from(f32::MIN_POSITIVE)
    }

    /// The arrivals are counted: leaves are subdivided next, unless there are too few.
    pub(super) fn end_count(&mut self) -> bool {
        let enough = self.scalars.rebuild.seen.arrivals >= FEWEST;
        if !enough {
            self.scalars.rebuild.source = CAMERA;
            self.leaves.iter_mut().take(self.tree.leaves() as usize).for_each(|l| *l = LeafSums::EMPTY);
        }
        enough
    }

    /// Adds an entry of a log while light paths are learned from.
    pub(super) fn add_while_light(&mut self, hit: &GuideHit, weight: f32) {
        let r = &mut self.scalars.rebuild;
        let first = r.source == COUNT && r.level == 0;
        let Some(arrival) = hit.arrival() else {
            if first {
                let [square, _] = hit.square_and_pdf();
                r.seen.contributions += weight;
                r.seen.square = (r.seen.square + square * weight).min(f32::MAX);
                r.seen.sum = (r.seen.sum + hit.contribution() * weight).min(f32::MAX);
            }
            return;
        };
        if first {
            r.seen.arrivals += weight;
        }
        let (source, round) = (r.source, r.round as usize);
        let leaf = self.leaf_of_place(arrival.place) as usize;
        let Some(sums) = self.leaves.get_mut(leaf) else { return };
        if source == COUNT {
            sums.hits += weight;
            return;
        }
        let root = self.root_of(leaf);
        if root == UNIFORM {
            return;
        }
        if round + 1 == LEVELS {
            let q = node::find(self.nodes, root, hit.point).density * UNIFORM_PDF;
            // no nearer to the ends than logs keep the shares of camera paths
            let share = (q / (q + arrival.pdf)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
            // as if the guide had sampled them: in proportion to the power
            self.leaves[leaf].add(arrival.power, Some(share), 1.0, weight);
        }
        self.add_to_cell(root, hit.point, arrival.power * weight, round == 0);
    }

    /// Makes the sums of power of a leaf what camera paths go on from.
    pub(super) fn become_prior(&mut self, leaf: usize) {
        let seen = self.scalars.rebuild.seen;
        if let Some(sums) = self.leaves.get_mut(leaf) {
            sums.become_prior(seen.mean(seen.square));
        }
    }

    /// Makes the powers of a leaf's cells, from its node `root` on, contributions.
    pub(super) fn become_contributions(&mut self, root: u16) {
        let seen = self.scalars.rebuild.seen;
        let power = self.mass(root, 0);
        if power > 0.0 && power.is_finite() {
            let by = (seen.mean(seen.sum) * CONTRIBUTIONS / power).min(f32::MAX);
            self.each_node(root, 0, &|s| s.mass.iter_mut().for_each(|m| *m = (*m * by).min(f32::MAX)));
        }
    }
}

impl SeenSums {
    /// A sum over the number of contributions.
    fn mean(&self, sum: f32) -> f32 {
        let mean = sum / self.contributions;
        if mean > 0.0 && mean.is_finite() { mean.max(UNKNOWN) } else { UNKNOWN }
    }
}

impl Rebuild {
    /// Is the source one that there is, and the level one that is reached?
    pub(super) fn has_source(&self) -> bool {
        self.source <= LIGHT && self.level <= SUBDIVISIONS
    }
}

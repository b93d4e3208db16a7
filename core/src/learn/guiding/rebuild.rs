//! From logs to what is sampled, in pieces that can stop anywhere:
//!
//! | pass | over | does |
//! |---|---|---|
//! | discount | nodes, leaves | old sums decay |
//! | replay | the logs of all shards, in order | adds contributions to leaves and cells |
//! | freeze | leaves | cells become nodes, or nodes cells again; densities |
//! | subdivide | nodes of the octrees | leaves of many contributions |
//! | grid | cells of the octrees' tables | tables of the first levels |
//!
//! Replay and freeze come three times, once for each level: what was made in one round learns from the same logs in the
//! next.
//!
//! A guide that has learned nothing learns from light paths in the logs, if there are any (`light.rs`): replay, subdivide and
//! grid once for each level of the octrees, then replay and freeze as above. The rest of those logs only tells units then.
#![deny(clippy::unwrap_used, clippy::expect_used)]

use super::fraction::LeafSums;
use super::light::{CAMERA, COUNT, LIGHT, SUBDIVIDE_ARRIVALS, SUBDIVISIONS};
use super::log::{GuideHit, GuideLog};
use super::node::{CELLS, GuideNode, LEVELS, NodeSums, UNIFORM, cell_at};
use super::shared::{FrozenLeaf, Guide, GuideScalars, ROOTS, Rebuild};
use crate::learn::cache::tree::{OctreeNode, group_nodes};

/// A cell with a larger part of its leaf's mass becomes a node.
const GROW: f32 = 0.04;
/// A node with a smaller part becomes a cell again.
const SHRINK: f32 = 0.01;
/// Contributions of a cell that becomes a node.
const GROW_HITS: u16 = 32;
/// Contributions of a leaf that is subdivided.
const SUBDIVIDE_HITS: f32 = 4096.0;
/// Part of the samples that is spread evenly over the cells of a root, whatever was learned.
const EVEN: f32 = 0.05;

/// Cells of the octrees' tables that are filled at once.
const GRID_AT_ONCE: usize = 64;

const REPLAY: u32 = 1;
const DISCOUNT_NODES: u32 = 2;
const DISCOUNT_LEAVES: u32 = 3;
const FREEZE: u32 = 4;
const SUBDIVIDE: u32 = 5;
const GRID: u32 = 6;

impl Guide<'_> {
    /// Learns from the logs of all shards of an iteration, in their order; old sums are multiplied by `keep`, 0 to 1.
    pub fn learn<'a, 'b: 'a>(&mut self, keep: f32, logs: impl Iterator<Item = &'a GuideLog<'b>> + Clone) {
        self.begin_learning(keep);
        loop {
            if self.wants_logs() {
                logs.clone().for_each(|log| {
                    let _ = self.replay(log, 0, usize::MAX, 1.0);
                });
                self.end_replay();
            }
            if self.learn_some().1 {
                return;
            }
        }
    }

    /// Begins to learn from an iteration.
    pub(crate) fn begin_learning(&mut self, keep: f32) {
        let keep = if keep >= 0.0 { keep.min(1.0) } else { 0.0 };
        let (pass, source) = if self.is_new() { (REPLAY, COUNT) } else { (DISCOUNT_NODES, CAMERA) };
        self.scalars.rebuild = Rebuild { pass, keep, source, ..Rebuild::default() };
    }

    /// Are logs to be replayed next?
    pub(crate) fn wants_logs(&self) -> bool {
        self.scalars.rebuild.pass == REPLAY
    }

    /// Are the logs replayed for the first time, to learn directions?
    pub(crate) fn is_first_replay(&self) -> bool {
        self.scalars.rebuild.round == 0 && self.scalars.rebuild.source != COUNT
    }

    /// Replays a log from entry `at` on, `limit` at most; their number, and `true` after the last. The part `guided` of its
    /// samples was guided.
    pub(crate) fn replay(&mut self, log: &GuideLog<'_>, at: usize, limit: usize, guided: f32) -> (usize, bool) {
        let hits = log.hits();
        let end = at.saturating_add(limit).min(hits.len());
        let weight = log.weight();
        let some = hits.get(at..end).unwrap_or(&[]);
        let first = self.is_first_replay().then_some(guided);
        for hit in some {
            self.add(hit, weight, first);
        }
        let done = end >= hits.len();
        if done && first.is_some() {
            self.scalars.thinned = self.scalars.thinned.saturating_add(log.thinned().into());
        }
        (some.len(), done)
    }

    /// All logs were replayed.
    pub(crate) fn end_replay(&mut self) {
        let pass = if self.scalars.rebuild.source != COUNT {
            FREEZE
        } else if self.end_count() {
            SUBDIVIDE
        } else {
            // too few arrivals: the camera paths of the same logs
            REPLAY
        };
        let r = &mut self.scalars.rebuild;
        (r.pass, r.index) = (pass, 0);
    }

    /// Goes on where no logs are wanted; work done, in units of about a ray, and `true` when there is no more.
    pub(crate) fn learn_some(&mut self) -> (u64, bool) {
        let mut r = self.scalars.rebuild;
        let index = r.index as usize;
        r.index = r.index.saturating_add(1);
        let next = |pass: u32| Rebuild { pass, index: 0, ..r };
        let mut work = 1;
        match r.pass {
            DISCOUNT_NODES => match self.sums.get_mut(index).filter(|_| index < self.scalars.used as usize) {
                Some(node) => node.scale(r.keep),
                None => r = next(DISCOUNT_LEAVES),
            },
            DISCOUNT_LEAVES => match self.leaves.get_mut(index).filter(|_| index < self.tree.leaves() as usize) {
                Some(leaf) if r.source != CAMERA => *leaf = LeafSums::EMPTY,
                Some(leaf) => leaf.discount(r.keep),
                None => r = next(REPLAY),
            },
            FREEZE => {
                if index < self.tree.leaves() as usize {
                    work = self.freeze_leaf(index, r.round + 1 < LEVELS as u32);
                } else if r.round + 1 < LEVELS as u32 {
                    r = Rebuild { round: r.round + 1, ..next(REPLAY) };
                } else if r.source == LIGHT {
                    r = Rebuild::default();
                } else {
                    r = next(SUBDIVIDE);
                }
            }
            SUBDIVIDE => {
                // behind the roots lie unused words
                let node = if r.index <= ROOTS { index as u32 } else { group_nodes(0).start + index as u32 - ROOTS };
                if node < self.tree.end() {
                    let nodes = |s: &GuideScalars| s.used - s.free_nodes;
                    let before = nodes(&self.scalars);
                    let done = self.subdivide(node);
                    // a copied node is read twice and written
                    work = if done { 8 + 4 * u64::from(nodes(&self.scalars).saturating_sub(before)) } else { 1 };
                } else {
                    r = next(GRID);
                }
            }
            GRID => {
                work = 10;
                match self.tree.refresh(index * GRID_AT_ONCE, GRID_AT_ONCE) {
                    Some(_) => {}
                    None if r.source == COUNT => {
                        r = Rebuild { level: r.level.saturating_add(1), ..next(DISCOUNT_LEAVES) };
                        r.source = if r.level < SUBDIVISIONS { COUNT } else { LIGHT };
                    }
                    None => r = Rebuild::default(),
                }
            }
            // logs are to be replayed, or there is nothing to do
            _ => {
                let done = r.pass != REPLAY;
                return (1, done);
            }
        }
        self.scalars.rebuild = r;
        (work, r.pass == 0)
    }

    /// Adds a contribution that counts `weight` times; after the first round, which has the part of samples that were
    /// guided, to nodes that are new only.
    fn add(&mut self, hit: &GuideHit, weight: f32, first: Option<f32>) {
        if self.scalars.rebuild.source != CAMERA {
            return self.add_while_light(hit, weight);
        }
        let leaf = hit.leaf() as usize;
        if leaf >= self.tree.leaves() as usize || hit.arrival().is_some() {
            return;
        }
        let [square, pdf] = hit.square_and_pdf();
        let Some((frozen, sums)) = self.frozen.get(leaf).zip(self.leaves.get_mut(leaf)) else { return };
        if let Some(guided) = first {
            let share = f32::from(frozen.share()) / 65_536.0;
            sums.add(square, hit.share(), share * guided, weight);
        }
        if pdf <= 0.0 {
            return;
        }
        let root = if first.is_some() { self.root_of(leaf) } else { frozen.root };
        if root != UNIFORM {
            self.add_to_cell(root, hit.point, hit.contribution() * weight, first.is_some());
        }
    }

    /// The node of all directions of a leaf, a new one if it has none; [`UNIFORM`] if there is no room.
    pub(super) fn root_of(&mut self, leaf: usize) -> u16 {
        let root = self.frozen.get(leaf).map_or(UNIFORM, |f| f.root);
        if root == UNIFORM
            && let Some(new) = self.take_node()
            && let Some(f) = self.frozen.get_mut(leaf)
        {
            f.root = new;
            return new;
        }
        root
    }

    /// Adds to the cell around a point of the square, from a node on; if not `always`, to nodes that are new only.
    pub(super) fn add_to_cell(&mut self, root: u16, point: u32, mass: f32, always: bool) {
        let mut node = root;
        for level in 0..LEVELS {
            let cell = cell_at(point, level);
            let Some((n, sums)) = self.nodes.get(node as usize).zip(self.sums.get_mut(node as usize)) else { return };
            let child = n.child[cell];
            if child == UNIFORM {
                if always || sums.fresh != 0 {
                    sums.add(cell, mass);
                }
                return;
            }
            node = child;
        }
    }

    /// A node that has learned nothing.
    pub(super) fn take_node(&mut self) -> Option<u16> {
        let s = &mut self.scalars;
        let index = if s.free_nodes > 0 && s.free != 0 {
            let index = s.free;
            s.free = self.nodes.get(index as usize).map_or(0, |n| n.child[0].into());
            s.free_nodes -= 1;
            index
        } else if s.used < self.size.nodes {
            s.used += 1;
            s.used - 1
        } else {
            s.refused = s.refused.saturating_add(1);
            return None;
        };
        *self.nodes.get_mut(index as usize)? = GuideNode::UNIFORM;
        *self.sums.get_mut(index as usize)? = NodeSums::EMPTY;
        u16::try_from(index).ok()
    }

    /// Frees a node and those below it.
    fn give_node(&mut self, index: u16, level: usize) {
        let Some(node) = self.nodes.get(index as usize).copied().filter(|_| index != UNIFORM) else { return };
        if level < LEVELS {
            node.child.into_iter().filter(|c| *c != UNIFORM).for_each(|c| self.give_node(c, level + 1));
        }
        let s = &mut self.scalars;
        if let Some(n) = self.nodes.get_mut(index as usize) {
            n.child[0] = s.free as u16;
            s.free = index.into();
            s.free_nodes += 1;
        }
    }

    /// Sum of the masses below a node.
    pub(super) fn mass(&self, index: u16, level: usize) -> f32 {
        let Some((n, s)) = self.nodes.get(index as usize).zip(self.sums.get(index as usize)) else { return 0.0 };
        let below = level + 1 < LEVELS;
        let one = |(c, m): (&u16, &f32)| if below && *c != UNIFORM { self.mass(*c, level + 1) } else { *m };
        // sums of numbers that were loaded may overflow
        n.child.iter().zip(&s.mass).map(one).sum::<f32>().min(f32::MAX)
    }

    /// Masses of the cells of a node on level `level`, those of nodes below included.
    fn masses(&self, index: u16, level: usize) -> [f32; CELLS] {
        let Some((n, s)) = self.nodes.get(index as usize).zip(self.sums.get(index as usize)) else {
            return [0.0; CELLS];
        };
        let mut masses = s.mass;
        if level + 1 < LEVELS {
            for (mass, child) in masses.iter_mut().zip(n.child).filter(|(_, c)| *c != UNIFORM) {
                *mass = self.masses(child, level + 1).iter().sum();
            }
        }
        masses
    }

    /// Computes what is sampled in a leaf; cells become nodes if `grow`. Work done.
    pub(super) fn freeze_leaf(&mut self, leaf: usize, grow: bool) -> u64 {
        let root = self.frozen.get(leaf).map_or(UNIFORM, |f| f.root);
        let last_of_light = !grow && self.scalars.rebuild.source == LIGHT;
        if last_of_light {
            self.become_prior(leaf);
        }
        if !grow && let Some((frozen, sums)) = self.frozen.get_mut(leaf).zip(self.leaves.get(leaf)) {
            frozen.fraction = sums.fraction();
        }
        if root == UNIFORM {
            return 1;
        }
        self.settle(root, 0);
        let total = self.masses(root, 0).iter().sum();
        let mut visited = 0;
        self.freeze_node(root, 0, total, grow, &mut visited);
        if last_of_light {
            self.become_contributions(root);
            visited *= 2;
        }
        4 * visited
    }

    /// Gives nodes that are new the mass of the cell that they were.
    fn settle(&mut self, index: u16, level: usize) {
        let Some(node) = self.nodes.get(index as usize).copied().filter(|_| level + 1 < LEVELS) else { return };
        for (cell, child) in node.child.into_iter().enumerate().filter(|(_, c)| *c != UNIFORM) {
            let was = self.sums.get(index as usize).and_then(|s| s.mass.get(cell)).copied().unwrap_or(0.0);
            match self.sums.get_mut(child as usize) {
                Some(s) if s.fresh != 0 => {
                    let sum: f32 = s.mass.iter().sum();
                    if sum > 0.0 && sum.is_finite() {
                        s.mass.iter_mut().for_each(|m| *m = *m / sum * was);
                    } else {
                        s.mass = [was / CELLS as f32; CELLS];
                    }
                    s.fresh = 0;
                }
                _ => self.settle(child, level + 1),
            }
        }
    }

    /// Freezes a node and those below it, of a leaf of mass `total`.
    fn freeze_node(&mut self, index: u16, level: usize, total: f32, grow: bool, visited: &mut u64) {
        *visited += 1;
        let mut masses = self.masses(index, level);
        for (cell, mass) in masses.iter().enumerate().filter(|_| level + 1 < LEVELS) {
            let Some((n, s)) = self.nodes.get(index as usize).zip(self.sums.get(index as usize)) else { return };
            let child = n.child[cell];
            if child == UNIFORM {
                if grow && *mass > GROW * total && s.hits[cell] >= GROW_HITS {
                    self.make_node(index, cell);
                }
            } else if *mass < SHRINK * total {
                self.merge_node(index, cell, level);
            } else {
                self.freeze_node(child, level + 1, total, grow, visited);
            }
        }
        if level == 0 {
            let even = EVEN / (1.0 - EVEN) * masses.iter().sum::<f32>() / CELLS as f32;
            masses.iter_mut().for_each(|m| *m += even);
        }
        if let Some(n) = self.nodes.get_mut(index as usize) {
            n.set(&masses);
        }
    }

    /// Makes a cell a node.
    fn make_node(&mut self, index: u16, cell: usize) {
        let Some(child) = self.take_node() else { return };
        if let Some(s) = self.sums.get_mut(child as usize) {
            s.fresh = 1;
        }
        if let Some(n) = self.nodes.get_mut(index as usize) {
            n.child[cell] = child;
        }
    }

    /// Makes the node in a cell a cell again.
    fn merge_node(&mut self, index: u16, cell: usize, level: usize) {
        let Some(child) = self.nodes.get(index as usize).map(|n| n.child[cell]) else { return };
        let mass = self.mass(child, level + 1);
        if let Some(s) = self.sums.get_mut(index as usize) {
            s.mass[cell] = mass;
            s.hits[cell] = 0;
        }
        if let Some(n) = self.nodes.get_mut(index as usize) {
            n.child[cell] = UNIFORM;
        }
        self.give_node(child, level + 1);
    }

    /// A copy of a node and of those below it, as far as there is room.
    fn copy_node(&mut self, index: u16, level: usize) -> u16 {
        if index == UNIFORM {
            return UNIFORM;
        }
        let Some(copy) = self.take_node() else { return UNIFORM };
        let (Some(node), Some(sums)) = (self.nodes.get(index as usize), self.sums.get(index as usize)) else {
            return UNIFORM;
        };
        let (mut node, mut sums) = (*node, *sums);
        for cell in 0..CELLS {
            let child = node.child[cell];
            if child == UNIFORM {
                continue;
            }
            node.child[cell] = if level + 1 < LEVELS { self.copy_node(child, level + 1) } else { UNIFORM };
            if node.child[cell] == UNIFORM {
                sums.mass[cell] = self.mass(child, level + 1);
            }
        }
        if let (Some(n), Some(s)) = (self.nodes.get_mut(copy as usize), self.sums.get_mut(copy as usize)) {
            (*n, *s) = (node, sums);
        }
        copy
    }

    /// Changes what a node and those below it have learned.
    pub(super) fn each_node(&mut self, index: u16, level: usize, change: &impl Fn(&mut NodeSums)) {
        let Some(node) = self.nodes.get(index as usize).copied().filter(|_| index != UNIFORM) else { return };
        if let Some(s) = self.sums.get_mut(index as usize) {
            change(s);
        }
        if level + 1 < LEVELS {
            node.child.into_iter().for_each(|c| self.each_node(c, level + 1, change));
        }
    }

    /// Subdivides the leaf at a node of the octrees if it has many contributions. `false` if it has not, or there is no
    /// room.
    fn subdivide(&mut self, index: u32) -> bool {
        let OctreeNode::Leaf { number, .. } = self.tree.node(index) else { return false };
        let counted = self.scalars.rebuild.source == COUNT;
        let Some(leaf) = self.leaves.get_mut(number as usize) else { return false };
        let many = leaf.hits > if counted { SUBDIVIDE_ARRIVALS } else { SUBDIVIDE_HITS };
        if counted {
            // its children are counted anew
            leaf.hits = 0.0;
        }
        many && self.divide(index)
    }

    /// Subdivides the leaf at a node of the octrees: its children begin with an eighth each. `false` if there is no room.
    pub(super) fn divide(&mut self, index: u32) -> bool {
        let OctreeNode::Leaf { number, .. } = self.tree.node(index) else { return false };
        let known = self.frozen.get(number as usize).copied().zip(self.leaves.get(number as usize).copied());
        let Some((FrozenLeaf { root, fraction }, leaf)) = known else { return false };
        let room = self.size.nodes - self.scalars.used + self.scalars.free_nodes >= 7;
        let first = if room { self.tree.subdivide(index) } else { None };
        let Some(first) = first else {
            self.scalars.refused = self.scalars.refused.saturating_add(1);
            return false;
        };
        self.each_node(root, 0, &|s| s.scale(0.125));
        let part: LeafSums = leaf.eighth();
        if let Some(first) = self.leaves.get_mut(number as usize) {
            *first = part;
        }
        for child in first as usize..first as usize + 7 {
            let root = self.copy_node(root, 0);
            if let (Some(f), Some(l)) = (self.frozen.get_mut(child), self.leaves.get_mut(child)) {
                (*f, *l) = (FrozenLeaf { root, fraction }, part);
            }
        }
        true
    }
}

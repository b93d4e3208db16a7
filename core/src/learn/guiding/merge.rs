//! Guides that were learned apart become one: sums are added, in the finer of both trees as far as there is room.
#![deny(clippy::unwrap_used, clippy::expect_used)]

use super::fraction::LeafSums;
use super::node::{CELLS, LEVELS, UNIFORM};
use super::save::{SavedGuide, SavedNode};
use super::shared::{Guide, ROOTS};
use crate::learn::cache::CacheError;
use crate::learn::cache::tree::OctreeNode;

/// A saved leaf: its sums, and the nodes of its tree.
#[derive(Clone, Copy)]
struct Added<'b> {
    sums: LeafSums,
    /// Empty if there is no tree.
    nodes: &'b [u8],
}

impl Guide<'_> {
    /// Adds a saved guide of the same bounds. Where its trees are finer, these grow as long as there is room, in the order
    /// of what was saved, else the finer sums join in one leaf or cell; where they are coarser, each part gets its share. A
    /// leaf without directions for which there is no node left learns no directions. Not while an iteration ends. After an
    /// error the guide is as before.
    ///
    /// # Errors
    /// Those of [`Self::load`], but for the room.
    pub fn merge(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        let mut saved = SavedGuide::check(bytes, self)?;
        (0..ROOTS).for_each(|root| self.merge_octree(root, &mut saved));
        (0..self.tree.leaves() as usize).for_each(|leaf| {
            self.freeze_leaf(leaf, false);
        });
        self.refresh();
        Ok(())
    }

    /// Adds the next saved node of the octrees and all below it to a node of these. Recursion ends at the depth limit.
    fn merge_octree(&mut self, index: u32, saved: &mut SavedGuide<'_>) {
        let Some(inner) = saved.next_is_inner() else { return };
        if !inner {
            if let Some((leaf, nodes)) = saved.next_leaf() {
                self.hand_down(index, Added { sums: leaf.sums(), nodes }, 1.0);
            }
            return;
        }
        if matches!(self.tree.node(index), OctreeNode::Leaf { .. }) {
            let _ = self.divide(index);
        }
        match self.tree.node(index) {
            OctreeNode::Inner { child } => (child..child + 8).for_each(|c| self.merge_octree(c, saved)),
            OctreeNode::Leaf { .. } => (0..8).for_each(|_| self.merge_octree(index, saved)),
        }
    }

    /// Adds a share of a saved leaf to all leaves below a node, in proportion to their volumes.
    fn hand_down(&mut self, index: u32, added: Added<'_>, share: f32) {
        let leaf = match self.tree.node(index) {
            OctreeNode::Inner { child } => {
                return (child..child + 8).for_each(|c| self.hand_down(c, added, 0.125 * share));
            }
            OctreeNode::Leaf { number, .. } => number as usize,
        };
        if let Some(sums) = self.leaves.get_mut(leaf) {
            sums.merge(&added.sums, share);
        }
        if added.nodes.is_empty() {
            return;
        }
        let known = self.frozen.get(leaf).map_or(UNIFORM, |f| f.root);
        let root = if known == UNIFORM { self.take_node().unwrap_or(UNIFORM) } else { known };
        if root == UNIFORM {
            return;
        }
        if let Some(f) = self.frozen.get_mut(leaf) {
            f.root = root;
        }
        self.add_nodes(root, 0, &mut { added.nodes }, share);
    }

    /// Adds a share of the next saved node, and of those below it, to a node on level `level`.
    fn add_nodes(&mut self, index: u16, level: usize, saved: &mut &[u8], share: f32) {
        let Some(node) = SavedNode::next(saved) else { return };
        let theirs = node.sums();
        for cell in 0..CELLS {
            let known = self.nodes.get(index as usize).map_or(UNIFORM, |n| n.child[cell]);
            let child = if level + 1 < LEVELS { known } else { UNIFORM };
            if !node.is_inner(cell) {
                self.spread(index, level, cell, theirs.mass[cell] * share, f32::from(theirs.hits[cell]) * share);
                continue;
            }
            let child = if child == UNIFORM { self.refine(index, cell) } else { child };
            if child == UNIFORM {
                let (mass, hits) = SavedNode::total(saved);
                self.spread(index, level, cell, mass * share, hits * share);
            } else {
                self.add_nodes(child, level + 1, saved, share);
            }
        }
    }

    /// Adds to a cell, or evenly to those of the node in it.
    fn spread(&mut self, index: u16, level: usize, cell: usize, mass: f32, hits: f32) {
        let child = self.nodes.get(index as usize).map_or(UNIFORM, |n| n.child[cell]);
        if child == UNIFORM || level + 1 >= LEVELS {
            if let Some(sums) = self.sums.get_mut(index as usize) {
                sums.merge(cell, mass, hits);
            }
            return;
        }
        let part = 1.0 / CELLS as f32;
        (0..CELLS).for_each(|c| self.spread(child, level + 1, c, mass * part, hits * part));
    }

    /// Makes a cell a node that has learned the same everywhere; [`UNIFORM`] if there is no room.
    fn refine(&mut self, index: u16, cell: usize) -> u16 {
        let Some(child) = self.take_node() else { return UNIFORM };
        let known = self.sums.get(index as usize).map_or((0.0, 0), |s| (s.mass[cell], s.hits[cell]));
        if let Some(sums) = self.sums.get_mut(child as usize) {
            sums.mass = [known.0 / CELLS as f32; CELLS];
            sums.hits = [known.1 / CELLS as u16; CELLS];
        }
        if let Some(n) = self.nodes.get_mut(index as usize) {
            n.child[cell] = child;
        }
        child
    }
}

//! A guide as bytes: for the next frame, another machine, another run.
//!
//! | bytes | what |
//! |---|---|
//! | 64 | [`Header`] |
//! | nodes of the octrees, padded to a multiple of 8 | shape, as that of a saved cache |
//! | 56 per leaf, in the order of the shape | sums of the leaf, share of guided samples, is there a tree |
//! | 100 per node, tree after tree, parents first | cells that are nodes, a bit each; masses; contributions |
//!
//! All numbers are little-endian. There are no indices, so bytes cannot describe anything but trees. All bytes are
//! checked before anything is changed; numbers that are not finite, or negative, are refused.
#![deny(clippy::unwrap_used, clippy::expect_used)]

use super::fraction::{LeafSums, MOST_FRACTION};
use super::node::{CELLS, LEVELS, NodeSums, UNIFORM};
use super::shared::{FrozenLeaf, Guide, ROOTS};
use crate::learn::cache::tree::OctreeNode;
use crate::learn::cache::{CacheError, check_shape};
use crate::scene::blob::content_hash;
use bytemuck::{Pod, Zeroable};

/// First bytes of a saved guide.
const MAGIC: u64 = u64::from_le_bytes(*b"CRPGUIDE");
/// Version of the format.
const VERSION: u32 = 3;
// another number of octrees is another format
const _: () = assert!(VERSION == 3 && ROOTS == 7);

const HEADER: usize = size_of::<Header>();
const LEAF_BYTES: usize = size_of::<SavedLeaf>();
const NODE_BYTES: usize = size_of::<SavedNode>();
const _: () = assert!(HEADER == 64 && LEAF_BYTES == 56 && NODE_BYTES == 100);

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: u64,
    /// [`content_hash`] of everything after it.
    hash: u64,
    version: u32,
    nodes: u32,
    leaves: u32,
    /// Cube around the bounds: bits of its smallest corner and of its edge.
    cube: [u32; 4],
    /// Nodes of all trees over the sphere.
    trees: u32,
    reserved: [u32; 4],
}

/// Words of a leaf: bits of its sums, share, is there a tree.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SavedLeaf {
    sums: [u32; 12],
    fraction: u32,
    tree: u32,
}

/// A node: cells that are nodes, bits of the masses, contributions.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SavedNode {
    inner: u32,
    mass: [u32; CELLS],
    hits: [u16; CELLS],
}

impl SavedNode {
    fn to_little_endian(self) -> Self {
        let Self { inner, mass, hits } = self;
        Self { inner: inner.to_le(), mass: mass.map(u32::to_le), hits: hits.map(u16::to_le) }
    }

    /// What it has learned.
    pub(super) fn sums(&self) -> NodeSums {
        NodeSums { mass: self.mass.map(f32::from_bits), hits: self.hits, fresh: 0 }
    }

    /// The next one of a tree.
    pub(super) fn next(saved: &mut &[u8]) -> Option<Self> {
        take::<Self>(saved).map(Self::to_little_endian)
    }

    /// Is the cell a node?
    pub(super) fn is_inner(&self, cell: usize) -> bool {
        self.inner >> cell & 1 == 1
    }

    /// Steps over the next node and those below it: what they have learned together.
    pub(super) fn total(saved: &mut &[u8]) -> (f32, f32) {
        let Some(node) = Self::next(saved) else { return (0.0, 0.0) };
        let (mut mass, mut hits) = (0.0, 0.0);
        for cell in 0..CELLS {
            let (m, h) = if node.is_inner(cell) {
                Self::total(saved)
            } else {
                (f32::from_bits(node.mass[cell]), node.hits[cell].into())
            };
            (mass, hits) = (mass + m, hits + h);
        }
        (mass, hits)
    }
}

impl SavedLeaf {
    fn to_little_endian(self) -> Self {
        let Self { sums, fraction, tree } = self;
        Self { sums: sums.map(u32::to_le), fraction: fraction.to_le(), tree: tree.to_le() }
    }

    /// What it has learned.
    pub(super) fn sums(&self) -> LeafSums {
        bytemuck::cast(self.sums)
    }
}

/// Parts of a saved guide, checked.
pub(super) struct SavedGuide<'b> {
    shape: &'b [u8],
    leaves: &'b [u8],
    trees: &'b [u8],
    /// Numbers of leaves and of nodes of all trees.
    counts: [u32; 2],
}

/// Length of the saved guide that bytes begin with, by its header; `None` if they begin with something else.
pub(in crate::learn) fn saved_length(bytes: &[u8]) -> Option<usize> {
    let (header, _) = bytes.split_at_checked(HEADER)?;
    let h = native(bytemuck::pod_read_unaligned(header));
    (h.magic == MAGIC).then(|| if h.version == VERSION { length(h.nodes, h.leaves, h.trees) } else { bytes.len() })
}

fn padded(nodes: u32) -> usize {
    (nodes as usize).saturating_add(7) & !7
}

/// Length of a saved guide, bytes.
fn length(nodes: u32, leaves: u32, trees: u32) -> usize {
    let tables =
        (leaves as usize).saturating_mul(LEAF_BYTES).saturating_add((trees as usize).saturating_mul(NODE_BYTES));
    tables.saturating_add(HEADER).saturating_add(padded(nodes))
}

fn native(h: Header) -> Header {
    Header {
        magic: u64::from_le(h.magic),
        hash: u64::from_le(h.hash),
        version: u32::from_le(h.version),
        nodes: u32::from_le(h.nodes),
        leaves: u32::from_le(h.leaves),
        cube: h.cube.map(u32::from_le),
        trees: u32::from_le(h.trees),
        reserved: h.reserved,
    }
}

/// The next record of a table.
fn take<T: Pod>(rest: &mut &[u8]) -> Option<T> {
    let (head, tail) = rest.split_at_checked(size_of::<T>())?;
    *rest = tail;
    Some(bytemuck::pod_read_unaligned(head))
}

/// Steps over the next saved node and those below it; the number of nodes, `None` if one is missing or too deep.
fn check_node(rest: &mut &[u8], level: usize) -> Option<Result<u32, f32>> {
    let node = SavedNode::next(rest)?;
    if let Some(bad) = node.sums().mass.into_iter().find(|m| !(0.0..=f32::MAX).contains(m)) {
        return Some(Err(bad));
    }
    let below = if level + 1 < LEVELS { node.inner } else { 0 };
    if node.inner >> CELLS != 0 || below != node.inner {
        return None;
    }
    let mut all = 1;
    for _ in 0..below.count_ones() {
        match check_node(rest, level + 1)? {
            Ok(n) => all += n,
            bad => return Some(bad),
        }
    }
    Some(Ok(all))
}

impl<'b> SavedGuide<'b> {
    pub(super) fn check(bytes: &'b [u8], guide: &Guide<'_>) -> Result<Self, CacheError> {
        let given = bytes.len();
        let (header, body) = bytes.split_at_checked(HEADER).ok_or(CacheError::Length { needed: HEADER, given })?;
        let h = native(bytemuck::pod_read_unaligned(header));
        if h.magic != MAGIC {
            return Err(CacheError::Magic(h.magic));
        }
        if h.version != VERSION {
            return Err(CacheError::Version { found: h.version, known: VERSION });
        }
        let needed = length(h.nodes, h.leaves, h.trees);
        if given != needed {
            return Err(CacheError::Length { needed, given });
        }
        let found = content_hash(bytes.get(16..).unwrap_or(&[]));
        if h.hash != found {
            return Err(CacheError::Hash { stored: h.hash, found });
        }
        for (index, (expected, found)) in (0..).zip(guide.tree.cube.into_iter().zip(h.cube)) {
            if expected.to_bits() != found {
                return Err(CacheError::Bounds { index, expected, found: f32::from_bits(found) });
            }
        }
        let (shape, rest) = body.split_at_checked(padded(h.nodes)).unwrap_or((&[], &[]));
        let shape = shape.get(..h.nodes as usize).unwrap_or(&[]);
        check_shape(ROOTS, shape, [h.nodes, h.leaves])?;
        let (leaves, trees) = rest.split_at_checked(h.leaves as usize * LEAF_BYTES).unwrap_or((&[], &[]));
        let (mut left, mut nodes) = (trees, 0u32);
        for (leaf, b) in (0u32..).zip(leaves.chunks_exact(LEAF_BYTES)) {
            let l = bytemuck::pod_read_unaligned::<SavedLeaf>(b).to_little_endian();
            let bad = |field: u32, found: f64| CacheError::Sum { leaf, bin: 0, field, found };
            if !l.sums().is_sound() {
                let found = l.sums.into_iter().map(f32::from_bits).find(|x| !(0.0..=f32::MAX).contains(x));
                return Err(bad(0, found.unwrap_or(f32::NAN).into()));
            }
            if l.fraction > MOST_FRACTION || l.tree > 1 {
                return Err(bad(12, l.fraction.into()));
            }
            if l.tree == 1 {
                let short = CacheError::Shape { expected: [h.trees, h.leaves], found: [nodes, leaf] };
                match check_node(&mut left, 0).ok_or(short)? {
                    Ok(n) => nodes = nodes.saturating_add(n),
                    Err(found) => return Err(bad(14, found.into())),
                }
            }
        }
        if nodes != h.trees {
            return Err(CacheError::Shape { expected: [h.trees, h.leaves], found: [nodes, h.leaves] });
        }
        Ok(Self { shape, leaves, trees, counts: [h.leaves, h.trees] })
    }

    /// Is the next node of the octrees an inner one? Steps over it; `None` after the last.
    pub(super) fn next_is_inner(&mut self) -> Option<bool> {
        let (first, rest) = self.shape.split_first()?;
        self.shape = rest;
        Some(*first == 1)
    }

    /// Steps over the next leaf and the nodes of its tree; none if it has no tree.
    pub(super) fn next_leaf(&mut self) -> Option<(SavedLeaf, &'b [u8])> {
        let leaf = take::<SavedLeaf>(&mut self.leaves)?.to_little_endian();
        let (all, mut rest) = (self.trees, self.trees);
        if leaf.tree == 1 {
            SavedNode::total(&mut rest);
        }
        self.trees = rest;
        Some((leaf, all.get(..all.len() - rest.len()).unwrap_or(&[])))
    }
}

impl Guide<'_> {
    /// Length of what [`Self::save`] writes, bytes.
    pub fn saved_len(&self) -> usize {
        length(self.tree.nodes(), self.leaves(), self.nodes().saturating_sub(1))
    }

    /// Writes the trees and what they have learned; returns the bytes written. Not while an iteration ends.
    ///
    /// # Errors
    /// Too few bytes.
    pub fn save(&self, out: &mut [u8]) -> Result<usize, CacheError> {
        let (needed, given) = (self.saved_len(), out.len());
        let short = CacheError::Length { needed, given };
        let out = out.get_mut(..needed).ok_or(short)?;
        out.fill(0);
        let (head, body) = out.split_at_mut_checked(HEADER).ok_or(short)?;
        let (shape, rest) = body.split_at_mut_checked(padded(self.tree.nodes())).ok_or(short)?;
        let (leaves, mut trees) = rest.split_at_mut_checked(self.leaves() as usize * LEAF_BYTES).ok_or(short)?;
        let (mut nodes, mut leaves) = (shape.iter_mut(), leaves.chunks_exact_mut(LEAF_BYTES));
        let mut complete = true;
        for root in 0..ROOTS {
            self.tree.visit(root, &mut |node| {
                let byte = nodes.next();
                let OctreeNode::Leaf { number, .. } = node else {
                    byte.into_iter().for_each(|b| *b = 1);
                    return;
                };
                let at = number as usize;
                let (Some(f), Some(s), Some(to)) = (self.frozen.get(at), self.leaves.get(at), leaves.next()) else {
                    return;
                };
                let tree = u32::from(f.root != UNIFORM);
                let leaf = SavedLeaf { sums: bytemuck::cast(*s), fraction: f.fraction.into(), tree };
                to.copy_from_slice(bytemuck::bytes_of(&leaf.to_little_endian()));
                if tree == 1 {
                    complete &= self.save_node(f.root, 0, &mut trees).is_some();
                }
            });
        }
        if !complete || !trees.is_empty() {
            return Err(short);
        }
        let mut header = Header {
            magic: MAGIC,
            hash: 0,
            version: VERSION,
            nodes: self.tree.nodes(),
            leaves: self.leaves(),
            cube: self.tree.cube.map(f32::to_bits),
            trees: self.nodes().saturating_sub(1),
            reserved: [0; 4],
        };
        head.copy_from_slice(bytemuck::bytes_of(&native(header)));
        header.hash = content_hash(out.get(16..).unwrap_or(&[]));
        if let Some(head) = out.get_mut(..HEADER) {
            head.copy_from_slice(bytemuck::bytes_of(&native(header)));
        }
        Ok(needed)
    }

    /// Writes a node and those below it; `None` if there is no room.
    fn save_node(&self, index: u16, level: usize, out: &mut &mut [u8]) -> Option<()> {
        let (node, sums) = self.nodes.get(index as usize).zip(self.sums.get(index as usize))?;
        let inner = |c: usize| level + 1 < LEVELS && node.child[c] != UNIFORM;
        let bits = (0..CELLS).filter(|c| inner(*c)).fold(0, |b, c| b | 1 << c);
        let saved = SavedNode { inner: bits, mass: sums.mass.map(f32::to_bits), hits: sums.hits };
        let (head, tail) = core::mem::take(out).split_at_mut_checked(NODE_BYTES)?;
        head.copy_from_slice(bytemuck::bytes_of(&saved.to_little_endian()));
        *out = tail;
        (0..CELLS).filter(|c| inner(*c)).try_for_each(|c| self.save_node(node.child[c], level + 1, out))
    }

    /// Replaces everything by a saved guide of the same bounds that has no more leaves and nodes than there is room
    /// for. After an error the guide is as before.
    ///
    /// # Errors
    /// Those of a saved cache, whose shape a guide has; a sum's `bin` and `field` mean nothing here.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        let mut saved = SavedGuide::check(bytes, self)?;
        let [leaves, nodes] = saved.counts;
        for (needed, room) in [(leaves, self.frozen.len() as u32), (nodes.saturating_add(1), self.size.nodes)] {
            if needed > room {
                return Err(CacheError::Full { needed, room });
            }
        }
        self.reset();
        (0..ROOTS).for_each(|root| self.load_octree(root, &mut saved));
        self.refresh();
        Ok(())
    }

    /// Fills the octrees' tables.
    pub(super) fn refresh(&mut self) {
        let (mut at, step) = (0, 1 << 10);
        while let Some(next) = self.tree.refresh(at, step) {
            at = next;
        }
    }

    /// Checks bytes that are to be loaded or merged, whatever room there is.
    pub(in crate::learn) fn check(&self, bytes: &[u8]) -> Result<(), CacheError> {
        SavedGuide::check(bytes, self).map(|_| ())
    }

    /// Takes the next node of the octrees and all below it. Recursion ends at the depth limit.
    fn load_octree(&mut self, index: u32, saved: &mut SavedGuide<'_>) {
        if saved.next_is_inner() == Some(true) {
            let _ = self.tree.subdivide(index);
            if let OctreeNode::Inner { child } = self.tree.node(index) {
                (child..child + 8).for_each(|c| self.load_octree(c, saved));
            }
            return;
        }
        let (OctreeNode::Leaf { number, .. }, Some((leaf, mut nodes))) = (self.tree.node(index), saved.next_leaf())
        else {
            return;
        };
        let root = if nodes.is_empty() { UNIFORM } else { self.load_node(&mut nodes) };
        let at = number as usize;
        if let (Some(f), Some(s)) = (self.frozen.get_mut(at), self.leaves.get_mut(at)) {
            *f = FrozenLeaf { root, fraction: 0 };
            *s = leaf.sums();
            self.freeze_leaf(at, false);
            self.frozen[at].fraction = leaf.fraction as u16;
        }
    }

    /// Takes the next node and those below it, no deeper than the check has seen.
    fn load_node(&mut self, trees: &mut &[u8]) -> u16 {
        let (Some(saved), Some(index)) = (SavedNode::next(trees), self.take_node()) else { return UNIFORM };
        if let Some(s) = self.sums.get_mut(index as usize) {
            *s = saved.sums();
        }
        for cell in (0..CELLS).filter(|c| saved.is_inner(*c)) {
            let child = self.load_node(trees);
            if let Some(n) = self.nodes.get_mut(index as usize) {
                n.child[cell] = child;
            }
        }
        index
    }
}

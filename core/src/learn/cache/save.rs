//! The cache as bytes: for the next frame, another machine, another run.
//!
//! | bytes | what |
//! |---|---|
//! | 64 | [`Header`] |
//! | nodes, padded to a multiple of 8 | shape: a byte per node, 1 inner, 0 leaf; parents first, children in order |
//! | 1920 per leaf | sums of the leaves in the order of the shape |
//!
//! All numbers are little-endian. The header states what the sums depend on: the bounds, which determine the cells, and
//! the objective, because values of [first vertices](super::VertexKind::FirstDiffuse) are in units of their pixel under
//! the relative one, and radiance under the absolute one. Nothing else has to agree: after a change of strategy, norm,
//! depth, camera or scene the sums have the same units, and decay as new ones are added.
//!
//! There are no indices, so bytes cannot describe anything but a tree: what is left to check is that the shape ends
//! where the header says, how deep it goes, and the numbers. All bytes are checked before anything is changed.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::bins::{BINS, BinSums};
use super::kind::ROOTS;
use super::shared::Cache;
use super::tree::{MAX_DEPTH, OctreeNode};
use crate::learn::settings::Objective;
use crate::scene::blob::content_hash;
use bytemuck::{Pod, Zeroable};
use core::fmt;

/// First bytes of a saved cache.
const MAGIC: u64 = u64::from_le_bytes(*b"CRPCACHE");
/// Version of the format, which covers the layout of the sums too.
const VERSION: u32 = 5;
/// Largest sum that is accepted: sums of such files, and squares of their means, stay finite.
const MAX_SUM: f64 = 1e100;

// Any of these is part of the layout: another number of octrees, bins or sums needs another version.
const _: () = assert!(VERSION == 5 && ROOTS == 6 && BINS == 16 && size_of::<BinSums>() == 15 * 8);

const HEADER: usize = size_of::<Header>();
const LEAF_BYTES: usize = BINS * size_of::<BinSums>();

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
    /// [`Objective`] as a number.
    objective: u32,
    reserved: [u32; 4],
}

/// Reason why bytes cannot be loaded as a cache, or a cache cannot be saved.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CacheError {
    /// Too few bytes, or too many.
    Length {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// Neither a saved cache nor a saved guide; the first eight bytes.
    Magic(u64),
    /// A version of the format that is not known.
    Version {
        /// Version of the bytes.
        found: u32,
        /// The one that can be loaded.
        known: u32,
    },
    /// The hash of the contents is not the one stored.
    Hash {
        /// Hash in the header.
        stored: u64,
        /// Hash of the bytes.
        found: u64,
    },
    /// A cache over other bounds.
    Bounds {
        /// 0 to 2: smallest corner of the cube; 3: its edge.
        index: u32,
        /// Value of this cache.
        expected: f32,
        /// Value in the header.
        found: f32,
    },
    /// A cache of renders with another objective.
    Objective {
        /// Objective of this cache.
        expected: Objective,
        /// Objective in the header, as a number.
        found: u32,
    },
    /// A node that is neither 0 nor 1, or an inner one at the depth limit.
    OctreeNode {
        /// Number of the node in the order of the shape.
        index: u32,
        /// Byte of the node.
        found: u8,
        /// Depth of the node.
        depth: u32,
    },
    /// The shape has other numbers of nodes and leaves than the header.
    Shape {
        /// Nodes and leaves in the header.
        expected: [u32; 2],
        /// Nodes and leaves in the shape.
        found: [u32; 2],
    },
    /// A sum that is negative, not finite or too large: above 1e100 in a cache, above the largest f32 in a guide.
    Sum {
        /// Leaf in the order of the shape.
        leaf: u32,
        /// Direction bin of the leaf.
        bin: u32,
        /// Number of the sum within the bin.
        field: u32,
        /// Value of the sum.
        found: f64,
    },
    /// Nothing is learned here, or nothing of what was saved, or an iteration runs.
    Absent,
    /// More leaves than there is room for.
    Full {
        /// Leaves needed.
        needed: u32,
        /// Leaves there is room for.
        room: u32,
    },
}

impl fmt::Display for CacheError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { needed, given } => write!(f, "saved statistics have {needed} bytes, {given} given"),
            Self::Magic(m) => write!(f, "no saved statistics: the first bytes are {m:#018x}"),
            Self::Version { found, known } => {
                write!(f, "saved statistics of version {found}, only {known} is known")
            }
            Self::Hash { stored, found } => {
                write!(f, "saved statistics have hash {found:#018x}, header says {stored:#018x}")
            }
            Self::Bounds { index: 3, expected, found } => {
                write!(f, "saved statistics have edge {found}, need {expected}")
            }
            Self::Bounds { index, expected, found } => {
                write!(f, "saved statistics start at {found} on axis {index}, need {expected}")
            }
            Self::Objective { expected, found } => match Objective::from_u32(*found) {
                Some(o) => write!(f, "saved statistics have values for the objective {o}, need {expected}"),
                None => write!(f, "saved statistics have values for an unknown objective, {found}, need {expected}"),
            },
            Self::OctreeNode { index, found, depth } => {
                write!(f, "node {index} of the saved statistics is {found} at depth {depth}")
            }
            Self::Shape { expected: [n, l], found: [m, k] } => {
                write!(f, "saved statistics have {m} nodes and {k} leaves, header says {n} and {l}")
            }
            Self::Sum { leaf, bin, field, found } => {
                write!(
                    f,
                    "leaf {leaf} bin {bin} field {field} of the saved statistics is {found}: \
                     negative, not finite or too large"
                )
            }
            Self::Absent => f.write_str("nothing is learned here that could be saved or loaded, or an iteration runs"),
            Self::Full { needed, room } => write!(f, "saved statistics have {needed} leaves, there is room for {room}"),
        }
    }
}

impl core::error::Error for CacheError {}

/// Shape and sums of a saved cache, checked.
struct SavedCache<'b> {
    shape: &'b [u8],
    sums: &'b [u8],
    leaves: u32,
}

fn padded(nodes: u32) -> usize {
    (nodes as usize).saturating_add(7) & !7
}

/// Length of a saved cache, bytes.
fn length(nodes: u32, leaves: u32) -> usize {
    (leaves as usize).saturating_mul(LEAF_BYTES).saturating_add(HEADER).saturating_add(padded(nodes))
}

/// Length of the saved cache that bytes begin with, by its header; `None` if they begin with something else.
pub(in crate::learn) fn saved_length(bytes: &[u8]) -> Option<usize> {
    let (header, _) = bytes.split_at_checked(HEADER)?;
    let h = words_to_native(bytemuck::pod_read_unaligned(header));
    (h.magic == MAGIC).then(|| if h.version == VERSION { length(h.nodes, h.leaves) } else { bytes.len() })
}

/// Why bytes are nothing that was saved.
pub(in crate::learn) fn not_saved(bytes: &[u8]) -> CacheError {
    match bytes.split_at_checked(HEADER) {
        Some((header, _)) => CacheError::Magic(words_to_native(bytemuck::pod_read_unaligned(header)).magic),
        None => CacheError::Length { needed: HEADER, given: bytes.len() },
    }
}

fn read_sums(bytes: &[u8]) -> BinSums {
    let mut sums = BinSums::ZERO;
    for (x, b) in sums.fields_mut().iter_mut().zip(bytes.as_chunks().0) {
        *x = f64::from_le_bytes(*b);
    }
    sums
}

impl<'b> SavedCache<'b> {
    fn check(bytes: &'b [u8], cache: &Cache<'_>) -> Result<Self, CacheError> {
        let given = bytes.len();
        let (header, body) = bytes.split_at_checked(HEADER).ok_or(CacheError::Length { needed: HEADER, given })?;
        let header = words_to_native(bytemuck::pod_read_unaligned(header));
        if header.magic != MAGIC {
            return Err(CacheError::Magic(header.magic));
        }
        if header.version != VERSION {
            return Err(CacheError::Version { found: header.version, known: VERSION });
        }
        let needed = length(header.nodes, header.leaves);
        if given != needed {
            return Err(CacheError::Length { needed, given });
        }
        let found = content_hash(bytes.get(16..).unwrap_or(&[]));
        if header.hash != found {
            return Err(CacheError::Hash { stored: header.hash, found });
        }
        for (index, (expected, found)) in (0..).zip(cache.tree.cube.into_iter().zip(header.cube)) {
            if expected.to_bits() != found {
                return Err(CacheError::Bounds { index, expected, found: f32::from_bits(found) });
            }
        }
        if header.objective != cache.objective as u32 {
            return Err(CacheError::Objective { expected: cache.objective, found: header.objective });
        }
        let (shape, sums) = body.split_at_checked(padded(header.nodes)).unwrap_or((&[], &[]));
        let shape = shape.get(..header.nodes as usize).unwrap_or(&[]);
        check_shape(ROOTS, shape, [header.nodes, header.leaves])?;
        for (i, b) in (0u32..).zip(sums.chunks_exact(size_of::<BinSums>())) {
            let bin = read_sums(b);
            // a NaN is in no range
            let bad = (0u32..).zip(bin.fields()).find(|(_, x)| !(0.0..=MAX_SUM).contains(*x));
            if let Some((field, found)) = bad {
                let (leaf, bin) = (i / BINS as u32, i % BINS as u32);
                return Err(CacheError::Sum { leaf, bin, field, found: *found });
            }
        }
        Ok(Self { shape, sums, leaves: header.leaves })
    }

    fn leaf(&self, number: u32) -> [BinSums; BINS] {
        let from = number as usize * LEAF_BYTES;
        let bytes = self.sums.get(from..).unwrap_or(&[]);
        let mut bins = [BinSums::ZERO; BINS];
        for (bin, b) in bins.iter_mut().zip(bytes.chunks_exact(size_of::<BinSums>())) {
            *bin = read_sums(b);
        }
        bins
    }
}

/// Checks that the shape is one tree after the other, `roots` of them.
pub(in crate::learn) fn check_shape(roots: u32, shape: &[u8], expected: [u32; 2]) -> Result<(), CacheError> {
    // nodes still to come at every depth
    let mut open = [0u32; MAX_DEPTH as usize + 1];
    if let Some(o) = open.first_mut() {
        *o = roots;
    }
    let (mut depth, mut leaves) = (0usize, 0u32);
    for (index, found) in (0u32..).zip(shape.iter().copied()) {
        let bad = CacheError::OctreeNode { index, found, depth: depth as u32 };
        let excess = CacheError::Shape { expected, found: [index, leaves] };
        let o = open.get_mut(depth).filter(|o| **o > 0).ok_or(excess)?;
        *o -= 1;
        match found {
            0 => leaves += 1,
            1 => {
                depth += 1;
                *open.get_mut(depth).ok_or(bad)? = 8;
            }
            _ => return Err(bad),
        }
        while depth > 0 && open.get(depth) == Some(&0) {
            depth -= 1;
        }
    }
    let found = [shape.len() as u32, leaves];
    if open != [0; MAX_DEPTH as usize + 1] || found != expected {
        return Err(CacheError::Shape { expected, found });
    }
    Ok(())
}

/// Header converted between the machine's byte order and little-endian.
fn words_to_native(h: Header) -> Header {
    Header {
        magic: u64::from_le(h.magic),
        hash: u64::from_le(h.hash),
        version: u32::from_le(h.version),
        nodes: u32::from_le(h.nodes),
        leaves: u32::from_le(h.leaves),
        cube: h.cube.map(u32::from_le),
        objective: u32::from_le(h.objective),
        reserved: h.reserved,
    }
}

/// Next node and next leaf of a [`SavedCache`].
#[derive(Default)]
struct SavedCursor {
    node: usize,
    leaf: u32,
}

impl Cache<'_> {
    /// Length of what [`Self::save`] writes, bytes.
    pub fn saved_len(&self) -> usize {
        length(self.nodes(), self.leaves())
    }

    /// Writes the tree and its sums; returns the bytes written. Equal statistics give equal bytes, whatever the order
    /// in which the tree grew.
    pub fn save(&self, out: &mut [u8]) -> Result<usize, CacheError> {
        let (needed, given) = (self.saved_len(), out.len());
        let short = CacheError::Length { needed, given };
        let out = out.get_mut(..needed).ok_or(short)?;
        let (head, body) = out.split_at_mut_checked(HEADER).ok_or(short)?;
        let (shape, sums) = body.split_at_mut_checked(padded(self.nodes())).ok_or(short)?;
        shape.fill(0);
        let (mut nodes, mut leaves) = (shape.iter_mut(), sums.chunks_exact_mut(LEAF_BYTES));
        for root in 0..ROOTS {
            self.tree.visit(root, &mut |node| {
                let byte = nodes.next();
                match node {
                    OctreeNode::Inner { .. } => byte.into_iter().for_each(|b| *b = 1),
                    OctreeNode::Leaf { number, .. } => {
                        let numbers = self.leaf(number).iter().flat_map(BinSums::fields);
                        let bytes = leaves.next().unwrap_or(&mut []).as_chunks_mut().0;
                        bytes.iter_mut().zip(numbers).for_each(|(b, x)| *b = x.to_le_bytes());
                    }
                }
            });
        }
        let mut header = Header {
            magic: MAGIC,
            hash: 0,
            version: VERSION,
            nodes: self.nodes(),
            leaves: self.leaves(),
            cube: self.tree.cube.map(f32::to_bits),
            objective: self.objective as u32,
            reserved: [0; 4],
        };
        head.copy_from_slice(bytemuck::bytes_of(&words_to_native(header)));
        header.hash = content_hash(out.get(16..).unwrap_or(&[]));
        if let Some(head) = out.get_mut(..HEADER) {
            head.copy_from_slice(bytemuck::bytes_of(&words_to_native(header)));
        }
        Ok(needed)
    }

    /// Replaces all statistics by a saved cache of the same bounds and objective. Bytes with more leaves than there is
    /// room for are refused; [`Self::merge`] into an empty cache takes what fits. After an error the cache is as
    /// before.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        let saved = SavedCache::check(bytes, self)?;
        let room = self.size.leaves();
        if saved.leaves > room {
            return Err(CacheError::Full { needed: saved.leaves, room });
        }
        self.reset();
        self.add(&saved);
        Ok(())
    }

    /// Adds a saved cache of the same bounds and objective. Where its tree is finer, this one grows as long as there is
    /// room, else the finer sums join in one leaf; where it is coarser, leaves get an eighth per level. After an error
    /// the cache is as before.
    pub fn merge(&mut self, bytes: &[u8]) -> Result<(), CacheError> {
        let saved = SavedCache::check(bytes, self)?;
        self.add(&saved);
        Ok(())
    }

    fn add(&mut self, saved: &SavedCache<'_>) {
        let mut at = SavedCursor::default();
        (0..ROOTS).for_each(|root| self.add_node(root, saved, &mut at));
        self.refresh();
    }

    /// Adds the next saved node and all below it to a node of this tree. Recursion ends at the depth limit.
    fn add_node(&mut self, index: u32, saved: &SavedCache<'_>, at: &mut SavedCursor) {
        let inner = saved.shape.get(at.node) == Some(&1);
        at.node += 1;
        if !inner {
            let bins = saved.leaf(at.leaf);
            at.leaf += 1;
            return self.hand_down(index, &bins, 1.0);
        }
        if matches!(self.tree.node(index), OctreeNode::Leaf { .. }) && !self.subdivide(index) {
            self.refuse_subdivision();
        }
        match self.tree.node(index) {
            OctreeNode::Inner { child } => (child..child + 8).for_each(|c| self.add_node(c, saved, at)),
            OctreeNode::Leaf { .. } => (0..8).for_each(|_| self.add_node(index, saved, at)),
        }
    }

    /// Adds a share of sums to all leaves below a node, in proportion to their volumes.
    fn hand_down(&mut self, index: u32, bins: &[BinSums; BINS], share: f64) {
        match self.tree.node(index) {
            OctreeNode::Inner { child } => (child..child + 8).for_each(|c| self.hand_down(c, bins, 0.125 * share)),
            OctreeNode::Leaf { number, .. } => {
                self.leaf_mut(number).iter_mut().zip(bins).for_each(|(b, o)| b.add(o, share));
            }
        }
    }
}

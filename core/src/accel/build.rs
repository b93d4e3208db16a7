//! A builder of trees in the caller's memory: no allocation, a stack of fixed size, the same tree for the same input.
//!
//! ```text
//! node(primitives):
//!     while there are fewer than eight ranges: split the range of largest area that is too large for a leaf
//!     each range becomes a leaf or a node, those of leaves and large boxes first
//! ```
//!
//! 1. A range is split where the surface area heuristic says (Wald, "On fast construction of SAH-based bounding volume
//!    hierarchies", 2007): up to 128 primitives at the best of all places along each axis, more at the best of 31 planes
//!    between 32 bins. A leaf of eight triangles costs as much as one of one, so ranges count by eights.
//! 2. Ranges whose centres coincide are cut in half in the order of their primitives.
//! 3. Where the levels left are no more than halving needs, ranges are halved by count, so that no tree is deeper than
//!    [`MAX_TREE_DEPTH`].
//! 4. Nodes and leaves are numbered as [`Node`] says: depth first, slots ascending. What waits lies on a stack: seven ranges
//!    a level, and those of the last.

use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, MAX_TREE_DEPTH, NONE, Node};
use bytemuck::{Pod, Zeroable};
use core::fmt;

/// Children of a node, triangles of a leaf.
const WIDTH: usize = 8;
/// Bins along an axis.
const BINS: usize = 32;
/// Most primitives for which every place is looked at.
const SWEEP: usize = 128;
/// Ranges that wait: seven siblings a level, eight at the last.
const WAITING: usize = 7 * MAX_TREE_DEPTH as usize + 8;

/// A box that a tree is built over, and what is in it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Primitive {
    /// Smallest coordinates.
    pub min: [f32; 3],
    /// What the leaf function makes of it: an index of a triangle, or the child reference itself.
    pub id: u32,
    /// Largest coordinates.
    pub max: [f32; 3],
    /// Not read.
    pub reserved: u32,
}

impl Primitive {
    /// A primitive in a box.
    pub const fn new(id: u32, [min, max]: [[f32; 3]; 2]) -> Self {
        Self { min, id, max, reserved: 0 }
    }

    fn bounds(&self) -> Box3 {
        Box3 { min: self.min, max: self.max }
    }

    /// Twice the centre.
    fn centre(&self, axis: usize) -> f32 {
        self.min[axis] + self.max[axis]
    }

    fn is_sound(&self) -> bool {
        (0..3).all(|k| self.min[k] <= self.max[k] && self.min[k] >= -1e30 && self.max[k] <= 1e30)
    }
}

/// Error of building.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BuildError {
    /// More nodes are needed than there is room for.
    Nodes {
        /// Room for nodes.
        room: usize,
    },
    /// More leaves are needed than there is room for.
    Leaves {
        /// Room for leaves.
        room: usize,
    },
    /// More primitives than there is room for.
    Scratch {
        /// Primitives.
        needed: usize,
        /// Room for primitives.
        room: usize,
    },
    /// An object that is not there, or whose runs are not.
    Object(u32),
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nodes { room } => write!(f, "the tree needs more than {room} nodes"),
            Self::Leaves { room } => write!(f, "the tree needs more than {room} leaves"),
            Self::Scratch { needed, room } => write!(f, "{needed} primitives to build over, room for {room}"),
            Self::Object(o) => write!(f, "there is no object {o}"),
        }
    }
}

impl core::error::Error for BuildError {}

/// Size of a tree that was built.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Built {
    /// Nodes.
    pub nodes: u32,
    /// Leaves.
    pub leaves: u32,
    /// Levels of nodes.
    pub depth: u32,
    /// Box of everything; zeros without primitives.
    pub bounds: [[f32; 3]; 2],
}

/// Triangles that leaves are made of.
pub trait Corners {
    /// Corners of triangle `id`.
    fn corners(&self, id: u32) -> [[f32; 3]; 3];
}

impl<F: Fn(u32) -> [[f32; 3]; 3]> Corners for F {
    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self(id)
    }
}

/// Builds a tree over triangles: `primitives` are their boxes with their indices, in an order that is lost. The tree takes the
/// first of `nodes` and `leaves`, which are numbered from `first_node` and `first_leaf` on. Enough are as many
/// nodes and leaves as triangles. Primitives whose box is not finite are left out, no ray finds them.
///
/// # Errors
/// Too little room for nodes or leaves, or leaves whose numbers do not fit into references.
pub fn build_triangles(
    primitives: &mut [Primitive],
    corners: &impl Corners,
    (nodes, first_node): (&mut [Node], u32),
    (leaves, first_leaf): (&mut [Leaf], u32),
) -> Result<Built, BuildError> {
    let room = leaves.len();
    let mut used = 0usize;
    let leaf = |range: &[Primitive]| {
        let leaf = leaves.get_mut(used).ok_or(BuildError::Leaves { room })?;
        let index = u32::try_from(used).ok().and_then(|used| first_leaf.checked_add(used));
        let index = index.filter(|i| *i <= CHILD_INDEX).ok_or(BuildError::Leaves { room: used })?;
        *leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
        for (slot, primitive) in range.iter().enumerate().take(WIDTH) {
            leaf.triangle[slot] = primitive.id;
            for (row, x) in corners.corners(primitive.id).as_flattened().iter().enumerate().take(9) {
                leaf.p[row][slot] = *x;
            }
        }
        let reference = LEAF_BIT | (range.len() as u32) << 27 | index;
        used += 1;
        Ok(reference)
    };
    build::<WIDTH>(primitives, nodes, first_node, leaf)
}

/// Builds a top-level tree: the `id` of each primitive is the child reference itself. See
/// [`top_capacity`](crate::scene::blob::top_capacity) for the nodes that it takes at most. Primitives whose box is not finite
/// are left out, no ray finds them.
///
/// # Errors
/// Too little room for nodes.
pub fn build_references(
    primitives: &mut [Primitive],
    nodes: &mut [Node],
    first_node: u32,
) -> Result<Built, BuildError> {
    build::<1>(primitives, nodes, first_node, |range| Ok(range.first().map_or(NONE, |primitive| primitive.id)))
}

/// A closed box.
#[derive(Clone, Copy)]
struct Box3 {
    min: [f32; 3],
    max: [f32; 3],
}

impl Box3 {
    const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    fn grow(&mut self, o: &Self) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(o.min[k]);
            self.max[k] = self.max[k].max(o.max[k]);
        }
    }

    /// Half the surface area; 0 of an empty box.
    fn area(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|k| (self.max[k] - self.min[k]).max(0.0));
        x * y + y * z + z * x
    }

    fn of(primitives: &[Primitive]) -> Self {
        let mut b = Self::EMPTY;
        primitives.iter().for_each(|p| b.grow(&p.bounds()));
        b
    }
}

/// Primitives that belong together: a run of all.
#[derive(Clone, Copy)]
struct Range {
    start: u32,
    end: u32,
    bounds: Box3,
}

impl Range {
    const NONE: Self = Self { start: 0, end: 0, bounds: Box3::EMPTY };

    fn of(primitives: &[Primitive], start: usize, end: usize) -> Self {
        let bounds = Box3::of(primitives.get(start..end).unwrap_or(&[]));
        Self { start: start as u32, end: end as u32, bounds }
    }

    fn len(&self) -> usize {
        (self.end - self.start) as usize
    }
}

/// A range that waits to become the child `slot` of node `parent`, at `level`.
#[derive(Clone, Copy)]
struct Waiting {
    range: Range,
    parent: u32,
    slot: u32,
    level: u32,
}

/// Levels of nodes over `n` primitives if each halves them three times.
fn levels(n: usize, leaf: usize) -> u32 {
    let (mut levels, mut holds) = (1u32, leaf.saturating_mul(WIDTH));
    while holds < n {
        holds = holds.saturating_mul(WIDTH);
        levels += 1;
    }
    levels
}

fn build<const LEAF: usize>(
    primitives: &mut [Primitive],
    nodes: &mut [Node],
    first: u32,
    mut leaf: impl FnMut(&[Primitive]) -> Result<u32, BuildError>,
) -> Result<Built, BuildError> {
    let room = nodes.len();
    let mut kept = 0;
    for i in 0..primitives.len() {
        if primitives[i].is_sound() {
            primitives.swap(kept, i);
            kept += 1;
        }
    }
    let Some(primitives) = primitives.get_mut(..kept).filter(|t| !t.is_empty()) else { return Ok(Built::default()) };
    let whole = Range::of(primitives, 0, primitives.len());
    let mut built = Built { bounds: [whole.bounds.min, whole.bounds.max], ..Built::default() };
    let root = Waiting { range: whole, parent: NONE, slot: 0, level: 1 };
    let mut waiting = [root; WAITING];
    let mut sp = 1;
    while sp > 0 {
        sp -= 1;
        let Waiting { range, parent, slot, level } = waiting[sp];
        let own = primitives.get_mut(range.start as usize..range.end as usize).unwrap_or(&mut []);
        let reference = if own.len() <= LEAF && parent != NONE {
            built.leaves += 1;
            leaf(own)?
        } else {
            let index = built.nodes;
            let node = nodes.get_mut(index as usize).ok_or(BuildError::Nodes { room })?;
            let number = first.checked_add(index).filter(|i| *i < LEAF_BIT);
            let number = number.ok_or(BuildError::Nodes { room: index as usize })?;
            *node = Node { bounds: [[0.0; 8]; 6], child: [NONE; 8], reserved: [0; 8] };
            for k in 0..3 {
                (node.bounds[k], node.bounds[k + 3]) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
            }
            built.nodes += 1;
            built.depth = built.depth.max(level);
            let (ranges, count) = divide::<LEAF>(primitives, range, level);
            for (slot, range) in ranges.iter().enumerate().take(count).rev() {
                waiting[sp] = Waiting { range: *range, parent: index, slot: slot as u32, level: level + 1 };
                sp += 1;
            }
            number
        };
        if let Some(parent) = nodes.get_mut(parent as usize) {
            let slot = slot as usize & 7;
            parent.child[slot] = reference;
            for k in 0..3 {
                parent.bounds[k][slot] = range.bounds.min[k];
                parent.bounds[k + 3][slot] = range.bounds.max[k];
            }
        }
    }
    Ok(built)
}

/// The children of a node at `level` over `range`: how many there are, in the order of their slots.
fn divide<const LEAF: usize>(primitives: &mut [Primitive], range: Range, level: u32) -> ([Range; WIDTH], usize) {
    let mut ranges = [Range::NONE; WIDTH];
    ranges[0] = range;
    let mut count = 1;
    let halve = level + levels(range.len(), LEAF) > MAX_TREE_DEPTH;
    while count < WIDTH {
        let large = |p: &Range| if halve { p.len() as f32 } else { p.bounds.area() };
        let mut best: Option<(usize, f32)> = None;
        for (i, p) in ranges.iter().enumerate().take(count).filter(|(_, p)| p.len() > LEAF) {
            if best.is_none_or(|(_, size)| large(p) > size) {
                best = Some((i, large(p)));
            }
        }
        // leaves are split further where that leaves less area to be met
        let split = match best {
            Some((i, _)) => Some((i, split::<LEAF>(primitives, &ranges[i], halve))),
            None if halve => None,
            None => tighten(primitives, &ranges, count),
        };
        let Some((i, at)) = split else { break };
        let Range { start, end, .. } = ranges[i];
        ranges[i] = Range::of(primitives, start as usize, at);
        ranges[count] = Range::of(primitives, at, end as usize);
        count += 1;
    }
    // any-hit rays try slots in this order: most hits for the least work. Few ranges, and equal ones stay in order
    let before = |a: &Range, b: &Range| match (a.len() <= LEAF, b.len() <= LEAF) {
        (true, false) => true,
        (false, true) => false,
        _ => a.bounds.area() > b.bounds.area(),
    };
    for i in 1..count {
        let mut j = i;
        while j > 0 && before(&ranges[j], &ranges[j - 1]) {
            ranges.swap(j, j - 1);
            j -= 1;
        }
    }
    (ranges, count)
}

/// The leaf, and where to split it, for which both halves together have the least area against it; if any has less.
fn tighten(primitives: &mut [Primitive], ranges: &[Range; WIDTH], count: usize) -> Option<(usize, usize)> {
    let mut best: Option<(usize, f32)> = None;
    for (i, range) in ranges.iter().enumerate().take(count).filter(|(_, p)| p.len() > 1) {
        let own = primitives.get_mut(range.start as usize..range.end as usize)?;
        let (_, _, cost) = sweep::<1>(own, false)?;
        let gain = range.bounds.area() - cost;
        if gain > 0.0 && best.is_none_or(|(_, most)| gain > most) {
            best = Some((i, gain));
        }
    }
    let (i, _) = best?;
    let range = ranges[i];
    let own = primitives.get_mut(range.start as usize..range.end as usize)?;
    let (axis, at, _) = sweep::<1>(own, false)?;
    sort(own, axis);
    Some((i, range.start as usize + at))
}

/// Orders the primitives of a range so that it can be split, and says where.
fn split<const LEAF: usize>(primitives: &mut [Primitive], range: &Range, halve: bool) -> usize {
    let start = range.start as usize;
    let middle = range.len().div_ceil(2);
    let Some(own) = primitives.get_mut(start..range.end as usize) else { return start + middle };
    let centres =
        |f: fn(f32, f32) -> f32, from: f32| own.iter().fold([from; 3], |c, p| [0, 1, 2].map(|k| f(c[k], p.centre(k))));
    let (low, high) = (centres(f32::min, f32::INFINITY), centres(f32::max, f32::NEG_INFINITY));
    let widest = (0..3).fold(0, |m, k| if high[k] - low[k] > high[m] - low[m] { k } else { m });
    if high[widest] <= low[widest] {
        return start + middle;
    }
    if halve {
        own.select_nth_unstable_by(middle, |a, b| order(a, b, widest));
        return start + middle;
    }
    if own.len() <= SWEEP {
        let Some((axis, at, _)) = sweep::<LEAF>(own, true) else { return start + middle };
        sort(own, axis);
        return start + at;
    }
    match binned::<LEAF>(own, low, high) {
        Some((axis, bin)) => start + partition(own, |p| bin_of(p, axis, low, high) < bin),
        None => {
            own.select_nth_unstable_by(middle, |a, b| order(a, b, widest));
            start + middle
        }
    }
}

/// By centre, then by id: a total order, so that unstable sorts give one result.
fn order(a: &Primitive, b: &Primitive, axis: usize) -> core::cmp::Ordering {
    a.centre(axis).total_cmp(&b.centre(axis)).then(a.id.cmp(&b.id))
}

fn sort(primitives: &mut [Primitive], axis: usize) {
    primitives.sort_unstable_by(|a, b| order(a, b, axis));
}

/// How many leaves of `LEAF` primitives `n` primitives fill.
fn fill<const LEAF: usize>(n: usize) -> f32 {
    n.div_ceil(LEAF) as f32
}

/// The best place to split up to [`SWEEP`] primitives: axis, primitives before it, cost. `weigh`: areas times leaves, else areas
/// alone. The order of the primitives changes.
fn sweep<const LEAF: usize>(primitives: &mut [Primitive], weigh: bool) -> Option<(usize, usize, f32)> {
    let n = primitives.len();
    let weight = |n: usize| if weigh { fill::<LEAF>(n) } else { 1.0 };
    let mut best: Option<(usize, usize, f32)> = None;
    let mut before = [0.0f32; SWEEP];
    for axis in 0..3 {
        sort(primitives, axis);
        let mut b = Box3::EMPTY;
        for (area, p) in before.iter_mut().zip(primitives.iter()) {
            b.grow(&p.bounds());
            *area = b.area();
        }
        let mut b = Box3::EMPTY;
        for at in (1..n.min(SWEEP)).rev() {
            b.grow(&primitives[at].bounds());
            let cost = before[at - 1] * weight(at) + b.area() * weight(n - at);
            if best.is_none_or(|(_, _, least)| cost < least) {
                best = Some((axis, at, cost));
            }
        }
    }
    best
}

/// Bin of a primitive along an axis on which not all centres are equal.
fn bin_of(p: &Primitive, axis: usize, low: [f32; 3], high: [f32; 3]) -> usize {
    let scale = BINS as f32 / (high[axis] - low[axis]);
    // a conversion saturates, and makes 0 of NaN
    (((p.centre(axis) - low[axis]) * scale) as usize).min(BINS - 1)
}

/// The best plane between bins: axis, and the first bin behind it.
fn binned<const LEAF: usize>(primitives: &[Primitive], low: [f32; 3], high: [f32; 3]) -> Option<(usize, usize)> {
    let mut bins = [[(Box3::EMPTY, 0usize); BINS]; 3];
    for p in primitives {
        for (axis, bins) in bins.iter_mut().enumerate() {
            let bin = &mut bins[bin_of(p, axis, low, high) & (BINS - 1)];
            bin.0.grow(&p.bounds());
            bin.1 += 1;
        }
    }
    let mut best: Option<(usize, usize, f32)> = None;
    for (axis, bins) in bins.iter().enumerate().filter(|(axis, _)| high[*axis] > low[*axis]) {
        let (mut before, mut b, mut n) = ([(0.0f32, 0usize); BINS], Box3::EMPTY, 0);
        for (before, bin) in before.iter_mut().zip(bins) {
            b.grow(&bin.0);
            n += bin.1;
            *before = (b.area(), n);
        }
        let (mut b, mut n) = (Box3::EMPTY, 0);
        for at in (1..BINS).rev() {
            b.grow(&bins[at].0);
            n += bins[at].1;
            let (area, m) = before[at - 1];
            if n == 0 || m == 0 {
                continue;
            }
            let cost = area * fill::<LEAF>(m) + b.area() * fill::<LEAF>(n);
            if best.is_none_or(|(_, _, least)| cost < least) {
                best = Some((axis, at, cost));
            }
        }
    }
    best.map(|(axis, at, _)| (axis, at))
}

/// Brings those for which `first` holds to the front; returns how many.
fn partition(primitives: &mut [Primitive], first: impl Fn(&Primitive) -> bool) -> usize {
    let mut count = 0;
    for i in 0..primitives.len() {
        if first(&primitives[i]) {
            primitives.swap(count, i);
            count += 1;
        }
    }
    count
}

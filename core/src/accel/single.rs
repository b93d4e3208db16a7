//! Traversal of the tree by single rays, eight boxes or eight triangles at a time, several rays in turn.
//!
//! ```text
//! for each ray in turn, until all are done:
//!     at a leaf: keep the closest hit of its triangles
//!     at a node: of the children that the ray enters before the closest hit so far
//!         the nearest is next, the others go to the ray's stack
//!     none: next is the top of the stack, unless it is behind the closest hit
//! ```
//!
//! 1. The nearest child is walked at once, the others go to the stack in the order of their slots. All eight are
//!    written, and those that are not met overwritten: what a ray meets is hard to predict, and a wrong guess costs
//!    more than the eight writes. The same for triangles: all is computed, then selected. Only whether a closest ray
//!    meets nothing at all is a branch; without it, such nodes cost more. Sorted stacks save 1 % of the nodes and 3 %
//!    of the leaves, but not their own cost.
//! 2. Entry and child share a `u64`: one read, one write. Entries are never negative, so their bits compare like them.
//! 3. Any hit: no order but that of the slots, the first hit that blocks ends it.
//! 4. A hit counts from `max(t, entry of its leaf)`: so a subtree entered after the closest hit holds nothing closer,
//!    not even by rounding, and the result does not depend on the order of visits. Equal t: the lower triangle index.
//! 5. While one ray waits for a node or a leaf from memory, the processor already works on the next ray; in large trees
//!    what a ray visits in its next turn is prefetched. Rays share one stack of the full size: a ray that fills its
//!    eighth begins anew with all of it, and (4) gives the same result. Dropped: nodes of all rays first and then leaves,
//!    reading what is next in place of a prefetch (slower).

use super::blocking::Blocking;
use super::setup::{Setup, each};
use super::triangle::{Line, intersect};
use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, NONE, Node};
use croupier_simd::{F32x8, Mask8, U32x8, prefetch};

/// Entries of the traversal stack: 7 siblings per level of a tree of
/// [`MAX_TREE_DEPTH`](crate::scene::blob::MAX_TREE_DEPTH) levels fit, and one that is written but not kept.
pub(super) const STACK: usize = 256;

/// Node tables longer than this, of all trees of a scene, are prefetched: with their leaves they have some 2 MB or more,
/// which does not stay in the fast caches.
const LARGE: usize = 1024;
/// Cache lines of a node or leaf that are prefetched. With four no further gain was found.
const AHEAD: usize = 2;

/// Entry distance (upper half, float bits) and child reference of the subtrees to visit.
pub(super) type Keys = [u64; STACK];

/// A closest hit. `t` is the limit before the first, never negative: single rays compare its bits.
#[derive(Clone, Copy)]
pub(super) struct Hit1 {
    pub t: f32,
    pub triangle: u32,
    pub u: f32,
    pub v: f32,
}

/// Closest hits by lane.
pub(super) struct Hits {
    pub t: [f32; 8],
    pub triangle: [u32; 8],
    pub u: [f32; 8],
    pub v: [f32; 8],
}

impl Hits {
    /// Hits of rays that have not hit anything yet: limits up to and including `limit`.
    #[inline(always)]
    pub(super) fn none(limit: [f32; 8]) -> Self {
        Self { t: limit, triangle: [NONE; 8], u: [0.0; 8], v: [0.0; 8] }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, h: &Hit1) {
        (self.t[i], self.triangle[i], self.u[i], self.v[i]) = (h.t, h.triangle, h.u, h.v);
    }
}

/// Tests lane `i` of `s` against the triangles of `leaf`, which it enters at `entry`. Closest: improves `best`, returns
/// whether it did. Any: returns whether there is a hit at or before `best.t`. `EARLY`: see [`intersect`].
#[inline(always)]
pub(super) fn test_leaf<const ANY: bool, const EARLY: bool, B: Blocking>(
    leaf: &Leaf,
    s: &Setup,
    i: usize,
    entry: f32,
    best: &mut Hit1,
    blocking: &mut B,
) -> bool {
    let axes = s.axes(i);
    let line = Line {
        o: each(|k| F32x8::splat(s.o[axes[k]][i])),
        shear: each(|k| F32x8::splat(s.shear[k][i])),
        tmin: F32x8::splat(s.tmin[i]),
        setup: s,
        axes,
        lane: Some(i),
    };
    let p = each(|v| each(|k| F32x8::new(leaf.p[3 * v + axes[k]])));
    let Some(c) = intersect::<ANY, EARLY>(&p, &line, F32x8::splat(best.t)) else { return false };
    if ANY {
        // each is asked, so that all that let the ray pass are counted
        return if B::ALL {
            c.mask.any()
        } else {
            c.mask.lanes().fold(false, |hit, k| hit | blocking.blocks(leaf.triangle[k], 1 << i))
        };
    }
    let t = c.mask.select(F32x8::splat(entry).max(c.t), F32x8::INFINITY);
    let nearest = t.min_lane();
    let (ids, u, v) = (&leaf.triangle, c.u.to_array(), c.v.to_array());
    let equal = (c.mask & t.eq(F32x8::splat(nearest))).bits();
    let mut slot = equal.trailing_zeros() as usize & 7;
    if equal.count_ones() > 1 {
        for k in Mask8::from_bits(equal).lanes() {
            if ids[k] < ids[slot] {
                slot = k;
            }
        }
    }
    // infinite without a hit; hits have t > 0, whose bits compare like the numbers
    let closer = key(nearest, ids[slot]) < key(best.t, best.triangle);
    let pick = |a: f32, b: f32| f32::from_bits(if closer { a.to_bits() } else { b.to_bits() });
    *best = Hit1 {
        t: pick(nearest, best.t),
        triangle: if closer { ids[slot] } else { best.triangle },
        u: pick(u[slot], best.u),
        v: pick(v[slot], best.v),
    };
    closer
}

/// Orders by `x` (not negative), then by `y`.
#[inline(always)]
pub(super) fn key(x: f32, y: u32) -> u64 {
    u64::from(x.to_bits()) << 32 | u64::from(y)
}

/// Walks the subtree `root` with the rays `lanes` of `s`, which enter it at `entry`. Closest: improves `hits`. Any:
/// returns the lanes with a hit at or before `hits.t`; each stops at its first.
pub(super) fn walk<const ANY: bool, B: Blocking>(
    tree: (&[Node], &[Leaf]),
    root: (u32, &[f32; 8]),
    (s, lanes): (&Setup, u32),
    hits: &mut Hits,
    stack: &mut Keys,
    blocking: &mut B,
) -> u32 {
    // where code must be small, there is only the loop that gives a ray the whole stack
    let (mut found, deep) = match cfg!(feature = "compact") {
        true => (0, lanes),
        false => take_turns::<ANY, { STACK / 8 }, B>(tree, root, (s, lanes), hits, stack, blocking),
    };
    for i in Mask8::from_bits(deep).lanes() {
        found |= take_turns::<ANY, STACK, B>(tree, root, (s, 1 << i), hits, stack, blocking).0;
    }
    found
}

/// [`walk`] with `ROOM` entries of the stack for each ray. Returns the lanes with any hit, and those that need more
/// room: their `hits` are real, though perhaps not the closest.
#[inline(never)]
fn take_turns<const ANY: bool, const ROOM: usize, B: Blocking>(
    (nodes, leaves): (&[Node], &[Leaf]),
    (root, entry): (u32, &[f32; 8]),
    (s, lanes): (&Setup, u32),
    hits: &mut Hits,
    stack: &mut Keys,
    blocking: &mut B,
) -> (u32, u32) {
    let mut current: [u64; 8] = core::array::from_fn(|i| key(entry[i], root));
    let mut tops = [0usize; 8];
    let tables: [&[u8]; 2] = [bytemuck::cast_slice(nodes), bytemuck::cast_slice(leaves)];
    let is_large = nodes.len() > LARGE;
    let read_ahead = |child: u32| {
        if is_large {
            // without a branch on what cannot be predicted
            let kind = usize::from(child & LEAF_BIT != 0);
            let size = [size_of::<Node>(), size_of::<Leaf>()][kind];
            // trees that were not checked may hold any index
            prefetch::<AHEAD>(tables[kind], ((child & CHILD_INDEX) as usize).wrapping_mul(size));
        }
    };
    let (mut live, mut found, mut deep) = (lanes, 0u32, 0u32);
    while live != 0 {
        for i in Mask8::from_bits(live).lanes() {
            let base = i * ROOM;
            let mut sp = tops[i];
            let child = current[i] as u32;
            if child & LEAF_BIT == 0 {
                if let Some(node) = nodes.get(child as usize) {
                    let low = s.rows(i);
                    let b = &node.bounds;
                    let ninv = each(|k| F32x8::splat(s.ninv[k][i]));
                    let near = |k: usize| (F32x8::splat(s.near[k][i]) - F32x8::new(b[low[k]])) * ninv[k];
                    let far = |k: usize| (F32x8::splat(s.far[k][i]) - F32x8::new(b[2 * k + 3 - low[k]])) * ninv[k];
                    let enter = F32x8::splat(s.tmin[i]).max(near(0)).max(near(1).max(near(2)));
                    let leave = F32x8::splat(hits.t[i]).min(far(0)).min(far(1).min(far(2)));
                    let met = enter.le(leave);
                    let m = met.bits();
                    if ANY || m != 0 {
                        if sp + 8 > ROOM {
                            deep |= 1 << i;
                            live &= !(1 << i);
                            continue;
                        }
                        let mut push = |keep: u32, c: usize, key: u64| {
                            stack[(base + sp) & (STACK - 1)] = key;
                            // what is not kept is overwritten by the next
                            sp += (keep >> c & 1) as usize;
                        };
                        if ANY {
                            for c in (0..8).rev() {
                                push(m, c, u64::from(node.child[c]));
                            }
                        } else {
                            // the slot's number takes the place of the entry's last bits: ties go to the first
                            let slots = U32x8::new([0, 1, 2, 3, 4, 5, 6, 7]);
                            let order = enter.to_bits() & U32x8::splat(!7) | slots;
                            let order = U32x8::select(met, order, U32x8::splat(u32::MAX));
                            let nearest = order.min_lane() as usize & 7;
                            let enter = enter.to_array();
                            let keys: [u64; 8] = core::array::from_fn(|c| key(enter[c], node.child[c]));
                            let rest = m & !(1 << nearest);
                            for (c, key) in keys.into_iter().enumerate() {
                                push(rest, c, key);
                            }
                            (current[i], tops[i]) = (keys[nearest], sp);
                            read_ahead(current[i] as u32);
                            continue;
                        }
                    }
                }
            } else if let Some(leaf) = leaves.get((child & CHILD_INDEX) as usize) {
                let mut best = Hit1 { t: hits.t[i], triangle: hits.triangle[i], u: hits.u[i], v: hits.v[i] };
                let entry = f32::from_bits((current[i] >> 32) as u32);
                let hit = test_leaf::<ANY, false, B>(leaf, s, i, entry, &mut best, blocking);
                if !ANY {
                    hits.set(i, &best);
                } else if hit {
                    found |= 1 << i;
                    live &= !(1 << i);
                    continue;
                }
            }
            let limit = hits.t[i];
            loop {
                if sp == 0 {
                    live &= !(1 << i);
                    break;
                }
                sp -= 1;
                let key = stack[(base + sp) & (STACK - 1)];
                // an entry equal to the closest t may hold an equal hit with a lower index
                if ANY || f32::from_bits((key >> 32) as u32) <= limit {
                    (current[i], tops[i]) = (key, sp);
                    read_ahead(current[i] as u32);
                    break;
                }
            }
        }
    }
    (found, deep)
}

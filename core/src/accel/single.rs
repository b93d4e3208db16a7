//! One ray against the tree, eight boxes or eight triangles at a time.
//!
//! ```text
//! closest(node):
//!     for each child that the ray enters before the closest hit so far, nearest first:
//!         leaf: keep the closest hit of its triangles
//!         node: closest(child)
//! ```
//!
//! 1. The nearest child is walked at once, the others go to the stack sorted by entry (insertion sort: seldom more than
//!    three). Lazily sorted stacks were slower or equal.
//! 2. Entry and child share a `u64`, so that keys compare as integers (entries are never negative).
//! 3. Any hit: no order, the first hit ends it.
//! 4. A hit counts from `max(t, entry of its leaf)`: so a subtree entered after the closest hit holds nothing closer, not
//!    even by rounding, and the result does not depend on the order of visits. Equal t: the lower triangle index.

use super::setup::{Setup, each};
use super::triangle::{Line, intersect};
use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, NONE, Node};
use croupier_simd::F32x8;

/// Entries of the traversal stack: 7 siblings per level of a tree of
/// [`MAX_TREE_DEPTH`](crate::scene::blob::MAX_TREE_DEPTH) levels fit.
pub(super) const STACK: usize = 256;

/// Entry distance (upper half, float bits) and child reference of the subtrees to visit.
pub(super) type Keys = [u64; STACK];

/// Constants of one ray, one value in all lanes.
pub(super) struct Ray1<'a> {
    line: Line<'a>,
    near: [F32x8; 3],
    far: [F32x8; 3],
    ninv: [F32x8; 3],
    /// Rows of a node's near planes.
    rows: [usize; 3],
}

impl<'a> Ray1<'a> {
    /// Lane `i` of `s`.
    #[inline(always)]
    pub fn new(s: &'a Setup, i: usize) -> Self {
        let i = i & 7;
        let axes = s.axes(i);
        Self {
            line: Line {
                o: each(|k| F32x8::splat(s.o[axes[k]][i])),
                shear: each(|k| F32x8::splat(s.shear[k][i])),
                tmin: F32x8::splat(s.tmin[i]),
                setup: s,
                axes,
                lane: Some(i),
            },
            near: each(|k| F32x8::splat(s.near[k][i])),
            far: each(|k| F32x8::splat(s.far[k][i])),
            ninv: each(|k| F32x8::splat(s.ninv[k][i])),
            rows: s.rows(i),
        }
    }
}

/// A closest hit.
#[derive(Clone, Copy)]
pub(super) struct Hit1 {
    pub t: f32,
    pub triangle: u32,
    pub u: f32,
    pub v: f32,
}

impl Hit1 {
    /// No hit up to and including `limit`.
    pub fn none(limit: f32) -> Self {
        Self { t: limit, triangle: NONE, u: 0.0, v: 0.0 }
    }
}

/// The triangles of a leaf as the rows of `axes`.
#[inline(always)]
fn rows(leaf: &Leaf, axes: [usize; 3]) -> [[F32x8; 3]; 3] {
    each(|v| each(|k| F32x8::new(leaf.p[3 * v + axes[k]])))
}

/// Tests `r` against the triangles of `leaf`, which it enters at `entry`. Closest: improves `best`, returns whether it did.
/// Any: returns whether there is a hit at or before `best.t`.
#[inline(always)]
pub(super) fn test_leaf<const ANY: bool>(leaf: &Leaf, r: &Ray1<'_>, entry: f32, best: &mut Hit1) -> bool {
    let Some(c) = intersect::<ANY>(&rows(leaf, r.line.axes), &r.line, F32x8::splat(best.t)) else { return false };
    if ANY {
        return true;
    }
    let (t, mut found) = (F32x8::splat(entry).max(c.t).to_array(), false);
    for i in c.mask.lanes() {
        if t[i] < best.t || (t[i] == best.t && leaf.triangle[i] < best.triangle) {
            *best = Hit1 { t: t[i], triangle: leaf.triangle[i], u: c.u.lane(i), v: c.v.lane(i) };
            found = true;
        }
    }
    found
}

/// Walks the subtree `root`, which the ray enters at `entry`. Closest: improves `best`. Any: stops at the first hit and
/// returns whether there is one. Uses `stack` from `base` on.
#[inline(always)]
pub(super) fn walk<const ANY: bool>(
    (nodes, leaves): (&[Node], &[Leaf]),
    (root, entry): (u32, f32),
    r: &Ray1<'_>,
    best: &mut Hit1,
    stack: &mut Keys,
    base: usize,
) -> bool {
    let [n0, n1, n2] = r.rows;
    let [f0, f1, f2] = each(|k| 2 * k + 3 - r.rows[k]);
    let mut limit = F32x8::splat(best.t);
    let mut sp = base;
    let mut current = u64::from(entry.to_bits()) << 32 | u64::from(root);
    loop {
        let child = current as u32;
        if child & LEAF_BIT == 0 {
            if let Some(node) = nodes.get(child as usize) {
                let b = &node.bounds;
                let near = |row: usize, k: usize| (r.near[k] - F32x8::new(b[row])) * r.ninv[k];
                let far = |row: usize, k: usize| (r.far[k] - F32x8::new(b[row])) * r.ninv[k];
                let enter = r.line.tmin.max(near(n0, 0)).max(near(n1, 1).max(near(n2, 2)));
                let leave = limit.min(far(f0, 0)).min(far(f1, 1).min(far(f2, 2)));
                let mut m = enter.le(leave).bits();
                if m != 0 {
                    let enter = enter.to_array();
                    // any hit reads no entries
                    let bits = |i: usize| if ANY { 0 } else { u64::from(enter[i].to_bits()) << 32 };
                    let key = |i: usize| bits(i) | u64::from(node.child[i]);
                    let mut next = || {
                        let i = m.trailing_zeros() as usize & 7;
                        m &= m - 1;
                        (key(i), m != 0)
                    };
                    let (mut nearest, mut more) = next();
                    let start = sp;
                    while more {
                        let other;
                        (other, more) = next();
                        if ANY {
                            stack[sp & (STACK - 1)] = other;
                            sp += 1;
                            continue;
                        }
                        let mut later = other;
                        if other < nearest {
                            (nearest, later) = (other, nearest);
                        }
                        let mut p = sp;
                        while p > start && stack[(p - 1) & (STACK - 1)] < later {
                            stack[p & (STACK - 1)] = stack[(p - 1) & (STACK - 1)];
                            p -= 1;
                        }
                        stack[p & (STACK - 1)] = later;
                        sp += 1;
                    }
                    current = nearest;
                    continue;
                }
            }
        } else if let Some(leaf) = leaves.get((child & CHILD_INDEX) as usize) {
            let found = test_leaf::<ANY>(leaf, r, f32::from_bits((current >> 32) as u32), best);
            if ANY && found {
                return true;
            }
            limit = F32x8::splat(best.t);
        }
        loop {
            if sp == base {
                return false;
            }
            sp -= 1;
            current = stack[sp & (STACK - 1)];
            // an entry equal to the closest t may hold an equal hit with a lower index
            if ANY || f32::from_bits((current >> 32) as u32) <= best.t {
                break;
            }
        }
    }
}

//! Traversal of the tree by packets: up to eight rays of one octant and one major axis.
//!
//! ```text
//! packet(node):
//!     few rays left in it: each goes on as a single ray
//!     for each child that the interval of all rays meets, nearest first:
//!         the rays that enter it before their closest hits, if any: packet(child)
//! ```
//!
//! 1. The eight children are tested at once against intervals of the packet's origins and inverse directions, then
//!    eight rays at once against each survivor. Every step is monotone (see `setup`): the intervals never reject a
//!    child that one of the rays enters. Rays that look for any hit take the children in the order of their slots.
//! 2. A leaf costs one test per triangle (eight rays each) or one per ray (eight triangles each), whichever is fewer.
//! 3. The stack holds the interval's entry and where the child's box is, eight bytes. The rays are tested against the
//!    box when it is popped: fewer tests, as some are behind a hit by then, and a fifth of the memory of keeping their
//!    entries.

use super::blocking::Blocking;
use super::setup::{Setup, each};
use super::single::{Hit1, Hits, Keys, STACK, key, test_leaf, walk};
use super::triangle::{Line, intersect};
use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, Node};
use croupier_simd::{F32x8, Mask8, U32x8};

/// Groups of at most this many rays go as single rays; 3 to 7 differ by few %.
pub(super) const FEW: u32 = 5;

/// Closest hits of the packet.
struct Best {
    /// Limits: t of the closest hits; below every t in lanes that are done.
    t: F32x8,
    triangle: U32x8,
    u: F32x8,
    v: F32x8,
}

impl Best {
    #[inline(always)]
    fn load(h: &Hits) -> Self {
        Self { t: F32x8::new(h.t), triangle: U32x8::new(h.triangle), u: F32x8::new(h.u), v: F32x8::new(h.v) }
    }

    #[inline(always)]
    fn store(&self) -> Hits {
        Hits { t: self.t.to_array(), triangle: self.triangle.to_array(), u: self.u.to_array(), v: self.v.to_array() }
    }

    #[inline(always)]
    fn lane(&self, i: usize) -> Hit1 {
        Hit1 { t: self.t.lane(i), triangle: self.triangle.lane(i), u: self.u.lane(i), v: self.v.lane(i) }
    }

    /// Sets lane `i`, by selection: a read of eight lanes right after a write of one stalls the processor.
    #[inline(always)]
    fn set(&mut self, i: usize, h: &Hit1) {
        let lane = one(i);
        self.t = lane.select(F32x8::splat(h.t), self.t);
        self.triangle = U32x8::select(lane, U32x8::splat(h.triangle), self.triangle);
        self.u = lane.select(F32x8::splat(h.u), self.u);
        self.v = lane.select(F32x8::splat(h.v), self.v);
    }

    /// Ends the search of lane `i`.
    #[inline(always)]
    fn finish(&mut self, i: usize) {
        self.t = one(i).select(F32x8::splat(f32::NEG_INFINITY), self.t);
    }
}

/// Mask of lane `i`.
#[inline(always)]
fn one(i: usize) -> Mask8 {
    U32x8::splat(i as u32).eq(U32x8::new([0, 1, 2, 3, 4, 5, 6, 7]))
}

/// Walks the rays `group` of `s` (one octant, one major axis) from node `root`. Closest: improves `hits`. Any: returns the
/// lanes with a hit. `stack` is for single rays.
#[inline(never)]
pub(super) fn walk_packet<const ANY: bool, B: Blocking>(
    (tree, root): ((&[Node], &[Leaf]), u32),
    s: &Setup,
    group: u32,
    hits: &mut Hits,
    stack: &mut Keys,
    blocking: &mut B,
) -> u32 {
    let mut keys: Keys = [0; STACK];
    let lead = group.trailing_zeros() as usize & 7;
    let members = Mask8::from_bits(group);
    let axes = s.axes(lead);
    // lanes outside the group may hold anything: give them the values of the first ray
    let only = |a: &[[f32; 8]; 3]| each(|k| members.select(F32x8::new(a[k]), F32x8::splat(a[k][lead])));
    let (near, far, ninv) = (only(&s.near), only(&s.far), only(&s.ninv));
    let line = Line {
        o: each(|k| F32x8::new(s.o[axes[k]])),
        shear: each(|k| F32x8::new(s.shear[k])),
        tmin: F32x8::new(s.tmin),
        setup: s,
        axes,
        lane: None,
    };
    let low = s.rows(lead);
    let high = each(|k| 2 * k + 3 - low[k]);
    let negative = each(|k| low[k] > 2);
    // the earliest entry has the origin farthest along the direction, the latest exit the one farthest behind
    let bound = |v: F32x8, largest: bool| F32x8::splat(if largest { v.max_lane() } else { v.min_lane() });
    let in_o = each(|k| bound(near[k], !negative[k]));
    let out_o = each(|k| bound(far[k], negative[k]));
    let (inv_lo, inv_hi) = (each(|k| bound(ninv[k], false)), each(|k| bound(ninv[k], true)));
    let earliest = F32x8::splat(members.select(line.tmin, F32x8::INFINITY).min_lane());

    let never = F32x8::splat(f32::NEG_INFINITY);
    let before = Best::load(hits);
    let mut b = Best { t: members.select(before.t, never), ..before };
    let mut latest = b.t.max_lane();
    let (mut sp, mut child, mut entry, mut inside) = (0usize, root, line.tmin, members);
    let mut occluded = 0u32;
    'walk: loop {
        let rays = inside.bits();
        let n = rays.count_ones();
        let mut changed = false;
        if child & LEAF_BIT == 0 {
            if n <= FEW {
                let mut h = b.store();
                let found = walk::<ANY, B>(tree, (child, &entry.to_array()), (s, rays), &mut h, stack, blocking);
                if ANY {
                    occluded |= found;
                    b.t = Mask8::from_bits(found).select(never, b.t);
                } else {
                    b = Best::load(&h);
                }
                changed = true;
            } else if let Some(node) = tree.0.get(child as usize) {
                let rows = &node.bounds;
                let (mut enter, mut leave) = (earliest, F32x8::splat(latest));
                for k in 0..3 {
                    let x = in_o[k] - F32x8::new(rows[low[k]]);
                    let y = out_o[k] - F32x8::new(rows[high[k]]);
                    enter = enter.max((x * inv_lo[k]).min(x * inv_hi[k]));
                    leave = leave.min((y * inv_lo[k]).max(y * inv_hi[k]));
                }
                let met = enter.le(leave);
                let enter = enter.to_array();
                let start = sp;
                let mut left = met.bits();
                // any hit: the first slot on top
                while left != 0 {
                    let i = left.ilog2() as usize & 7;
                    left ^= 1 << i;
                    let key = key(enter[i], child << 3 | i as u32);
                    let mut p = sp;
                    while !ANY && p > start && keys[(p - 1) & (STACK - 1)] < key {
                        keys[p & (STACK - 1)] = keys[(p - 1) & (STACK - 1)];
                        p -= 1;
                    }
                    keys[p & (STACK - 1)] = key;
                    sp += 1;
                }
            }
        } else if let Some(leaf) = tree.1.get((child & CHILD_INDEX) as usize) {
            let triangles = (child >> 27 & 15).min(8);
            if n < triangles {
                for i in Mask8::from_bits(rays).lanes() {
                    let mut h = b.lane(i);
                    if test_leaf::<ANY, true, B>(leaf, s, i, entry.lane(i), &mut h, blocking) {
                        changed = true;
                        if ANY {
                            occluded |= 1 << i;
                            b.finish(i);
                        } else {
                            b.set(i, &h);
                        }
                    }
                }
            } else {
                for i in 0..triangles as usize {
                    let p = each(|v| each(|k| F32x8::splat(leaf.p[3 * v + axes[k]][i])));
                    let Some(c) = intersect::<ANY, true>(&p, &line, b.t) else { continue };
                    // rays that miss the leaf's box miss its triangles, also when they go on as single rays
                    let mask = c.mask & inside;
                    if ANY {
                        if !B::ALL && (mask.none() || !blocking.blocks(leaf.triangle[i], mask.bits())) {
                            continue;
                        }
                        occluded |= mask.bits();
                        b.t = mask.select(never, b.t);
                        changed = true;
                        continue;
                    }
                    let (t, id) = (entry.max(c.t), U32x8::splat(leaf.triangle[i]));
                    let mask = mask & (t.lt(b.t) | (t.eq(b.t) & id.lt(b.triangle)));
                    b.t = mask.select(t, b.t);
                    b.triangle = U32x8::select(mask, id, b.triangle);
                    b.u = mask.select(c.u, b.u);
                    b.v = mask.select(c.v, b.v);
                    changed = true;
                }
            }
        }
        if changed {
            latest = b.t.max_lane();
            if ANY && occluded == group {
                break 'walk;
            }
        }
        loop {
            if sp == 0 {
                break 'walk;
            }
            sp -= 1;
            let key = keys[sp & (STACK - 1)];
            let (parent, slot) = ((key as u32 >> 3) as usize, key as usize & 7);
            let Some(node) = tree.0.get(parent).filter(|_| f32::from_bits((key >> 32) as u32) <= latest) else {
                continue;
            };
            let mut leave = b.t;
            entry = line.tmin;
            for k in 0..3 {
                entry = entry.max((near[k] - F32x8::splat(node.bounds[low[k]][slot])) * ninv[k]);
                leave = leave.min((far[k] - F32x8::splat(node.bounds[high[k]][slot])) * ninv[k]);
            }
            inside = entry.le(leave);
            if inside.any() {
                child = node.child[slot];
                break;
            }
        }
    }
    if !ANY {
        b.t = members.select(b.t, before.t);
        *hits = b.store();
    }
    occluded
}

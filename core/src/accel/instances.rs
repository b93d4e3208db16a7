//! Traversal of top-level trees: instances of objects, and the world's own triangles among them.
//!
//! ```text
//! top(object, rays):
//!     for each child box that some of the rays enter before their closest hits, nearest first:
//!         a node:      its children, with the rays that enter it
//!         triangles:   the walk of triangle trees, with the same rays
//!         an instance: rays through the inverse of its map, directions not normalised, so that t stays; then
//!                      top(its object) or the walk of its triangles; the closest hits of both are merged
//! ```
//!
//! 1. Rays stay together as a set of lanes, of any octants. At a node each ray is tested against the eight boxes; the stack
//!    holds the nearest entry, node and slot. All rays are tested against a box again when it is popped: many are behind a
//!    hit by then, and the stack needs no entries and no sets.
//! 2. A hit counts from `max(t, entry of the instance's box)`, equal ones by the lower instance, those of no instance last:
//!    what comes out depends neither on the order of visits nor on other rays, as in a plain tree.
//! 3. Boxes are larger than what is in them by what rounding may do to rays on their way into an object: by a constant
//!    (`scene/instances.rs`), and by `16 u K |o|`, K the largest condition of the object's instances, which is
//!    added to the origins of the slabs as `setup` adds its own.

use super::blocking::Blocking;
use super::grouping::trace;
use super::setup::{Setup, each};
use super::single::{Hits, Keys, STACK, key};
use crate::geometry::{Map8, Ray8};
use crate::scene::blob::{
    CHILD_INDEX, INSTANCE_HIDDEN, Instance, LEAF_BIT, Leaf, MAX_INSTANCE_DEPTH, NONE, Node, Object,
};
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// What the walk reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Forest<'s> {
    pub nodes: &'s [Node],
    pub leaves: &'s [Leaf],
    pub objects: &'s [Object],
    pub instances: &'s [Instance],
}

/// Closest hits, and the instances around them by level.
pub(super) struct Found {
    pub hits: Hits,
    pub instance: [[u32; 8]; 2],
}

impl Found {
    /// No hits yet, and limits up to and including `limit`.
    pub(super) fn none(limit: [f32; 8]) -> Self {
        Self { hits: Hits::none(limit), instance: [[NONE; 8]; 2] }
    }

    /// Takes over what `other` has in the lanes `inside` that enter `child` at `entry`, if it is closer.
    fn merge(&mut self, other: &Self, level: usize, child: u32, inside: Mask8, entry: F32x8) {
        let entry = entry.to_array();
        for i in inside.lanes() {
            let h = &other.hits;
            if h.triangle[i] == NONE {
                continue;
            }
            let t = h.t[i].max(entry[i]);
            let here = self.instance[level & 1][i];
            if t < self.hits.t[i] || t == self.hits.t[i] && (self.hits.triangle[i] == NONE || child < here) {
                (self.hits.t[i], self.hits.triangle[i]) = (t, h.triangle[i]);
                (self.hits.u[i], self.hits.v[i]) = (h.u[i], h.v[i]);
                self.instance[1][i] = other.instance[1][i];
                self.instance[level & 1][i] = child;
            }
        }
    }
}

/// Largest |coordinate| of an object.
pub(super) fn extent(o: &Object) -> f32 {
    o.bounds_min.iter().chain(&o.bounds_max).fold(0.0, |m, x| x.abs().max(m))
}

impl Forest<'_> {
    /// Constants of rays in the space of `o`.
    #[inline(never)]
    pub(super) fn setup(o: &Object, rays: &Ray8, active: Mask8) -> Setup {
        let far = rays.o.abs().max_component() * (2.0 * o.condition);
        Setup::new(rays, active, far + extent(o))
    }

    /// Walks everything in `o` with the rays `lanes` of `s`, which are `rays` in its space. Closest: improves `found`. Any:
    /// returns the lanes with a hit that blocks.
    pub(super) fn walk<const ANY: bool, B: Blocking>(
        &self,
        (level, o): (usize, &Object),
        (s, rays, lanes): (&Setup, &Ray8, u32),
        found: &mut Found,
        stack: &mut Keys,
        blocking: &mut B,
    ) -> u32 {
        if o.instances == 0 {
            let tree = (self.nodes, self.leaves);
            return trace::<ANY, B>(tree, o.first_node, (s, lanes), &mut found.hits, stack, blocking);
        }
        self.top::<ANY, B>((level, o), (s, rays, lanes), found, stack, blocking)
    }

    #[inline(never)]
    fn top<const ANY: bool, B: Blocking>(
        &self,
        (level, o): (usize, &Object),
        (s, rays, lanes): (&Setup, &Ray8, u32),
        found: &mut Found,
        stack: &mut Keys,
        blocking: &mut B,
    ) -> u32 {
        let never = F32x8::splat(f32::NEG_INFINITY);
        let mut keys: Keys = [0; STACK];
        let (mut sp, mut node, mut inside) = (0usize, o.first_top, lanes);
        // limits: below every entry in lanes that are done
        let mut limit = Mask8::from_bits(lanes).select(F32x8::new(found.hits.t), never);
        let mut occluded = 0u32;
        let load = |rows: &[[f32; 8]; 3]| each(|k| F32x8::new(rows[k]));
        let (near, far, ninv, tmin) = (load(&s.near), load(&s.far), load(&s.ninv), F32x8::new(s.tmin));
        let negative = each(|k| Mask8::from_bits(s.negative[k]));
        'walk: loop {
            if let Some(n) = self.nodes.get(node as usize) {
                let entries = nearest(n, s, inside, &limit.to_array());
                let start = sp;
                let mut met = entries.lt(F32x8::INFINITY).bits();
                let entries = entries.to_array();
                while met != 0 && sp < STACK {
                    let i = met.ilog2() as usize & 7;
                    met ^= 1 << i;
                    let key = key(entries[i], node << 3 | i as u32);
                    let mut p = sp;
                    while p > start && keys[(p - 1) & (STACK - 1)] < key {
                        keys[p & (STACK - 1)] = keys[(p - 1) & (STACK - 1)];
                        p -= 1;
                    }
                    keys[p & (STACK - 1)] = key;
                    sp += 1;
                }
            }
            loop {
                if sp == 0 {
                    break 'walk;
                }
                sp -= 1;
                let key = keys[sp & (STACK - 1)];
                let (parent, slot) = ((key as u32 >> 3) as usize, key as usize & 7);
                let in_reach = f32::from_bits((key >> 32) as u32) <= limit.max_lane();
                let Some(n) = self.nodes.get(parent).filter(|_| in_reach) else { continue };
                let (mut entry, mut leave) = (tmin, limit);
                for k in 0..3 {
                    let (lo, hi) = (F32x8::splat(n.bounds[k][slot]), F32x8::splat(n.bounds[k + 3][slot]));
                    entry = entry.max((near[k] - negative[k].select(hi, lo)) * ninv[k]);
                    leave = leave.min((far[k] - negative[k].select(lo, hi)) * ninv[k]);
                }
                let enters = entry.le(leave) & Mask8::from_bits(lanes & !occluded);
                if enters.none() {
                    continue;
                }
                let child = n.child[slot];
                let mut other = Found::none(limit.to_array());
                let (hit, index) = if child & LEAF_BIT != 0 {
                    let index = child & CHILD_INDEX;
                    (self.instance::<ANY, B>(level, index, rays, enters, &mut other, stack, blocking), index)
                } else if child == o.first_node {
                    let tree = (self.nodes, self.leaves);
                    let lanes = (s, enters.bits());
                    (trace::<ANY, B>(tree, o.first_node, lanes, &mut other.hits, stack, blocking), NONE)
                } else {
                    (node, inside) = (child, enters.bits());
                    break;
                };
                if ANY {
                    occluded |= hit;
                    limit = Mask8::from_bits(hit).select(never, limit);
                    if occluded == lanes {
                        break 'walk;
                    }
                } else {
                    found.merge(&other, level, index, enters, entry);
                    limit = Mask8::from_bits(lanes).select(F32x8::new(found.hits.t), never);
                }
            }
        }
        occluded
    }

    /// Sends the rays `inside` through an instance.
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "a walk's own, and the instance")]
    fn instance<const ANY: bool, B: Blocking>(
        &self,
        level: usize,
        index: u32,
        rays: &Ray8,
        inside: Mask8,
        found: &mut Found,
        stack: &mut Keys,
        blocking: &mut B,
    ) -> u32 {
        let instance = self.instances.get(index as usize).filter(|i| i.flags & INSTANCE_HIDDEN == 0);
        let object = instance.and_then(|i| self.objects.get(i.object as usize));
        let (Some(i), Some(o)) = (instance, object) else { return 0 };
        let deeper = level + 1;
        if o.instances > 0 && deeper >= MAX_INSTANCE_DEPTH as usize {
            return 0;
        }
        let ([x, y, z], t) = Map8::inverse_of(i, rays.time);
        let turn = |v: Vec3x8| Vec3x8::new(dot(x, v), dot(y, v), dot(z, v));
        let rays = Ray8 { o: turn(rays.o - t), d: turn(rays.d), ..*rays };
        let s = Self::setup(o, &rays, inside);
        self.walk::<ANY, B>((deeper, o), (&s, &rays, s.valid), found, stack, blocking)
    }
}

/// Sum of three products, none of them fused: the error bound of `scene/instances.rs` counts its roundings.
#[inline(always)]
fn dot(a: Vec3x8, b: Vec3x8) -> F32x8 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Earliest entry of any of the rays `lanes` into each child of `n`, infinite where none enters before its limit.
#[inline(always)]
fn nearest(n: &Node, s: &Setup, lanes: u32, limit: &[f32; 8]) -> F32x8 {
    let mut first = F32x8::INFINITY;
    let b = &n.bounds;
    for i in Mask8::from_bits(lanes).lanes() {
        let low = s.rows(i);
        let ninv = each(|k| F32x8::splat(s.ninv[k][i]));
        let near = |k: usize| (F32x8::splat(s.near[k][i]) - F32x8::new(b[low[k]])) * ninv[k];
        let far = |k: usize| (F32x8::splat(s.far[k][i]) - F32x8::new(b[2 * k + 3 - low[k]])) * ninv[k];
        let enter = F32x8::splat(s.tmin[i]).max(near(0)).max(near(1).max(near(2)));
        let leave = F32x8::splat(limit[i]).min(far(0)).min(far(1).min(far(2)));
        first = first.min(enter.le(leave).select(enter, F32x8::INFINITY));
    }
    first
}

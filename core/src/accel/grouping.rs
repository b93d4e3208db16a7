//! Grouping of rays.
//!
//! Rays are grouped by direction octant and major axis; groups of more than [`FEW`] walk the tree as a packet, which
//! doubles the throughput of coherent rays; the others go one by one, which is best for incoherent ones.

use super::blocking::Blocking;
use super::packet::{FEW, walk_packet};
use super::setup::Setup;
use super::single::{Hits, Keys, walk};
use crate::scene::blob::{Leaf, Node};

/// Do groups walk as packets? Not where code must be small: single rays find the same hits.
const PACKETS: bool = !cfg!(feature = "compact");

/// Traces the rays `lanes` of `s` through the tree of triangles at node `root`. Closest: improves `hits`. Any: returns the
/// lanes with a hit that blocks.
#[inline(always)]
pub(super) fn trace<const ANY: bool, B: Blocking>(
    tree: (&[Node], &[Leaf]),
    root: u32,
    (s, lanes): (&Setup, u32),
    hits: &mut Hits,
    stack: &mut Keys,
    blocking: &mut B,
) -> u32 {
    let (mut left, mut single, mut occluded) = (lanes, 0, 0);
    while left != 0 {
        let group = s.alike(left.trailing_zeros() as usize & 7, left);
        left &= !group;
        if !PACKETS || group.count_ones() <= FEW {
            single |= group;
        } else {
            occluded |= walk_packet::<ANY, B>((tree, root), s, group, hits, stack, blocking);
        }
    }
    if single != 0 {
        occluded |= walk::<ANY, B>(tree, (root, &s.tmin), (s, single), hits, stack, blocking);
    }
    occluded
}

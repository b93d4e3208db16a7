//! Triangles that the builder of the binary tree takes as one.

use super::node::Bounds;
use rayon::prelude::*;
use std::array;
use std::ops::Range;

/// Most area of the box of a pair of triangles, over the sum of those of their boxes.
const PAIR_AREA: f64 = 0.75;

/// Place of triangles that are in the group of another, or not finite, and of those without others of their box.
const NOWHERE: (u32, u32) = (0, 0);
const ALONE: (u32, u32) = (u32::MAX, u32::MAX);

/// The finite triangles in groups, by ascending first triangle: those of equal boxes, and, if asked for, pairs that follow
/// each other and share an edge.
///
/// PLOC merges nearest neighbours: among equal boxes hardly any two choose each other, and it would need as many passes as
/// there are boxes. The two halves of a quadrilateral it would merge first anyway: in meshes of those it is spared the
/// longest of its passes.
pub(super) struct Groups {
    pub(super) boxes: Vec<Bounds>,
    /// Triangles, group by group, each ascending.
    pub(super) triangles: Vec<u32>,
    /// Where each group ends in `triangles`.
    ends: Vec<u32>,
    /// Do groups of two stay together?
    pairs: bool,
}

impl Groups {
    pub(super) fn of(corners: &[[[f32; 3]; 3]], pairs: bool) -> Self {
        let bounds = |(id, t): (usize, &[[f32; 3]; 3])| {
            let finite = t.as_flattened().iter().all(|x| x.is_finite());
            finite.then(|| (hash(&Bounds::of(t)), id as u32))
        };
        let mut sorted: Vec<(u64, u32)> = corners.par_iter().enumerate().filter_map(bounds).collect();
        sorted.par_sort_unstable();
        // where the groups of several triangles are in `shared`, by their first, and of all others whether they begin one
        let (mut shared, mut places) = (Vec::new(), vec![NOWHERE; corners.len()]);
        for alike in sorted.chunk_by(|x, y| x.0 == y.0) {
            if let [(_, id)] = alike {
                places[*id as usize] = ALONE;
                continue;
            }
            // boxes of one hash may differ
            let mut alike: Vec<_> =
                alike.iter().map(|(_, id)| (bits(&Bounds::of(&corners[*id as usize])), *id)).collect();
            alike.sort_unstable();
            for group in alike.chunk_by(|x, y| x.0 == y.0) {
                let from = shared.len() as u32;
                shared.extend(group.iter().map(|x| x.1));
                places[group[0].1 as usize] = if group.len() == 1 { ALONE } else { (from, shared.len() as u32) };
            }
        }
        let finite = sorted.len();
        let mut out = Self {
            boxes: Vec::with_capacity(finite),
            triangles: Vec::with_capacity(finite),
            ends: Vec::with_capacity(finite),
            pairs,
        };
        let mut paired = false;
        for (i, &place) in places.iter().enumerate() {
            if std::mem::take(&mut paired) || place == NOWHERE {
                continue;
            }
            let mut bounds = Bounds::of(&corners[i]);
            if place == ALONE {
                out.triangles.push(i as u32);
                let with_next = pairs && places.get(i + 1) == Some(&ALONE);
                if let Some(both) = with_next.then(|| pair(&corners[i], &corners[i + 1])).flatten() {
                    (bounds, paired) = (both, true);
                    out.triangles.push(i as u32 + 1);
                }
            } else {
                out.triangles.extend(&shared[place.0 as usize..place.1 as usize]);
            }
            out.boxes.push(bounds);
            out.ends.push(out.triangles.len() as u32);
        }
        out
    }

    /// Places of a group's triangles, and whether they stay together: if not, all have the group's box.
    pub(super) fn places(&self, group: usize) -> (Range<u32>, bool) {
        let from = if group == 0 { 0 } else { self.ends[group - 1] };
        let places = from..self.ends[group];
        let pair = self.pairs && places.len() == 2;
        (places, pair)
    }
}

/// Bits of a box's coordinates.
fn bits(b: &Bounds) -> [u32; 6] {
    array::from_fn(|k| if k < 3 { b.min[k] } else { b.max[k - 3] }.to_bits())
}

/// A hash of a box, which is sooner sorted than boxes are.
fn hash(b: &Bounds) -> u64 {
    bits(b).iter().fold(0, |h: u64, x| (h.rotate_left(25) ^ u64::from(*x)).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

/// The box of two triangles that are better off together: they share an edge, and their boxes overlap.
fn pair(a: &[[f32; 3]; 3], b: &[[f32; 3]; 3]) -> Option<Bounds> {
    let shared = a.iter().filter(|p| b.contains(p)).count();
    let (of_a, of_b) = (Bounds::of(a), Bounds::of(b));
    let both = of_a.with(&of_b);
    (shared == 2 && both.half_area() <= PAIR_AREA * (of_a.half_area() + of_b.half_area())).then_some(both)
}

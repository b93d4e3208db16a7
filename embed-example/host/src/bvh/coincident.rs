//! Triangles with the same box.

use super::node::Bounds;
use rayon::prelude::*;
use std::array;

/// The finite triangles grouped by equal boxes, by ascending first triangle. PLOC merges nearest neighbours: among equal
/// boxes hardly any two choose each other, and it would need as many passes as there are boxes.
pub(super) struct Groups {
    pub(super) boxes: Vec<Bounds>,
    /// Triangles, group by group, each ascending.
    triangles: Vec<u32>,
    /// Where each group ends in `triangles`.
    ends: Vec<u32>,
}

impl Groups {
    pub(super) fn of(triangles: &[[[f32; 3]; 3]]) -> Self {
        let bounds = |(id, t): (usize, &[[f32; 3]; 3])| {
            let b = Bounds::of(t);
            let finite = t.as_flattened().iter().all(|x| x.is_finite());
            finite.then(|| (array::from_fn(|k| if k < 3 { b.min[k] } else { b.max[k - 3] }.to_bits()), id as u32))
        };
        let mut sorted: Vec<([u32; 6], u32)> = triangles.par_iter().enumerate().filter_map(bounds).collect();
        sorted.par_sort_unstable();
        // places of the group that begins with a triangle
        let mut places = vec![0..0; triangles.len()];
        let mut from = 0;
        for group in sorted.chunk_by(|x, y| x.0 == y.0) {
            places[group[0].1 as usize] = from..from + group.len();
            from += group.len();
        }
        let mut out = Self {
            boxes: Vec::with_capacity(from),
            triangles: Vec::with_capacity(from),
            ends: Vec::with_capacity(from),
        };
        for (t, places) in triangles.iter().zip(places).filter(|(_, places)| !places.is_empty()) {
            out.boxes.push(Bounds::of(t));
            out.triangles.extend(sorted[places].iter().map(|x| x.1));
            out.ends.push(out.triangles.len() as u32);
        }
        out
    }

    /// Triangles of a group.
    pub(super) fn ids(&self, group: usize) -> &[u32] {
        let from = if group == 0 { 0 } else { self.ends[group - 1] };
        &self.triangles[from as usize..self.ends[group] as usize]
    }
}

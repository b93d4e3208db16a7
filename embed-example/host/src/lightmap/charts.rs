//! Charts: parts of a surface that hang together in the map.

use super::surface::Patch;
use std::collections::HashMap;

/// Bits of a corner: place in the map, position.
type Corner = [u32; 5];

fn corner(patch: &Patch, k: usize) -> Corner {
    let ([u, v], [x, y, z]) = (patch.uv[k], patch.corners[k]);
    // 0 and -0 are one place
    [u, v, x, y, z].map(|number| (number + 0.0).to_bits())
}

/// Number of each patch's chart, from 0 on in the order of the patches: patches are in one chart if they share an edge
/// in the map and in space, or others join them.
pub(super) fn charts(patches: &[Patch]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..patches.len() as u32).collect();
    let mut edges = HashMap::new();
    for (i, patch) in (0..).zip(patches) {
        for k in 0..3 {
            let (a, b) = (corner(patch, k), corner(patch, (k + 1) % 3));
            let other = *edges.entry((patch.object, patch.instance, a.min(b), a.max(b))).or_insert(i);
            let (a, b) = (root(&mut parent, i), root(&mut parent, other));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let (mut number, mut count) = (vec![0; patches.len()], 0);
    for i in 0..patches.len() as u32 {
        let root = root(&mut parent, i);
        if root == i {
            number[i as usize] = count;
            count += 1;
        } else {
            // roots come before what hangs on them
            number[i as usize] = number[root as usize];
        }
    }
    number
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        let above = parent[parent[i as usize] as usize];
        parent[i as usize] = above;
        i = above;
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: patches joined by a corner alone, by the map alone or by space alone; a chart of several joins that
    /// stays apart; numbers with gaps.
    #[test]
    fn edges_join_patches() {
        let at = |p: [f32; 2]| [p[0], p[1], 0.0];
        let patch = |uv: [[f32; 2]; 3]| Patch { triangle: 0, instance: 0, object: 0, uv, corners: uv.map(at) };
        let [a, b, c, d, e] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 0.0]];
        let strip = [patch([a, b, c]), patch([e, d, b]), patch([b, d, c])];
        assert_eq!(charts(&strip), [0, 0, 0]);
        assert_eq!(charts(&strip[..2]), [0, 1], "a corner");
        let mut lifted = strip;
        lifted[2].corners[2][2] = 1.0;
        lifted[2].uv[1] = [0.5, 0.5];
        assert_eq!(charts(&lifted), [0, 1, 2]);
        let mut other = strip;
        other[0].object = 1;
        assert_eq!(charts(&other), [0, 1, 1]);
    }
}

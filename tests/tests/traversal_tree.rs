//! The host's trees: every triangle once, every vertex in every box above it, bounded depth, the promised numbering.

use croupier::accel::{Intersector, Ray8, WideBvh};
use croupier::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, MAX_TREE_DEPTH, NONE, Node};
use croupier::simd::{F32x8, Mask8, Vec3x8};
use croupier_host::bvh::{Effort, Tree, build};
use croupier_tests::geometry::{Rng, Tri, soup, star};

/// Walks the tree depth first and checks all that its contract says; returns how often each triangle occurs.
fn check(tree: &Tree, triangles: &[Tri]) -> Vec<u32> {
    let mut seen = vec![0; triangles.len()];
    assert_eq!(tree.nodes.is_empty(), tree.leaves.is_empty());
    if tree.nodes.is_empty() {
        assert_eq!(tree.depth, 0);
        return seen;
    }
    // references in the order of a preorder walk, with the boxes above
    let (mut nodes, mut leaves, mut deepest) = (0u32, 0u32, 0);
    let mut todo: Vec<(u32, Vec<[f32; 6]>)> = vec![(0, Vec::new())];
    while let Some((child, boxes)) = todo.pop() {
        if child & LEAF_BIT == 0 {
            assert_eq!(child, nodes, "nodes are numbered depth first");
            nodes += 1;
            let node: &Node = &tree.nodes[child as usize];
            deepest = deepest.max(boxes.len() as u32 + 1);
            for slot in (0..8).rev() {
                let b: [f32; 6] = std::array::from_fn(|k| node.bounds[k][slot]);
                if node.child[slot] == NONE {
                    let (inf, none) = (f32::INFINITY, f32::NEG_INFINITY);
                    assert_eq!(b, [inf, inf, inf, none, none, none]);
                    continue;
                }
                let mut boxes = boxes.clone();
                boxes.push(b);
                todo.push((node.child[slot], boxes));
            }
            continue;
        }
        assert_eq!(child & CHILD_INDEX, leaves, "leaves are numbered depth first");
        leaves += 1;
        let (leaf, count): (&Leaf, _) = (&tree.leaves[(child & CHILD_INDEX) as usize], (child >> 27 & 15) as usize);
        assert!((1..=8).contains(&count));
        for slot in 0..8 {
            let p: [f32; 9] = std::array::from_fn(|k| leaf.p[k][slot]);
            if slot >= count {
                assert_eq!((leaf.triangle[slot], p), (NONE, [0.0; 9]));
                continue;
            }
            let id = leaf.triangle[slot] as usize;
            seen[id] += 1;
            assert_eq!(p, triangles[id].as_flattened());
            for (b, v) in boxes.iter().flat_map(|b| triangles[id].iter().map(move |v| (b, v))) {
                assert!((0..3).all(|k| b[k] <= v[k] && v[k] <= b[k + 3]), "{v:?} outside {b:?}");
            }
        }
    }
    assert_eq!((nodes as usize, leaves as usize), (tree.nodes.len(), tree.leaves.len()));
    assert_eq!(tree.depth, deepest);
    assert!(deepest <= MAX_TREE_DEPTH, "{deepest} levels");
    seen
}

// Killed by: a box shrunk by one unit in the last place, a child out of order, a leaf of nine.
#[test]
fn trees_hold_every_triangle_once_inside_all_boxes() {
    let mut r = Rng(1);
    let sets = [
        vec![],
        soup(1, [0.0; 3], 1.0, 1.0, &mut r),
        soup(2, [0.0; 3], 1.0, 1.0, &mut r),
        soup(9, [1e6; 3], 1.0, 1.0, &mut r),
        soup(5000, [0.0; 3], 1.0, 0.1, &mut r),
        soup(3000, [1e7, 0.0, -1e7], 1e3, 0.1, &mut r),
        star(100, [0.0; 3], 1e-6, 3),
        // flat, a line, a point
        soup(2000, [0.0; 3], 1.0, 0.1, &mut r).into_iter().map(|t| t.map(|p| [p[0], 0.5, p[2]])).collect(),
        soup(2000, [0.0; 3], 1.0, 0.1, &mut r).into_iter().map(|t| t.map(|p| [p[0], 0.5, -1.0])).collect(),
        vec![[[1.0, 2.0, 3.0]; 3]; 100],
    ];
    for triangles in &sets {
        for effort in [Effort::Fast, Effort::Medium, Effort::Slow] {
            assert!(check(&build(triangles, effort), triangles).iter().all(|n| *n == 1));
        }
    }
}

// Killed by: dropping the fallback to median splits (the exponential row then needs hundreds of levels).
#[test]
fn depth_is_bounded_for_hostile_geometry() {
    let triangle = |x: f32, s: f32| [[x, 0.0, 0.0], [x + s, 0.0, 0.0], [x, s, 0.0]];
    let coincident = vec![triangle(1.0, 1.0); 200_000];
    // each box half as large as the one around it
    let nested: Vec<Tri> = (0..250).map(|i| triangle(0.0, 2f32.powi(120 - i))).collect();
    let row: Vec<Tri> = (0..250).map(|i| triangle(2f32.powi(i - 125), 2f32.powi(i - 128))).collect();
    // unequal but all of one size, as a stack of sheets of paper
    let stack: Vec<Tri> = (0..20_000).map(|i| triangle(0.0, 1.0).map(|p| [p[0], p[1], 1e-4 * i as f32])).collect();
    let both: Vec<Tri> = nested.iter().flat_map(|t| [*t; 40]).chain(row.iter().copied()).collect();
    for triangles in [&coincident, &nested, &row, &stack, &both] {
        for effort in [Effort::Fast, Effort::Medium] {
            assert!(check(&build(triangles, effort), triangles).iter().all(|n| *n == 1));
        }
    }
}

// Killed by: not filtering (obvhs asserts on NaN, boxes lose their meaning).
#[test]
fn triangles_that_are_not_finite_are_left_out() {
    let mut triangles = soup(100, [0.0; 3], 1.0, 0.1, &mut Rng(2));
    for (i, x) in [(3, f32::NAN), (50, f32::INFINITY), (99, f32::NEG_INFINITY)] {
        triangles[i][i % 3][1] = x;
    }
    let seen = check(&build(&triangles, Effort::Medium), &triangles);
    assert!(seen.iter().enumerate().all(|(i, n)| *n == u32::from(![3, 50, 99].contains(&i))));
    let bad = vec![[[f32::NAN; 3]; 3]; 5];
    assert!(build(&bad, Effort::Medium).nodes.is_empty());
}

/// The deepest tree that validates, made to fill stacks: every node has seven leaves and, at the same distance and with
/// a lower reference, the next node. Leaf k holds two triangles at z = +-height(k).
fn chain(height: impl Fn(u32) -> f32) -> (Vec<Node>, Vec<Leaf>) {
    let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
    for level in 0..MAX_TREE_DEPTH {
        let mut node = Node { bounds: [[-10.0; 8]; 6], child: [NONE; 8], reserved: [0; 8] };
        node.bounds[3..].fill([10.0; 8]);
        let inner = usize::from(level + 1 < MAX_TREE_DEPTH);
        for child in &mut node.child[inner..] {
            let k = leaves.len() as u32;
            let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
            for (slot, z) in [height(k), -height(k)].into_iter().enumerate() {
                leaf.triangle[slot] = 2 * k + slot as u32;
                let corners = [-9.0, -9.0, z, 9.0, -9.0, z, 0.0, 9.0, z];
                (0..9).for_each(|row| leaf.p[row][slot] = corners[row]);
            }
            leaves.push(leaf);
            *child = LEAF_BIT | 2 << 27 | k;
        }
        if inner == 1 {
            node.child[0] = level + 1;
        }
        nodes.push(node);
    }
    (nodes, leaves)
}

// Killed by: rays that take turns keep to their eighth of the stack and lose what does not fit, or forget to begin
// anew.
#[test]
fn full_stacks_lose_nothing() {
    let last = 7 * MAX_TREE_DEPTH;
    for closest in [0, 3, 100, last - 1, last] {
        let (nodes, leaves) = chain(|k| if k == closest { 1.0 } else { 2.0 + k as f32 / 256.0 });
        let bvh = WideBvh::from_parts(&nodes, &leaves);
        // all directions, so that rays go alone; or one octant, so that up to eight go together
        for (octants, active) in [(7, 8), (0, 1), (0, 2), (0, 5), (0, 8)] {
            let d = Vec3x8::from_fn(|i| {
                let sign = |k: usize| if (i & octants) >> k & 1 == 1 { -1.0 } else { 1.0 };
                [0.1 * sign(0), 0.1 * sign(1), sign(2)]
            });
            let ray = |tmax: f32| Ray8 { o: Vec3x8::ZERO, d, tmin: F32x8::ZERO, tmax: F32x8::splat(tmax) };
            let active = Mask8::first(active);
            let hit = bvh.closest(&ray(f32::INFINITY), active);
            assert_eq!(hit.hit, active);
            for i in active.lanes() {
                assert_eq!(hit.t.lane(i), 1.0);
                assert_eq!(hit.triangle.lane(i), 2 * closest + u32::from(d.z.lane(i) < 0.0));
            }
            assert_eq!(bvh.occluded(&ray(1.1), active), active);
            assert_eq!(bvh.occluded(&ray(0.9), active), Mask8::NONE);
        }
    }
}

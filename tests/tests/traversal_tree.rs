//! The host's trees: every triangle once, every vertex in every box above it, bounded depth, the promised numbering.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::Ray8;
use croupier::unstable::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, MAX_TREE_DEPTH, NONE, Node};
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
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
            let extent = |slot: usize, k: usize| f64::from(node.bounds[k + 3][slot]) - f64::from(node.bounds[k][slot]);
            let half_area = |slot| (0..3).map(|k| extent(slot, k) * extent(slot, (k + 1) % 3)).sum::<f64>();
            let used = node.child.iter().take_while(|c| **c != NONE).count();
            assert!(node.child[used..].iter().all(|c| *c == NONE), "unused slots come last");
            for slot in 1..used {
                let leaf = [slot - 1, slot].map(|s| node.child[s] & LEAF_BIT != 0);
                let falls = half_area(slot - 1) >= (1.0 - 1e-9) * half_area(slot);
                assert!(leaf[0] && !leaf[1] || leaf[0] == leaf[1] && falls, "leaves first, then the largest");
            }
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

// Killed by: a box shrunk by one unit in the last place, a child out of order, a leaf of nine, slots not sorted.
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

/// The tree of `triangles`, which is the same for one thread, two and five.
fn same_with_all_threads(triangles: &[Tri]) -> Tree {
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build(triangles, Effort::Medium))
    };
    let one = with_threads(1);
    for threads in [2, 5] {
        let tree = with_threads(threads);
        assert!(bytemuck::cast_slice::<Node, u8>(&tree.nodes) == bytemuck::cast_slice::<Node, u8>(&one.nodes));
        assert!(bytemuck::cast_slice::<Leaf, u8>(&tree.leaves) == bytemuck::cast_slice::<Leaf, u8>(&one.leaves));
        assert_eq!(tree.depth, one.depth);
    }
    one
}

// Killed by: parts of the binary tree in the order in which threads finish them.
#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    let mut triangles = soup(20_000, [0.0; 3], 1.0, 0.1, &mut Rng(5));
    triangles.extend(vec![[[0.25, 0.5, 0.5], [0.5, 0.25, 0.5], [0.5; 3]]; 300]);
    same_with_all_threads(&triangles);
}

/// Large meshes: the halves of quadrilaterals, which follow each other, are in one leaf; what has no other half, what has the
/// box of others and what is not finite is among them. Killed by: a pair of which one half is lost or counted twice, a
/// pair of triangles that are far apart, of one that is not finite, of one from a group of equal boxes.
#[test]
fn large_meshes_are_built_from_pairs() {
    const SIDE: usize = 200;
    let at = |i: usize, j: usize| [i as f32, (0.3 * i as f32).sin() + (0.2 * j as f32).cos(), j as f32];
    let quads = (0..SIDE * SIDE).map(|q| (q / SIDE, q % SIDE));
    let mut triangles: Vec<Tri> = quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let in_quads = triangles.len();
    triangles.extend(soup(2000, [0.0; 3], 100.0, 0.1, &mut Rng(6)));
    triangles.extend(vec![[[1.0, 2.0, 3.0], [2.0, 1.0, 3.0], [2.0, 2.0, 3.0]]; 301]);
    triangles.push([[f32::NAN; 3]; 3]);
    triangles
        .extend([[[5.0, 9.0, 5.0], [6.0, 9.0, 5.0], [5.0, 9.0, 6.0]], [[6.0, 9.0, 5.0], [5.0, 9.0, 6.0], [6.0; 3]]]);
    triangles[in_quads + 7] = [[f32::INFINITY; 3]; 3];
    let tree = same_with_all_threads(&triangles);
    let seen = check(&tree, &triangles);
    let finite = |i: usize| triangles[i].as_flattened().iter().all(|x| x.is_finite());
    assert!(seen.iter().enumerate().all(|(i, n)| *n == u32::from(finite(i))));
    let mut leaf_of = vec![usize::MAX; triangles.len()];
    for (l, leaf) in tree.leaves.iter().enumerate() {
        leaf.triangle.iter().filter(|t| **t != NONE).for_each(|t| leaf_of[*t as usize] = l);
    }
    assert!(leaf_of[..in_quads].chunks(2).all(|pair| pair[0] == pair[1]));
    // the loose ones lie apart: pairs of them would make boxes as large as all of them
    let apart = leaf_of[in_quads..in_quads + 2000].chunks(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(apart > 900, "{apart} of 1000");
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

/// A leaf of triangles that face along z, at these heights.
fn leaf(triangles: &[(u32, f32)]) -> Leaf {
    let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
    for (slot, &(id, z)) in triangles.iter().enumerate() {
        leaf.triangle[slot] = id;
        let corners = [-9.0, -9.0, z, 9.0, -9.0, z, 0.0, 9.0, z];
        (0..9).for_each(|row| leaf.p[row][slot] = corners[row]);
    }
    leaf
}

/// A node whose children's boxes are all the same cube around the origin.
fn cubes(child: [u32; 8]) -> Node {
    let row = |used, unused| child.map(|c| if c == NONE { unused } else { used });
    let (low, high) = (row(-10.0, f32::INFINITY), row(10.0, f32::NEG_INFINITY));
    Node { bounds: [low, low, low, high, high, high], child, reserved: [0; 8] }
}

/// Eight rays from the origin, mostly along z; the bits of `octants` in a lane's number make a component negative.
fn rays(octants: usize, tmax: f32) -> Ray8 {
    let d = Vec3x8::from_fn(|i| {
        let sign = |k: usize| if (i & octants) >> k & 1 == 1 { -1.0 } else { 1.0 };
        [0.1 * sign(0), 0.1 * sign(1), sign(2)]
    });
    Ray8 { tmax: F32x8::splat(tmax), ..Ray8::unbounded(Vec3x8::ZERO, d) }
}

/// Ways to send rays: octants, and how many. All directions go alone; of one octant up to eight go together.
const WAYS: [(usize, usize); 5] = [(7, 8), (0, 1), (0, 2), (0, 5), (0, 8)];

// Killed by: the first of equal hits in a leaf; `<` on t alone between leaves; the same in packets.
#[test]
fn the_lowest_of_equal_triangles_is_hit_wherever_it_is() {
    let at = |ids: &[u32]| leaf(&ids.iter().flat_map(|id| [(*id, 1.0), (*id + 100, -1.0)]).collect::<Vec<_>>());
    let contents: [&[&[u32]]; 6] =
        [&[&[7, 2, 9, 4]], &[&[1, 2, 3]], &[&[9, 8, 5, 3]], &[&[6], &[1]], &[&[1], &[6]], &[&[5, 4], &[3, 8], &[9, 2]]];
    for content in contents {
        let lowest = *content.iter().copied().flatten().min().unwrap();
        let leaves: Vec<Leaf> = content.iter().map(|ids| at(ids)).collect();
        // the leaves in the first slots, in the last, and in the opposite order
        for slot in [|i: usize| i, |i| 5 + i, |i| 7 - i] {
            let mut child = [NONE; 8];
            for (i, ids) in content.iter().enumerate() {
                child[slot(i)] = LEAF_BIT | (2 * ids.len() as u32) << 27 | i as u32;
            }
            let nodes = [cubes(child)];
            let bvh = WideBvh::from_parts(&nodes, &leaves);
            for (octants, active) in WAYS {
                let (rays, active) = (rays(octants, f32::INFINITY), Mask8::first(active));
                let hit = bvh.closest(&rays, active);
                assert_eq!(hit.hit, active);
                for i in active.lanes() {
                    let side = if rays.d.z.lane(i) < 0.0 { 100 } else { 0 };
                    assert_eq!(hit.triangle.lane(i), lowest + side, "{content:?}");
                }
            }
        }
    }
}

/// The deepest tree that validates, made to fill stacks: every node has leaves and, at the same distance, the next node
/// in slot `inner`. The root has `first` children, the others eight. Leaf k holds two triangles at z = +-height(k).
fn chain(first: usize, inner: usize, height: impl Fn(u32) -> f32) -> (Vec<Node>, Vec<Leaf>) {
    let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
    for level in 0..MAX_TREE_DEPTH {
        let mut child = [NONE; 8];
        let mut room = if level == 0 { first } else { 8 };
        if level + 1 < MAX_TREE_DEPTH {
            child[inner] = level + 1;
            room -= 1;
        }
        for child in child.iter_mut().filter(|c| **c == NONE).take(room) {
            let k = leaves.len() as u32;
            leaves.push(leaf(&[(2 * k, height(k)), (2 * k + 1, -height(k))]));
            *child = LEAF_BIT | 2 << 27 | k;
        }
        nodes.push(cubes(child));
    }
    (nodes, leaves)
}

// Killed by: rays that take turns keep to their eighth of the stack and lose what does not fit, or forget to begin
// anew.
#[test]
fn full_stacks_lose_nothing() {
    for (first, inner) in (1..=8).flat_map(|first| [(first, 0), (first, 7)]) {
        let last = chain(first, inner, |_| 1.0).1.len() as u32 - 1;
        for closest in [0, 3, 100, last - 1, last] {
            let (nodes, leaves) = chain(first, inner, |k| if k == closest { 1.0 } else { 2.0 + k as f32 / 256.0 });
            let bvh = WideBvh::from_parts(&nodes, &leaves);
            for (octants, active) in WAYS {
                let active = Mask8::first(active);
                let all = rays(octants, f32::INFINITY);
                let hit = bvh.closest(&all, active);
                assert_eq!(hit.hit, active);
                for i in active.lanes() {
                    assert_eq!(hit.t.lane(i), 1.0);
                    assert_eq!(hit.triangle.lane(i), 2 * closest + u32::from(all.d.z.lane(i) < 0.0));
                }
                assert_eq!(bvh.occluded(&rays(octants, 1.1), active), active);
                assert_eq!(bvh.occluded(&rays(octants, 0.9), active), Mask8::NONE);
            }
        }
    }
}

// Four rays fill their eighths of the stack up to 25 of 32 entries and meet eight more children, while the four others
// still have the leaf with their hit at the bottom of theirs. Killed by: room for seven entries is taken for enough.
#[test]
fn full_stacks_do_not_spill_into_their_neighbours() {
    let far = LEAF_BIT | 2 << 27;
    let leaves = [leaf(&[(0, 3.0), (1, -3.0)]), leaf(&[(2, 1.0), (3, -1.0)])];
    // the chain, seen along +z; leaves that take long, seen along -z; three leaves, and the one with the hit
    let mut nodes = vec![cubes([1, 9, far, far, far, far | 1, NONE, NONE])];
    (nodes[0].bounds[2][0], nodes[0].bounds[5][1]) = (0.1, -0.1);
    nodes.extend((1..8).map(|i| cubes([i + 1, far, far, far, far, far, far, far])));
    nodes.extend([cubes([far; 8]), cubes([far; 8])]);
    let bvh = WideBvh::from_parts(&nodes, &leaves);
    assert_eq!(bvh.occluded(&rays(7, 1.5), Mask8::all_lanes()), Mask8::all_lanes());
    assert!(bvh.closest(&rays(7, 1.5), Mask8::all_lanes()).t.to_array().iter().all(|t| *t == 1.0));
}

// Trees that nobody validated: wrong hits, and nothing worse. Killed by: indexing without a check, a triangle count
// above eight, a stack that is not bounded.
#[test]
fn trees_of_garbage_do_no_harm() {
    let mut r = Rng(4);
    for _ in 0..2000 {
        let numbers = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e38, -1e-40, -10.0, 10.0, 1.0];
        let levels = 1 + r.below(60) as u32;
        let mut leaves = vec![leaf(&[(0, 1.0), (1, -1.0), (2, 2.0)]); 3];
        leaves[1].p.as_flattened_mut().fill_with(|| numbers[r.below(10)]);
        leaves[1].triangle = [NONE; 8];
        let mut nodes = Vec::new();
        for level in 0..levels {
            // a node's index is above that of its parent, so that walks end
            let mut node = cubes([0; 8]);
            node.child = [(); 8].map(|()| match r.below(4) {
                0 => LEAF_BIT | r.bits(),
                1 => LEAF_BIT | (r.below(16) as u32) << 27 | r.below(4) as u32,
                2 => levels + r.bits() % 1000,
                _ => NONE,
            });
            node.child[r.below(8)] = level + 1;
            for _ in 0..r.below(20) {
                node.bounds[r.below(6)][r.below(8)] = numbers[r.below(10)];
            }
            nodes.push(node);
        }
        let bvh = WideBvh::from_parts(&nodes, &leaves);
        for (octants, active) in WAYS {
            let (rays, active) = (rays(octants, f32::INFINITY), Mask8::first(active));
            let hit = bvh.closest(&rays, active);
            assert_eq!(hit.hit & active, hit.hit);
            assert!(hit.hit.lanes().all(|i| hit.t.lane(i) >= 0.0 && hit.triangle.lane(i) != NONE));
            assert_eq!(bvh.occluded(&rays, active) & active, bvh.occluded(&rays, active));
        }
    }
}

//! Stand-in: median splits.
use bytemuck::Zeroable;
use croupier::scene::blob::{LEAF_BIT, Leaf, NONE, Node};

#[derive(Clone, Copy, Debug, Default)]
pub enum Effort {
    #[default]
    Normal,
}

pub struct Tree {
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    pub depth: u32,
}

type Corners = [[f32; 3]; 3];

fn bounds(triangles: &[Corners], ids: &[u32]) -> [[f32; 3]; 2] {
    let mut b = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for p in ids.iter().flat_map(|i| triangles[*i as usize]) {
        for a in 0..3 {
            b[0][a] = b[0][a].min(p[a]);
            b[1][a] = b[1][a].max(p[a]);
        }
    }
    b
}

fn node(triangles: &[Corners], ids: &mut [u32], tree: &mut Tree, depth: u32) -> u32 {
    tree.depth = tree.depth.max(depth);
    let mut parts = vec![ids];
    while parts.len() < 8 {
        parts.sort_by_key(|p| p.len());
        let big = parts.pop().unwrap();
        if big.len() <= 8 {
            parts.push(big);
            break;
        }
        let b = bounds(triangles, big);
        let axis = (0..3).max_by(|x, y| (b[1][*x] - b[0][*x]).total_cmp(&(b[1][*y] - b[0][*y]))).unwrap();
        let middle = big.len() / 2;
        let key = |i: &u32| triangles[*i as usize].iter().map(|p| p[axis]).sum::<f32>();
        big.select_nth_unstable_by(middle, |x, y| key(x).total_cmp(&key(y)));
        let (x, y) = big.split_at_mut(middle);
        parts.extend([x, y]);
    }
    let me = tree.nodes.len();
    let mut n = Node::zeroed();
    n.child = [NONE; 8];
    n.bounds = [[f32::INFINITY; 8]; 6];
    n.bounds[3..].fill([f32::NEG_INFINITY; 8]);
    tree.nodes.push(n);
    for (slot, part) in parts.into_iter().enumerate() {
        let b = bounds(triangles, part);
        for a in 0..3 {
            n.bounds[a][slot] = b[0][a];
            n.bounds[3 + a][slot] = b[1][a];
        }
        n.child[slot] = if part.len() <= 8 {
            let mut leaf = Leaf::zeroed();
            leaf.triangle = [NONE; 8];
            for (k, i) in part.iter().enumerate() {
                leaf.triangle[k] = *i;
                for r in 0..9 {
                    leaf.p[r][k] = triangles[*i as usize][r / 3][r % 3];
                }
            }
            tree.leaves.push(leaf);
            LEAF_BIT | (part.len() as u32) << 27 | (tree.leaves.len() - 1) as u32
        } else {
            node(triangles, part, tree, depth + 1)
        };
    }
    tree.nodes[me] = n;
    me as u32
}

pub fn build(triangles: &[Corners], _effort: Effort) -> Tree {
    let mut tree = Tree { nodes: vec![], leaves: vec![], depth: 0 };
    if !triangles.is_empty() {
        let mut ids: Vec<u32> = (0..triangles.len() as u32).collect();
        node(triangles, &mut ids, &mut tree, 1);
    }
    tree
}

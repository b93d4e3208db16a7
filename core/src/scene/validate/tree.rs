//! The tree: shape, boxes, leaves.
//!
//! Nodes and leaves must be numbered in the order in which a depth-first walk meets them. So the walk needs no marks:
//! each child reference has exactly one legal index, the next of a counter. A counter only grows, hence the walk ends
//! after at most as many steps as there are child slots, no record is met twice (neither cycles nor sharing), and the
//! counters at the end say whether all were met. The stack is the path to the current node.
//!
//! With instances there is such a walk for each tree of each object, through its own runs of nodes and leaves.

use super::instances::run;
use super::record::hash_of;
use crate::scene::Records;
use crate::scene::blob::*;
use crate::scene::error::{ChildFault, ObjectFault, SceneError, SlotFault};
use crate::scene::instances::derive;

/// A closed box: smallest and largest corner.
#[derive(Clone, Copy)]
struct Bounds {
    min: [f32; 3],
    max: [f32; 3],
}

impl Bounds {
    /// Bounds of a node's child.
    fn of_child(node: &Node, slot: usize) -> Self {
        let [x0, y0, z0, x1, y1, z1] = node.bounds.map(|row| row.get(slot).copied().unwrap_or(f32::NAN));
        Self { min: [x0, y0, z0], max: [x1, y1, z1] }
    }

    /// A coordinate of `p` that is outside; NaN is.
    fn excludes(&self, p: [f32; 3]) -> Option<f32> {
        let axes = p.iter().zip(self.min.iter().zip(&self.max));
        axes.filter(|(x, (lo, hi))| !(*x >= lo && *x <= hi)).map(|(x, _)| *x).next()
    }

    /// Finite, ordered, inside `parent`.
    fn check(&self, parent: &Self) -> Result<(), ChildFault> {
        for (lo, hi) in self.min.iter().zip(&self.max) {
            if !(*lo <= *hi && *lo >= f32::MIN && *hi <= f32::MAX) {
                return Err(ChildFault::Bounds(if hi.is_finite() { *lo } else { *hi }));
            }
        }
        let outside = parent.excludes(self.min).or(parent.excludes(self.max));
        outside.map_or(Ok(()), |x| Err(ChildFault::Outside(x)))
    }

    /// The box of an unused slot, bit for bit.
    fn check_empty(&self) -> Result<(), ChildFault> {
        let wrong_min = self.min.iter().find(|x| **x != f32::INFINITY);
        let wrong_max = self.max.iter().find(|x| **x != f32::NEG_INFINITY);
        wrong_min.or(wrong_max).map_or(Ok(()), |x| Err(ChildFault::EmptyBox(*x)))
    }
}

/// One node of the path from the root: its index, its box, the next slot to look at.
#[derive(Clone, Copy)]
struct Step {
    node: u32,
    slot: u32,
    bounds: Bounds,
}

/// Counts of what the walks have met.
#[derive(Default)]
struct Met {
    nodes: u32,
    leaves: u32,
    slots: u64,
    /// Sum of [`hash_of`] of the triangles met.
    hashes: u64,
    /// Instances met in the current top-level tree, and the sum of their hashes.
    instances: (u32, u64),
    /// Box of the reference from the current top-level tree to the tree of the object's triangles.
    own: Option<Bounds>,
}

/// A tree: its nodes and leaves are `met.nodes..end_node` and `met.leaves..end_leaf`.
struct Tree<'a> {
    end_node: u32,
    end_leaf: u32,
    bounds: Bounds,
    /// Triangles that its leaves may hold.
    triangles: core::ops::Range<usize>,
    /// The object, if this is its top-level tree.
    top: Option<&'a Object>,
}

/// Walks all trees.
pub(super) fn tree(scene: &Records<'_>) -> Result<(), SceneError> {
    let mut met = Met::default();
    let [nodes, leaves, triangles] = [scene.nodes.len(), scene.leaves.len(), scene.triangles.len()];
    let [end_node, end_leaf, triangles] = [nodes, leaves, triangles].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let bounds = Bounds { min: scene.info.bounds_min, max: scene.info.bounds_max };
    if scene.objects.is_empty() {
        let tree = Tree { end_node, end_leaf, bounds, triangles: 0..triangles as usize, top: None };
        walk(scene, &tree, &mut met)?;
    }
    for (index, o) in (0u32..).zip(scene.objects) {
        object(scene, index, o, bounds, &mut met)?;
    }
    // As many slots as triangles, all in range, and equal sums of 64-bit hashes: a multiset other than {0, 1, ... n-1}
    // passes by accident with probability 2^-64. On purpose it can; that wrongs the picture, not memory.
    let hashes = (0..triangles).fold(0u64, |sum, t| sum.wrapping_add(hash_of(u64::from(t))));
    if met.slots != u64::from(triangles) || met.hashes != hashes {
        return Err(SceneError::Coverage { triangles, slots: met.slots });
    }
    Ok(())
}

/// The trees of an object, whose runs have been checked. `world` are the bounds of the world.
fn object(scene: &Records<'_>, index: u32, o: &Object, world: Bounds, met: &mut Met) -> Result<(), SceneError> {
    let mut bounds = Bounds { min: o.bounds_min, max: o.bounds_max };
    if index == 0
        && let Some(x) = world.excludes(bounds.min).or(world.excludes(bounds.max))
    {
        let (of, field) = (SectionKind::Objects, crate::scene::error::Field::Bounds);
        return Err(SceneError::Number { of, index, field, found: x });
    }
    if o.instances > 0 {
        (met.nodes, met.instances, met.own) = (o.first_top, (0, 0), None);
        let end_node = o.first_top.saturating_add(o.top_nodes);
        walk(scene, &Tree { end_node, end_leaf: met.leaves, bounds, triangles: 0..0, top: Some(o) }, met)?;
        let last = o.first_instance.saturating_add(o.instances);
        let hashes = (o.first_instance..last).fold(0u64, |sum, i| sum.wrapping_add(hash_of(u64::from(i))));
        let coverage = ObjectFault::Coverage { instances: o.instances, met: met.instances.0 };
        let fault = SceneError::Object { object: index, fault: coverage };
        if met.instances != (o.instances, hashes) || met.own.is_some() != (o.nodes > 0) {
            return Err(fault);
        }
        bounds = met.own.unwrap_or(bounds);
    }
    (met.nodes, met.leaves) = (o.first_node, o.first_leaf);
    let tree = Tree {
        end_node: o.first_node.saturating_add(o.nodes),
        end_leaf: o.first_leaf.saturating_add(o.leaves),
        bounds,
        triangles: run(o.first_triangle, o.triangles),
        top: None,
    };
    walk(scene, &tree, met)
}

/// Walks one tree, from the counters of `met` on.
fn walk(scene: &Records<'_>, tree: &Tree<'_>, met: &mut Met) -> Result<(), SceneError> {
    if met.nodes < tree.end_node {
        descend(scene, tree, met)?;
    }
    let counts = [(SectionKind::Nodes, met.nodes, tree.end_node), (SectionKind::Leaves, met.leaves, tree.end_leaf)];
    for (of, met, end) in counts {
        if met != end {
            return Err(SceneError::Unreached { of, index: met });
        }
    }
    Ok(())
}

fn descend(scene: &Records<'_>, tree: &Tree<'_>, met: &mut Met) -> Result<(), SceneError> {
    let first = Step { node: met.nodes, slot: 0, bounds: tree.bounds };
    let mut path = [first; MAX_TREE_DEPTH as usize];
    let mut depth = 0usize;
    met.nodes = met.nodes.saturating_add(1);
    // `depth` indexes the last step of the path and is kept below its length.
    while let Some(step) = path.get_mut(depth) {
        let (Step { node: index, slot, bounds }, Some(node)) = (*step, scene.nodes.get(step.node as usize)) else {
            break;
        };
        let Some(child) = node.child.get(slot as usize).copied() else {
            let Some(up) = depth.checked_sub(1) else { break };
            depth = up;
            continue;
        };
        step.slot = slot.saturating_add(1);
        let bad = |fault| SceneError::Child { node: index, slot, fault };
        if slot == 0 && (node.reserved != [0; 8] || node.child == [NONE; 8]) {
            return Err(match node.reserved {
                [0, 0, 0, 0, 0, 0, 0, 0] => SceneError::Unreached { of: SectionKind::Nodes, index },
                _ => SceneError::Reserved { of: SectionKind::Nodes, index },
            });
        }
        let own = Bounds::of_child(node, slot as usize);
        if child == NONE {
            own.check_empty().map_err(bad)?;
            continue;
        }
        own.check(&bounds).map_err(bad)?;
        let count = (child & !LEAF_BIT) >> 27;
        if let Some(object) = tree.top {
            if child == object.first_node && object.nodes > 0 {
                if met.own.replace(own).is_some() {
                    return Err(bad(ChildFault::Order { expected: met.nodes, found: child }));
                }
                continue;
            }
            if child & LEAF_BIT != 0 && count == 0 {
                instance(scene, object, child & CHILD_INDEX, &own, met).map_err(bad)?;
                continue;
            }
        }
        let found = child & if child & LEAF_BIT == 0 { !LEAF_BIT } else { CHILD_INDEX };
        let (next, end) =
            if child & LEAF_BIT == 0 { (&mut met.nodes, tree.end_node) } else { (&mut met.leaves, tree.end_leaf) };
        if found != *next || found >= end {
            return Err(bad(ChildFault::Order { expected: *next, found }));
        }
        *next = next.saturating_add(1);
        if child & LEAF_BIT == 0 {
            depth = depth.saturating_add(1);
            *path.get_mut(depth).ok_or(bad(ChildFault::Deep))? = Step { node: found, slot: 0, bounds: own };
        } else {
            if !(1..=8).contains(&count) {
                return Err(bad(ChildFault::Count(count)));
            }
            leaf(scene, tree, (found, count), &own, met)?;
        }
    }
    Ok(())
}

/// The instance is one of the object, and the box holds what rays can meet of it.
fn instance(scene: &Records<'_>, o: &Object, index: u32, own: &Bounds, met: &mut Met) -> Result<(), ChildFault> {
    let all = scene.instances.get(run(o.first_instance, o.instances)).unwrap_or(&[]);
    let place = index.checked_sub(o.first_instance).and_then(|i| all.get(i as usize));
    let fault = ChildFault::Order { expected: o.first_instance, found: index };
    let (Some(i), Some(inner)) = (place, place.and_then(|i| scene.objects.get(i.object as usize))) else {
        return Err(fault);
    };
    let [min, max] = derive(&i.to_world, [inner.bounds_min, inner.bounds_max]).map_err(|_| fault)?.bounds;
    if let Some(x) = own.excludes(min).or(own.excludes(max)) {
        return Err(ChildFault::Outside(x));
    }
    met.instances.0 = met.instances.0.saturating_add(1);
    met.instances.1 = met.instances.1.wrapping_add(hash_of(u64::from(index)));
    Ok(())
}

/// The leaf holds the corners of its triangles, inside its box; the rest of it is empty.
fn leaf(
    scene: &Records<'_>,
    tree: &Tree<'_>,
    (index, count): (u32, u32),
    bounds: &Bounds,
    met: &mut Met,
) -> Result<(), SceneError> {
    let Some(leaf) = scene.leaves.get(index as usize) else { return Ok(()) };
    for (slot, t) in (0u32..).zip(leaf.triangle) {
        let bad = |fault| SceneError::Slot { leaf: index, slot, fault };
        let stored = leaf.p.map(|row| row.get(slot as usize).copied().unwrap_or(f32::NAN));
        if slot >= count {
            if t != NONE || stored.map(f32::to_bits) != [0; 9] {
                return Err(bad(SlotFault::Unused));
            }
            continue;
        }
        let of = SectionKind::Leaves;
        let (to, triangles) = (SectionKind::Triangles, u32::try_from(scene.triangles.len()).unwrap_or(u32::MAX));
        let range = SceneError::Reference { of, index, to, found: t, count: triangles };
        let triangle =
            scene.triangles.get(t as usize).filter(|_| tree.triangles.contains(&(t as usize))).ok_or(range)?;
        for (v, p) in triangle.vertex.iter().zip(stored.chunks_exact(3)) {
            let &[x, y, z] = p else { continue };
            let vertex = scene.vertices.get(*v as usize).map_or([f32::NAN; 3], |v| v.p);
            if let Some((wrong, _)) = [x, y, z].iter().zip(vertex).find(|(a, b)| a.to_bits() != b.to_bits()) {
                return Err(bad(SlotFault::Vertex(*wrong)));
            }
            if let Some(x) = bounds.excludes(vertex) {
                return Err(bad(SlotFault::Outside(x)));
            }
        }
        met.slots = met.slots.saturating_add(1);
        met.hashes = met.hashes.wrapping_add(hash_of(u64::from(t)));
    }
    Ok(())
}

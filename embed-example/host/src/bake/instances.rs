//! Objects, their trees and their instances.
//!
//! Object 0 is the world; the others are the prototypes that instances lead to, in the order of the description. What no
//! instance leads to is checked and left out.

use super::BakeError;
use super::geometry::Geometry;
use crate::bvh::{Effort, Tree, build};
use crate::description::{Instance, Prototype, SceneDescription};
use bytemuck::Zeroable;
use croupier::unstable::accel::{Primitive, TopLevel, set_hidden, set_transform};
use croupier::unstable::scene::blob::{self, LEAF_BIT, Leaf, NONE, Node, Object, top_capacity};
use std::ops::Range;

/// Which triangles of the description belong to which object.
pub(super) struct Plan {
    /// Runs of triangles by object. One object: a scene without instances.
    pub runs: Vec<Vec<Range<u32>>>,
    /// Prototype of each object but the world.
    prototypes: Vec<u32>,
    /// Object of each prototype, [`NONE`] of those that are left out.
    objects: Vec<u32>,
}

impl Plan {
    /// Prototypes that no instance leads to.
    pub(super) fn unused(&self) -> u32 {
        self.objects.iter().filter(|o| **o == NONE).count() as u32
    }
}

fn instance_error(scene: &SceneDescription, i: &Instance, what: impl Into<String>) -> BakeError {
    let prototype =
        scene.prototypes.get(i.prototype as usize).map_or_else(|| i.prototype.to_string(), |p| p.name.clone());
    BakeError::Instance { name: i.name.clone(), prototype, what: what.into() }
}

fn prototype_error(p: &Prototype, what: String) -> BakeError {
    BakeError::Prototype { name: p.name.clone(), what }
}

/// Checks ranges and references, and says what belongs to which object.
pub(super) fn plan(scene: &SceneDescription) -> Result<Plan, BakeError> {
    let total = scene.triangles.len() as u32;
    for (what, count) in [("prototypes", scene.prototypes.len()), ("instances", scene.instances.len())] {
        if count >= 1 << 27 {
            return Err(BakeError::TooMany { what, count });
        }
    }
    let mut taken: Vec<&Prototype> = scene.prototypes.iter().filter(|p| !p.triangles.is_empty()).collect();
    taken.sort_by_key(|p| p.triangles.start);
    for p in &taken {
        if p.triangles.end > total {
            let what = format!("its triangles {:?} are not there, there are {total}", p.triangles);
            return Err(prototype_error(p, what));
        }
    }
    for pair in taken.windows(2) {
        if pair[0].triangles.end > pair[1].triangles.start {
            let what = format!("its triangles {:?} are also those of `{}`", pair[1].triangles, pair[0].name);
            return Err(prototype_error(pair[1], what));
        }
    }
    let nested = |p: &Prototype| !p.instances.is_empty();
    for p in &scene.prototypes {
        for i in &p.instances {
            let inner = prototype(scene, i)?;
            if nested(inner) {
                let what = format!("within `{}` it may not hold instances in turn: they nest once", p.name);
                return Err(instance_error(scene, i, what));
            }
        }
    }
    let mut used = vec![false; scene.prototypes.len()];
    for i in &scene.instances {
        prototype(scene, i)?;
        used[i.prototype as usize] = true;
    }
    for (index, p) in scene.prototypes.iter().enumerate() {
        if used[index] {
            p.instances.iter().for_each(|i| used[i.prototype as usize] = true);
        }
    }
    let mut world = Vec::new();
    let mut from = 0;
    for p in &taken {
        world.push(from..p.triangles.start);
        from = p.triangles.end;
    }
    world.push(from..total);
    let mut plan = Plan { runs: vec![world], prototypes: Vec::new(), objects: vec![NONE; scene.prototypes.len()] };
    for (index, p) in (0u32..).zip(&scene.prototypes).filter(|(index, _)| used[*index as usize]) {
        plan.objects[index as usize] = plan.runs.len() as u32;
        plan.runs.push(vec![p.triangles.clone()]);
        plan.prototypes.push(index);
    }
    Ok(plan)
}

/// The prototype of an instance.
fn prototype<'a>(scene: &'a SceneDescription, i: &Instance) -> Result<&'a Prototype, BakeError> {
    let found = scene.prototypes.get(i.prototype as usize);
    found.ok_or_else(|| instance_error(scene, i, format!("there is no prototype {}", i.prototype)))
}

/// Trees, objects and instances of the blob.
#[derive(Default)]
pub(super) struct Forest {
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    /// Empty without instances, like `instances`.
    pub objects: Vec<Object>,
    pub instances: Vec<blob::Instance>,
    pub depth: u32,
    /// Bounds of the world.
    pub bounds: [[f32; 3]; 2],
}

/// Builds all trees.
pub(super) fn bake(
    scene: &SceneDescription,
    plan: &Plan,
    geometry: &Geometry,
    effort: Effort,
) -> Result<Forest, BakeError> {
    if plan.runs.len() == 1 {
        let Tree { nodes, leaves, depth } = build(&geometry.corners, effort);
        return Ok(Forest { nodes, leaves, depth, bounds: geometry.bounds_of(0), ..Forest::default() });
    }
    let mut out = Forest::default();
    let of_object = |o: usize| match o.checked_sub(1).map(|p| &scene.prototypes[plan.prototypes[p] as usize]) {
        None => &scene.instances,
        Some(prototype) => &prototype.instances,
    };
    for (index, triangles) in geometry.objects.iter().enumerate() {
        let described = of_object(index);
        if let Some(prototype) = index.checked_sub(1).map(|p| &scene.prototypes[plan.prototypes[p] as usize])
            && described.is_empty()
            && triangles.is_empty()
        {
            return Err(prototype_error(prototype, "it holds no triangle with an area".into()));
        }
        let tree = build(&geometry.corners[triangles.start as usize..triangles.end as usize], effort);
        let [bounds_min, bounds_max] = geometry.bounds_of(index);
        let count = described.len() as u32;
        let things = count + u32::from(!tree.nodes.is_empty());
        let first_top = out.nodes.len() as u32;
        let capacity = if count == 0 { 0 } else { top_capacity(things) };
        let object = Object {
            bounds_min,
            bounds_max,
            first_triangle: triangles.start,
            triangles: triangles.len() as u32,
            first_node: first_top + capacity,
            nodes: tree.nodes.len() as u32,
            first_leaf: out.leaves.len() as u32,
            leaves: tree.leaves.len() as u32,
            first_top,
            top_capacity: capacity,
            first_instance: out.instances.len() as u32,
            instances: count,
            ..Object::zeroed()
        };
        out.depth = out.depth.max(tree.depth);
        out.nodes.resize(object.first_node as usize, Node::zeroed());
        out.join(&object, tree);
        out.objects.push(object);
        let object_of = |i: &Instance| plan.objects[i.prototype as usize];
        out.instances.extend(described.iter().map(|i| blob::Instance { object: object_of(i), ..Zeroable::zeroed() }));
    }
    // what is placed comes before what places it: the world last
    let nested = (1..out.objects.len()).filter(|o| out.objects[*o].instances > 0);
    for index in nested.chain([0]).collect::<Vec<_>>() {
        out.place(scene, index as u32, of_object(index))?;
    }
    let [world, ..] = &out.objects[..] else { return Ok(out) };
    out.bounds = [world.bounds_min, world.bounds_max];
    Ok(out)
}

impl Forest {
    /// Appends the tree of an object's own triangles.
    fn join(&mut self, o: &Object, tree: Tree) {
        let moved = |child: u32| match child {
            NONE => NONE,
            leaf if leaf & LEAF_BIT != 0 => leaf + o.first_leaf,
            node => node + o.first_node,
        };
        self.nodes.extend(tree.nodes.into_iter().map(|n| Node { child: n.child.map(moved), ..n }));
        let renumbered = |t: u32| if t == NONE { NONE } else { t + o.first_triangle };
        self.leaves.extend(tree.leaves.into_iter().map(|l| Leaf { triangle: l.triangle.map(renumbered), ..l }));
    }

    /// Transforms the instances of an object, and builds the tree over them.
    fn place(&mut self, scene: &SceneDescription, index: u32, described: &[Instance]) -> Result<(), BakeError> {
        let o = self.objects[index as usize];
        let own = o.first_instance as usize..(o.first_instance + o.instances) as usize;
        for (i, described) in self.instances[own].iter_mut().zip(described) {
            let keys = [described.to_world, described.to_world_end.unwrap_or(described.to_world)];
            let object = &self.objects[i.object as usize];
            let fault = |e: croupier::unstable::scene::InstanceFault| instance_error(scene, described, e.to_string());
            set_transform(i, keys, object).map_err(fault)?;
            set_hidden(i, !described.visible);
        }
        let mut scratch = vec![Primitive::zeroed(); o.instances as usize + 1];
        let mut top = TopLevel { objects: &mut self.objects, instances: &self.instances, nodes: &mut self.nodes };
        let built = top.rebuild(index, &mut scratch);
        // capacities were computed for this
        self.depth = self.depth.max(built.map_or(0, |b| b.depth));
        Ok(())
    }
}

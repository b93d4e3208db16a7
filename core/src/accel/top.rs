//! Changes of instances in a blob's own memory: transforms, what follows from them, top-level trees.

use super::build::{BuildError, Built, Primitive, build_references};
use super::refit::{node_bounds, set_bounds};
use crate::scene::blob::{
    CHILD_INDEX, INSTANCE_HIDDEN, INSTANCE_MIRRORED, INSTANCE_MOVING, Instance, LEAF_BIT, NONE, Node, Object,
};
use crate::scene::{InstanceFault, derive};

/// Sets both keys of the map of an instance, and what follows from them; `object` is what it places. The top-level tree that
/// holds it must be rebuilt or refitted before the next ray, and the areas of its lights set (`area_of` of the layer `light`).
///
/// # Errors
/// Maps that cannot be; the instance stays as it was.
pub fn set_transform(
    instance: &mut Instance,
    to_world: [[[f32; 4]; 3]; 2],
    object: &Object,
) -> Result<(), InstanceFault> {
    let facts = derive(&to_world, [object.bounds_min, object.bounds_max])?;
    let kept = instance.flags & !(INSTANCE_MIRRORED | INSTANCE_MOVING);
    (instance.to_world, instance.inverse) = (to_world, facts.inverse);
    (instance.condition, instance.flags) = (facts.condition, kept | facts.flags);
    Ok(())
}

/// Shows or hides an instance. Nothing else changes: hidden ones stay in the tree, and their lights are not sampled.
pub fn set_hidden(instance: &mut Instance, hidden: bool) {
    instance.flags = instance.flags & !INSTANCE_HIDDEN | if hidden { INSTANCE_HIDDEN } else { 0 };
}

/// Top-level trees of a blob, and what they are over.
#[derive(Debug)]
pub struct TopLevel<'a> {
    /// All objects.
    pub objects: &'a mut [Object],
    /// All instances.
    pub instances: &'a [Instance],
    /// All nodes.
    pub nodes: &'a mut [Node],
}

impl TopLevel<'_> {
    /// Primitives that [`Self::rebuild`] of object `object` needs room for.
    pub fn scratch_len(&self, object: u32) -> usize {
        self.objects.get(object as usize).map_or(0, |o| o.instances as usize + usize::from(o.nodes > 0))
    }

    /// Builds the top-level tree of an object anew, from the transforms of its instances; sets its bounds and condition. The
    /// work is linear in its instances, times their logarithm. After a change of another object than the world (0), the
    /// instances that place it must be set and the world rebuilt too; after one of the world, the scene's bounds must be
    /// those of object 0.
    ///
    /// # Errors
    /// Too little room, or runs that are not there; the tree must not be walked then.
    pub fn rebuild(&mut self, object: u32, scratch: &mut [Primitive]) -> Result<Built, BuildError> {
        let o = *self.objects.get(object as usize).ok_or(BuildError::Object(object))?;
        let (needed, room) = (self.scratch_len(object), scratch.len());
        let primitives = scratch.get_mut(..needed).ok_or(BuildError::Scratch { needed, room })?;
        let own = o.first_instance as usize..o.first_instance as usize + o.instances as usize;
        let own = self.instances.get(own).ok_or(BuildError::Object(object))?;
        let mut condition = 0.0f32;
        for (primitive, (index, i)) in primitives.iter_mut().zip((o.first_instance..).zip(own)) {
            *primitive = Primitive::new(LEAF_BIT | index & CHILD_INDEX, self.bounds_of(i));
            condition = condition.max(i.condition);
        }
        if let Some(last) = primitives.last_mut().filter(|_| o.nodes > 0) {
            let root = self.nodes.get(o.first_node as usize).ok_or(BuildError::Object(object))?;
            *last = Primitive::new(o.first_node, node_bounds(root));
        }
        let top = o.first_top as usize..o.first_top as usize + o.top_capacity as usize;
        let nodes = self.nodes.get_mut(top).ok_or(BuildError::Object(object))?;
        let built = build_references(primitives, nodes, o.first_top)?;
        if let Some(o) = self.objects.get_mut(object as usize) {
            (o.top_nodes, o.condition) = (built.nodes, condition);
            [o.bounds_min, o.bounds_max] = built.bounds;
        }
        Ok(built)
    }

    /// Makes the boxes of an object's top-level tree those of its instances as they are now, without another order of the
    /// tree; sets its bounds and condition. Cheaper than [`Self::rebuild`], but the tree gets worse with the distance
    /// that instances move.
    ///
    /// # Errors
    /// Runs that are not there.
    pub fn refit(&mut self, object: u32) -> Result<(), BuildError> {
        let o = *self.objects.get(object as usize).ok_or(BuildError::Object(object))?;
        let mut bounds = None;
        for index in (o.first_top..o.first_top + o.top_nodes).rev() {
            let mut node = *self.nodes.get(index as usize).ok_or(BuildError::Object(object))?;
            for slot in 0..8 {
                let child = node.child[slot];
                if child == NONE {
                    continue;
                }
                let below = self.nodes.get(child as usize).map(node_bounds);
                let placed = self.instances.get((child & CHILD_INDEX) as usize).map(|i| self.bounds_of(i));
                let b = if child & LEAF_BIT == 0 { below } else { placed };
                set_bounds(&mut node, slot, b.ok_or(BuildError::Object(object))?);
            }
            bounds = Some(node_bounds(&node));
            if let Some(place) = self.nodes.get_mut(index as usize) {
                *place = node;
            }
        }
        let own = o.first_instance as usize..o.first_instance as usize + o.instances as usize;
        let own = self.instances.get(own).ok_or(BuildError::Object(object))?;
        let condition = own.iter().fold(0.0f32, |m, i| m.max(i.condition));
        if let (Some(o), Some(bounds)) = (self.objects.get_mut(object as usize), bounds) {
            ([o.bounds_min, o.bounds_max], o.condition) = (bounds, condition);
        }
        Ok(())
    }

    /// Box of an instance in the space around it.
    fn bounds_of(&self, i: &Instance) -> [[f32; 3]; 2] {
        let object = self.objects.get(i.object as usize);
        let facts = object.and_then(|o| derive(&i.to_world, [o.bounds_min, o.bounds_max]).ok());
        facts.map_or([[0.0; 3]; 2], |f| f.bounds)
    }
}

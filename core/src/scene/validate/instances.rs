//! Objects and instances: runs that fill their sections, references without cycles, stored facts that follow from the
//! transforms.

use super::record::{Record, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, ObjectFault, SceneError};
use crate::scene::instances::{InstanceFault, derive};
use crate::scene::{Effects, Records};

/// `start` and `count` as a range of indices.
pub(super) fn run(start: u32, count: u32) -> core::ops::Range<usize> {
    start as usize..(start as usize).saturating_add(count as usize)
}

/// Object that a triangle belongs to, if it is one of those that instances place.
pub(super) fn placed(scene: &Records<'_>, triangle: usize) -> Option<u32> {
    let after = scene.objects.partition_point(|o| o.first_triangle as usize <= triangle);
    // objects without triangles start where the next one does
    let index = after.checked_sub(1).filter(|i| *i > 0)?;
    u32::try_from(index).ok()
}

/// The lights that instances of the world name are theirs. Each light has one instance at most, so this is linear.
pub(super) fn lights(scene: &Records<'_>) -> Result<(), SceneError> {
    let Some(world) = scene.objects.first() else { return Ok(()) };
    for (index, i) in (0u32..world.instances).zip(scene.instances) {
        let count = scene.objects.get(i.object as usize).map_or(0, |o| o.lights);
        let own = scene.lights.get(run(i.first_light, count)).unwrap_or(&[]);
        let refers_back = |l: &Light| l.kind == LightKind::Area as u32 && l.instance.checked_sub(1) == Some(index);
        if own.len() != count as usize || !own.iter().all(refers_back) {
            return Err(SceneError::Instance { instance: index, fault: InstanceFault::Lights(i.first_light) });
        }
    }
    Ok(())
}

/// An emitting triangle that an instance of the world places.
pub(super) struct Emitter {
    /// Object of the triangle.
    pub object: u32,
    /// Its number among the emitting triangles of the object.
    pub number: u32,
    /// Ways to the world when the shutter opens, innermost first.
    pub maps: [Option<[[f32; 4]; 3]>; 2],
}

/// All objects and instances; returns their effects. Trees and lights are checked later.
pub(super) fn instances(scene: &Records<'_>) -> Result<Effects, SceneError> {
    if scene.objects.is_empty() && scene.instances.is_empty() {
        return Ok(Effects::default());
    }
    let bad = |object: usize, fault| SceneError::Object { object: u32::try_from(object).unwrap_or(u32::MAX), fault };
    // first triangle, node, leaf and instance that no object has had
    let (mut triangle, mut node, mut leaf, mut instance) = (0u32, 0u32, 0u32, 0u32);
    let mut effects = Effects::INSTANCES;
    for (at, o) in records(SectionKind::Objects, scene.objects) {
        let starts = [o.first_triangle, o.first_top, o.first_leaf, o.first_instance];
        if starts != [triangle, node, leaf, instance] || Some(o.first_node) != node.checked_add(o.top_capacity) {
            return Err(bad(at.index, ObjectFault::Order));
        }
        let ends = [
            (triangle.checked_add(o.triangles), scene.triangles.len()),
            (o.first_node.checked_add(o.nodes), scene.nodes.len()),
            (leaf.checked_add(o.leaves), scene.leaves.len()),
            (instance.checked_add(o.instances), scene.instances.len()),
        ];
        if ends.iter().any(|(end, count)| end.is_none_or(|e| e as usize > *count)) {
            return Err(bad(at.index, ObjectFault::Order));
        }
        [triangle, node, leaf, instance] = ends.map(|(end, _)| end.unwrap_or(u32::MAX));
        let top = (o.instances > 0) == (o.top_nodes > 0) && o.top_nodes <= o.top_capacity;
        let own = (o.triangles > 0) == (o.nodes > 0) && (o.nodes > 0) == (o.leaves > 0);
        if !top || !own || (at.index == 0) && o.instances == 0 || o.triangles == 0 && o.instances == 0 {
            return Err(bad(at.index, ObjectFault::Empty));
        }
        at.all_within(Field::Bounds, &o.bounds_min, -MAX_COORDINATE, MAX_COORDINATE)?;
        at.all_within(Field::Bounds, &o.bounds_max, -MAX_COORDINATE, MAX_COORDINATE)?;
        o.bounds_min.iter().zip(&o.bounds_max).try_for_each(|(lo, hi)| at.within(Field::Bounds, *lo, f32::MIN, *hi))?;
        let own = scene.triangles.get(run(o.first_triangle, o.triangles)).unwrap_or(&[]);
        let emitters = own.iter().filter(|t| t.light != NONE).count();
        if o.emitters as usize != emitters {
            return Err(bad(at.index, ObjectFault::Lights(o.emitters)));
        }
    }
    let filled = [
        (triangle, scene.triangles.len()),
        (node, scene.nodes.len()),
        (leaf, scene.leaves.len()),
        (instance, scene.instances.len()),
    ];
    if filled.iter().any(|(end, count)| *end as usize != *count) || scene.instances.is_empty() {
        return Err(bad(scene.objects.len(), ObjectFault::Order));
    }
    for (at, o) in records(SectionKind::Objects, scene.objects) {
        let own = scene.instances.get(run(o.first_instance, o.instances)).unwrap_or(&[]);
        let (mut lights, mut condition) = (o.emitters, 0.0f32);
        for (index, i) in (o.first_instance..).zip(own) {
            let bad = |fault| SceneError::Instance { instance: index, fault };
            let object = scene.objects.get(i.object as usize).filter(|_| i.object > 0);
            // two levels: what instances of other objects place has none of its own
            let object = object.filter(|inner| at.index == 0 || inner.instances == 0);
            let object = object.ok_or(bad(InstanceFault::Object(i.object)))?;
            let facts = derive(&i.to_world, [object.bounds_min, object.bounds_max]).map_err(bad)?;
            let inverse = i.inverse.map(|row| row.map(f32::to_bits)) == facts.inverse.map(|row| row.map(f32::to_bits));
            let flags = i.flags & !INSTANCE_HIDDEN == facts.flags;
            if !inverse || !flags || i.condition.to_bits() != facts.condition.to_bits() {
                return Err(bad(InstanceFault::Derived));
            }
            Record { of: SectionKind::Instances, index: index as usize }.zero(i.reserved == [0; 3])?;
            if facts.flags & INSTANCE_MOVING != 0 {
                effects = effects.with(Effects::MOTION);
            }
            condition = condition.max(i.condition);
            if at.index == 0 {
                let end = i.first_light.checked_add(object.lights);
                if object.lights > 0 && end.is_none_or(|e| e as usize > scene.lights.len()) {
                    return Err(bad(InstanceFault::Lights(i.first_light)));
                }
            } else if i.first_light != lights {
                return Err(bad(InstanceFault::Lights(i.first_light)));
            }
            lights = lights.saturating_add(object.lights);
        }
        if at.index > 0 && o.lights != lights {
            return Err(bad(at.index, ObjectFault::Lights(o.lights)));
        }
        if o.condition.to_bits() != condition.to_bits() {
            return Err(at.bad(Field::Condition, o.condition));
        }
    }
    Ok(effects)
}

/// The emitting triangle behind light `index`, of the world's instance `i`.
pub(super) fn emitter(scene: &Records<'_>, index: usize, i: &Instance) -> Option<Emitter> {
    let object = scene.objects.get(i.object as usize)?;
    let within = u32::try_from(index).ok()?.checked_sub(i.first_light).filter(|n| *n < object.lights)?;
    let [outer, _] = i.to_world;
    if within < object.emitters {
        return Some(Emitter { object: i.object, number: within, maps: [None, Some(outer)] });
    }
    let inner = scene.instances.get(run(object.first_instance, object.instances))?;
    let inner = inner.get(inner.partition_point(|k| k.first_light <= within).checked_sub(1)?)?;
    let [map, _] = inner.to_world;
    let number = within.checked_sub(inner.first_light)?;
    Some(Emitter { object: inner.object, number, maps: [Some(map), Some(outer)] })
}

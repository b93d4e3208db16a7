//! Edits of instances: transforms, visibility, and what follows from them.

use super::editable::SceneEdit;
use super::error::EditError;
use crate::accel::{Primitive, TopLevel, set_hidden, set_transform};
use crate::light::{self, SceneExtent};
use crate::scene::blob::*;
use crate::scene::{Effects, Records, Scene, derive};
use core::ops::RangeInclusive;

impl SceneEdit<'_> {
    /// Moves an instance: the maps to the space around it when the shutter opens and when it closes (the same twice if it
    /// stands still). Its lights move along. The top-level trees around it are refitted once all edits are made, however many
    /// moved, in a time that grows with all their instances: 18.7 million instructions for 10,000, some 3 ms, also if one
    /// moved. After far moves [`Self::rebuild`] makes rays faster again.
    ///
    /// # Errors
    /// No such instance, or maps that cannot be: not finite, singular or nearly, or out of the range of coordinates, of an
    /// instance within another object also in the world.
    pub fn transform(&mut self, index: u32, to_world: [[[f32; 4]; 3]; 2]) -> Result<(), EditError> {
        let of = SectionKind::Instances;
        let mut instance: Instance = self.read(of, index)?;
        let object: Object = self.read(SectionKind::Objects, instance.object)?;
        set_transform(&mut instance, to_world, &object).map_err(|fault| EditError::Transform { index, fault })?;
        let around = self.object_around(index);
        if around == 0 {
            self.write(of, index, &instance);
            self.world_moved = true;
            self.settle_areas(&instance);
        } else {
            self.enlarge(around, [object.bounds_min, object.bounds_max], index, &to_world)?;
            self.write(of, index, &instance);
            let [first, last] = self.moved_within.unwrap_or([around; 2]);
            self.moved_within = Some([first.min(around), last.max(around)]);
        }
        if instance.flags & INSTANCE_MOVING != 0 {
            *self.effects = self.effects.with(Effects::MOTION);
        }
        Ok(())
    }

    /// Shows or hides an instance, with its lights.
    ///
    /// # Errors
    /// No such instance.
    pub fn visible(&mut self, index: u32, visible: bool) -> Result<(), EditError> {
        let of = SectionKind::Instances;
        let mut instance: Instance = self.read(of, index)?;
        let object: Object = self.read(SectionKind::Objects, instance.object)?;
        let before = instance.flags;
        set_hidden(&mut instance, !visible);
        self.lights_changed |= object.lights > 0 && instance.flags != before;
        self.write(of, index, &instance);
        Ok(())
    }

    /// Object whose own instance this is: those of the objects follow each other.
    fn object_around(&self, instance: u32) -> u32 {
        let after = self.records().map_or(0, |s| s.objects.partition_point(|o| o.first_instance <= instance));
        // objects without instances begin where the next one does
        after.saturating_sub(1) as u32
    }

    /// Makes the bounds of object `around` hold a box of its own instance `index`, unless an instance of the world would
    /// reach beyond the range of coordinates then. Until the object is refitted they may be too large.
    fn enlarge(
        &mut self,
        around: u32,
        placed: [[f32; 3]; 2],
        index: u32,
        to_world: &[[[f32; 4]; 3]; 2],
    ) -> Result<(), EditError> {
        let of = SectionKind::Objects;
        let mut object: Object = self.read(of, around)?;
        let check = |index, to_world, bounds| {
            derive(to_world, bounds).map_err(|fault| EditError::Transform { index, fault }).map(|facts| facts.bounds)
        };
        let [low, high] = check(index, to_world, placed)?;
        let old = [object.bounds_min, object.bounds_max];
        object.bounds_min.iter_mut().zip(low).for_each(|(x, y)| *x = x.min(y));
        object.bounds_max.iter_mut().zip(high).for_each(|(x, y)| *x = x.max(y));
        let new = [object.bounds_min, object.bounds_max];
        if new == old {
            return Ok(());
        }
        let own = self.records().map_or(&[][..], |scene| world_instances(&scene));
        for (index, i) in (0..).zip(own).filter(|(_, i)| i.object == around) {
            check(index, &i.to_world, new)?;
        }
        // not by `write`: what follows from transforms is no part of the identity
        if let Some(place) = self.table.record(of, around).and_then(|range| self.bytes.get_mut(range)) {
            place.copy_from_slice(bytemuck::bytes_of(&object));
        }
        Ok(())
    }

    /// Makes what follows from transforms right again: boxes of top-level trees, the scene's bounds, areas of lights. With
    /// `scratch` the world's tree is built anew; whether that was done.
    pub(super) fn settle_moves(&mut self, scratch: Option<&mut [Primitive]>) -> bool {
        if let Some([first, last]) = self.moved_within.take() {
            self.world_moved = true;
            // objects that the world places come before it, its boxes hold theirs
            self.with_top(|top| {
                for object in first..=last {
                    let _ = top.refit(object);
                }
            });
            let mut next = 0;
            while let Some((index, instance)) = self.next_with_lights(next, first..=last) {
                self.settle_areas(&instance);
                next = index.saturating_add(1);
            }
        }
        let mut built = false;
        if core::mem::take(&mut self.world_moved) || scratch.is_some() {
            self.with_top(|top| match scratch {
                Some(scratch) => built = top.rebuild(0, scratch).is_ok(),
                None => _ = top.refit(0),
            });
            self.settle_bounds();
        }
        built
    }

    /// The first instance of the world from `from` on whose object is in the range and has instances with lights.
    fn next_with_lights(&self, from: u32, objects: RangeInclusive<u32>) -> Option<(u32, Instance)> {
        let scene = self.records()?;
        let lit = |i: &Instance| {
            let object = scene.objects.get(i.object as usize).filter(|_| objects.contains(&i.object));
            object.is_some_and(|o| o.lights > o.emitters)
        };
        let (index, instance) = (from..).zip(world_instances(&scene).get(from as usize..)?).find(|(_, i)| lit(i))?;
        Some((index, *instance))
    }

    /// Takes over the bounds of object 0 as those of the scene, on which the power of lights without a place depends.
    fn settle_bounds(&mut self) {
        let (world, info) =
            (self.read::<Object>(SectionKind::Objects, 0), self.read::<SceneInfo>(SectionKind::Info, 0));
        let (Ok(world), Ok(info)) = (world, info) else { return };
        let (bounds_min, bounds_max) = (world.bounds_min, world.bounds_max);
        if [bounds_min, bounds_max] != [info.bounds_min, info.bounds_max] {
            self.write(SectionKind::Info, 0, &SceneInfo { bounds_min, bounds_max, ..info });
            let far = |l: &Light| {
                let [small, large] =
                    [1.0, 2.0].map(|radius| light::power(l, &SceneExtent { radius, environment: 1.0 }));
                small != large
            };
            self.lights_changed |= self.records().is_some_and(|s| s.lights.iter().any(far));
        }
    }

    /// Sets the areas of the lights of an instance of the world.
    fn settle_areas(&mut self, instance: &Instance) {
        let count = self.read::<Object>(SectionKind::Objects, instance.object).map_or(0, |o| o.lights);
        self.lights_moved |= count > 0;
        for index in (instance.first_light..=u32::MAX).zip(0..count).map(|(light, _)| light) {
            let (Some(scene), Ok(light)) = (self.records(), self.read::<Light>(SectionKind::Lights, index)) else {
                return;
            };
            let area = light::area_of(&Scene::assume_valid(scene), index, &light);
            if area > 0.0 && area.is_finite() && area.to_bits() != light.area.to_bits() {
                self.write(SectionKind::Lights, index, &Light { area, ..light });
                self.lights_changed = true;
            }
        }
    }

    /// Primitives that [`Self::rebuild`] needs room for.
    pub fn rebuild_len(&mut self) -> usize {
        let mut room = 0;
        self.with_top(|top| room = top.scratch_len(0));
        room
    }

    /// Builds the world's top-level tree anew over its instances as they are, with this memory for them
    /// ([`Self::rebuild_len`]): after moves that are large against the distances between instances. The time grows with
    /// the world's instances, times their logarithm: 74 million instructions for 10,000, some 7 ms. Other objects are
    /// refitted. It is one call, which cannot be spread over frames.
    ///
    /// # Errors
    /// [`EditError::Room`], [`EditError::Missing`] in a scene without instances, [`EditError::Fixed`] if the blob has too few
    /// nodes for some trees over them ([`top_capacity`]); the tree is as it was.
    pub fn rebuild(&mut self, scratch: &mut [Primitive]) -> Result<(), EditError> {
        let (of, index) = (SectionKind::Objects, 0);
        let world: Object = self.read(of, index)?;
        let (needed, given) = (self.rebuild_len(), scratch.len());
        if needed > given {
            return Err(EditError::Room { needed, given });
        }
        if world.top_capacity < top_capacity(needed as u32) {
            return Err(EditError::Fixed { of, index });
        }
        if self.settle_moves(Some(scratch)) { Ok(()) } else { Err(EditError::Fixed { of, index }) }
    }

    /// Calls `change` with the top-level trees, if the scene has any.
    fn with_top(&mut self, change: impl FnOnce(&mut TopLevel<'_>)) {
        let range = |kind| self.table.whole(kind);
        let of = [SectionKind::Objects, SectionKind::Instances, SectionKind::Nodes].map(range);
        let [Some(objects), Some(instances), Some(nodes)] = of else { return };
        let Ok([objects, instances, nodes]) = self.bytes.get_disjoint_mut([objects, instances, nodes]) else { return };
        let objects = bytemuck::try_cast_slice_mut::<u8, Object>(objects);
        let instances = bytemuck::try_cast_slice::<u8, Instance>(instances);
        let nodes = bytemuck::try_cast_slice_mut::<u8, Node>(nodes);
        if let (Ok(objects), Ok(instances), Ok(nodes)) = (objects, instances, nodes) {
            change(&mut TopLevel { objects, instances, nodes });
        }
    }
}

/// The world's own instances.
fn world_instances<'s>(scene: &Records<'s>) -> &'s [Instance] {
    let own = scene.objects.first().map_or(0, |world| world.instances as usize);
    scene.instances.get(..own).unwrap_or(&[])
}

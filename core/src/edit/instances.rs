//! Edits of instances: transforms, visibility, and what follows from them.

use super::editable::SceneEdit;
use super::error::EditError;
use crate::accel::{Primitive, TopLevel, set_hidden, set_transform};
use crate::light;
use crate::scene::blob::*;
use crate::scene::{Effects, Scene};

impl SceneEdit<'_> {
    /// Moves an instance: the maps to the space around it when the shutter opens and when it closes (the same twice if it
    /// stands still). Its lights move along. The top-level trees around it are refitted once all edits are made, in a time
    /// that grows with their instances; after far moves [`Self::rebuild`] makes rays faster again.
    ///
    /// # Errors
    /// No such instance, or maps that cannot be: not finite, singular or nearly, or out of the range of coordinates.
    pub fn transform(&mut self, index: u32, to_world: [[[f32; 4]; 3]; 2]) -> Result<(), EditError> {
        let of = SectionKind::Instances;
        let mut instance: Instance = self.read(of, index)?;
        let object: Object = self.read(SectionKind::Objects, instance.object)?;
        set_transform(&mut instance, to_world, &object).map_err(|fault| EditError::Transform { index, fault })?;
        self.write(of, index, &instance);
        if instance.flags & INSTANCE_MOVING != 0 {
            *self.effects = self.effects.with(Effects::MOTION);
        }
        let around = self.object_around(index);
        let [first, last] = self.moved.unwrap_or([around; 2]);
        self.moved = Some([first.min(around), last.max(around)]);
        Ok(())
    }

    /// Shows or hides an instance, with its lights.
    ///
    /// # Errors
    /// No such instance.
    pub fn visible(&mut self, index: u32, visible: bool) -> Result<(), EditError> {
        let of = SectionKind::Instances;
        let mut instance: Instance = self.read(of, index)?;
        set_hidden(&mut instance, !visible);
        self.write(of, index, &instance);
        self.lights_changed |= self.records().is_some_and(|s| s.lights.iter().any(|l| l.instance > 0));
        Ok(())
    }

    /// Object whose own instance this is.
    fn object_around(&self, instance: u32) -> u32 {
        let holds = |o: &Object| (o.first_instance..o.first_instance.saturating_add(o.instances)).contains(&instance);
        self.records().and_then(|s| s.objects.iter().position(holds)).map_or(0, |i| i as u32)
    }

    /// Brings what follows from transforms up to date: boxes of top-level trees, the scene's bounds, areas of lights.
    pub(super) fn settle_moves(&mut self, [first, last]: [u32; 2]) {
        // objects that instances place come before the world is refitted, whose boxes hold them
        for object in (first.max(1)..=last).rev() {
            self.with_top(|top| top.refit(object).is_ok());
            let placers = self.records().map_or(0, |s| s.instances.len() as u32);
            for index in 0..placers {
                let Ok(mut placer) = self.read::<Instance>(SectionKind::Instances, index) else { continue };
                let (to_world, placed) = (placer.to_world, self.read::<Object>(SectionKind::Objects, object));
                if let (true, Ok(placed)) = (placer.object == object, placed)
                    && set_transform(&mut placer, to_world, &placed).is_ok()
                {
                    self.write(SectionKind::Instances, index, &placer);
                }
            }
        }
        self.with_top(|top| top.refit(0).is_ok());
        self.settle_world();
    }

    /// Takes over what object 0 says of the whole scene, and the areas of lights in instances.
    fn settle_world(&mut self) {
        let (world, info) =
            (self.read::<Object>(SectionKind::Objects, 0), self.read::<SceneInfo>(SectionKind::Info, 0));
        if let (Ok(world), Ok(info)) = (world, info) {
            let (bounds_min, bounds_max) = (world.bounds_min, world.bounds_max);
            self.write(SectionKind::Info, 0, &SceneInfo { bounds_min, bounds_max, ..info });
        }
        let mut next = 0;
        while let Some((index, light)) = self.next_light(next, |_, l| l.instance > 0) {
            next = index.saturating_add(1);
            let Some(scene) = self.records() else { return };
            let area = light::area_of(&Scene::assume_valid(scene), index, &light);
            if area > 0.0 && area.is_finite() && area.to_bits() != light.area.to_bits() {
                self.write(SectionKind::Lights, index, &Light { area, ..light });
                self.lights_changed = true;
            }
        }
    }

    /// Room that [`Self::rebuild`] needs.
    pub fn rebuild_len(&mut self) -> usize {
        let mut room = 0;
        self.with_top(|top| {
            room = (0..top.objects.len() as u32).map(|object| top.scratch_len(object)).max().unwrap_or(0);
            true
        });
        room
    }

    /// Builds the world's top-level tree anew over its instances as they are, with this memory for them
    /// ([`Self::rebuild_len`]): after moves that are large against the distances between instances.
    ///
    /// # Errors
    /// Too little room; the tree is as it was.
    pub fn rebuild(&mut self, scratch: &mut [Primitive]) -> Result<(), EditError> {
        let none = EditError::Missing { of: SectionKind::Objects, index: 0 };
        if self.rebuild_len() > scratch.len() {
            return Err(none);
        }
        if let Some(moved) = self.moved.take() {
            self.settle_moves(moved);
        }
        let built = self.with_top(|top| top.rebuild(0, scratch).is_ok());
        self.settle_world();
        if built { Ok(()) } else { Err(none) }
    }

    /// Calls `change` with the top-level trees, if the scene has any.
    fn with_top(&mut self, change: impl FnOnce(&mut TopLevel<'_>) -> bool) -> bool {
        let range = |kind| self.table.whole(kind);
        let of = [SectionKind::Objects, SectionKind::Instances, SectionKind::Nodes].map(range);
        let [Some(objects), Some(instances), Some(nodes)] = of else { return false };
        let Ok([objects, instances, nodes]) = self.bytes.get_disjoint_mut([objects, instances, nodes]) else {
            return false;
        };
        let objects = bytemuck::try_cast_slice_mut::<u8, Object>(objects);
        let instances = bytemuck::try_cast_slice::<u8, Instance>(instances);
        let nodes = bytemuck::try_cast_slice_mut::<u8, Node>(nodes);
        let (Ok(objects), Ok(instances), Ok(nodes)) = (objects, instances, nodes) else { return false };
        change(&mut TopLevel { objects, instances, nodes })
    }
}

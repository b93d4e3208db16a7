//! A validated blob in the host's memory that may change between frames.

use super::error::EditError;
use super::light_table;
use crate::light::{self, SceneExtent};
use crate::rng::mix;
use crate::scene::blob::*;
use crate::scene::{Effects, Records, Scene, SceneError, SectionTable, Sections, check};
use bytemuck::Pod;
use core::f64::consts::PI;
use croupier_simd::{F32x8, LUMINANCE};

/// A validated scene that owns its bytes, in whatever holds them (`Vec<u8>`, `&mut [u8]`, a static array), and that may be
/// changed between frames. [`Self::scene`] shows it, in a fixed short time.
///
/// The identity of the scene changes with every edit, so that shards of another state are refused; it depends on what
/// the scene is and not on how it came about: an edit that is taken back restores it. (Light tables that were built
/// anew are another state than baked ones.)
///
/// The container must give the same bytes whenever it is asked, at the same place or moved as a whole to another multiple
/// of 4: a container that holds them itself needs that alignment (a plain `[u8; N]` has none).
///
/// ```
/// use croupier::{EditableScene, SceneError};
///
/// /// The scene seen from another place.
/// fn look_from(blob: Vec<u8>, origin: [f32; 3]) -> Result<EditableScene<Vec<u8>>, Box<dyn core::error::Error>> {
///     let mut scene = EditableScene::new(blob)?;
///     let camera = *scene.scene().camera;
///     scene.edit().camera(croupier::unstable::scene::blob::Camera { origin, ..camera })?;
///     Ok(scene)
/// }
/// assert!(look_from(Vec::new(), [0.0; 3]).is_err());
/// ```
#[derive(Debug)]
pub struct EditableScene<B> {
    bytes: B,
    table: SectionTable,
    effects: Effects,
    /// [`Records::highlight`].
    highlight: f32,
    /// [`Records::hash`], changed by edits.
    identity: u64,
    /// Largest values of the environment map.
    brightest: [f32; 3],
    /// Integral of the environment's radiance over all directions at a scale of 1, by channel.
    sky: [f64; 3],
    /// The light table is no longer the baked one.
    relit: bool,
}

/// What the identity of a scene changes by when its light table is built anew.
const RELIT: u64 = 0x9d5c_2f4b_7a61_e083;

impl<B: AsRef<[u8]>> EditableScene<B> {
    /// Validates a blob, see [`Scene::from_bytes`].
    ///
    /// # Errors
    /// The first fault found.
    pub fn new(bytes: B) -> Result<Self, SceneError> {
        let (scene, table) = Scene::validated(bytes.as_ref())?;
        let (effects, highlight) = (scene.effects, scene.highlight);
        let (identity, brightest) = (scene.hash, check::brightest(&scene));
        let sky = sky(&scene);
        Ok(Self { bytes, table, effects, highlight, identity, brightest, sky, relit: false })
    }

    /// The scene as it is now; an empty one with a hash of 0 if the container does not give the bytes any more, or not at
    /// a multiple of 4.
    pub fn scene(&self) -> Scene<'_> {
        let sections = Sections::assume_sound(self.table, self.bytes.as_ref());
        let records = Scene::records(&sections);
        let changed =
            |records| Records { effects: self.effects, highlight: self.highlight, hash: self.identity, ..records };
        Scene::assume_valid(records.map_or(Records::NOTHING, changed))
    }

    /// The bytes as they are now; see [`Self::into_bytes`].
    pub fn bytes(&self) -> &[u8] {
        self.bytes.as_ref()
    }

    /// The container with the bytes. Their header still has the hash from before the edits: [`Self::seal`] first to use
    /// them as a blob.
    pub fn into_bytes(self) -> B {
        self.bytes
    }
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> EditableScene<B> {
    /// Begins a round of edits. What they have in common (the table that chooses among lights) is brought up to date when
    /// the returned value is dropped. An error leaves its record as it was.
    pub fn edit(&mut self) -> SceneEdit<'_> {
        SceneEdit {
            bytes: self.bytes.as_mut(),
            table: &self.table,
            effects: &mut self.effects,
            highlight: &mut self.highlight,
            identity: &mut self.identity,
            brightest: self.brightest,
            sky: self.sky,
            relit: &mut self.relit,
            lights_changed: false,
            lights_moved: false,
            world_moved: false,
            moved_within: None,
        }
    }

    /// Writes the hash of the bytes as they are into their header, so that they are a blob again. Takes a pass over all
    /// bytes. The identity becomes that hash.
    pub fn seal(&mut self) {
        let bytes = self.bytes.as_mut();
        let Some((head, rest)) = bytes.split_at_mut_checked(size_of::<Header>()) else { return };
        let mut header: Header = bytemuck::pod_read_unaligned(head);
        let length = usize::try_from(header.length).unwrap_or(usize::MAX).saturating_sub(size_of::<Header>());
        let Some(content) = rest.get(..length) else { return };
        header.hash = content_hash(content);
        head.copy_from_slice(bytemuck::bytes_of(&header));
        (self.identity, self.table.hash, self.relit) = (header.hash, header.hash, false);
    }
}

/// Integral of the environment's radiance over all directions at a scale of 1, by channel; of a map bilinear in polar angle
/// and azimuth, as the kernels read it.
fn sky(scene: &Records<'_>) -> [f64; 3] {
    let Some(e) = scene.environment else { return [0.0; 3] };
    if e.kind == EnvironmentKind::Constant as u32 {
        return [4.0 * PI; 3];
    }
    let cells = f64::from(e.height.saturating_sub(1).max(1));
    let step = PI / cells;
    let sin = |turns: f64| f64::from(F32x8::splat(turns as f32).sin_cos_2pi().0.lane(0));
    // integral of the sine times a row's share, which falls from 1 to 0 at the rows beside it
    let weight = |row: u32| match f64::from(row) {
        row if row > 0.0 && row < cells => 4.0 * sin(0.25 / cells) * sin(0.25 / cells) / step * sin(0.5 * row / cells),
        _ => 1.0 - sin(0.5 / cells) / step,
    };
    let mut sum = [0.0; 3];
    for (row, texels) in (0..).zip(scene.env_texels.chunks_exact(e.width.max(1) as usize)) {
        let weight = weight(row) * 2.0 * PI / f64::from(e.width.max(1));
        for texel in texels {
            sum.iter_mut().zip(texel).for_each(|(sum, x)| *sum += weight * f64::from(*x));
        }
    }
    sum
}

/// A round of edits of an [`EditableScene`].
#[derive(Debug)]
pub struct SceneEdit<'a> {
    pub(super) bytes: &'a mut [u8],
    pub(super) table: &'a SectionTable,
    pub(super) effects: &'a mut Effects,
    highlight: &'a mut f32,
    identity: &'a mut u64,
    brightest: [f32; 3],
    sky: [f64; 3],
    relit: &'a mut bool,
    pub(super) lights_changed: bool,
    /// Lights have other places.
    pub(super) lights_moved: bool,
    /// An instance of the world has moved.
    pub(super) world_moved: bool,
    /// First and last object other than the world whose instances have moved.
    pub(super) moved_within: Option<[u32; 2]>,
}

impl SceneEdit<'_> {
    pub(super) fn records(&self) -> Option<Records<'_>> {
        Scene::records(&Sections::assume_sound(*self.table, self.bytes)).ok()
    }

    pub(super) fn read<T: Pod>(&self, of: SectionKind, index: u32) -> Result<T, EditError> {
        let bytes = self.table.record(of, index).and_then(|range| self.bytes.get(range));
        let record = bytes.filter(|b| b.len() == size_of::<T>()).map(bytemuck::pod_read_unaligned);
        record.ok_or(EditError::Missing { of, index })
    }

    /// Replaces a record that was checked.
    pub(super) fn write<T: Pod>(&mut self, of: SectionKind, index: u32, record: &T) {
        let Some(place) = self.table.record(of, index).and_then(|range| self.bytes.get_mut(range)) else { return };
        let new = bytemuck::bytes_of(record);
        if place.len() == new.len() {
            // each record counts in the identity by its place and content, whatever the order of edits
            let at = (u64::from(index) << 8 | of as u64).wrapping_mul(RELIT | 1);
            *self.identity ^= mix(content_hash(place) ^ at) ^ mix(content_hash(new) ^ at);
            place.copy_from_slice(new);
        }
    }

    /// Replaces the camera. Its `size` is only the default of settings: sessions keep theirs.
    ///
    /// # Errors
    /// A camera that breaks a rule of the blob.
    pub fn camera(&mut self, camera: Camera) -> Result<(), EditError> {
        let effects = check::camera(&camera)?;
        self.write(SectionKind::Cameras, 0, &camera);
        *self.effects = self.effects.with(effects);
        Ok(())
    }

    /// Replaces a light's emission, and the position, direction, cone, size and flags of one that has no triangle. Kind,
    /// triangle and area must be the old ones. Emission may become black and light up again; the light stays in the scene.
    ///
    /// # Errors
    /// No such light, one that breaks a rule of the blob, or one that differs in what cannot change.
    pub fn light(&mut self, index: u32, light: Light) -> Result<(), EditError> {
        let of = SectionKind::Lights;
        let old: Light = self.read(of, index)?;
        let placed = |f: &LightField| matches!(f, LightField::Position | LightField::Direction);
        let moves = LightKind::from_u32(old.kind).is_some_and(|kind| kind.fields().iter().any(placed));
        let (vector, params) = if moves { (light.vector, light.params) } else { (old.vector, old.params) };
        let has_shape = LightKind::from_u32(old.kind).is_some_and(LightKind::has_shape);
        let triangle = if has_shape { light.triangle } else { old.triangle };
        let fixed = Light { emission: light.emission, vector, params, triangle, ..old };
        if bytemuck::bytes_of(&fixed) != bytemuck::bytes_of(&light) {
            return Err(EditError::Fixed { of, index });
        }
        let scene = self.records().ok_or(EditError::Missing { of, index })?;
        check::light(&scene, index, &light)?;
        if light.emission != [0.0; 3] && scene.light_alias.is_empty() {
            // baked without any light that emits: there is no table to choose by
            return Err(EditError::Fixed { of, index });
        }
        self.lights_changed |= bytemuck::bytes_of(&old) != bytemuck::bytes_of(&light);
        self.write(of, index, &light);
        Ok(())
    }

    /// Gives all emitting triangles of a material this radiance; how many there are. Takes a pass over the lights.
    ///
    /// # Errors
    /// Radiance that breaks a rule of the blob.
    pub fn emission(&mut self, material: u32, radiance: [f32; 3]) -> Result<u32, EditError> {
        let of_material = |s: &Records<'_>, l: &Light| {
            let triangle = s.triangles.get(l.triangle as usize).filter(|_| l.kind == LightKind::Area as u32);
            triangle.is_some_and(|t| t.material == material)
        };
        let (mut next, mut changed) = (0, 0);
        while let Some((index, light)) = self.next_light(next, of_material) {
            self.light(index, Light { emission: radiance, ..light })?;
            (next, changed) = (index.saturating_add(1), changed + 1);
        }
        Ok(changed)
    }

    /// Replaces the environment's rotation and scale (of a map) or radiance (of a constant). Kind and size must be the
    /// old ones.
    ///
    /// # Errors
    /// No environment, one that breaks a rule of the blob, or one that differs in what cannot change; light from it in a scene
    /// that was baked without any.
    pub fn environment(&mut self, environment: Environment) -> Result<(), EditError> {
        let (of, index) = (SectionKind::Environment, 0);
        let old: Environment = self.read(of, index)?;
        let fixed = Environment { to_local: environment.to_local, radiance: environment.radiance, ..old };
        if bytemuck::bytes_of(&fixed) != bytemuck::bytes_of(&environment) {
            return Err(EditError::Fixed { of, index });
        }
        check::environment(&environment, self.brightest)?;
        let constant = environment.kind == EnvironmentKind::Constant as u32;
        let brightest = if constant { [1.0; 3] } else { self.brightest };
        let emits = brightest.iter().zip(&environment.radiance).any(|(x, scale)| x * scale > 0.0);
        if emits && self.records().is_some_and(|scene| scene.light_alias.is_empty()) {
            return Err(EditError::Fixed { of, index });
        }
        self.write(of, index, &environment);
        self.lights_changed |= old.radiance != environment.radiance;
        Ok(())
    }

    /// The first light from `from` on that `is` wanted.
    pub(super) fn next_light(&self, from: u32, is: impl Fn(&Records<'_>, &Light) -> bool) -> Option<(u32, Light)> {
        let scene = self.records()?;
        let rest = scene.lights.get(from as usize..)?;
        let found = rest.iter().position(|l| is(&scene, l))?;
        Some((from.saturating_add(found as u32), *rest.get(found)?))
    }

    /// Builds the table that chooses among lights, in four passes over them.
    fn relight(&mut self) {
        let Some(scene) = self.records() else { return };
        let of_channel = |e: &Environment| {
            let channels = e.radiance.iter().zip(&self.sky).zip(LUMINANCE);
            channels.map(|((scale, integral), weight)| weight * f64::from(*scale) * integral).sum()
        };
        let environment = scene.environment.map_or(0.0, of_channel);
        let extent = SceneExtent { radius: light_table::radius(scene.info), environment };
        let range = |kind| self.table.whole(kind);
        let of = [SectionKind::LightAlias, SectionKind::Lights].map(range);
        let instances = range(SectionKind::Instances).unwrap_or(0..0);
        let [Some(table), Some(lights)] = of else { return };
        let Ok([table, lights, instances]) = self.bytes.get_disjoint_mut([table, lights, instances]) else { return };
        let lights = bytemuck::try_cast_slice::<u8, Light>(lights);
        let table = bytemuck::try_cast_slice_mut::<u8, Alias>(table);
        let instances = bytemuck::try_cast_slice::<u8, Instance>(instances).unwrap_or(&[]);
        let (Ok(lights), Ok(table)) = (lights, table) else { return };
        let hidden = |l: &Light| {
            let outer = l.instance.checked_sub(1).and_then(|i| instances.get(i as usize));
            outer.is_some_and(|i| i.flags & INSTANCE_HIDDEN != 0)
        };
        light_table::build(table, |i| {
            lights.get(i as usize).filter(|l| !hidden(l)).map_or(0.0, |l| light::power(l, &extent))
        });
        if !core::mem::replace(self.relit, true) {
            *self.identity ^= RELIT;
        }
        self.refit_light_tree();
        self.find_highlight();
    }

    /// Finds what narrow lobes may show now, in a pass over materials and lights.
    pub(super) fn find_highlight(&mut self) {
        let found = self.records().map(|scene| check::highlight(&scene, self.brightest));
        *self.highlight = found.unwrap_or(0.0);
    }

    /// Makes the nodes of the light tree say what the lights are now. Which lights hang together stays.
    fn refit_light_tree(&mut self) {
        let nodes = self.records().map_or(0, |scene| scene.light_nodes.len());
        for index in 0..nodes {
            let Some(scene) = self.records().map(Scene::assume_valid) else { return };
            let Some(node) = light::light_node_of(&scene, scene.light_nodes, index) else { return };
            // not by `write`: what follows from the lights is no part of the identity
            let place = self.table.record(SectionKind::LightNodes, index as u32);
            if let Some(place) = place.and_then(|range| self.bytes.get_mut(range)) {
                place.copy_from_slice(bytemuck::bytes_of(&node));
            }
        }
    }
}

impl Drop for SceneEdit<'_> {
    fn drop(&mut self) {
        self.settle_moves(None);
        if self.lights_changed {
            self.relight();
        } else if self.lights_moved {
            self.refit_light_tree();
        }
    }
}

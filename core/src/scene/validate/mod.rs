//! Validation: proves once what everything downstream relies on. Linear in the bytes, iterative, no allocation.
//!
//! Order matters: references are checked before anything follows them.

mod alias;
mod environment;
mod geometry;
mod highlight;
mod instances;
mod light_tree;
mod lights;
mod materials;
mod media;
mod principled;
mod record;
mod tree;

use super::blob::*;
use super::error::{Field, SceneError};
use crate::scene::effects::Effects;
use crate::scene::records::Records;
use record::{Record, cross, dot64};

/// Validates all records of a scene whose sections are sound; returns the effects that it calls for.
pub(super) fn scene(scene: &Records<'_>) -> Result<Effects, SceneError> {
    info(scene.info)?;
    let camera = camera(scene.camera)?;
    names(scene)?;
    materials::textures(scene)?;
    media::media(scene)?;
    materials::materials(scene)?;
    geometry::vertices(scene)?;
    let instances = instances::instances(scene)?;
    let surfaces = geometry::triangles(scene)?;
    let lights = lights::lights(scene)?;
    let environment = environment::environment(scene)?;
    lights::table(scene, environment.emits)?;
    light_tree::light_tree(scene)?;
    tree::tree(scene)?;
    Ok(surfaces.with(instances).with(lights).with(environment.effects).with(camera))
}

/// Effects that the materials of a validated scene call for, whether or not triangles have them.
pub(super) fn effects_of_materials(scene: &Records<'_>) -> Effects {
    let of = |m: &Material| materials::effects(scene, m).with(media::effects(scene, m));
    scene.materials.iter().fold(Effects::default(), |all, m| all.with(of(m)))
}

/// Checks of single records that take the places of others in a validated scene; each gives the effects that it calls
/// for.
pub(crate) mod single {
    use super::*;

    pub(crate) fn camera(c: &Camera) -> Result<Effects, SceneError> {
        super::camera(c)
    }

    pub(crate) fn material(scene: &Records<'_>, index: u32, m: &Material) -> Result<Effects, SceneError> {
        materials::material(scene, Record { of: SectionKind::Materials, index: index as usize }, m)?;
        Ok(materials::effects(scene, m).with(media::effects(scene, m)))
    }

    pub(crate) fn light(scene: &Records<'_>, index: u32, l: &Light) -> Result<(), SceneError> {
        lights::light(scene, Record { of: SectionKind::Lights, index: index as usize }, l).map(|_| ())
    }

    pub(crate) fn environment(e: &Environment, brightest: [f32; 3]) -> Result<(), SceneError> {
        environment::placement(e, brightest)
    }

    /// A vertex of triangles that are flat or have unit normals.
    pub(crate) fn vertex(index: u32, v: &Vertex) -> Result<(), SceneError> {
        geometry::vertex(Record { of: SectionKind::Vertices, index: index as usize }, v)
    }

    /// A material that has no tables yet; its kind.
    pub(crate) fn parameters(scene: &Records<'_>, index: u32, m: &Material) -> Result<MaterialKind, SceneError> {
        materials::parameters(scene, Record { of: SectionKind::Materials, index: index as usize }, m)
    }

    /// Everything that materials refer to but their tables, and the names.
    pub(crate) fn around_materials(scene: &Records<'_>) -> Result<(), SceneError> {
        names(scene)?;
        materials::textures(scene)?;
        media::media(scene)
    }

    /// A radiance.
    pub(crate) fn emission(of: SectionKind, index: u32, rgb: &[f32; 3]) -> Result<(), SceneError> {
        Record { of, index: index as usize }.all_within(Field::Emission, rgb, 0.0, MAX_EMISSION)
    }

    pub(crate) fn brightest(scene: &Records<'_>) -> [f32; 3] {
        environment::brightest(scene)
    }

    /// [`Records::highlight`]; takes a pass over materials and lights.
    pub(crate) fn highlight(scene: &Records<'_>, brightest: [f32; 3]) -> f32 {
        highlight::highlight(scene, brightest)
    }
}

fn info(info: &SceneInfo) -> Result<(), SceneError> {
    let at = Record { of: SectionKind::Info, index: 0 };
    at.all_within(Field::Bounds, &info.bounds_min, -MAX_COORDINATE, MAX_COORDINATE)?;
    at.all_within(Field::Bounds, &info.bounds_max, -MAX_COORDINATE, MAX_COORDINATE)?;
    let pairs = info.bounds_min.iter().zip(&info.bounds_max);
    pairs.into_iter().try_for_each(|(lo, hi)| at.within(Field::Bounds, *lo, f32::MIN, *hi))
}

/// The axes must span space, so that no pixel has a direction of length 0; how long they are does not matter.
fn camera(c: &Camera) -> Result<Effects, SceneError> {
    let at = Record { of: SectionKind::Cameras, index: 0 };
    let kind = CameraKind::from_u32(c.kind).ok_or(SceneError::Kind { of: at.of, index: at.index(), found: c.kind })?;
    at.position(&c.origin)?;
    at.unit(c.forward)?;
    at.all_within(Field::ImagePlane, &c.right, -MAX_COORDINATE, MAX_COORDINATE)?;
    at.all_within(Field::ImagePlane, &c.down, -MAX_COORDINATE, MAX_COORDINATE)?;
    let [forward, right, down] = [c.forward, c.right, c.down].map(|v| v.map(f64::from));
    let volume = dot64(cross(right, down), forward);
    let lengths = dot64(right, right) * dot64(down, down);
    if volume * volume <= 1e-12 * lengths {
        return Err(at.bad(Field::ImagePlane, volume as f32));
    }
    if kind == CameraKind::Panoramic {
        at.unit(c.right)?;
        at.unit(c.down)?;
    }
    let widest = if kind == CameraKind::Perspective { MAX_COORDINATE } else { 0.0 };
    at.within(Field::LensRadius, c.lens_radius, 0.0, widest)?;
    let nearest = if c.lens_radius > 0.0 { f32::MIN_POSITIVE } else { -MAX_COORDINATE };
    at.within(Field::FocusDistance, c.focus_distance, nearest, MAX_COORDINATE)?;
    let [width, height] = c.size;
    at.side(Field::Width, width, 1)?;
    at.side(Field::Height, height, 1)?;
    let lens = if c.lens_radius > 0.0 { Effects::LENS } else { Effects::default() };
    Ok(if kind == CameraKind::Perspective { lens } else { lens.with(Effects::PROJECTIONS) })
}

fn names(scene: &Records<'_>) -> Result<(), SceneError> {
    let lines = scene.names.iter().filter(|b| **b == b'\n').count();
    let whole = scene.names.last().is_none_or(|b| *b == b'\n') && core::str::from_utf8(scene.names).is_ok();
    // those behind the materials are objects'
    if whole && (scene.names.is_empty() || lines >= scene.materials.len()) {
        return Ok(());
    }
    let materials = u32::try_from(scene.materials.len()).unwrap_or(u32::MAX);
    Err(SceneError::Names { lines: lines as u64, materials })
}

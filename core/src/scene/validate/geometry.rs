//! Vertices and triangles.

use super::record::{Record, records};
use super::{instances, materials, media};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError};
use crate::scene::{Effects, Records};

/// Positions and texture coordinates are finite and not huge; normals are finite.
pub(super) fn vertices(scene: &Records<'_>) -> Result<(), SceneError> {
    records(SectionKind::Vertices, scene.vertices).try_for_each(|(at, v)| vertex(at, v))
}

/// One vertex.
pub(super) fn vertex(at: Record, v: &Vertex) -> Result<(), SceneError> {
    at.position(&v.p)?;
    at.finite(Field::Direction, &v.n)?;
    at.all_within(Field::TextureCoordinate, &v.uv, -MAX_COORDINATE, MAX_COORDINATE)
}

/// Triangles refer to vertices, materials and lights that exist; smooth ones to unit normals. Returns the effects of
/// the materials they use and of the media behind them. That a light refers back is for `lights` to check.
///
/// A triangle of no area is allowed: no ray hits it, so nothing divides by its area.
pub(super) fn triangles(scene: &Records<'_>) -> Result<Effects, SceneError> {
    let mut effects = Effects::default();
    for (at, t) in records(SectionKind::Triangles, scene.triangles) {
        at.zero(t.flags & ((1 << TRIANGLE_OBJECT_SHIFT) - 1) & !TRIANGLE_SMOOTH == 0)?;
        let smooth = t.flags & TRIANGLE_SMOOTH != 0;
        for v in t.vertex {
            let vertex = at.follow(SectionKind::Vertices, v, scene.vertices)?;
            if smooth {
                Record { of: SectionKind::Vertices, index: v as usize }.unit(vertex.n)?;
            }
        }
        let material = at.follow(SectionKind::Materials, t.material, scene.materials)?;
        effects = effects.with(materials::effects(scene, material)).with(media::effects(scene, material));
        if smooth {
            effects = effects.with(Effects::SMOOTH_NORMALS);
        }
        let object = instances::placed(scene, at.index).and_then(|o| scene.objects.get(o as usize));
        match object {
            None => world_light(scene, at, t)?,
            Some(o) if t.light != NONE && t.light >= o.emitters => {
                return Err(at.wrong_reference(SectionKind::Lights, t.light, o.emitters as usize));
            }
            Some(_) => {}
        }
    }
    Ok(effects)
}

/// The light of a triangle that is in the world itself.
fn world_light(scene: &Records<'_>, at: Record, t: &Triangle) -> Result<(), SceneError> {
    if t.light != NONE {
        let light = at.follow(SectionKind::Lights, t.light, scene.lights)?;
        if light.kind != LightKind::Area as u32 || light.triangle as usize != at.index || light.instance != 0 {
            return Err(at.wrong_reference(SectionKind::Lights, t.light, scene.lights.len()));
        }
    }
    Ok(())
}

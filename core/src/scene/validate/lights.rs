//! Lights and the table that chooses among them.

use super::{Record, alias, cross, dot64, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError, SectionFault};
use crate::scene::{Effects, Records};

/// Every light, then the alias table. Triangles have been checked.
pub(super) fn lights(scene: &Records<'_>) -> Result<Effects, SceneError> {
    let mut effects = Effects::default();
    let mut any = false;
    for (at, l) in records(SectionKind::Lights, scene.lights) {
        let kind = LightKind::from_u32(l.kind);
        let kind = kind.ok_or(SceneError::Kind { of: at.of, index: at.index(), found: l.kind })?;
        at.zero(l.reserved == [0; 2])?;
        at.within(Field::Probability, l.probability, 0.0, 1.0)?;
        any |= l.probability > 0.0;
        at.all_within(Field::Emission, &l.emission, 0.0, MAX_EMISSION)?;
        at.finite(Field::Area, &[l.area])?;
        at.finite(Field::Direction, &l.vector)?;
        match kind {
            LightKind::Area => {
                area(scene, at, l)?;
                effects = effects.with(Effects::AREA_LIGHTS);
            }
            LightKind::Environment => {
                // The one environment refers to it, so there is at most one such light.
                if scene.environment.is_none_or(|e| e.light as usize != at.index) {
                    return Err(at.wrong_reference(
                        SectionKind::Environment,
                        0,
                        usize::from(scene.environment.is_some()),
                    ));
                }
            }
            LightKind::Point => {
                at.position(&l.vector)?;
                effects = effects.with(Effects::DELTA_LIGHTS);
            }
            LightKind::Directional => {
                at.unit(l.vector)?;
                effects = effects.with(Effects::DELTA_LIGHTS);
            }
        }
    }
    // Without a light to pick there is no table: picking from it would divide by a probability of 0.
    if scene.light_alias.len() != if any { scene.lights.len() } else { 0 } {
        let fault = SectionFault::Count(scene.light_alias.len() as u64);
        return Err(SceneError::Section { kind: SectionKind::LightAlias, fault });
    }
    if any {
        alias::well_formed(SectionKind::LightAlias, 0, scene.light_alias)?;
        alias::consistent(SectionKind::LightAlias, 0, scene.light_alias)?;
        // The same number twice: selection reads one, MIS the other.
        for ((at, l), a) in records(SectionKind::Lights, scene.lights).zip(scene.light_alias) {
            at.within(Field::Probability, l.probability, a.probability, a.probability)?;
        }
    }
    Ok(effects)
}

/// An emitting triangle: both name each other, and area and emission are what a ray that hits it finds.
fn area(scene: &Records<'_>, at: Record, l: &Light) -> Result<(), SceneError> {
    let t = at.follow(SectionKind::Triangles, l.triangle, scene.triangles)?;
    if t.light as usize != at.index {
        return Err(at.wrong_reference(SectionKind::Triangles, l.triangle, scene.triangles.len()));
    }
    let mut corners = [[0.0f64; 3]; 3];
    for (corner, v) in corners.iter_mut().zip(t.vertex) {
        *corner = at.follow(SectionKind::Vertices, v, scene.vertices)?.p.map(f64::from);
    }
    let [[ax, ay, az], b, c] = corners;
    let [ab, ac] = [b, c].map(|[x, y, z]| [x - ax, y - ay, z - az]);
    let normal = cross(ab, ac);
    // (2 area)^2, so that no square root is needed: a relative 2e-3 here is 1e-3 of the area.
    let (stated, actual) = (4.0 * f64::from(l.area) * f64::from(l.area), dot64(normal, normal));
    at.within(Field::Area, l.area, f32::MIN_POSITIVE, f32::MAX)?;
    if (stated - actual).abs() > 2e-3 * actual {
        return Err(at.bad(Field::Area, l.area));
    }
    let m = at.follow(SectionKind::Materials, t.material, scene.materials)?;
    m.emission.iter().zip(&l.emission).try_for_each(|(m, l)| at.within(Field::Emission, *l, *m, *m))
}

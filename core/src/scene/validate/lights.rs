//! Lights and the table that chooses among them.

use super::alias;
use super::instances;
use super::record::{Record, cross, dot64, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError, SectionFault};
use crate::scene::{Effects, Records};

/// Every light. Triangles have been checked.
pub(super) fn lights(scene: &Records<'_>) -> Result<Effects, SceneError> {
    instances::lights(scene)?;
    let mut effects = Effects::default();
    let mut first_shape = None;
    for (at, l) in records(SectionKind::Lights, scene.lights) {
        let kind = light(scene, at, l)?;
        match (kind.has_shape(), first_shape) {
            (true, None) => first_shape = Some(at.index()),
            (true, Some(first)) if at.index().saturating_sub(first) as usize >= MAX_SHAPE_LIGHTS => {
                return Err(SceneError::ShapeLights { light: at.index() });
            }
            (false, Some(_)) => return Err(SceneError::ShapeLights { light: at.index().saturating_sub(1) }),
            _ => (),
        }
        // The environment's own kind says what it calls for.
        if !kind.fields().contains(&LightField::Environment) {
            effects = effects.with(Effects::of_light(kind));
        }
    }
    Ok(effects)
}

/// One light; its kind.
pub(super) fn light(scene: &Records<'_>, at: Record, l: &Light) -> Result<LightKind, SceneError> {
    let kind = LightKind::from_u32(l.kind);
    let kind = kind.ok_or(SceneError::Kind { of: at.of, index: at.index(), found: l.kind })?;
    at.zero((l.instance == 0 || kind == LightKind::Area) && unused_params_are_zero(kind, &l.params))?;
    at.finite(Field::Area, &[l.area])?;
    at.finite(Field::Direction, &l.vector)?;
    field(scene, at, l, LightField::Emission)?;
    kind.fields().iter().try_for_each(|f| field(scene, at, l, *f))?;
    Ok(kind)
}

/// Are the words of `params` that the kind does not use 0?
fn unused_params_are_zero(kind: LightKind, params: &[f32; 6]) -> bool {
    let words = |field: &LightField| match field {
        LightField::Cone => 5,
        LightField::Disk | LightField::Radius => 1,
        LightField::Circle => 4,
        LightField::HalfEdges => 6,
        _ => 0,
    };
    let used = kind.fields().iter().map(words).sum();
    params.iter().skip(used).all(|p| p.to_bits() == 0)
}

/// One field of a light that uses it.
fn field(scene: &Records<'_>, at: Record, l: &Light, field: LightField) -> Result<(), SceneError> {
    match field {
        LightField::Triangle => area(scene, at, l),
        LightField::Environment => {
            // The one environment refers to it, so there is at most one such light.
            if scene.environment.is_some_and(|e| e.light as usize == at.index) {
                return Ok(());
            }
            let there_are = usize::from(scene.environment.is_some());
            Err(at.wrong_reference(SectionKind::Environment, 0, there_are))
        }
        LightField::Position => at.position(&l.vector),
        LightField::Direction => at.unit(l.vector),
        LightField::Cone => {
            let [x, y, z, outer, inner, _] = l.params;
            at.unit([x, y, z])?;
            at.within(Field::Cone, outer, f32::MIN_POSITIVE, 2.0)?;
            at.within(Field::Cone, inner, 0.0, outer)
        }
        LightField::Disk => {
            let [width, ..] = l.params;
            at.within(Field::Cone, width, f32::MIN_POSITIVE, 1.0)
        }
        LightField::Shape => at.zero(l.triangle & !(SHAPE_TWO_SIDED | SHAPE_HIDDEN) == 0),
        LightField::Radius => {
            let [radius, ..] = l.params;
            size(at, radius)
        }
        LightField::HalfEdges => half_edges(at, l.params),
        LightField::Circle => {
            let [x, y, z, radius, ..] = l.params;
            at.unit([x, y, z])?;
            size(at, radius)
        }
        LightField::Emission => at.all_within(Field::Emission, &l.emission, 0.0, MAX_EMISSION),
    }
}

/// A radius, or the length of half an edge.
fn size(at: Record, x: f32) -> Result<(), SceneError> {
    let [lo, hi] = SHAPE_SIZE_RANGE;
    at.within(Field::ShapeSize, x, lo, hi)
}

/// Both halves of edges of a rectangle.
fn half_edges(at: Record, [a, b, c, x, y, z]: [f32; 6]) -> Result<(), SceneError> {
    let [_, widest] = SHAPE_SIZE_RANGE;
    at.all_within(Field::ShapeSize, &[a, b, c, x, y, z], -widest, widest)?;
    let [u, v] = [[a, b, c], [x, y, z]].map(|e| e.map(f64::from));
    let [lo, hi] = SHAPE_SIZE_RANGE.map(|x| f64::from(x) * f64::from(x));
    for e in [u, v] {
        // squares: no square root is needed
        if !(lo..=hi).contains(&dot64(e, e)) {
            return Err(at.bad(Field::ShapeSize, e.iter().fold(0.0, |m: f64, x| m.max(x.abs())) as f32));
        }
    }
    let [uu, vv] = [dot64(u, u), dot64(v, v)];
    let cos_sqr = dot64(u, v) * dot64(u, v) / (uu * vv);
    at.within(Field::Edges, cos_sqr as f32, 0.0, 1e-6)
}

/// The table that chooses among the lights; only where none emits may it be missing, and only where none can be seen to
/// emit may all probabilities be 0.
pub(super) fn table(scene: &Records<'_>, environment_emits: bool) -> Result<(), SceneError> {
    let (of, table) = (SectionKind::LightAlias, scene.light_alias);
    let emits = environment_emits || scene.lights.iter().any(|l| l.emission != [0.0; 3]);
    if table.is_empty() && !emits {
        return Ok(());
    }
    if table.len() != scene.lights.len() {
        return Err(SceneError::Section { kind: of, fault: SectionFault::Count(table.len() as u64) });
    }
    alias::well_formed(of, 0, table)?;
    // where all that emit are hidden, no light has a share
    let hidden = |l: &Light| {
        let outer = l.instance.checked_sub(1).and_then(|i| scene.instances.get(i as usize));
        outer.is_some_and(|i| i.flags & INSTANCE_HIDDEN != 0)
    };
    let shines = environment_emits || scene.lights.iter().any(|l| l.emission != [0.0; 3] && !hidden(l));
    if !shines && table.iter().all(|a| a.probability == 0.0) {
        return Ok(());
    }
    alias::consistent(of, 0, table)
}

/// An emitting triangle: both name each other, and the area is that of the triangle in the world.
fn area(scene: &Records<'_>, at: Record, l: &Light) -> Result<(), SceneError> {
    let t = at.follow(SectionKind::Triangles, l.triangle, scene.triangles)?;
    let wrong = at.wrong_reference(SectionKind::Triangles, l.triangle, scene.triangles.len());
    let maps = match (l.instance.checked_sub(1), instances::placed(scene, l.triangle as usize)) {
        (None, None) if t.light as usize == at.index => [None; 2],
        (Some(index), Some(object)) => {
            let i = at.follow(SectionKind::Instances, index, scene.instances)?;
            let world = scene.objects.first().is_some_and(|o| index < o.instances);
            let found = instances::emitter(scene, at.index, i).filter(|e| world && e.object == object);
            found.filter(|e| e.number == t.light).ok_or(wrong)?.maps
        }
        _ => return Err(wrong),
    };
    let mut corners = [[0.0f64; 3]; 3];
    for (corner, v) in corners.iter_mut().zip(t.vertex) {
        *corner = at.follow(SectionKind::Vertices, v, scene.vertices)?.p.map(f64::from);
        for map in maps.into_iter().flatten() {
            let [x, y, z] = *corner;
            *corner = map.map(|row| {
                let [a, b, c, t] = row.map(f64::from);
                a * x + b * y + c * z + t
            });
        }
    }
    let [[ax, ay, az], b, c] = corners;
    let [ab, ac] = [b, c].map(|[x, y, z]| [x - ax, y - ay, z - az]);
    let normal = cross(ab, ac);
    // (2 area)^2, so that no square root is needed: a relative 2e-3 here is 1e-3 of the area.
    let (stated, actual) = (4.0 * f64::from(l.area) * f64::from(l.area), dot64(normal, normal));
    at.within(Field::Area, l.area, f32::MIN_POSITIVE, f32::MAX)?;
    if (stated - actual).abs() <= 2e-3 * actual { Ok(()) } else { Err(at.bad(Field::Area, l.area)) }
}

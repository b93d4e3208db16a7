//! Reasons for which a scene calls for its effects, as data: what of it uses each. Counts are of what triangles use;
//! materials, textures and media that no triangle leads to do not count.
//!
//! The table is `REASONS`, a row per effect; effects of materials need none.

use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::profile::AnyProfile;
use croupier::unstable::scene::blob::{
    CameraKind, INSTANCE_MOVING, LightKind, MATERIAL_COMPENSATED, MATERIAL_CUTOUT, MAX_INSTANCE_DEPTH, Material,
    MaterialKind, MediumKind, NONE, Object, PrincipledTexture, TRIANGLE_SMOOTH,
};
use serde::{Serialize, Serializer};
use std::collections::BTreeSet;
use std::fmt;

/// A fact about what uses an effect.
#[derive(Clone, Debug, PartialEq)]
pub enum Fact {
    /// How many of something there are: its name in the singular and in the plural.
    Count([&'static str; 2], usize),
    /// A number by its name.
    Number(&'static str, f32),
    /// A colour by its name.
    Colour(&'static str, [f32; 3]),
    /// Columns and rows by their name.
    Size(&'static str, [u32; 2]),
    /// Sizes of grids, by the name of the list.
    Sizes(&'static str, Vec<[u32; 3]>),
}

impl Fact {
    /// Name of the fact in JSON.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Count([_, name], _) | Self::Number(name, _) | Self::Colour(name, _) => name,
            Self::Size(name, _) | Self::Sizes(name, _) => name,
        }
    }
}

/// The fact in words: `9 materials`, `radius 0.1`, `48x72x48`.
impl fmt::Display for Fact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count([one, many], n) => write!(f, "{n} {}", if *n == 1 { one } else { many }),
            Self::Number(name, x) => write!(f, "{} {x}", name.replace('_', " ")),
            Self::Colour(name, [r, g, b]) => write!(f, "{} {r} {g} {b}", name.replace('_', " ")),
            Self::Size(_, [width, height]) => write!(f, "{width}x{height}"),
            Self::Sizes(_, sizes) => {
                let size = |[x, y, z]: &[u32; 3]| format!("{x}x{y}x{z}");
                f.write_str(&sizes.iter().map(size).collect::<Vec<_>>().join(", "))
            }
        }
    }
}

impl Serialize for Fact {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Count(_, n) => n.serialize(s),
            Self::Number(_, x) => x.serialize(s),
            Self::Colour(_, rgb) => rgb.serialize(s),
            Self::Size(_, size) => size.serialize(s),
            Self::Sizes(_, sizes) => sizes.serialize(s),
        }
    }
}

/// An effect that a scene calls for, with what uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct Reason {
    /// The effect, one bit.
    pub effect: Effects,
    /// Name of the effect.
    pub name: &'static str,
    /// What uses it.
    pub facts: Vec<Fact>,
}

/// `textures: 9 materials, 4 images`.
impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let facts: Vec<_> = self.facts.iter().map(Fact::to_string).collect();
        write!(f, "{}: {}", self.name, facts.join(", "))
    }
}

/// An object with the key `effect` and one key per fact.
impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let facts = self.facts.iter().map(|f| (f.name(), serde_json::json!(f)));
        s.collect_map([("effect", serde_json::json!(self.name))].into_iter().chain(facts))
    }
}

/// What the triangles of a scene use.
struct Census<'a> {
    scene: &'a Scene<'a>,
    /// Triangles of each material.
    triangles: Vec<usize>,
    /// Triangles with shading normals, and the materials that they have.
    smooth: (usize, BTreeSet<u32>),
}

impl<'a> Census<'a> {
    fn of(scene: &'a Scene<'a>) -> Self {
        let mut census = Self { scene, triangles: vec![0; scene.materials.len()], smooth: (0, BTreeSet::new()) };
        for t in scene.triangles {
            census.triangles[t.material as usize] += 1;
            if t.flags & TRIANGLE_SMOOTH != 0 {
                census.smooth.0 += 1;
                census.smooth.1.insert(t.material);
            }
        }
        census
    }

    /// Materials in use for which `holds`, each with its number of triangles.
    fn materials(&self, holds: impl Fn(&Material) -> bool) -> Vec<(&'a Material, usize)> {
        let used = self.scene.materials.iter().zip(self.triangles.iter().copied());
        used.filter(|(m, triangles)| *triangles > 0 && holds(m)).collect()
    }

    /// How many such materials and triangles there are.
    fn surfaces(&self, holds: impl Fn(&Material) -> bool) -> Vec<Fact> {
        let found = self.materials(holds);
        vec![materials(found.len()), triangles(found.iter().map(|(_, triangles)| triangles).sum())]
    }

    /// Textures that materials have, among those that `holds`; of principled ones only that of `which`, if it is given.
    fn textures(&self, which: Option<PrincipledTexture>, holds: impl Fn(&Material) -> bool) -> Vec<Fact> {
        let of = |m: &Material| -> Vec<u32> {
            let own = (which.is_none() && m.texture != NONE).then_some(m.texture);
            let records = self.scene.principled(m).map_or(&[][..], |r| match which {
                None => &r.textures,
                Some(which) => &r.textures[which as usize..][..1],
            });
            own.into_iter().chain(records.iter().map(|t| t.texture).filter(|t| *t != NONE)).collect()
        };
        let found = self.materials(|m| holds(m) && !of(m).is_empty());
        let images: BTreeSet<u32> = found.iter().flat_map(|(m, _)| of(m)).collect();
        vec![materials(found.len()), Fact::Count(["image", "images"], images.len())]
    }

    fn lights(&self, kind: LightKind) -> usize {
        self.scene.lights.iter().filter(|l| l.kind == kind as u32).count()
    }

    /// Kinds and cells of the media in use.
    fn media(&self) -> Vec<(MediumKind, [u32; 3])> {
        let media: BTreeSet<u32> = self.materials(|m| m.medium != NONE).iter().map(|(m, _)| m.medium).collect();
        let media = media.into_iter().filter_map(|i| self.scene.media.get(i as usize));
        media.filter_map(|m| Some((MediumKind::from_u32(m.kind)?, m.cells))).collect()
    }

    fn grids(&self) -> Vec<[u32; 3]> {
        self.media().into_iter().filter(|(kind, _)| *kind == MediumKind::Grid).map(|(_, cells)| cells).collect()
    }
}

fn materials(n: usize) -> Fact {
    Fact::Count(["material", "materials"], n)
}

fn triangles(n: usize) -> Fact {
    Fact::Count(["triangle", "triangles"], n)
}

/// Triangles of an object, those that its instances place included.
fn placed_triangles(scene: &Scene<'_>, o: &Object, level: u32) -> u64 {
    let own = (o.first_instance as usize..).take(if level < MAX_INSTANCE_DEPTH { o.instances as usize } else { 0 });
    let object = |i: usize| scene.instances.get(i).and_then(|i| scene.objects.get(i.object as usize));
    u64::from(o.triangles) + own.filter_map(object).map(|o| placed_triangles(scene, o, level + 1)).sum::<u64>()
}

/// What uses an effect.
type Facts = fn(&Census<'_>) -> Vec<Fact>;

/// Facts by effect; effects of materials are counted by their kind.
const REASONS: &[(Effects, Facts)] = &[
    (Effects::TEXTURES, |c| c.textures(None, |_| true)),
    (Effects::AREA_LIGHTS, |c| vec![triangles(c.lights(LightKind::Area))]),
    (Effects::ENVIRONMENT, |c| c.scene.environment.iter().map(|e| Fact::Size("size", [e.width, e.height])).collect()),
    (Effects::CONSTANT, |c| c.scene.environment.iter().map(|e| Fact::Colour("radiance", e.radiance)).collect()),
    (Effects::DELTA_LIGHTS, |c| {
        let count = |kind: LightKind, names| Some(Fact::Count(names, c.lights(kind))).filter(|_| c.lights(kind) > 0);
        let point = count(LightKind::Point, ["point light", "point lights"]);
        let directional = count(LightKind::Directional, ["directional light", "directional lights"]);
        let spot = count(LightKind::Spot, ["spot light", "spot lights"]);
        let sun = count(LightKind::Sun, ["sun", "suns"]);
        [point, directional, spot, sun].into_iter().flatten().collect()
    }),
    (Effects::SHAPE_LIGHTS, |c| {
        let count = |kind: LightKind, names| Some(Fact::Count(names, c.lights(kind))).filter(|_| c.lights(kind) > 0);
        let sphere = count(LightKind::Sphere, ["sphere light", "sphere lights"]);
        let rectangle = count(LightKind::Rectangle, ["rectangle light", "rectangle lights"]);
        let disk = count(LightKind::Disk, ["disk light", "disk lights"]);
        [sphere, rectangle, disk].into_iter().flatten().collect()
    }),
    (Effects::LENS, |c| {
        let camera = c.scene.camera;
        vec![Fact::Number("radius", camera.lens_radius), Fact::Number("focus_distance", camera.focus_distance)]
    }),
    (Effects::SMOOTH_NORMALS, |c| vec![materials(c.smooth.1.len()), triangles(c.smooth.0)]),
    (Effects::MEDIA, |c| {
        let (media, grids) = (c.media().len(), c.grids().len());
        let of = |n: usize, names| (n > 0).then_some(Fact::Count(names, n));
        let homogeneous = of(media.saturating_sub(grids), ["homogeneous medium", "homogeneous media"]);
        homogeneous.into_iter().chain(of(grids, ["grid", "grids"])).collect()
    }),
    (Effects::GRID_MEDIA, |c| vec![Fact::Sizes("cells", c.grids())]),
    (Effects::ALPHA, |c| c.textures(None, |m| m.flags & MATERIAL_CUTOUT != 0)),
    (Effects::INSTANCES, |c| {
        let objects = c.scene.objects.len().saturating_sub(1);
        let placed: u64 = c.scene.objects.first().map_or(0, |world| placed_triangles(c.scene, world, 0));
        vec![
            Fact::Count(["instance", "instances"], c.scene.instances.len()),
            Fact::Count(["object", "objects"], objects),
            Fact::Count(["triangle in the world", "triangles in the world"], placed as usize),
        ]
    }),
    (Effects::MOTION, |c| {
        let moving = c.scene.instances.iter().filter(|i| i.flags & INSTANCE_MOVING != 0).count();
        vec![Fact::Count(["moving instance", "moving instances"], moving)]
    }),
    (Effects::MULTIPLE_SCATTERING, |c| c.surfaces(|m| m.flags & MATERIAL_COMPENSATED != 0)),
    (Effects::NORMAL_MAPS, |c| c.textures(Some(PrincipledTexture::Normal), |_| true)),
    (Effects::PROJECTIONS, |c| match CameraKind::from_u32(c.scene.camera.kind) {
        Some(CameraKind::Orthographic) => vec![Fact::Count(["orthographic camera", "orthographic cameras"], 1)],
        Some(CameraKind::Panoramic) => vec![Fact::Count(["panoramic camera", "panoramic cameras"], 1)],
        Some(CameraKind::Perspective) | None => vec![],
    }),
];

/// Every effect that a scene calls for, in the order of their bits, with what uses it.
pub fn reasons(scene: &Scene<'_>) -> Vec<Reason> {
    let census = Census::of(scene);
    let called_for = Effects::NAMES.iter().filter(|(effect, _)| scene.effects.contains(*effect));
    let reason = |&(effect, name): &(Effects, &'static str)| {
        let row = REASONS.iter().find(|(e, _)| *e == effect);
        let of_kind = |m: &Material| MaterialKind::from_u32(m.kind).map(Effects::of_material) == Some(effect);
        Reason { effect, name, facts: row.map_or_else(|| census.surfaces(of_kind), |(_, facts)| facts(&census)) }
    };
    called_for.map(reason).collect()
}

/// Effects that the scene's profile contains although the scene does not call for them.
pub fn beyond(scene: &Scene<'_>) -> Vec<&'static str> {
    AnyProfile::smallest(scene.effects).effects().without(scene.effects).names().collect()
}

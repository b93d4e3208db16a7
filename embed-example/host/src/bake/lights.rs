//! Lights, the table that chooses among them, the environment.

use super::geometry::{Geometry, area, radius};
use super::instances::Forest;
use super::{BakeError, emission};
use crate::description::{Emitter, Environment, LightShape, Model, SceneDescription, ShapeLight};
use crate::math::Std;
use crate::{alias, environment};
use bytemuck::Zeroable;
use croupier::Scene;
use croupier::unstable::compose::{FieldError, LightSource, MIN_CONE_DEG, Sides};
use croupier::unstable::light::{LightTree, build_light_tree, luminance};
use croupier::unstable::scene::blob::{self, Alias, EnvironmentKind, Light, LightKind, LightNode, NONE, SceneInfo};
use croupier::unstable::scene::blob::{LIGHT_TREE_MIN, MAX_EMISSION, MAX_SHAPE_LIGHTS, MAX_SIDE};
use croupier::unstable::scene::{Field, Records};
use glam::DVec3;
use std::ops::Range;

/// Sections of the blob.
#[derive(Default)]
pub(super) struct Lights {
    pub lights: Vec<Light>,
    pub alias: Vec<Alias>,
    /// Light tree, in scenes with many lights.
    pub nodes: Vec<LightNode>,
    pub trails: Vec<u32>,
    /// None or one.
    pub environment: Vec<blob::Environment>,
    pub env_texels: Vec<[f32; 3]>,
    pub env_alias: Vec<Alias>,
}

/// Emission is from 0 to what the blob allows.
fn check_emission(emitter: &str, what: &'static str, rgb: [f32; 3]) -> Result<(), BakeError> {
    let bad = rgb.into_iter().find(|x| !(0.0..=MAX_EMISSION).contains(x));
    bad.map_or(Ok(()), |found| Err(BakeError::Emitter { emitter: emitter.into(), what, found }))
}

/// Radiance per material; black ones do not emit.
pub(super) fn emission_of_materials(scene: &SceneDescription) -> Result<Vec<[f32; 3]>, BakeError> {
    let mut emission: Vec<Option<[f32; 3]>> = vec![None; scene.materials.len()];
    for (i, e) in scene.emitters.iter().enumerate() {
        let Emitter::Area { material: found, radiance } = *e else { continue };
        let emitter = format!("emitter {i} (area)");
        match emission.get_mut(found as usize) {
            None => return Err(BakeError::EmitterMaterial { emitter, found, repeated: false }),
            Some(Some(_)) => return Err(BakeError::EmitterMaterial { emitter, found, repeated: true }),
            Some(slot) => *slot = Some(radiance),
        }
        check_emission(&emitter, "radiance", radiance)?;
    }
    for (i, m) in scene.materials.iter().enumerate() {
        let Model::Principled(p) = &m.model else { continue };
        if p.emission == [0.0; 3] {
            continue;
        }
        check_emission(&m.name, "emission", p.emission)?;
        if emission[i].replace(p.emission).is_some() {
            let emitter = format!("emission of material `{}`", m.name);
            return Err(BakeError::EmitterMaterial { emitter, found: i as u32, repeated: true });
        }
    }
    Ok(emission.into_iter().map(Option::unwrap_or_default).collect())
}

/// Makes the lights and tells the triangles and instances theirs.
pub(super) fn bake(
    scene: &SceneDescription,
    emission: &[[f32; 3]],
    geometry: &mut Geometry,
    forest: &mut Forest,
) -> Result<Lights, BakeError> {
    let mut out = Lights::default();
    // of area lights with a texture: its mean in luminance over the whole
    let mut shares = Vec::new();
    let world = geometry.objects.first().map_or(0, |world| world.len());
    for (i, (t, corners)) in (0..).zip(geometry.triangles.iter_mut().zip(&geometry.corners)).take(world) {
        let emission = emission[t.material as usize];
        if emission != [0.0; 3] {
            let mut share = 1.0;
            if let Some((texture, reference)) = emission::texture_of(scene, t.material) {
                let uv = t.vertex.map(|v| geometry.vertices.get(v as usize).map_or([0.0; 2], |v| v.uv));
                let Some(mean) = emission::mean(texture, &reference, uv) else { continue };
                let emitted = std::array::from_fn(|c| (f64::from(emission[c]) * mean[c]) as f32);
                share = luminance(emitted) / luminance(emission);
            }
            shares.push(share);
            t.light = out.lights.len() as u32;
            let kind = LightKind::Area as u32;
            out.lights.push(Light { kind, triangle: i, area: area(corners), emission, ..Zeroable::zeroed() });
        }
    }
    for (i, e) in scene.emitters.iter().enumerate().filter(|(_, e)| !matches!(e, Emitter::Shape(_))) {
        out.lights.extend(light(i, e)?);
    }
    if let Some(e) = &scene.environment {
        out.surround(e)?;
    }
    let hidden = out.place(scene, emission, geometry, forest)?;
    for (i, e) in scene.emitters.iter().enumerate().filter(|(_, e)| matches!(e, Emitter::Shape(_))) {
        out.lights.extend(light(i, e)?);
    }
    let shapes = out.lights.iter().filter(|l| LightKind::from_u32(l.kind).is_some_and(LightKind::has_shape)).count();
    if shapes > MAX_SHAPE_LIGHTS {
        return Err(BakeError::TooMany { what: "sphere, rectangle and disk lights", count: shapes });
    }
    let radius = radius(forest.bounds);
    let mut weights = environment::light_weights(&out.lights, out.environment.first(), &out.env_texels, radius);
    weights.iter_mut().zip(&shares).for_each(|(weight, share)| *weight *= share);
    hidden.into_iter().flatten().for_each(|light| weights[light] = 0.0);
    out.alias = alias::build(&weights);
    out.grow(geometry, forest);
    Ok(out)
}

impl Lights {
    /// Builds the light tree, if there are enough lights that are chosen at all.
    fn grow(&mut self, geometry: &Geometry, forest: &Forest) {
        let n = self.lights.len();
        if self.alias.iter().filter(|a| a.probability > 0.0).count() < LIGHT_TREE_MIN {
            return;
        }
        let [bounds_min, bounds_max] = forest.bounds;
        let info = SceneInfo { bounds_min, bounds_max, max_depth: 1, dropped_triangles: 0 };
        let camera = Zeroable::zeroed();
        let scene = Scene::assume_valid(Records {
            vertices: &geometry.vertices,
            triangles: &geometry.triangles,
            lights: &self.lights,
            light_alias: &self.alias,
            environment: self.environment.first(),
            objects: &forest.objects,
            instances: &forest.instances,
            ..Records::of(&info, &camera)
        });
        let mut nodes: Vec<LightNode> = vec![Zeroable::zeroed(); n];
        let (mut trails, mut order) = (vec![NONE; n], vec![0; n]);
        let tree = LightTree { nodes: &mut nodes, trails: &mut trails, order: &mut order };
        let count = build_light_tree(&scene, tree).expect("a node, a trail and an entry per light suffice");
        nodes.truncate(count);
        (self.nodes, self.trails) = (nodes, trails);
    }

    /// Adds the lights of instances, one for each emitting triangle of each; returns those that are hidden.
    fn place(
        &mut self,
        scene: &SceneDescription,
        emission: &[[f32; 3]],
        geometry: &mut Geometry,
        forest: &mut Forest,
    ) -> Result<Vec<Range<usize>>, BakeError> {
        let Forest { objects, instances, .. } = forest;
        let mut emitters: Vec<Vec<u32>> = Vec::with_capacity(objects.len());
        for (index, (o, own)) in objects.iter_mut().zip(&geometry.objects).enumerate() {
            let emits = |i: &u32| emission[geometry.triangles[*i as usize].material as usize] != [0.0; 3];
            let own: Vec<u32> = own.clone().filter(emits).collect();
            o.emitters = own.len() as u32;
            o.lights = if index == 0 { 0 } else { o.emitters };
            if index > 0 {
                (0..).zip(&own).for_each(|(number, i)| geometry.triangles[*i as usize].light = number);
            }
            emitters.push(own);
        }
        for index in (1..objects.len()).filter(|o| objects[*o].instances > 0).collect::<Vec<_>>() {
            let o = objects[index];
            for i in &mut instances[o.first_instance as usize..(o.first_instance + o.instances) as usize] {
                i.first_light = objects[index].lights;
                objects[index].lights += objects[i.object as usize].lights;
            }
        }
        let mut hidden = Vec::new();
        let world = objects.first().map_or(0, |world| world.instances);
        for index in 0..world {
            let outer = instances[index as usize];
            let o = objects[outer.object as usize];
            let first = self.lights.len();
            instances[index as usize].first_light = if o.lights > 0 { first as u32 } else { 0 };
            let mut add = |object: u32, maps: &[[[f32; 4]; 3]]| {
                for i in &emitters[object as usize] {
                    let corners = geometry.corners[*i as usize].map(|p| maps.iter().fold(p.map(f64::from), apply));
                    let area = 0.5 * (sub(corners[1], corners[0])).cross(sub(corners[2], corners[0])).length();
                    let emission = emission[geometry.triangles[*i as usize].material as usize];
                    let (kind, instance, area) = (LightKind::Area as u32, index + 1, area as f32);
                    self.lights.push(Light { kind, triangle: *i, area, instance, emission, ..Zeroable::zeroed() });
                }
            };
            let [open, _] = outer.to_world;
            add(outer.object, &[open]);
            for i in &instances[o.first_instance as usize..(o.first_instance + o.instances) as usize] {
                add(i.object, &[i.to_world[0], open]);
            }
            if let Some(light) = self.lights[first..].iter().find(|l| l.area < f32::MIN_POSITIVE) {
                let (name, prototype) = (&scene.instances[index as usize].name, outer.object);
                let what = format!("emitting triangle {} has no area in the world", light.triangle);
                return Err(BakeError::Instance { name: name.clone(), prototype: prototype.to_string(), what });
            }
            if !scene.instances[index as usize].visible {
                hidden.push(first..self.lights.len());
            }
        }
        if self.lights.len() >= 1 << 27 {
            return Err(BakeError::TooMany { what: "lights", count: self.lights.len() });
        }
        Ok(hidden)
    }
}

/// A point through an affine map.
fn apply(p: [f64; 3], map: &[[f32; 4]; 3]) -> [f64; 3] {
    map.map(|row| row[..3].iter().zip(p).map(|(a, x)| f64::from(*a) * x).sum::<f64>() + f64::from(row[3]))
}

fn sub(a: [f64; 3], b: [f64; 3]) -> DVec3 {
    DVec3::from_array(a) - DVec3::from_array(b)
}

/// The light of an emitter, unless triangles have it.
fn source(e: &Emitter) -> Option<LightSource> {
    Some(match *e {
        Emitter::Area { .. } => return None,
        Emitter::Point { position, intensity } => LightSource::Point { position, intensity },
        Emitter::Directional { direction, irradiance } => LightSource::Directional { direction, irradiance },
        Emitter::Sun { direction, irradiance, angle_deg } => LightSource::Sun { direction, irradiance, angle_deg },
        Emitter::Spot { position, direction, intensity, inner_deg, outer_deg } => {
            LightSource::Spot { position, direction, intensity, inner_deg, outer_deg }
        }
        Emitter::Shape(ShapeLight { shape, position, radiance, two_sided, visible }) => {
            let sides = Sides { two_sided, visible };
            match shape {
                LightShape::Sphere { radius } => LightSource::Sphere { position, radius, radiance, sides },
                LightShape::Rectangle { edges } => LightSource::Rectangle { position, edges, radiance, sides },
                LightShape::Disk { direction, radius } => {
                    LightSource::Disk { position, direction, radius, radiance, sides }
                }
            }
        }
    })
}

/// The record of an emitter that is no triangle; black ones are left out.
fn light(index: usize, e: &Emitter) -> Result<Option<Light>, BakeError> {
    let Some(source) = source(e) else { return Ok(None) };
    let light = source.record_with::<Std>().map_err(|e| {
        let (what, found) = words(&source, e);
        BakeError::Emitter { emitter: format!("emitter {index} ({})", source.kind().name()), what, found }
    })?;
    Ok((light.emission != [0.0; 3]).then_some(light))
}

/// What is wrong with a light, in words, and the number as scene files have it.
fn words(source: &LightSource, FieldError { field, found }: FieldError) -> (&'static str, f32) {
    let emission = match source.kind() {
        LightKind::Point | LightKind::Spot => "intensity",
        LightKind::Directional | LightKind::Sun => "irradiance",
        _ => "radiance",
    };
    match (field, source) {
        (Field::Emission, _) => (emission, found),
        (Field::Direction, _) => ("length of the direction", found),
        (Field::Cone, LightSource::Spot { outer_deg, .. }) if !(MIN_CONE_DEG..=180.0).contains(outer_deg) => {
            ("outer half angle in degrees", found)
        }
        (Field::Cone, LightSource::Spot { .. }) => ("inner half angle in degrees", found),
        (Field::Cone, _) => ("angular diameter in degrees", found),
        (Field::ShapeSize, LightSource::Rectangle { .. }) => ("length of an edge", 2.0 * found),
        (Field::ShapeSize, _) => ("radius", found),
        (Field::Edges, _) => ("cosine of the angle between the edges", found.sqrt()),
        _ => ("position", found),
    }
}

impl Lights {
    /// Adds the environment and its light; a black one is as good as none.
    fn surround(&mut self, e: &Environment) -> Result<(), BakeError> {
        let light = self.lights.len() as u32;
        let baked = match e {
            Environment::Constant { radiance } => {
                check_emission("environment", "radiance", *radiance)?;
                let kind = EnvironmentKind::Constant as u32;
                let to_local = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                blob::Environment { kind, light, radiance: *radiance, to_local, ..Zeroable::zeroed() }
            }
            Environment::Map { width, height, texels, scale, to_world } => {
                let size = [*width, *height];
                let fits = (1..=MAX_SIDE).contains(width) && (2..=MAX_SIDE).contains(height);
                if !fits || u64::from(*width) * u64::from(*height) != texels.len() as u64 {
                    return Err(BakeError::Image { image: "environment map".into(), size, texels: texels.len() });
                }
                check_emission("environment", "scale", *scale)?;
                for t in texels {
                    let scaled = std::array::from_fn(|c| t[c] * scale[c]);
                    check_emission("environment map", "texel", *t)?;
                    check_emission("environment map", "texel times scale", scaled)?;
                }
                if texels.iter().all(|t| *t == [0.0; 3]) {
                    return Ok(());
                }
                self.env_alias = environment::map_tables(texels, *width, *height);
                self.env_texels.clone_from(texels);
                blob::Environment {
                    kind: EnvironmentKind::Map as u32,
                    light,
                    width: *width,
                    height: *height,
                    to_local: inverse(to_world)?,
                    radiance: *scale,
                }
            }
        };
        if baked.radiance == [0.0; 3] {
            (self.env_alias, self.env_texels) = Default::default();
            return Ok(());
        }
        self.environment.push(baked);
        self.lights.push(Light { kind: LightKind::Environment as u32, ..Zeroable::zeroed() });
        Ok(())
    }
}

/// Inverse of a rotation (a reflection will do): its transpose.
fn inverse(m: &[[f32; 3]; 3]) -> Result<[[f32; 3]; 3], BakeError> {
    let column = |j: usize| [m[0][j], m[1][j], m[2][j]];
    let columns = [column(0), column(1), column(2)];
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            let wanted = if i == j { 1.0 } else { 0.0 };
            if (dot - wanted).abs() > 1e-3 || dot.is_nan() {
                return Err(BakeError::Rotation);
            }
        }
    }
    Ok(columns)
}

//! The tree of nodes: where meshes, cameras and lights are.

use super::super::LoadError;
use super::super::loader::Loader;
use super::asset::Asset;
use crate::description::{Camera, Emitter, NamedCamera, Projection, SceneDescription};
use crate::text::excerpt;
use glam::{DMat4, DQuat, DVec3};
use gltf_json::accessor::Type;
use gltf_json::camera::Type as CameraType;
use gltf_json::extensions::scene::khr_lights_punctual::{Light, Type as LightType};
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index, Mesh, Node, Skin};
use std::collections::HashMap;
use std::rc::Rc;

/// Rows of pictures.
const HEIGHT: u32 = 480;
/// Lumens of a watt, with which Blender writes lights.
const LUMENS_PER_WATT: f32 = 683.0;

/// A mesh in the world.
pub(super) struct Placement {
    /// An excerpt: a name may be a megabyte long, and its node in many places.
    pub name: Rc<str>,
    pub mesh: Index<Mesh>,
    pub skin: Option<Index<Skin>>,
    pub world: DMat4,
}

/// What the nodes of a scene hold.
#[derive(Default)]
pub(super) struct Placed {
    pub placements: Vec<Placement>,
    /// Place of each node that was met.
    pub worlds: HashMap<usize, DMat4>,
}

/// Walks through the default scene; cameras and lights go to `scene`.
pub(super) fn walk(loader: &mut Loader, scene: &mut SceneDescription, asset: &Asset<'_>) -> Result<Placed, LoadError> {
    let mut placed = Placed::default();
    let mut waiting: Vec<(Index<Node>, DMat4, String)> = Vec::new();
    for (root, at) in roots(asset)?.into_iter().rev() {
        waiting.push((root, DMat4::IDENTITY, at));
    }
    // What is pushed last is met first: roots and children in the order of the file.
    while let Some((index, parent, at)) = waiting.pop() {
        let node = asset.get(&asset.root.nodes, index, &at, "nodes")?;
        let at = format!("nodes[{}]", index.value());
        let world = parent * local(node);
        if placed.worlds.insert(index.value(), world).is_some() {
            return Err(asset.error(at, "it is in the scene twice: below itself, or below two other nodes"));
        }
        if let Some(mesh) = node.mesh {
            let name = node.name.as_ref().or_else(|| asset.root.meshes.get(mesh.value())?.name.as_ref());
            let name: Rc<str> = excerpt(name.unwrap_or(&at)).into();
            for world in instances(asset, node, world, &at, placed.placements.len())? {
                placed.placements.push(Placement { name: name.clone(), mesh, skin: node.skin, world });
            }
        }
        if let Some(camera) = node.camera {
            let name = node.name.clone().unwrap_or_else(|| at.clone());
            scene.cameras.push(NamedCamera { camera: self::camera(asset, camera, world, &at)?, name });
        }
        let light = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        if let Some(light) = light {
            let lights: &[Light] = asset.root.as_ref();
            let light = asset.get(lights, light.light, &at, "extensions.KHR_lights_punctual.lights")?;
            scene.emitters.extend(emitter(loader, asset, light, world, &at)?);
        }
        for (i, child) in node.children.as_deref().unwrap_or_default().iter().enumerate().rev() {
            waiting.push((*child, world, format!("{at}.children[{i}]")));
        }
    }
    Ok(placed)
}

/// Roots of the default scene, or of the first one; without scenes, the nodes that are nobody's children.
fn roots(asset: &Asset<'_>) -> Result<Vec<(Index<Node>, String)>, LoadError> {
    let root = &asset.root;
    let index = match root.scene {
        Some(scene) => scene,
        None if root.scenes.is_empty() => {
            let children: Vec<usize> =
                root.nodes.iter().flat_map(|n| n.children.iter().flatten().map(|c| c.value())).collect();
            let children: std::collections::HashSet<usize> = children.into_iter().collect();
            let free = (0..root.nodes.len()).filter(|i| !children.contains(i));
            return Ok(free.map(|i| (Index::new(i as u32), "nodes".into())).collect());
        }
        None => Index::new(0),
    };
    let scene = asset.get(&root.scenes, index, "scene", "scenes")?;
    let at = |i: usize| format!("scenes[{}].nodes[{i}]", index.value());
    Ok(scene.nodes.iter().enumerate().map(|(i, node)| (*node, at(i))).collect())
}

/// Map from a node's space to its parent's.
fn local(node: &Node) -> DMat4 {
    if let Some(columns) = node.matrix {
        return DMat4::from_cols_array(&columns.map(f64::from));
    }
    let vector =
        |v: Option<[f32; 3]>, default: f64| v.map_or(DVec3::splat(default), |v| DVec3::from_array(v.map(f64::from)));
    let rotation = node.rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |q| q.0);
    DMat4::from_scale_rotation_translation(vector(node.scale, 1.0), quaternion(rotation), vector(node.translation, 0.0))
}

/// A unit quaternion; none is a rotation by 0.
fn quaternion(q: [f32; 4]) -> DQuat {
    let q = DQuat::from_array(q.map(f64::from));
    if q.length_squared().is_normal() { q.normalize() } else { DQuat::IDENTITY }
}

/// Places of a node's mesh: one, or those of `EXT_mesh_gpu_instancing`. There are `others` in the scene already.
fn instances(asset: &Asset<'_>, node: &Node, world: DMat4, at: &str, others: usize) -> Result<Vec<DMat4>, LoadError> {
    let room = |count: usize| {
        let most = asset.most_placements();
        let what = || format!("more than {most} meshes in the scene, in a document of its size");
        if count <= most.saturating_sub(others) { Ok(()) } else { Err(asset.error(at, what())) }
    };
    let name = "EXT_mesh_gpu_instancing";
    let Some(value) = node.extensions.as_ref().and_then(|e| e.others.get(name)) else {
        return room(1).map(|()| vec![world]);
    };
    let at = format!("{at}.extensions.{name}.attributes");
    let numbers = |key: &str, wanted: Type| {
        let index = value.get("attributes").and_then(|a| a.get(key)).and_then(|i| i.as_u64());
        let index = index.map(|i| Index::<Accessor>::new(u32::try_from(i).unwrap_or(u32::MAX)));
        index.map(|i| asset.numbers(i, &format!("{at}.{key}"), &[wanted])).transpose()
    };
    let translations = numbers("TRANSLATION", Type::Vec3)?;
    let rotations = numbers("ROTATION", Type::Vec4)?;
    let scales = numbers("SCALE", Type::Vec3)?;
    let counts: Vec<usize> = [&translations, &rotations, &scales].into_iter().flatten().map(|n| n.count).collect();
    let Some(count) = counts.first().copied().filter(|n| counts.iter().all(|m| m == n)) else {
        return Err(asset.error(at, format!("accessors of {counts:?} elements")));
    };
    room(count)?;
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let place = |i: usize| {
        let scale = scales.as_ref().map_or(DVec3::ONE, |n| vector(n.get(i)));
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |n| quaternion(n.get(i)));
        let translation = translations.as_ref().map_or(DVec3::ZERO, |n| vector(n.get(i)));
        world * DMat4::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok((0..count).map(place).collect())
}

/// A direction of a node, of length 1.
fn direction(world: DMat4, axis: DVec3, asset: &Asset<'_>, at: &str) -> Result<DVec3, LoadError> {
    let direction = world.transform_vector3(axis).try_normalize();
    direction.ok_or_else(|| asset.error(at, "its transformation leaves no direction"))
}

fn camera(asset: &Asset<'_>, index: Index<gltf_json::Camera>, world: DMat4, at: &str) -> Result<Camera, LoadError> {
    let camera = asset.get(&asset.root.cameras, index, at, "cameras")?;
    let name = format!("cameras[{}]", index.value());
    let origin = world.w_axis.truncate();
    let target = origin + direction(world, DVec3::NEG_Z, asset, at)?;
    let up = direction(world, DVec3::Y, asset, at)?;
    let placed = Camera { origin: origin.into(), target: target.into(), up: up.into(), ..Camera::default() };
    let width = |aspect: f32| {
        let aspect = if aspect.is_finite() && aspect > 0.0 { f64::from(aspect) } else { 4.0 / 3.0 };
        (f64::from(HEIGHT) * aspect).round().clamp(16.0, 16.0 * f64::from(HEIGHT)) as u32
    };
    match (camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(p), _) => {
            let vfov_deg = f64::from(p.yfov).to_degrees();
            if !(vfov_deg > 0.0 && vfov_deg < 180.0) {
                return Err(asset.error(
                    format!("{name}.perspective.yfov"),
                    format!("{}, it must be above 0 and below pi", p.yfov),
                ));
            }
            let size = [width(p.aspect_ratio.unwrap_or(4.0 / 3.0)), HEIGHT];
            Ok(Camera { vfov_deg, size, ..placed })
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(o)) => {
            let height = 2.0 * o.ymag.abs();
            if !(height > 0.0 && height.is_finite()) {
                return Err(asset.error(format!("{name}.orthographic.ymag"), format!("{}, it must not be 0", o.ymag)));
            }
            let projection = Projection::Orthographic { height };
            Ok(Camera { projection, size: [width((o.xmag / o.ymag).abs()), HEIGHT], ..placed })
        }
        _ => Err(asset.error(name, "neither a perspective nor an orthographic camera with its parameters")),
    }
}

/// Factor from the intensities that the generator of a file writes to watts. Blender writes watts times 683 lumens, and
/// emission without them; its exporter before 3.4 writes the power of point and spot lights in watts, as it is.
fn radiometric(loader: &mut Loader, asset: &Asset<'_>, light: &Light) -> f32 {
    let generator = asset.root.asset.generator.as_deref().unwrap_or_default();
    if !generator.contains("Blender") {
        return 1.0;
    }
    let version = generator.rsplit_once('v').map(|(_, v)| v.splitn(3, '.').map_while(|n| n.parse::<u32>().ok()));
    let version: Vec<u32> = version.into_iter().flatten().take(2).collect();
    let (factor, what) = match (version.as_slice() < &[3, 4] && !version.is_empty(), &light.type_) {
        (false, _) => {
            (1.0 / LUMENS_PER_WATT, "lights were divided by 683 lumens per watt, with which Blender writes them")
        }
        (true, Checked::Valid(LightType::Directional)) => return 1.0,
        (true, _) => (
            0.25 / std::f32::consts::PI,
            "lights were taken as watts in all directions, as Blender before 3.4 writes them",
        ),
    };
    if loader.report.notes.iter().all(|n| n != what) {
        loader.note(what.into());
    }
    factor
}

/// A light. Candela and lux are taken as radiometric numbers, as emission in candela per square metre is, and as viewers
/// do, so that all of them fit together; what Blender writes is undone ([`radiometric`]).
fn emitter(
    loader: &mut Loader,
    asset: &Asset<'_>,
    light: &Light,
    world: DMat4,
    at: &str,
) -> Result<Option<Emitter>, LoadError> {
    let scale = light.intensity.max(0.0) * radiometric(loader, asset, light);
    let intensity = light.color.map(|x| x.max(0.0) * scale);
    if intensity == [0.0; 3] {
        return Ok(None);
    }
    let position = world.w_axis.truncate().as_vec3().to_array();
    let axis = || direction(world, DVec3::NEG_Z, asset, at).map(|d| d.as_vec3().to_array());
    Ok(Some(match (light.type_, &light.spot) {
        (Checked::Valid(LightType::Point), _) => Emitter::Point { position, intensity },
        (Checked::Valid(LightType::Directional), _) => {
            Emitter::Directional { direction: axis()?, irradiance: intensity }
        }
        (Checked::Valid(LightType::Spot), Some(spot)) => {
            let outer_deg = spot.outer_cone_angle.to_degrees().clamp(0.01, 180.0);
            let inner_deg = spot.inner_cone_angle.to_degrees().clamp(0.0, outer_deg);
            Emitter::Spot { position, direction: axis()?, intensity, inner_deg, outer_deg }
        }
        _ => return Err(asset.error(at, "its light is none that KHR_lights_punctual has")),
    }))
}

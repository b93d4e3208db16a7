//! glTF 2.0, `.gltf` and `.glb`. World space is that of the file: right-handed, +Y up, metres.
//!
//! | file | reads |
//! |---|---|
//! | `container` | chunks of a `.glb`, URIs |
//! | `asset` | the document, its buffers, accessors |
//! | `nodes` | the tree of nodes, cameras, lights |
//! | `meshes` | primitives |
//! | `materials` | materials, with the table of what becomes of which parameter |
//! | `textures` | images |
//!
//! The schema is `gltf-json`'s. The crate `gltf` around it panics where a document refers to what it does not have, and
//! so does its validation: each index, length and count is checked here where it is followed.
//!
//! Meshes are put into the world as triangles; one that several nodes have becomes a prototype with instances if that
//! saves more than [`SAVED_TRIANGLES`]. Skins are posed as their joints are. Animations and morph targets are ignored,
//! with a note.

mod asset;
mod container;
mod materials;
mod meshes;
mod nodes;
mod textures;

use super::LoadError;
use super::error::quoted;
use super::loader::Loader;
use crate::bake::boundary_is_closed;
use crate::description::{
    Instance, Material, Medium, Model, Object, Projection, Prototype, SceneDescription, Triangle, Vertex,
};
use crate::look::{Given, Up};
use crate::text::excerpt;
use asset::Asset;
use croupier::unstable::scene::blob::MAX_MEDIA;
use croupier::unstable::scene::derive;
use glam::{DMat3, DMat4, DVec3, Vec3};
use gltf_json::accessor::Type;
use gltf_json::{Index, Mesh, Root, Skin};
use materials::{Materials, Volume};
use meshes::Primitive;
use nodes::{Placed, Placement};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

pub(super) use container::is_glb;

/// Triangles that instances of a mesh must save, compared with its copies in the world.
const SAVED_TRIANGLES: usize = 4096;

/// Extensions whose meaning is known here, or does not concern pictures.
const EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
];

/// Loads a `.gltf` or `.glb` file.
pub(super) fn load(loader: &mut Loader, path: &Path) -> Result<SceneDescription, LoadError> {
    let bytes = loader.read(path, None)?;
    let (json, binary) = container::chunks(path, &bytes)?;
    let root: Root = serde_json::from_slice(json).map_err(|e| syntax(path, json, &e))?;
    check(loader, path, &root)?;
    let asset = Asset::new(loader, path, root, binary)?;
    let mut scene = SceneDescription::default();
    let placed = nodes::walk(loader, &mut scene, &asset)?;
    let mut materials = Materials::default();
    place(loader, &mut scene, &asset, &mut materials, &placed)?;
    if scene.triangles.is_empty() {
        return Err(LoadError::file(path, "no triangles in its scene"));
    }
    solids(loader, &mut scene, &materials.volumes);
    let perspective = scene.cameras.iter().find(|c| c.camera.projection == Projection::Perspective);
    let camera = perspective.or(scene.cameras.first()).map(|c| c.camera);
    scene.camera = camera.unwrap_or_default();
    // Emission that a texture modulates lights nothing: displays and eyes have it.
    let emits = |m: &Material| match &m.model {
        Model::Principled(p) => p.emission != [0.0; 3] && p.emission_texture.is_none(),
        _ => false,
    };
    let light = !scene.emitters.is_empty() || scene.materials.iter().any(emits);
    loader.given = Given { camera: camera.is_some(), light, up: Up::Y, up_is_known: true };
    Ok(scene)
}

/// Message of a document that is none.
fn syntax(path: &Path, json: &[u8], e: &serde_json::Error) -> LoadError {
    let document: Option<serde_json::Value> = serde_json::from_slice(json).ok();
    let version = document.as_ref().and_then(|d| d.get("asset")?.get("version")?.as_str());
    if let Some(version) = version.filter(|v| !v.starts_with("2.")) {
        return LoadError::json(path, "asset.version", format!("{}, only 2.x is supported", quoted(version)));
    }
    let what = e.to_string();
    let what = what.split(" at line ").next().unwrap_or_default();
    let what: String = what.chars().take(200).collect();
    LoadError::json(path, format!("line {} column {}", e.line(), e.column()), format!("not a glTF document: {what}"))
}

/// Version and extensions.
fn check(loader: &mut Loader, path: &Path, root: &Root) -> Result<(), LoadError> {
    if !root.asset.version.starts_with("2.") {
        let version = quoted(&root.asset.version);
        return Err(LoadError::json(path, "asset.version", format!("{version}, only 2.x is supported")));
    }
    let unknown = |name: &&String| !EXTENSIONS.contains(&name.as_str());
    for (i, name) in root.extensions_required.iter().enumerate().filter(|(_, name)| unknown(name)) {
        // A picture with a plainer material is better than none.
        if !name.starts_with("KHR_materials_") {
            let what = format!("the extension {} is required, which is not supported", quoted(name));
            return Err(LoadError::json(path, format!("extensionsRequired[{i}]"), what));
        }
    }
    let ignored: Vec<String> = root.extensions_used.iter().filter(unknown).take(20).map(|n| quoted(n)).collect();
    if !ignored.is_empty() {
        loader.note(format!("extensions that were ignored: {}", ignored.join(", ")));
    }
    if !root.animations.is_empty() {
        loader.note(format!("{} animations were ignored: the file's pose was taken", root.animations.len()));
    }
    if root.meshes.iter().flat_map(|m| &m.primitives).any(|p| p.targets.as_ref().is_some_and(|t| !t.is_empty())) {
        loader.note("morph targets were ignored".into());
    }
    Ok(())
}

/// Puts all meshes into the scene.
fn place(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    asset: &Asset<'_>,
    materials: &mut Materials,
    placed: &Placed,
) -> Result<(), LoadError> {
    let mut uses: HashMap<Index<Mesh>, Vec<&Placement>> = HashMap::new();
    let mut order = Vec::new();
    for placement in &placed.placements {
        let list = uses.entry(placement.mesh).or_default();
        if list.is_empty() {
            order.push(placement.mesh);
        }
        list.push(placement);
    }
    let mut flat = 0;
    let mut first_flat = None;
    for mesh in order {
        let Some(uses) = uses.get(&mesh) else { continue };
        let at = uses.first().map_or("nodes", |p| &*p.name);
        let primitives = meshes::load(loader, scene, asset, materials, mesh, at)?;
        let triangles: usize = primitives.iter().map(|p| p.triangles.len()).sum();
        if triangles == 0 {
            continue;
        }
        let (uses, gone): (Vec<&Placement>, Vec<&Placement>) =
            uses.iter().copied().partition(|p| p.skin.is_some() || spans(p.world));
        flat += gone.len();
        first_flat = first_flat.or(gone.first().map(|p| p.name.clone()));
        // what cannot be an instance, as its map is singular, is a copy
        let bounds = bounds(&primitives);
        let fits = |p: &&Placement| p.skin.is_none() && derive(&[rows(p.world); 2], bounds).is_ok();
        let (rigid, others): (Vec<&Placement>, Vec<&Placement>) = uses.iter().copied().partition(fits);
        let instanced = (rigid.len().max(1) - 1).saturating_mul(triangles) > SAVED_TRIANGLES;
        let copies = if instanced { others.len() + 1 } else { uses.len() };
        let total = copies.saturating_mul(triangles).saturating_add(scene.triangles.len());
        if total > asset.most_triangles() {
            let what = format!("{total} triangles in a document of its size");
            return Err(asset.error(format!("meshes[{}]", mesh.value()), what));
        }
        if instanced {
            let name = asset.root.meshes.get(mesh.value()).and_then(|m| m.name.clone());
            let name = name.map_or_else(|| format!("meshes[{}]", mesh.value()), |name| excerpt(&name).into_owned());
            if primitives.iter().any(Primitive::has_area) {
                let first = scene.triangles.len() as u32;
                append(scene, &name, &primitives, &Space::Own);
                let prototype = scene.prototypes.len() as u32;
                let triangles = first..scene.triangles.len() as u32;
                scene.prototypes.push(Prototype { name, triangles, instances: Vec::new() });
                scene.instances.extend(rigid.iter().map(|p| Instance::new(&p.name, prototype, rows(p.world))));
            } else {
                loader.note(format!("mesh {}: left out, none of its triangles has an area", quoted(&name)));
            }
        }
        for placement in if instanced { others } else { uses } {
            let space = match placement.skin {
                None => Space::world(placement.world),
                Some(skin) => {
                    let joints = joints(asset, placed, skin, &primitives)?;
                    Space::Joints(joints, Space::world(placement.world).into())
                }
            };
            append(scene, &placement.name, &primitives, &space);
        }
    }
    if let Some(name) = first_flat {
        let name = quoted(&name);
        loader.note(format!(
            "meshes that were left out, as their transformations leave them no area: {flat}, first {name}"
        ));
    }
    Ok(())
}

/// Whether surfaces keep an area under a map.
fn spans(map: DMat4) -> bool {
    let [x, y, z] = [map.x_axis, map.y_axis, map.z_axis].map(|c| c.truncate());
    [x.cross(y), y.cross(z), z.cross(x)].iter().any(|n| *n != DVec3::ZERO)
}

/// Bounds of vertices.
fn bounds(primitives: &[Primitive]) -> [[f32; 3]; 2] {
    let mut points = primitives.iter().flat_map(|p| &p.vertices).map(|v| Vec3::from(v.position));
    let first = points.next().unwrap_or_default();
    let (lo, hi) = points.fold((first, first), |(lo, hi), p| (lo.min(p), hi.max(p)));
    [lo.to_array(), hi.to_array()]
}

/// The upper rows of an affine map.
fn rows(m: DMat4) -> [[f32; 4]; 3] {
    let m = m.transpose();
    [m.x_axis, m.y_axis, m.z_axis].map(|row| row.as_vec4().to_array())
}

/// Where vertices go.
enum Space {
    /// They stay.
    Own,
    /// By a map; normals by the transpose of its inverse, times its determinant.
    World { map: DMat4, normals: DMat3, mirrored: bool },
    /// By the maps of joints, mixed by weights; without influences by the second.
    Joints(Vec<DMat4>, Box<Space>),
}

impl Space {
    fn world(map: DMat4) -> Self {
        let [x, y, z] = [map.x_axis, map.y_axis, map.z_axis].map(|c| c.truncate());
        // The cofactors are there for singular maps too.
        let normals = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
        let mirrored = x.dot(y.cross(z)) < 0.0;
        let sign = if mirrored { -1.0 } else { 1.0 };
        Self::World { map, normals: normals * sign, mirrored }
    }

    /// The space of a vertex of a skinned primitive.
    fn of(&self, primitive: &Primitive, vertex: usize) -> Option<Self> {
        let Self::Joints(joints, _) = self else { return None };
        let mut sum = DMat4::ZERO;
        let mut weight = 0.0;
        for influences in &primitive.influences {
            let (indices, weights) = influences.get(vertex)?;
            for (i, w) in indices.iter().zip(weights) {
                sum += *joints.get(*i as usize).filter(|_| *w > 0.0).unwrap_or(&DMat4::ZERO) * f64::from(*w);
                weight += f64::from(w.max(0.0));
            }
        }
        (weight > 0.0).then(|| Self::world(sum * (1.0 / weight)))
    }

    fn vertex(&self, primitive: &Primitive, i: usize, v: &Vertex) -> Vertex {
        match self {
            Self::Own => *v,
            Self::World { map, normals, .. } => {
                let [position, normal] = [v.position, v.normal].map(|x| DVec3::from_array(x.map(f64::from)));
                // Of length 1, as cofactors of small maps do not fit single precision.
                let normal = (*normals * normal).normalize_or_zero();
                let position = map.transform_point3(position);
                Vertex { position: position.as_vec3().to_array(), normal: normal.as_vec3().to_array(), ..*v }
            }
            Self::Joints(_, rigid) => self.of(primitive, i).as_ref().unwrap_or(rigid).vertex(primitive, i, v),
        }
    }

    /// Whether the map of the first vertex turns triangles over.
    fn mirrored(&self, primitive: &Primitive) -> bool {
        match self {
            Self::Own => false,
            Self::World { mirrored, .. } => *mirrored,
            Self::Joints(_, rigid) => self.of(primitive, 0).as_ref().unwrap_or(rigid).mirrored(primitive),
        }
    }
}

/// Appends primitives as an object.
fn append(scene: &mut SceneDescription, name: &str, primitives: &[Primitive], space: &Space) {
    scene.objects.push(Object { name: name.into(), first_triangle: scene.triangles.len() as u32 });
    for p in primitives {
        let base = scene.vertices.len() as u32;
        scene.vertices.extend(p.vertices.iter().enumerate().map(|(i, v)| space.vertex(p, i, v)));
        let mirrored = space.mirrored(p);
        scene.triangles.extend(p.triangles.iter().map(|[a, b, c]| {
            let vertices = if mirrored { [*a, *c, *b] } else { [*a, *b, *c] };
            Triangle { vertices: vertices.map(|v| v + base), material: p.material, smooth: p.smooth }
        }));
    }
}

/// The map of each joint from the mesh's space to the world, all that primitives are weighted with.
fn joints(
    asset: &Asset<'_>,
    placed: &Placed,
    index: Index<Skin>,
    primitives: &[Primitive],
) -> Result<Vec<DMat4>, LoadError> {
    let skin = asset.get(&asset.root.skins, index, "nodes", "skins")?;
    let at = format!("skins[{}]", index.value());
    let influences = primitives.iter().flat_map(|p| p.influences.iter().flatten());
    let weighted = influences.flat_map(|(joints, weights)| joints.iter().zip(weights)).filter(|(_, w)| **w > 0.0);
    if let Some(joint) = weighted.map(|(joint, _)| *joint).max().filter(|joint| *joint as usize >= skin.joints.len()) {
        let what = format!("a vertex follows its joint {joint}, there are {}", skin.joints.len());
        return Err(asset.error(at, what));
    }
    let inverse = skin.inverse_bind_matrices;
    let inverse = inverse.map(|i| asset.numbers(i, &format!("{at}.inverseBindMatrices"), &[Type::Mat4])).transpose()?;
    if inverse.as_ref().is_some_and(|n| n.count < skin.joints.len()) {
        return Err(asset.error(at, format!("fewer matrices than its {} joints", skin.joints.len())));
    }
    let joint = |(i, node): (usize, &Index<gltf_json::Node>)| {
        let world = placed.worlds.get(&node.value());
        let world =
            world.ok_or_else(|| asset.error(&at, format!("the joint nodes[{}] is not in the scene", node.value())))?;
        let bind = inverse.as_ref().map_or(DMat4::IDENTITY, |n| DMat4::from_cols_array(&n.get::<16>(i).map(f64::from)));
        Ok(*world * bind)
    };
    skin.joints.iter().enumerate().map(joint).collect()
}

/// Gives solids that absorb their media. What is open has no inside: it becomes a sheet. The world and each prototype are
/// closed on their own, as baking asks it: instances may be anywhere.
fn solids(loader: &mut Loader, scene: &mut SceneDescription, volumes: &[Volume]) {
    let wanted: HashSet<u32> = volumes.iter().map(|v| v.material).collect();
    // by material and object: 0 is the world, then come the prototypes in the order of their triangles
    let mut bounds: BTreeMap<(u32, usize), Vec<u32>> = BTreeMap::new();
    for (i, t) in (0..).zip(&scene.triangles).filter(|(_, t)| wanted.contains(&t.material)) {
        let object = scene.prototypes.partition_point(|p| p.triangles.start <= i);
        let within = object > 0 && scene.prototypes[object - 1].triangles.contains(&i);
        bounds.entry((t.material, if within { object } else { 0 })).or_default().push(i);
    }
    for volume in volumes {
        let mut objects = bounds.range((volume.material, 0)..=(volume.material, usize::MAX)).map(|(_, list)| list);
        if objects.clone().next().is_none() {
            continue;
        }
        let closed = objects.all(|list| boundary_is_closed(scene, list));
        let material = &mut scene.materials[volume.material as usize];
        let Model::Principled(p) = &mut material.model else { continue };
        if !closed {
            p.thin_walled = true;
            let name = quoted(&material.name);
            loader.note(format!("material {name}: its surface is not closed or faces inwards: taken as a thin sheet"));
            continue;
        }
        if volume.sigma_a == [0.0; 3] {
            continue;
        }
        let medium =
            Medium { name: format!("inside of {}", material.name), sigma_a: volume.sigma_a, ..Medium::default() };
        // copies of one material share one
        let known = scene.media.iter().position(|m| *m == medium);
        if known.is_none() && scene.media.len() >= MAX_MEDIA {
            let name = quoted(&material.name);
            loader.note(format!("material {name}: without absorption, as there may be {MAX_MEDIA} media"));
            continue;
        }
        material.medium = Some(known.unwrap_or(scene.media.len()) as u32);
        if known.is_none() {
            scene.media.push(medium);
        }
    }
}

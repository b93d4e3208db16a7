//! Primitives of meshes as vertices and triangles in the mesh's own space.

use super::super::LoadError;
use super::super::colors;
use super::super::loader::Loader;
use super::asset::{Asset, Numbers};
use super::materials::{Alpha, Loaded, Materials, Volume};
use crate::description::{Model, SceneDescription, TextureRef, Vertex};
use glam::{DVec3, Vec3};
use gltf_json::accessor::Type;
use gltf_json::mesh::{Mode, Semantic};
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index, Mesh, mesh};

/// Joints of a vertex and their weights.
pub(super) type Influences = Vec<([u32; 4], [f32; 4])>;

/// A primitive whose material has been loaded.
pub(super) struct Primitive {
    /// In the mesh's space; texture coordinates with v upwards.
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<[u32; 3]>,
    pub smooth: bool,
    pub material: u32,
    /// Of each vertex, up to eight joints in groups of four; empty without.
    pub influences: Vec<Influences>,
}

impl Primitive {
    /// Whether a triangle spans a plane, as baking asks it.
    pub(super) fn has_area(&self) -> bool {
        let position =
            |v: u32| self.vertices.get(v as usize).map_or(DVec3::ZERO, |v| Vec3::from(v.position).as_dvec3());
        self.triangles.iter().any(|t| {
            let [a, b, c] = t.map(position);
            (b - a).cross(c - a).length_squared() > 0.0
        })
    }
}

/// All primitives of a mesh that have triangles. Vertices that no triangle uses are left out: primitives often share
/// their vertices.
pub(super) fn load(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    asset: &Asset<'_>,
    materials: &mut Materials,
    index: Index<Mesh>,
    at: &str,
) -> Result<Vec<Primitive>, LoadError> {
    let mesh = asset.get(&asset.root.meshes, index, at, "meshes")?;
    let mut out = Vec::new();
    let mut triangles = 0;
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let at = format!("meshes[{}].primitives[{i}]", index.value());
        out.extend(load_primitive(loader, scene, asset, materials, primitive, &at)?);
        triangles += out.last().map_or(0, |p| p.triangles.len());
        if triangles > asset.most_triangles() {
            return Err(asset.error(at, format!("{triangles} triangles in a document of its size")));
        }
    }
    Ok(out)
}

fn load_primitive(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    asset: &Asset<'_>,
    materials: &mut Materials,
    primitive: &mesh::Primitive,
    at: &str,
) -> Result<Option<Primitive>, LoadError> {
    let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let numbers = |index: Option<Index<Accessor>>, name: &str, wanted: &[Type]| {
        index.map(|i| asset.numbers(i, &format!("{at}.attributes.{name}"), wanted)).transpose()
    };
    let draco = "KHR_draco_mesh_compression";
    let compressed = primitive.extensions.as_ref().is_some_and(|e| e.others.contains_key(draco));
    let position = attribute(Semantic::Positions);
    let raw = |i: Index<Accessor>| {
        asset.root.accessors.get(i.value()).is_some_and(|a| a.buffer_view.is_some() || a.sparse.is_some())
    };
    if compressed && !position.is_some_and(raw) {
        return Err(asset.error(at, format!("compressed with {draco}, which is not supported")));
    }
    let Checked::Valid(mode) = primitive.mode else {
        return Err(asset.error(format!("{at}.mode"), "a kind of primitive that glTF does not have"));
    };
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        loader.report.skipped_elements = loader.report.skipped_elements.saturating_add(1);
        return Ok(None);
    }
    // Without positions there is nothing to see, as the format says.
    let Some(positions) = numbers(position, "POSITION", &[Type::Vec3])? else { return Ok(None) };
    let corners = corners(asset, primitive, mode, positions.count, at)?;
    // vertices in the order of their first use
    let mut places = vec![u32::MAX; positions.count];
    let mut used: Vec<u32> = Vec::new();
    let triangles: Vec<[u32; 3]> = corners
        .iter()
        .map(|t| {
            t.map(|v| {
                let place = &mut places[v as usize];
                if *place == u32::MAX {
                    *place = used.len() as u32;
                    used.push(v);
                }
                *place
            })
        })
        .collect();
    drop((places, corners));
    let color = attribute(Semantic::Colors(0));
    let color = numbers(color, "COLOR_0", &[Type::Vec3, Type::Vec4])?;
    let rgb = color_is_rgb(asset, attribute(Semantic::Colors(0)));
    let color_of = |color: &Numbers<'_>, v: u32| {
        let mut rgba: [f32; 4] = color.get(v as usize);
        if rgb {
            rgba[3] = 1.0;
        }
        rgba
    };
    let colors: Option<Vec<[f32; 4]>> = match &color {
        Some(color) => {
            check_count(asset, color, positions.count, at, "COLOR_0")?;
            Some(used.iter().map(|v| color_of(color, *v)).collect())
        }
        None => None,
    };
    let first = colors.as_ref().and_then(|c| c.first()).copied();
    let constant = first.filter(|first| colors.iter().flatten().all(|x| x == first));
    let factor = constant.unwrap_or([1.0; 4]);
    let material = materials.load(loader, scene, asset, primitive.material, factor, &format!("{at}.material"))?;

    let normals = numbers(attribute(Semantic::Normals), "NORMAL", &[Type::Vec3])?;
    let set = material.set.unwrap_or(0);
    let uvs = numbers(attribute(Semantic::TexCoords(set)), "TEXCOORD", &[Type::Vec2])?;
    for (numbers, name) in [(&normals, "NORMAL"), (&uvs, "TEXCOORD")] {
        numbers.iter().try_for_each(|n| check_count(asset, n, positions.count, at, name))?;
    }
    let vertex = |v: &u32| {
        let v = *v as usize;
        let [s, t] = uvs.as_ref().map_or([0.0, 1.0], |n| n.get(v));
        Vertex { position: positions.get(v), normal: normals.as_ref().map_or([0.0; 3], |n| n.get(v)), uv: [s, 1.0 - t] }
    };
    let mut influences = Vec::new();
    for set in 0..2 {
        let [joints, weights] = [Semantic::Joints(set), Semantic::Weights(set)].map(attribute);
        let joints = numbers(joints, "JOINTS", &[Type::Vec4])?;
        let weights = numbers(weights, "WEIGHTS", &[Type::Vec4])?;
        if let (Some(joints), Some(weights)) = (joints, weights) {
            check_count(asset, &joints, positions.count, at, "JOINTS")?;
            check_count(asset, &weights, positions.count, at, "WEIGHTS")?;
            influences.push(used.iter().map(|v| (joints.integers(*v as usize), weights.get(*v as usize))).collect());
        }
    }
    let vertices: Vec<Vertex> = used.iter().map(vertex).collect();
    let smooth = normals.is_some();
    let mut out = Primitive { vertices, triangles, smooth, material: material.index, influences };
    if let Some(colors) = colors.filter(|_| constant.is_none()) {
        materials.volumes.extend(paint(loader, scene, asset, &mut out, material, &colors, at)?);
    }
    Ok(Some(out))
}

/// Gives a primitive the colours of its vertices as a texture of a copy of its material, unless that has others. Returns
/// the solid that the copy bounds.
fn paint(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    asset: &Asset<'_>,
    primitive: &mut Primitive,
    material: Loaded,
    colors: &[[f32; 4]],
    at: &str,
) -> Result<Option<Volume>, LoadError> {
    let mut painted = scene.materials[material.index as usize].clone();
    let Model::Principled(p) = &mut painted.model else {
        loader.note(format!("{at}: colours of vertices were ignored, as there is no material"));
        return Ok(None);
    };
    if material.set.is_some() {
        loader.note(format!("{at}: colours of vertices were ignored, as the material has textures"));
        return Ok(None);
    }
    let color = |v: u32| {
        let [r, g, b, a] = colors.get(v as usize).copied().unwrap_or([1.0; 4]);
        [r, g, b, material.alpha.of_texel(a)]
    };
    let texture = colors::paint(&mut primitive.vertices, &mut primitive.triangles, color);
    let (mut texture, origins) = texture.map_err(|what| asset.error(at, what))?;
    for influences in &mut primitive.influences {
        *influences = origins.iter().map(|v| influences[*v as usize]).collect();
    }
    texture.name = format!("{at}.attributes.COLOR_0");
    p.base_texture = Some(TextureRef::new(scene.textures.len() as u32));
    scene.textures.push(texture);
    if matches!(material.alpha, Alpha::Mask { .. }) {
        // the texture has it
        p.opacity = 1.0;
    }
    primitive.material = scene.materials.len() as u32;
    scene.materials.push(painted);
    Ok(material.sigma_a.map(|sigma_a| Volume { material: primitive.material, sigma_a }))
}

fn color_is_rgb(asset: &Asset<'_>, color: Option<Index<Accessor>>) -> bool {
    let accessor = color.and_then(|i| asset.root.accessors.get(i.value()));
    accessor.is_some_and(|a| a.type_ == Checked::Valid(Type::Vec3))
}

fn check_count(asset: &Asset<'_>, n: &Numbers<'_>, vertices: usize, at: &str, name: &str) -> Result<(), LoadError> {
    if n.count >= vertices {
        return Ok(());
    }
    Err(asset.error(at, format!("{} elements of {name} for {vertices} vertices", n.count)))
}

/// Vertex indices of the triangles, in range.
fn corners(
    asset: &Asset<'_>,
    primitive: &mesh::Primitive,
    mode: Mode,
    vertices: usize,
    at: &str,
) -> Result<Vec<[u32; 3]>, LoadError> {
    if vertices >= u32::MAX as usize {
        return Err(asset.error(at, "too many vertices"));
    }
    let at = format!("{at}.indices");
    let list: Vec<u32> = match primitive.indices {
        None => (0..vertices as u32).collect(),
        Some(index) => {
            let numbers = asset.numbers(index, &at, &[Type::Scalar])?;
            if !numbers.unsigned() {
                return Err(asset.error(at, "not of an unsigned integer type"));
            }
            (0..numbers.count).map(|i| numbers.integers::<1>(i)[0]).collect()
        }
    };
    if let Some(v) = list.iter().find(|v| **v as usize >= vertices) {
        return Err(asset.error(at, format!("there is no vertex {v}, there are {vertices}")));
    }
    let odd = |i: usize, [a, b, c]: [u32; 3]| if i.is_multiple_of(2) { [a, b, c] } else { [a, c, b] };
    Ok(match mode {
        Mode::TriangleStrip => list.windows(3).enumerate().map(|(i, w)| odd(i, [w[0], w[1], w[2]])).collect(),
        Mode::TriangleFan => {
            let rest = list.get(1..).unwrap_or_default();
            rest.windows(2).map(|w| [w[0], w[1], list[0]]).collect()
        }
        _ => list.as_chunks().0.to_vec(),
    })
}

//! Scenes of files that hold one mesh and nothing else: PLY and STL.

use super::loader::Loader;
use super::{LoadError, colors, mtl, obj};
use crate::description::{Model, Reflectance, SceneDescription, Vertex};
use crate::look::{Given, Up};
use std::path::Path;

/// A mesh as its file has it.
#[derive(Default)]
pub(super) struct Mesh {
    pub vertices: Vec<Vertex>,
    /// Indices of vertices, in range.
    pub triangles: Vec<[u32; 3]>,
    /// The vertices have normals.
    pub smooth: bool,
    /// Colours of the vertices, sRGB-encoded; empty, or one for each.
    pub colors: Vec<[u8; 3]>,
}

/// The mesh in grey, or in the colours of its vertices; camera, light and ground are left open. `up` is usual for the format.
pub(super) fn scene(loader: &mut Loader, path: &Path, mut mesh: Mesh, up: Up) -> Result<SceneDescription, LoadError> {
    let mut scene = SceneDescription::default();
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let diffuse = |reflectance| Model::Diffuse { reflectance };
    let used = |v: &u32| mesh.colors.get(*v as usize).copied();
    let first = mesh.triangles.as_flattened().iter().find_map(used);
    let (material, model) = match first {
        None => (obj::NO_MATERIAL, mtl::GREY),
        Some(color) if mesh.triangles.as_flattened().iter().all(|v| used(v) == first) => {
            ("vertex colours", diffuse(Reflectance::Constant(color.map(colors::linear))))
        }
        Some(_) => {
            let color = |v: u32| {
                let [r, g, b] = mesh.colors[v as usize].map(colors::linear);
                [r, g, b, 1.0]
            };
            let (texture, _) = colors::paint(&mut mesh.vertices, &mut mesh.triangles, color)
                .map_err(|what| LoadError::file(path, what))?;
            scene.textures.push(texture);
            ("vertex colours", diffuse(Reflectance::Texture(0)))
        }
    };
    let material = scene.add_material(material, model);
    scene.add_mesh(&name, material, &mesh.vertices, &mesh.triangles, mesh.smooth);
    loader.given = Given { up, ..Given::MESH };
    Ok(scene)
}

//! glTF files: geometry, nodes, materials, lights, cameras, containers, and what broken ones are told.

mod broken;
mod document;
mod geometry;
mod materials;
mod nodes;

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::{LoadOptions, LoadReport, load, load_with};
use croupier_host::look::Look;
use document::Document;
use std::fs;

/// Loads bytes under a name; the error as its text, in which the folder is `@`. The environment is a constant, so that no
/// sky has to be computed.
fn try_load(name: &str, bytes: &[u8]) -> Result<(SceneDescription, LoadReport), String> {
    let environment = Some(Environment::Constant { radiance: [1.0; 3] });
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), bytes).unwrap();
    let shown = folder.path().display().to_string();
    let loaded =
        load_with(&folder.path().join(name), &LoadOptions::default(), &Look { environment, ..Look::default() });
    loaded.map(|(scene, report)| (without_ground(scene), report)).map_err(|e| e.to_string().replace(&shown, "@"))
}

/// As [`try_load`], with the light that the file has or gets.
fn try_load_lit(name: &str, bytes: &[u8]) -> Result<(SceneDescription, LoadReport), String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), bytes).unwrap();
    let shown = folder.path().display().to_string();
    load(&folder.path().join(name)).map_err(|e| e.to_string().replace(&shown, "@"))
}

/// The scene as its file has it, without the ground that a bare mesh gets.
fn without_ground(mut scene: SceneDescription) -> SceneDescription {
    if let Some(i) = scene.objects.iter().position(|o| o.name == "added ground") {
        let first = scene.objects[i].first_triangle as usize;
        let vertices = scene.triangles[first..].iter().flat_map(|t| t.vertices).min().unwrap();
        scene.vertices.truncate(vertices as usize);
        scene.triangles.truncate(first);
        scene.objects.truncate(i);
        scene.materials.pop();
    }
    scene
}

/// Loads a document, which must bake as well.
fn loaded(document: &Document) -> (SceneDescription, Vec<String>) {
    let (scene, report) = try_load("a.glb", &document.glb()).unwrap_or_else(|e| panic!("{e}"));
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    croupier::Scene::from_bytes(&baked.bytes).unwrap();
    (scene, report.notes)
}

fn corners(scene: &SceneDescription) -> Vec<[Vertex; 3]> {
    scene.triangles.iter().map(|t| t.vertices.map(|v| scene.vertices[v as usize])).collect()
}

fn positions(scene: &SceneDescription) -> Vec<[[f32; 3]; 3]> {
    corners(scene).iter().map(|t| t.map(|v| v.position)).collect()
}

/// Rounded to a millionth, so that sums of products compare.
fn rounded(points: &[[[f32; 3]; 3]]) -> Vec<[[f64; 3]; 3]> {
    points.iter().map(|t| t.map(|p| p.map(|x| (f64::from(x) * 1e5).round() / 1e5 + 0.0))).collect()
}

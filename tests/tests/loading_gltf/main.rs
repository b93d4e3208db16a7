//! glTF files: geometry, nodes, materials, lights, cameras, containers, and what broken ones are told.

mod broken;
mod document;
mod geometry;
mod materials;
mod nodes;

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::{LoadReport, load};
use document::Document;
use std::fs;

/// Loads bytes under a name; the error as its text, in which the folder is `@`.
fn try_load(name: &str, bytes: &[u8]) -> Result<(SceneDescription, LoadReport), String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), bytes).unwrap();
    let shown = folder.path().display().to_string();
    load(&folder.path().join(name)).map_err(|e| e.to_string().replace(&shown, "@"))
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

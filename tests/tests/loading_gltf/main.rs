//! glTF files: geometry, nodes, materials, lights, cameras, containers, and what broken ones are told.

mod broken;
mod geometry;
mod materials;
mod nodes;

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::{LoadOptions, LoadReport};
use croupier_host::look::Look;
use croupier_tests::gltf::Document;
use croupier_tests::loading::{corners, positions, try_load, try_load_with};

/// As [`try_load`], with the light that the file has or gets.
fn try_load_lit(name: &str, bytes: &[u8]) -> Result<(SceneDescription, LoadReport), String> {
    try_load_with(name, bytes, &LoadOptions::default(), &Look::default())
}

/// Loads a document, which must bake as well.
fn loaded(document: &Document) -> (SceneDescription, Vec<String>) {
    let (scene, report) = try_load("a.glb", &document.glb()).unwrap_or_else(|e| panic!("{e}"));
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    croupier::Scene::from_bytes(&baked.bytes).unwrap();
    (scene, report.notes)
}

/// Rounded to a millionth, so that sums of products compare.
fn rounded(points: &[[[f32; 3]; 3]]) -> Vec<[[f64; 3]; 3]> {
    points.iter().map(|t| t.map(|p| p.map(|x| (f64::from(x) * 1e5).round() / 1e5 + 0.0))).collect()
}

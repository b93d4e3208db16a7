//! Scenes from a few sections.

use croupier::unstable::scene::blob::{Camera, SceneInfo};
use croupier::unstable::scene::{Effects, Records};

/// Records of a scene in which there is nothing, for `..none(info, camera)`.
pub(crate) fn none<'s>(info: &'s SceneInfo, camera: &'s Camera) -> Records<'s> {
    Records {
        info,
        nodes: &[],
        leaves: &[],
        triangles: &[],
        vertices: &[],
        materials: &[],
        textures: &[],
        texels: &[],
        tables: &[],
        lights: &[],
        light_alias: &[],
        light_nodes: &[],
        light_trails: &[],
        environment: None,
        env_texels: &[],
        env_alias: &[],
        camera,
        media: &[],
        densities: &[],
        majorants: &[],
        objects: &[],
        instances: &[],
        names: &[],
        effects: Effects::default(),
        highlight: 0.0,
        hash: 0,
    }
}

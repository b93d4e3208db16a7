//! The sections of a scene blob as slices.

use super::blob::*;
use super::effects::Effects;

/// The sections of a scene blob.
#[derive(Clone, Copy, Debug)]
pub struct Records<'s> {
    /// Facts about the whole scene.
    pub info: &'s SceneInfo,
    /// Nodes of the tree.
    pub nodes: &'s [Node],
    /// Leaves of the tree.
    pub leaves: &'s [Leaf],
    /// Triangles.
    pub triangles: &'s [Triangle],
    /// Vertices.
    pub vertices: &'s [Vertex],
    /// Materials.
    pub materials: &'s [Material],
    /// Textures.
    pub textures: &'s [Texture],
    /// sRGB texels.
    pub texels: &'s [u32],
    /// Tables that materials refer to.
    pub tables: &'s [f32],
    /// Lights.
    pub lights: &'s [Light],
    /// Alias table over the lights; may be empty if no light emits.
    pub light_alias: &'s [Alias],
    /// Light tree; empty where lights are chosen by the alias table.
    pub light_nodes: &'s [LightNode],
    /// Trails of the lights in the tree.
    pub light_trails: &'s [u32],
    /// Environment, if any.
    pub environment: Option<&'s Environment>,
    /// Radiance of the environment map.
    pub env_texels: &'s [[f32; 3]],
    /// Alias tables of the environment map; empty if it is black.
    pub env_alias: &'s [Alias],
    /// Camera.
    pub camera: &'s Camera,
    /// Media, those of higher priority first.
    pub media: &'s [Medium],
    /// Densities of grid media.
    pub densities: &'s [f32],
    /// Majorants of grid media.
    pub majorants: &'s [f32],
    /// Objects, the world first; empty without instances.
    pub objects: &'s [Object],
    /// Instances, those of each object in a run.
    pub instances: &'s [Instance],
    /// Names of materials and, behind them, of objects, a line each; see [`super::Scene::material_name`] and
    /// [`super::Scene::object_name`].
    pub names: &'s [u8],
    /// Effects that the scene calls for: of the materials that triangles use, of lights and camera.
    pub effects: Effects,
    /// Largest radiance, of any channel, that mirrors and other narrow lobes may show of the emitters that rays can meet,
    /// where no light sample stands in for it; 0 without such lobes.
    pub highlight: f32,
    /// [`content_hash`] of the blob.
    pub hash: u64,
}

impl<'s> Records<'s> {
    /// A scene with nothing but these.
    pub const fn of(info: &'s SceneInfo, camera: &'s Camera) -> Self {
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
            effects: Effects(0),
            highlight: 0.0,
            hash: 0,
        }
    }

    /// An empty scene: what a container shows that has lost its bytes.
    pub(crate) const NOTHING: Records<'static> = {
        const INFO: &SceneInfo =
            &SceneInfo { bounds_min: [0.0; 3], bounds_max: [0.0; 3], max_depth: 1, dropped_triangles: 0 };
        const CAMERA: &Camera = &Camera {
            origin: [0.0; 3],
            forward: [0.0, 0.0, -1.0],
            right: [1.0, 0.0, 0.0],
            down: [0.0, -1.0, 0.0],
            lens_radius: 0.0,
            focus_distance: 1.0,
            size: [1, 1],
            kind: CameraKind::Perspective as u32,
        };
        Records::of(INFO, CAMERA)
    };
}

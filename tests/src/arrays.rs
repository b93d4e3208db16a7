//! The arrays of a baked scene without instances, as a host has them that composes it again.

use croupier::Scene;
use croupier::unstable::compose::{SceneParts, Surround};
use croupier::unstable::scene::blob::*;
use croupier_host::blob::AlignedBytes;

/// Arrays of a scene. What composing derives is left out.
#[derive(Clone, Debug)]
pub struct Arrays {
    /// Of vertices.
    pub positions: Vec<[f32; 3]>,
    /// Of vertices; 0 where triangles are flat.
    pub normals: Vec<[f32; 3]>,
    /// Of vertices.
    pub uvs: Vec<[f32; 2]>,
    /// Vertices of triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Of triangles.
    pub triangle_materials: Vec<u32>,
    /// Without the tables of rough plastics.
    pub materials: Vec<Material>,
    /// Of materials.
    pub emission: Vec<[f32; 3]>,
    /// Of textures.
    pub texels: Vec<u32>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Homogeneous media.
    pub media: Vec<Medium>,
    /// Lights that are no triangles.
    pub lights: Vec<Light>,
    /// Environment: its record and its texels.
    pub environment: Option<(Environment, Vec<[f32; 3]>)>,
    /// Names of materials.
    pub names: Vec<u8>,
    /// Camera.
    pub camera: Camera,
    /// Longest path.
    pub max_depth: u32,
}

impl Arrays {
    /// Arrays of a blob. Each triangle gets vertices of its own if it is flat, so that vertices of smooth ones keep
    /// theirs.
    pub fn of(scene: &Scene<'_>) -> Self {
        assert!(scene.objects.is_empty(), "without instances");
        let mut emission = vec![[0.0; 3]; scene.materials.len()];
        for l in scene.lights.iter().filter(|l| l.kind == LightKind::Area as u32) {
            emission[scene.triangles[l.triangle as usize].material as usize] = l.emission;
        }
        let others = |l: &&Light| l.kind != LightKind::Area as u32 && l.kind != LightKind::Environment as u32;
        let plain = |m: &Material| {
            let coat = m.fdr > 0.0;
            Material { fdr: 0.0, table: if coat { NONE } else { m.table }, ..*m }
        };
        let smooth = scene.triangles.iter().any(|t| t.flags & TRIANGLE_SMOOTH != 0);
        let mut normals: Vec<_> = scene.vertices.iter().map(|v| v.n).collect();
        for t in scene.triangles.iter().filter(|t| t.flags & TRIANGLE_SMOOTH == 0) {
            t.vertex.iter().for_each(|v| normals[*v as usize] = [0.0; 3]);
        }
        Self {
            positions: scene.vertices.iter().map(|v| v.p).collect(),
            normals: if smooth { normals } else { Vec::new() },
            uvs: scene.vertices.iter().map(|v| v.uv).collect(),
            triangles: scene.triangles.iter().map(|t| t.vertex).collect(),
            triangle_materials: scene.triangles.iter().map(|t| t.material).collect(),
            materials: scene.materials.iter().map(plain).collect(),
            emission,
            texels: scene.texels.to_vec(),
            textures: scene.textures.to_vec(),
            media: scene.media.to_vec(),
            lights: scene.lights.iter().filter(others).copied().collect(),
            environment: scene.environment.map(|e| (*e, scene.env_texels.to_vec())),
            names: scene
                .names
                .split_inclusive(|b| *b == b'\n')
                .take(scene.materials.len())
                .flatten()
                .copied()
                .collect(),
            camera: *scene.camera,
            max_depth: scene.info.max_depth,
        }
    }

    /// The parts that these arrays are.
    pub fn parts(&self) -> SceneParts<'_> {
        SceneParts {
            positions: &self.positions,
            normals: &self.normals,
            uvs: &self.uvs,
            triangles: &self.triangles,
            triangle_materials: &self.triangle_materials,
            materials: &self.materials,
            emission: &self.emission,
            names: &self.names,
            textures: &self.textures,
            texels: &self.texels,
            media: &self.media,
            lights: &self.lights,
            environment: self.environment.as_ref().map(|(e, texels)| surround(e, texels)),
            max_depth: self.max_depth,
            ..SceneParts::new(self.camera)
        }
    }
}

fn surround<'a>(e: &Environment, texels: &'a [[f32; 3]]) -> Surround<'a> {
    if e.kind == EnvironmentKind::Constant as u32 {
        return Surround::Constant { radiance: e.radiance };
    }
    let to_world = std::array::from_fn(|i| std::array::from_fn(|j| e.to_local[j][i]));
    Surround::Map { size: [e.width, e.height], texels, scale: e.radiance, to_world }
}

/// A composed blob in memory of its own, no longer than it must be.
pub fn composed(parts: &SceneParts<'_>) -> AlignedBytes {
    let layout = parts.layout().expect("parts of a scene");
    let mut blob = AlignedBytes::zeroed(layout.blob.size);
    let mut scratch = AlignedBytes::zeroed(layout.scratch.size);
    // what is there must not matter
    blob.as_mut().fill(0xa5);
    scratch.as_mut().fill(0x5a);
    let composed = parts.compose(blob.as_mut(), scratch.as_mut()).expect("enough memory");
    let mut exact = AlignedBytes::zeroed(composed.len());
    exact.as_mut().copy_from_slice(composed);
    exact
}

//! Small scenes for light tests, put together without baking.

use crate::records::none;
use bytemuck::Zeroable;
use croupier::Scene;
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Effects, Records};
use croupier_host::{alias, environment};

/// Owns what a [`Scene`] borrows.
#[derive(Debug)]
pub struct LightScene {
    info: SceneInfo,
    camera: Camera,
    triangles: Vec<Triangle>,
    vertices: Vec<Vertex>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Texels.
    pub texels: Vec<u32>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Selection table, set by [`Self::finish`].
    pub light_alias: Vec<Alias>,
    /// Environment.
    pub environment: Option<Environment>,
    /// Its map.
    pub env_texels: Vec<[f32; 3]>,
    /// Its tables.
    pub env_alias: Vec<Alias>,
}

impl Default for LightScene {
    fn default() -> Self {
        Self {
            info: SceneInfo::zeroed(),
            camera: Camera::zeroed(),
            triangles: vec![],
            vertices: vec![],
            textures: vec![],
            texels: vec![],
            lights: vec![],
            light_alias: vec![],
            environment: None,
            env_texels: vec![],
            env_alias: vec![],
        }
    }
}

/// The rotation that leaves everything where it is.
pub const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl LightScene {
    /// Adds a triangle, an emitting one if `radiance` is given; returns its index.
    pub fn triangle(mut self, p: [[f32; 3]; 3], radiance: Option<[f32; 3]>) -> Self {
        let (first, index) = (self.vertices.len() as u32, self.triangles.len() as u32);
        self.vertices.extend(p.map(|p| Vertex { p, n: [0.0; 3], uv: [0.0; 2] }));
        let light = if radiance.is_some() { self.lights.len() as u32 } else { NONE };
        self.triangles.push(Triangle { vertex: [first, first + 1, first + 2], material: 0, light, flags: 0 });
        if let Some(emission) = radiance {
            let area = crate::light_oracle::area(p) as f32;
            self.lights.push(Light {
                kind: LightKind::Area as u32,
                triangle: index,
                area,
                emission,
                ..Light::zeroed()
            });
        }
        self
    }

    /// Adds a point or directional light.
    pub fn delta(mut self, kind: LightKind, vector: [f32; 3], emission: [f32; 3]) -> Self {
        self.lights.push(Light { kind: kind as u32, triangle: NONE, vector, emission, ..Light::zeroed() });
        self
    }

    /// Gives the last light a cone: axis, 1 - cos of the outer and of the inner half angle.
    pub fn cone(mut self, axis: [f64; 3], [outer, inner]: [f64; 2]) -> Self {
        let [x, y, z] = axis;
        let params = [x, y, z, outer, inner, 0.0].map(|x| x as f32);
        self.lights.iter_mut().last().expect("a light").params = params;
        self
    }

    /// Gives the last light an angular radius, radians.
    pub fn disk(mut self, radius: f64) -> Self {
        self.lights.iter_mut().last().expect("a light").params[0] = (1.0 - radius.cos()) as f32;
        self
    }

    /// Adds a light with a shape that emits from one side.
    pub fn shape(mut self, kind: LightKind, middle: [f32; 3], params: &[f32], emission: [f32; 3]) -> Self {
        let mut all = [0.0; 6];
        all[..params.len()].copy_from_slice(params);
        self.lights.push(Light { kind: kind as u32, vector: middle, emission, params: all, ..Light::zeroed() });
        self
    }

    /// Lets the last light, one with a shape, emit from both sides.
    pub fn two_sided(mut self) -> Self {
        self.lights.iter_mut().last().expect("a light").triangle |= SHAPE_TWO_SIDED;
        self
    }

    fn environment(mut self, e: Environment) -> Self {
        self.environment = Some(Environment { light: self.lights.len() as u32, ..e });
        self.lights.push(Light { kind: LightKind::Environment as u32, triangle: NONE, ..Light::zeroed() });
        self
    }

    /// Adds a constant environment.
    pub fn constant(self, radiance: [f32; 3]) -> Self {
        let kind = EnvironmentKind::Constant as u32;
        self.environment(Environment { kind, radiance, to_local: IDENTITY, ..Environment::zeroed() })
    }

    /// Adds an environment map with its tables.
    pub fn map(mut self, texels: Vec<[f32; 3]>, size: [u32; 2], scale: f32, to_local: [[f32; 3]; 3]) -> Self {
        self.env_alias = environment::map_tables(&texels, size[0], size[1]);
        self.env_texels = texels;
        self.environment(Environment {
            kind: EnvironmentKind::Map as u32,
            light: 0,
            width: size[0],
            height: size[1],
            to_local,
            radiance: [scale; 3],
        })
    }

    /// Gives the scene bounds.
    pub fn within(mut self, [lo, hi]: [[f32; 3]; 2]) -> Self {
        (self.info.bounds_min, self.info.bounds_max) = (lo, hi);
        self
    }

    /// Selects by power, the scene taken as of radius 1.
    pub fn finish(self) -> Self {
        let weights = environment::light_weights(&self.lights, self.environment.as_ref(), &self.env_texels, 1.0);
        self.select_by(&weights)
    }

    /// Selects with the given weights.
    pub fn select_by(mut self, weights: &[f64]) -> Self {
        self.light_alias = alias::build(weights);
        self
    }

    /// The scene. Nothing validates it: tests may hand over nonsense.
    pub fn scene(&self) -> Scene<'_> {
        Scene::assume_valid(Records {
            triangles: &self.triangles,
            vertices: &self.vertices,
            textures: &self.textures,
            texels: &self.texels,
            lights: &self.lights,
            light_alias: &self.light_alias,
            environment: self.environment.as_ref(),
            env_texels: &self.env_texels,
            env_alias: &self.env_alias,
            effects: Effects(u32::MAX),
            ..none(&self.info, &self.camera)
        })
    }
}

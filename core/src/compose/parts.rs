//! What a scene is composed of.

use crate::memory::Layout;
use crate::scene::blob::{Camera, Light, Material, Medium, Texture};

/// Arrays that make up a scene, all in the caller's memory. Lengths are in the scene's unit, emission is linear Rec.
/// 709.
///
/// Records of materials, textures, media and lights are those of the blob ([`crate::unstable::scene::blob`]): what
/// composing
/// derives of them is left at 0 or [`NONE`](crate::unstable::scene::blob::NONE).
///
/// ```
/// use croupier::unstable::compose::{LightSource, SceneParts, View};
/// use croupier::unstable::scene::blob::{Material, MaterialKind};
/// use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
/// # #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
/// # #[repr(C, align(64))]
/// # struct Line([u8; 64]);
/// # fn memory(layout: croupier::unstable::Layout) -> Vec<Line> {
/// #     vec![Line([0; 64]); layout.size.div_ceil(64)]
/// # }
/// # use bytemuck::cast_slice_mut as bytes;
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// // A floor of two triangles under a point light, without an allocator or files.
/// let positions = [[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]];
/// let grey = Material { reflectance: [0.5; 3], ..Material::new(MaterialKind::Diffuse) };
/// let light = LightSource::Point { position: [0.0, 1.0, 0.0], intensity: [3.0; 3] };
/// let view = View { origin: [0.0, 2.0, 2.0], size: [16, 16], ..View::default() };
/// let parts = SceneParts {
///     positions: &positions,
///     triangles: &[[0, 1, 2], [0, 2, 3]],
///     materials: &[grey],
///     lights: &[light.record()?],
///     ..SceneParts::new(view.record()?)
/// };
///
/// let layout = parts.layout()?;
/// let (mut blob, mut scratch) = (memory(layout.blob), memory(layout.scratch)); // or static arrays
/// let scene = Scene::from_bytes(parts.compose(bytes(&mut blob), bytes(&mut scratch))?)?;
///
/// let plan = Plan::new(&Settings::for_scene(&scene))?;
/// let (mut shared, mut block) = (memory(plan.session()), memory(plan.shard()));
/// let mut session = Session::new(scene, &plan, bytes(&mut shared))?;
/// let mut shard = Shard::new(&plan, 0, bytes(&mut block))?;
/// session.begin_iteration(4);
/// while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {}
/// session.end_iteration([&shard])?;
/// // light 1 above grey 0.5: radiance 0.5 / pi x 3 below it
/// let below = session.film().pixel(8 * 16 + 8).mean();
/// assert!((0.2..0.6).contains(&below[0]), "{below:?}");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SceneParts<'a> {
    /// Positions of vertices, world space, each coordinate up to 1e9 as a magnitude.
    pub positions: &'a [[f32; 3]],
    /// Normals of vertices, of any length; or nothing: all triangles are flat. Triangles with a vertex whose normal is
    /// 0 are
    /// flat.
    pub normals: &'a [[f32; 3]],
    /// Texture coordinates of vertices, v upwards; or nothing.
    pub uvs: &'a [[f32; 2]],
    /// Vertices of triangles, counter-clockwise seen from the front. Triangles without an area that `f32` can hold are
    /// left
    /// out and counted; others keep their order.
    pub triangles: &'a [[u32; 3]],
    /// Materials of triangles; or nothing: all have material 0.
    pub triangle_materials: &'a [u32],
    /// Materials. Left to composing: `fdr` of a smooth plastic if it is 0, `table` and `fdr` of a rough plastic whose
    /// table is
    /// [`NONE`](crate::unstable::scene::blob::NONE). Others with tables refer to [`Self::tables`].
    pub materials: &'a [Material],
    /// Radiance that the triangles of each material emit from their front; or nothing: none emit.
    pub emission: &'a [[f32; 3]],
    /// Tables that materials refer to.
    pub tables: &'a [f32],
    /// Names of materials, UTF-8, each ended by a newline; or nothing.
    pub names: &'a [u8],
    /// Textures.
    pub textures: &'a [Texture],
    /// Texels of textures: bytes r, g, b, alpha from the lowest on; row 0 is the top.
    pub texels: &'a [u32],
    /// Homogeneous media, those of higher priority first. Their boundaries must be closed, which is not checked.
    pub media: &'a [Medium],
    /// Lights that are not triangles, see [`LightSource::record`](super::LightSource::record). In the blob they follow
    /// those of
    /// the triangles: first those without a shape, then the environment, then those with one.
    pub lights: &'a [Light],
    /// Environment; a black one is left out.
    pub environment: Option<Surround<'a>>,
    /// Camera, see [`View::record`](super::View::record).
    pub camera: Camera,
    /// Path segments from the camera, a default for the settings.
    pub max_depth: u32,
}

/// What light comes from infinity.
#[derive(Clone, Copy, Debug)]
pub enum Surround<'a> {
    /// The same from all directions.
    Constant {
        /// Radiance.
        radiance: [f32; 3],
    },
    /// A lat-long map.
    Map {
        /// Columns, from 1, and rows, from 2, both up to 65536.
        size: [u32; 2],
        /// Radiance, row 0 (+Y of the map) first.
        texels: &'a [[f32; 3]],
        /// Factor on all texels.
        scale: [f32; 3],
        /// Rows of the rotation from map to world.
        to_world: [[f32; 3]; 3],
    },
}

impl SceneParts<'_> {
    /// No parts, seen by this camera; at most 40 path segments.
    pub const fn new(camera: Camera) -> Self {
        Self {
            positions: &[],
            normals: &[],
            uvs: &[],
            triangles: &[],
            triangle_materials: &[],
            materials: &[],
            emission: &[],
            tables: &[],
            names: &[],
            textures: &[],
            texels: &[],
            media: &[],
            lights: &[],
            environment: None,
            camera,
            max_depth: 40,
        }
    }

    /// Positions of the corners of a triangle; NaN where there is no such vertex.
    pub(super) fn corners(&self, triangle: &[u32; 3]) -> [[f32; 3]; 3] {
        triangle.map(|v| self.positions.get(v as usize).copied().unwrap_or([f32::NAN; 3]))
    }

    /// Material of triangle `i`.
    pub(super) fn material_of(&self, i: usize) -> u32 {
        self.triangle_materials.get(i).copied().unwrap_or(0)
    }

    /// Radiance of a material.
    pub(super) fn emission_of(&self, material: u32) -> [f32; 3] {
        self.emission.get(material as usize).copied().unwrap_or([0.0; 3])
    }
}

/// Memory that composing needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComposeLayout {
    /// The block for the blob: what always suffices. Most trees take a third of it; the blob's own length is known once
    /// it is
    /// composed. A block that is smaller will do as long as the tree fits.
    pub blob: Layout,
    /// The block for intermediate results.
    pub scratch: Layout,
}

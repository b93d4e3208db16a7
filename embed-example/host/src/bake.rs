//! From a [`SceneDescription`] to a scene blob.
//!
//! | file | bakes |
//! |---|---|
//! | `geometry` | vertices, triangles, which of them are degenerate |
//! | `instances` | trees, objects and their instances |
//! | `materials` | materials, their tables, textures |
//! | `principled` | the records of principled materials |
//! | `lights` | lights, their choice, the environment |
//! | `emission` | nothing: how much light triangles emit with a texture |
//! | `media` | participating media, their majorants |
//! | `boundary` | nothing: checks that boundaries of media are closed |
//! | `camera` | the camera |
//!
//! Degenerate triangles are dropped and counted; everything else that cannot be rendered is a [`BakeError`] that names
//! it. What is written passes [`croupier::Scene::from_bytes`].

mod boundary;
mod camera;
mod emission;
mod error;
mod geometry;
mod instances;
mod lights;
mod materials;
mod media;
mod principled;

pub(crate) use boundary::is_closed as boundary_is_closed;
pub use error::BakeError;

use crate::blob::{AlignedBytes, BlobWriter};
use crate::bvh;
use crate::description::SceneDescription;
use croupier::unstable::scene::blob::{SceneInfo, SectionKind};

/// Options of baking.
#[derive(Clone, Copy, Debug, Default)]
pub struct BakeOptions {
    /// Effort of building the tree.
    pub effort: bvh::Effort,
}

/// Stages of baking, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Checks vertices, triangles, media and their boundaries.
    Geometry,
    /// Builds the tree.
    Tree,
    /// Tabulates materials, collects textures.
    Materials,
    /// Builds the tables of the lights and the environment.
    Lights,
    /// Writes the blob.
    Write,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: &'static [Self] = &[Self::Geometry, Self::Tree, Self::Materials, Self::Lights, Self::Write];

    /// Name of the stage for progress displays.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Geometry => "checking geometry",
            Self::Tree => "building the tree",
            Self::Materials => "tabulating materials",
            Self::Lights => "tabulating lights",
            Self::Write => "writing the scene",
        }
    }
}

/// Counts and sizes of a baked scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BakeReport {
    /// Triangles in the blob.
    pub triangles: u32,
    /// Triangles without area, which are left out.
    pub dropped_degenerate: u32,
    /// Triangles without area that would have been lights.
    pub dropped_lights: u32,
    /// Smooth triangles with a vertex normal of length 0, shaded flat.
    pub flattened: u32,
    /// Lights, the environment included.
    pub lights: u32,
    /// Instances, those within other objects included.
    pub instances: u32,
    /// Prototypes that no instance leads to, which are left out.
    pub unused_prototypes: u32,
    /// Nodes of all trees.
    pub nodes: u32,
    /// Leaves of all trees.
    pub leaves: u32,
    /// Nodes on the longest path of any tree.
    pub depth: u32,
    /// Bytes of the sections, in blob order.
    pub sections: Vec<(SectionKind, u64)>,
    /// Bytes of the blob.
    pub bytes: u64,
}

/// Scene blob with a report of its making.
#[derive(Clone, Debug)]
pub struct Baked {
    /// The blob, at an address that suits [`croupier::Scene::from_bytes`] best.
    pub bytes: AlignedBytes,
    /// Counts and sizes.
    pub report: BakeReport,
}

/// Index in the description of each triangle of the blob, in the blob's order: triangles without area are left out, and
/// those of prototypes follow those of the world.
///
/// # Errors
/// Prototypes and instances that cannot be baked.
pub fn triangle_order(scene: &SceneDescription) -> Result<Vec<u32>, BakeError> {
    Ok(geometry::order(scene, &instances::plan(scene)?.runs))
}

/// Bakes a scene. `progress` hears of each stage at its start (0) and end (1).
///
/// The blob depends on the description and the options only: the same input gives the same bytes.
pub fn bake(
    scene: &SceneDescription,
    options: &BakeOptions,
    progress: impl Fn(Stage, f32),
) -> Result<Baked, BakeError> {
    let staged = |stage| {
        progress(stage, 0.0);
        stage
    };
    let done = |stage| progress(stage, 1.0);

    let stage = staged(Stage::Geometry);
    let camera = camera::bake(&scene.camera)?;
    let emission = lights::emission_of_materials(scene)?;
    let plan = instances::plan(scene)?;
    let mut geometry = geometry::bake(scene, &emission, &plan.runs)?;
    let media = media::bake(&scene.media)?;
    boundary::check(scene, &plan.runs)?;
    done(stage);

    let stage = staged(Stage::Tree);
    let mut forest = instances::bake(scene, &plan, &geometry, options.effort)?;
    done(stage);

    let stage = staged(Stage::Materials);
    let materials = materials::bake(scene)?;
    done(stage);

    let stage = staged(Stage::Lights);
    let lights = lights::bake(scene, &emission, &mut geometry, &mut forest)?;
    done(stage);

    let stage = staged(Stage::Write);
    let [bounds_min, bounds_max] = forest.bounds;
    let info = SceneInfo {
        bounds_min,
        bounds_max,
        max_depth: scene.max_depth,
        dropped_triangles: geometry.dropped_degenerate,
    };
    let mut report = BakeReport {
        triangles: geometry.triangles.len() as u32,
        dropped_degenerate: geometry.dropped_degenerate,
        dropped_lights: geometry.dropped_lights,
        flattened: geometry.flattened,
        lights: lights.lights.len() as u32,
        instances: forest.instances.len() as u32,
        unused_prototypes: plan.unused(),
        nodes: forest.nodes.len() as u32,
        leaves: forest.leaves.len() as u32,
        depth: forest.depth,
        ..BakeReport::default()
    };
    let (info, camera) = ([info], [camera]);
    let mut writer = BlobWriter::default();
    writer
        .section(SectionKind::Info, &info)
        .section(SectionKind::Cameras, &camera)
        .section(SectionKind::Nodes, &forest.nodes)
        .section(SectionKind::Leaves, &forest.leaves)
        .section(SectionKind::Triangles, &geometry.triangles)
        .section(SectionKind::Vertices, &geometry.vertices)
        .section(SectionKind::Materials, &materials.materials)
        .section(SectionKind::Textures, &materials.textures)
        .section(SectionKind::Texels, &materials.texels)
        .section(SectionKind::Tables, &materials.tables)
        .section(SectionKind::Names, &materials.names)
        .section(SectionKind::Lights, &lights.lights)
        .section(SectionKind::LightAlias, &lights.alias)
        .section(SectionKind::LightNodes, &lights.nodes)
        .section(SectionKind::LightTrails, &lights.trails)
        .section(SectionKind::Environment, &lights.environment)
        .section(SectionKind::EnvTexels, &lights.env_texels)
        .section(SectionKind::EnvAlias, &lights.env_alias)
        .section(SectionKind::Media, &media.media)
        .section(SectionKind::Densities, &media.densities)
        .section(SectionKind::Majorants, &media.majorants)
        .section(SectionKind::Objects, &forest.objects)
        .section(SectionKind::Instances, &forest.instances);
    report.sections = writer.sizes();
    let bytes = writer.finish();
    report.bytes = bytes.len() as u64;
    done(stage);
    Ok(Baked { bytes, report })
}

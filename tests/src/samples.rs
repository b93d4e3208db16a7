//! Sample files: those of `tests/samples`, taken from packages, and glTF documents with the features of the usual sample
//! models. They are completed, baked and rendered as the program does.

mod documents;
mod files;
mod shapes;

pub use documents::documents;
pub use files::{FILES, REFUSED};

use croupier::Strategy;
use croupier::unstable::film::{Aov, AovSet};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::SceneDescription;
use croupier_host::drive::Unobserved;
use croupier_host::image::Rgb;
use croupier_host::load::{LoadOptions, load_with};
use croupier_host::look::Look;
use croupier_host::render::{RenderOptions, Target, render};
use std::path::{Path, PathBuf};

/// A file and what must be in it.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Path below `tests/samples`, or the name of a document.
    pub name: String,
    /// Where it is: shipped, or written by [`all`].
    pub path: PathBuf,
    /// Triangles in the world, those of every instance counted.
    pub triangles: usize,
}

/// Every sample; the documents are written into `folder`.
///
/// # Panics
/// If a document cannot be written.
pub fn all(folder: &Path) -> Vec<Sample> {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    let files = FILES.iter().map(|(name, triangles)| Sample {
        name: (*name).into(),
        path: shipped.join(name),
        triangles: *triangles,
    });
    let made = documents().into_iter().map(|(name, triangles, document)| {
        let path = folder.join(format!("{name}.glb"));
        std::fs::write(&path, document.glb()).expect("a folder to write to");
        Sample { name: name.into(), path, triangles }
    });
    files.chain(made).collect()
}

/// What became of a sample.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Triangles in the world without those of an added ground, those of every instance counted.
    pub triangles: usize,
    /// Linear radiance.
    pub picture: Rgb,
    /// Share of the pixels that see the sample and not the added ground or the environment, 0 to 1.
    pub seen: f64,
    /// Notes of loading.
    pub notes: Vec<String>,
}

/// Name of the ground that bare meshes get.
const GROUND: &str = "added ground";

/// Renders a sample with the camera, light and ground that it has or gets; the longer side has `side` pixels.
///
/// # Errors
/// Those of loading, baking and rendering, as their text.
pub fn show(sample: &Sample, side: u32, spp: u32) -> Result<Shown, String> {
    let (mut scene, report) =
        load_with(&sample.path, &LoadOptions::default(), &Look::default()).map_err(|e| e.to_string())?;
    let [width, height] = scene.camera.size;
    scene.camera.size = [width, height].map(|n| (side * n / width.max(height)).max(1));
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).map_err(|e| e.to_string())?;
    let mut options = RenderOptions::new(Strategy::parse("classic").expect("a strategy"));
    options.settings.aovs = AovSet::of(&[Aov::Object]);
    options.settings.shards = 1;
    options.target = Target::Spp(spp);
    options.threads = 1;
    let rendered = render(&baked.bytes, &options, &Unobserved).map_err(|e| e.to_string())?.picture;
    let objects = rendered.layer("object").and_then(|l| l.channel("id")).ok_or("no plane of objects")?;
    let ground = scene.objects.iter().position(|o| o.name == GROUND).map(|i| i as f32);
    let seen = objects.iter().filter(|o| **o >= 0.0 && Some(**o) != ground).count();
    Ok(Shown {
        triangles: triangles(&scene),
        seen: seen as f64 / objects.len() as f64,
        picture: rendered.main().ok_or("no picture")?,
        notes: report.notes,
    })
}

/// Triangles in the world, without the added ground.
fn triangles(scene: &SceneDescription) -> usize {
    let of_prototype = |i: u32| scene.prototypes.iter().any(|p| p.triangles.contains(&i));
    let own = |i: &u32| scene.object_of(*i) != GROUND && !of_prototype(*i);
    let placed = |prototype: u32| -> usize {
        let p = &scene.prototypes[prototype as usize];
        let inner = p.instances.iter().map(|i| scene.prototypes[i.prototype as usize].triangles.len());
        p.triangles.len() + inner.sum::<usize>()
    };
    let instances = scene.instances.iter().map(|i| placed(i.prototype)).sum::<usize>();
    (0..scene.triangles.len() as u32).filter(own).count() + instances
}

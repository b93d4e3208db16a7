//! A shared scene, baked, with the picture it should give.

use croupier_host::bake::{BakeOptions, Baked, bake};
use croupier_host::compare::{Estimate, relmse_of};
use croupier_host::image::Rgb;
use croupier_host::load::load;
use std::error::Error;
use std::path::Path;

/// A scene with its reference.
pub struct Subject {
    /// Name of its folder.
    pub name: String,
    /// Ready to render.
    pub baked: Baked,
    /// `reference.exr`.
    pub image: Rgb,
    /// The same with `reference_stderr.exr`.
    pub reference: Estimate,
}

impl Subject {
    /// Loads and bakes the scene `name` of a folder of scenes.
    pub fn open(scenes: &Path, name: &str) -> Result<Self, Box<dyn Error>> {
        let folder = scenes.join(name);
        let (scene, _) = load(&folder)?;
        let baked = bake(&scene, &BakeOptions::default(), |_, _| ())?;
        let image = Rgb::read_exr(&folder.join("reference.exr"))?;
        let stderr = Rgb::read_exr(&folder.join("reference_stderr.exr"))?;
        let reference = Estimate::from_image(&image, Some(&stderr))?;
        Ok(Self { name: name.into(), baked, image, reference })
    }

    /// What the noise of the reference adds to every relMSE.
    pub fn reference_noise(&self) -> f64 {
        relmse_of(&self.reference)
    }
}

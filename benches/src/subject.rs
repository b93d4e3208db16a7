//! A shared scene, baked, with the picture it should give.

use croupier_host::bake::{BakeOptions, Baked, bake};
use croupier_host::compare::{CompareError, MeanImage, relmse_of, relmse_of_per_pixel, relmse_per_pixel};
use croupier_host::image::{Layer, Picture, Rgb};
use croupier_host::load::load;
use std::error::Error;
use std::path::Path;

/// A scene with its reference.
pub struct Subject {
    /// Name of its folder.
    pub name: String,
    /// Ready to render.
    pub baked: Baked,
    /// `reference.exr`, or what [`Self::with_reference`] put in its place.
    pub image: Rgb,
    /// The same with its standard error.
    pub reference: MeanImage,
}

impl Subject {
    /// Loads and bakes the scene `name` of a folder of scenes.
    pub fn open(scenes: &Path, name: &str) -> Result<Self, Box<dyn Error>> {
        let folder = scenes.join(name);
        let (scene, _) = load(&folder)?;
        let baked = bake(&scene, &BakeOptions::default(), |_, _| ())?;
        let image = Rgb::read_exr(&folder.join("reference.exr"))?;
        let stderr = Rgb::read_exr(&folder.join("reference_stderr.exr"))?;
        let reference = MeanImage::from_image(&image, Some(&stderr))?;
        Ok(Self { name: name.into(), baked, image, reference })
    }

    /// The same scene with another reference: an EXR file with its standard error in the layer `stderr`, as the
    /// benchmark `references` saves it.
    pub fn with_reference(self, file: &Path) -> Result<Self, Box<dyn Error>> {
        let picture = Picture::read_exr(file)?;
        let stderr = picture.layer("stderr").and_then(Layer::rgb);
        let (image, stderr) = picture.main().zip(stderr).ok_or("a reference without colours or `stderr`")?;
        let stderr = Rgb::new(image.width, image.height, stderr).ok_or("a layer `stderr` without its pixels")?;
        if [image.width, image.height] != [self.image.width, self.image.height] {
            return Err("a reference of another size".into());
        }
        let reference = MeanImage::from_image(&image, Some(&stderr))?;
        Ok(Self { image, reference, ..self })
    }

    /// relMSE of an image without the worst part `outliers` of the pixels, less the share of the reference's noise in
    /// the others: what it would be against a reference without noise.
    pub fn error_beyond_noise(&self, image: &Rgb, outliers: f64) -> Result<f64, CompareError> {
        let errors = relmse_per_pixel(image, &self.image)?;
        let noise = relmse_of_per_pixel(&self.reference);
        let mut both: Vec<(f64, f64)> = errors.into_iter().zip(noise).collect();
        both.sort_by(|a, b| a.0.total_cmp(&b.0));
        both.truncate(both.len() - (both.len() as f64 * outliers) as usize);
        Ok(both.iter().map(|(e, n)| e - n).sum::<f64>() / both.len() as f64)
    }

    /// What the noise of the reference adds to every relMSE.
    pub fn reference_noise(&self) -> f64 {
        relmse_of(&self.reference)
    }
}

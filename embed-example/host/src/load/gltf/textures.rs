//! Images of an asset as textures of the scene, each variant that materials need once.

use super::super::LoadError;
use super::super::colors::linear;
use super::super::loader::Loader;
use super::asset::Asset;
use super::container;
use crate::description::{Encoding, SceneDescription, Texture, TextureRef, Wrap};
use gltf_json::extensions::texture::TextureTransform;
use gltf_json::texture::WrappingMode;
use gltf_json::validation::Checked;
use gltf_json::{Image, Index, texture};
use std::collections::HashMap;

/// What a material wants of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Use {
    /// Its numbers are linear, not sRGB-encoded.
    pub linear: bool,
    /// Alpha becomes 1 from this value on, 0 below; `None` leaves it as it is.
    pub threshold: Option<u16>,
}

impl Use {
    pub(super) const COLOR: Self = Self { linear: false, threshold: None };
    pub(super) const NUMBERS: Self = Self { linear: true, threshold: None };
}

/// A texture as a material refers to it.
#[derive(Clone)]
pub(super) struct Slot {
    pub texture: Index<gltf_json::Texture>,
    /// Set of texture coordinates.
    pub set: u32,
    transform: Option<TextureTransform>,
    /// Place in the document.
    pub at: String,
}

impl Slot {
    pub(super) fn new(info: &texture::Info, at: String) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Self::with(info.index, info.tex_coord, transform, at)
    }

    pub(super) fn with(
        texture: Index<gltf_json::Texture>,
        set: u32,
        transform: Option<TextureTransform>,
        at: String,
    ) -> Self {
        let set = transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(set);
        Self { texture, set, transform, at }
    }

    /// The map of coordinates with v upwards, where the document has v downwards. There, with the rotation r, it is
    /// u' = cos r su u + sin r sv v + ou, v' = -sin r su u + cos r sv v + ov: counter-clockwise as the image is seen
    /// (KHR_texture_transform; the signs are those of the Khronos sample viewer).
    fn matrix(&self) -> [[f32; 3]; 2] {
        let Some(t) = &self.transform else { return TextureRef::new(0).transform };
        let [[su, sv], [ou, ov]] = [t.scale.0, t.offset.0].map(|p| p.map(f64::from));
        let (sin, cos) = f64::from(t.rotation.0).sin_cos();
        let (a, b, c, d) = (cos * su, sin * sv, -sin * su, cos * sv);
        [[a, -b, b + ou], [-c, d, 1.0 - d - ov]].map(|row| row.map(|x| x as f32))
    }
}

/// Textures of the scene by image, wrapping and use.
#[derive(Default)]
pub(super) struct Textures {
    known: HashMap<(usize, [u8; 2], Use), Option<u32>>,
    means: HashMap<(usize, bool), Option<[f32; 4]>>,
}

impl Textures {
    /// The texture of a slot; `None`, with a note, if its file is missing.
    pub(super) fn reference(
        &mut self,
        loader: &mut Loader,
        scene: &mut SceneDescription,
        asset: &Asset<'_>,
        slot: &Slot,
        wanted: Use,
    ) -> Result<Option<TextureRef>, LoadError> {
        let (image, wrap) = source(asset, slot)?;
        let key = (image.value(), wrap.map(|w| w as u8), wanted);
        let index = match self.known.get(&key) {
            Some(index) => *index,
            None => {
                let decoded = decode(loader, asset, image, &slot.at)?;
                let index = decoded.map(|mut texture| {
                    texture.encoding = if wanted.linear { Encoding::Linear } else { Encoding::Srgb };
                    texture.wrap = wrap;
                    if let Some(least) = wanted.threshold {
                        texture.texels.iter_mut().for_each(|t| t[3] = if u16::from(t[3]) >= least { 255 } else { 0 });
                    }
                    loader.charge(&texture);
                    scene.textures.push(texture);
                    (scene.textures.len() - 1) as u32
                });
                self.known.insert(key, index);
                index
            }
        };
        Ok(index.map(|texture| TextureRef { texture, transform: slot.matrix() }))
    }

    /// Linear mean of all texels, where a material has a number for them only. `None` if the file is missing.
    pub(super) fn mean(
        &mut self,
        loader: &mut Loader,
        asset: &Asset<'_>,
        slot: &Slot,
        wanted: Use,
    ) -> Result<Option<[f32; 4]>, LoadError> {
        let (image, _) = source(asset, slot)?;
        let key = (image.value(), wanted.linear);
        if let Some(mean) = self.means.get(&key) {
            return Ok(*mean);
        }
        let mean = decode(loader, asset, image, &slot.at)?.map(|texture| {
            let value = |t: &[u8; 4], c: usize| match wanted.linear || c == 3 {
                true => f64::from(t[c]) / 255.0,
                false => f64::from(linear(t[c])),
            };
            let sum = |c: usize| texture.texels.iter().map(|t| value(t, c)).sum::<f64>();
            [0, 1, 2, 3].map(|c| (sum(c) / texture.texels.len().max(1) as f64) as f32)
        });
        self.means.insert(key, mean);
        Ok(mean)
    }
}

/// Image and wrapping of a slot's texture.
fn source(asset: &Asset<'_>, slot: &Slot) -> Result<(Index<Image>, [Wrap; 2]), LoadError> {
    let texture = asset.get(&asset.root.textures, slot.texture, &slot.at, "textures")?;
    let at = format!("textures[{}]", slot.texture.value());
    // what the types have for a texture without an image
    if texture.source.value() == u32::MAX as usize {
        let extension = texture.extensions.as_ref().and_then(|e| e.others.keys().next());
        let what = match extension {
            Some(name) => {
                format!("its image is of the extension {name}, which is not supported, and there is no other")
            }
            None => "it has no image".into(),
        };
        return Err(asset.error(at, what));
    }
    asset.get(&asset.root.images, texture.source, &at, "images")?;
    let wrap = match texture.sampler {
        None => [Wrap::Repeat; 2],
        Some(sampler) => {
            let sampler = asset.get(&asset.root.samplers, sampler, &at, "samplers")?;
            let wrap = |mode: Checked<WrappingMode>| match mode {
                Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
                Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
                Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
                Checked::Invalid => Err(asset.error(&at, "its sampler wraps in a way that glTF does not have")),
            };
            [wrap(sampler.wrap_s)?, wrap(sampler.wrap_t)?]
        }
    };
    Ok((texture.source, wrap))
}

/// An image, decoded; `None`, with a note, if its file is missing.
fn decode(loader: &mut Loader, asset: &Asset<'_>, index: Index<Image>, at: &str) -> Result<Option<Texture>, LoadError> {
    let image = asset.get(&asset.root.images, index, at, "images")?;
    let at = format!("images[{}]", index.value());
    let (name, read) = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => {
            let name = if uri.starts_with("data:") { at.clone() } else { uri.clone() };
            (name, container::read(loader, asset.path, uri, &format!("{at}.uri")))
        }
        (None, Some(view)) => (at.clone(), asset.view(view, &at).map(|(bytes, _)| bytes.to_vec())),
        (None, None) => return Err(asset.error(at, "neither a URI nor a buffer view")),
    };
    let bytes = match read {
        Err(e) if e.is_missing() => {
            loader.replace(e, "materials are without it")?;
            return Ok(None);
        }
        read => read?,
    };
    let image = loader.decode(&bytes).map_err(|what| asset.error(&at, what))?;
    if let Some(what) = image.ignored {
        loader.replace(asset.error(&at, what), "the picture was taken without that")?;
    }
    Ok(Some(Texture { name, ..image.texture }))
}

//! Materials of an asset as principled materials.
//!
//! | glTF | here |
//! |---|---|
//! | metallic-roughness: base colour, metalness, roughness, their textures | the same |
//! | normal texture | the same; tangents follow from texture coordinates, `TANGENT` is ignored |
//! | occlusion texture | ignored: light transport finds what it approximates |
//! | emission, `KHR_materials_emissive_strength` | radiance of the front side |
//! | `alphaMode` MASK | alpha is 0 or 1 by the cutoff, before interpolation |
//! | `alphaMode` BLEND | alpha is the share of light that meets the surface |
//! | `doubleSided` false | both sides scatter alike unless the material emits: then its back is black |
//! | `KHR_materials_transmission` | transmission of a thin sheet |
//! | with `KHR_materials_volume` of a thickness above 0 | of a solid, whose boundary must be closed; attenuation is a medium. The thickness itself and its texture are ignored: the geometry is there |
//! | `KHR_materials_ior`, `_specular`, `_clearcoat`, `_sheen` | the same; of textures that the principled material has no place for (specular, sheen, roughness of the coat) the mean is taken |
//! | `KHR_materials_pbrSpecularGlossiness` | dielectric of the specular colour; of its texture the mean is taken |
//! | `KHR_materials_unlit` | diffuse |
//! | `COLOR_0` | multiplies base colour and alpha if it is constant, or if the material has no textures |

use super::super::loader::Loader;
use super::super::{LoadError, mtl};
use super::asset::Asset;
use super::textures::{Slot, Textures, Use};
use crate::description::{Material, Model, Principled, SceneDescription, TextureRef};
use crate::text::excerpt;
use gltf_json::extensions::material::PbrSpecularGlossiness;
use gltf_json::extensions::texture::TextureTransform;
use gltf_json::material::{AlphaMode, PbrMetallicRoughness};
use gltf_json::validation::Checked;
use gltf_json::{Index, texture};
use serde::Deserialize;
use std::collections::HashMap;

/// `KHR_materials_clearcoat`.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<texture::Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<texture::Info>,
    clearcoat_normal_texture: Option<gltf_json::Value>,
}

/// `KHR_materials_sheen`.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Sheen {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<texture::Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<texture::Info>,
}

/// A material of the scene, and what geometry has to know of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loaded {
    /// Index in the scene.
    pub index: u32,
    /// Set of texture coordinates that its textures use; `None` without textures.
    pub set: Option<u32>,
    /// What alpha of vertices means.
    pub alpha: Alpha,
    /// Absorption coefficient of the solid that it bounds.
    pub sigma_a: Option<[f32; 3]>,
}

/// Meaning of alpha.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Alpha {
    /// None.
    #[default]
    Ignored,
    /// Share of light that meets the surface.
    Share,
    /// All light meets the surface where alpha times `factor` is `cutoff` or more, else none.
    Mask { factor: f32, cutoff: f32 },
}

impl Alpha {
    /// Alpha of a texture for that of a vertex.
    pub(super) fn of_texel(self, a: f32) -> f32 {
        match self {
            Self::Ignored => 1.0,
            Self::Share => unit(a),
            Self::Mask { factor, cutoff } => f32::from(u8::from(unit(a) * factor >= cutoff)),
        }
    }
}

/// A solid that light enters.
pub(super) struct Volume {
    /// Material of the scene.
    pub material: u32,
    /// Absorption coefficient.
    pub sigma_a: [f32; 3],
}

/// Materials of the scene by their index and the factor of their base colour.
#[derive(Default)]
pub(super) struct Materials {
    known: HashMap<(Option<usize>, [u32; 4]), Loaded>,
    textures: Textures,
    pub volumes: Vec<Volume>,
}

/// One material while it is read.
struct Reading<'r, 'l, 'a, 'b> {
    textures: &'r mut Textures,
    loader: &'l mut Loader,
    scene: &'r mut SceneDescription,
    asset: &'a Asset<'b>,
    at: String,
    /// Set of texture coordinates of the textures so far.
    set: Option<u32>,
    alpha: Alpha,
}

impl Materials {
    /// The material with a factor on its base colour and alpha, read at its first use. `at` names who wants it.
    pub(super) fn load(
        &mut self,
        loader: &mut Loader,
        scene: &mut SceneDescription,
        asset: &Asset<'_>,
        material: Option<Index<gltf_json::Material>>,
        factor: [f32; 4],
        at: &str,
    ) -> Result<Loaded, LoadError> {
        let key = (material.map(|m| m.value()), factor.map(f32::to_bits));
        if let Some(loaded) = self.known.get(&key) {
            return Ok(*loaded);
        }
        let index = scene.materials.len() as u32;
        let mut loaded = Loaded { index, set: None, alpha: Alpha::Ignored, sigma_a: None };
        match material {
            None => {
                if self.known.keys().all(|(m, _)| m.is_some()) {
                    loader.note("what has no material is grey".into());
                }
                let base = crate::description::Reflectance::Constant([0, 1, 2].map(|c| 0.5 * unit(factor[c])));
                let model = if factor == [1.0; 4] { mtl::GREY } else { Model::Diffuse { reflectance: base } };
                scene.add_material("default", model);
            }
            Some(i) => {
                let m = asset.get(&asset.root.materials, i, at, "materials")?;
                let at = format!("materials[{}]", i.value());
                // an excerpt: each factor makes a material of that name
                let name = excerpt(m.name.as_ref().unwrap_or(&at)).into_owned();
                let (textures, alpha) = (&mut self.textures, Alpha::Ignored);
                let mut reading = Reading { textures, loader, scene, asset, at, set: None, alpha };
                let (material, sigma_a) = reading.material(m, name, factor)?;
                loaded = Loaded { set: reading.set, alpha: reading.alpha, sigma_a, ..loaded };
                scene.materials.push(material);
                self.volumes.extend(sigma_a.map(|sigma_a| Volume { material: index, sigma_a }));
            }
        }
        self.known.insert(key, loaded);
        Ok(loaded)
    }
}

/// A factor from 0 to 1; what is no number is 1.
fn unit(x: f32) -> f32 {
    if x.is_nan() { 1.0 } else { x.clamp(0.0, 1.0) }
}

impl Reading<'_, '_, '_, '_> {
    fn note(&mut self, what: &str) {
        self.loader.note(format!("{}: {what}", self.at));
    }

    fn slot(&self, info: &texture::Info, name: &str) -> Slot {
        Slot::new(info, format!("{}.{name}", self.at))
    }

    /// A texture, unless its coordinates are of another set than those of the textures before.
    fn texture(&mut self, slot: Option<Slot>, wanted: Use) -> Result<Option<TextureRef>, LoadError> {
        let Some(slot) = slot else { return Ok(None) };
        if self.set.is_some_and(|set| set != slot.set) {
            let at = slot.at;
            self.loader.note(format!("{at}: ignored, its texture coordinates are not those of the material's others"));
            return Ok(None);
        }
        let found = self.textures.reference(self.loader, self.scene, self.asset, &slot, wanted)?;
        if found.is_some() {
            self.set = Some(slot.set);
        }
        Ok(found)
    }

    /// The mean of a texture, 1 without one.
    fn mean(&mut self, info: &Option<texture::Info>, name: &str, wanted: Use) -> Result<[f32; 4], LoadError> {
        let Some(info) = info else { return Ok([1.0; 4]) };
        let slot = self.slot(info, name);
        let mean = self.textures.mean(self.loader, self.asset, &slot, wanted)?;
        self.loader.note(format!("{}: its mean was taken", slot.at));
        Ok(mean.unwrap_or([1.0; 4]))
    }

    /// The material, and the absorption of the solid that it bounds.
    fn material(
        &mut self,
        m: &gltf_json::Material,
        name: String,
        factor: [f32; 4],
    ) -> Result<(Material, Option<[f32; 3]>), LoadError> {
        let Checked::Valid(mode) = m.alpha_mode else {
            return Err(self.asset.error(format!("{}.alphaMode", self.at), "neither OPAQUE nor MASK nor BLEND"));
        };
        let cutoff = unit(m.alpha_cutoff.map_or(0.5, |c| c.0));
        let none = Default::default();
        let extensions = m.extensions.as_ref().unwrap_or(&none);
        let mut p = Principled::default();
        let alpha = match &extensions.pbr_specular_glossiness {
            Some(old) => self.specular_glossiness(old, mode, cutoff, factor, &mut p)?,
            None => self.metallic_roughness(&m.pbr_metallic_roughness, mode, cutoff, factor, &mut p)?,
        };
        self.alpha = match mode {
            AlphaMode::Opaque => Alpha::Ignored,
            AlphaMode::Blend => Alpha::Share,
            AlphaMode::Mask => Alpha::Mask { factor: alpha, cutoff },
        };
        p.opacity = match mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Blend => alpha,
            // with a texture, its alpha was compared
            AlphaMode::Mask if p.base_texture.is_some() || alpha >= cutoff => 1.0,
            AlphaMode::Mask => 0.0,
        };
        if let Some(normal) = &m.normal_texture {
            let others = normal.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
            let slot = format!("{}.normalTexture", self.at);
            let transform: Option<TextureTransform> = self.extension(others, &slot)?;
            let slot = Slot::with(normal.index, normal.tex_coord, transform, slot);
            p.normal_texture = self.texture(Some(slot), Use::NUMBERS)?;
            p.normal_scale = if normal.scale.is_finite() { normal.scale } else { 1.0 };
        }
        let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0.max(0.0));
        p.emission = m.emissive_factor.0.map(|x| unit(x) * strength);
        if p.emission != [0.0; 3] {
            let slot = m.emissive_texture.as_ref().map(|info| self.slot(info, "emissiveTexture"));
            p.emission_texture = self.texture(slot, Use::COLOR)?;
        }
        if let Some(ior) = &extensions.ior {
            // 0 stands for a dielectric that reflects everything at grazing angles and its colour elsewhere
            p.ior = if ior.ior.0 >= 1.0 { ior.ior.0.min(10.0) } else { 1.5 };
            if ior.ior.0 < 1.0 {
                self.note(&format!("a refractive index of {} was taken as 1.5", ior.ior.0));
            }
        }
        if let Some(specular) = &extensions.specular {
            let strength = self.mean(&specular.specular_texture, "specularTexture", Use::NUMBERS)?[3];
            let color = self.mean(&specular.specular_color_texture, "specularColorTexture", Use::COLOR)?;
            p.specular = unit(specular.specular_factor.0) * strength;
            p.specular_color = [0, 1, 2].map(|c| specular.specular_color_factor.0[c].max(0.0) * color[c]);
        }
        let mut sigma_a = None;
        if let Some(transmission) = &extensions.transmission {
            p.transmission = unit(transmission.transmission_factor.0);
            if p.transmission > 0.0 {
                let info = transmission.transmission_texture.as_ref();
                let slot = info.map(|info| self.slot(info, "transmissionTexture"));
                p.transmission_texture = self.texture(slot, Use::NUMBERS)?;
                p.thin_walled = true;
            }
        }
        if let Some(volume) = &extensions.volume
            && p.transmission > 0.0
            && volume.thickness_factor.0 > 0.0
        {
            p.thin_walled = false;
            let distance = volume.attenuation_distance.0;
            let absorbs = distance.is_finite() && distance > 0.0;
            sigma_a = Some(volume.attenuation_color.0.map(|x| match absorbs {
                // Black attenuates to a millionth, as infinity is no coefficient.
                true => -f64::from(unit(x).max(1e-6)).ln() as f32 / distance,
                false => 0.0,
            }));
        }
        self.layers(&extensions.others, &mut p)?;
        if extensions.unlit.is_some() {
            self.note("unlit materials are diffuse here");
            (p.metalness, p.roughness, p.specular, p.metal_rough_texture) = (0.0, 1.0, 0.0, None);
        }
        let emits = p.emission != [0.0; 3];
        let two_sided = p.transmission == 0.0 && (m.double_sided || !emits);
        let material = Material {
            two_sided,
            cutout: mode != AlphaMode::Opaque,
            compensated: true,
            ..Material::new(&name, Model::Principled(p))
        };
        Ok((material, sigma_a))
    }

    /// Base colour and texture; returns the alpha that multiplies the texture's.
    fn base(
        &mut self,
        rgba: [f32; 4],
        slot: Option<Slot>,
        mode: AlphaMode,
        cutoff: f32,
        p: &mut Principled,
    ) -> Result<f32, LoadError> {
        let alpha = unit(rgba[3]);
        let threshold = match mode {
            // the least of 255 that passes; 256 is none
            AlphaMode::Mask => Some((0..=255u16).find(|a| f32::from(*a) / 255.0 * alpha >= cutoff).unwrap_or(256)),
            AlphaMode::Opaque | AlphaMode::Blend => None,
        };
        p.base_color = [0, 1, 2].map(|c| unit(rgba[c]));
        p.base_texture = self.texture(slot, Use { threshold, ..Use::COLOR })?;
        Ok(alpha)
    }

    fn metallic_roughness(
        &mut self,
        from: &PbrMetallicRoughness,
        mode: AlphaMode,
        cutoff: f32,
        factor: [f32; 4],
        p: &mut Principled,
    ) -> Result<f32, LoadError> {
        let slot = from.base_color_texture.as_ref().map(|i| self.slot(i, "pbrMetallicRoughness.baseColorTexture"));
        let rgba = std::array::from_fn(|c| unit(from.base_color_factor.0[c]) * unit(factor[c]));
        let alpha = self.base(rgba, slot, mode, cutoff, p)?;
        (p.metalness, p.roughness) = (unit(from.metallic_factor.0), unit(from.roughness_factor.0));
        let info = from.metallic_roughness_texture.as_ref();
        let slot = info.map(|i| self.slot(i, "pbrMetallicRoughness.metallicRoughnessTexture"));
        p.metal_rough_texture = self.texture(slot, Use::NUMBERS)?;
        Ok(alpha)
    }

    fn specular_glossiness(
        &mut self,
        from: &PbrSpecularGlossiness,
        mode: AlphaMode,
        cutoff: f32,
        factor: [f32; 4],
        p: &mut Principled,
    ) -> Result<f32, LoadError> {
        let slot = from.diffuse_texture.as_ref().map(|i| self.slot(i, "diffuseTexture"));
        let rgba = std::array::from_fn(|c| unit(from.diffuse_factor.0[c]) * unit(factor[c]));
        let alpha = self.base(rgba, slot, mode, cutoff, p)?;
        let mean = self.mean(&from.specular_glossiness_texture, "specularGlossinessTexture", Use::COLOR)?;
        p.roughness = 1.0 - unit(from.glossiness_factor.0) * mean[3];
        // A refractive index of 1.5 reflects 4 %.
        p.specular_color = [0, 1, 2].map(|c| unit(from.specular_factor.0[c]) * mean[c] / 0.04);
        Ok(alpha)
    }

    /// Extensions that the types do not know: coat and sheen.
    fn layers(
        &mut self,
        others: &serde_json::Map<String, serde_json::Value>,
        p: &mut Principled,
    ) -> Result<(), LoadError> {
        let coat: Option<Clearcoat> = self.extension(others.get("KHR_materials_clearcoat"), &self.at)?;
        if let Some(coat) = coat {
            p.coat = unit(coat.clearcoat_factor);
            if p.coat > 0.0 {
                let slot = coat.clearcoat_texture.as_ref().map(|i| self.slot(i, "clearcoatTexture"));
                p.coat_texture = self.texture(slot, Use::NUMBERS)?;
                let name = "clearcoatRoughnessTexture";
                let roughness = self.mean(&coat.clearcoat_roughness_texture, name, Use::NUMBERS)?[1];
                p.coat_roughness = unit(coat.clearcoat_roughness_factor) * roughness;
                if coat.clearcoat_normal_texture.is_some() {
                    self.note("the coat's normal texture was ignored");
                }
            }
        }
        let sheen: Option<Sheen> = self.extension(others.get("KHR_materials_sheen"), &self.at)?;
        if let Some(sheen) = sheen {
            let color = self.mean(&sheen.sheen_color_texture, "sheenColorTexture", Use::COLOR)?;
            let roughness = self.mean(&sheen.sheen_roughness_texture, "sheenRoughnessTexture", Use::NUMBERS)?[3];
            p.sheen_color = [0, 1, 2].map(|c| unit(sheen.sheen_color_factor[c]) * color[c]);
            p.sheen_roughness = unit(sheen.sheen_roughness_factor) * roughness;
        }
        Ok(())
    }

    fn extension<T: for<'de> Deserialize<'de>>(
        &self,
        value: Option<&serde_json::Value>,
        at: &str,
    ) -> Result<Option<T>, LoadError> {
        let parsed = value.map(T::deserialize).transpose();
        parsed.map_err(|e| self.asset.error(format!("{at}.extensions"), e.to_string()))
    }
}

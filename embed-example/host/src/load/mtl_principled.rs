//! MTL materials with keys of the extension for physically based rendering, mapped to the principled material: those with
//! `Ps`, `Pc`, `Pcr`, `norm`, `map_Pr`, `map_Pm` or `map_Ke`.
//!
//! | key | field |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour; the texture replaces `Kd` |
//! | `Pr`, `map_Pr`, else `Ns` | roughness; the texture replaces the number |
//! | `Pm`, `map_Pm` | metalness, likewise |
//! | `Ps` | sheen, white, of roughness 0.5 |
//! | `Pc`, `Pcr` | coat and its roughness |
//! | `Ni` | index |
//! | `norm` | normal map |
//! | `Ke`, `map_Ke` | emission; the texture multiplies `Ke`, 1 if that is black or not stated |
//! | opacity below 0.5, or `illum` 4, 6, 7 or 9 | transmission 1; thin-walled with `Ni` 1 |
//! | `d`, `Tr` from 0.5 | opacity |
//! | `map_d` | alpha of the base colour's texture, in place of the two rows above |
//!
//! `aniso` and `anisor` are ignored.

use super::budget::fits;
use super::loader::Loader;
use super::mtl::{Definition, nearest};
use crate::description::{Encoding, Material, Model, Principled, SceneDescription, Texture, TextureRef};

/// Textures of a definition, by their key: indices in the scene.
#[derive(Clone, Copy, Default)]
pub(super) struct Maps {
    pub base: Option<u32>,
    pub roughness: Option<u32>,
    pub metalness: Option<u32>,
    /// Of roughness and metalness, by [`combine`].
    pub combined: Option<u32>,
    pub emission: Option<u32>,
    pub normal: Option<u32>,
    /// The alpha of `base` is the opacity.
    pub cut_out: bool,
}

/// Numbers that make a material a principled one, as textures of any of [`MAPS`](super::mtl::MAPS) do.
const NUMBERS: [&str; 3] = ["Ps", "Pc", "Pcr"];

/// Is the definition mapped here?
pub(super) fn applies(definition: &Definition) -> bool {
    let parameters = &definition.material.unknown_param;
    !definition.maps.is_empty() || NUMBERS.iter().any(|key| parameters.contains_key(*key))
}

/// Index of the texture with the roughness in green and the metalness in blue, each the red of its own or 1. Made at the
/// first use of the pair; the error is a text.
pub(super) fn combine(loader: &mut Loader, scene: &mut SceneDescription, maps: &Maps) -> Result<Option<u32>, String> {
    let key = [maps.roughness, maps.metalness];
    if let Some(index) = loader.combined.get(&key) {
        return Ok(Some(*index));
    }
    let [rough, metal] = key.map(|i| i.and_then(|i| scene.textures.get(i as usize)));
    let larger = [rough, metal].into_iter().flatten().max_by_key(|t| u64::from(t.width) * u64::from(t.height));
    let Some(larger) = larger else { return Ok(None) };
    let [width, height] = [larger.width, larger.height];
    fits(width.into(), height.into(), 4, loader.free())?;
    let red =
        |t: Option<&Texture>, x: u32, y: u32| t.map_or(255, |t| nearest(t, x, y, width, height).map_or(255, |t| t[0]));
    let texel = |i: u32| [255, red(rough, i % width, i / width), red(metal, i % width, i / width), 255];
    let texture = Texture {
        name: larger.name.clone(),
        width,
        height,
        texels: (0..width * height).map(texel).collect(),
        encoding: Encoding::Linear,
        ..Texture::default()
    };
    loader.charge(&texture);
    let index = scene.textures.len() as u32;
    scene.textures.push(texture);
    loader.combined.insert(key, index);
    Ok(Some(index))
}

/// The mapping of the table above, and the radiance of its emitter.
pub(super) fn map(definition: &Definition, maps: Maps) -> (Material, Option<[f32; 3]>) {
    let m = &definition.material;
    let parameter = |key: &str| m.unknown_param.get(key).and_then(|v| v.parse::<f32>().ok());
    let share = |x: f32| x.clamp(0.0, 1.0);
    let texture = |index: Option<u32>| index.map(TextureRef::new);
    let from_ns = m.shininess.map(|n| (2.0 / (n.max(0.0) + 2.0)).sqrt().sqrt());
    let opacity = m.dissolve.or(parameter("Tr").map(|t| 1.0 - t)).unwrap_or(1.0);
    let clear = !maps.cut_out && (matches!(m.illumination_model, Some(4 | 6 | 7 | 9)) || opacity < 0.5);
    let thin = m.optical_density.is_some_and(|n| (n - 1.0).abs() <= 1e-3);
    let default = Principled::default();
    let given = m.emissive.filter(|c| c.iter().any(|x| *x > 1e-3)).map(|c| c.map(|x| x.max(0.0)));
    let radiance = given.or(maps.emission.map(|_| [1.0; 3]));
    let p = Principled {
        base_color: if maps.base.is_some() { [1.0; 3] } else { m.diffuse.unwrap_or([0.5; 3]).map(share) },
        base_texture: texture(maps.base),
        metalness: if maps.metalness.is_some() { 1.0 } else { share(parameter("Pm").unwrap_or(0.0)) },
        roughness: if maps.roughness.is_some() { 1.0 } else { share(parameter("Pr").or(from_ns).unwrap_or(0.5)) },
        metal_rough_texture: texture(maps.combined),
        ior: m.optical_density.filter(|n| *n > 0.1 && (n - 1.0).abs() > 1e-3).map_or(default.ior, |n| n.min(10.0)),
        transmission: if clear { 1.0 } else { 0.0 },
        thin_walled: clear && thin,
        coat: share(parameter("Pc").unwrap_or(0.0)),
        coat_roughness: share(parameter("Pcr").unwrap_or(0.0)),
        sheen_color: [share(parameter("Ps").unwrap_or(0.0)); 3],
        sheen_roughness: 0.5,
        emission_texture: texture(maps.emission),
        normal_texture: texture(maps.normal),
        opacity: if clear || maps.cut_out { 1.0 } else { share(opacity) },
        ..default
    };
    (Material { cutout: maps.cut_out, ..Material::new(&m.name, Model::Principled(p)) }, radiance)
}

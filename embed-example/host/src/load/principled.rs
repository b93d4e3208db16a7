//! Principled materials of a `scene.json`: keys named as the fields of [`Principled`], each with its default.
//!
//! A texture is the name of its file, or an object: `file`; `transform`, two rows of three numbers that map (u, v, 1) to
//! the texture's coordinates; `wrap`, `repeat`, `clamp` or `mirror`, or two of them for u and v; of the base texture
//! `alpha`, `cutout` or `ignore`. Base and emission are sRGB-encoded, the others numbers.

use super::LoadError;
use super::json::Place;
use super::loader::{Decoding, Loader};
use crate::description::{Encoding, Principled, SceneDescription, TextureRef, Wrap};
use std::path::Path;

/// Keys of any material.
const COMMON: [&str; 5] = ["type", "twosided", "compensate", "interior", "interior_scale"];

fn number(m: &Place<'_>, key: &str, into: &mut f32) -> Result<(), LoadError> {
    m.find(key)?.map_or(Ok(()), |place| place.float().map(|x| *into = x))
}

/// A colour, or one number for all channels.
fn colour(m: &Place<'_>, key: &str, into: &mut [f32; 3]) -> Result<(), LoadError> {
    let Some(place) = m.find(key)? else { return Ok(()) };
    *into = if place.is_number() { [place.float()?; 3] } else { place.rgb()? };
    Ok(())
}

fn wrap(place: &Place<'_>) -> Result<Wrap, LoadError> {
    match place.text()? {
        "repeat" => Ok(Wrap::Repeat),
        "clamp" => Ok(Wrap::Clamp),
        "mirror" => Ok(Wrap::Mirror),
        other => Err(place.error(format!("`{other}` is not supported, only `repeat`, `clamp` and `mirror`"))),
    }
}

/// Reads a principled material.
pub(super) fn read(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    folder: &Path,
    m: &Place<'_>,
) -> Result<Principled, LoadError> {
    let mut p = Principled::default();
    let mut known: Vec<&str> = COMMON.to_vec();
    for (key, into) in [
        ("metalness", &mut p.metalness),
        ("roughness", &mut p.roughness),
        ("ior", &mut p.ior),
        ("specular", &mut p.specular),
        ("transmission", &mut p.transmission),
        ("coat", &mut p.coat),
        ("coat_roughness", &mut p.coat_roughness),
        ("sheen_roughness", &mut p.sheen_roughness),
        ("normal_scale", &mut p.normal_scale),
        ("opacity", &mut p.opacity),
    ] {
        number(m, key, into)?;
        known.push(key);
    }
    for (key, into) in [
        ("base_color", &mut p.base_color),
        ("specular_color", &mut p.specular_color),
        ("sheen_color", &mut p.sheen_color),
        ("emission", &mut p.emission),
    ] {
        colour(m, key, into)?;
        known.push(key);
    }
    for (key, encoding, into) in [
        ("base_texture", Encoding::Srgb, &mut p.base_texture),
        ("emission_texture", Encoding::Srgb, &mut p.emission_texture),
        ("metal_rough_texture", Encoding::Linear, &mut p.metal_rough_texture),
        ("transmission_texture", Encoding::Linear, &mut p.transmission_texture),
        ("coat_texture", Encoding::Linear, &mut p.coat_texture),
        ("normal_texture", Encoding::Linear, &mut p.normal_texture),
    ] {
        if let Some(place) = m.find(key)? {
            *into = Some(texture(loader, scene, folder, &place, encoding)?);
        }
        known.push(key);
    }
    if let Some(place) = m.find("thin_walled")? {
        p.thin_walled = place.flag()?;
    }
    known.push("thin_walled");
    match m.entries()?.find(|(key, _)| !known.contains(key)) {
        Some((key, place)) => Err(place.error(format!("a principled material has no `{key}`"))),
        None => Ok(p),
    }
}

fn texture(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    folder: &Path,
    t: &Place<'_>,
    encoding: Encoding,
) -> Result<TextureRef, LoadError> {
    let mut decoding = Decoding { encoding, wrap: [Wrap::Repeat; 2] };
    if !t.is_object() {
        let index = loader.texture_as(scene, &folder.join(t.text()?), &t.referrer(), decoding)?;
        return Ok(TextureRef::new(index));
    }
    if let Some(place) = t.find("wrap")? {
        decoding.wrap = match place.elements() {
            Ok(both) => match both.as_slice() {
                [u, v] => [wrap(u)?, wrap(v)?],
                _ => return Err(place.error("expected one or two of `repeat`, `clamp` and `mirror`")),
            },
            Err(_) => [wrap(&place)?; 2],
        };
    }
    let file = t.get("file")?;
    let index = loader.texture_as(scene, &folder.join(file.text()?), &file.referrer(), decoding)?;
    let mut reference = TextureRef::new(index);
    if let Some(place) = t.find("transform")? {
        match place.elements()?.as_slice() {
            [u, v] => reference.transform = [u.rgb()?, v.rgb()?],
            _ => return Err(place.error("expected two rows of three numbers")),
        }
    }
    Ok(reference)
}

//! MTL materials of a bare OBJ, through `tobj`, mapped to the models of this renderer.
//!
//! Materials with more keys of the extension for physically based rendering are mapped in `mtl_principled.rs`. Of the
//! others the first row that fits decides:
//!
//! | if | model |
//! |---|---|
//! | `illum` 4, 6, 7 or 9, or opacity (`d`, or 1 - `Tr`) below 0.5 | dielectric of index `Ni`, 1.5 if not stated; rough with `Pr`. `Ni` 1 (many exporters' default): a thin sheet of index 1.5 |
//! | metalness `Pm` from 0.5 | metal of reflectance `Kd` (or its texture) |
//! | `Ks` not black, `Kd` black or not stated, no texture | metal of reflectance `Ks` |
//! | `illum` 0 or 1 without `Pr` | diffuse, `Kd` |
//! | `Pr` below 1, or `Ks` not black, or `Ks` not stated and `Ni` above 1 | plastic of index `Ni` (1.5 if not stated or 1), `Kd`; rough |
//! | else | diffuse, `Kd` (0.5 if not stated) |
//!
//! The GGX width is `Pr` squared, else sqrt(2 / (`Ns` + 2)) (Walter et al. 2007, section 5.2), else 0; below 1e-3 the
//! smooth model is taken. Metals have no Fresnel term (eta 0, k 1): MTL states what they look like, not what they are
//! made of. `map_Kd` replaces `Kd`. Reflectances are limited to 1. `Ke` is the radiance of an area light. `map_d` cuts
//! holes, in place of `d` and `Tr` and of glass: its alpha, or its red if it has none, is the share of light that meets the
//! surface. Opacity from 0.5 and all other parameters are ignored, other textures with a note. All materials are compensated for what single scattering loses.

use super::LoadError;
use super::budget::fits;
use super::loader::Loader;
use crate::description::{Material, Model, Reflectance, SceneDescription, Texture};
use crate::text::{excerpt, number};
use crate::tonemap::srgb;
use std::path::{Path, PathBuf};

/// Model of faces without a material.
pub(super) const GREY: Model = Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) };

/// Keys of textures besides `map_Kd`, which ask for the principled material (`mtl_principled.rs`).
pub(super) const MAPS: [&str; 4] = ["map_Pr", "map_Pm", "map_Ke", "norm"];

/// Keys of textures, in lower case, that nothing is made of.
const IGNORED: [&str; 9] = ["bump", "map_bump", "disp", "map_disp", "decal", "map_ks", "map_ns", "map_ps", "refl"];

/// Name of a definition that has none; no face can name it.
const UNNAMED: &str = "(unnamed)";

/// Widths below this are taken as smooth.
const SMOOTH: f32 = 1e-3;

/// One `newmtl`.
pub(super) struct Definition {
    pub material: tobj::Material,
    /// File of `map_Kd`, without its options, and the line that names it.
    pub texture: Option<(String, u32)>,
    /// File of `map_d`, likewise.
    pub opacity: Option<(String, u32)>,
    /// Key, file and line of the other textures ([`MAPS`]).
    pub maps: Vec<(String, String, u32)>,
}

/// Material and emission of a definition.
pub(super) struct Mapped {
    pub material: Material,
    pub radiance: Option<[f32; 3]>,
    pub notes: Vec<String>,
}

/// Parses a library. Each line is checked first: `tobj` does not say which one it refuses, and panics at a colour of
/// fewer than three numbers. A value that cannot be read is ignored with a note, unless the options are strict; for `Kd`
/// that is grey.
pub(super) fn parse(loader: &mut Loader, path: &Path, text: &str) -> Result<Vec<Definition>, LoadError> {
    let mut plain = String::with_capacity(text.len() + 16);
    // of each definition: the line of its texture
    let mut texture_lines = Vec::new();
    let mut maps: Vec<Vec<(String, String, u32)>> = Vec::new();
    let mut opacities = Vec::new();
    // key, first line and number of lines
    let mut ignored: Vec<(String, u32, u32)> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        if let Err(what) = check(line.trim(), &mut plain) {
            let error = LoadError::line(path, number, what);
            match line.split_whitespace().next() {
                Some("newmtl") => {
                    loader.replace(error, "no face has its material")?;
                    plain.push_str("newmtl ");
                    plain.push_str(UNNAMED);
                }
                Some("Kd") => {
                    loader.replace(error, "grey was taken")?;
                    plain.push_str("Kd 0.5 0.5 0.5");
                }
                _ => loader.replace(error, "the line was ignored")?,
            }
        }
        plain.push('\n');
        match line.split_whitespace().next() {
            Some("newmtl") => {
                texture_lines.push(0);
                maps.push(Vec::new());
                opacities.push(None);
            }
            Some(key) if MAPS.contains(&key) || key == "map_d" => {
                let file = without_options(&line.trim()[key.len()..]);
                if file.is_empty() {
                    return Err(LoadError::line(path, number, format!("`{key}` needs a file")));
                }
                match (key, maps.last_mut(), opacities.last_mut()) {
                    ("map_d", _, Some(opacity)) => *opacity = Some((file, number)),
                    (_, Some(maps), _) => maps.push((key.into(), file, number)),
                    _ => {}
                }
            }
            Some(key) if IGNORED.contains(&key.to_ascii_lowercase().as_str()) => {
                match ignored.iter_mut().find(|(k, ..)| k == key) {
                    Some((_, _, count)) => *count += 1,
                    None => ignored.push((key.into(), number, 1)),
                }
            }
            Some("map_Kd") => texture_lines.iter_mut().next_back().into_iter().for_each(|l| *l = number),
            _ => {}
        }
    }
    for (key, line, count) in ignored {
        loader.note(format!("{}:{line}: `{key}` is ignored; lines of that kind: {count}", crate::text::path(path)));
    }
    let (materials, _) = tobj::load_mtl_buf(&mut plain.as_bytes())
        .map_err(|e| LoadError::Format { path: path.into(), what: format!("refused by the MTL parser: {e}") })?;
    let define = |(((material, line), maps), opacity): (((tobj::Material, u32), _), _)| {
        let texture = material.diffuse_texture.as_deref().map(|t| (without_options(t), line));
        Definition { material, texture, opacity, maps }
    };
    Ok(materials.into_iter().zip(texture_lines).zip(maps).zip(opacities).map(define).collect())
}

/// Writes the line in the form that `tobj` takes; lines of no use here become empty.
fn check(line: &str, out: &mut String) -> Result<(), String> {
    let (keyword, rest) = line.split_once(char::is_whitespace).map_or((line, ""), |(k, r)| (k, r.trim()));
    let number = |word: &str| match word.parse::<f32>() {
        Ok(x) if x.is_finite() => Ok(()),
        _ => Err(format!("`{}` is not a finite number", excerpt(word))),
    };
    let mut words: Vec<&str> = rest.split_whitespace().collect();
    match keyword {
        "newmtl" if rest.is_empty() => return Err("`newmtl` needs a name".into()),
        "newmtl" => {}
        "Kd" | "Ks" | "Ke" => {
            words.truncate(3);
            words.iter().try_for_each(|w| number(w))?;
            match *words.as_slice() {
                // One number is a grey.
                [y] => words = vec![y; 3],
                [_, _, _] => {}
                _ => return Err(format!("`{keyword}` needs 1 or 3 numbers")),
            }
        }
        "Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm" | "Ps" | "Pc" | "Pcr" => {
            let word = words.iter().find(|w| **w != "-halo").copied().unwrap_or("");
            number(word)?;
            words = vec![word];
        }
        "illum" => {
            let word = words.first().copied().unwrap_or("");
            word.parse::<u8>().map_err(|_| format!("`{}` is not an illumination model", excerpt(word)))?;
            words.truncate(1);
        }
        "map_Kd" if rest.is_empty() => return Err("`map_Kd` needs a file".into()),
        "map_Kd" => {}
        _ => return Ok(()),
    }
    out.push_str(keyword);
    out.push(' ');
    if matches!(keyword, "newmtl" | "map_Kd") {
        out.push_str(rest)
    } else {
        out.push_str(&words.join(" "))
    }
    Ok(())
}

/// The file name behind options such as `-s 2 2 1` or `-clamp on`.
fn without_options(value: &str) -> String {
    let mut rest = value.trim();
    while let Some(option) = rest.split_whitespace().next().filter(|w| w.starts_with('-')) {
        rest = rest[option.len()..].trim_start();
        let takes_word = matches!(option, "-imfchan" | "-type" | "-blendu" | "-blendv" | "-cc" | "-clamp");
        let mut first = true;
        while let Some((word, after)) = rest.split_once(char::is_whitespace) {
            if !(word.parse::<f32>().is_ok() || (first && takes_word)) {
                break;
            }
            (rest, first) = (after.trim_start(), false);
        }
    }
    rest.into()
}

/// A file beside `file`; backslashes separate folders if no file has them in its name.
pub(super) fn sibling(file: &Path, name: &str) -> PathBuf {
    let folder = file.parent().unwrap_or(Path::new(""));
    let plain = folder.join(name);
    if plain.exists() || !name.contains('\\') { plain } else { folder.join(name.replace('\\', "/")) }
}

/// The texel of a texture at a place in a picture of `width` x `height`.
pub(super) fn nearest(t: &Texture, x: u32, y: u32, width: u32, height: u32) -> Option<[u8; 4]> {
    let column = u64::from(x) * u64::from(t.width) / u64::from(width);
    let row = u64::from(y) * u64::from(t.height) / u64::from(height);
    t.texels.get((row * u64::from(t.width) + column) as usize).copied()
}

/// Index of the texture that has the colours of `base`, or `Kd` without one, and as its alpha that of `mask`, or its red if
/// it is opaque. Made at the first use of both; the error is a text.
pub(super) fn cut_out(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    definition: &Definition,
    base: Option<u32>,
    mask: u32,
) -> Result<u32, String> {
    let m = &definition.material;
    let black = |rgb: Option<[f32; 3]>| rgb.is_none_or(|c| c.iter().all(|x| *x <= 1e-3));
    let missing = definition.texture.is_some() && base.is_none();
    let kd = match m.diffuse {
        kd if missing && black(kd) => [0.5; 3],
        Some(kd) => kd,
        None if black(m.emissive) => [0.5; 3],
        None => [0.0; 3],
    };
    let plain = kd.map(|x| (srgb(x.clamp(0.0, 1.0)) * 255.0).round() as u8);
    let key = (base, plain, mask);
    if let Some(index) = loader.cut_outs.get(&key) {
        return Ok(*index);
    }
    let base = base.and_then(|i| scene.textures.get(i as usize));
    let mask = scene.textures.get(mask as usize).ok_or("no texture of opacity")?;
    let larger =
        base.into_iter().chain([mask]).max_by_key(|t| u64::from(t.width) * u64::from(t.height)).unwrap_or(mask);
    let [width, height] = [larger.width, larger.height];
    fits(width.into(), height.into(), 4, loader.free())?;
    let channel = if mask.texels.iter().any(|t| t[3] < 255) { 3 } else { 0 };
    let texel = |i: u32| {
        let [x, y] = [i % width, i / width];
        let [r, g, b] = base.and_then(|t| nearest(t, x, y, width, height)).map_or(plain, |[r, g, b, _]| [r, g, b]);
        [r, g, b, nearest(mask, x, y, width, height).map_or(255, |t| t[channel])]
    };
    let name = base.unwrap_or(mask).name.clone();
    let texels = (0..width * height).map(texel).collect();
    let texture = Texture { name, width, height, texels, ..Texture::default() };
    loader.charge(&texture);
    let index = scene.textures.len() as u32;
    scene.textures.push(texture);
    loader.cut_outs.insert(key, index);
    Ok(index)
}

/// The mapping of the table above. Where the file of `map_Kd` is missing, that is no `texture`, `Kd` counts, or grey if it
/// is black.
/// With `cut_out` the texture's alpha is the opacity.
pub(super) fn map(definition: &Definition, texture: Option<u32>, cut_out: bool) -> Mapped {
    let m = &definition.material;
    let mut notes = Vec::new();
    let parameter = |key: &str| m.unknown_param.get(key).and_then(|v| v.parse::<f32>().ok());
    let limited = |rgb: [f32; 3], notes: &mut Vec<String>| {
        if rgb.iter().any(|x| !(0.0..=1.0).contains(x)) {
            let [r, g, b] = rgb.map(|x| number(x.into()));
            let name = excerpt(&m.name);
            notes.push(format!("material `{name}`: reflectance [{r}, {g}, {b}] was limited to 0 .. 1"));
        }
        rgb.map(|x| x.clamp(0.0, 1.0))
    };
    let black = |rgb: Option<[f32; 3]>| rgb.is_none_or(|c| c.iter().all(|x| *x <= 1e-3));
    let missing = definition.texture.is_some() && texture.is_none();
    let kd = if missing && black(m.diffuse) { Some([0.5; 3]) } else { m.diffuse };
    let diffuse = match (texture, kd) {
        (Some(texture), _) => Reflectance::Texture(texture),
        // An emitter that states no reflectance reflects nothing.
        (None, None) if !black(m.emissive) => Reflectance::Constant([0.0; 3]),
        (None, rgb) => Reflectance::Constant(limited(rgb.unwrap_or([0.5; 3]), &mut notes)),
    };
    let (roughness, metalness) = (parameter("Pr"), parameter("Pm").unwrap_or(0.0));
    let opacity = if cut_out { 1.0 } else { m.dissolve.or(parameter("Tr").map(|t| 1.0 - t)).unwrap_or(1.0) };
    let illum = m.illumination_model;
    let from_pr = roughness.map(|r| r.clamp(0.0, 1.0).powi(2));
    let from_ns = m.shininess.map(|n| (2.0 / (n.max(0.0) + 2.0)).sqrt());
    let alpha = from_pr.or(from_ns).unwrap_or(0.0);
    let ior = m.optical_density.filter(|n| *n > 0.1 && (n - 1.0).abs() > 1e-3).map_or(1.5, |n| n.min(10.0));
    let metal = |reflectance| match alpha {
        alpha if alpha < SMOOTH => Model::Mirror { reflectance },
        alpha => Model::RoughConductor { eta: [0.0; 3], k: [1.0; 3], reflectance, alpha },
    };
    let clear = !cut_out && (matches!(illum, Some(4 | 6 | 7 | 9)) || opacity < 0.5);
    if opacity < 1.0 && !clear {
        let (name, opacity) = (excerpt(&m.name), number(opacity.into()));
        notes.push(format!("material `{name}`: opacity {opacity} was taken as 1"));
    }
    let model = if clear {
        match from_pr.unwrap_or(0.0) {
            _ if m.optical_density.is_some_and(|n| (n - 1.0).abs() <= 1e-3) => {
                Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 }
            }
            alpha if alpha < SMOOTH => Model::Dielectric { int_ior: ior, ext_ior: 1.0 },
            alpha => Model::RoughDielectric { int_ior: ior, ext_ior: 1.0, alpha },
        }
    } else if metalness >= 0.5 {
        metal(diffuse)
    } else if !black(m.specular) && black(kd) && texture.is_none() {
        metal(Reflectance::Constant(limited(m.specular.unwrap_or_default(), &mut notes)))
    } else if (matches!(illum, Some(0 | 1)) && roughness.is_none()) || !coated(m, roughness) {
        Model::Diffuse { reflectance: diffuse }
    } else if alpha < SMOOTH {
        Model::Plastic { reflectance: diffuse, int_ior: ior, ext_ior: 1.0 }
    } else {
        Model::RoughPlastic { reflectance: diffuse, int_ior: ior, ext_ior: 1.0, alpha }
    };
    let radiance = m.emissive.filter(|_| !black(m.emissive)).map(|c| c.map(|x| x.max(0.0)));
    let material = Material { compensated: true, cutout: cut_out, ..Material::new(&m.name, model) };
    Mapped { material, radiance, notes }
}

/// Whether the material has a glossy coat.
fn coated(m: &tobj::Material, roughness: Option<f32>) -> bool {
    let glossy = match m.specular {
        Some(rgb) => rgb.iter().any(|x| *x > 0.01),
        None => m.optical_density.is_some_and(|n| n > 1.0 + 1e-3),
    };
    roughness.map_or(glossy, |r| r < 1.0)
}

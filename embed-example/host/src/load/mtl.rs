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
//! made of. `map_Kd` replaces `Kd`. Reflectances are limited to 1. `Ke` is the radiance of an area light. Opacity from
//! 0.5, bump maps and all other parameters are ignored. All materials are compensated for what single scattering loses.

use super::LoadError;
use crate::description::{Material, Model, Reflectance};
use std::path::{Path, PathBuf};

/// Model of faces without a material.
pub(super) const GREY: Model = Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) };

/// Keys of textures besides `map_Kd`, which ask for the principled material (`mtl_principled.rs`).
pub(super) const MAPS: [&str; 4] = ["map_Pr", "map_Pm", "map_Ke", "norm"];

/// Widths below this are taken as smooth.
const SMOOTH: f32 = 1e-3;

/// One `newmtl`.
pub(super) struct Definition {
    pub material: tobj::Material,
    /// File of `map_Kd`, without its options, and the line that names it.
    pub texture: Option<(String, u32)>,
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
/// fewer than three numbers.
pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<Definition>, LoadError> {
    let mut plain = String::with_capacity(text.len() + 16);
    // of each definition: the line of its texture
    let mut texture_lines = Vec::new();
    let mut maps: Vec<Vec<(String, String, u32)>> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        check(line.trim(), &mut plain).map_err(|what| LoadError::line(path, number, what))?;
        plain.push('\n');
        match line.split_whitespace().next() {
            Some("newmtl") => {
                texture_lines.push(0);
                maps.push(Vec::new());
            }
            Some(key) if MAPS.contains(&key) => {
                let file = without_options(&line.trim()[key.len()..]);
                if file.is_empty() {
                    return Err(LoadError::line(path, number, format!("`{key}` needs a file")));
                }
                maps.iter_mut().next_back().into_iter().for_each(|m| m.push((key.into(), file.clone(), number)));
            }
            Some("map_Kd") => texture_lines.iter_mut().next_back().into_iter().for_each(|l| *l = number),
            _ => {}
        }
    }
    let (materials, _) = tobj::load_mtl_buf(&mut plain.as_bytes())
        .map_err(|e| LoadError::line(path, 0, format!("refused by the MTL parser: {e}")))?;
    let define = |((material, line), maps): ((tobj::Material, u32), _)| {
        let texture = material.diffuse_texture.as_deref().map(|t| (without_options(t), line));
        Definition { material, texture, maps }
    };
    Ok(materials.into_iter().zip(texture_lines).zip(maps).map(define).collect())
}

/// Writes the line in the form that `tobj` takes; lines of no use here become empty.
fn check(line: &str, out: &mut String) -> Result<(), String> {
    let (keyword, rest) = line.split_once(char::is_whitespace).map_or((line, ""), |(k, r)| (k, r.trim()));
    let number = |word: &str| match word.parse::<f32>() {
        Ok(x) if x.is_finite() => Ok(()),
        _ => Err(format!("`{word}` is not a finite number")),
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
            word.parse::<u8>().map_err(|_| format!("`{word}` is not an illumination model"))?;
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

/// The mapping of the table above.
pub(super) fn map(definition: &Definition, texture: Option<u32>) -> Mapped {
    let m = &definition.material;
    let mut notes = Vec::new();
    let parameter = |key: &str| m.unknown_param.get(key).and_then(|v| v.parse::<f32>().ok());
    let limited = |rgb: [f32; 3], notes: &mut Vec<String>| {
        if rgb.iter().any(|x| !(0.0..=1.0).contains(x)) {
            notes.push(format!("material `{}`: reflectance {rgb:?} was limited to 0 .. 1", m.name));
        }
        rgb.map(|x| x.clamp(0.0, 1.0))
    };
    let black = |rgb: Option<[f32; 3]>| rgb.is_none_or(|c| c.iter().all(|x| *x <= 1e-3));
    let diffuse = match (texture, m.diffuse) {
        (Some(texture), _) => Reflectance::Texture(texture),
        // An emitter that states no reflectance reflects nothing.
        (None, None) if !black(m.emissive) => Reflectance::Constant([0.0; 3]),
        (None, rgb) => Reflectance::Constant(limited(rgb.unwrap_or([0.5; 3]), &mut notes)),
    };
    let (roughness, metalness) = (parameter("Pr"), parameter("Pm").unwrap_or(0.0));
    let opacity = m.dissolve.or(parameter("Tr").map(|t| 1.0 - t)).unwrap_or(1.0);
    let illum = m.illumination_model;
    let from_pr = roughness.map(|r| r.clamp(0.0, 1.0).powi(2));
    let from_ns = m.shininess.map(|n| (2.0 / (n.max(0.0) + 2.0)).sqrt());
    let alpha = from_pr.or(from_ns).unwrap_or(0.0);
    let ior = m.optical_density.filter(|n| *n > 0.1 && (n - 1.0).abs() > 1e-3).map_or(1.5, |n| n.min(10.0));
    let metal = |reflectance| match alpha {
        alpha if alpha < SMOOTH => Model::Mirror { reflectance },
        alpha => Model::RoughConductor { eta: [0.0; 3], k: [1.0; 3], reflectance, alpha },
    };
    let clear = matches!(illum, Some(4 | 6 | 7 | 9)) || opacity < 0.5;
    if opacity < 1.0 && !clear {
        notes.push(format!("material `{}`: opacity {opacity} was taken as 1", m.name));
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
    } else if !black(m.specular) && black(m.diffuse) && texture.is_none() {
        metal(Reflectance::Constant(limited(m.specular.unwrap_or_default(), &mut notes)))
    } else if (matches!(illum, Some(0 | 1)) && roughness.is_none()) || !coated(m, roughness) {
        Model::Diffuse { reflectance: diffuse }
    } else if alpha < SMOOTH {
        Model::Plastic { reflectance: diffuse, int_ior: ior, ext_ior: 1.0 }
    } else {
        Model::RoughPlastic { reflectance: diffuse, int_ior: ior, ext_ior: 1.0, alpha }
    };
    let radiance = m.emissive.filter(|_| !black(m.emissive)).map(|c| c.map(|x| x.max(0.0)));
    let material = Material { compensated: true, ..Material::new(&m.name, model) };
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

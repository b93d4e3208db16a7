//! Participating media of `scene.json`: the list `media`, and `interior` of materials. Read after the geometry, because
//! a boundary without triangles is an error.
//!
//! The file says of each medium which material encloses it and which others have it in front of them
//! (`also_exterior_of`); a [`SceneDescription`] has an order instead, in which the first of overlapping media is there
//! alone. So what lies in front of a material comes after what is behind it, which is a medium of zeros if the file
//! names none.

use super::LoadError;
use super::json::Place;
use super::loader::Loader;
use super::presets::{PRESETS, Preset};
use crate::description::{Density, Medium, SceneDescription};
use crate::text::{excerpt, number};
use croupier::unstable::bsdf::{Lobes, facts};
use croupier::unstable::scene::blob::{MAX_ANISOTROPY, MAX_COEFFICIENT, MAX_EMISSION, MAX_MEDIA, MAX_SIDE, MediumKind};
use std::path::Path;

/// Only value of `dtype`.
const DTYPE: &str = "f32le";
/// Only value of `order`.
const ORDER: &str = "index = (z*ny + y)*nx + x";
/// Only value of `interpolation`.
const INTERPOLATION: &str = "trilinear, cell-centred, clamp";

/// A medium with what decides its place in the order.
struct Draft {
    medium: Medium,
    /// Material index.
    boundary: u32,
    /// Materials that have the medium in front of them.
    exterior_of: Vec<u32>,
}

/// Adds the media of a document whose materials and geometry have been loaded.
pub(super) fn load(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    folder: &Path,
    document: &Place<'_>,
) -> Result<(), LoadError> {
    let mut used = vec![false; scene.materials.len()];
    scene.triangles.iter().for_each(|t| used[t.material as usize] = true);
    let mut drafts = Vec::new();
    for ((_, material), index) in document.get("materials")?.entries()?.zip(0..) {
        if let Some(draft) = interior(scene, &material, index)?
            && used[index as usize]
        {
            drafts.push(draft);
        }
    }
    let Some(list) = document.find("media")? else { return finish(scene, drafts, document) };
    let elements = list.elements()?;
    if elements.len() > MAX_MEDIA {
        return Err(list.error(too_many(elements.len())));
    }
    for (i, place) in elements.iter().enumerate() {
        let name = place.find("name")?.map_or(Ok(format!("medium {i}")), |n| n.text().map(Into::into))?;
        let draft = draft(loader, scene, &used, folder, place, &name).and_then(|draft| {
            let taken = drafts.iter().find(|d: &&Draft| d.boundary == draft.boundary);
            let wrong = |other: &Draft| {
                let material = &scene.materials[draft.boundary as usize].name;
                place.error(format!(
                    "its boundary `{}` is that of `{}` already",
                    excerpt(material),
                    excerpt(&other.medium.name)
                ))
            };
            taken.map(wrong).map_or(Ok(draft), Err)
        });
        drafts.push(draft.map_err(|e| e.within(&format!("medium `{}`", excerpt(&name))))?);
    }
    finish(scene, clear_interiors(scene, drafts), &list)
}

fn too_many(count: usize) -> String {
    format!("{count} media are too many, there may be {MAX_MEDIA}")
}

/// The medium that a material's `interior` stands for.
fn interior(scene: &SceneDescription, m: &Place<'_>, boundary: u32) -> Result<Option<Draft>, LoadError> {
    let scale = m.find("interior_scale")?;
    let Some(place) = m.find("interior")? else {
        return scale.map_or(Ok(None), |s| Err(s.error("without `interior` it has no meaning")));
    };
    let material = &scene.materials[boundary as usize];
    if !material.model.is_transmissive() {
        return Err(place.error("light does not pass this material: it has no interior"));
    }
    let [sigma_a, sigma_s] = preset(&place)?.coefficients(millimetres(scale)?, 0.0);
    let name = format!("{} of {}", place.text()?, material.name);
    let medium = Medium { name, sigma_a, sigma_s, ..Medium::default() };
    Ok(Some(Draft { medium, boundary, exterior_of: Vec::new() }))
}

fn preset(place: &Place<'_>) -> Result<&'static Preset, LoadError> {
    let name = place.text()?;
    let names = || PRESETS.iter().map(|p| format!("`{}`", p.name)).collect::<Vec<_>>().join(", ");
    let found = PRESETS.iter().find(|p| p.name == name);
    found.ok_or_else(|| place.error(format!("unknown preset `{}`, there are {}", excerpt(name), names())))
}

/// Length of a unit of the scene.
fn millimetres(scale: Option<Place<'_>>) -> Result<f64, LoadError> {
    // so that coefficients stay in range
    let range = 0.0..=1e12;
    scale.map_or(Ok(1.0), |place| match place.number()? {
        x if range.contains(&x) && x > 0.0 => Ok(x),
        x => {
            Err(place
                .error(format!("{} millimetres to a unit of length, it must be above 0 and up to 1e12", number(x))))
        }
    })
}

/// One element of `media`.
fn draft(
    loader: &mut Loader,
    scene: &SceneDescription,
    used: &[bool],
    folder: &Path,
    m: &Place<'_>,
    name: &str,
) -> Result<Draft, LoadError> {
    let boundary = material(scene, used, &m.get("boundary_material")?)?;
    let others = m.find("also_exterior_of")?.map_or(Ok(Vec::new()), |o| o.elements())?;
    let exterior_of = others.iter().map(|o| material(scene, used, o)).collect::<Result<_, _>>()?;
    let kind = m.get("type")?;
    let g = phase(m)?;
    let emission = m.find("emission")?.map_or(Ok([0.0; 3]), |e| colour(&e, MAX_EMISSION))?;
    let medium = Medium { name: name.into(), emission, g: g.unwrap_or(0.0), ..Medium::default() };
    let medium = match MediumKind::from_name(kind.text()?) {
        Some(MediumKind::Homogeneous) => homogeneous(m, medium)?,
        Some(MediumKind::Grid) => grid(loader, folder, m, medium)?,
        None => return Err(kind.error(format!("unknown medium type `{}`", excerpt(kind.text()?)))),
    };
    Ok(Draft { medium, boundary, exterior_of })
}

/// Index of a material that has triangles.
fn material(scene: &SceneDescription, used: &[bool], place: &Place<'_>) -> Result<u32, LoadError> {
    let name = place.text()?;
    let index = scene.materials.iter().position(|m| m.name == name);
    let index = index.ok_or_else(|| place.error(format!("there is no material `{}`", excerpt(name))))?;
    if used[index] {
        Ok(index as u32)
    } else {
        Err(place.error(format!("no face has the material `{}`", excerpt(name))))
    }
}

/// Mean cosine of the phase function, if there is one.
fn phase(m: &Place<'_>) -> Result<Option<f32>, LoadError> {
    let Some(phase) = m.find("phase")? else { return Ok(None) };
    let kind = phase.get("type")?;
    if kind.text()? != "hg" {
        return Err(kind.error(format!("unknown phase function `{}`, there is only `hg`", excerpt(kind.text()?))));
    }
    let place = phase.get("g")?;
    match place.float()? {
        g if g.abs() <= MAX_ANISOTROPY => Ok(Some(g)),
        g => Err(place.error(format!("{}, it must be from -{MAX_ANISOTROPY} to {MAX_ANISOTROPY}", number(g.into())))),
    }
}

/// A colour, or a number for all three channels, from 0 to `most`.
fn colour(place: &Place<'_>, most: f32) -> Result<[f32; 3], LoadError> {
    let rgb = if place.is_number() { [place.float()?; 3] } else { place.rgb()? };
    let bad = rgb.into_iter().find(|x| !(0.0..=most).contains(x));
    bad.map_or(Ok(rgb), |x| Err(place.error(format!("{}, it must be from 0 to {most:e}", number(x.into())))))
}

fn homogeneous(m: &Place<'_>, medium: Medium) -> Result<Medium, LoadError> {
    let scale = m.find("scale")?;
    let Some(place) = m.find("preset")? else {
        if let Some(scale) = scale {
            return Err(scale.error("without `preset` it has no meaning"));
        }
        let sigma = |key| colour(&m.get(key)?, MAX_COEFFICIENT);
        return Ok(Medium { sigma_a: sigma("sigma_a")?, sigma_s: sigma("sigma_s")?, ..medium });
    };
    for key in ["sigma_a", "sigma_s"] {
        if let Some(place) = m.find(key)? {
            return Err(place.error("a preset has coefficients of its own"));
        }
    }
    let [sigma_a, sigma_s] = preset(&place)?.coefficients(millimetres(scale)?, medium.g.into());
    Ok(Medium { sigma_a, sigma_s, ..medium })
}

fn grid(loader: &mut Loader, folder: &Path, m: &Place<'_>, medium: Medium) -> Result<Medium, LoadError> {
    for (key, only) in [("dtype", DTYPE), ("order", ORDER), ("interpolation", INTERPOLATION)] {
        if let Some(place) = m.find(key)?
            && place.text()? != only
        {
            return Err(place.error(format!("`{}` is not supported, only `{only}`", excerpt(place.text()?))));
        }
    }
    let resolution = m.get("resolution")?;
    let sides = resolution.elements()?.iter().map(|n| n.count(1)).collect::<Result<Vec<_>, _>>()?;
    let cells: [u32; 3] = sides.try_into().map_err(|_| resolution.error("expected 3 numbers"))?;
    if cells.iter().any(|n| *n > MAX_SIDE) {
        return Err(resolution.error(format!("more than {MAX_SIDE} cells along an axis")));
    }
    let bounds = [m.get("bbox_min")?.rgb()?, m.get("bbox_max")?.rgb()?];
    if (0..3).any(|axis| bounds[0][axis].partial_cmp(&bounds[1][axis]) != Some(std::cmp::Ordering::Less)) {
        return Err(m.error(format!("bbox_min {:?} must be below bbox_max {:?}", bounds[0], bounds[1])));
    }
    let sigma_t = colour(&m.get("sigma_t_scale")?, MAX_COEFFICIENT)?;
    let albedo = colour(&m.get("albedo")?, 1.0)?;
    let share = |of: fn(f64) -> f64| std::array::from_fn(|c| (f64::from(sigma_t[c]) * of(f64::from(albedo[c]))) as f32);
    let (sigma_s, sigma_a) = (share(|albedo| albedo), share(|albedo| 1.0 - albedo));
    let file = m.get("file")?;
    let path = folder.join(file.text()?);
    let values = densities(&loader.read(&path, Some(&file.referrer()))?, cells);
    let values = values.map_err(|what| LoadError::grid(&path, &file.referrer(), what))?;
    Ok(Medium { sigma_a, sigma_s, density: Density::Grid { cells, bounds, values }, ..medium })
}

/// The densities of a file.
fn densities(bytes: &[u8], [nx, ny, nz]: [u32; 3]) -> Result<Vec<f32>, String> {
    let stated = 4 * u64::from(nx) * u64::from(ny) * u64::from(nz);
    if bytes.len() as u64 != stated {
        return Err(format!("{} bytes, but {nx} x {ny} x {nz} cells of 4 bytes are {stated}", bytes.len()));
    }
    let values: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    match values.iter().position(|x| !(0.0..=MAX_COEFFICIENT).contains(x)) {
        None => Ok(values),
        Some(i) => {
            let (row, x) = (i / nx as usize, i % nx as usize);
            let (z, y) = (row / ny as usize, row % ny as usize);
            let found = number(values[i].into());
            Err(format!("the density of cell ({x}, {y}, {z}) is {found}, it must be from 0 to {MAX_COEFFICIENT:e}"))
        }
    }
}

/// Lobes of models that are both interfaces at once: they reflect, and let the rest pass straight on.
const SHEET: Lobes = Lobes::REFLECTION.with(Lobes::STRAIGHT);

/// Puts before each medium what is behind the materials that it is in front of, where no medium is: nothing, as a
/// medium of zeros. Opaque materials let no path in, and a sheet has no inside.
fn clear_interiors(scene: &SceneDescription, drafts: Vec<Draft>) -> Vec<Draft> {
    let mut bounded: Vec<u32> = drafts.iter().map(|d| d.boundary).collect();
    let mut out = Vec::with_capacity(drafts.len());
    for draft in drafts {
        for boundary in draft.exterior_of.iter().copied() {
            let material = &scene.materials[boundary as usize];
            let sheet = facts(material.model.kind()).lobes.contains(SHEET);
            let encloses = material.model.is_transmissive() && !sheet;
            if encloses && !bounded.contains(&boundary) {
                bounded.push(boundary);
                let medium = Medium { name: format!("inside of {}", material.name), ..Medium::default() };
                out.push(Draft { medium, boundary, exterior_of: Vec::new() });
            }
        }
        out.push(draft);
    }
    out
}

/// Orders the media: as they stand, but each after those whose boundaries it is in front of.
fn finish(scene: &mut SceneDescription, drafts: Vec<Draft>, list: &Place<'_>) -> Result<(), LoadError> {
    if drafts.len() > MAX_MEDIA {
        return Err(list.error(too_many(drafts.len())));
    }
    let behind = |d: &Draft| -> Vec<usize> {
        (0..drafts.len()).filter(|i| d.exterior_of.contains(&drafts[*i].boundary)).collect()
    };
    let before: Vec<Vec<usize>> = drafts.iter().map(behind).collect();
    let mut order: Vec<usize> = Vec::with_capacity(drafts.len());
    while order.len() < drafts.len() {
        let free = |i: &usize| !order.contains(i) && before[*i].iter().all(|b| order.contains(b));
        match (0..drafts.len()).find(free) {
            Some(next) => order.push(next),
            None => return Err(list.error(circle(&drafts, &before, &order))),
        }
    }
    for (index, i) in (0..).zip(&order) {
        scene.materials[drafts[*i].boundary as usize].medium = Some(index);
    }
    let mut media: Vec<Option<Medium>> = drafts.into_iter().map(|d| Some(d.medium)).collect();
    scene.media.extend(order.into_iter().filter_map(|i| media[i].take()));
    Ok(())
}

/// Names media that surround each other, of which each that is not in `order` has another one before it.
fn circle(drafts: &[Draft], before: &[Vec<usize>], order: &[usize]) -> String {
    let mut walk: Vec<usize> = (0..drafts.len()).filter(|i| !order.contains(i)).take(1).collect();
    let names = loop {
        let next = walk.last().and_then(|i| before[*i].iter().find(|b| !order.contains(b)));
        let Some(&next) = next else { break walk };
        let seen = walk.iter().position(|i| *i == next);
        walk.push(next);
        if let Some(start) = seen {
            break walk.split_off(start);
        }
    };
    let names: Vec<String> = names.iter().map(|i| format!("`{}`", excerpt(&drafts[*i].medium.name))).collect();
    format!("media surround each other by `also_exterior_of`: {}", names.join(" is around "))
}

//! `instances` and `prototypes` of `scene.json`. Every key is in docs/SCENES.md.

use super::LoadError;
use super::json::Place;
use crate::description::{Instance, Prototype, SceneDescription};
use std::collections::HashMap;

/// Names of what instances may place.
struct Names {
    /// Triangles of each object of the geometry file; the last of a name counts.
    objects: HashMap<String, std::ops::Range<u32>>,
    /// Prototypes that there are.
    prototypes: HashMap<String, u32>,
}

/// Reads both, if there are any. The geometry has been loaded.
pub(super) fn load(scene: &mut SceneDescription, document: &Place<'_>) -> Result<(), LoadError> {
    let mut names = Names { objects: runs(scene), prototypes: HashMap::new() };
    if let Some(prototypes) = document.find("prototypes")? {
        for (name, place) in prototypes.entries()? {
            let object = place.find("object")?;
            let triangles = match &object {
                Some(object) => names.objects.get(object.text()?).cloned().ok_or_else(|| no_object(object))?,
                None => 0..0,
            };
            // its instances may name prototypes that come later
            names.prototypes.insert(name.into(), scene.prototypes.len() as u32);
            scene.prototypes.push(Prototype { name: name.into(), triangles, instances: Vec::new() });
        }
        for (name, place) in prototypes.entries()? {
            let own = instances(scene, &mut names, &place)?;
            scene.prototypes[names.prototypes[name] as usize].instances = own;
        }
    }
    scene.instances = instances(scene, &mut names, document)?;
    Ok(())
}

/// Objects of the geometry, each with the triangles of all its materials.
fn runs(scene: &SceneDescription) -> HashMap<String, std::ops::Range<u32>> {
    let mut out: HashMap<String, std::ops::Range<u32>> = HashMap::new();
    let ends = scene.objects.iter().skip(1).map(|o| o.first_triangle).chain([scene.triangles.len() as u32]);
    for (o, end) in scene.objects.iter().zip(ends) {
        let run = out.entry(o.name.clone()).or_insert(o.first_triangle..o.first_triangle);
        if run.end != o.first_triangle {
            run.start = o.first_triangle;
        }
        run.end = end;
    }
    out
}

fn no_object(place: &Place<'_>) -> LoadError {
    place.error(format!("there is no prototype and no object `{}` in the geometry", place.text().unwrap_or_default()))
}

/// `instances` of the document or of a prototype.
fn instances(scene: &mut SceneDescription, names: &mut Names, around: &Place<'_>) -> Result<Vec<Instance>, LoadError> {
    let Some(list) = around.find("instances")? else { return Ok(Vec::new()) };
    list.elements()?.iter().map(|place| instance(scene, names, place)).collect()
}

fn instance(scene: &mut SceneDescription, names: &mut Names, place: &Place<'_>) -> Result<Instance, LoadError> {
    let object = place.get("object")?;
    let of = object.text()?;
    let prototype = match names.prototypes.get(of) {
        Some(prototype) => *prototype,
        None => {
            let triangles = names.objects.get(of).cloned().ok_or_else(|| no_object(&object))?;
            let index = scene.prototypes.len() as u32;
            scene.prototypes.push(Prototype { name: of.into(), triangles, instances: Vec::new() });
            names.prototypes.insert(of.into(), index);
            index
        }
    };
    let name = place.find("name")?.map_or_else(|| Ok(place.at.clone()), |n| n.text().map(String::from))?;
    Ok(Instance {
        name,
        prototype,
        to_world: rows(&place.get("transform")?)?,
        to_world_end: place.find("transform_end")?.map(|m| rows(&m)).transpose()?,
        visible: place.find("visible")?.map_or(Ok(true), |v| v.flag())?,
    })
}

/// Three rows of four numbers.
fn rows(m: &Place<'_>) -> Result<[[f32; 4]; 3], LoadError> {
    let rows = m.elements()?;
    let [a, b, c] = &rows[..] else { return Err(m.error("expected 3 rows of 4 numbers")) };
    let row = |r: &Place<'_>| r.numbers::<4>().map(|r| r.map(|x| x as f32));
    Ok([row(a)?, row(b)?, row(c)?])
}

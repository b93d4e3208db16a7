//! `scene.json`: every key, its unit and what is refused are in docs/SCENES.md.

use super::json::{self, Place};
use super::loader::Loader;
use super::{LoadError, instances, media, obj};
use crate::description::{
    Camera, Emitter, Environment, Material, Model, ParameterSource, Reflectance, SceneDescription, ThinLens,
};
use croupier::unstable::scene::blob::{EnvironmentKind, LightKind, MaterialKind};
use std::path::Path;

pub(super) fn load(loader: &mut Loader, path: &Path) -> Result<SceneDescription, LoadError> {
    let text = loader.read_text(path, None)?;
    let document = json::parse(path, &text)?;
    let document = Place::document(path, &document);
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut scene = SceneDescription { camera: camera(&document.get("camera")?)?, ..SceneDescription::default() };
    if let Some(transport) = document.find("transport")?
        && let Some(depth) = transport.find("max_depth")?
    {
        scene.max_depth = depth.count(1)?;
    }
    for (name, place) in document.get("materials")?.entries()? {
        let material = material(loader, &mut scene, folder, name, &place)?;
        scene.materials.push(material);
    }
    if let Some(emitters) = document.find("emitters")? {
        for place in emitters.elements()? {
            emitter(loader, &mut scene, folder, &place)?;
        }
    }
    let file = document.get("geometry")?.get("file")?;
    obj::load_geometry(loader, &mut scene, &folder.join(file.text()?), &file)?;
    media::load(loader, &mut scene, folder, &document)?;
    instances::load(&mut scene, &document)?;
    Ok(scene)
}

fn camera(c: &Place<'_>) -> Result<Camera, LoadError> {
    if let Some(kind) = c.find("type")?
        && !matches!(kind.text()?, "perspective" | "thinlens")
    {
        return Err(kind.error(format!("unknown camera `{}`", kind.text()?)));
    }
    let lens = c.find("thin_lens")?.map(|l| -> Result<_, LoadError> {
        Ok(ThinLens { radius: l.get("radius")?.float()?, focus_distance: l.get("focus_distance")?.float()? })
    });
    Ok(Camera {
        origin: c.get("origin")?.numbers()?,
        target: c.get("target")?.numbers()?,
        up: c.get("up")?.numbers()?,
        vfov_deg: c.get("vfov_deg")?.number()?,
        size: [c.get("width")?.count(1)?, c.get("height")?.count(1)?],
        lens: lens.transpose()?,
    })
}

fn material(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    folder: &Path,
    name: &str,
    m: &Place<'_>,
) -> Result<Material, LoadError> {
    let kind = m.get("type")?;
    let name_of_kind = kind.text()?;
    let kind = MaterialKind::from_name(name_of_kind)
        .ok_or_else(|| kind.error(format!("unknown material type `{name_of_kind}`")))?;
    let model = Model::from_source(kind, &mut Parameters { loader, scene, folder, m })?;
    let two_sided = m.find("twosided")?.map_or(Ok(false), |t| t.flag())?;
    let cutout = matches!(model.parameters().reflectance, Some(Reflectance::Texture(_))) && cutout(m)?;
    let compensated = match m.find("compensate")? {
        Some(place) if place.flag()? && !kind.facts().compensates() => {
            return Err(place.error(format!("a `{name_of_kind}` is not rough: it loses no energy")));
        }
        place => place.map_or(Ok(false), |p| p.flag())?,
    };
    Ok(Material { two_sided, cutout, compensated, ..Material::new(name, model) })
}

/// Whether a texture's alpha cuts holes into the material.
fn cutout(m: &Place<'_>) -> Result<bool, LoadError> {
    let Some(place) = m.get("reflectance")?.find("alpha")? else { return Ok(false) };
    match place.text()? {
        "cutout" => Ok(true),
        "ignore" => Ok(false),
        other => Err(place.error(format!("`{other}` is not supported, only `cutout` and `ignore`"))),
    }
}

/// Parameters of a material, all required.
struct Parameters<'a, 'v> {
    loader: &'a mut Loader,
    scene: &'a mut SceneDescription,
    folder: &'a Path,
    m: &'a Place<'v>,
}

impl ParameterSource for Parameters<'_, '_> {
    type Error = LoadError;

    fn reflectance(&mut self) -> Result<Reflectance, LoadError> {
        reflectance(self.loader, self.scene, self.folder, &self.m.get("reflectance")?)
    }

    fn eta(&mut self) -> Result<[f32; 3], LoadError> {
        self.m.get("eta")?.rgb()
    }

    fn k(&mut self) -> Result<[f32; 3], LoadError> {
        self.m.get("k")?.rgb()
    }

    fn int_ior(&mut self) -> Result<f32, LoadError> {
        self.m.get("int_ior")?.float()
    }

    fn ext_ior(&mut self) -> Result<f32, LoadError> {
        self.m.get("ext_ior")?.float()
    }

    fn alpha(&mut self) -> Result<f32, LoadError> {
        self.m.get("alpha")?.float()
    }
}

fn reflectance(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    folder: &Path,
    r: &Place<'_>,
) -> Result<Reflectance, LoadError> {
    if !r.is_object() {
        return Ok(Reflectance::Constant(r.rgb()?));
    }
    for (key, only) in [("filter", "bilinear"), ("wrap", "repeat")] {
        if let Some(place) = r.find(key)?
            && place.text()? != only
        {
            return Err(place.error(format!("`{}` is not supported, only `{only}`", place.text()?)));
        }
    }
    let file = r.get("file")?;
    Ok(Reflectance::Texture(loader.texture(scene, &folder.join(file.text()?), &file.referrer())?))
}

fn emitter(loader: &mut Loader, scene: &mut SceneDescription, folder: &Path, e: &Place<'_>) -> Result<(), LoadError> {
    let kind = e.get("type")?;
    let name = kind.text()?;
    let emitter = match LightKind::from_name(name) {
        Some(LightKind::Area) => {
            Emitter::Area { material: material_index(scene, e)?, radiance: e.get("radiance")?.rgb()? }
        }
        Some(LightKind::Point) => {
            Emitter::Point { position: e.get("position")?.rgb()?, intensity: e.get("intensity")?.rgb()? }
        }
        Some(LightKind::Directional) => {
            Emitter::Directional { direction: e.get("direction")?.rgb()?, irradiance: e.get("irradiance")?.rgb()? }
        }
        // An environment's type is that of its own kind.
        Some(LightKind::Environment) | None => {
            let environment = match EnvironmentKind::from_name(name) {
                Some(EnvironmentKind::Constant) => Environment::Constant { radiance: e.get("radiance")?.rgb()? },
                Some(EnvironmentKind::Map) => envmap(loader, folder, e)?,
                None => return Err(kind.error(format!("unknown emitter type `{name}`"))),
            };
            return match scene.environment.replace(environment) {
                None => Ok(()),
                Some(_) => Err(e.error("there is already an environment")),
            };
        }
    };
    scene.emitters.push(emitter);
    Ok(())
}

/// Index of the material that an area emitter names.
fn material_index(scene: &SceneDescription, e: &Place<'_>) -> Result<u32, LoadError> {
    let place = e.get("material")?;
    let name = place.text()?;
    let index = scene.materials.iter().position(|m| m.name == name);
    index.map(|i| i as u32).ok_or_else(|| place.error(format!("there is no material `{name}`")))
}

fn envmap(loader: &mut Loader, folder: &Path, e: &Place<'_>) -> Result<Environment, LoadError> {
    let file = e.get("file")?;
    let mut map = loader.environment(&folder.join(file.text()?), &file.referrer())?;
    if let Environment::Map { scale, to_world, .. } = &mut map {
        if let Some(s) = e.find("scale")? {
            *scale = if s.is_number() { [s.float()?; 3] } else { s.rgb()? };
        }
        if let Some(m) = e.find("to_world")? {
            // Rows of a 4 x 4 (or 3 x 3) matrix; light from infinity has no use for the translation.
            let rows = m.elements()?;
            if !matches!(rows.len(), 3 | 4) {
                return Err(m.error("expected 4 rows"));
            }
            for (row, place) in to_world.iter_mut().zip(&rows) {
                *row = match rows.len() {
                    3 => place.rgb()?,
                    _ => place.numbers::<4>().map(|[x, y, z, _]| [x, y, z].map(|x| x as f32))?,
                };
            }
        }
    }
    Ok(map)
}

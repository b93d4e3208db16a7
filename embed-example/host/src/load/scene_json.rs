//! `scene.json`: every key, its unit and what is refused are in docs/SCENES.md.

use super::json::{self, Place};
use super::loader::Loader;
use super::{LoadError, instances, media, obj, principled};
use crate::description::{
    Camera, Emitter, Environment, LightShape, Material, Model, ModelParameters, NamedCamera, ParameterSource,
    Principled, Projection, Reflectance, SceneDescription, ShapeLight, ThinLens,
};
use crate::text::excerpt;
use croupier::unstable::scene::blob::{CameraKind, EnvironmentKind, LightKind, MaterialKind};
use std::path::Path;

pub(super) fn load(loader: &mut Loader, path: &Path) -> Result<SceneDescription, LoadError> {
    let text = loader.read_text(path, None)?;
    let document = json::parse(path, &text)?;
    let document = Place::document(path, &document);
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut scene = SceneDescription { camera: camera(&document.get("camera")?)?, ..SceneDescription::default() };
    if let Some(cameras) = document.find("cameras")? {
        for (name, place) in cameras.entries()? {
            scene.cameras.push(NamedCamera { name: name.into(), camera: camera(&place)? });
        }
    }
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
    let geometry = document.get("geometry")?;
    if let Some(kind) = geometry.find("type")?
        && kind.text()? != "obj"
    {
        return Err(kind.error(format!("unknown kind of geometry `{}`, there is only `obj`", excerpt(kind.text()?))));
    }
    let file = geometry.get("file")?;
    obj::load_geometry(loader, &mut scene, &folder.join(file.text()?), &file)?;
    media::load(loader, &mut scene, folder, &document)?;
    instances::load(&mut scene, &document)?;
    Ok(scene)
}

fn camera(c: &Place<'_>) -> Result<Camera, LoadError> {
    let kind = match c.find("type")? {
        None => CameraKind::Perspective,
        Some(place) => match place.text()? {
            "thinlens" => CameraKind::Perspective,
            name => {
                CameraKind::from_name(name).ok_or_else(|| place.error(format!("unknown camera `{}`", excerpt(name))))?
            }
        },
    };
    let lens = c.find("thin_lens")?.map(|l| -> Result<_, LoadError> {
        if kind != CameraKind::Perspective {
            return Err(l.error(format!("a camera of type `{}` has no lens", kind.name())));
        }
        Ok(ThinLens { radius: l.get("radius")?.float()?, focus_distance: l.get("focus_distance")?.float()? })
    });
    let camera = Camera {
        origin: c.get("origin")?.numbers()?,
        target: c.get("target")?.numbers()?,
        up: c.get("up")?.numbers()?,
        size: [c.get("width")?.count(1)?, c.get("height")?.count(1)?],
        lens: lens.transpose()?,
        ..Camera::default()
    };
    Ok(match kind {
        CameraKind::Perspective => Camera { vfov_deg: c.get("vfov_deg")?.number()?, ..camera },
        CameraKind::Orthographic => {
            Camera { projection: Projection::Orthographic { height: c.get("view_height")?.float()? }, ..camera }
        }
        CameraKind::Panoramic => Camera { projection: Projection::Panoramic, ..camera },
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
        .ok_or_else(|| kind.error(format!("unknown material type `{}`", excerpt(name_of_kind))))?;
    let model = Model::from_source(kind, &mut Parameters { loader, scene, folder, m })?;
    let two_sided = m.find("twosided")?.map_or(Ok(false), |t| t.flag())?;
    let cutout = match model.parameters() {
        ModelParameters { reflectance: Some(Reflectance::Texture(_)), .. } => cutout(&m.get("reflectance")?)?,
        ModelParameters { principled: Some(Principled { base_texture: Some(_), .. }), .. } => {
            let texture = m.get("base_texture")?;
            texture.is_object() && cutout(&texture)?
        }
        _ => false,
    };
    let compensated = match m.find("compensate")? {
        Some(place) if place.flag()? && !kind.facts().compensates() => {
            return Err(place.error(format!("a `{name_of_kind}` is not rough: it loses no energy")));
        }
        place => place.map_or(Ok(false), |p| p.flag())?,
    };
    Ok(Material { two_sided, cutout, compensated, ..Material::new(name, model) })
}

/// Whether a texture's alpha cuts holes into the material.
fn cutout(texture: &Place<'_>) -> Result<bool, LoadError> {
    let Some(place) = texture.find("alpha")? else { return Ok(false) };
    match place.text()? {
        "cutout" => Ok(true),
        "ignore" => Ok(false),
        other => Err(place.error(format!("`{}` is not supported, only `cutout` and `ignore`", excerpt(other)))),
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

    fn principled(&mut self) -> Result<Principled, LoadError> {
        principled::read(self.loader, self.scene, self.folder, self.m)
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
            return Err(place.error(format!("`{}` is not supported, only `{only}`", excerpt(place.text()?))));
        }
    }
    let file = r.get("file")?;
    let texture = loader.texture(scene, &folder.join(file.text()?), &file.referrer())?;
    Ok(texture.map_or(Reflectance::Constant([0.5; 3]), Reflectance::Texture))
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
        Some(LightKind::Sun) => Emitter::Sun {
            direction: e.get("direction")?.rgb()?,
            irradiance: e.get("irradiance")?.rgb()?,
            angle_deg: e.find("angle_deg")?.map_or(Ok(0.53), |d| d.float())?,
        },
        Some(LightKind::Spot) => Emitter::Spot {
            position: e.get("position")?.rgb()?,
            direction: e.get("direction")?.rgb()?,
            intensity: e.get("intensity")?.rgb()?,
            inner_deg: e.find("inner_deg")?.map_or(Ok(0.0), |d| d.float())?,
            outer_deg: e.get("outer_deg")?.float()?,
        },
        Some(LightKind::Sphere) => shape_light(e, LightShape::Sphere { radius: e.get("radius")?.float()? })?,
        Some(LightKind::Rectangle) => {
            let edges = [e.get("edge_u")?.rgb()?, e.get("edge_v")?.rgb()?];
            shape_light(e, LightShape::Rectangle { edges })?
        }
        Some(LightKind::Disk) => {
            let (direction, radius) = (e.get("direction")?.rgb()?, e.get("radius")?.float()?);
            shape_light(e, LightShape::Disk { direction, radius })?
        }
        // An environment's type is that of its own kind.
        Some(LightKind::Environment) | None => {
            let environment = match EnvironmentKind::from_name(name) {
                Some(EnvironmentKind::Constant) => Environment::Constant { radiance: e.get("radiance")?.rgb()? },
                Some(EnvironmentKind::Map) => envmap(loader, folder, e)?,
                None => return Err(kind.error(format!("unknown emitter type `{}`", excerpt(name)))),
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

/// What lights with shapes have in common.
fn shape_light(e: &Place<'_>, shape: LightShape) -> Result<Emitter, LoadError> {
    let flag = |key: &str, default: bool| e.find(key)?.map_or(Ok(default), |f| f.flag());
    Ok(Emitter::Shape(ShapeLight {
        shape,
        position: e.get("position")?.rgb()?,
        radiance: e.get("radiance")?.rgb()?,
        two_sided: flag("twosided", false)?,
        visible: flag("visible", true)?,
    }))
}

/// Index of the material that an area emitter names.
fn material_index(scene: &SceneDescription, e: &Place<'_>) -> Result<u32, LoadError> {
    let place = e.get("material")?;
    let name = place.text()?;
    let index = scene.materials.iter().position(|m| m.name == name);
    index.map(|i| i as u32).ok_or_else(|| place.error(format!("there is no material `{}`", excerpt(name))))
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

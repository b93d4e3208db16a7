//! Small scenes that together call for every effect, and the tracers of profiles outside the closed set.

use croupier::unstable::Effects;
use croupier::unstable::accel::WideBvh;
use croupier::unstable::profile::Profile;
use croupier::{Scene, Settings};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin::sky;
use croupier_host::description::*;
use croupier_tests::runner::{Image, Schedule, render_with};
use croupier_tests::scenes::*;

/// The profile of these effects, which reads light trees as the closed set does: the principled scene has one.
struct Exactly<const EFFECTS: u32>;

impl<const EFFECTS: u32> Profile for Exactly<EFFECTS> {
    const EFFECTS: Effects = Effects(EFFECTS);
    const NAME: &'static str = "exactly";
    type Unguided = Self;
}

/// Renders a scene with a profile, settings and numbers of samples.
pub(crate) type Renderer = fn(Scene<'_>, &Settings, &[u32]) -> Image;

/// Renders with the profile of exactly these effects.
fn exactly<const EFFECTS: u32>(scene: Scene<'_>, settings: &Settings, samples: &[u32]) -> Image {
    let schedule = Schedule::InOrder(1 << 20);
    render_with::<Exactly<EFFECTS>, _>(scene, WideBvh::new(&scene), settings, samples, schedule)
}

/// A scene that calls for some effects.
pub(crate) struct EffectScene {
    /// What it shows.
    pub(crate) name: &'static str,
    /// Effects that it calls for.
    pub(crate) effects: Effects,
    /// The scene's blob.
    pub(crate) blob: fn() -> AlignedBytes,
    /// The tracer with exactly these effects.
    pub(crate) exactly: Renderer,
}

macro_rules! scenes {
    ($($name:literal, [$($effect:ident),*], $blob:expr;)*) => {
        /// Scenes that together call for every effect.
        pub(crate) const SCENES: &[EffectScene] = &[$(EffectScene {
            name: $name,
            effects: Effects(0)$(.with(Effects::$effect))*,
            blob: $blob,
            exactly: exactly::<{ 0 $(| Effects::$effect.0)* }>,
        }),*];
    };
}

/// Tracers of profiles with more than most scenes call for, each with its effects: less a model, less lights, less what
/// comes between surfaces.
pub(crate) const LARGER: [(Effects, Renderer); 3] = [
    (Effects(NO_MIRROR), exactly::<NO_MIRROR>),
    (Effects(AREA_LIGHTS_ONLY), exactly::<AREA_LIGHTS_ONLY>),
    (Effects(NO_MEDIA), exactly::<NO_MEDIA>),
];
const NO_MIRROR: u32 = !Effects::MIRROR.0;
const AREA_LIGHTS_ONLY: u32 = !(Effects::ENVIRONMENT.0 | Effects::CONSTANT.0 | Effects::DELTA_LIGHTS.0);
const NO_MEDIA: u32 = !(Effects::MEDIA.0 | Effects::GRID_MEDIA.0);

scenes! {
    "moving instance", [DIFFUSE, AREA_LIGHTS, INSTANCES, MOTION], || {
        let mut s = cornell(SIZE);
        let first = s.triangles.len() as u32;
        add_quad(&mut s, "sheet", 0, facing_y(0.5, 0.0, 1.0));
        let sheet = croupier_tests::placed::add_prototype(&mut s, "sheet", first, vec![]);
        let up = |y| croupier_tests::placed::translation([0.0, y, 0.0]);
        s.instances.push(Instance { to_world_end: Some(up(0.5)), ..Instance::new("sheet", sheet, up(-0.5)) });
        blob(&s)
    };
    "diffuse", [DIFFUSE, AREA_LIGHTS], || blob(&cornell(SIZE));
    "mirror", [DIFFUSE, MIRROR, AREA_LIGHTS], || with(Model::Mirror { reflectance: WHITE });
    "conductor", [DIFFUSE, CONDUCTOR, AREA_LIGHTS], || with(Model::Conductor { eta: ETA, k: K, reflectance: WHITE });
    "rough conductor", [DIFFUSE, ROUGH_CONDUCTOR, AREA_LIGHTS], || with(rough_conductor());
    "dielectric", [DIFFUSE, DIELECTRIC, AREA_LIGHTS], || with(Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    "rough dielectric", [DIFFUSE, ROUGH_DIELECTRIC, AREA_LIGHTS],
        || with(Model::RoughDielectric { int_ior: 1.5, ext_ior: 1.0, alpha: 0.3 });
    "thin dielectric", [DIFFUSE, THIN_DIELECTRIC, AREA_LIGHTS],
        || with(Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 });
    "plastic", [DIFFUSE, PLASTIC, AREA_LIGHTS],
        || with(Model::Plastic { reflectance: WHITE, int_ior: 1.5, ext_ior: 1.0 });
    "rough plastic", [DIFFUSE, ROUGH_PLASTIC, AREA_LIGHTS],
        || with(Model::RoughPlastic { reflectance: WHITE, int_ior: 1.5, ext_ior: 1.0, alpha: 0.3 });
    "null", [DIFFUSE, NULL, AREA_LIGHTS], || with(Model::Null);
    "texture", [DIFFUSE, AREA_LIGHTS, TEXTURES], || {
        changed(|s| {
            let texels = (0..16).map(|i| [10 * i, 255 - 9 * i, 40, 255]).collect();
            s.textures.push(Texture { name: "ramp".into(), width: 4, height: 4, texels, ..Texture::default() });
            s.materials[0].model = Model::Diffuse { reflectance: Reflectance::Texture(0) };
        })
    };
    "environment map", [DIFFUSE, ENVIRONMENT], || changed(|s| (s.emitters, s.environment) = (Vec::new(), Some(sky())));
    "constant environment", [DIFFUSE, AREA_LIGHTS, CONSTANT],
        || changed(|s| s.environment = Some(Environment::Constant { radiance: [0.5, 1.0, 2.0] }));
    "point and directional light", [DIFFUSE, DELTA_LIGHTS], || {
        changed(|s| {
            s.emitters = vec![
                Emitter::Point { position: [0.2, 0.5, 0.1], intensity: [1.0, 2.0, 3.0] },
                Emitter::Directional { direction: [0.1, -0.2, -1.0], irradiance: [1.0; 3] },
            ];
        })
    };
    "lens", [DIFFUSE, AREA_LIGHTS, LENS],
        || changed(|s| s.camera.lens = Some(ThinLens { radius: 0.1, focus_distance: 3.0 }));
    "spot light", [DIFFUSE, DELTA_LIGHTS], || {
        changed(|s| {
            let (position, direction) = ([0.0, 0.9, 0.0], [0.1, -1.0, 0.0]);
            s.emitters = vec![Emitter::Spot { position, direction, intensity: [3.0; 3], inner_deg: 20.0, outer_deg: 60.0 }];
        })
    };
    "sphere, rectangle and disk light", [DIFFUSE, SHAPE_LIGHTS], || {
        changed(|s| {
            let edges = [[0.4, 0.0, 0.0], [0.0, 0.0, 0.6]];
            let light = |shape, position| {
                let radiance = [3.0, 2.0, 4.0];
                Emitter::Shape(ShapeLight { shape, position, radiance, two_sided: false, visible: true })
            };
            s.emitters = vec![
                light(LightShape::Sphere { radius: 0.1 }, [-0.4, 0.1, 0.2]),
                light(LightShape::Rectangle { edges }, [0.1, 0.9, 0.0]),
                light(LightShape::Disk { direction: [1.0, 0.2, 0.0], radius: 0.3 }, [-0.9, 0.0, 0.0]),
            ];
        })
    };
    "orthographic", [DIFFUSE, AREA_LIGHTS, PROJECTIONS],
        || changed(|s| s.camera.projection = Projection::Orthographic { height: 2.0 });
    "panoramic", [DIFFUSE, AREA_LIGHTS, PROJECTIONS], || {
        changed(|s| {
            let camera = Camera { projection: Projection::Panoramic, origin: [0.0; 3], target: [0.0, 0.0, -1.0], ..s.camera };
            s.camera = camera;
        })
    };
    "shading normals", [DIFFUSE, AREA_LIGHTS, SMOOTH_NORMALS], || {
        changed(|s| add_sphere(s, 0, [0.0, -0.4, 0.0], 0.5, Sphere { subdivisions: 2, smooth: true, inwards: false }))
    };
    "compensated metal", [DIFFUSE, ROUGH_CONDUCTOR, AREA_LIGHTS, MULTIPLE_SCATTERING],
        || changed(|s| { ball(s, rough_conductor()).compensated = true; });
    "fog", [DIFFUSE, NULL, AREA_LIGHTS, MEDIA], || changed(|s| fill(s, Model::Null, Density::Homogeneous));
    "clouded glass", [DIFFUSE, DIELECTRIC, AREA_LIGHTS, MEDIA],
        || changed(|s| fill(s, Model::Dielectric { int_ior: 1.3, ext_ior: 1.0 }, Density::Homogeneous));
    "smoke", [DIFFUSE, NULL, AREA_LIGHTS, MEDIA, GRID_MEDIA], || changed(|s| fill(s, Model::Null, smoke()));
    "cut-outs", [DIFFUSE, AREA_LIGHTS, TEXTURES, ALPHA], || {
        changed(|s| {
            let texels = (0..16).map(|i| [200, 180, 160, 17 * i]).collect();
            s.textures.push(Texture { name: "leaves".into(), width: 4, height: 4, texels, ..Texture::default() });
            let m = s.add_material("leaves", Model::Diffuse { reflectance: Reflectance::Texture(0) });
            s.materials[m as usize].cutout = true;
            add_quad(s, "leaves", m, facing_z(0.6, 0.3, 1.0).map(|[x, y, z]| [x, y - 0.4, z]));
        })
    };
    "principled", [DIFFUSE, PRINCIPLED, AREA_LIGHTS, TEXTURES, NORMAL_MAPS], || {
        changed(|s| {
            let texels = (0..16).map(|i| [100 + 4 * i, 160 - 3 * i, 250, 255]).collect();
            let normals = Texture { width: 4, height: 4, texels, encoding: Encoding::Linear, ..Texture::default() };
            s.textures.push(normals);
            ball(s, Model::Principled(Principled {
                coat: 0.5,
                sheen_color: [0.2; 3],
                transmission: 0.3,
                normal_texture: Some(TextureRef::new(0)),
                emission: [0.5; 3],
                emission_texture: Some(TextureRef::new(0)),
                ..Principled::default()
            }));
        })
    };
    "everything but media", [
        DIFFUSE, ROUGH_CONDUCTOR, DIELECTRIC, THIN_DIELECTRIC, ROUGH_PLASTIC, NULL, TEXTURES, AREA_LIGHTS, ENVIRONMENT,
        DELTA_LIGHTS, LENS, SMOOTH_NORMALS
    ], || blob(&everything(SIZE));
}

const SIZE: [u32; 2] = [12, 9];
const ETA: [f32; 3] = [0.2, 0.9, 1.1];
const K: [f32; 3] = [3.9, 2.4, 2.2];
const WHITE: Reflectance = Reflectance::Constant([0.9; 3]);

fn rough_conductor() -> Model {
    Model::RoughConductor { eta: ETA, k: K, reflectance: WHITE, alpha: 0.3 }
}

/// The diffuse box with something else.
fn changed(change: impl FnOnce(&mut SceneDescription)) -> AlignedBytes {
    let mut scene = cornell(SIZE);
    change(&mut scene);
    blob(&scene)
}

/// Adds a ball of a model; its material.
fn ball(scene: &mut SceneDescription, model: Model) -> &mut Material {
    let material = scene.add_material("ball", model);
    let shape = Sphere { subdivisions: 2, smooth: false, inwards: false };
    add_sphere(scene, material, [0.0, -0.4, 0.0], 0.5, shape);
    &mut scene.materials[material as usize]
}

/// The diffuse box with a ball of a model.
fn with(model: Model) -> AlignedBytes {
    changed(|s| {
        ball(s, model);
    })
}

/// Adds a ball full of a medium.
fn fill(scene: &mut SceneDescription, model: Model, density: Density) {
    let (sigma_a, sigma_s) = ([0.1, 0.3, 0.6], [3.0, 2.0, 1.0]);
    scene.media.push(Medium { sigma_a, sigma_s, emission: [0.1, 0.0, 0.2], g: 0.4, density, ..Medium::default() });
    ball(scene, model).medium = Some(0);
}

/// Densities in a box a little smaller than the ball's.
fn smoke() -> Density {
    let values = (0..5 * 6 * 7u32).map(|i| (i * 37 % 11) as f32 * 0.2).collect();
    Density::Grid { cells: [5, 6, 7], bounds: [[-0.4, -0.8, -0.4], [0.4, 0.0, 0.4]], values }
}

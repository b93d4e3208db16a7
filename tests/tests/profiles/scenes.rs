//! Small scenes that together call for every effect, and the tracers of profiles outside the closed set.
//!
//! An effect that comes new needs a row in [`SCENES`]; until a scene can call for it, it stands in [`WITHOUT_SCENE`].

use croupier::unstable::Effects;
use croupier::unstable::accel::WideBvh;
use croupier::unstable::profile::Custom;
use croupier::unstable::scene::blob::{Header, MATERIAL_COMPENSATED, Material, Section, SectionKind};
use croupier::{Scene, Settings};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin::sky;
use croupier_host::description::*;
use croupier_tests::runner::{Image, Schedule, render_with};
use croupier_tests::scenes::*;

/// Effects that no scene calls for yet.
pub(crate) const WITHOUT_SCENE: Effects = Effects::MEDIA.with(Effects::GRID_MEDIA).with(Effects::ALPHA);

/// Renders a scene with a profile, settings and numbers of samples.
pub(crate) type Renderer = fn(Scene<'_>, &Settings, &[u32]) -> Image;

/// Renders with the profile of exactly these effects.
fn exactly<const EFFECTS: u32>(scene: Scene<'_>, settings: &Settings, samples: &[u32]) -> Image {
    let schedule = Schedule::InOrder(1 << 20);
    render_with::<Custom<EFFECTS>, _>(scene, WideBvh::new(&scene), settings, samples, schedule)
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
        /// Scenes with all effects but [`WITHOUT_SCENE`].
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
            s.textures.push(Texture { name: "ramp".into(), width: 4, height: 4, texels });
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
    "shading normals", [DIFFUSE, AREA_LIGHTS, SMOOTH_NORMALS], || {
        changed(|s| add_sphere(s, 0, [0.0, -0.4, 0.0], 0.5, Sphere { subdivisions: 2, smooth: true, inwards: false }))
    };
    "compensated metal", [DIFFUSE, ROUGH_CONDUCTOR, AREA_LIGHTS, MULTIPLE_SCATTERING],
        || with_flag(&with(rough_conductor()), MATERIAL_COMPENSATED);
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

/// The diffuse box with a ball of a model.
fn with(model: Model) -> AlignedBytes {
    changed(|s| {
        let material = s.add_material("ball", model);
        add_sphere(s, material, [0.0, -0.4, 0.0], 0.5, Sphere { subdivisions: 2, smooth: false, inwards: false });
    })
}

/// The blob with a flag set on its last material.
fn with_flag(scene: &[u8], flag: u32) -> AlignedBytes {
    let mut out = AlignedBytes::zeroed(scene.len());
    let bytes = out.as_mut();
    bytes.copy_from_slice(scene);
    let header: Header = *bytemuck::from_bytes(&bytes[..size_of::<Header>()]);
    let sections = &bytes[size_of::<Header>()..][..header.sections as usize * size_of::<Section>()];
    let sections: &[Section] = bytemuck::cast_slice(sections);
    let materials = sections.iter().find(|s| s.kind == SectionKind::Materials as u32).expect("materials");
    let last = materials.offset as usize + (materials.count as usize - 1) * size_of::<Material>();
    bytemuck::from_bytes_mut::<Material>(&mut bytes[last..][..size_of::<Material>()]).flags |= flag;
    let hash = croupier::unstable::scene::blob::content_hash(&bytes[size_of::<Header>()..]);
    bytemuck::from_bytes_mut::<Header>(&mut bytes[..size_of::<Header>()]).hash = hash;
    out
}

//! The table of effects: for each the scene that it is added to, and how.
//!
//! An effect that comes new is a row; until its scene can be built, `None` stands in place of the builder.

use super::instance::Instance;
use croupier::unstable::Effects;
use croupier::unstable::profile::Custom;
use croupier_host::builtin;
use croupier_host::description::*;

/// A scene that effects are added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    /// The built-in box, diffuse and flat, under its area light.
    Diffuse,
    /// The same of rough metal.
    Metal,
    /// The same as `Diffuse`, under a constant environment in place of the area light.
    Open,
}

const DIFFUSE: Effects = Effects::DIFFUSE.with(Effects::AREA_LIGHTS);
const METAL: Effects = Effects::ROUGH_CONDUCTOR.with(Effects::AREA_LIGHTS);
const OPEN: Effects = Effects::DIFFUSE.with(Effects::CONSTANT);

impl Base {
    /// Every base.
    pub(crate) const ALL: [Self; 3] = [Self::Diffuse, Self::Metal, Self::Open];

    /// Name in tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse box",
            Self::Metal => "metal box",
            Self::Open => "open box",
        }
    }

    /// The tracer with what the base calls for, and no more.
    pub(crate) const fn instance(self) -> Instance {
        match self {
            Self::Diffuse => Instance::of::<Custom<{ DIFFUSE.0 }>>(),
            Self::Metal => Instance::of::<Custom<{ METAL.0 }>>(),
            Self::Open => Instance::of::<Custom<{ OPEN.0 }>>(),
        }
    }

    /// The scene.
    pub(crate) fn scene(self) -> SceneDescription {
        let mut scene = builtin::cornell_box();
        let model = if self == Self::Metal { metal(0.3) } else { diffuse() };
        scene.materials.iter_mut().for_each(|m| (m.model, m.two_sided) = (model, true));
        scene.triangles.iter_mut().for_each(|t| t.smooth = false);
        if self == Self::Open {
            scene.emitters.clear();
            scene.environment = Some(Environment::Constant { radiance: [1.0; 3] });
        }
        scene
    }
}

fn diffuse() -> Model {
    Model::Diffuse { reflectance: Reflectance::Constant([0.7; 3]) }
}

fn metal(alpha: f32) -> Model {
    let (eta, k) = ([1.65746, 0.880369, 0.521229], [9.22387, 6.26952, 4.837]);
    Model::RoughConductor { eta, k, reflectance: WHITE, alpha }
}

const WHITE: Reflectance = Reflectance::Constant([1.0; 3]);
const GLASS: (f32, f32) = (1.5, 1.0);

/// A builder: makes a scene use an effect.
type Builder = fn(&mut SceneDescription);

/// An effect and its scenes.
pub(crate) struct Row {
    /// The effect, one bit.
    pub(crate) effect: Effects,
    /// Scene without it.
    pub(crate) base: Base,
    /// The tracer with what the base calls for and the effect.
    pub(crate) instance: Instance,
    /// What makes the base use it, and nothing else that it has not; `None` if no scene can yet.
    pub(crate) used: Option<Builder>,
}

/// Gives the material of the left sphere in the built-in box, index 5, another model.
fn sphere(scene: &mut SceneDescription, model: Model) {
    let m = &mut scene.materials[5];
    (m.model, m.two_sided) = (model, !model.is_transmissive());
}

/// A texture on the floor, ceiling and back wall, which share material 0.
fn textured(scene: &mut SceneDescription) {
    let texels =
        (0..64 * 64u32).map(|i| if (i / 8 + i / 512) % 2 == 0 { [200, 190, 180, 255] } else { [60, 60, 90, 255] });
    scene.textures.push(Texture { name: "checks".into(), width: 64, height: 64, texels: texels.collect() });
    scene.vertices.iter_mut().for_each(|v| v.uv = [v.position[0], v.position[1] + v.position[2]]);
    scene.materials[0].model = Model::Diffuse { reflectance: Reflectance::Texture(0) };
}

macro_rules! rows {
    ($($effect:ident: $base:ident, $used:expr;)*) => {
        /// Every effect.
        pub(crate) const ROWS: &[Row] = &[$(Row {
            effect: Effects::$effect,
            base: Base::$base,
            instance: Instance::of::<Custom<{ Effects::$effect.0 | rows!(@$base).0 }>>(),
            used: $used,
        }),*];
    };
    (@Diffuse) => { DIFFUSE };
    (@Metal) => { METAL };
    (@Open) => { OPEN };
}

rows! {
    DIFFUSE: Metal, Some(|s| sphere(s, diffuse()));
    MIRROR: Diffuse, Some(|s| sphere(s, Model::Mirror { reflectance: WHITE }));
    CONDUCTOR: Diffuse, Some(|s| {
        let (eta, k) = ([1.65746, 0.880369, 0.521229], [9.22387, 6.26952, 4.837]);
        sphere(s, Model::Conductor { eta, k, reflectance: WHITE });
    });
    ROUGH_CONDUCTOR: Diffuse, Some(|s| sphere(s, metal(0.3)));
    DIELECTRIC: Diffuse, Some(|s| sphere(s, Model::Dielectric { int_ior: GLASS.0, ext_ior: GLASS.1 }));
    ROUGH_DIELECTRIC: Diffuse, Some(|s| {
        sphere(s, Model::RoughDielectric { int_ior: GLASS.0, ext_ior: GLASS.1, alpha: 0.3 });
    });
    THIN_DIELECTRIC: Diffuse, Some(|s| sphere(s, Model::ThinDielectric { int_ior: GLASS.0, ext_ior: GLASS.1 }));
    PLASTIC: Diffuse, Some(|s| {
        sphere(s, Model::Plastic { reflectance: WHITE, int_ior: GLASS.0, ext_ior: GLASS.1 });
    });
    ROUGH_PLASTIC: Diffuse, Some(|s| {
        sphere(s, Model::RoughPlastic { reflectance: WHITE, int_ior: GLASS.0, ext_ior: GLASS.1, alpha: 0.3 });
    });
    NULL: Diffuse, Some(|s| sphere(s, Model::Null));
    TEXTURES: Diffuse, Some(textured);
    AREA_LIGHTS: Open, Some(|s| s.emitters.push(Emitter::Area { material: 3, radiance: [17.0, 12.0, 4.0] }));
    ENVIRONMENT: Diffuse, Some(|s| s.environment = Some(builtin::sky()));
    CONSTANT: Diffuse, Some(|s| s.environment = Some(Environment::Constant { radiance: [1.0; 3] }));
    DELTA_LIGHTS: Diffuse, Some(|s| {
        s.emitters.push(Emitter::Point { position: [0.0, 1.7, 0.5], intensity: [1.0; 3] });
    });
    LENS: Diffuse, Some(|s| s.camera.lens = Some(ThinLens { radius: 0.05, focus_distance: 6.8 }));
    SMOOTH_NORMALS: Diffuse, Some(|s| s.triangles.iter_mut().skip(12).for_each(|t| t.smooth = true));
    MEDIA: Diffuse, None;
    GRID_MEDIA: Diffuse, None;
    ALPHA: Diffuse, None;
    MULTIPLE_SCATTERING: Diffuse, None;
}

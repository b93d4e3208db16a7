//! The table of effects: for each the scene that it is added to, and how.
//!
//! An effect that cannot be without another, such as a density grid without media, has a base with the other.

use super::instance::Instance;
use croupier::unstable::Effects;
use croupier::unstable::profile::Custom;
use croupier_benches::placed::place_metal_sphere;
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
    /// The same as `Diffuse`, with an index-matched left sphere.
    Boundary,
    /// The same as `Boundary`, the sphere full of fog.
    Fog,
    /// The same as `Diffuse`, with a texture on the left sphere and most walls.
    Textured,
    /// The same as `Textured`, with a principled left sphere.
    Principled,
    /// The same as `Diffuse`, with the left sphere in an instance.
    Instanced,
}

impl Base {
    /// Every base.
    pub(crate) const ALL: [Self; 8] = [
        Self::Diffuse,
        Self::Metal,
        Self::Open,
        Self::Boundary,
        Self::Fog,
        Self::Textured,
        Self::Principled,
        Self::Instanced,
    ];

    /// Name in tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse box",
            Self::Metal => "metal box",
            Self::Open => "open box",
            Self::Boundary => "boundary box",
            Self::Fog => "fog box",
            Self::Textured => "textured box",
            Self::Principled => "principled box",
            Self::Instanced => "instanced box",
        }
    }

    /// What the base calls for, and no more.
    const fn effects(self) -> Effects {
        match self {
            Self::Diffuse => Effects::DIFFUSE.with(Effects::AREA_LIGHTS),
            Self::Metal => Effects::ROUGH_CONDUCTOR.with(Effects::AREA_LIGHTS),
            Self::Open => Effects::DIFFUSE.with(Effects::CONSTANT),
            Self::Boundary => Self::Diffuse.effects().with(Effects::NULL),
            Self::Fog => Self::Boundary.effects().with(Effects::MEDIA),
            Self::Textured => Self::Diffuse.effects().with(Effects::TEXTURES),
            Self::Principled => Self::Textured.effects().with(Effects::PRINCIPLED),
            Self::Instanced => Self::Diffuse.effects().with(Effects::INSTANCES),
        }
    }

    /// The tracer of [`Self::effects`].
    pub(crate) const fn instance(self) -> Instance {
        match self {
            Self::Diffuse => Instance::of::<Custom<{ Base::Diffuse.effects().0 }>>(),
            Self::Metal => Instance::of::<Custom<{ Base::Metal.effects().0 }>>(),
            Self::Open => Instance::of::<Custom<{ Base::Open.effects().0 }>>(),
            Self::Boundary => Instance::of::<Custom<{ Base::Boundary.effects().0 }>>(),
            Self::Fog => Instance::of::<Custom<{ Base::Fog.effects().0 }>>(),
            Self::Textured => Instance::of::<Custom<{ Base::Textured.effects().0 }>>(),
            Self::Principled => Instance::of::<Custom<{ Base::Principled.effects().0 }>>(),
            Self::Instanced => Instance::of::<Custom<{ Base::Instanced.effects().0 }>>(),
        }
    }

    /// The scene.
    pub(crate) fn scene(self) -> SceneDescription {
        let mut scene = builtin::cornell_box();
        let model = if self == Self::Metal { metal(0.3) } else { diffuse() };
        scene.materials.iter_mut().for_each(|m| (m.model, m.two_sided) = (model, true));
        scene.triangles.iter_mut().for_each(|t| t.smooth = false);
        match self {
            Self::Diffuse | Self::Metal => (),
            Self::Open => {
                scene.emitters.clear();
                scene.environment = Some(Environment::Constant { radiance: [1.0; 3] });
            }
            Self::Boundary => sphere(&mut scene, Model::Null),
            Self::Fog => {
                sphere(&mut scene, Model::Null);
                fog(&mut scene, Density::Homogeneous);
            }
            Self::Textured => {
                textured(&mut scene);
                scene.materials[SPHERE].model = scene.materials[0].model;
            }
            Self::Principled => {
                textured(&mut scene);
                sphere(&mut scene, Model::Principled(layered()));
            }
            Self::Instanced => place_metal_sphere(&mut scene),
        }
        scene
    }
}

fn diffuse() -> Model {
    Model::Diffuse { reflectance: Reflectance::Constant([0.7; 3]) }
}

/// A material with a texture for the base colour.
fn layered() -> Principled {
    Principled { base_texture: Some(TextureRef::new(0)), ..Principled::default() }
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
    /// What makes the base use it, and nothing else that it has not.
    pub(crate) used: Builder,
}

/// Material of the left sphere in the built-in box.
const SPHERE: usize = 5;

/// Gives the material of the left sphere another model.
fn sphere(scene: &mut SceneDescription, model: Model) {
    let m = &mut scene.materials[SPHERE];
    (m.model, m.two_sided) = (model, !model.is_transmissive());
}

/// A texture on the floor, ceiling and back wall, which share material 0. Its alpha counts where a material says so.
fn textured(scene: &mut SceneDescription) {
    let texels =
        (0..64 * 64u32).map(|i| if (i / 8 + i / 512) % 2 == 0 { [200, 190, 180, 255] } else { [60, 60, 90, 0] });
    scene.textures.push(Texture {
        name: "checks".into(),
        width: 64,
        height: 64,
        texels: texels.collect(),
        ..Texture::default()
    });
    scene.vertices.iter_mut().for_each(|v| v.uv = [v.position[0], v.position[1] + v.position[2]]);
    scene.materials[0].model = Model::Diffuse { reflectance: Reflectance::Texture(0) };
}

/// Fills the left sphere with a medium of optical thickness 2 along its diameter, at density 1.
fn fog(scene: &mut SceneDescription, density: Density) {
    let coefficient = |c: f32| [c * 0.9, c, c * 1.1];
    let (sigma_a, sigma_s) = (coefficient(0.5), coefficient(2.0));
    scene.media = vec![Medium { name: "fog".into(), sigma_a, sigma_s, g: 0.3, density, ..Medium::default() }];
    scene.materials[SPHERE].medium = Some(0);
}

/// A grid of 16^3 cells around the left sphere, of mean density 1.
fn grid() -> Density {
    let wave = |i: u32| if i % 4 < 2 { 0.5 } else { 1.5 };
    let values = (0..16 * 16 * 16u32).map(|i| wave(i) * wave(i / 16) * wave(i / 256)).collect();
    Density::Grid { cells: [16; 3], bounds: [[-0.83, -0.01, -0.76], [-0.01, 0.81, 0.06]], values }
}

macro_rules! rows {
    ($($effect:ident: $base:ident, $used:expr;)*) => {
        /// Every effect.
        pub(crate) const ROWS: &[Row] = &[$(Row {
            effect: Effects::$effect,
            base: Base::$base,
            instance: Instance::of::<Custom<{ Effects::$effect.0 | Base::$base.effects().0 }>>(),
            used: $used,
        }),*];
    };
}

rows! {
    DIFFUSE: Metal, |s| sphere(s, diffuse());
    MIRROR: Diffuse, |s| sphere(s, Model::Mirror { reflectance: WHITE });
    CONDUCTOR: Diffuse, |s| {
        let (eta, k) = ([1.65746, 0.880369, 0.521229], [9.22387, 6.26952, 4.837]);
        sphere(s, Model::Conductor { eta, k, reflectance: WHITE });
    };
    ROUGH_CONDUCTOR: Diffuse, |s| sphere(s, metal(0.3));
    DIELECTRIC: Diffuse, |s| sphere(s, Model::Dielectric { int_ior: GLASS.0, ext_ior: GLASS.1 });
    ROUGH_DIELECTRIC: Diffuse, |s| {
        sphere(s, Model::RoughDielectric { int_ior: GLASS.0, ext_ior: GLASS.1, alpha: 0.3 });
    };
    THIN_DIELECTRIC: Diffuse, |s| sphere(s, Model::ThinDielectric { int_ior: GLASS.0, ext_ior: GLASS.1 });
    PLASTIC: Diffuse, |s| {
        sphere(s, Model::Plastic { reflectance: WHITE, int_ior: GLASS.0, ext_ior: GLASS.1 });
    };
    ROUGH_PLASTIC: Diffuse, |s| {
        sphere(s, Model::RoughPlastic { reflectance: WHITE, int_ior: GLASS.0, ext_ior: GLASS.1, alpha: 0.3 });
    };
    NULL: Diffuse, |s| sphere(s, Model::Null);
    PRINCIPLED: Diffuse, |s| sphere(s, Model::Principled(Principled::default()));
    TEXTURES: Diffuse, textured;
    AREA_LIGHTS: Open, |s| s.emitters.push(Emitter::Area { material: 3, radiance: [17.0, 12.0, 4.0] });
    ENVIRONMENT: Diffuse, |s| s.environment = Some(builtin::sky());
    CONSTANT: Diffuse, |s| s.environment = Some(Environment::Constant { radiance: [1.0; 3] });
    DELTA_LIGHTS: Diffuse, |s| {
        s.emitters.push(Emitter::Point { position: [0.0, 1.7, 0.5], intensity: [1.0; 3] });
    };
    SHAPE_LIGHTS: Open, |s| {
        let (shape, position) = (LightShape::Sphere { radius: 0.2 }, [0.0, 1.5, 0.5]);
        let radiance = [10.0; 3];
        s.emitters.push(Emitter::Shape(ShapeLight { shape, position, radiance, two_sided: false, visible: true }));
    };
    LENS: Diffuse, |s| s.camera.lens = Some(ThinLens { radius: 0.05, focus_distance: 6.8 });
    SMOOTH_NORMALS: Diffuse, |s| s.triangles.iter_mut().skip(12).for_each(|t| t.smooth = true);
    MEDIA: Boundary, |s| fog(s, Density::Homogeneous);
    GRID_MEDIA: Fog, |s| fog(s, grid());
    ALPHA: Textured, |s| s.materials[SPHERE].cutout = true;
    PROJECTIONS: Diffuse, |s| s.camera.projection = Projection::Orthographic { height: 2.4 };
    MULTIPLE_SCATTERING: Metal, |s| s.materials.iter_mut().for_each(|m| m.compensated = true);
    NORMAL_MAPS: Principled, |s| {
        let texels = (0..64 * 64).map(|i: u32| [100 + (i % 56) as u8, 100 + (i / 64 % 56) as u8, 250, 255]).collect();
        let bumps = Texture { name: "bumps".into(), width: 64, height: 64, texels, ..Texture::default() };
        s.textures.push(Texture { encoding: Encoding::Linear, ..bumps });
        sphere(s, Model::Principled(Principled { normal_texture: Some(TextureRef::new(1)), ..layered() }));
    };
    INSTANCES: Diffuse, place_metal_sphere;
    MOTION: Instanced, |s| {
        let place = &mut s.instances[0];
        let mut end = place.to_world;
        end[1][3] = 0.1;
        place.to_world_end = Some(end);
    };
}

//! A scene as plain values, before baking: what files are read into, and what a host program can fill in by hand.
//!
//! World space is right-handed; lengths have one unit throughout. Colours are linear Rec. 709. A triangle's front is
//! the side from which its vertices run counter-clockwise.
//!
//! ```
//! use croupier_host::bake::{BakeOptions, bake};
//! use croupier_host::description::*;
//!
//! let mut scene = SceneDescription::default();
//! let grey = scene.add_material("grey", Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) });
//! let floor = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
//! let floor = floor.map(|position| Vertex { position, ..Vertex::default() });
//! scene.add_mesh("floor", grey, &floor, &[[0, 1, 2], [0, 2, 3]], false);
//! scene.emitters.push(Emitter::Point { position: [0.0, 2.0, 0.0], intensity: [1.0; 3] });
//! scene.camera = Camera { origin: [0.0, 1.0, 4.0], target: [0.0, 0.0, 0.0], ..Camera::default() };
//!
//! let baked = bake(&scene, &BakeOptions::default(), |_stage, _fraction| {})?;
//! assert_eq!(baked.report.triangles, 2);
//! assert!(croupier::Scene::from_bytes(&baked.bytes).is_ok());
//! # Ok::<(), croupier_host::bake::BakeError>(())
//! ```

mod principled;

pub use principled::{Principled, TextureRef};

use croupier::unstable::scene::blob::MaterialKind;

/// A whole scene. Indices are positions in the `Vec`s here.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// Vertices of all objects.
    pub vertices: Vec<Vertex>,
    /// Triangles of all objects.
    pub triangles: Vec<Triangle>,
    /// Names of runs of triangles, by ascending `first_triangle`, for messages and for the auxiliary value `object`.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Decoded textures.
    pub textures: Vec<Texture>,
    /// Participating media. Where the insides of several overlap, the first of them is there alone.
    pub media: Vec<Medium>,
    /// Lights, except the one at infinity all around.
    pub emitters: Vec<Emitter>,
    /// Environment of the scene; `None` is black.
    pub environment: Option<Environment>,
    /// Camera that renders.
    pub camera: Camera,
    /// Further cameras of the file, to be chosen by name; the blob holds `camera` alone.
    pub cameras: Vec<NamedCamera>,
    /// Path segments from the camera: 1 sees emitters only, 2 adds direct light.
    pub max_depth: u32,
    /// Groups of triangles and instances that are in the world through instances only.
    pub prototypes: Vec<Prototype>,
    /// Instances in the world.
    pub instances: Vec<Instance>,
}

/// A group that instances place in the world as often as they like. Its vertices are in its own space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prototype {
    /// Name in messages and scene files.
    pub name: String,
    /// Its triangles, which are not in the world themselves; runs of different prototypes share no triangle.
    pub triangles: std::ops::Range<u32>,
    /// Instances of other prototypes, relative to its own space. Those may have triangles, but no instances in turn.
    pub instances: Vec<Instance>,
}

/// A placement of a prototype.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Name in messages and scene files.
    pub name: String,
    /// Index of the prototype.
    pub prototype: u32,
    /// Rows of the affine map from the prototype's space to the space around the instance, when the shutter opens.
    /// Mirrored and sheared maps will do, singular ones not.
    pub to_world: [[f32; 4]; 3],
    /// The map when the shutter closes; entries change linearly in between. `None`: it does not move.
    pub to_world_end: Option<[[f32; 4]; 3]>,
    /// Rays meet it. An invisible one is as good as absent until an edit of the blob shows it.
    pub visible: bool,
}

impl Instance {
    /// A visible instance that does not move.
    pub fn new(name: &str, prototype: u32, to_world: [[f32; 4]; 3]) -> Self {
        Self { name: name.into(), prototype, to_world, to_world_end: None, visible: true }
    }
}

/// One corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// World space.
    pub position: [f32; 3],
    /// World space, of any length; read where the triangle is smooth.
    pub normal: [f32; 3],
    /// Texture coordinates, v upwards.
    pub uv: [f32; 2],
}

/// One triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Vertex indices, counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// Material index.
    pub material: u32,
    /// Shade with the interpolated vertex normals.
    pub smooth: bool,
}

/// A named run of triangles, up to the next object's first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Name.
    pub name: String,
    /// First triangle.
    pub first_triangle: u32,
}

/// A named material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in messages and scene files.
    pub name: String,
    /// Both sides behave like the front; else the back of an opaque surface is black. Ignored by dielectrics and
    /// `Null`.
    pub two_sided: bool,
    /// Scattering model.
    pub model: Model,
    /// Index of the medium behind the front sides of the material's triangles; all triangles in front of one medium
    /// together must be closed.
    pub medium: Option<u32>,
    /// The texture's alpha is the share of light that meets the surface, the rest passes straight on. Ignored without a
    /// texture, and where the texture is opaque.
    pub cutout: bool,
    /// A rough model gives back what single scattering between its microfacets loses. Ignored by smooth models.
    pub compensated: bool,
}

impl Material {
    /// A material without medium, cut-outs and compensation, two-sided unless light passes it.
    pub fn new(name: &str, model: Model) -> Self {
        let two_sided = !model.is_transmissive();
        Self { name: name.into(), two_sided, model, medium: None, cutout: false, compensated: false }
    }
}

/// What fills the inside of a closed boundary. Coefficients are per unit length at density 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Medium {
    /// Name in messages and scene files.
    pub name: String,
    /// Absorption coefficient.
    pub sigma_a: [f32; 3],
    /// Scattering coefficient.
    pub sigma_s: [f32; 3],
    /// Emitted radiance: the source per unit length is `sigma_a * emission * density`.
    pub emission: [f32; 3],
    /// Mean cosine of the Henyey-Greenstein phase function, positive forwards.
    pub g: f32,
    /// Density by position.
    pub density: Density,
}

/// Density of a medium.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Density {
    /// 1 everywhere inside.
    #[default]
    Homogeneous,
    /// Values at the centres of the cells of a box, trilinear between them, clamped towards its sides; 0 outside.
    Grid {
        /// Cells along x, y, z.
        cells: [u32; 3],
        /// Smallest and largest corner, world space.
        bounds: [[f32; 3]; 2],
        /// Cell (x, y, z) is value `(z * cells[1] + y) * cells[0] + x`.
        values: Vec<f32>,
    },
}

/// Diffuse albedo, or scale of a specular reflection; 0 to 1 per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflectance {
    /// Constant colour.
    Constant([f32; 3]),
    /// Index of a texture.
    Texture(u32),
}

/// Parameters that a model has, by their keys in scene files; see the core's `bsdf` for the formulas and
/// [`Parameter`](croupier::unstable::scene::blob::Parameter) for the ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModelParameters {
    /// Diffuse albedo, or scale of a specular reflection.
    pub reflectance: Option<Reflectance>,
    /// Real refractive index of a conductor per channel.
    pub eta: Option<[f32; 3]>,
    /// Extinction of a conductor per channel.
    pub k: Option<[f32; 3]>,
    /// Refractive index behind the front side.
    pub int_ior: Option<f32>,
    /// Refractive index before the front side.
    pub ext_ior: Option<f32>,
    /// GGX width.
    pub alpha: Option<f32>,
    /// Everything of a principled material.
    pub principled: Option<Principled>,
}

/// Source of a model's parameters, such as an object of a scene file.
pub trait ParameterSource {
    /// Error of a parameter that is missing or of another type.
    type Error;
    /// `reflectance`.
    fn reflectance(&mut self) -> Result<Reflectance, Self::Error>;
    /// `eta`.
    fn eta(&mut self) -> Result<[f32; 3], Self::Error>;
    /// `k`.
    fn k(&mut self) -> Result<[f32; 3], Self::Error>;
    /// `int_ior`.
    fn int_ior(&mut self) -> Result<f32, Self::Error>;
    /// `ext_ior`.
    fn ext_ior(&mut self) -> Result<f32, Self::Error>;
    /// `alpha`.
    fn alpha(&mut self) -> Result<f32, Self::Error>;
    /// The keys of a principled material, each with a default.
    fn principled(&mut self) -> Result<Principled, Self::Error>;
}

macro_rules! models {
    ($($(#[$doc:meta])* $kind:ident $({ $($parameter:ident: $type:ty),* })? $(($whole:ident: $all:ty))?;)*) => {
        /// Scattering models; their parameters are those of [`ModelParameters`], present.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[expect(missing_docs, reason = "the fields are described at `ModelParameters`, their formulas in the core")]
        #[expect(clippy::large_enum_variant, reason = "models are copied while a scene is loaded, and never in a loop")]
        pub enum Model { $($(#[$doc])* $kind $({ $($parameter: $type),* })? $(($all))?),* }

        impl Model {
            /// Kind of material in the blob.
            pub const fn kind(&self) -> MaterialKind {
                match self { $(Self::$kind { .. } => MaterialKind::$kind),* }
            }

            /// Parameters of the model.
            pub fn parameters(&self) -> ModelParameters {
                match *self {
                    $(Self::$kind $({ $($parameter),* })? $(($whole))? => ModelParameters {
                        $($($parameter: Some($parameter),)*)? $($whole: Some($whole),)?
                        ..ModelParameters::default()
                    }),*
                }
            }

            /// The model of a kind with the parameters that `source` gives.
            pub fn from_source<S: ParameterSource>(kind: MaterialKind, source: &mut S) -> Result<Self, S::Error> {
                match kind {
                    $(MaterialKind::$kind =>
                        Ok(Self::$kind $({ $($parameter: source.$parameter()?),* })? $((source.$whole()?))?)),*
                }
            }
        }
    };
}

models! {
    /// Lambertian.
    Diffuse { reflectance: Reflectance };
    /// Perfect mirror without Fresnel.
    Mirror { reflectance: Reflectance };
    /// Smooth conductor.
    Conductor { eta: [f32; 3], k: [f32; 3], reflectance: Reflectance };
    /// GGX conductor.
    RoughConductor { eta: [f32; 3], k: [f32; 3], reflectance: Reflectance, alpha: f32 };
    /// Smooth interface.
    Dielectric { int_ior: f32, ext_ior: f32 };
    /// GGX interface.
    RoughDielectric { int_ior: f32, ext_ior: f32, alpha: f32 };
    /// Thin sheet.
    ThinDielectric { int_ior: f32, ext_ior: f32 };
    /// Smooth coat over a diffuse base.
    Plastic { reflectance: Reflectance, int_ior: f32, ext_ior: f32 };
    /// GGX coat over a diffuse base.
    RoughPlastic { reflectance: Reflectance, int_ior: f32, ext_ior: f32, alpha: f32 };
    /// Index-matched boundary: light passes unchanged.
    Null;
    /// A host's own model: black unless the session has an extension with one.
    Own { reflectance: Reflectance, alpha: f32 };
    /// Layers of sheen, coat, metal, dielectric, transmission and a diffuse base.
    Principled(principled: Principled);
}

/// What the texels of a texture stand for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Colours, sRGB-encoded.
    #[default]
    Srgb,
    /// Numbers from 0 to 1.
    Linear,
}

/// Texels beyond the edges of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// Those at the edge.
    Clamp,
    /// The texture, mirrored at the edge.
    Mirror,
}

/// An 8-bit image; bilinear.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// Name or path, for messages.
    pub name: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` texels r, g, b, a; row 0 is the top (v = 1). Alpha is read by cut-outs only.
    pub texels: Vec<[u8; 4]>,
    /// Encoding of red, green and blue; alpha is linear.
    pub encoding: Encoding,
    /// Along u and v.
    pub wrap: [Wrap; 2],
}

/// A light of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Emitter {
    /// Every triangle of the material emits from its front; it also keeps its scattering.
    Area {
        /// Material index; at most one emitter for each.
        material: u32,
        /// Radiance.
        radiance: [f32; 3],
    },
    /// Isotropic point.
    Point {
        /// World space.
        position: [f32; 3],
        /// Radiant intensity, power per steradian.
        intensity: [f32; 3],
    },
    /// Parallel light from infinity.
    Directional {
        /// Direction in which the light travels, of any length but 0.
        direction: [f32; 3],
        /// Irradiance of a surface that faces the light.
        irradiance: [f32; 3],
    },
    /// Parallel light with the spread of a distant disk. Shadows have soft edges; smooth surfaces do not mirror it.
    Sun {
        /// Direction in which the light of the disk's middle travels, of any length but 0.
        direction: [f32; 3],
        /// Irradiance of a surface that faces the light.
        irradiance: [f32; 3],
        /// Angular diameter, degrees, 0.01 to 90; 0.53 for the sun.
        angle_deg: f32,
    },
    /// Point that shines into a cone. At the angle t from the axis it has `intensity * f^2`, with
    /// `f = (cos t - cos outer) / (cos inner - cos outer)` clamped to 0..=1: full inside the inner cone, nothing
    /// outside the outer one (the falloff of glTF's KHR_lights_punctual).
    Spot {
        /// World space.
        position: [f32; 3],
        /// Axis, along which the light travels, of any length but 0.
        direction: [f32; 3],
        /// Radiant intensity on the axis, power per steradian.
        intensity: [f32; 3],
        /// Half angle of the inner cone, degrees, from 0 to `outer_deg`.
        inner_deg: f32,
        /// Half angle of the outer cone, degrees, 0.01 to 180.
        outer_deg: f32,
    },
    /// A sphere, rectangle or disk of its own, without triangles.
    Shape(ShapeLight),
}

/// A light with a shape of its own. Rays that meet it take its radiance along and go on: it hides nothing. At most
/// [`MAX_SHAPE_LIGHTS`](croupier::unstable::scene::blob::MAX_SHAPE_LIGHTS) of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeLight {
    /// What it looks like.
    pub shape: LightShape,
    /// Middle, world space.
    pub position: [f32; 3],
    /// Radiance.
    pub radiance: [f32; 3],
    /// A rectangle or disk emits from its back, too; a sphere also to its inside.
    pub two_sided: bool,
    /// Do camera rays see it?
    pub visible: bool,
}

/// Shape of a [`ShapeLight`]. Lengths are from 2e-9 (edges) or 1e-9 (radii) to 1e9.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightShape {
    /// A sphere that emits to its outside.
    Sphere {
        /// Radius, world units.
        radius: f32,
    },
    /// A rectangle that emits to the side where the cross product of its edges points.
    Rectangle {
        /// Two edges from one corner, perpendicular to 1e-3; whole lengths, world units.
        edges: [[f32; 3]; 2],
    },
    /// A disk that emits from one side.
    Disk {
        /// Direction in which it faces, of any length but 0.
        direction: [f32; 3],
        /// Radius, world units.
        radius: f32,
    },
}

/// Light from infinity, all around.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// Constant radiance from all directions.
    Constant {
        /// Radiance.
        radiance: [f32; 3],
    },
    /// Latitude-longitude map. For a direction d in map space, u = atan2(d.x, -d.z) / 2 pi wrapped to [0, 1),
    /// v = acos(d.y) / pi; column position u * width - 0.5 (wraps), row position v * (height - 1).
    Map {
        /// Columns.
        width: u32,
        /// Rows, at least 2; row 0 is exactly +Y, the last exactly -Y.
        height: u32,
        /// Radiance, row 0 first.
        texels: Vec<[f32; 3]>,
        /// Factor on every texel.
        scale: [f32; 3],
        /// Rows of the rotation map space -> world.
        to_world: [[f32; 3]; 3],
    },
}

/// How a camera maps directions and places to the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Projection {
    /// Pinhole or thin lens, with [`Camera::vfov_deg`].
    #[default]
    Perspective,
    /// Parallel rays along the viewing axis.
    Orthographic {
        /// Height of the image, world units.
        height: f32,
    },
    /// Every direction around `origin`, latitude by longitude: the image's middle is the viewing axis, its left and
    /// right edges lie behind, its rows are equal steps from `up` to down.
    Panoramic,
}

/// A camera by its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// Name in the file.
    pub name: String,
    /// Camera.
    pub camera: Camera,
}

/// Camera; image right is cross(target - origin, up).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Projection to the image.
    pub projection: Projection,
    /// World space. `f64` here and in `target`, so that their difference is precise far from the origin.
    pub origin: [f64; 3],
    /// A point on the viewing axis.
    pub target: [f64; 3],
    /// Upwards, not parallel to the axis.
    pub up: [f64; 3],
    /// Full vertical field of view, degrees, between 0 and 180; read by the perspective projection alone.
    pub vfov_deg: f64,
    /// Columns and rows.
    pub size: [u32; 2],
    /// `None` is a pinhole; `None` for other projections than perspective.
    pub lens: Option<ThinLens>,
}

/// A lens that blurs what is out of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// Radius.
    pub radius: f32,
    /// Distance of the plane in focus along the viewing axis.
    pub focus_distance: f32,
}

impl Default for Camera {
    /// At (0, 0, 5), looking at the origin, 45 degrees, 512 x 512 pixels.
    fn default() -> Self {
        Self {
            projection: Projection::Perspective,
            origin: [0.0, 0.0, 5.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            vfov_deg: 45.0,
            size: [512, 512],
            lens: None,
        }
    }
}

impl Model {
    /// Whether light passes the surface.
    pub const fn is_transmissive(&self) -> bool {
        match self {
            Self::Principled(p) => p.transmission > 0.0,
            _ => self.kind().facts().transmissive,
        }
    }
}

impl Default for SceneDescription {
    /// Empty black scene, seen by the default camera; at most 40 path segments.
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            objects: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
            media: Vec::new(),
            emitters: Vec::new(),
            environment: None,
            camera: Camera::default(),
            cameras: Vec::new(),
            max_depth: 40,
            prototypes: Vec::new(),
            instances: Vec::new(),
        }
    }
}

impl SceneDescription {
    /// Adds a material, two-sided unless light passes it and not compensated; returns its index.
    pub fn add_material(&mut self, name: &str, model: Model) -> u32 {
        self.materials.push(Material::new(name, model));
        (self.materials.len() - 1) as u32
    }

    /// Adds an object: `triangles` index `vertices`, both of this object alone.
    pub fn add_mesh(&mut self, name: &str, material: u32, vertices: &[Vertex], triangles: &[[u32; 3]], smooth: bool) {
        let base = self.vertices.len() as u32;
        self.objects.push(Object { name: name.into(), first_triangle: self.triangles.len() as u32 });
        self.vertices.extend_from_slice(vertices);
        let shifted = triangles.iter().map(|t| t.map(|v| v.saturating_add(base)));
        self.triangles.extend(shifted.map(|vertices| Triangle { vertices, material, smooth }));
    }

    /// Name of the object that a triangle belongs to.
    pub fn object_of(&self, triangle: u32) -> &str {
        self.objects.get(self.object_number(triangle) as usize).map_or("unnamed object", |o| &o.name)
    }

    /// Index in `objects` of the object that a triangle belongs to; their number if it is before the first of them.
    pub fn object_number(&self, triangle: u32) -> u32 {
        let next = self.objects.partition_point(|o| o.first_triangle <= triangle);
        next.checked_sub(1).unwrap_or(self.objects.len()) as u32
    }

    /// Smallest and largest coordinates of the vertices that triangles use; `None` without triangles.
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let corners = self.triangles.iter().flat_map(|t| t.vertices);
        let points = corners.filter_map(|v| self.vertices.get(v as usize)).map(|v| v.position);
        points.map(|p| [p, p]).reduce(|[lo, hi], [p, _]| {
            [std::array::from_fn(|i| lo[i].min(p[i])), std::array::from_fn(|i| hi[i].max(p[i]))]
        })
    }
}

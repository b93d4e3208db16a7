//! Scenes from arrays, in the caller's memory: what baking does for hosts that bring triangles at run time and have
//! neither
//! files nor an allocator.
//!
//! | file | holds |
//! |---|---|
//! | `parts` | [`SceneParts`]: the arrays |
//! | `assemble` | their checks, and the order in which the blob is written |
//! | `draft` | a blob in the making |
//! | `geometry` | areas and normals |
//! | `materials` | what follows from the parameters of materials |
//! | `microfacet` | tables of plastics |
//! | `lat_long` | sampling tables of environment maps |
//! | `light_source`, `view` | records of lights and cameras from the numbers that people use |
//! | `math` | functions in f64 that `core` lacks |

mod assemble;
mod draft;
mod error;
mod geometry;
mod lat_long;
mod light_source;
mod materials;
mod math;
mod microfacet;
mod parts;
mod view;

pub use error::{ComposeError, FieldError, PerRecord};
pub use geometry::{area, has_area, vertex_normal};
pub use lat_long::LatLong;
pub use light_source::{LightSource, MIN_CONE_DEG, Sides};
pub use math::{Math, Portable};
pub use microfacet::{
    Facet, RoughPlasticTable, diffuse_fresnel_inside, fresnel, gauss_legendre, rough_plastic, visible,
};
pub use parts::{ComposeLayout, SceneParts, Surround};
pub use view::View;

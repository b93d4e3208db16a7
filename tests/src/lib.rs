//! Scalar f64 oracles and statistics shared by the integration tests.

pub mod allocator;
pub mod arrays;
pub mod blob;
pub mod bsdf;
pub mod cache;
pub mod documents;
pub mod embedding;
pub mod environment;
pub mod exchange;
pub mod furnace;
pub mod geometry;
pub mod gltf;
pub mod hard;
pub mod hit;
pub mod imports;
pub mod jacobian;
pub mod light_oracle;
pub mod light_scene;
pub mod loading;
pub mod many_lights;
pub mod math;
pub mod media_flights;
pub mod media_oracle;
pub mod media_scene;
pub mod minimum;
pub mod model;
pub mod placed;
pub mod principled;
pub mod quadrature;
mod records;
pub mod replay;
pub mod runner;
pub mod samples;
pub mod scenes;
mod source;
pub mod stats;
pub mod texture_oracle;
pub mod walk;

/// The README's Rust code, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

/// The Rust code for those who come from Embree, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../docs/FROM_EMBREE.md")]
struct FromEmbree;

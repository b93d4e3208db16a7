//! Scalar f64 oracles and statistics shared by the integration tests.

pub mod geometry;
pub mod light_oracle;
pub mod light_scene;
pub mod light_stats;
pub mod texture_oracle;
pub mod blob;
pub mod walk;
pub mod bsdf;
pub mod quadrature;
pub mod stats;
pub mod math;

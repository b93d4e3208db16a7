//! Scalar f64 oracles and statistics shared by the integration tests.

pub mod bsdf;
pub mod quadrature;
pub mod stats;

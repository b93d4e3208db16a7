//! Scalar f64 oracles and statistics shared by the integration tests.

pub mod math;

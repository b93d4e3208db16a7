//! What the benchmarks share: scenes with their references, CPU time, medians.

pub mod clock;
pub mod stats;
pub mod subject;

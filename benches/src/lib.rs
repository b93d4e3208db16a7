//! What the benchmarks share: scenes with their references, CPU time, watched renders, medians.

pub mod clock;
pub mod measure;
pub mod stats;
pub mod subject;
pub mod variant;

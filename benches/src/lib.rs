//! What the benchmarks share: scenes with their references, CPU time, counted instructions, watched renders, medians,
//! generated results, and the check of the figures that documents cite from them.

pub mod callgrind;
pub mod clock;
pub mod exit;
pub mod figures;
pub mod measure;
pub mod micro;
pub mod placed;
pub mod provenance;
pub mod results;
pub mod serial;
pub mod stats;
pub mod subject;
pub mod variant;

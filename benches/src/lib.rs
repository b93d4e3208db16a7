//! What the benchmarks share: scenes with their references, CPU time, counted instructions, watched renders, hard
//! cases, medians, work in parts, generated results, and the check of the figures that documents cite from them.

pub mod callgrind;
pub mod clock;
pub mod exit;
pub mod figures;
pub mod hard;
pub mod measure;
pub mod micro;
pub mod parts;
pub mod placed;
pub mod provenance;
pub mod results;
pub mod serial;
pub mod stats;
pub mod subject;
pub mod twins;
pub mod variant;

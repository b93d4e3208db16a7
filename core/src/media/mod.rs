//! Participating media: where a path collides, and what passes. Kernels over eight lanes, each a medium and a straight
//! segment of its own; which medium a path is in, boundaries and phase functions are not known here.
//!
//! | file | what |
//! |---|---|
//! | `segment.rs` | the arguments and results |
//! | `coefficients.rs` | the media of eight lanes |
//! | `density.rs` | densities of grids |
//! | `majorants.rs` | the walk through the bricks of majorants |
//! | `collision.rs` | the choice at a tentative collision |
//! | `grid.rs` | delta and ratio tracking through grids |
//! | `tracking.rs` | [`fly`] and [`transmittance`]: homogeneous media, and the way to the grids |

mod coefficients;
mod collision;
mod density;
mod grid;
mod majorants;
mod segment;
mod tracking;

pub use density::{Grids8, density};
pub use majorants::BrickWalk8;
pub use segment::{Flight8, Passage8, Segment8, Span8};
pub use tracking::{fly, transmittance};

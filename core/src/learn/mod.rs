//! What paths have taught so far: statistics by place and direction, from which strategies take their factors.
//!
//! This layer knows places, directions, values and costs. It must not know materials, lights or how paths are traced.
//! Statistics change efficiency only: whatever they hold, no estimate's mean moves.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

mod bins;
pub mod cache;
mod save;
mod training;
mod tree;

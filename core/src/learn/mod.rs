//! Statistics learned from paths: by position and direction ([`cache`]), an estimate of every pixel, and variance and
//! cost of the picture. They are frozen while an iteration runs and change when it ends.
//!
//! This layer knows positions, directions, values and costs. It must not know materials, lights or how paths are
//! traced. Statistics change efficiency only: whatever their values, all estimators stay unbiased.
//!
//! How it works as a whole, where it departs from the papers, and what is not done: docs/LEARNING.md.

mod adaptive;
pub mod cache;
mod estimate;
pub mod guiding;
mod learned_state;
mod needs;
mod picture;
pub mod saved;
mod settings;

pub(crate) use learned_state::LearnedScalars;
pub use learned_state::LearnedState;
pub(crate) use needs::Needs;
pub use picture::PictureStatistics;
pub use settings::{ControlVariate, Guiding, Learning, Objective, PixelEstimator};

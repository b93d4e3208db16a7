//! Files, trees and threads around the croupier core.

pub mod compare;
pub mod flip;
pub mod image;
pub mod render;
pub mod tonemap;

//! Files, trees and threads around the croupier core.

pub mod alias;
pub mod environment;
pub mod bvh;
pub mod compare;
pub mod flip;
pub mod image;
pub mod render;
pub mod tonemap;
pub mod microfacet;

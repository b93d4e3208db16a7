//! Files, trees and threads around the croupier core.

pub mod alias;
pub mod environment;
pub mod bvh;

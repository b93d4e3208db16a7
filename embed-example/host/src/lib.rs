//! Files, trees and threads around the croupier core.

pub mod microfacet;

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
//!
//! | module | does | must not know |
//! |---|---|---|
//! | [`description`] | a scene as plain values | files, blobs |
//! | [`load`] | files -> description | blobs |
//! | [`builtin`] | a description without files | blobs |
//! | [`bake`] | description -> scene blob | files |
//! | [`blob`] | the blob's layout on disk and in memory | what sections mean |

pub mod bake;
pub mod blob;
pub mod builtin;
pub mod description;
pub mod load;

// Until the modules of these names are merged.
mod standin;
use standin::{alias, bvh, environment, limits, microfacet};

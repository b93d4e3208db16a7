//! Files, trees and threads around the croupier core.
//!
//! | module | does | must not know |
//! |---|---|---|
//! | [`description`] | a scene as plain values | files, blobs |
//! | [`load`] | files -> description | blobs |
//! | [`look`] | camera, light, ground and exposure that files leave open | files, blobs |
//! | [`builtin`] | a description without files | blobs |
//! | [`bake`] | description -> scene blob, with [`bvh`], [`alias`], [`environment`], [`microfacet`], [`principled`] | files |
//! | [`blob`] | the blob's layout on disk and in memory | what sections mean |
//! | [`effects`] | reasons for a scene's effects | files |
//! | [`drive`] | memory, threads, iterations around the core | files |
//! | [`checkpoint`] | files that a render goes on from | how light is transported |
//! | [`part`] | files with parts of a picture, and their sum | how light is transported |
//! | [`render`] | options in, pictures with layers out | how light is transported |
//! | [`lightmap`], [`probes`] | irradiance of surfaces texel by texel, radiance at points as spherical harmonics | files |
//! | [`memory`] | bytes of a render against those of the machine | files of scenes |
//! | [`statistics`] | figures of a render as tables | files |
//! | [`image`], [`tonemap`], [`false_color`] | EXR and PNG | scenes |
//! | [`compare`], [`flip`] | how far two pictures differ | scenes |
//! | [`text`] | quoted input, numbers and sizes in messages | scenes |

pub mod alias;
pub mod bake;
pub mod blob;
pub mod builtin;
pub mod bvh;
pub mod checkpoint;
pub mod compare;
pub mod compensation;
mod cryptomatte;
pub mod description;
pub mod drive;
pub mod effects;
pub mod environment;
pub mod false_color;
pub mod flip;
pub mod image;
pub mod lightmap;
pub mod load;
pub mod look;
pub mod memory;
pub mod microfacet;
pub mod part;
pub mod principled;
pub mod probes;
pub mod render;
pub mod renderer;
mod sides;
pub mod statistics;
pub mod text;
pub mod tonemap;

//! The C interface of croupier. The header is `include/croupier.h`, the manual `docs/C.md`.
//!
//! The functions are what C sees: each checks its pointers, takes the locks of its objects, calls the crate
//! `croupier`, and turns what that says into a status and a message. All memory is the caller's; there are no globals,
//! no threads, no panics.
//!
//! # The caller's promise
//!
//! Functions are unsafe for one reason, which is the same everywhere: **pointers that are neither null nor misaligned point
//! to memory that may be read** (`const`) **or written, for as many bytes as the function's documentation says**, and no
//! other thread writes there meanwhile unless the documentation allows it. Memory handed over with an object (a scene's
//! blob, blocks of sessions and shards) stays the object's until it is destroyed or suspended. Blocks may hold anything: bytes
//! behind a pointer from C count as initialised. SAFETY comments call this *the caller's promise*.
//!
//! What a caller can break without breaking the promise is answered with a status: null and misaligned pointers, too
//! little memory, handles of other objects, of moved, destroyed or suspended ones, calls that would race with one
//! another, shards of other plans, numbers out of range.
//!
//! | file | holds |
//! |---|---|
//! | `status` | status codes and their texts |
//! | `fault` | what goes wrong, and how it becomes a status and a message |
//! | `guarded` | objects in the caller's memory: marks and locks |
//! | `memory` | pointers of the caller as slices, texts and versioned structs |
//! | `records` | the structs of the header |
//! | `parts` | callbacks: intersectors, ray sources |
//! | `kernels` | the kernels that callbacks choose |
//! | `version`, `settings`, `plan`, `compose`, `scene`, `edit`, `session`, `picture`, `learned`, `schedule`, `shard`, `exchange` | the functions |
#![no_std]
#![deny(clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_used)]
#![deny(clippy::indexing_slicing, clippy::arithmetic_side_effects)]
#![expect(non_camel_case_types, reason = "types have the names that C sees")]
#![expect(clippy::missing_safety_doc, reason = "one promise for all functions: see the documentation of the crate")]

// in the order of the header
mod version;

mod status;

mod fault;

mod guarded;

mod memory;

mod records;

mod scene;

mod edit;

mod compose;

mod settings;

mod plan;

mod session;

mod schedule;

mod shard;

mod picture;

mod learned;

mod exchange;

mod parts;

mod kernels;

pub use compose::*;
pub use edit::*;
pub use exchange::*;
pub use fault::croupier_message;
pub use learned::*;
pub use parts::*;
pub use picture::*;
pub use plan::*;
pub use records::*;
pub use scene::*;
pub use schedule::*;
pub use session::*;
pub use settings::*;
pub use shard::*;
pub use status::*;
pub use version::*;

//! Status codes. Numbers are never used again for something else.

use core::ffi::c_char;

/// What became of a call. Functions that return a status have done nothing unless it is CROUPIER_OK, or their
/// documentation says otherwise. Later versions may return numbers that are not listed here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum croupier_status {
    /// Done.
    CROUPIER_OK = 0,
    /// A pointer is null that must not be.
    CROUPIER_NULL = 1,
    /// A pointer is not a multiple of what its type or documentation asks for.
    CROUPIER_MISALIGNED = 2,
    /// A block of memory or a buffer is too small, or an array has another length than it must have.
    CROUPIER_SIZE = 3,
    /// The member struct_size is not that of any version of the struct.
    CROUPIER_STRUCT_SIZE = 4,
    /// A pointer does not point to an object of its type: never initialised, overwritten, or moved.
    CROUPIER_NO_OBJECT = 5,
    /// The object was destroyed or suspended.
    CROUPIER_DESTROYED = 6,
    /// The object is in use by a call that excludes this one: on another thread, or one whose callback makes this call.
    CROUPIER_BUSY = 7,
    /// Blocks of memory overlap that must not.
    CROUPIER_OVERLAP = 8,
    /// The processor lacks instructions that the library uses.
    CROUPIER_INSTRUCTIONS = 9,
    /// An index, a name or a number that names nothing, or is out of its range.
    CROUPIER_RANGE = 10,
    /// A text is not UTF-8, or longer than 4096 bytes.
    CROUPIER_TEXT = 11,
    /// The bytes are no valid scene.
    CROUPIER_SCENE = 12,
    /// The settings, alone or together, cannot be used.
    CROUPIER_SETTINGS = 13,
    /// An edit of the scene that breaks a rule of scenes.
    CROUPIER_EDIT = 14,
    /// An edit of the scene that only baking it anew can make.
    CROUPIER_EDIT_FIXED = 15,
    /// The scene is not in the state that the session was started or changed for: croupier_session_change_scene.
    CROUPIER_SCENE_CHANGED = 16,
    /// Scene or settings need a part that the library does not have, such as a scattering model of the host's own.
    CROUPIER_EFFECTS = 17,
    /// Session and shard, or session and saved bytes, are of different plans.
    CROUPIER_PLAN = 18,
    /// No iteration has begun, or one is under way that must not be.
    CROUPIER_ITERATION = 19,
    /// A shard has not finished the iteration.
    CROUPIER_UNFINISHED = 20,
    /// Not all shards of the plan in order.
    CROUPIER_SHARDS = 21,
    /// The block does not hold a suspended session or shard of this plan.
    CROUPIER_NOT_SUSPENDED = 22,
    /// The settings did not ask for it, or it is not there before the end of the first iteration.
    CROUPIER_ABSENT = 23,
    /// Saved bytes that are damaged, or of another version, scene or setting.
    CROUPIER_SAVED = 24,
    /// Arrays that make no scene.
    CROUPIER_COMPOSE = 25,
}

use croupier_status::*;

/// Texts with the zero byte that C wants.
const TEXTS: [&str; 26] = [
    "done\0",
    "a pointer is null\0",
    "a pointer is misaligned\0",
    "wrong size\0",
    "struct_size is that of no version of the struct\0",
    "no such object there\0",
    "the object was destroyed or suspended\0",
    "the object is in use by another call\0",
    "blocks of memory overlap\0",
    "the processor lacks instructions that the library uses\0",
    "index, name or number out of range\0",
    "the text is not UTF-8 or too long\0",
    "the bytes are no valid scene\0",
    "the settings cannot be used\0",
    "the edit breaks a rule of scenes\0",
    "only baking can change that\0",
    "the scene has changed since the session was told\0",
    "the library lacks a part that scene or settings need\0",
    "made for another plan\0",
    "no iteration has begun, or one is under way\0",
    "a shard has not finished the iteration\0",
    "the shards are not all of the plan's, in order\0",
    "the block holds nothing suspended of this plan\0",
    "not asked for by the settings, or not there yet\0",
    "the saved bytes cannot be used\0",
    "the arrays make no scene\0",
];

const UNKNOWN: &str = "unknown status\0";

/// Text of a status, with its zero byte.
fn text(status: i32) -> &'static str {
    usize::try_from(status).ok().and_then(|i| TEXTS.get(i)).unwrap_or(&UNKNOWN)
}

impl croupier_status {
    /// Text, without a zero byte.
    pub(crate) fn text(self) -> &'static str {
        text(self as i32).trim_end_matches('\0')
    }

    /// Every status.
    pub const ALL: [Self; 26] = [
        CROUPIER_OK,
        CROUPIER_NULL,
        CROUPIER_MISALIGNED,
        CROUPIER_SIZE,
        CROUPIER_STRUCT_SIZE,
        CROUPIER_NO_OBJECT,
        CROUPIER_DESTROYED,
        CROUPIER_BUSY,
        CROUPIER_OVERLAP,
        CROUPIER_INSTRUCTIONS,
        CROUPIER_RANGE,
        CROUPIER_TEXT,
        CROUPIER_SCENE,
        CROUPIER_SETTINGS,
        CROUPIER_EDIT,
        CROUPIER_EDIT_FIXED,
        CROUPIER_SCENE_CHANGED,
        CROUPIER_EFFECTS,
        CROUPIER_PLAN,
        CROUPIER_ITERATION,
        CROUPIER_UNFINISHED,
        CROUPIER_SHARDS,
        CROUPIER_NOT_SUSPENDED,
        CROUPIER_ABSENT,
        CROUPIER_SAVED,
        CROUPIER_COMPOSE,
    ];
}

/// What a status means, in a few English words that end with a zero byte. Never null, whatever the number. The text is
/// the library's and stays.
#[unsafe(no_mangle)]
pub extern "C" fn croupier_status_text(status: i32) -> *const c_char {
    text(status).as_ptr().cast()
}

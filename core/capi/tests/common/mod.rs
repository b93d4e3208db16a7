//! A host in Rust that sees the library as C does.
#![allow(dead_code, unused_macros, unused_imports, clippy::allow_attributes, reason = "each test uses a part of it")]

use croupier_capi::*;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
pub(crate) use croupier_tests::embedding::SETTINGS;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;

/// Calls a function of the library.
macro_rules! c {
    ($name:ident($($argument:expr),* $(,)?)) => {{
        // SAFETY: the tests' pointers are those that the documentation asks for, or null or misaligned, which is checked.
        unsafe { $name($($argument),*) }
    }};
}
pub(crate) use c;

/// Calls a function that must succeed.
macro_rules! ok {
    ($name:ident($($argument:expr),* $(,)?)) => {{
        let mut message = $crate::common::message();
        // SAFETY: as of `c`.
        let status = unsafe { $name($($argument,)* &raw mut message) };
        assert_eq!(status, croupier_capi::croupier_status::CROUPIER_OK, "{}: {}", stringify!($name), $crate::common::text(&message));
    }};
}
pub(crate) use ok;

/// Calls a function that must fail with this status; what its message says.
macro_rules! fails {
    ($status:ident, $name:ident($($argument:expr),* $(,)?)) => {{
        let mut message = $crate::common::message();
        // SAFETY: as of `c`.
        let status = unsafe { $name($($argument,)* &raw mut message) };
        let text = $crate::common::text(&message);
        assert_eq!(status, croupier_capi::croupier_status::$status, "{}: {text}", stringify!($name));
        assert!(!text.is_empty(), "{} says nothing", stringify!($name));
        text
    }};
}
pub(crate) use fails;

pub(crate) fn message() -> croupier_message {
    croupier_message { text: [1; 256] }
}

pub(crate) fn text(message: &croupier_message) -> String {
    let bytes: Vec<u8> = message.text.iter().map(|c| *c as u8).collect();
    CStr::from_bytes_until_nul(&bytes).expect("a zero byte").to_string_lossy().into_owned()
}

/// A library's own text.
pub(crate) fn static_text(text: *const c_char) -> String {
    // SAFETY: the library's texts end with a zero byte and stay.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Memory at a multiple of 64 bytes that holds rubbish.
pub(crate) struct Block(AlignedBytes);

impl Block {
    pub(crate) fn new(bytes: usize) -> Self {
        Self::of(&vec![0xa5; bytes])
    }

    pub(crate) fn of(bytes: &[u8]) -> Self {
        let mut block = AlignedBytes::zeroed(bytes.len());
        block.as_mut().copy_from_slice(bytes);
        Self(block)
    }

    pub(crate) fn pointer(&mut self) -> *mut c_void {
        self.0.as_mut().as_mut_ptr().cast()
    }

    pub(crate) fn len(&mut self) -> usize {
        self.0.as_mut().len()
    }

    pub(crate) fn bytes(&mut self) -> &mut [u8] {
        self.0.as_mut()
    }
}

/// The baked box of the examples.
pub(crate) fn baked() -> AlignedBytes {
    bake(&builtin::cornell_blocks(), &BakeOptions::default(), |_, _| {}).expect("a scene").bytes
}

/// A scene with its memory.
pub(crate) struct OwnScene {
    pub(crate) object: Block,
    pub(crate) blob: Block,
    pub(crate) handle: *mut croupier_scene,
}

impl OwnScene {
    pub(crate) fn new(blob: &[u8]) -> Self {
        let (mut object, mut blob) = (Block::new(CROUPIER_SCENE_BYTES), Block::of(blob));
        let mut handle = ptr::null_mut();
        ok!(croupier_scene_init(object.pointer(), object.len(), blob.pointer(), blob.len(), &raw mut handle));
        Self { object, blob, handle }
    }

    /// Address of the blob.
    pub(crate) fn blob_at(&self) -> *mut c_void {
        self.blob.0.as_ptr().cast_mut().cast()
    }
}

pub(crate) fn set(settings: &mut croupier_settings, name: &str, value: &str) {
    let (name, value) = (CString::new(name).expect("a name"), CString::new(value).expect("a value"));
    ok!(croupier_settings_set(settings, name.as_ptr(), value.as_ptr()));
}

/// Settings of the examples.
pub(crate) fn settings(scene: *const croupier_scene, shards: u32) -> croupier_settings {
    let mut settings = croupier_settings { opaque: [7; 64] };
    ok!(croupier_settings_init(&raw mut settings, scene));
    for (name, value) in SETTINGS {
        set(&mut settings, name, value);
    }
    ok!(croupier_settings_set_shards(&raw mut settings, shards));
    settings
}

pub(crate) fn plan(settings: &croupier_settings) -> croupier_plan {
    let mut plan = croupier_plan { opaque: [7; 128] };
    ok!(croupier_plan_init(&raw mut plan, settings));
    plan
}

pub(crate) fn sizes(plan: &croupier_plan) -> croupier_sizes {
    let mut sizes = croupier_sizes { struct_size: 40, width: 0, height: 0, shards: 0, session: 0, shard: 0, stack: 0 };
    ok!(croupier_plan_sizes(plan, &raw mut sizes));
    sizes
}

/// A session with its shards and their memory.
pub(crate) struct Render {
    pub(crate) session: *mut croupier_session,
    pub(crate) shards: Vec<*mut croupier_shard>,
    pub(crate) memory: Vec<Block>,
    pub(crate) pixels: usize,
}

impl Render {
    pub(crate) fn new(scene: *const croupier_scene, plan: &croupier_plan, parts: Option<&croupier_parts>) -> Self {
        let sizes = sizes(plan);
        let mut memory = vec![Block::new(sizes.session as usize)];
        let mut session = ptr::null_mut();
        match parts {
            None => ok!(croupier_session_init(memory[0].pointer(), memory[0].len(), plan, scene, &raw mut session)),
            Some(parts) => {
                let (p, n) = (memory[0].pointer(), memory[0].len());
                ok!(croupier_session_init_with(p, n, plan, scene, parts, &raw mut session));
            }
        }
        let mut shards = Vec::new();
        for i in 0..sizes.shards {
            let mut bytes = 0;
            ok!(croupier_plan_shard_size(plan, i, &raw mut bytes));
            assert!(bytes as u64 <= sizes.shard);
            let (mut block, mut shard) = (Block::new(bytes), ptr::null_mut());
            ok!(croupier_shard_init(block.pointer(), block.len(), plan, i, &raw mut shard));
            memory.push(block);
            shards.push(shard);
        }
        Self { session, shards, memory, pixels: (sizes.width * sizes.height) as usize }
    }

    pub(crate) fn begin(&self, samples: u32) {
        ok!(croupier_session_begin_iteration(self.session, samples));
    }

    pub(crate) fn step_all(&self, rays: u64) {
        for shard in &self.shards {
            let mut more = 1;
            while more != 0 {
                ok!(croupier_shard_step(*shard, self.session, rays, &raw mut more));
            }
        }
    }

    pub(crate) fn finish(&self, units: u64) {
        let mut more = 1;
        while more != 0 {
            let (shards, count) = (self.shards.as_ptr(), self.shards.len());
            ok!(croupier_session_finish_iteration(self.session, shards, count, units, &raw mut more));
        }
    }

    /// The three iterations of the examples; the hash of the picture.
    pub(crate) fn render(&self, rays: u64, units: u64) -> u64 {
        for samples in [2, 2, 4] {
            self.begin(samples);
            self.step_all(rays);
            self.finish(units);
        }
        self.hash()
    }

    pub(crate) fn rgb(&self) -> Vec<f32> {
        let mut rgb = vec![0.0; 3 * self.pixels];
        ok!(croupier_session_rgb(self.session, rgb.as_mut_ptr(), rgb.len()));
        rgb
    }

    pub(crate) fn hash(&self) -> u64 {
        let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        self.rgb().into_iter().flat_map(f32::to_le_bytes).fold(0xcbf2_9ce4_8422_2325, mix)
    }
}

/// Hash of a picture of the examples.
pub(crate) fn expected(name: &str) -> u64 {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../embed-example/hashes.txt");
    let text = std::fs::read_to_string(file).expect("the hashes");
    let line = text.lines().find_map(|l| l.strip_prefix(name)).expect("the picture");
    u64::from_str_radix(line.trim(), 16).expect("a hash")
}

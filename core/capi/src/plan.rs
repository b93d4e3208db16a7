//! How much memory a render needs.

use crate::fault::{Failure, Fault, answer, croupier_message, promised};
use crate::memory::{Versioned, output, write_struct, zeroed};
use crate::session::SESSION_HEAD;
use crate::settings::{Stored, croupier_settings, settings_at};
use crate::shard::SHARD_HEAD;
use crate::status::croupier_status::{self, *};
use bytemuck::{Pod, Zeroable};
use core::fmt::{self, Write};
use croupier::unstable::STACK_BYTES;
use croupier::{Plan, Settings, SettingsError};

/// What a render needs: settings that were checked, and sizes. Its members are the library's; the struct may be copied.
/// Threads may read it at the same time. Sessions and shards have what they need of it and do not refer to it.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct croupier_plan {
    /// Not for programs.
    pub opaque: [u64; 128],
}

/// Sizes of a plan's blocks of memory. Each block starts at a multiple of CROUPIER_ALIGN bytes and may hold anything
/// before.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_sizes {
    /// sizeof(croupier_sizes), set by the program.
    pub struct_size: u32,
    /// Columns of the picture.
    pub width: u32,
    /// Rows of the picture.
    pub height: u32,
    /// Number of shards.
    pub shards: u32,
    /// Bytes of a session's block.
    pub session: u64,
    /// Bytes of a block that any shard fits into; croupier_plan_shard_size is exact.
    pub shard: u64,
    /// Bytes of stack that a call needs at most, without what callbacks need.
    pub stack: u64,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_sizes {
    const FIRST: u32 = 40;
    const NAME: &'static str = "sizes";

    fn empty() -> Self {
        zeroed()
    }
}

/// A plan and what tells it from others.
#[derive(Clone, Copy)]
pub(crate) struct Planned {
    pub plan: Plan,
    /// Hash of all settings.
    pub identity: u64,
}

/// The plan in a struct.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn plan_at<'a>(plan: *const croupier_plan) -> Result<&'a Planned, Fault> {
    promised!(Stored::at(plan, "plan"))
}

/// 64-bit FNV-1a of the settings as texts.
fn identity(settings: &Settings) -> u64 {
    struct Hash(u64);
    impl Write for Hash {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            for byte in text.bytes() {
                self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
            Ok(())
        }
    }
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    for row in Settings::TABLE {
        // a hash never fails
        if let Some(value) = settings.get(row.name) {
            let _ = write!(hash, "{}={value};", row.name);
        }
    }
    hash.0
}

/// Makes a plan of memory that may hold anything: checks the settings and measures the blocks. CROUPIER_SETTINGS if
/// they cannot be used, with the reason in the message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_plan_init(
    plan: *mut croupier_plan,
    settings: *const croupier_settings,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SettingsError>, {
        let settings = promised!(settings_at(settings))?;
        let planned = Planned { plan: Plan::new(settings)?, identity: identity(settings) };
        let fits = planned.plan.session().size.checked_add(SESSION_HEAD).is_some();
        if !fits || planned.plan.shard().size.checked_add(SHARD_HEAD).is_none() {
            return Err(SettingsError::Memory.into());
        }
        promised!(Stored::put(plan, planned, "plan"))?;
        Ok(())
    })
}

/// Sizes of the blocks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_plan_sizes(
    plan: *const croupier_plan,
    sizes: *mut croupier_sizes,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let Planned { plan, .. } = promised!(plan_at(plan))?;
        let ([width, height], shards) = (plan.settings().size, plan.settings().shards);
        let measured = croupier_sizes {
            width,
            height,
            shards,
            session: plan.session().size.saturating_add(SESSION_HEAD) as u64,
            shard: plan.shard().size.saturating_add(SHARD_HEAD) as u64,
            stack: STACK_BYTES as u64,
            ..croupier_sizes::empty()
        };
        promised!(write_struct(sizes, &measured))
    })
}

/// Bytes of the block of shard index, which depend on its pixels. CROUPIER_RANGE if the plan has fewer shards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_plan_shard_size(
    plan: *const croupier_plan,
    index: u32,
    bytes: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let Planned { plan, .. } = promised!(plan_at(plan))?;
        let mut bytes = promised!(output(bytes, "bytes"))?;
        if index >= plan.settings().shards {
            return Err(Fault::new(CROUPIER_RANGE, "shard").at(index.into()));
        }
        bytes.set(plan.shard_of(index).size.saturating_add(SHARD_HEAD));
        Ok(())
    })
}

//! Shards: units of parallel work.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::guarded::{Guarded, Kind, Reading};
use crate::memory::{apart, block, output, overlap, write_struct};
use crate::picture::croupier_counters;
use crate::plan::{croupier_plan, plan_at};
use crate::session::{SessionData, croupier_session, plain, session_at};
use crate::status::croupier_status::{self, *};
use core::ffi::c_void;
use core::{ptr, slice};
use croupier::{Budget, MemoryError, Shard, ShardError, StepResult};

/// A shard: one unit of parallel work, in the program's memory. One call at a time uses it.
pub struct croupier_shard {
    _opaque: [u8; 0],
}

/// Bytes in front of the core's block.
pub(crate) const SHARD_HEAD: usize = size_of::<Guarded<ShardData>>().next_multiple_of(crate::memory::ALIGN);

/// What a shard object holds.
pub(crate) struct ShardData {
    /// `None` only while it is being suspended.
    pub shard: Option<Shard<'static>>,
    /// [`crate::plan::Planned::identity`].
    pub plan: u64,
    /// Address and length of the memory.
    pub place: (usize, usize),
}

impl Kind for ShardData {
    const MARK: u32 = u32::from_le_bytes(*b"CRsh");
    const NAME: &'static str = "shard";
}

const _: () = {
    const fn used_by_any_thread<T: Send + Sync>() {}
    used_by_any_thread::<Shard<'static>>();
};

impl CoreError for ShardError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Index { .. } => CROUPIER_RANGE,
            Self::Memory(MemoryError::Misaligned) => CROUPIER_MISALIGNED,
            Self::Memory(_) => CROUPIER_SIZE,
            Self::NotSuspended { .. } => CROUPIER_NOT_SUSPENDED,
        }
    }
}

impl ShardData {
    pub(crate) fn shard(&self) -> Result<&Shard<'static>, Fault> {
        self.shard.as_ref().ok_or(Fault::new(CROUPIER_DESTROYED, Self::NAME))
    }

    /// Is it of the session's plan, and in memory of its own?
    pub(crate) fn fits(&self, session: &SessionData) -> Result<(), Fault> {
        let status = match (session.plan == self.plan, overlap(session.place, self.place)) {
            (true, false) => return Ok(()),
            (true, true) => CROUPIER_OVERLAP,
            (false, _) => CROUPIER_PLAN,
        };
        Err(Fault::new(status, Self::NAME).at(self.shard()?.index().into()))
    }

    pub(crate) fn shard_mut(&mut self) -> Result<&mut Shard<'static>, Fault> {
        self.shard.as_mut().ok_or(Fault::new(CROUPIER_DESTROYED, Self::NAME))
    }
}

/// The shard at an address.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn shard_at<'a>(shard: *const croupier_shard) -> Result<&'a Guarded<ShardData>, Fault> {
    promised!(Guarded::at(shard.cast()))
}

/// Shards of an array, shared as long as this exists.
pub(crate) struct Shards<'a> {
    /// Those that are locked.
    shards: &'a [*mut croupier_shard],
}

impl<'a> Shards<'a> {
    /// Locks shards that may not overlap `place`.
    ///
    /// # Safety
    /// The caller's promise for each of them, until this is dropped.
    pub(crate) unsafe fn lock(shards: &'a [*mut croupier_shard], place: (usize, usize)) -> Result<Self, Fault> {
        let mut locked = Self { shards: &[] };
        for (i, shard) in shards.iter().enumerate() {
            let reading = promised!(shard_at(*shard)).and_then(Guarded::read).map_err(|e| e.at(i as u64))?;
            let overlaps = overlap(reading.place, place);
            core::mem::forget(reading);
            locked.shards = shards.get(..=i).unwrap_or_default();
            if overlaps {
                return Err(Fault::new(CROUPIER_OVERLAP, "shard").at(i as u64));
            }
        }
        Ok(locked)
    }

    /// The shards in order.
    pub(crate) fn all(&self) -> impl Iterator<Item = &'a Shard<'static>> + Clone {
        // SAFETY: locked: they exist, and nothing changes them.
        self.shards.iter().filter_map(|shard| unsafe { locked(*shard) })
    }
}

/// A shard that is locked for reading.
///
/// # Safety
/// It is.
unsafe fn locked<'a>(shard: *const croupier_shard) -> Option<&'a Shard<'static>> {
    // SAFETY: the promise of this function.
    let shard: &'a Guarded<ShardData> = unsafe { shard_at(shard) }.ok()?;
    // SAFETY: the same.
    unsafe { shard.locked() }.shard.as_ref()
}

impl Drop for Shards<'_> {
    fn drop(&mut self) {
        for shard in self.shards {
            // SAFETY: the promise of `lock`.
            if let Ok(shard) = unsafe { shard_at(*shard) } {
                // SAFETY: `lock` has forgotten a use of it.
                drop(unsafe { Reading::again(shard) });
            }
        }
    }
}

/// What making a shard takes.
struct Start {
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    index: u32,
    shard: *mut *mut croupier_shard,
    resume: bool,
}

/// Makes or resumes a shard.
///
/// # Safety
/// The caller's promise for all pointers.
unsafe fn start(s: &Start) -> Result<(), Failure<ShardError>> {
    let mut handle = promised!(output(s.shard, "shard"))?;
    handle.set(ptr::null_mut());
    let planned = promised!(plan_at(s.plan))?;
    let shards = planned.plan.settings().shards;
    if s.index >= shards {
        return Err(ShardError::Index { index: s.index, shards }.into());
    }
    let size = planned.plan.shard_of(s.index).size;
    let needed = SHARD_HEAD.saturating_add(size);
    let place = block(s.memory, s.memory_size, needed, "memory")?;
    apart(s.plan, 1, &[(place.addr().get(), needed)], "plan")?;
    let core = place.as_ptr().wrapping_add(SHARD_HEAD);
    // SAFETY: the caller's promise; `block` has checked address and length, of which this is the rest.
    let bytes: &'static mut [u8] = unsafe { slice::from_raw_parts_mut(core, size) };
    let make = if s.resume { Shard::resume } else { Shard::new };
    let shard = Some(make(&planned.plan, s.index, bytes)?);
    let data = ShardData { shard, plan: planned.identity, place: (place.addr().get(), needed) };
    promised!(Guarded::place(place.as_ptr().cast(), data));
    handle.set(place.as_ptr().cast());
    Ok(())
}

/// Makes shard index of a plan in memory: as many bytes as croupier_plan_shard_size says, at a multiple of
/// CROUPIER_ALIGN. It serves one session; make it anew for another one. *shard becomes the handle, which is the
/// address of the memory; null after a failure. CROUPIER_RANGE if the plan has fewer shards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_init(
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    index: u32,
    shard: *mut *mut croupier_shard,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<ShardError>, {
        promised!(start(&Start { memory, memory_size, plan, index, shard, resume: false }))
    })
}

/// Takes up the shard that croupier_shard_suspend has left in memory, which may have been copied elsewhere or stored
/// since. CROUPIER_NOT_SUSPENDED if the memory holds no shard of an equal plan with this index, suspended.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_resume(
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    index: u32,
    shard: *mut *mut croupier_shard,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<ShardError>, {
        promised!(start(&Start { memory, memory_size, plan, index, shard, resume: true }))
    })
}

/// Leaves the shard in its memory, an iteration that is under way included, to be resumed. The handle is dead.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_suspend(
    shard: *mut croupier_shard,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut data = promised!(shard_at(shard))?.write()?;
        data.shard.take().ok_or(Fault::new(CROUPIER_DESTROYED, ShardData::NAME))?.suspend();
        data.bury();
        Ok(())
    })
}

/// Ends a shard: its memory is the program's again. CROUPIER_BUSY, and the shard goes on, while another call uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_destroy(
    shard: *mut croupier_shard,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(shard_at(shard))?.write()?.bury();
        Ok(())
    })
}

/// Works until about rays rays are traced (exceeded by less than one packet of 16, but for rays that pass surfaces or
/// media) or the shard has finished the iteration; *more becomes 1 or 0. Many small steps and one big step give the
/// same bits. Different shards may step on different threads at a time, with the same session; a program cancels by
/// not calling again. CROUPIER_PLAN if session and shard are of different plans, CROUPIER_SCENE_CHANGED if the scene was
/// edited since the session was told, CROUPIER_ITERATION if none has begun; *more is 0 then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_step(
    shard: *mut croupier_shard,
    session: *const croupier_session,
    rays: u64,
    more: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut more = promised!(output(more, "more"))?;
        more.set(0);
        let session = promised!(session_at(session))?.read()?;
        let mut data = promised!(shard_at(shard))?.write()?;
        data.fits(&session)?;
        let state = session.state()?;
        if state.iteration().number == 0 {
            return Err(Fault::new(CROUPIER_ITERATION, "session"));
        }
        let scene = session.scene()?;
        let view = scene.scene.scene();
        let result = (session.kernel.step)(view, &session.parts, state, data.shard_mut()?, Budget { rays });
        more.set(u32::from(result.map_err(|e| plain(&e))? == StepResult::More));
        Ok(())
    })
}

/// Starts no further camera samples in the iteration of the shard's last step: stepping on finishes those in flight,
/// so that the iteration can end early and the picture stays unbiased.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_stop(
    shard: *mut croupier_shard,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(shard_at(shard))?.write()?.shard_mut()?.stop();
        Ok(())
    })
}

/// Counts of the current iteration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_counters(
    shard: *const croupier_shard,
    counters: *mut croupier_counters,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(shard_at(shard))?.read()?;
        let counts = croupier_counters::from_core(data.shard()?.counters());
        promised!(write_struct(counters, &counts))
    })
}

//! Finished shards as bytes, for renders on many machines: every process begins the same iterations, steps some of the
//! shards, sends these to all others and ends the iteration with all of them.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::memory::{apart, array, array_mut, output};
use crate::plan::{Planned, croupier_plan, plan_at};
use crate::session::{croupier_session, session_at};
use crate::shard::{croupier_shard, shard_at};
use crate::status::croupier_status::{self, *};
use core::ffi::c_void;
use croupier::{SavedShardError, SessionError};

impl CoreError for SavedShardError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Length { .. } => CROUPIER_SIZE,
            Self::Unfinished { .. } => CROUPIER_UNFINISHED,
            Self::Plan { .. } => CROUPIER_PLAN,
            _ => CROUPIER_SAVED,
        }
    }
}

/// Most bytes that croupier_shard_save writes of shard index, in any iteration. CROUPIER_RANGE if the plan has fewer
/// shards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_plan_saved_shard_size(
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
        bytes.set(plan.saved_shard(index));
        Ok(())
    })
}

/// Writes what the end of an iteration reads of a finished shard, for croupier_shard_load of another process; *written
/// becomes the number of bytes. Equal sums give equal bytes. CROUPIER_UNFINISHED if the shard has not finished an
/// iteration, CROUPIER_SIZE if there is too little room; nothing is written then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_save(
    shard: *const croupier_shard,
    bytes: *mut c_void,
    size: usize,
    written: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SavedShardError>, {
        let mut written = promised!(output(written, "written"))?;
        written.set(0);
        let data = promised!(shard_at(shard))?.read()?;
        apart(bytes.cast::<u8>(), size, &[data.place], "bytes")?;
        let to = promised!(array_mut(bytes.cast::<u8>(), size, "bytes"))?;
        written.set(data.shard()?.save(to)?);
        Ok(())
    })
}

/// Takes the place of the shard that croupier_shard_save has written: joins the iteration of the session with its
/// sums, finished. Sessions of several processes that begin the same iterations and end each with all shards have the
/// same picture and the same statistics to the bit. CROUPIER_PLAN or CROUPIER_SAVED, with the reason in the message,
/// if the bytes are of another scene, plan, shard, iteration or version, or damaged; the shard is as before then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_load(
    shard: *mut croupier_shard,
    session: *const croupier_session,
    bytes: *const c_void,
    size: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SavedShardError>, {
        let session = promised!(session_at(session))?.read()?;
        let mut data = promised!(shard_at(shard))?.write()?;
        data.fits(&session)?;
        apart(bytes.cast::<u8>(), size, &[data.place], "bytes")?;
        let bytes = promised!(array(bytes.cast::<u8>(), size, "bytes"))?;
        let (state, scene) = (session.state()?, session.scene()?);
        (session.kernel.load)(scene.scene.scene(), &session.parts, state, data.shard_mut()?, bytes)
            .map_err(|e: SessionError| Fault::new(e.status(), "session"))??;
        Ok(())
    })
}

/// Goes on as if so many iterations, of so many camera samples per pixel in all, had been before: for one picture in
/// parts that are rendered apart and added afterwards. Parts with other numbers of iterations and disjoint ranges of
/// samples take other random numbers. CROUPIER_ITERATION if one has begun since the picture did.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_skip(
    session: *mut croupier_session,
    iterations: u64,
    samples: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut data = promised!(session_at(session))?.write()?;
        let state = data.state_mut()?;
        if state.iteration().number != 0 {
            return Err(Fault::new(CROUPIER_ITERATION, "session"));
        }
        state.skip(iterations, samples);
        Ok(())
    })
}

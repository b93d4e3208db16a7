//! What a session has learned: statistics of the scene as bytes, the estimate of the pixels.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::memory::{apart, array, array_mut, output};
use crate::session::{croupier_session, session_at};
use crate::status::croupier_status::{self, *};
use core::ffi::c_void;
use croupier::SessionError;
use croupier::unstable::learn::cache::CacheError;

impl CoreError for CacheError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Length { .. } | Self::Full { .. } => CROUPIER_SIZE,
            Self::Absent => CROUPIER_ABSENT,
            _ => CROUPIER_SAVED,
        }
    }
}

/// Name in messages.
const STATISTICS: &str = "statistics";

/// Bytes that croupier_session_save_statistics writes. CROUPIER_ABSENT if neither the strategy nor path
/// guiding learns anything of the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_statistics_size(
    session: *const croupier_session,
    bytes: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let mut to = promised!(output(bytes, "bytes"))?;
        let len = Some(data.state()?.saved_statistics_len()).filter(|len| *len > 0);
        to.set(len.ok_or(Fault::new(CROUPIER_ABSENT, STATISTICS))?);
        Ok(())
    })
}

/// Writes what was learned of the scene, for another run, another machine, another scene of the same bounds. The bytes
/// are the same on every machine. CROUPIER_SIZE if there is too little room, CROUPIER_ABSENT if neither the strategy
/// nor path guiding learns anything of the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_save_statistics(
    session: *const croupier_session,
    bytes: *mut c_void,
    size: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<CacheError>, {
        let data = promised!(session_at(session))?.read()?;
        apart(bytes.cast::<u8>(), size, &[data.place], "bytes")?;
        let to = promised!(array_mut(bytes.cast::<u8>(), size, "bytes"))?;
        data.state()?.save_statistics(to)?;
        Ok(())
    })
}

/// Replaces (merge is 0) what was learned of the scene by saved bytes, or adds them. Whatever is loaded changes
/// efficiency only. The bytes are checked first; CROUPIER_SAVED, with the reason in the message, if they are damaged
/// or of another scene or objective, CROUPIER_ABSENT while an iteration runs or if they hold nothing that the session
/// learns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_load_statistics(
    session: *mut croupier_session,
    bytes: *const c_void,
    size: usize,
    merge: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<CacheError>, {
        let mut data = promised!(session_at(session))?.write()?;
        apart(bytes.cast::<u8>(), size, &[data.place], "bytes")?;
        let bytes = promised!(array(bytes.cast::<u8>(), size, "bytes"))?;
        let session = data.state_mut()?;
        if merge == 0 {
            session.load_statistics(bytes)?
        } else {
            session.merge_statistics(bytes)?
        }
        Ok(())
    })
}

/// The estimate of the pixels that the strategy works with (denoised, or means of blocks): red, green and blue of
/// each, row by row. count is three times the number of pixels, or the answer is CROUPIER_SIZE. CROUPIER_ABSENT if the
/// settings need none, and before the end of the first iteration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_estimate(
    session: *const croupier_session,
    rgb: *mut f32,
    count: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let [r, g, b] = data.state()?.estimate().ok_or(Fault::new(CROUPIER_ABSENT, "estimate"))?;
        let needed = r.len().saturating_mul(3);
        if count != needed {
            return Err(Fault::sizes("rgb", needed, count));
        }
        apart(rgb, count, &[data.place], "rgb")?;
        let to = promised!(array_mut(rgb, count, "rgb"))?;
        for (to, ((r, g), b)) in to.as_chunks_mut().0.iter_mut().zip(r.iter().zip(g).zip(b)) {
            *to = [*r, *g, *b];
        }
        Ok(())
    })
}

/// Replaces the built-in estimate of the pixels by the host's (such as that of another denoiser), for good: red, green
/// and blue of each pixel, row by row. It changes efficiency only. CROUPIER_SIZE if count is not three times the
/// number of pixels, the settings have no estimate per pixel, or an iteration runs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_give_estimate(
    session: *mut croupier_session,
    rgb: *const f32,
    count: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SessionError>, {
        let mut data = promised!(session_at(session))?.write()?;
        apart(rgb, count, &[data.place], "rgb")?;
        let (pixels, rest) = promised!(array(rgb, count, "rgb"))?.as_chunks();
        if !rest.is_empty() {
            return Err(Fault::new(CROUPIER_SIZE, "rgb").into());
        }
        data.state_mut()?.give_estimate(pixels)?;
        Ok(())
    })
}

//! Sessions: iterations of a picture.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::guarded::{Guarded, Kind};
use crate::kernels::{Kernel, State};
use crate::memory::{Versioned, apart, array, block, output, overlap};
use crate::parts::croupier_parts;
use crate::plan::{croupier_plan, plan_at};
use crate::scene::{SceneData, croupier_scene, scene_at};
use crate::shard::{Shards, croupier_shard};
use crate::status::croupier_status::{self, *};
use core::ffi::c_void;
use core::{ptr, slice};
use croupier::unstable::ResumeError;
use croupier::{Budget, MemoryError, SessionError, StepResult};

/// A session: the picture so far and what was learned, in the program's memory. Calls that take a const pointer to it
/// may run on several threads at a time; the others need it for themselves, or answer CROUPIER_BUSY.
pub struct croupier_session {
    _opaque: [u8; 0],
}

/// Bytes in front of the core's block.
pub(crate) const SESSION_HEAD: usize = size_of::<Guarded<SessionData>>().next_multiple_of(crate::memory::ALIGN);

/// What a session object holds.
pub(crate) struct SessionData {
    /// `None` only while it is being suspended.
    pub state: Option<State>,
    pub scene: *const croupier_scene,
    /// State of the scene that the session knows.
    pub known: u64,
    /// [`crate::plan::Planned::identity`].
    pub plan: u64,
    /// Address and length of the memory.
    pub place: (usize, usize),
    pub kernel: &'static Kernel,
    pub parts: croupier_parts,
}

impl Kind for SessionData {
    const MARK: u32 = u32::from_le_bytes(*b"CRse");
    const NAME: &'static str = "session";
}

const _: () = {
    const fn shared_by_threads<T: Sync>() {}
    shared_by_threads::<State>();
};

impl CoreError for SessionError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Instructions { .. } => CROUPIER_INSTRUCTIONS,
            Self::Memory(MemoryError::Misaligned) => CROUPIER_MISALIGNED,
            Self::Memory(_) | Self::Estimate { .. } => CROUPIER_SIZE,
            Self::Profile { .. } | Self::Sampler { .. } | Self::Guiding => CROUPIER_EFFECTS,
            Self::Shards { .. } => CROUPIER_SHARDS,
            Self::Unfinished { .. } => CROUPIER_UNFINISHED,
            Self::Plan { .. } | Self::Resume(ResumeError::Plan) => CROUPIER_PLAN,
            Self::Resume(_) => CROUPIER_NOT_SUSPENDED,
            _ => CROUPIER_ITERATION,
        }
    }
}

/// An error at the end of an iteration without the formatting of the standard library.
pub(crate) fn plain(e: &SessionError) -> Fault {
    let fault = Fault::new(e.status(), "shard");
    match e {
        SessionError::Shards { expected } => fault.at((*expected).into()),
        SessionError::Unfinished { shard } | SessionError::Plan { shard } => fault.at((*shard).into()),
        _ => Fault { about: "session", ..fault },
    }
}

/// The session at an address.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn session_at<'a>(session: *const croupier_session) -> Result<&'a Guarded<SessionData>, Fault> {
    promised!(Guarded::at(session.cast()))
}

impl SessionData {
    pub(crate) fn state(&self) -> Result<&State, Fault> {
        self.state.as_ref().ok_or(Fault::new(CROUPIER_DESTROYED, Self::NAME))
    }

    pub(crate) fn state_mut(&mut self) -> Result<&mut State, Fault> {
        self.state.as_mut().ok_or(Fault::new(CROUPIER_DESTROYED, Self::NAME))
    }

    /// The scene, if it is in the state that the session knows.
    pub(crate) fn scene(&self) -> Result<crate::guarded::Reading<'_, SceneData>, Fault> {
        // SAFETY: the promise of the call that named the scene: it stays where it is.
        let data = unsafe { scene_at(self.scene) }?.read()?;
        match data.scene.scene().hash == self.known {
            true => Ok(data),
            false => Err(Fault::new(CROUPIER_SCENE_CHANGED, "scene")),
        }
    }
}

/// What starting a session takes.
struct Start {
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    scene: *const croupier_scene,
    session: *mut *mut croupier_session,
    resume: bool,
}

/// Starts or resumes a session.
///
/// # Safety
/// The caller's promise for all pointers.
unsafe fn start(s: &Start, kernel: &'static Kernel, parts: croupier_parts) -> Result<(), Failure<SessionError>> {
    let mut handle = promised!(output(s.session, "session"))?;
    handle.set(ptr::null_mut());
    let planned = promised!(plan_at(s.plan))?;
    let scene = promised!(scene_at(s.scene))?.read()?;
    let needed = SESSION_HEAD.saturating_add(planned.plan.session().size);
    let place = block(s.memory, s.memory_size, needed, "memory")?;
    let place_range = (place.addr().get(), needed);
    if scene.places(s.scene).iter().any(|place| overlap(place_range, *place)) {
        return Err(Fault::new(CROUPIER_OVERLAP, "memory").into());
    }
    apart(s.plan, 1, &[place_range], "plan")?;
    let core = place.as_ptr().wrapping_add(SESSION_HEAD);
    // SAFETY: the caller's promise; `block` has checked address and length, of which this is the rest.
    let bytes: &'static mut [u8] = unsafe { slice::from_raw_parts_mut(core, planned.plan.session().size) };
    let view = scene.scene.scene();
    let state = (kernel.start)(view, &parts, &planned.plan, bytes, s.resume)?;
    let known = view.hash;
    let plan = planned.identity;
    let data = SessionData { state: Some(state), scene: s.scene, known, plan, place: place_range, kernel, parts };
    promised!(Guarded::place(place.as_ptr().cast(), data));
    handle.set(place.as_ptr().cast());
    Ok(())
}

/// Makes a session of a scene in memory: as many bytes as croupier_plan_sizes says, at a multiple of CROUPIER_ALIGN.
/// The scene stays where it is, and exists, as long as the session is used; the plan may go. *session becomes the
/// handle, which is the address of the memory; null after a failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_init(
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    scene: *const croupier_scene,
    session: *mut *mut croupier_session,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SessionError>, {
        let s = Start { memory, memory_size, plan, scene, session, resume: false };
        promised!(start(&s, Kernel::BUILT_IN, Versioned::empty()))
    })
}

/// croupier_session_init with parts of the host's own, which are copied. CROUPIER_RANGE if parts are there that do not
/// go together.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_init_with(
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    scene: *const croupier_scene,
    parts: *const croupier_parts,
    session: *mut *mut croupier_session,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SessionError>, {
        let parts = promised!(croupier_parts::read(parts))?;
        let s = Start { memory, memory_size, plan, scene, session, resume: false };
        promised!(start(&s, Kernel::for_parts(&parts), parts))
    })
}

/// Goes on with the session that croupier_session_suspend has left in memory, which may have been copied elsewhere or
/// stored since, with the bits that it would have had without the break. The plan must be equal; with another scene
/// the picture begins anew, with what was learned. CROUPIER_NOT_SUSPENDED if the memory holds no such session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_resume(
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    scene: *const croupier_scene,
    session: *mut *mut croupier_session,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SessionError>, {
        let s = Start { memory, memory_size, plan, scene, session, resume: true };
        promised!(start(&s, Kernel::BUILT_IN, Versioned::empty()))
    })
}

/// croupier_session_resume with parts of the host's own.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_resume_with(
    memory: *mut c_void,
    memory_size: usize,
    plan: *const croupier_plan,
    scene: *const croupier_scene,
    parts: *const croupier_parts,
    session: *mut *mut croupier_session,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SessionError>, {
        let parts = promised!(croupier_parts::read(parts))?;
        let s = Start { memory, memory_size, plan, scene, session, resume: true };
        promised!(start(&s, Kernel::for_parts(&parts), parts))
    })
}

/// Leaves the session in its memory, to be resumed later, in another place, or by another process of the same kind. The
/// handle is dead. Shards are suspended each for itself.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_suspend(
    session: *mut croupier_session,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut data = promised!(session_at(session))?.write()?;
        let state = data.state.take().ok_or(Fault::new(CROUPIER_DESTROYED, SessionData::NAME))?;
        state.suspend();
        data.bury();
        Ok(())
    })
}

/// Ends a session: its memory is the program's again. CROUPIER_BUSY, and the session goes on, while another call uses
/// it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_destroy(
    session: *mut croupier_session,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(session_at(session))?.write()?.bury();
        Ok(())
    })
}

/// Begins a round of samples camera samples per pixel. One that is under way is abandoned. Shards notice at their next
/// step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_begin_iteration(
    session: *mut croupier_session,
    samples: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(session_at(session))?.write()?.state_mut()?.begin_iteration(samples);
        Ok(())
    })
}

/// Goes on with the end of the iteration: merges what the shards gathered, estimates the error, learns. All shards of
/// the plan in order, each finished; the same ones until *more is 0, when the next iteration can begin. units is a
/// budget: work in the time of a ray, some 300 instructions each. With the same bits whatever the budgets.
/// CROUPIER_SHARDS, CROUPIER_UNFINISHED, CROUPIER_PLAN, CROUPIER_ITERATION: the picture is as before then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_finish_iteration(
    session: *mut croupier_session,
    shards: *const *mut croupier_shard,
    count: usize,
    units: u64,
    more: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut more = promised!(output(more, "more"))?;
        more.set(0);
        let mut data = promised!(session_at(session))?.write()?;
        apart(shards, count, &[data.place], "shards")?;
        let shards = promised!(array(shards, count, "shards"))?;
        let shards = promised!(Shards::lock(shards, data.place))?;
        let result = data.state_mut()?.finish_iteration(shards.all(), Budget { rays: units });
        more.set(u32::from(result.map_err(|e| plain(&e))? == StepResult::More));
        Ok(())
    })
}

/// Forgets the picture and begins again with iteration 1; an iteration that is under way is abandoned. If keep is 0,
/// what was learned is forgotten too, and the pictures that follow are those of a new session to the bit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_restart(
    session: *mut croupier_session,
    keep: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(session_at(session))?.write()?.state_mut()?.restart(keep != 0);
        Ok(())
    })
}

/// Goes over to a scene that was edited, or to another one, and begins a new picture of it as croupier_session_restart
/// does. Sizes and path length stay those of the plan. CROUPIER_EFFECTS if the library lacks what the scene needs; the
/// session is as before then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_change_scene(
    session: *mut croupier_session,
    scene: *const croupier_scene,
    keep: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SessionError>, {
        let mut data = promised!(session_at(session))?.write()?;
        let to = promised!(scene_at(scene))?.read()?;
        if to.places(scene).iter().any(|place| overlap(data.place, *place)) {
            return Err(Fault::new(CROUPIER_OVERLAP, "scene").into());
        }
        let view = to.scene.scene();
        let (kernel, parts) = (data.kernel, data.parts);
        (kernel.change)(view, &parts, data.state_mut()?, keep != 0)?;
        (data.scene, data.known) = (scene, view.hash);
        Ok(())
    })
}

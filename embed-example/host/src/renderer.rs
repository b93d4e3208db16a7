//! A renderer that owns its scene and its memory, for hosts that render between other things: an engine's frames, an
//! editor's events. It can be stored in a struct, its scene changes between frames without baking, and any number of
//! persistent threads step it; nothing is allocated after [`Renderer::new`].
//!
//! ```
//! use croupier::{Budget, Scene, Settings, StepResult};
//! use croupier_host::bake::{BakeOptions, bake};
//! use croupier_host::builtin;
//! use croupier_host::renderer::{Keep, Renderer};
//!
//! let blob = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {})?.bytes;
//! let settings = Settings { size: [32, 32], ..Settings::for_scene(&Scene::from_bytes(&blob)?) };
//! let renderer: Renderer = Renderer::new(blob, &settings)?;
//! for _frame in 0..2 {
//!     // in each frame: what has changed, and as many rays as there is time for
//!     let mut camera = renderer.with_scene(|scene| *scene.camera);
//!     camera.origin[0] += 0.01;
//!     renderer.edit(Keep::Statistics, |scene| scene.camera(camera))?;
//!     renderer.begin_iteration(2);
//!     while renderer.step(0, Budget { rays: 10_000 })? == StepResult::More {}
//!     while renderer.finish_iteration(Budget { rays: 10_000 })? == StepResult::More {}
//!     assert!(renderer.with_film(|film| film.error_estimate().rel_mse) > 0.0);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::blob::AlignedBytes;
use croupier::unstable::Iteration;
use croupier::unstable::accel::WideBvh;
use croupier::unstable::extension::Extension;
use croupier::unstable::light::TreeSelector;
use croupier::unstable::profile::{Full, Profile};
use croupier::{
    Budget, Counters, EditError, EditableScene, Film, Plan, Scene, SceneEdit, SceneError, Session, SessionBuilder,
    SessionError, SessionState, Settings, SettingsError, Shard, ShardError, StepResult,
};
use self_cell::{MutBorrow, self_cell};
use std::fmt;
use std::marker::PhantomData;
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

self_cell!(
    /// A session's state with the memory that it is in.
    struct OwnedState {
        owner: MutBorrow<AlignedBytes>,
        #[covariant]
        dependent: SessionState,
    }
);

self_cell!(
    /// A shard with the memory that it is in.
    struct OwnedShard {
        owner: MutBorrow<AlignedBytes>,
        #[covariant]
        dependent: Shard,
    }
);

/// What stays when a scene changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// What roulette and splitting have learned; it serves on where the scene looks much as before.
    Statistics,
    /// Nothing: the pictures that follow are bit for bit those of a new renderer.
    Nothing,
}

/// Why a renderer cannot be made or cannot go on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RendererError {
    /// The bytes are no scene.
    Scene(SceneError),
    /// Settings that cannot be used.
    Settings(SettingsError),
    /// The system has not so much memory.
    Memory {
        /// Bytes of all blocks.
        needed: usize,
    },
    /// See [`SessionError`].
    Session(SessionError),
    /// See [`ShardError`].
    Shard(ShardError),
    /// An edit that was refused.
    Edit(EditError),
}

impl fmt::Display for RendererError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(e) => e.fmt(f),
            Self::Settings(e) => e.fmt(f),
            Self::Memory { needed } => write!(f, "the render needs {needed} bytes, which the system does not have"),
            Self::Session(e) => e.fmt(f),
            Self::Shard(e) => e.fmt(f),
            Self::Edit(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for RendererError {}

macro_rules! from {
    ($($Error:ident => $Variant:ident),*) => {$(
        impl From<$Error> for RendererError {
            fn from(e: $Error) -> Self {
                Self::$Variant(e)
            }
        }
    )*};
}

from! { SceneError => Scene, SettingsError => Settings, SessionError => Session, ShardError => Shard, EditError => Edit }

/// The scene and what all shards share.
struct Shared {
    scene: EditableScene<AlignedBytes>,
    state: OwnedState,
    /// Where the shards are while an iteration ends; room for all of them.
    shards: Vec<OwnedShard>,
}

/// Scene, session and shards in one value without lifetimes: `Send`, `Sync`, to be stored anywhere and shared by
/// reference or `Arc`.
///
/// Calls from several threads wait for each other only where they must: steps of different shards run together, a
/// change of the scene or the end of an iteration waits for the steps that are under way. Small budgets keep those
/// waits short.
///
/// # Deadlocks
/// Closures given to [`Self::edit`], [`Self::with_film`], [`Self::with_scene`] and [`Self::with_unfinished`] run while the
/// renderer is locked: one that calls the same renderer may wait for itself for ever. They read or change what they are
/// given, and return what is needed afterwards.
///
/// # Extensions
/// What the host computes in place of the core ([`Extension`]) is a value that [`Self::with_extension`] takes and that each
/// step copies: a unit struct, or one with plain numbers or `&'static` references.
pub struct Renderer<P: Profile = Full, X: Extension + Copy = ()> {
    plan: Plan,
    extension: X,
    shared: RwLock<Shared>,
    /// One for each unit of parallel work; `None` while an iteration ends.
    shards: Vec<Mutex<Option<OwnedShard>>>,
    profile: PhantomData<fn() -> P>,
}

impl<P: Profile, X: Extension + Copy> fmt::Debug for Renderer<P, X> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Renderer").field("settings", self.plan.settings()).finish_non_exhaustive()
    }
}

/// A lock that another thread has left in panic still guards sound data: the core keeps no invariant across a panic
/// that a later call relies on.
fn read<T>(lock: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    lock.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(lock: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    lock.write().unwrap_or_else(PoisonError::into_inner)
}

fn own<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The parts of a session: kernels of `P`, the scene's own tree, lights by power, `X`.
type Builder<'s, P, X> = SessionBuilder<'s, P, WideBvh<'s>, TreeSelector<'s>, X>;

fn builder<P: Profile, X: Extension>(scene: Scene<'_>, extension: X) -> Builder<'_, P, X> {
    Session::builder(scene).profile::<P>().extension(extension)
}

impl<P: Profile> Renderer<P> {
    /// Validates the blob and allocates all memory that rendering with these settings will need.
    ///
    /// # Errors
    /// A blob that is not valid or calls for effects outside the profile, settings that cannot be used, not enough
    /// memory.
    pub fn new(blob: AlignedBytes, settings: &Settings) -> Result<Self, RendererError> {
        Self::with_extension(blob, settings, ())
    }
}

impl<P: Profile, X: Extension + Copy> Renderer<P, X> {
    /// As [`Renderer::new`], with ray sources, points, textures, a scattering model or factors of roulette of the host's own.
    ///
    /// # Errors
    /// As of [`Renderer::new`].
    pub fn with_extension(blob: AlignedBytes, settings: &Settings, extension: X) -> Result<Self, RendererError> {
        let scene = EditableScene::new(blob)?;
        let plan = Plan::new(&settings.with_scene(&scene.scene()))?;
        let shards = plan.settings().shards;
        let needed = (0..shards).fold(plan.session().size, |sum, shard| sum.saturating_add(plan.shard_of(shard).size));
        let block = |size| AlignedBytes::try_zeroed(size).ok_or(RendererError::Memory { needed });
        let state = OwnedState::try_new(MutBorrow::new(block(plan.session().size)?), |owner| {
            let session = builder::<P, X>(scene.scene(), extension).build(&plan, owner.borrow_mut().as_mut());
            session.map(Session::into_state)
        })?;
        let shard = |index| {
            let owner = MutBorrow::new(block(plan.shard_of(index).size)?);
            let shard = OwnedShard::try_new(owner, |owner| Shard::new(&plan, index, owner.borrow_mut().as_mut()))?;
            Ok(Mutex::new(Some(shard)))
        };
        Ok(Self {
            plan,
            extension,
            shared: RwLock::new(Shared { scene, state, shards: Vec::with_capacity(shards as usize) }),
            shards: (0..shards).map(shard).collect::<Result<_, RendererError>>()?,
            profile: PhantomData,
        })
    }

    /// Sizes and settings.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Changes the scene and begins a new picture of it; an iteration that is under way is abandoned. What the edits of
    /// `change` take does not depend on the size of the scene, but for moves of instances, see [`EditableScene::edit`] and
    /// [`SceneEdit::transform`]. `change` must not call this renderer ([Deadlocks](Self#deadlocks)).
    ///
    /// # Errors
    /// The error of `change`; the edits that it made before stay.
    pub fn edit<T>(
        &self,
        keep: Keep,
        change: impl FnOnce(&mut SceneEdit<'_>) -> Result<T, EditError>,
    ) -> Result<T, RendererError> {
        let Shared { scene, state, .. } = &mut *write(&self.shared);
        let changed = change(&mut scene.edit());
        let to = builder::<P, X>(scene.scene(), self.extension);
        state.with_dependent_mut(|_, state| state.change_scene(&to, keep == Keep::Statistics))?;
        Ok(changed?)
    }

    /// Begins a round of `samples` camera samples per pixel.
    pub fn begin_iteration(&self, samples: u32) {
        write(&self.shared).state.with_dependent_mut(|_, state| state.begin_iteration(samples));
    }

    /// Works on a shard until the budget is used or it has finished the iteration; from any thread.
    ///
    /// # Errors
    /// No such shard.
    pub fn step(&self, shard: u32, budget: Budget) -> Result<StepResult, RendererError> {
        let shards = self.plan.settings().shards;
        let slot = self.shards.get(shard as usize).ok_or(ShardError::Index { index: shard, shards })?;
        let shared = read(&self.shared);
        let view = builder::<P, X>(shared.scene.scene(), self.extension).view(shared.state.borrow_dependent())?;
        let mut own = own(slot);
        // it is away only while an iteration ends, which the lock above excludes
        let step = |owned: &mut OwnedShard| owned.with_dependent_mut(|_, shard| shard.step(&view, budget));
        Ok(own.as_mut().map_or(StepResult::Done, step))
    }

    /// Goes on with the end of the iteration: merges what the shards have gathered, estimates the error, learns. Work is
    /// counted as that of [`Self::step`]; the next iteration can begin when it is done.
    ///
    /// # Errors
    /// No iteration, or a shard that has not finished it. The film is as before then.
    pub fn finish_iteration(&self, budget: Budget) -> Result<StepResult, RendererError> {
        let Shared { state, shards, .. } = &mut *write(&self.shared);
        shards.extend(self.shards.iter().filter_map(|slot| own(slot).take()));
        let all = shards.iter().map(OwnedShard::borrow_dependent);
        let result = state.with_dependent_mut(|_, state| state.finish_iteration(all, budget));
        for (slot, shard) in self.shards.iter().zip(shards.drain(..)) {
            *own(slot) = Some(shard);
        }
        Ok(result?)
    }

    /// See [`SessionState::finishing_stage`].
    pub fn finishing_stage(&self) -> &'static str {
        read(&self.shared).state.borrow_dependent().finishing_stage()
    }

    /// [`Self::finish_iteration`] in one call.
    ///
    /// # Errors
    /// As of [`Self::finish_iteration`].
    pub fn end_iteration(&self) -> Result<(), RendererError> {
        self.finish_iteration(Budget { rays: u64::MAX }).map(|_| ())
    }

    /// Starts no further camera samples in this iteration: stepping on finishes those in flight, and the iteration may
    /// end early.
    pub fn stop(&self) {
        for slot in &self.shards {
            if let Some(owned) = own(slot).as_mut() {
                owned.with_dependent_mut(|_, shard| shard.stop());
            }
        }
    }

    /// Shows the picture so far. `show` must not call this renderer ([Deadlocks](Self#deadlocks)).
    pub fn with_film<T>(&self, show: impl FnOnce(&Film<'_>) -> T) -> T {
        show(read(&self.shared).state.borrow_dependent().film())
    }

    /// Shows the pixels of a shard in the iteration under way: calls `show(film index, mean radiance, samples)`, see
    /// [`Shard::for_each_pixel`]. Takes time by the pixels of the shard; waits for a step of it that is under way.
    /// Nothing is shown of a shard that has not stepped since the scene has changed, or that does not exist. `show` must
    /// not call this renderer ([Deadlocks](Self#deadlocks)).
    pub fn with_unfinished(&self, shard: u32, show: impl FnMut(usize, [f64; 3], u32)) {
        let shared = read(&self.shared);
        let Ok(view) = builder::<P, X>(shared.scene.scene(), self.extension).view(shared.state.borrow_dependent())
        else {
            return;
        };
        if let Some(own) = self.shards.get(shard as usize).map(own)
            && let Some(owned) = own.as_ref().filter(|s| s.borrow_dependent().has_joined(&view))
        {
            owned.borrow_dependent().for_each_pixel(show);
        }
    }

    /// Shows the scene as it is now. `show` must not call this renderer ([Deadlocks](Self#deadlocks)).
    pub fn with_scene<T>(&self, show: impl FnOnce(&Scene<'_>) -> T) -> T {
        show(&read(&self.shared).scene.scene())
    }

    /// The current iteration of the picture.
    pub fn iteration(&self) -> Iteration {
        read(&self.shared).state.borrow_dependent().iteration()
    }

    /// Counts of the finished iterations of the picture.
    pub fn counters(&self) -> Counters {
        *read(&self.shared).state.borrow_dependent().counters()
    }

    /// The scene's bytes, valid as a blob again.
    pub fn into_blob(self) -> AlignedBytes {
        let mut scene = self.shared.into_inner().unwrap_or_else(PoisonError::into_inner).scene;
        scene.seal();
        scene.into_bytes()
    }
}

//! What all shards share: frozen while they work, changed between iterations.

mod error;
mod finish;
mod next;
mod statistics;

pub use error::SessionError;

use crate::accel::{Intersector, WideBvh};
use crate::counters::Counters;
use crate::extension::Extension;
use crate::film::Film;
use crate::instructions::missing_instructions;
use crate::learn::cache::Cache;
use crate::learn::guiding::{Guide, GuideUse};
use crate::learn::{LearnedScalars, LearnedState, PictureStatistics};
use crate::light::{LightSelector, TreeSelector};
use crate::memory::Carver;
use crate::plan::Plan;
use crate::profile::{Full, Profile};
use crate::record::{Finishing, SessionRecord, SessionScalars};
use crate::sampler::Sampler;
use crate::scene::{Effects, Scene};
use crate::settings::MAX_PATH_LENGTH;
use crate::tracer::media_at;
use crate::world::sealed::Sealed;
use crate::world::{Identity, Iteration, World};
use core::marker::PhantomData;
use core::ops::{Deref, DerefMut};

/// What the end of an iteration consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The shards' pixels are in the film.
    Merged,
    /// The pixels are estimated (denoised).
    Estimated,
    /// The scene's statistics are merged, their tree is rebuilt.
    Learned,
}

/// The shared side of a render: scene, kernels, and its [`SessionState`], whose methods it has. Frozen while shards step,
/// changed between iterations.
#[derive(Debug)]
pub struct Session<
    's,
    'm,
    P: Profile = Full,
    I: Intersector = WideBvh<'s>,
    L: LightSelector = TreeSelector<'s>,
    X: Extension = (),
> {
    scene: Scene<'s>,
    intersector: I,
    selector: L,
    extension: X,
    state: SessionState<'m>,
    profile: PhantomData<P>,
}

/// What a session has in the caller's memory: learned state and film. A host whose scene may change between frames keeps
/// this and shows shards a [`SessionView`]; [`Session::into_state`] makes one.
#[derive(Debug)]
pub struct SessionState<'m> {
    plan: Plan,
    record: &'m mut SessionRecord,
    /// Heap of the pixels with most error, while an iteration ends.
    largest: &'m mut [u32],
    film: Film<'m>,
    finishing: Finishing,
    counters: Counters,
    learned: LearnedState<'m>,
    /// Content hash of the scene.
    scene: u64,
    /// [`Records::highlight`](crate::scene::Records::highlight) of the scene.
    highlight: f32,
    epoch: u64,
    iteration: Iteration,
    running: bool,
    max_depth: u32,
    /// Bits of the media that the camera is inside of, in that scene.
    camera_media: u32,
}

/// The state of a session together with a scene, for as long as shards step: what [`Shard::step`](crate::Shard::step)
/// takes in place of a [`Session`].
#[derive(Clone, Copy, Debug)]
pub struct SessionView<
    'a,
    'm,
    P: Profile = Full,
    I: Intersector = WideBvh<'a>,
    L: LightSelector = TreeSelector<'a>,
    X: Extension = (),
> {
    scene: Scene<'a>,
    intersector: I,
    selector: L,
    extension: X,
    state: &'a SessionState<'m>,
    camera_media: u32,
    profile: PhantomData<P>,
}

/// What kernels without path guiding see of a session or its view; see [`World::unguided`]. Unlike a view it borrows what
/// finds hits and chooses lights, so that both give the same type, and so does this.
#[derive(Clone, Copy, Debug)]
pub struct Unguided<'a, P: Profile, I: Intersector, L: LightSelector, X: Extension> {
    scene: Scene<'a>,
    intersector: &'a I,
    selector: &'a L,
    extension: &'a X,
    state: &'a SessionState<'a>,
    camera_media: u32,
    profile: PhantomData<P>,
}

/// The replaceable parts of a session; see [`Session::builder`].
#[derive(Clone, Copy, Debug)]
pub struct SessionBuilder<
    's,
    P: Profile = Full,
    I: Intersector = WideBvh<'s>,
    L: LightSelector = TreeSelector<'s>,
    X: Extension = (),
> {
    scene: Scene<'s>,
    intersector: I,
    selector: L,
    extension: X,
    profile: PhantomData<P>,
}

impl<'s, P: Profile, I: Intersector, L: LightSelector, X: Extension> SessionBuilder<'s, P, I, L, X> {
    /// Kernels of another profile: those of `Q` and no more are compiled in.
    pub fn profile<Q: Profile>(self) -> SessionBuilder<'s, Q, I, L, X> {
        let Self { scene, intersector, selector, extension, .. } = self;
        SessionBuilder { scene, intersector, selector, extension, profile: PhantomData }
    }

    /// Another intersector than the scene's own tree; it may bring surfaces of its own ([`Intersector::SURFACES`]).
    pub fn intersector<J: Intersector>(self, intersector: J) -> SessionBuilder<'s, P, J, L, X> {
        let Self { scene, selector, extension, profile, .. } = self;
        SessionBuilder { scene, intersector, selector, extension, profile }
    }

    /// Another choice of lights than by the scene's light tree, or by power where it has none.
    pub fn light_selector<M: LightSelector>(self, selector: M) -> SessionBuilder<'s, P, I, M, X> {
        let Self { scene, intersector, extension, profile, .. } = self;
        SessionBuilder { scene, intersector, selector, extension, profile }
    }

    /// Ray sources, textures, a scattering model or factors of roulette of the host's own.
    pub fn extension<Y: Extension>(self, extension: Y) -> SessionBuilder<'s, P, I, L, Y> {
        let Self { scene, intersector, selector, profile, .. } = self;
        SessionBuilder { scene, intersector, selector, extension, profile }
    }

    /// Carves the shared block of at least [`Plan::session`] bytes.
    ///
    /// # Errors
    /// A scene that calls for effects outside the profile, or a block that does not fit.
    pub fn build<'m>(self, plan: &Plan, block: &'m mut [u8]) -> Result<Session<'s, 'm, P, I, L, X>, SessionError> {
        let mut session = self.carve(plan, block, false)?;
        session.film.clear();
        session.learned.forget();
        Ok(session)
    }

    /// Goes on with the session that [`Session::suspend`] has left in a block of the same plan, with the bits that it
    /// would have had without the break. The time does not depend on the size of the picture. The scene may be another
    /// one (edited, moved): the picture begins anew then, with the statistics ([`SessionState::restart`]).
    ///
    /// # Errors
    /// As of [`Self::build`], and [`SessionError::Resume`] for a block without a suspended session of this plan. The
    /// block is as before then. Its tables are not checked: other bytes in them make another picture, never a panic.
    pub fn resume<'m>(self, plan: &Plan, block: &'m mut [u8]) -> Result<Session<'s, 'm, P, I, L, X>, SessionError> {
        self.carve(plan, block, true)
    }

    /// Carves the block without touching the memory of pixels and statistics.
    fn carve<'m>(
        self,
        plan: &Plan,
        block: &'m mut [u8],
        resume: bool,
    ) -> Result<Session<'s, 'm, P, I, L, X>, SessionError> {
        if let Some(missing) = missing_instructions() {
            return Err(SessionError::Instructions { missing });
        }
        let Self { scene, intersector, selector, extension, profile } = self;
        let scene = with_surfaces::<I>(scene);
        check_effects::<P, X>(&scene)?;
        check_sampler::<P>(plan)?;
        check_guiding::<P>(plan)?;
        let camera_media = || camera_media::<P, I>(&scene, &intersector);
        let mut c = Carver::new(block, plan.session()).map_err(SessionError::Memory)?;
        let s = plan.settings();
        let needs = s.needs(plan.job.cache);
        let record: &mut SessionRecord = c.take_one().map_err(SessionError::Memory)?;
        let mut scalars = match resume {
            true => record.scalars(plan.fingerprint(), &needs).map_err(SessionError::Resume)?,
            false => SessionScalars::new(&scene, camera_media()),
        };
        let another = scalars.scene != scene.hash;
        if another {
            scalars.camera_media = camera_media();
        }
        record.open();
        let state = SessionState {
            plan: *plan,
            record,
            largest: c.take_unset(s.largest_len()).map_err(SessionError::Memory)?,
            film: Film::carve(&mut c, &s.film_layout(), scalars.film).map_err(SessionError::Memory)?,
            finishing: scalars.finishing,
            counters: scalars.counters,
            learned: LearnedState::carve(&mut c, &needs, &scalars.learned).map_err(SessionError::Memory)?,
            epoch: scalars.epoch,
            iteration: scalars.iteration,
            running: scalars.running != 0,
            max_depth: s.max_depth.min(MAX_PATH_LENGTH),
            scene: scene.hash,
            highlight: scene.highlight,
            camera_media: scalars.camera_media,
        };
        let mut session = Session { scene, intersector, selector, extension, state, profile };
        if another {
            session.restart(true);
        }
        Ok(session)
    }

    /// The state of a session with the parts of this builder, for shards to step; in a fixed short time, so that it can
    /// be made for each step (with [`Intersector::SURFACES`] in proportion to the number of materials). After the scene has changed: [`SessionState::change_scene`] first, or the shards begin
    /// anew and the iteration cannot end.
    ///
    /// # Errors
    /// A scene that calls for effects outside the profile.
    pub fn view<'a, 'm>(self, state: &'a SessionState<'m>) -> Result<SessionView<'a, 'm, P, I, L, X>, SessionError>
    where
        's: 'a,
    {
        let Self { scene, intersector, selector, extension, profile } = self;
        let scene = with_surfaces::<I>(scene);
        check_effects::<P, X>(&scene)?;
        check_sampler::<P>(&state.plan)?;
        check_guiding::<P>(&state.plan)?;
        let same = state.scene == scene.hash;
        let camera_media = if same { state.camera_media } else { camera_media::<P, I>(&scene, &intersector) };
        Ok(SessionView { scene, intersector, selector, extension, state, camera_media, profile })
    }
}

/// Effects of the kernels: those of the profile, the host's own scattering model only where there is one.
const fn effects<P: Profile, X: Extension>() -> Effects {
    if X::BSDF { P::EFFECTS } else { P::EFFECTS.without(Effects::OWN) }
}

/// The scene as the surfaces of an intersector see it: any material may be theirs.
fn with_surfaces<I: Intersector>(scene: Scene<'_>) -> Scene<'_> {
    if I::SURFACES { scene.with_all_materials() } else { scene }
}

fn check_effects<P: Profile, X: Extension>(scene: &Scene<'_>) -> Result<(), SessionError> {
    let wanted = if X::POINTS { scene.effects.with(Effects::DIFFUSE) } else { scene.effects };
    let missing = wanted.without(effects::<P, X>()).with(wanted.without(effects::<P::Unguided, X>()));
    if missing == Effects(0) { Ok(()) } else { Err(SessionError::Profile { missing }) }
}

fn check_sampler<P: Profile>(plan: &Plan) -> Result<(), SessionError> {
    match plan.settings().sampler {
        missing @ Sampler::Sobol if !(P::SOBOL && P::Unguided::SOBOL) => Err(SessionError::Sampler { missing }),
        _ => Ok(()),
    }
}

fn check_guiding<P: Profile>(plan: &Plan) -> Result<(), SessionError> {
    const { assert!(!P::Unguided::GUIDING, "the kernels without path guiding have path guiding") };
    if P::GUIDING || !plan.settings().guides() { Ok(()) } else { Err(SessionError::Guiding) }
}

/// Bits of the media that the camera is inside of.
fn camera_media<P: Profile, I: Intersector>(scene: &Scene<'_>, intersector: &I) -> u32 {
    let with_media = P::EFFECTS.contains(Effects::MEDIA) && !scene.media.is_empty();
    if with_media { media_at(scene, intersector, scene.camera.origin) } else { 0 }
}

impl<'s, 'm> Session<'s, 'm> {
    /// A session with all kernels, the scene's own trees for rays and lights (lights by power where it has none), in a
    /// shared block of at least [`Plan::session`] bytes.
    ///
    /// # Errors
    /// A block that does not fit.
    pub fn new(scene: Scene<'s>, plan: &Plan, block: &'m mut [u8]) -> Result<Self, SessionError> {
        Self::builder(scene).build(plan, block)
    }

    /// Goes on with the session that [`Session::suspend`] has left in the block; see [`SessionBuilder::resume`].
    ///
    /// # Errors
    /// A block that does not fit, or holds no suspended session of this plan.
    pub fn resume(scene: Scene<'s>, plan: &Plan, block: &'m mut [u8]) -> Result<Self, SessionError> {
        Self::builder(scene).resume(plan, block)
    }

    /// A session whose parts can be replaced before it is built; at first they are those of [`Session::new`].
    pub fn builder(scene: Scene<'s>) -> SessionBuilder<'s> {
        let (intersector, selector) = (WideBvh::new(&scene), TreeSelector(scene));
        SessionBuilder { scene, intersector, selector, extension: (), profile: PhantomData }
    }
}

/// All show shards the same.
macro_rules! worlds {
    ($($World:ty, $Unguided:ty, $camera_media:expr;)*) => {$(
        impl<P: Profile, I: Intersector, L: LightSelector, X: Extension> Sealed for $World {}

        impl<P: Profile, I: Intersector, L: LightSelector, X: Extension> World for $World {
            const EFFECTS: Effects = effects::<P, X>();
            const LIGHT_TREES: bool = P::LIGHT_TREES;
            const GUIDING: bool = P::GUIDING;
            type Intersector = I;
            type Lights = L;
            type Extension = X;
            type Unguided<'w> = Unguided<'w, $Unguided, I, L, X> where Self: 'w;

            #[inline(always)]
            fn unguided(&self) -> Self::Unguided<'_> {
                Unguided {
                    scene: *self.scene(),
                    intersector: &self.intersector,
                    selector: &self.selector,
                    extension: &self.extension,
                    state: &self.state,
                    camera_media: self.camera_media(),
                    profile: PhantomData,
                }
            }

            #[inline(always)]
            fn scene(&self) -> &Scene<'_> {
                &self.scene
            }

            #[inline(always)]
            fn intersector(&self) -> &I {
                &self.intersector
            }

            #[inline(always)]
            fn lights(&self) -> &L {
                &self.selector
            }

            #[inline(always)]
            fn extension(&self) -> &X {
                &self.extension
            }

            #[inline(always)]
            fn learned(&self) -> &LearnedState<'_> {
                &self.state.learned
            }

            #[inline(always)]
            fn iteration(&self) -> Iteration {
                self.state.iteration
            }

            #[inline(always)]
            fn sampler(&self) -> Sampler {
                if P::SOBOL { self.state.plan.settings().sampler } else { Sampler::Hashed }
            }

            #[inline(always)]
            fn epoch(&self) -> u64 {
                self.state.epoch
            }

            #[inline(always)]
            fn max_depth(&self) -> u32 {
                self.state.max_depth
            }

            #[inline(always)]
            fn camera_media(&self) -> u32 {
                $camera_media(self)
            }
        }
    )*};
}

worlds! {
    Session<'_, '_, P, I, L, X>, P::Unguided, |s: &Self| s.state.camera_media;
    SessionView<'_, '_, P, I, L, X>, P::Unguided, |s: &Self| s.camera_media;
    Unguided<'_, P, I, L, X>, P, |s: &Self| s.camera_media;
}

impl<'m, P: Profile, I: Intersector, L: LightSelector, X: Extension> Deref for Session<'_, 'm, P, I, L, X> {
    type Target = SessionState<'m>;

    #[inline(always)]
    fn deref(&self) -> &SessionState<'m> {
        &self.state
    }
}

impl<P: Profile, I: Intersector, L: LightSelector, X: Extension> DerefMut for Session<'_, '_, P, I, L, X> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.state
    }
}

impl<'s, 'm, P: Profile, I: Intersector, L: LightSelector, X: Extension> Session<'s, 'm, P, I, L, X> {
    /// See [`SessionState::suspend`].
    pub fn suspend(self) {
        self.state.suspend();
    }

    /// The session without its scene.
    pub fn into_state(self) -> SessionState<'m> {
        self.state
    }

    /// The scene.
    pub fn scene(&self) -> &Scene<'s> {
        &self.scene
    }
}

impl<'m> SessionState<'m> {
    /// Leaves the session in its block, to be resumed ([`Session::resume`]) later, in another place, or by another process:
    /// the block holds no addresses. Whatever state it is in goes along, an iteration that is under way included. A
    /// session that is dropped instead cannot be resumed.
    pub fn suspend(self) {
        let scalars = SessionScalars {
            scene: self.scene,
            epoch: self.epoch,
            iteration: self.iteration,
            counters: self.counters,
            film: self.film.scalars(),
            learned: self.learned.scalars(LearnedScalars::new([[0.0; 3]; 2])),
            finishing: self.finishing,
            camera_media: self.camera_media,
            running: u32::from(self.running),
        };
        self.record.suspend(self.plan.fingerprint(), &scalars);
    }

    /// Forgets the picture and begins again with iteration 1 and sample 0; an iteration that is under way is abandoned.
    /// Shards join the next iteration by themselves. Without the statistics the pictures that follow are bit for bit
    /// those of a new session. With them the strategy goes on with what it has learned, of the scene and of the picture,
    /// which changes efficiency only.
    pub fn restart(&mut self, keep_statistics: bool) {
        self.epoch = self.epoch.wrapping_add(1);
        self.iteration = Iteration::default();
        self.running = false;
        self.counters = Counters::default();
        self.finishing = Finishing::default();
        self.film.clear();
        self.learned.forget_film();
        if !keep_statistics {
            self.learned.forget();
        }
    }

    /// Number of restarts.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Goes over to a scene that was edited, or another one: [`Self::restart`] for it. Sizes and depth stay those of
    /// the settings. In scenes with media it traces rays in eight directions to find those around the camera, without a
    /// budget.
    ///
    /// # Errors
    /// A scene that calls for effects outside the profile `P`; then nothing of the session has changed. Edits of the scene
    /// stay: they must be taken back, or the session is left with a scene that it cannot show.
    pub fn change_scene<P: Profile, I: Intersector, L: LightSelector, X: Extension>(
        &mut self,
        to: &SessionBuilder<'_, P, I, L, X>,
        keep_statistics: bool,
    ) -> Result<(), SessionError> {
        check_effects::<P, X>(&to.scene)?;
        self.restart(keep_statistics);
        (self.scene, self.highlight) = (to.scene.hash, to.scene.highlight);
        self.camera_media = camera_media::<P, I>(&to.scene, &to.intersector);
        Ok(())
    }

    /// What shards must have joined.
    fn identity(&self) -> Identity {
        Identity { scene: self.scene, epoch: self.epoch, iteration: self.iteration }
    }

    /// Begins a round of `samples` camera samples per pixel. Shards notice at their next step. Takes a few instructions, with
    /// [`Settings::adaptive`](crate::Settings::adaptive) a pass over the tiles of the picture.
    pub fn begin_iteration(&mut self, samples: u32) {
        let i = self.iteration;
        self.iteration = Iteration {
            number: i.number.wrapping_add(1),
            first_sample: i.first_sample.wrapping_add(i.samples),
            samples,
        };
        self.learned.begin(samples);
        self.finishing = Finishing::default();
        self.running = true;
    }

    /// Goes on as if so many iterations, of so many camera samples per pixel in all, had been before: for one picture in
    /// parts that are rendered apart. Parts with other numbers of iterations and disjoint ranges of samples draw other
    /// random numbers: other points of the same sequences, or independent ones. Not while an iteration runs: nothing
    /// happens then.
    pub fn skip(&mut self, iterations: u64, samples: u32) {
        if !self.running {
            self.iteration = Iteration { number: iterations, first_sample: samples, samples: 0 };
        }
    }

    /// The picture so far, without the iteration under way.
    pub fn film(&self) -> &Film<'m> {
        &self.film
    }

    /// Variance and cost per camera sample: of the last iteration, and blended over the iterations as factors use them.
    /// All 0 unless the strategy learns.
    pub fn picture_statistics(&self) -> [PictureStatistics; 2] {
        self.learned.statistics()
    }

    /// The statistics of the scene, if the strategy learns them (`bolin-meyer` learns of the picture).
    /// [`Self::save_statistics`] saves them with the guide.
    pub fn cache(&self) -> Option<&Cache<'m>> {
        self.learned.cache()
    }

    /// See [`Self::cache`]. Whatever is loaded changes efficiency only. Not while an iteration runs: `None` then.
    pub fn cache_mut(&mut self) -> Option<&mut Cache<'m>> {
        if self.running { None } else { self.learned.cache_mut() }
    }

    /// The distributions of path guiding, if it is on.
    pub fn guide(&self) -> Option<&Guide<'m>> {
        self.learned.guide()
    }

    /// Whether path guiding pays, if the settings leave that to the render
    /// ([`Guiding::Auto`](crate::unstable::learn::Guiding::Auto)).
    pub fn guide_use(&self) -> Option<GuideUse> {
        self.learned.guide_use()
    }

    /// See [`Self::guide`]. Whatever is loaded changes efficiency only. Not while an iteration runs: `None` then.
    pub fn guide_mut(&mut self) -> Option<&mut Guide<'m>> {
        if self.running { None } else { self.learned.guide_mut() }
    }

    /// The estimate of the pixels that the strategy works with, rgb planes; `None` if it needs none, or before the end
    /// of the first iteration.
    pub fn estimate(&self) -> Option<[&[f32]; 3]> {
        self.learned.estimate()
    }

    /// Replaces the built-in estimate of the pixels by the host's, row by row, for good. It changes efficiency only.
    ///
    /// # Errors
    /// [`SessionError::Estimate`] if there is not one value per pixel, the settings have no estimate per pixel, or an
    /// iteration runs.
    pub fn give_estimate(&mut self, rgb: &[[f32; 3]]) -> Result<(), SessionError> {
        if self.running || !self.learned.give_estimate(rgb, &self.film) {
            return Err(SessionError::Estimate { given: rgb.len() });
        }
        Ok(())
    }

    /// Counts of all finished iterations.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The current iteration.
    pub fn iteration(&self) -> Iteration {
        self.iteration
    }
}

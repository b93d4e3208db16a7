//! What all shards share: frozen while they work, changed between iterations.

use crate::accel::{Intersector, WideBvh};
use crate::counters::Counters;
use crate::film::{Film, PixelSums};
use crate::instructions::{INSTRUCTION_SET, missing_instructions};
use crate::learn::cache::Cache;
use crate::learn::{LearnedState, PictureStatistics};
use crate::light::{LightSelector, PowerSelector};
use crate::memory::{Carver, MemoryError};
use crate::plan::Plan;
use crate::profile::{Full, Profile};
use crate::scene::{Effects, Scene};
use crate::settings::MAX_PATH_LENGTH;
use crate::tracer::{Shard, media_at};
use crate::world::sealed::Sealed;
use crate::world::{Iteration, World};
use core::fmt;
use core::marker::PhantomData;

/// Why a session cannot start or an iteration cannot end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SessionError {
    /// The processor lacks instructions that this build uses ([`crate::INSTRUCTION_SET`]).
    Instructions {
        /// The first set that is missing.
        missing: &'static str,
    },
    /// The shared block does not fit.
    Memory(MemoryError),
    /// The scene calls for effects that the profile was compiled without.
    Profile {
        /// The missing effects.
        missing: Effects,
    },
    /// The shards are not all of the plan's, in order.
    Shards {
        /// Index expected next.
        expected: u32,
    },
    /// This shard has not finished the iteration.
    Unfinished {
        /// Index of the shard.
        shard: u32,
    },
    /// This shard was made for other settings.
    Plan {
        /// Index of the shard.
        shard: u32,
    },
    /// No iteration has begun.
    NoIteration,
    /// An estimate of the pixels that does not fit.
    Estimate {
        /// Number of values given.
        given: usize,
    },
}

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Instructions { missing } => {
                write!(f, "this build needs a processor with {INSTRUCTION_SET}; this one lacks {missing}")
            }
            Self::Memory(e) => write!(f, "session: {e}"),
            Self::Profile { missing } => {
                f.write_str("the scene calls for effects outside the kernel profile:")?;
                let mut names = missing.names().enumerate();
                names.try_for_each(|(i, name)| write!(f, "{}{name}", if i == 0 { " " } else { ", " }))
            }
            Self::Shards { expected } => {
                write!(f, "end_iteration needs every shard in order; shard {expected} is missing")
            }
            Self::Unfinished { shard } => write!(f, "shard {shard} has not finished the iteration"),
            Self::Plan { shard } => write!(f, "shard {shard} was made for another plan"),
            Self::Estimate { given } => {
                write!(f, "an estimate of {given} values does not fit the settings, or comes while an iteration runs")
            }
            Self::NoIteration => f.write_str("no iteration has begun"),
        }
    }
}

impl core::error::Error for SessionError {}

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

/// The shared side of a render: scene, kernels, learned state and film. Frozen while shards step, changed between
/// iterations.
#[derive(Debug)]
pub struct Session<'s, 'm, P: Profile = Full, I: Intersector = WideBvh<'s>, L: LightSelector = PowerSelector<'s>> {
    scene: Scene<'s>,
    plan: Plan,
    intersector: I,
    selector: L,
    film: Film<'m>,
    counters: Counters,
    learned: LearnedState<'m>,
    iteration: Iteration,
    running: bool,
    max_depth: u32,
    camera_media: u32,
    profile: PhantomData<P>,
}

/// The replaceable parts of a session; see [`Session::builder`].
#[derive(Clone, Copy, Debug)]
pub struct SessionBuilder<'s, P: Profile = Full, I: Intersector = WideBvh<'s>, L: LightSelector = PowerSelector<'s>> {
    scene: Scene<'s>,
    intersector: I,
    selector: L,
    profile: PhantomData<P>,
}

impl<'s, P: Profile, I: Intersector, L: LightSelector> SessionBuilder<'s, P, I, L> {
    /// Kernels of another profile: those of `Q` and no more are compiled in.
    pub fn profile<Q: Profile>(self) -> SessionBuilder<'s, Q, I, L> {
        let Self { scene, intersector, selector, .. } = self;
        SessionBuilder { scene, intersector, selector, profile: PhantomData }
    }

    /// Another intersector than the scene's own tree.
    pub fn intersector<J: Intersector>(self, intersector: J) -> SessionBuilder<'s, P, J, L> {
        let Self { scene, selector, profile, .. } = self;
        SessionBuilder { scene, intersector, selector, profile }
    }

    /// Another choice of lights than by power.
    pub fn light_selector<M: LightSelector>(self, selector: M) -> SessionBuilder<'s, P, I, M> {
        let Self { scene, intersector, profile, .. } = self;
        SessionBuilder { scene, intersector, selector, profile }
    }

    /// Carves the shared block of at least [`Plan::session`] bytes.
    ///
    /// # Errors
    /// A scene that calls for effects outside the profile, or a block that does not fit.
    pub fn build<'m>(self, plan: &Plan, block: &'m mut [u8]) -> Result<Session<'s, 'm, P, I, L>, SessionError> {
        if let Some(missing) = missing_instructions() {
            return Err(SessionError::Instructions { missing });
        }
        let Self { scene, intersector, selector, profile } = self;
        if !P::EFFECTS.contains(scene.effects) {
            return Err(SessionError::Profile { missing: scene.effects.without(P::EFFECTS) });
        }
        let with_media = P::EFFECTS.contains(Effects::MEDIA) && !scene.media.is_empty();
        let camera_media = if with_media { media_at(&scene, &intersector, scene.camera.origin) } else { 0 };
        let mut c = Carver::new(block, plan.session()).map_err(SessionError::Memory)?;
        let s = plan.settings();
        let pixels = s.size[0] as usize * s.size[1] as usize;
        Ok(Session {
            scene,
            plan: *plan,
            intersector,
            selector,
            film: Film::new(
                s.size,
                c.take(pixels).map_err(SessionError::Memory)?,
                c.take(if s.aovs { pixels } else { 0 }).map_err(SessionError::Memory)?,
            ),
            counters: Counters::default(),
            learned: LearnedState::carve(&mut c, &s.needs(plan.job.cache), &scene).map_err(SessionError::Memory)?,
            iteration: Iteration::default(),
            running: false,
            max_depth: s.max_depth.min(MAX_PATH_LENGTH),
            camera_media,
            profile,
        })
    }
}

impl<'s, 'm> Session<'s, 'm> {
    /// A session with all kernels, the scene's own tree and lights chosen by power, in a shared block of at least
    /// [`Plan::session`] bytes.
    ///
    /// # Errors
    /// A block that does not fit.
    pub fn new(scene: Scene<'s>, plan: &Plan, block: &'m mut [u8]) -> Result<Self, SessionError> {
        Self::builder(scene).build(plan, block)
    }

    /// A session whose parts can be replaced before it is built; at first they are those of [`Session::new`].
    pub fn builder(scene: Scene<'s>) -> SessionBuilder<'s> {
        let (intersector, selector) = (WideBvh::new(&scene), PowerSelector(scene));
        SessionBuilder { scene, intersector, selector, profile: PhantomData }
    }
}

impl<P: Profile, I: Intersector, L: LightSelector> Sealed for Session<'_, '_, P, I, L> {}

impl<P: Profile, I: Intersector, L: LightSelector> World for Session<'_, '_, P, I, L> {
    const EFFECTS: Effects = P::EFFECTS;
    type Intersector = I;
    type Lights = L;

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
    fn learned(&self) -> &LearnedState<'_> {
        &self.learned
    }

    #[inline(always)]
    fn iteration(&self) -> Iteration {
        self.iteration
    }

    #[inline(always)]
    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    #[inline(always)]
    fn camera_media(&self) -> u32 {
        self.camera_media
    }
}

impl<'s, 'm, P: Profile, I: Intersector, L: LightSelector> Session<'s, 'm, P, I, L> {
    /// Begins a round of `samples` camera samples per pixel. Shards notice at their next step.
    pub fn begin_iteration(&mut self, samples: u32) {
        let i = self.iteration;
        self.iteration =
            Iteration { number: i.number + 1, first_sample: i.first_sample.wrapping_add(i.samples), samples };
        self.learned.begin(samples, &self.film);
        self.running = true;
    }

    /// Merges what the shards gathered, in shard order. All of them must be there and have finished (or have been
    /// stopped and drained); after an error the film is as before.
    pub fn end_iteration<'a, 'b: 'a>(
        &mut self,
        shards: impl IntoIterator<Item = &'a Shard<'b>> + Clone,
    ) -> Result<(), SessionError> {
        self.end_iteration_in_phases(shards, |_| ())
    }

    /// [`Self::end_iteration`] for hosts with a clock: `passed` is called after each phase.
    pub fn end_iteration_in_phases<'a, 'b: 'a>(
        &mut self,
        shards: impl IntoIterator<Item = &'a Shard<'b>> + Clone,
        mut passed: impl FnMut(Phase),
    ) -> Result<(), SessionError> {
        if !self.running {
            return Err(SessionError::NoIteration);
        }
        let mut expected = 0;
        for s in shards.clone() {
            if s.index() != expected {
                return Err(SessionError::Shards { expected });
            }
            // its sums would go to the wrong pixels
            if s.settings() != self.plan.settings() {
                return Err(SessionError::Plan { shard: s.index() });
            }
            if !s.is_done(World::identity(self)) {
                return Err(SessionError::Unfinished { shard: s.index() });
            }
            expected += 1;
        }
        if expected != self.plan.settings().shards {
            return Err(SessionError::Shards { expected });
        }
        let mut counters = Counters::default();
        shards.clone().into_iter().for_each(|s| counters.merge(s.counters()));
        let visit = |show: &mut dyn FnMut(usize, &PixelSums)| {
            shards.clone().into_iter().for_each(|s| s.for_each_pixel(|i, sums, _| show(i, sums)));
        };
        self.learned.measure_picture(&counters, visit);
        for s in shards.clone() {
            s.for_each_pixel(|i, sums, aov| {
                let w = self.learned.weight_of(i);
                self.film.merge(i, sums, aov, w);
            });
        }
        self.film.end_iteration();
        self.counters.merge(&counters);
        passed(Phase::Merged);
        self.learned.learn_picture(&self.film, &counters, visit);
        passed(Phase::Estimated);
        self.learned.learn_scene(shards.into_iter().filter_map(Shard::training));
        passed(Phase::Learned);
        self.running = false;
        Ok(())
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

    /// The statistics of the scene, if the strategy learns them (`bolin-meyer` learns of the picture): to be saved, or
    /// loaded before the first iteration.
    pub fn cache(&self) -> Option<&Cache<'m>> {
        self.learned.cache()
    }

    /// See [`Self::cache`]. Whatever is loaded changes efficiency only. Not while an iteration runs: `None` then.
    pub fn cache_mut(&mut self) -> Option<&mut Cache<'m>> {
        if self.running { None } else { self.learned.cache_mut() }
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
        if self.running || !self.learned.give_estimate(rgb) {
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

    /// The scene.
    pub fn scene(&self) -> &Scene<'s> {
        &self.scene
    }
}

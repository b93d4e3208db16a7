//! What all shards share: frozen while they work, changed between iterations.

use crate::accel::Intersector;
use crate::film::Film;
use crate::light::PowerSelector;
use crate::memory::{Carver, MemoryError};
use crate::profile::Profile;
use crate::scene::{Effects, Scene};
use crate::settings::{HARD_STOP, Plan};
use crate::tracer::{Counters, Shard};
use core::fmt;
use core::marker::PhantomData;

/// Why a session cannot start or an iteration cannot end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SessionError {
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
        /// Its index.
        shard: u32,
    },
    /// This shard was made for other settings.
    Plan {
        /// Its index.
        shard: u32,
    },
    /// No iteration has begun.
    NoIteration,
}

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Memory(e) => write!(f, "session: {e}"),
            Self::Profile { missing } => {
                f.write_str("the scene calls for effects outside the kernel profile:")?;
                let names = Effects::NAMES.iter().filter(|(e, _)| missing.intersects(*e));
                names.enumerate().try_for_each(|(i, (_, n))| write!(f, "{}{n}", if i == 0 { " " } else { ", " }))
            }
            Self::Shards { expected } => {
                write!(f, "end_iteration needs every shard in order; shard {expected} is missing")
            }
            Self::Unfinished { shard } => write!(f, "shard {shard} has not finished the iteration"),
            Self::Plan { shard } => write!(f, "shard {shard} was made for another plan"),
            Self::NoIteration => f.write_str("no iteration has begun"),
        }
    }
}

impl core::error::Error for SessionError {}

/// One round of camera samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Iteration {
    /// 1 for the first; 0 before it.
    pub number: u64,
    /// Camera samples per pixel before it.
    pub first_sample: u32,
    /// Camera samples per pixel in it.
    pub samples: u32,
}

/// The shared side of a render: scene, intersector and film.
#[derive(Debug)]
pub struct Session<'s, 'm, P: Profile, I: Intersector> {
    scene: Scene<'s>,
    plan: Plan,
    intersector: I,
    selector: PowerSelector<'s>,
    film: Film<'m>,
    counters: Counters,
    iteration: Iteration,
    running: bool,
    max_depth: u32,
    profile: PhantomData<P>,
}

impl<'s, 'm, P: Profile, I: Intersector> Session<'s, 'm, P, I> {
    /// Carves the shared block of at least `plan.session()`.
    pub fn new(scene: Scene<'s>, intersector: I, plan: &Plan, block: &'m mut [u8]) -> Result<Self, SessionError> {
        if !P::EFFECTS.contains(scene.effects) {
            return Err(SessionError::Profile { missing: Effects(scene.effects.0 & !P::EFFECTS.0) });
        }
        let mut c = Carver::new(block, plan.session()).map_err(SessionError::Memory)?;
        let s = plan.settings();
        let pixels = s.size[0] as usize * s.size[1] as usize;
        Ok(Self {
            scene,
            plan: *plan,
            intersector,
            selector: PowerSelector(scene),
            film: Film {
                size: s.size,
                pixels: c.take(pixels).map_err(SessionError::Memory)?,
                aovs: c.take(if s.aovs { pixels } else { 0 }).map_err(SessionError::Memory)?,
            },
            counters: Counters::default(),
            iteration: Iteration::default(),
            running: false,
            max_depth: s.max_depth.min(HARD_STOP),
            profile: PhantomData,
        })
    }

    /// Begins a round of `samples` camera samples per pixel. Shards notice at their next step.
    pub fn begin_iteration(&mut self, samples: u32) {
        let i = self.iteration;
        self.iteration =
            Iteration { number: i.number + 1, first_sample: i.first_sample.wrapping_add(i.samples), samples };
        self.running = true;
    }

    /// Merges what the shards gathered, in shard order. All of them must be there and have finished (or have been
    /// stopped and drained); after an error the film is as before.
    pub fn end_iteration<'a, 'b: 'a>(
        &mut self,
        shards: impl IntoIterator<Item = &'a Shard<'b>> + Clone,
    ) -> Result<(), SessionError> {
        if !self.running {
            return Err(SessionError::NoIteration);
        }
        let mut expected = 0;
        for s in shards.clone() {
            if s.index != expected {
                return Err(SessionError::Shards { expected });
            }
            // its sums would go to the wrong pixels
            if s.settings() != self.plan.settings() {
                return Err(SessionError::Plan { shard: s.index });
            }
            if !s.is_done(self.iteration.number) {
                return Err(SessionError::Unfinished { shard: s.index });
            }
            expected += 1;
        }
        if expected != self.plan.settings().shards {
            return Err(SessionError::Shards { expected });
        }
        for s in shards {
            s.for_each_pixel(|i, stats, aov| self.film.merge(i, stats, aov));
            self.counters.merge(s.counters());
        }
        self.running = false;
        Ok(())
    }

    /// The picture so far, without the iteration under way.
    pub fn film(&self) -> &Film<'m> {
        &self.film
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

    pub(crate) fn intersector(&self) -> &I {
        &self.intersector
    }

    pub(crate) fn selector(&self) -> &PowerSelector<'s> {
        &self.selector
    }

    /// Path segments at which every path ends.
    pub(crate) fn max_depth(&self) -> u32 {
        self.max_depth
    }
}

//! The tracer compiled for one profile, as a value.

use croupier::unstable::Effects;
use croupier::unstable::profile::{AnyProfile, Profile, ProfileVisitor};
use croupier::{Counters, Plan, Scene};
use croupier_benches::serial;
use std::error::Error;

/// Renders a scene, with numbers of samples.
type Render = fn(Scene<'_>, &Plan, &[u32]) -> Result<(Counters, f64), Box<dyn Error>>;

/// The tracer of one profile.
#[derive(Clone, Copy)]
pub(crate) struct Instance {
    /// Name of the profile.
    pub(crate) name: &'static str,
    /// Effects that it contains.
    pub(crate) effects: Effects,
    /// [`serial::render_with`] of the profile.
    pub(crate) render: Render,
    /// Address of the function that steps.
    pub(crate) step: fn() -> usize,
}

impl Instance {
    /// The tracer of profile `P`.
    pub(crate) const fn of<P: Profile>() -> Self {
        Self {
            name: P::NAME,
            effects: P::EFFECTS,
            render: serial::render_with::<P>,
            step: serial::address_of_step::<P>,
        }
    }

    /// The tracer of a profile of the closed set.
    pub(crate) fn of_set(profile: AnyProfile) -> Self {
        struct Make;
        impl ProfileVisitor for Make {
            type Out = Instance;

            fn visit<P: Profile + Send + Sync>(self) -> Instance {
                Instance::of::<P>()
            }
        }
        profile.dispatch(Make)
    }
}

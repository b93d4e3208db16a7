//! A whole render on one thread: shards are stepped one after the other, iterations follow each other.
//!
//! The two parts of an iteration are functions that are never inlined, so that a profiler finds them by their names
//! ([`STEP`], [`END`]).

use crate::clock::Clock;
use croupier::unstable::profile::{AnyProfile, Profile, ProfileVisitor};
use croupier::{Budget, Counters, Plan, Scene, Session, SessionError, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use std::error::Error;

/// The function that steps all shards through an iteration.
pub const STEP: &str = "bench_step_shards";
/// The function that ends an iteration: merging, denoising, learning.
pub const END: &str = "bench_end_iteration";

type Tracer<'s, 'm, P> = Session<'s, 'm, P>;

/// Renders one iteration for each number of samples per pixel; counters of the whole render, and the seconds of its
/// iterations.
pub fn render(scene: Scene<'_>, plan: &Plan, iterations: &[u32]) -> Result<(Counters, f64), Box<dyn Error>> {
    let guided = plan.settings().guides();
    AnyProfile::smallest(scene.effects).dispatch_guided(guided, Render { scene, plan, iterations })
}

/// A render whose profile is to be chosen.
struct Render<'a, 's> {
    scene: Scene<'s>,
    plan: &'a Plan,
    iterations: &'a [u32],
}

impl ProfileVisitor for Render<'_, '_> {
    type Out = Result<(Counters, f64), Box<dyn Error>>;

    fn visit<P: Profile + Send + Sync>(self) -> Self::Out {
        render_with::<P>(self.scene, self.plan, self.iterations)
    }
}

/// [`render`] with the profile `P`.
pub fn render_with<P: Profile>(
    scene: Scene<'_>,
    plan: &Plan,
    iterations: &[u32],
) -> Result<(Counters, f64), Box<dyn Error>> {
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let shards = plan.settings().shards;
    let mut blocks: Vec<_> = (0..shards).map(|_| AlignedBytes::zeroed(plan.shard().size)).collect();
    let mut session = Session::builder(scene).profile::<P>().build(plan, shared.as_mut())?;
    let shards = blocks.iter_mut().zip(0..).map(|(b, i)| Shard::new(plan, i, b.as_mut()));
    let mut shards = shards.collect::<Result<Vec<_>, _>>()?;
    let clock = Clock::start();
    for &samples in iterations {
        session.begin_iteration(samples);
        bench_step_shards(&session, &mut shards);
        bench_end_iteration(&mut session, &shards)?;
    }
    Ok((*session.counters(), clock.seconds()))
}

/// Address of the function that steps with profile `P`, to find it in a disassembly.
pub fn address_of_step<P: Profile>() -> usize {
    bench_step_shards::<P> as *const () as usize
}

#[inline(never)]
fn bench_step_shards<P: Profile>(session: &Tracer<'_, '_, P>, shards: &mut [Shard<'_>]) {
    for shard in shards {
        while shard.step(session, Budget { rays: u64::MAX }) == StepResult::More {}
    }
}

#[inline(never)]
fn bench_end_iteration<P: Profile>(session: &mut Tracer<'_, '_, P>, shards: &[Shard<'_>]) -> Result<(), SessionError> {
    session.end_iteration(shards)
}

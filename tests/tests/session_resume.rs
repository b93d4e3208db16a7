//! Sessions that are suspended in their block, resumed, and restarted.

use croupier::unstable::learn::{Guiding, Learning};
use croupier::unstable::profile::{Full, Guided, Profile, Surfaces};
use croupier::unstable::scene::blob::content_hash;
use croupier::unstable::{ResumeError, World};
use croupier::{Budget, Plan, Scene, Session, SessionError, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{Model, Reflectance};
use croupier_tests::runner::{finish, kinds_of_statistics, memory, shown};
use croupier_tests::scenes::*;
use croupier_tests::stats::SplitMix;

const ITERATIONS: [u32; 4] = [4, 8, 3, 8];

/// Strategies that guide paths, always and where it pays, with and without statistics of their own.
fn kinds_of_guides(bytes: &[u8]) -> Vec<Settings> {
    let guided = |mut s: Settings, guiding| {
        s.learning = Learning { guiding, guide_bytes: 1 << 20, ..s.learning };
        s
    };
    let kinds = kinds_of_statistics(bytes, 2);
    let [classic, ears, .., sobol] = kinds[..] else { unreachable!() };
    vec![guided(classic, Guiding::On), guided(ears, Guiding::On), guided(sobol, Guiding::Auto)]
}

/// All that a session shows and has learned, as bytes.
fn everything<P: Profile>(session: &Session<'_, '_, P>) -> Vec<u8> {
    let mut all = shown(session);
    let mut statistics = vec![0; session.saved_statistics_len()];
    let _ = session.save_statistics(&mut statistics);
    all.extend(statistics);
    all.extend(format!("{:?}", session.guide_use()).into_bytes());
    all
}

/// Renders all iterations.
fn render<P: Profile>(session: &mut Session<'_, '_, P>, shards: &mut [Shard<'_>]) {
    for samples in ITERATIONS {
        session.begin_iteration(samples);
        shards.iter_mut().for_each(|s| finish(session, s, 1 << 20));
        session.end_iteration(&*shards).unwrap();
    }
}

fn shards<'m>(plan: &Plan, blocks: &'m mut [AlignedBytes]) -> Vec<Shard<'m>> {
    blocks.iter_mut().enumerate().map(|(i, b)| Shard::new(plan, i as u32, b.as_mut()).unwrap()).collect()
}

fn blocks(plan: &Plan) -> Vec<AlignedBytes> {
    (0..plan.settings().shards).map(|_| memory(plan.shard().size, 0xff)).collect()
}

/// Killed by: a scalar that is not stored, memory that `resume` clears, a flag that is lost.
#[test]
fn a_session_goes_on_where_it_was_suspended() {
    let bytes = blob(&cornell([20, 12]));
    kinds_of_statistics(&bytes, 2).iter().for_each(|s| goes_on::<Full>(&bytes, s));
    kinds_of_guides(&bytes).iter().for_each(|s| goes_on::<Guided<Surfaces>>(&bytes, s));
}

fn goes_on<P: Profile>(bytes: &[u8], s: &Settings) {
    let scene = Scene::from_bytes(bytes).unwrap();
    let plan = Plan::new(s).unwrap();
    let builder = || Session::builder(scene).profile::<P>();
    let (mut block, mut own) = (memory(plan.session().size, 0xff), blocks(&plan));
    let mut session = builder().build(&plan, block.as_mut()).unwrap();
    render(&mut session, &mut shards(&plan, &mut own));
    let clean = everything(&session);
    if s.learning.guiding == Guiding::On {
        assert!(session.guide().unwrap().mean_fraction() > 0.1);
    }

    // the block changes places every time
    let (mut block, mut own) = (memory(plan.session().size, 0xff), blocks(&plan));
    let mut shards = shards(&plan, &mut own);
    builder().build(&plan, block.as_mut()).unwrap().suspend();
    let mut moved = |work: &mut dyn FnMut(&mut Session<'_, '_, P>)| {
        let mut other = memory(plan.session().size, 0xff);
        other.as_mut().copy_from_slice(block.as_ref());
        block = other;
        let mut session = builder().resume(&plan, block.as_mut()).unwrap();
        work(&mut session);
        session.suspend();
    };
    for samples in ITERATIONS {
        moved(&mut |session| session.begin_iteration(samples));
        moved(&mut |session| {
            shards.iter_mut().for_each(|s| {
                s.step(session, Budget { rays: 500 });
            });
        });
        moved(&mut |session| shards.iter_mut().for_each(|s| finish(session, s, 1 << 20)));
        moved(&mut |session| session.end_iteration(&shards).unwrap());
    }
    let mut found = Vec::new();
    moved(&mut |session| found = everything(session));
    assert!(found == clean, "{}, guiding {:?}", s.strategy, s.learning.guiding);
}

/// Killed by: statistics, samples or numbers of before that stay, shards whose sums of before are taken.
#[test]
fn a_restarted_session_renders_what_a_new_one_does() {
    let bytes = blob(&cornell([20, 12]));
    kinds_of_statistics(&bytes, 2).iter().for_each(|s| starts_again::<Full>(&bytes, s));
    kinds_of_guides(&bytes).iter().for_each(|s| starts_again::<Guided<Surfaces>>(&bytes, s));
}

fn starts_again<P: Profile>(bytes: &[u8], s: &Settings) {
    let scene = Scene::from_bytes(bytes).unwrap();
    let plan = Plan::new(s).unwrap();
    let (mut block, mut own) = (memory(plan.session().size, 0xff), blocks(&plan));
    let mut shards = shards(&plan, &mut own);
    let mut session = Session::builder(scene).profile::<P>().build(&plan, block.as_mut()).unwrap();
    render(&mut session, &mut shards);
    let clean = everything(&session);
    let before = session.identity();
    // between iterations, and while one runs
    for part in [0, 1, 2] {
        if part > 0 {
            session.begin_iteration(8);
            shards.iter_mut().take(part).for_each(|s| finish(&session, s, 1 << 20));
        }
        session.restart(false);
        assert_ne!(session.identity().epoch, before.epoch);
        assert_eq!(session.end_iteration(&shards), Err(SessionError::NoIteration));
        // the same numbers again: the sums of before are those of another epoch
        session.begin_iteration(ITERATIONS[3]);
        assert_eq!(session.end_iteration(&shards), Err(SessionError::Unfinished { shard: 0 }));
        session.restart(false);
        render(&mut session, &mut shards);
        assert!(everything(&session) == clean, "{}, guiding {:?}, part {part}", s.strategy, s.learning.guiding);
    }
    // with its statistics it renders something else, if it has any, with as many samples
    session.restart(true);
    let kept = session.cache().map(|c| c.leaves());
    assert!(kept.is_none_or(|leaves| leaves > 6));
    render(&mut session, &mut shards);
    let learns = s.strategy.name() != "classic" || s.learning.guiding != Guiding::Off;
    assert_eq!(everything(&session) != clean, learns, "{}, guiding {:?}", s.strategy, s.learning.guiding);
}

/// A session that is resumed with another scene begins its picture anew, as a restart with the statistics does. Killed by:
/// samples of the old scene in the picture of the new one, an iteration of the old one that goes on, the highlight of the
/// old one.
#[test]
fn another_scene_begins_another_picture() {
    let bytes = blob(&cornell([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let mut other = cornell([20, 12]);
    other.camera.origin[0] += 0.125;
    // has highlights, for a mirror that no triangle has
    other.add_material("mirror", Model::Mirror { reflectance: Reflectance::Constant([1.0; 3]) });
    let other = blob(&other);
    let other = Scene::from_bytes(&other).unwrap();
    for s in kinds_of_statistics(&bytes, 3) {
        let plan = Plan::new(&s).unwrap();
        let (mut block, mut own) = (memory(plan.session().size, 0xff), blocks(&plan));
        let mut shards = shards(&plan, &mut own);
        let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
        render(&mut session, &mut shards);
        session.begin_iteration(8);
        session.suspend();
        let mut copy = memory(plan.session().size, 0xff);
        copy.as_mut().copy_from_slice(block.as_ref());

        let mut resumed = Session::resume(other, &plan, block.as_mut()).unwrap();
        assert!(resumed.film().pixels().all(|p| p.samples == 0));
        assert_eq!(resumed.end_iteration(&shards), Err(SessionError::NoIteration));
        render(&mut resumed, &mut shards);
        let mut changed = Session::resume(scene, &plan, copy.as_mut()).unwrap();
        changed.change_scene(&Session::builder(other), true).unwrap();
        // what edits do, by another way
        let mut state = changed.into_state();
        for samples in ITERATIONS {
            state.begin_iteration(samples);
            let view = Session::builder(other).view(&state).unwrap();
            for shard in &mut shards {
                while shard.step(&view, Budget { rays: 1 << 20 }) == StepResult::More {}
            }
            state.end_iteration(&shards).unwrap();
        }
        let sums =
            |film: &croupier::Film<'_>| bytemuck::cast_slice::<_, u8>(&film.pixels().collect::<Vec<_>>()).to_vec();
        assert!(sums(resumed.film()) == sums(state.film()), "{}", s.strategy);
        let highlight = resumed.film().error_estimate().highlight;
        assert!(highlight > 0.0 && highlight == state.film().error_estimate().highlight);
        assert!(resumed.counters().camera_samples == 20 * 12 * 23);
    }
}

/// Killed by: a block that is resumed twice or was never suspended, settings that are left out of the fingerprint, a
/// record that is taken although a bit of it has changed.
#[test]
fn other_blocks_are_refused() {
    let bytes = blob(&cornell([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = kinds_of_statistics(&bytes, 2)[1];
    let plan = Plan::new(&s).unwrap();
    let mut block = memory(plan.session().size, 0xff);
    let resume =
        |plan: &Plan, block: &mut AlignedBytes| Session::resume(scene, plan, block.as_mut()).map(Session::suspend);
    let refused = |e| Err(SessionError::Resume(e));
    assert_eq!(resume(&plan, &mut block), refused(ResumeError::NotSuspended));
    let _ = Session::new(scene, &plan, block.as_mut()).unwrap();
    assert_eq!(resume(&plan, &mut block), refused(ResumeError::NotSuspended));
    Session::new(scene, &plan, block.as_mut()).unwrap().suspend();
    for other in [Settings { seed: 1, ..s }, Settings { split_budget: 7, ..s }, Settings { max_depth: 3, ..s }] {
        assert_eq!(resume(&Plan::new(&other).unwrap(), &mut block), refused(ResumeError::Plan));
    }
    assert_eq!(resume(&plan, &mut block), Ok(()));
    for byte in [40, 80, 200, 500] {
        block.as_mut()[byte] ^= 4;
        assert_eq!(resume(&plan, &mut block), refused(ResumeError::Damaged), "byte {byte}");
        block.as_mut()[byte] ^= 4;
    }
    assert_eq!(resume(&plan, &mut block), Ok(()));
    let _ = Session::resume(scene, &plan, block.as_mut()).unwrap();
    assert_eq!(resume(&plan, &mut block), refused(ResumeError::NotSuspended));
}

/// Scalars that nobody wrote, with a hash that fits: refused or harmless. Killed by: a counter from memory that is used
/// as an index, a sum of counters that overflows before it is checked.
#[test]
fn made_up_records_do_no_harm() {
    let bytes = blob(&cornell([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let mut rng = SplitMix(5);
    let (mut taken, mut refused) = (0, 0);
    for s in kinds_of_statistics(&bytes, 2) {
        let plan = Plan::new(&s).unwrap();
        let mut block = memory(plan.session().size, 0xff);
        Session::new(scene, &plan, block.as_mut()).unwrap().suspend();
        // magic, state, fingerprint, hash, scalars
        let words = (0..200).find(|&n| {
            let b = block.as_ref();
            content_hash(&b[32..32 + 8 * n]) == u64::from_le_bytes(b[24..32].try_into().unwrap())
        });
        let words = words.expect("the hash is that of the scalars");
        for round in 0..200 {
            let mut block = memory(plan.session().size, 0xff);
            Session::new(scene, &plan, block.as_mut()).unwrap().suspend();
            let b = block.as_mut();
            for _ in 0..=round % 4 {
                let at = 32 + 4 * (rng.bits() as usize % (2 * words));
                let value = [rng.bits() as u32, u32::MAX, 0, 1 << 31, 7][rng.bits() as usize % 5];
                b[at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
            let hash = content_hash(&b[32..32 + 8 * words]);
            b[24..32].copy_from_slice(&hash.to_le_bytes());
            let Ok(mut session) = Session::resume(scene, &plan, block.as_mut()) else {
                refused += 1;
                continue;
            };
            taken += 1;
            let mut own = blocks(&plan);
            let mut shards = shards(&plan, &mut own);
            session.begin_iteration(1);
            shards.iter_mut().for_each(|s| finish(&session, s, 1 << 20));
            session.end_iteration(&shards).unwrap();
        }
    }
    assert!(taken > 100 && refused > 20, "{taken} taken, {refused} refused");
}

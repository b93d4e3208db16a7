//! Finished shards as bytes: processes that exchange them have the same picture and the same statistics, and bytes that
//! do not belong are refused.

use croupier::unstable::World;
use croupier::unstable::learn::{Guiding, Learning};
use croupier::unstable::profile::{Full, Guided, Profile};
use croupier::unstable::scene::blob::content_hash;
use croupier::{Budget, Plan, SavedShardError, Scene, Session, Settings, Shard};
use croupier_host::blob::AlignedBytes;
use croupier_tests::runner::{finish, kinds_of_statistics, memory, settings, shown};
use croupier_tests::scenes::*;
use croupier_tests::stats::SplitMix;

const ITERATIONS: [u32; 3] = [4, 3, 8];

/// Bytes before what the hash covers, and where the header has other things.
const UNHASHED: usize = 16;
const VERSION: usize = 16;
/// The difference of the first pixel's halves.
const DIFFERENCE: usize = HEADER + 40;
const PIXELS: usize = 72;
const HEADER: usize = 400;
/// Bytes of what path guiding promises, behind the number of its directions; and of each direction.
const PROMISE: usize = 48;
const DIRECTION: usize = 12;

/// Memory of one process: session and shards, full of what is no number.
struct Process {
    session: AlignedBytes,
    shards: Vec<AlignedBytes>,
}

impl Process {
    fn new(plan: &Plan) -> Self {
        let shards = (0..plan.settings().shards).map(|i| memory(plan.shard_of(i).size, 0xff));
        Self { session: memory(plan.session().size, 0xff), shards: shards.collect() }
    }

    fn start<'m, P: Profile>(&'m mut self, scene: Scene<'m>, plan: &Plan) -> (Session<'m, 'm, P>, Vec<Shard<'m>>) {
        let session = Session::builder(scene).profile::<P>().build(plan, self.session.as_mut()).unwrap();
        let shards = self.shards.iter_mut().zip(0..).map(|(b, i)| Shard::new(plan, i, b.as_mut()).unwrap());
        (session, shards.collect())
    }
}

/// Saves a shard into memory of exactly its length.
fn saved(shard: &Shard<'_>) -> Vec<u8> {
    let mut bytes = vec![0xa5; shard.saved_len()];
    assert_eq!(shard.save(&mut bytes), Ok(bytes.len()));
    bytes
}

/// Makes the hash right.
fn seal(bytes: &mut [u8]) {
    let hash = content_hash(&bytes[UNHASHED..]);
    bytes[8..16].copy_from_slice(&hash.to_ne_bytes());
}

/// Renders in `ranks` processes that exchange their shards, `stopped` samples early in the last iteration; what each of
/// them shows.
fn exchange<P: Profile>(scene: Scene<'_>, s: &Settings, iterations: &[u32], ranks: usize, stop: bool) -> Vec<Vec<u8>> {
    let plan = Plan::new(s).unwrap();
    let mut memory: Vec<_> = (0..ranks).map(|_| Process::new(&plan)).collect();
    let mut processes: Vec<_> = memory.iter_mut().map(|p| p.start::<P>(scene, &plan)).collect();
    for (n, &samples) in iterations.iter().enumerate() {
        let mut wire: Vec<Vec<u8>> = vec![Vec::new(); s.shards as usize];
        for (rank, (session, shards)) in processes.iter_mut().enumerate() {
            session.begin_iteration(samples);
            for shard in shards.iter_mut().skip(rank).step_by(ranks) {
                if stop && n + 1 == iterations.len() {
                    shard.step(session, Budget { rays: 3000 });
                    shard.stop();
                }
                finish(session, shard, 1000);
                let bytes = saved(shard);
                assert!(bytes.len() <= plan.saved_shard(shard.index()));
                wire[shard.index() as usize] = bytes;
            }
        }
        for (rank, (session, shards)) in processes.iter_mut().enumerate() {
            // in any order
            for i in (0..shards.len()).rev().filter(|i| i % ranks != rank) {
                shards[i].load(session, &wire[i]).unwrap();
                assert_eq!(saved(&shards[i]), wire[i], "shard {i}");
            }
            session.end_iteration(&*shards).unwrap();
        }
    }
    processes.iter().map(|(session, _)| shown(session)).collect()
}

/// Killed by: a sum, ray count, auxiliary value or counter that is not carried, statistics of one process that differ,
/// pixels in another order, a shard that has to have joined before it loads.
#[test]
fn processes_that_exchange_shards_have_the_same_picture() {
    let bytes = blob(&cornell([20, 28]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    for s in kinds_of_statistics(&bytes, 8) {
        for stop in [false, true] {
            let one = exchange::<Full>(scene, &s, &ITERATIONS, 1, stop);
            for ranks in [2, 3, 8] {
                for (rank, other) in exchange::<Full>(scene, &s, &ITERATIONS, ranks, stop).iter().enumerate() {
                    assert!(*other == one[0], "{}: rank {rank} of {ranks}, stopped {stop}", s.strategy);
                }
            }
        }
    }
}

/// With a small guide.
fn guided(bytes: &[u8], shards: u32) -> Settings {
    let s = Settings { shards, ..settings(bytes, "ears") };
    let learning = Learning { guiding: Guiding::Auto, guide_bytes: 256 << 10, ..s.learning };
    Settings { learning, ..s }
}

/// With a guide that light paths teach at first, and shards that take turns at it later. Killed by: a loaded shard that has
/// light paths left, turns that differ between processes.
#[test]
fn processes_with_path_guiding_have_the_same_picture() {
    let bytes = blob(&cornell([20, 28]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = guided(&bytes, 6);
    // after twelve iterations a gain is in doubt, however little is known
    let iterations = [1, 2, 4, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2];
    let one = exchange::<Guided<Full>>(scene, &s, &iterations, 1, false);
    for other in exchange::<Guided<Full>>(scene, &s, &iterations, 2, false) {
        assert!(other == one[0]);
    }
}

/// A session with two shards that have finished its second iteration, the second shard's bytes, and another session to
/// load them into.
fn with_saved_shard(check: impl FnOnce(&Plan, Scene<'_>, &mut Session<'_, '_>, &mut Vec<Shard<'_>>, &[u8])) {
    let bytes = blob(&cornell([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = Settings { aovs: true.into(), ..kinds_of_statistics(&bytes, 2)[1] };
    let plan = Plan::new(&s).unwrap();
    let mut memory = [0, 1].map(|_| Process::new(&plan));
    let [(session, shards), (other, others)] = &mut memory.each_mut().map(|p| p.start::<Full>(scene, &plan));
    for (session, shards) in [(&mut *session, &mut *shards), (other, others)] {
        session.begin_iteration(4);
        shards.iter_mut().for_each(|s| finish(session, s, 1000));
        session.end_iteration(&*shards).unwrap();
        session.begin_iteration(3);
    }
    shards.iter_mut().for_each(|s| finish(session, s, 1000));
    let bytes = saved(&shards[1]);
    check(&plan, scene, other, others, &bytes);
}

/// Killed by: what path guiding promises taken as it is.
#[test]
fn forged_promises_are_refused() {
    let bytes = blob(&cornell([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = guided(&bytes, 1);
    let plan = Plan::new(&s).unwrap();
    let mut memory = [0, 1].map(|_| Process::new(&plan));
    let [(session, shards), (other, others)] = &mut memory.each_mut().map(|p| p.start::<Guided<Full>>(scene, &plan));
    session.begin_iteration(4);
    other.begin_iteration(4);
    finish(session, &mut shards[0], 1000);
    let bytes = saved(&shards[0]);
    // behind the number of directions, of which the log holds all
    let header = |directions: usize| bytes.len().checked_sub(DIRECTION * directions + PROMISE + 8);
    let number = |at: usize| u64::from_ne_bytes(bytes[at..at + 8].try_into().unwrap());
    let found = (1..).map_while(|n| Some((n, header(n)?))).find(|&(n, at)| number(at) == n as u64);
    let at = found.expect("directions").1 + 8;
    for forged in [-1.0f64, f64::NAN, 1e300] {
        let mut bytes = bytes.clone();
        bytes[at..at + 8].copy_from_slice(&forged.to_ne_bytes());
        seal(&mut bytes);
        let error = others[0].load(other, &bytes).unwrap_err();
        assert!(matches!(error, SavedShardError::Numbers { what: "promise of path guiding", .. }), "{forged}: {error}");
    }
    others[0].load(other, &bytes).unwrap();
}

/// Killed by: any of the checks left out, an error that changes the shard, a shard that is saved while it works.
#[test]
fn shards_that_do_not_belong_are_refused_by_name() {
    use SavedShardError as E;
    with_saved_shard(|plan, scene, session, shards, bytes| {
        let refused = |shard: &mut Shard<'_>, session: &Session<'_, '_>, bytes: &[u8]| {
            let before = (shard.has_joined(session), *shard.counters());
            let error = shard.load(session, bytes).unwrap_err();
            assert_eq!((shard.has_joined(session), *shard.counters()), before, "{error}");
            error
        };
        // length, kind, version, damage
        for n in [0, 1, HEADER - 1, HEADER, bytes.len() - 1] {
            let needed = if n < HEADER { HEADER } else { bytes.len() };
            assert_eq!(refused(&mut shards[1], session, &bytes[..n]), E::Length { needed, given: n });
        }
        let longer = [bytes, &[0]].concat();
        let lengths = E::Length { needed: bytes.len(), given: longer.len() };
        assert_eq!(refused(&mut shards[1], session, &longer), lengths);
        let changed = |at: usize, to: u8| {
            let mut other = bytes.to_vec();
            other[at] ^= to;
            other
        };
        assert!(matches!(refused(&mut shards[1], session, &changed(0, 1)), E::Magic(_)));
        assert_eq!(refused(&mut shards[1], session, &changed(VERSION, 1)), E::Version(6));
        for at in (8..bytes.len()).step_by(97).filter(|at| !(16..20).contains(at) && !(24..32).contains(at)) {
            assert!(matches!(refused(&mut shards[1], session, &changed(at, 4)), E::Hash { .. }), "byte {at}");
        }
        // another shard, numbers that are none
        assert_eq!(refused(&mut shards[0], session, bytes), E::Shard { expected: 0, found: 1 });
        for (at, what) in [
            (PIXELS, "pixels"),
            (PIXELS + 16 + 7, "counters of shard"),
            (HEADER + 7, "pixel"),
            (DIFFERENCE + 3, "pixel"),
        ] {
            let mut forged = bytes.to_vec();
            forged[at..=at].fill(0xff);
            if what == "pixel" {
                forged[at - 1] = 0xff;
            }
            seal(&mut forged);
            assert!(matches!(refused(&mut shards[1], session, &forged), E::Numbers { what: w, .. } if w == what));
        }
        let mut forged = bytes.to_vec();
        forged[bytes.len() - 4..].copy_from_slice(&[1, 0, 2, 0]);
        seal(&mut forged);
        assert!(matches!(refused(&mut shards[1], session, &forged), E::Numbers { what: "bin", .. }));
        // another plan
        let settings = Settings { seed: 9, ..*plan.settings() };
        let other_plan = Plan::new(&settings).unwrap();
        let mut block = memory(other_plan.shard().size, 0);
        let mut other = Shard::new(&other_plan, 1, block.as_mut()).unwrap();
        assert!(matches!(refused(&mut other, session, bytes), E::Plan { .. }));
        // another scene
        let mut moved = cornell([20, 12]);
        moved.camera.origin[0] += 0.125;
        let moved = blob(&moved);
        let mut block = memory(plan.session().size, 0);
        let elsewhere = Session::new(Scene::from_bytes(&moved).unwrap(), plan, block.as_mut()).unwrap();
        assert!(matches!(refused(&mut shards[1], &elsewhere, bytes), E::Scene { .. }));
        // another iteration, other statistics
        let here = session.identity();
        let mut block = Process::new(plan);
        let (mut fresh, mut empty) = block.start::<Full>(scene, plan);
        fresh.begin_iteration(4);
        let (expected, found) = ((0, fresh.iteration()), (0, here.iteration));
        assert_eq!(refused(&mut empty[1], &fresh, bytes), E::Iteration { expected, found });
        for shard in &mut empty {
            shard.step(&fresh, Budget { rays: 0 });
            shard.stop();
            finish(&fresh, shard, 100);
        }
        fresh.end_iteration(&empty).unwrap();
        fresh.begin_iteration(3);
        assert!(matches!(refused(&mut empty[1], &fresh, bytes), E::Statistics { .. }));
        // unfinished shards
        let b = &mut shards[1];
        b.step(session, Budget { rays: 300 });
        let unfinished = E::Unfinished { shard: 1 };
        assert_eq!(b.save(&mut vec![0; 1 << 20]), Err(unfinished));
        assert_eq!(Shard::new(plan, 1, memory(plan.shard().size, 0).as_mut()).unwrap().save(&mut []), Err(unfinished));
        // and the bytes themselves are good
        b.load(session, bytes).unwrap();
        assert_eq!(saved(b), bytes);
        let given = bytes.len() - 1;
        assert_eq!(b.save(&mut vec![0; given]), Err(E::Length { needed: bytes.len(), given }));
    });
}

/// Killed by: a length, index or sum that is believed because the hash is right.
#[test]
fn forged_bytes_never_panic() {
    with_saved_shard(|_, _, session, shards, bytes| {
        finish(session, &mut shards[0], 1000);
        let mut rng = SplitMix(3);
        let mut taken = 0;
        for n in 0..3000 {
            let mut forged = bytes.to_vec();
            for _ in 0..1 + rng.word() % 3 {
                // mostly the header, where it matters
                let end = if rng.word().is_multiple_of(2) { HEADER } else { forged.len() };
                let at = rng.word() as usize % end;
                forged[at] = [0, 1, 0x7f, 0xff, rng.word() as u8][rng.word() as usize % 5];
            }
            match n % 8 {
                0 => forged.truncate(rng.word() as usize % forged.len()),
                1 => forged = (0..rng.word() % 2000).map(|_| rng.word() as u8).collect(),
                _ => {}
            }
            if forged.len() >= UNHASHED {
                seal(&mut forged);
            }
            taken += u32::from(shards[1].load(session, &forged).is_ok());
        }
        // sums that are wrong but in range are believed: an iteration ends with them
        assert!(taken > 500, "{taken}");
        if shards[1].load(session, bytes).is_ok() {
            let mut forged = bytes.to_vec();
            forged[HEADER..HEADER + 48].fill(0x7e);
            seal(&mut forged);
            shards[1].load(session, &forged).unwrap();
        }
        session.end_iteration(&*shards).unwrap();
    });
}

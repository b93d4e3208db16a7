//! Memory, settings and the order of calls: what is wrong is an error with its number, and what was rendered stays.

use croupier::unstable::accel::WideBvh;
use croupier::unstable::learn::Learning;
use croupier::unstable::profile::{DiffuseOnly, Full, Profile, WithoutSobol};
use croupier::unstable::{Effects, Sampler};
use croupier::{
    BLOCK_ALIGN, Budget, MemoryError, Plan, Scene, Session, SessionError, Settings, SettingsError, Shard, ShardError,
    StepResult,
};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{Emitter, Model};
use croupier_tests::runner::{finish, render, settings};
use croupier_tests::scenes::{add_quad, blob, cornell, everything, facing_y, spot};
use std::marker::PhantomData;

type Start<'s, 'm> = Result<Session<'s, 'm, DiffuseOnly, WideBvh<'s>>, SessionError>;

fn start<'s, 'm>(scene: &Scene<'s>, plan: &Plan, block: &'m mut [u8]) -> Start<'s, 'm> {
    Session::builder(*scene).profile().build(plan, block)
}

/// Killed by: a check against a smaller size, a block carved without a check of its address.
#[test]
fn blocks_must_fit_to_the_byte() {
    let bytes = blob(&cornell([17, 9]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    for aovs in [false, true] {
        let plan = Plan::new(&Settings { aovs: aovs.into(), shards: 3, ..settings(&bytes, "classic") }).unwrap();
        for layout in [plan.session(), plan.shard()] {
            assert_eq!((layout.align, layout.size % BLOCK_ALIGN), (BLOCK_ALIGN, 0));
        }
        let mut memory = AlignedBytes::zeroed(plan.session().size.max(plan.shard().size) + BLOCK_ALIGN);
        let memory = memory.as_mut();

        let needed = plan.session().size;
        for given in [0, 1, needed - 1] {
            let error = SessionError::Memory(MemoryError::TooSmall { needed, given });
            assert_eq!(start(&scene, &plan, &mut memory[..given]).err(), Some(error));
            assert!(error.to_string().contains(&format!("{needed} bytes, {given} given")), "{error}");
        }
        for shift in [1, 4, 32, 63] {
            let error = SessionError::Memory(MemoryError::Misaligned);
            assert_eq!(start(&scene, &plan, &mut memory[shift..shift + needed]).err(), Some(error));
        }
        assert!(start(&scene, &plan, &mut memory[..needed]).is_ok());
        assert!(start(&scene, &plan, memory).is_ok(), "more than needed will do");

        let needed = plan.shard_of(0).size;
        for given in [0, 1, needed - 1] {
            let error = ShardError::Memory(MemoryError::TooSmall { needed, given });
            assert_eq!(Shard::new(&plan, 0, &mut memory[..given]).err(), Some(error));
            assert!(error.to_string().contains(&format!("{needed} bytes, {given} given")), "{error}");
        }
        for shift in [1, 4, 32, 63] {
            let error = ShardError::Memory(MemoryError::Misaligned);
            assert_eq!(Shard::new(&plan, 0, &mut memory[shift..shift + needed]).err(), Some(error));
        }
        assert!(Shard::new(&plan, 2, &mut memory[..plan.shard_of(2).size]).is_ok());
        for index in [3, u32::MAX] {
            let error = ShardError::Index { index, shards: 3 };
            assert_eq!(Shard::new(&plan, index, &mut memory[..needed]).err(), Some(error));
            assert!(error.to_string().contains(&index.to_string()));
        }
    }
}

/// Memory that held something else gives the same picture, and the same is learned. Killed by: a slab that is read
/// before it is written.
#[test]
fn blocks_may_hold_garbage() {
    let bytes = blob(&cornell([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    for strategy in ["fixed:1.5", "ears", "bolin-meyer"] {
        let s = settings(&bytes, strategy);
        let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 300.0, ..s.learning };
        let learns = strategy != "fixed:1.5";
        let s = Settings { aovs: true.into(), adaptive: strategy == "ears", shadow_roulette: learns, learning, ..s };
        let plan = Plan::new(&s).unwrap();
        let run = |garbage: &dyn Fn(usize) -> u8| {
            let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
            for memory in [&mut shared, &mut block] {
                memory.as_mut().iter_mut().enumerate().for_each(|(i, b)| *b = garbage(i));
            }
            let mut session = start(&scene, &plan, shared.as_mut()).unwrap();
            let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
            for samples in [8, 8, 16, 1] {
                session.begin_iteration(samples);
                finish(&session, &mut shard, 1000);
                session.end_iteration([&shard]).unwrap();
            }
            let film = session.film();
            let saved = session.cache().map(|c| {
                let mut saved = vec![0; c.saved_len()];
                c.save(&mut saved).unwrap();
                saved
            });
            let leaves = session.cache().map_or(0, |c| c.leaves());
            let bits = [
                bytemuck::cast_slice::<_, u8>(&film.pixels().collect::<Vec<_>>()),
                bytemuck::cast_slice(&film.aovs().collect::<Vec<_>>()),
            ]
            .concat();
            (bits, saved, *session.counters(), leaves)
        };
        let clean = run(&|_| 0);
        assert!(strategy != "ears" || clean.3 > 10, "{} leaves", clean.3);
        // NaNs and indices beyond everything; small floats; small integers
        let garbage: [&dyn Fn(usize) -> u8; 3] =
            [&|_| 0xff, &|_| 0xa5, &|i| if i % 4 == 0 { (i / 4 * 37 % 29) as u8 } else { 0 }];
        for (i, g) in garbage.into_iter().enumerate() {
            assert!(run(g) == clean, "{strategy}, garbage {i}");
        }
    }
}

/// Killed by: a limit off by one, pixels counted in 32 bits.
#[test]
fn settings_out_of_range_are_named() {
    let bytes = blob(&cornell([8, 8]));
    let base = settings(&bytes, "classic");
    let error = |s: Settings| {
        let e = Plan::new(&s).err()?;
        Some((e, e.to_string()))
    };
    let is = |s: Settings, name: &str, value: &str| {
        let (found, text) = error(s).expect("an error");
        assert!(matches!(found, SettingsError::Range { setting, .. } if setting.name == name), "{text}");
        assert!(text.starts_with(&format!("{name} {value}: need ")), "{text}");
    };
    for size in [[0, 0], [0, 5], [5, 0], [1 << 16, (1 << 15) + 1], [1 << 31, 2], [u32::MAX, u32::MAX]] {
        is(Settings { size, ..base }, "size", &format!("{}x{}", size[0], size[1]));
    }
    for shards in [0, 65_537, u32::MAX] {
        is(Settings { shards, ..base }, "shards", &shards.to_string());
    }
    is(Settings { max_depth: 0, ..base }, "max-depth", "0");
    for ring in [0, 15, (1 << 24) + 1, u32::MAX] {
        is(Settings { ring, ..base }, "ring", &ring.to_string());
    }
    for fine in [
        Settings { size: [1 << 16, 1 << 15], ..base },
        Settings { size: [1, 1], shards: 65_536, ..base },
        Settings { ring: 16, ..base },
        Settings { ring: 1 << 24, ..base },
        Settings { max_depth: u32::MAX, ..base },
    ] {
        assert_eq!(error(fine), None);
    }
}

/// Each effect outside the profile is named, alone and together. Killed by: a session that starts anyway, a mask the
/// wrong way round.
#[test]
fn a_profile_without_an_effect_refuses_the_scene() {
    let missing = |bytes: &[u8]| {
        let scene = Scene::from_bytes(bytes).unwrap();
        let plan = Plan::new(&Settings::for_scene(&scene)).unwrap();
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let result = start(&scene, &plan, shared.as_mut()).err();
        let full = Session::new(scene, &plan, shared.as_mut());
        assert!(full.is_ok(), "the full profile has everything");
        result.map(|e| (e, e.to_string()))
    };
    assert_eq!(missing(&blob(&cornell([8, 8]))), None);

    let mut glass = spot(0.5, [8, 8]);
    let material = glass.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_quad(&mut glass, "glass", material, facing_y(1.0, 0.5, 1.0));
    let (error, text) = missing(&blob(&glass)).expect("an error");
    assert_eq!(error, SessionError::Profile { missing: Effects::DIELECTRIC });
    assert!(text.ends_with("profile: dielectric"), "{text}");

    let mut lit = spot(0.5, [8, 8]);
    lit.emitters.push(Emitter::Point { position: [0.0, 2.0, 0.0], intensity: [1.0; 3] });
    let (error, text) = missing(&blob(&lit)).expect("an error");
    assert_eq!(error, SessionError::Profile { missing: Effects::DELTA_LIGHTS });
    assert!(text.contains("point, directional, spot and sun lights"), "{text}");

    let bytes = blob(&everything([8, 8]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let (error, text) = missing(&bytes).expect("an error");
    assert_eq!(error, SessionError::Profile { missing: Effects(scene.effects.0 & !DiffuseOnly::EFFECTS.0) });
    for name in ["roughplastic", "dielectric", "environment map", "thin lens", "null"] {
        assert!(text.contains(name), "{text}");
    }
}

/// What both of its kernels have, with path guiding and without, a profile has. Killed by: a profile of which one half is
/// not asked.
#[test]
fn both_kernels_of_a_profile_must_have_what_a_scene_calls_for() {
    struct Halves<P, Q>(PhantomData<(P, Q)>);
    impl<P: Profile, Q: Profile> Profile for Halves<P, Q> {
        const EFFECTS: Effects = P::EFFECTS;
        const NAME: &'static str = "halves";
        const SOBOL: bool = P::SOBOL;
        type Unguided = Q;
    }
    fn built<P: Profile, Q: Profile>(bytes: &[u8]) -> Option<SessionError> {
        let scene = Scene::from_bytes(bytes).unwrap();
        let plan = Plan::new(&Settings { sampler: Sampler::Sobol, ..Settings::for_scene(&scene) }).unwrap();
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        Session::builder(scene).profile::<Halves<P, Q>>().build(&plan, shared.as_mut()).err()
    }
    let mut glass = spot(0.5, [8, 8]);
    let material = glass.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_quad(&mut glass, "glass", material, facing_y(1.0, 0.5, 1.0));
    let (plain, glass) = (blob(&cornell([8, 8])), blob(&glass));
    assert_eq!(built::<Full, DiffuseOnly>(&plain), None);
    let missing = Some(SessionError::Profile { missing: Effects::DIELECTRIC });
    assert_eq!([built::<Full, DiffuseOnly>(&glass), built::<DiffuseOnly, Full>(&glass)], [missing, missing]);
    let missing = Some(SessionError::Sampler { missing: Sampler::Sobol });
    let without = [built::<Full, WithoutSobol<Full>>(&plain), built::<WithoutSobol<Full>, Full>(&plain)];
    assert_eq!(without, [missing, missing]);
}

/// The pixels of a session's film as bytes.
fn film_of(session: &Session<'_, '_, DiffuseOnly, WideBvh<'_>>) -> Vec<u8> {
    let (pixels, aovs): (Vec<_>, Vec<_>) = (session.film().pixels().collect(), session.film().aovs().collect());
    [bytemuck::cast_slice::<_, u8>(&pixels), bytemuck::cast_slice(&aovs)].concat()
}

/// Killed by: a merge that starts before all shards were checked, a check of the count alone, an iteration that counts
/// as ended after an error.
#[test]
fn iterations_end_with_every_shard_in_order_or_not_at_all() {
    let bytes = blob(&cornell([40, 24]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let settings = Settings { shards: 3, aovs: true.into(), ..settings(&bytes, "classic") };
    let plan = Plan::new(&settings).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut blocks = [(); 3].map(|_| AlignedBytes::zeroed(plan.shard().size));
    let mut session = start(&scene, &plan, shared.as_mut()).unwrap();
    let mut i = 0..;
    let mut shards = blocks.each_mut().map(|b| Shard::new(&plan, i.next().unwrap(), b.as_mut()).unwrap());

    assert_eq!(session.end_iteration(&shards), Err(SessionError::NoIteration), "none has begun");
    session.begin_iteration(2);
    assert_eq!(session.end_iteration(&shards), Err(SessionError::Unfinished { shard: 0 }), "none has stepped");
    for s in &mut shards {
        finish(&session, s, 500);
    }
    session.end_iteration(&shards).unwrap();
    assert_eq!(session.end_iteration(&shards), Err(SessionError::NoIteration), "it has ended");
    let before = (film_of(&session), *session.counters());

    session.begin_iteration(3);
    assert_eq!((session.iteration().number, session.iteration().first_sample), (2, 2));
    finish(&session, &mut shards[0], 500);
    finish(&session, &mut shards[2], 500);
    assert_eq!(shards[1].step(&session, Budget { rays: 100 }), StepResult::More);
    let order = |a: usize, b: usize, c: usize| [&shards[a], &shards[b], &shards[c]];
    let tries: [(Vec<&Shard<'_>>, SessionError); 6] = [
        (vec![], SessionError::Shards { expected: 0 }),
        (order(0, 1, 2).to_vec(), SessionError::Unfinished { shard: 1 }),
        (order(1, 0, 2).to_vec(), SessionError::Shards { expected: 0 }),
        (order(0, 2, 1).to_vec(), SessionError::Shards { expected: 1 }),
        (order(0, 0, 2).to_vec(), SessionError::Shards { expected: 1 }),
        (vec![&shards[0]], SessionError::Shards { expected: 1 }),
    ];
    for (list, error) in tries {
        assert_eq!(session.end_iteration(list.iter().copied()), Err(error));
        assert!((film_of(&session), *session.counters()) == before, "{error}: the film changed");
        assert!(!error.to_string().is_empty());
    }
    finish(&session, &mut shards[1], 500);
    let error = SessionError::Shards { expected: 2 };
    assert_eq!(session.end_iteration([&shards[0], &shards[1]]), Err(error), "one is missing");
    let error = SessionError::Shards { expected: 3 };
    assert_eq!(session.end_iteration(shards.iter().chain([&shards[0]])), Err(error), "one too many");
    assert!((film_of(&session), *session.counters()) == before);

    session.end_iteration(&shards).unwrap();
    assert!(session.film().pixels().all(|p| p.samples == 5));
    assert_eq!(session.counters().camera_samples, 5 * 40 * 24);
}

/// Shards of another plan would put their sums into the wrong pixels. Killed by: a check of the index alone.
#[test]
fn shards_of_another_plan_are_refused() {
    let bytes = blob(&cornell([16, 16]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let base = settings(&bytes, "classic");
    let plan = Plan::new(&base).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut session = start(&scene, &plan, shared.as_mut()).unwrap();
    session.begin_iteration(1);
    for other in
        [Settings { size: [16, 8], ..base }, Settings { seed: 1, ..base }, Settings { aovs: true.into(), ..base }]
    {
        let other = Plan::new(&other).unwrap();
        let mut block = AlignedBytes::zeroed(other.shard().size);
        let mut shard = Shard::new(&other, 0, block.as_mut()).unwrap();
        finish(&session, &mut shard, 1000);
        assert_eq!(session.end_iteration([&shard]), Err(SessionError::Plan { shard: 0 }));
        assert!(session.film().pixels().all(|p| p.samples == 0));
    }
}

/// A shard joins an iteration with a step of 0 rays and can be stopped before its first sample. Killed by: a step of 0
/// rays that does not begin the iteration, a stop that lasts for the next one.
#[test]
fn a_shard_can_be_stopped_before_it_starts() {
    let bytes = blob(&cornell([16, 16]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let plan = Plan::new(&Settings { shards: 2, ..settings(&bytes, "classic") }).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut blocks = [(); 2].map(|_| AlignedBytes::zeroed(plan.shard().size));
    let mut session = start(&scene, &plan, shared.as_mut()).unwrap();
    let mut i = 0..;
    let mut shards = blocks.each_mut().map(|b| Shard::new(&plan, i.next().unwrap(), b.as_mut()).unwrap());
    session.begin_iteration(4);
    finish(&session, &mut shards[0], 1000);
    assert_eq!(shards[1].step(&session, Budget { rays: 0 }), StepResult::More);
    shards[1].stop();
    assert_eq!(shards[1].step(&session, Budget { rays: 1 }), StepResult::Done);
    session.end_iteration(&shards).unwrap();
    let samples: Vec<u64> = session.film().pixels().map(|p| p.samples).collect();
    assert_eq!(samples.iter().filter(|n| **n == 4).count(), 128);
    assert_eq!(samples.iter().filter(|n| **n == 0).count(), 128);
    // the next iteration starts as usual
    session.begin_iteration(1);
    for s in &mut shards {
        finish(&session, s, 1000);
    }
    session.end_iteration(&shards).unwrap();
    assert_eq!(session.film().pixels().map(|p| p.samples).sum::<u64>(), 4 * 128 + 256);
}

/// Stopping and draining leaves every started sample finished: the sum over (sample - truth) has mean 0, because
/// whether a sample starts depends on earlier ones only (a martingale), and the next iteration goes on with new
/// samples. Killed by: a stop that drops waiting vertices (their light is missing), one that counts samples that never
/// started.
#[test]
fn a_stopped_iteration_is_unbiased_and_merges() {
    let bytes = blob(&cornell([8, 8]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let base = Settings { max_depth: 6, ..settings(&bytes, "fixed:1.4") };
    let truth = render(&bytes, &Settings { seed: 99, ..base }, 4096);
    // per pixel: sums over seeds of (sum - samples * truth)
    let mut residual = vec![[0.0f64; 3]; 64];
    let mut variance = vec![[0.0f64; 3]; 64];
    let mut started = vec![0.0f64; 64];
    let (mut stopped, mut partial) = (0, 0);
    for seed in 0..1500 {
        let plan = Plan::new(&Settings { seed, ..base }).unwrap();
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let mut block = AlignedBytes::zeroed(plan.shard().size);
        let mut session = start(&scene, &plan, shared.as_mut()).unwrap();
        let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
        session.begin_iteration(5);
        if shard.step(&session, Budget { rays: 400 }) == StepResult::More {
            assert_eq!(session.end_iteration([&shard]), Err(SessionError::Unfinished { shard: 0 }));
            shard.stop();
            finish(&session, &mut shard, 64);
            stopped += 1;
        }
        session.end_iteration([&shard]).unwrap();
        let samples = session.film().pixels().map(|p| p.samples).sum::<u64>();
        partial += u32::from(samples % 5 != 0);
        assert!(samples > 0 && samples < 320);
        assert_eq!(session.counters().camera_samples, samples);
        for (i, p) in session.film().pixels().enumerate() {
            let t = &truth.pixels[i];
            let n = p.samples as f64;
            started[i] += n;
            for c in 0..3 {
                residual[i][c] += p.sum[c] - n * t.mean()[c];
                variance[i][c] += n * t.variance_of_mean()[c] * t.samples as f64;
            }
        }
        session.begin_iteration(1);
        finish(&session, &mut shard, 1 << 20);
        session.end_iteration([&shard]).unwrap();
        assert_eq!(session.film().pixels().map(|p| p.samples).sum::<u64>(), samples + 64);
    }
    assert!(stopped == 1500 && partial > 300, "{stopped} stopped, {partial} within a pixel");
    let (mut scores, mut total, mut error) = (0, 0.0, 0.0f64);
    for (i, t) in truth.pixels.iter().enumerate() {
        // the truth's own error counts for every sample
        let own = |c: usize| started[i] * started[i] * t.variance_of_mean()[c];
        if started[i] < 500.0 {
            continue;
        }
        let z = residual[i][1] / (variance[i][1] + own(1)).sqrt();
        assert!(z.abs() < 5.0, "pixel {i}: {z} standard errors off after {} samples", started[i]);
        total += residual[i][1];
        error += variance[i][1] + own(1);
        scores += 1;
    }
    // power: dropping the last packet's paths of each of the 1500 runs would cost about 12 000 samples' light
    assert!(
        scores >= 8 && (total / error.sqrt()).abs() < 4.0,
        "{scores} pixels, {} standard errors",
        total / error.sqrt()
    );
    let light: f64 = truth.pixels.iter().map(|t| t.mean()[1]).sum::<f64>() / 64.0;
    assert!(error.sqrt() < 1000.0 * light, "the test could not see {} samples' light", error.sqrt() / light);
}

/// A shard that comes from another session, or from an iteration that was given up, draws what a new one draws. Killed
/// by: a shard that looks at the iteration's number alone, vertices that wait across iterations.
#[test]
fn used_shards_begin_anew() {
    let bytes = blob(&cornell([16, 16]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let plan = Plan::new(&settings(&bytes, "ears")).unwrap();
    let memory = || [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    let rendered = |used: &dyn Fn(&mut Session<'_, '_, DiffuseOnly, WideBvh<'_>>, &mut Shard<'_>)| {
        let [mut shared, mut block] = memory();
        let mut session = start(&scene, &plan, shared.as_mut()).unwrap();
        let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
        used(&mut session, &mut shard);
        session.begin_iteration(9);
        finish(&session, &mut shard, 1 << 20);
        session.end_iteration([&shard]).unwrap();
        assert!(session.film().pixels().all(|p| p.samples == 9));
        film_of(&session)
    };
    let expected = rendered(&|_, _| ());
    let elsewhere = rendered(&|_, shard| {
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let mut other = start(&scene, &plan, shared.as_mut()).unwrap();
        other.begin_iteration(4);
        finish(&other, shard, 1 << 20);
        other.end_iteration([&*shard]).unwrap();
    });
    assert!(elsewhere == expected, "a shard kept what another session had it do");
    for rays in [40, 1000] {
        rendered(&|session, shard| {
            session.begin_iteration(5);
            assert_eq!(shard.step(session, Budget { rays }), StepResult::More);
        });
    }
}

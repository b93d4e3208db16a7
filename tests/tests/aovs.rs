//! Auxiliary values: each on its own, what they hold, what they cost.

use croupier::unstable::film::{Aov, AovSet};
use croupier::{Plan, Scene, Session, Settings, Shard};
use croupier_host::blob::AlignedBytes;
use croupier_tests::media_scene::misty;
use croupier_tests::runner::{finish, settings};
use croupier_tests::scenes::*;

/// Planes of a render, mean radiance and samples of every pixel.
struct Planes {
    planes: Vec<Vec<Option<Vec<f32>>>>,
    mean: Vec<[f64; 3]>,
}

impl Planes {
    fn of(&self, aov: Aov) -> Vec<&[f32]> {
        self.planes[aov as usize].iter().map(|p| p.as_deref().expect("a plane")).collect()
    }
}

fn render(bytes: &[u8], s: &Settings, iterations: &[u32]) -> Planes {
    let scene = Scene::from_bytes(bytes).unwrap();
    let plan = Plan::new(s).unwrap();
    let block = |bytes: usize| {
        let mut block = AlignedBytes::zeroed(bytes);
        block.as_mut().fill(0xff);
        block
    };
    let mut shared = block(plan.session().size);
    let mut own: Vec<_> = (0..s.shards).map(|i| block(plan.shard_of(i).size)).collect();
    let mut session = Session::new(scene, &plan, shared.as_mut()).unwrap();
    let mut shards: Vec<_> =
        own.iter_mut().enumerate().map(|(i, b)| Shard::new(&plan, i as u32, b.as_mut()).unwrap()).collect();
    for samples in iterations {
        session.begin_iteration(*samples);
        shards.iter_mut().for_each(|s| finish(&session, s, 5000));
        session.end_iteration(&shards).unwrap();
    }
    let film = session.film();
    let plane = |aov: Aov| (0..aov.channels().len()).map(|c| film.plane(aov, c).map(<[f32]>::to_vec)).collect();
    Planes { planes: Aov::ALL.into_iter().map(plane).collect(), mean: film.pixels().map(|p| p.mean()).collect() }
}

/// What is seen directly, direct and indirect light are the picture, whatever carries the light there. Killed by: light
/// that is in no part or in two, a depth that is off by one (the parts of a scene cut at depth 2 have no indirect light, at
/// depth 1 no direct light).
#[test]
fn parts_of_the_light_add_up_to_the_picture() {
    let all = AovSet::of(&[Aov::Emission, Aov::Direct, Aov::Indirect]);
    let mut seen_directly = 0.0;
    for scene in [cornell([24, 18]), everything([24, 18]), misty([24, 18])] {
        let bytes = blob(&scene);
        for (strategy, max_depth) in [("none", 1), ("classic", 2), ("fixed:1.5", 6), ("ears", 6)] {
            let s = Settings { aovs: all, max_depth, shards: 3, ..settings(&bytes, strategy) };
            let seen = render(&bytes, &s, &[3, 5, 2]);
            let parts = [Aov::Emission, Aov::Direct, Aov::Indirect].map(|a| seen.of(a));
            let mut sums = [0.0; 3];
            for (i, mean) in seen.mean.iter().enumerate() {
                for c in 0..3 {
                    let values = parts.each_ref().map(|p| f64::from(p[c][i]));
                    let sum: f64 = values.iter().sum();
                    assert!((sum - mean[c]).abs() <= 2e-6 * (1.0 + mean[c]), "{strategy} {max_depth}: {sum} {mean:?}");
                    sums.iter_mut().zip(values).for_each(|(s, v)| *s += v);
                }
            }
            seen_directly += sums[0];
            assert_eq!((sums[1] > 0.0, sums[2] > 0.0), (max_depth > 1, max_depth > 2), "{strategy} {max_depth}");
        }
    }
    assert!(seen_directly > 1.0);
}

/// Every set shows the planes that it asks for, with the bits that they have among all others, and the same picture.
/// Killed by: a plane that is written where another begins, one that appears unasked, a set that changes the picture.
#[test]
fn any_set_has_the_same_planes_and_picture() {
    let bytes = blob(&everything([20, 12]));
    let everything = Aov::ALL.iter().fold(AovSet::NONE, |set, a| set.with(AovSet::of(&[*a])));
    for strategy in ["none", "classic"] {
        let base = Settings { max_depth: 5, shards: 2, ..settings(&bytes, strategy) };
        let all = render(&bytes, &Settings { aovs: everything, ..base }, &[2, 3]);
        let none = render(&bytes, &base, &[2, 3]);
        assert_eq!(all.mean, none.mean);
        for aov in Aov::ALL {
            let two = AovSet::of(&[aov, Aov::Depth]);
            let some = render(&bytes, &Settings { aovs: two, ..base }, &[2, 3]);
            assert_eq!(some.mean, none.mean);
            for other in Aov::ALL {
                let wanted = two.has(other) && !other.channels().is_empty();
                assert_eq!(some.planes[other as usize].iter().all(Option::is_some), wanted || other == Aov::Cost);
                if wanted {
                    assert_eq!(some.planes[other as usize], all.planes[other as usize], "{other:?} with {aov:?}");
                }
            }
        }
    }
}

/// Adaptive renders weigh iterations, and the parts of the light with them. Killed by: means over samples, of which
/// adaptive iterations have different numbers.
#[test]
fn parts_of_adaptive_light_add_up_to_the_picture() {
    let bytes = blob(&cornell([40, 40]));
    let aovs = AovSet::of(&[Aov::Emission, Aov::Direct, Aov::Indirect, Aov::Depth]);
    let s = Settings { aovs, adaptive: true, max_depth: 6, shards: 3, ..settings(&bytes, "ears") };
    let seen = render(&bytes, &s, &[4, 5, 16, 7]);
    let parts = [Aov::Emission, Aov::Direct, Aov::Indirect].map(|a| seen.of(a));
    for (i, mean) in seen.mean.iter().enumerate() {
        for c in 0..3 {
            let sum: f64 = parts.iter().map(|p| f64::from(p[c][i])).sum();
            assert!((sum - mean[c]).abs() <= 1e-5 * (mean[c] + 1e-3), "pixel {i}: {sum} and {}", mean[c]);
        }
    }
}

/// A plane before a camera of which a part sees nothing. Killed by: a divisor other than the camera samples, alpha that
/// counts samples instead of hits, an index of a later sample.
#[test]
fn planes_are_means_over_camera_samples() {
    let bytes = blob(&everything([24, 24]));
    let wanted = AovSet::of(&[Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Alpha, Aov::Material]);
    let s = Settings { aovs: wanted, max_depth: 2, ..settings(&bytes, "none") };
    let seen = render(&bytes, &s, &[4, 12]);
    let (alpha, material, depth) = (seen.of(Aov::Alpha)[0], seen.of(Aov::Material)[0], seen.of(Aov::Depth)[0]);
    let normal = seen.of(Aov::Normal);
    assert!(alpha.iter().all(|a| (0.0..=1.0).contains(a) && (a * 16.0).fract().abs() < 1e-5));
    for (i, a) in alpha.iter().enumerate() {
        let length = normal.iter().map(|p| p[i] * p[i]).sum::<f32>().sqrt();
        assert!(length <= a + 1e-5, "pixel {i}: normals of {length} at a coverage of {a}");
        if *a == 0.0 {
            assert_eq!((material[i], depth[i], length), (-1.0, 0.0, 0.0));
        }
        if *a == 1.0 {
            assert!(material[i] >= 0.0 && material[i].fract() == 0.0 && depth[i] > 0.0);
        }
    }
    let kinds: std::collections::BTreeSet<_> = material.iter().map(|m| *m as i32).collect();
    assert!(kinds.len() > 2, "{kinds:?}");
    // the same first samples in one iteration
    let again = render(&bytes, &s, &[4]);
    assert_eq!(again.of(Aov::Material)[0], material);
}

/// Memory by the planes that are asked for. Killed by: a plane for what is not in the set, planes of eight bytes.
#[test]
fn each_plane_takes_four_bytes_in_film_and_shards() {
    let bytes = blob(&cornell([64, 64]));
    let of = |aovs: AovSet| {
        let plan = Plan::new(&Settings { aovs, ..settings(&bytes, "classic") }).unwrap();
        plan.session().size + plan.shard_of(0).size
    };
    for aov in Aov::ALL {
        let values = if aov == Aov::Cost { 1 } else { aov.channels().len() };
        assert_eq!(of(AovSet::of(&[aov])) - of(AovSet::NONE), 2 * 4 * values * 64 * 64, "{aov:?}");
    }
}

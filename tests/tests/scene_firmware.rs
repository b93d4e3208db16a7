//! The firmware's scenes, settings and memory are those that it should have, and its picture is every host's.

use croupier::{Plan, Scene};
use croupier_firmware::{BETWEEN_TICKS, ITERATIONS, Kernels, Renderer, SESSION_BYTES, SHARD_BYTES, Sensor};
use croupier_host::blob::AlignedBytes;
use croupier_tests::blob::Parts;
use croupier_tests::embedding;

/// Killed by: changing the layout or the tiny scene without `BLESS=1 cargo test -p croupier-tests --test
/// scene_firmware`, which writes the file again.
#[test]
fn firmware_holds_the_tiny_scene() {
    let blob = Parts::tiny().blob();
    if std::env::var_os("BLESS").is_some() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../embed-example/firmware/tiny.crp");
        std::fs::write(file, blob.bytes()).unwrap();
        return;
    }
    assert!(blob.bytes() == croupier_firmware::scene_bytes(), "run again with BLESS=1");
    let [(_, simd), (_, scene), (_, damaged)] = croupier_firmware::probe();
    assert!(simd != 0 && scene != 0 && Scene::from_bytes(blob.bytes()).is_ok());
    assert_eq!(damaged, blob.bytes().len().div_ceil(61) as u64);
}

/// What the firmware says in numbers of its own is what the other hosts say in texts. Killed by: another setting, another
/// iteration, a block that has a byte more or less than the plan asks for, an effect that no scene of it calls for.
#[test]
fn firmware_has_the_settings_of_the_examples() {
    use croupier::unstable::profile::Profile;
    let scene = Scene::from_bytes(croupier_firmware::box_bytes()).unwrap();
    let settings = croupier_firmware::settings(&scene);
    assert_eq!(settings, embedding::settings(&scene, 1));
    assert_eq!(ITERATIONS, embedding::ITERATIONS);
    assert_eq!(Kernels::EFFECTS, scene.effects);
    let plan = Plan::new(&settings).unwrap();
    assert_eq!([SESSION_BYTES, SHARD_BYTES], [plan.session().size, plan.shard_of(0).size]);
}

/// Steps of a few rays give the picture of the other hosts, and each gives the processor back after one packet too many
/// at most. Killed by: a step that ignores its budget, a picture that depends on it.
#[test]
fn firmware_draws_the_picture_of_the_examples() {
    let (mut session, mut shard) = (AlignedBytes::zeroed(SESSION_BYTES), AlignedBytes::zeroed(SHARD_BYTES));
    let mut renderer = Renderer::new(croupier_firmware::box_bytes(), session.as_mut(), shard.as_mut()).unwrap();
    let mut sensor = Sensor::default();
    while renderer.work(BETWEEN_TICKS).unwrap() {
        sensor.serve(renderer.rays(), 0);
    }
    assert!(sensor.most_rays >= BETWEEN_TICKS && sensor.most_rays < BETWEEN_TICKS + 16, "{sensor:?}");
    if croupier::unstable::simd::REPRODUCIBLE {
        let hashes = std::fs::read_to_string(embedding::HASHES).unwrap();
        assert!(hashes.lines().any(|line| line == format!("A {:016x}", renderer.hash())), "{:016x}", renderer.hash());
    }
}

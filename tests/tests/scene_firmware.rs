//! The blob in the firmware is the tiny scene of these tests, and is a scene.

use croupier::Scene;
use croupier_tests::blob::Parts;

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

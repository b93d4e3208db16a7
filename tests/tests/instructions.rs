//! The library on a processor that lacks what it was built for: an error of the first call that a host makes, in place of
//! an illegal instruction.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use croupier::unstable::scene::blob::Header;
use croupier::{INSTRUCTION_SET, Scene, SceneError, missing_instructions};
use std::process::Command;

/// Environment variable of the process that is emulated.
const EMULATED: &str = "CROUPIER_TEST_EMULATED";

/// This test runs itself under an emulator of a processor of 2008. Killed by: a check that comes behind the first vector
/// instruction, or not at all; a build for every processor that uses newer instructions.
#[test]
fn old_processors_are_refused() {
    static BYTES: [u32; 4096] = [0; 4096];
    if std::env::var_os(EMULATED).is_some() {
        // nothing is moved or printed: that would be vector instructions of this test
        let refused = matches!(&Scene::from_bytes(bytemuck::cast_slice(&BYTES)), Err(SceneError::Instructions { .. }));
        assert!(refused == cfg!(target_feature = "avx2"));
        return;
    }
    assert_eq!(missing_instructions(), None);
    assert_eq!(Scene::from_bytes(bytemuck::cast_slice(&BYTES)).err(), Some(SceneError::Magic));
    assert!(size_of_val(&BYTES) > size_of::<Header>());
    let mut emulator = Command::new("qemu-x86_64");
    emulator.args(["-cpu", "Nehalem"]).arg(std::env::current_exe().unwrap());
    emulator.args(["--exact", "old_processors_are_refused", "--nocapture", "--test-threads", "1"]).env(EMULATED, "1");
    let Ok(output) = emulator.output() else {
        println!("no qemu-x86_64: not tested here");
        return;
    };
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && said.contains("1 passed"),
        "{INSTRUCTION_SET}, {}: {said} {errors}",
        output.status
    );
}

//! The firmware's results as this machine computes them: `name hash` per line, and with `--picture` those of the picture.
//! The script that runs everything compares them with what the Cortex-M7 programs print. With `--level`: the instruction
//! set of this build.

use croupier_firmware::{BETWEEN_TICKS, Renderer, SESSION_BYTES, SHARD_BYTES, Sensor, box_bytes};
use croupier_host::blob::AlignedBytes;

fn main() {
    let asked = |option: &str| std::env::args().any(|a| a == option);
    if asked("--level") {
        let v3 = cfg!(all(target_feature = "avx2", target_feature = "fma"));
        println!("{}{}", std::env::consts::ARCH.replace('_', "-"), if v3 { "-v3" } else { "" });
    } else if asked("--picture") {
        let (mut session, mut shard) = (AlignedBytes::zeroed(SESSION_BYTES), AlignedBytes::zeroed(SHARD_BYTES));
        let mut renderer = Renderer::new(box_bytes(), session.as_mut(), shard.as_mut()).unwrap();
        let mut sensor = Sensor::default();
        while renderer.work(BETWEEN_TICKS).unwrap() {
            sensor.serve(renderer.rays(), 0);
        }
        println!("picture {:016x}", renderer.hash());
        renderer.report().into_iter().chain(sensor.report()).for_each(|(name, count)| println!("{name} {count}"));
    } else {
        croupier_firmware::probe().iter().for_each(|(name, hash)| println!("{name} {hash:016x}"));
    }
}

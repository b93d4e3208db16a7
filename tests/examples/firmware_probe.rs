//! The firmware's results as this machine computes them: `name hash` per line, and with `--picture` those of the picture.
//! The script that runs everything compares them with what the Cortex-M7 programs print. With `--level`: the instruction
//! set of this build.

// An example of the firmware's package as well, for processors that the other packages are not built for.
use croupier_firmware::{Aligned, BETWEEN_TICKS, Renderer, SESSION_BYTES, SHARD_BYTES, Sensor, box_bytes};

fn main() {
    let asked = |option: &str| std::env::args().any(|a| a == option);
    if asked("--level") {
        let v3 = cfg!(all(target_feature = "avx2", target_feature = "fma"));
        println!("{}{}", std::env::consts::ARCH.replace('_', "-"), if v3 { "-v3" } else { "" });
    } else if asked("--picture") {
        let (mut session, mut shard) = (Box::new(Aligned([0; SESSION_BYTES])), Box::new(Aligned([0; SHARD_BYTES])));
        let mut renderer = Renderer::new(box_bytes(), &mut session.0, &mut shard.0).unwrap();
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

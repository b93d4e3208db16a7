//! The firmware's results as this machine computes them: `name hash` per line. The script that runs everything
//! compares them with what the Cortex-M7 program prints. With `--level`: the instruction set of this build.

fn main() {
    if std::env::args().any(|a| a == "--level") {
        let v3 = cfg!(all(target_feature = "avx2", target_feature = "fma"));
        println!("{}{}", std::env::consts::ARCH.replace('_', "-"), if v3 { "-v3" } else { "" });
        return;
    }
    for (name, hash) in croupier_firmware::probe() {
        println!("{name} {hash:016x}");
    }
}

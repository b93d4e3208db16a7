//! The firmware's results as this machine computes them: `name hash` per line. The script that runs everything
//! compares them with what the Cortex-M7 program prints.

fn main() {
    for (name, hash) in croupier_firmware::probe() {
        println!("{name} {hash:016x}");
    }
}

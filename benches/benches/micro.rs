//! Times of the kernels of [`croupier_benches::micro`], each compared with its expected answer before it is timed.
//!
//! `cargo bench -p croupier-benches --bench micro`, with a part of a name behind `--` for some of them. Times are per
//! unit, nearly always a packet of eight lanes; lanes used of the eight are printed with each. Instructions and cache
//! misses of the same kernels, which do not depend on the machine's load: `--bin micro`.

use criterion::Criterion;
use croupier_benches::micro::{self, Kernel};
use std::process::ExitCode;
use std::time::{Duration, Instant};

fn main() -> ExitCode {
    let kernels = match micro::all() {
        Ok(kernels) => kernels,
        Err(e) => {
            eprintln!("micro: {e}");
            return ExitCode::FAILURE;
        }
    };
    // some two hundred kernels: a second each
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
        .sample_size(30)
        .without_plots()
        .configure_from_args();
    for kernel in kernels {
        time(&mut criterion, kernel);
    }
    criterion.final_summary();
    ExitCode::SUCCESS
}

fn time(criterion: &mut Criterion, mut kernel: Kernel) {
    let lanes = kernel.lanes.map_or(String::new(), |l| format!(", {l:.2} lanes used"));
    let name = format!("{}/{} (per {}{lanes})", kernel.group, kernel.name, kernel.unit);
    criterion.bench_function(&name, |b| {
        b.iter_custom(|units| {
            let calls = units.div_ceil(kernel.units as u64);
            let start = Instant::now();
            (0..calls).for_each(|_| (kernel.call)());
            // what is measured is calls, what is stated is units
            start.elapsed().mul_f64(units as f64 / (calls * kernel.units as u64) as f64)
        });
    });
}

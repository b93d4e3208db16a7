//! Renders the box and serves a sensor meanwhile; prints the hash of the picture and what it took, one `name value` per
//! line, and ends with status 0.
//!
//! Cortex-M7 object code without any library and without a heap; see `board` for how it starts and how it ends.
#![no_std]
#![no_main]

mod board;

use board::{Block, clock, exit, line, line_hexadecimal, stack_used, start_clock, write};
use croupier_firmware::{BETWEEN_TICKS, Failure, Renderer, SESSION_BYTES, SHARD_BYTES, Sensor, box_bytes};

static SESSION: Block<SESSION_BYTES> = Block::new();
static SHARD: Block<SHARD_BYTES> = Block::new();

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    match render() {
        Ok(()) => exit(0),
        Err(failure) => {
            write(b"failed: ");
            write(failure.name().as_bytes());
            line(": bytes needed", failure.needed() as u64);
            exit(1)
        }
    }
}

fn render() -> Result<(), Failure> {
    // SAFETY: once each, because `main` is called once.
    let (session, shard) = unsafe { (SESSION.take(), SHARD.take()) };
    let mut renderer = Renderer::new(box_bytes(), session, shard)?;
    let mut sensor = Sensor::default();
    start_clock();
    while renderer.work(BETWEEN_TICKS)? {
        sensor.serve(renderer.rays(), clock());
    }
    line_hexadecimal("picture", renderer.hash());
    renderer.report().into_iter().chain(sensor.report()).for_each(|(name, count)| line(name, count));
    let [tracing, ending] = sensor.most_time;
    for (name, time) in [("time", sensor.time), ("time_tracing", tracing), ("time_ending", ending)] {
        line(name, time);
    }
    let [used, stack] = stack_used();
    line("stack_used", used as u64);
    line("stack", stack as u64);
    Ok(())
}

/// The compiler keeps bounds checks of indices that are always within; `sizes.txt` counts them. None of them is known to
/// fail.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    write(b"panicked\n");
    exit(2)
}

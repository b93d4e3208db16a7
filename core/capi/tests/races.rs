//! Calls that run together on several threads and may not.

mod common;

use common::{Block, OwnScene, c, ok, plan, settings};
use croupier_capi::croupier_status::{CROUPIER_BUSY, CROUPIER_DESTROYED, CROUPIER_OK};
use croupier_capi::*;
use std::ptr;
use std::sync::Barrier;
use std::sync::atomic::{AtomicPtr, AtomicU32, AtomicUsize, Ordering};
use std::thread;

/// Two threads that destroy the same shard at a time: one of them does. Killed by: a mark that is looked at before the
/// lock is taken, and not afterwards: some tens of the rounds then have two that do, where threads have cores of their
/// own. `guarded` has the same without chance.
#[test]
fn one_of_two_threads_destroys() {
    const ROUNDS: usize = 1000;
    let own = OwnScene::new(&common::baked());
    let mut s = settings(own.handle, 1);
    ok!(croupier_settings_set_size(&raw mut s, 1, 1));
    let planned = plan(&s);
    let mut bytes = 0;
    ok!(croupier_plan_shard_size(&planned, 0, &raw mut bytes));
    let mut block = Block::new(bytes);
    let (first, handle) = (AtomicPtr::new(block.pointer()), AtomicPtr::new(ptr::null_mut()));
    let (arrived, destroyed) = (AtomicUsize::new(0), AtomicU32::new(0));
    // waits for the other thread in each round; sleeps only where threads share a core
    let meet = |round: usize| {
        arrived.fetch_add(1, Ordering::AcqRel);
        for spins in 0u32.. {
            if arrived.load(Ordering::Acquire) >= 2 * (round + 1) {
                break;
            }
            if spins > 2000 { thread::yield_now() } else { core::hint::spin_loop() }
        }
    };
    let wrong = AtomicU32::new(0);
    let ready = Barrier::new(2);
    let run = |maker: bool| {
        ready.wait();
        for round in 0..ROUNDS {
            if maker {
                let (at, mut shard) = (first.load(Ordering::Relaxed), ptr::null_mut());
                c!(croupier_shard_init(at, bytes, &planned, 0, &raw mut shard, ptr::null_mut()));
                handle.store(shard, Ordering::Relaxed);
                destroyed.store(0, Ordering::Relaxed);
            }
            meet(2 * round);
            let status = c!(croupier_shard_destroy(handle.load(Ordering::Relaxed), ptr::null_mut()));
            let expected = matches!(status, CROUPIER_OK | CROUPIER_BUSY | CROUPIER_DESTROYED);
            destroyed.fetch_add(if expected { u32::from(status == CROUPIER_OK) } else { 100 }, Ordering::Relaxed);
            meet(2 * round + 1);
            // a thread that ended here would leave the other one waiting
            wrong.fetch_add(u32::from(maker && destroyed.load(Ordering::Relaxed) != 1), Ordering::Relaxed);
        }
    };
    thread::scope(|scope| {
        scope.spawn(|| run(true));
        scope.spawn(|| run(false));
    });
    assert_eq!(wrong.into_inner(), 0, "rounds in which not exactly one call destroyed the shard");
}

//! The longest single call of a host that works in pieces, in instructions: every call is a function that callgrind
//! writes a profile after.

use crate::callgrind::Folder;
use croupier::unstable::profile::{AnyProfile, Profile, ProfileVisitor};
use croupier::{Budget, Plan, Scene, Session, SessionError, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use std::error::Error;
use std::process::Command;

/// Names of the calls: each is part of the name of a function that is never inlined.
pub const CALLS: [&str; 5] =
    ["longest_call_start", "longest_call_join", "longest_call_begin", "longest_call_step", "longest_call_finish"];

/// Renders one shard in pieces of `rays`; the number of calls.
pub fn render(scene: Scene<'_>, plan: &Plan, iterations: &[u32], rays: u64) -> Result<u64, Box<dyn Error>> {
    AnyProfile::smallest(scene.effects).dispatch(Pieces { scene, plan, iterations, budget: Budget { rays } })
}

struct Pieces<'a, 's> {
    scene: Scene<'s>,
    plan: &'a Plan,
    iterations: &'a [u32],
    budget: Budget,
}

impl ProfileVisitor for Pieces<'_, '_> {
    type Out = Result<u64, Box<dyn Error>>;

    fn visit<P: Profile + Send + Sync>(self) -> Self::Out {
        let (plan, budget) = (self.plan, self.budget);
        let (mut shared, mut own) =
            (AlignedBytes::zeroed(plan.session().size), AlignedBytes::zeroed(plan.shard_of(0).size));
        let mut session = longest_call_start::<P>(self.scene, plan, shared.as_mut())?;
        let mut shard = longest_call_join(plan, own.as_mut())?;
        let mut calls = 2;
        for &samples in self.iterations {
            longest_call_begin(&mut session, samples);
            while longest_call_step(&session, &mut shard, budget) == StepResult::More {
                calls += 1;
            }
            while longest_call_finish(&mut session, &shard, budget)? == StepResult::More {
                calls += 1;
            }
            calls += 3;
        }
        Ok(calls)
    }
}

type Render<'s, 'm, P> = Session<'s, 'm, P>;

#[inline(never)]
fn longest_call_start<'s, 'm, P: Profile>(
    scene: Scene<'s>,
    plan: &Plan,
    block: &'m mut [u8],
) -> Result<Render<'s, 'm, P>, SessionError> {
    Session::builder(scene).profile::<P>().build(plan, block)
}

#[inline(never)]
fn longest_call_join<'m>(plan: &Plan, block: &'m mut [u8]) -> Result<Shard<'m>, croupier::ShardError> {
    Shard::new(plan, 0, block)
}

#[inline(never)]
fn longest_call_begin<P: Profile>(session: &mut Render<'_, '_, P>, samples: u32) {
    session.begin_iteration(samples);
}

#[inline(never)]
fn longest_call_step<P: Profile>(session: &Render<'_, '_, P>, shard: &mut Shard<'_>, budget: Budget) -> StepResult {
    shard.step(session, budget)
}

#[inline(never)]
fn longest_call_finish<P: Profile>(
    session: &mut Render<'_, '_, P>,
    shard: &Shard<'_>,
    budget: Budget,
) -> Result<StepResult, SessionError> {
    session.finish_iteration([shard], budget)
}

/// Runs this program with `args`, which must call [`render`] once, under callgrind: the number of calls of each kind of
/// [`CALLS`], and the instructions of the longest.
pub fn count(folder: &Folder, args: &[&str]) -> Result<Vec<(u64, u64)>, Box<dyn Error>> {
    let out = folder.path().join("longest.out");
    let mut valgrind = Command::new("valgrind");
    // a profile before a call ends what is counted until then, the one after it has the call alone
    valgrind.args(["--tool=callgrind", "--quiet", "--compress-strings=no"]);
    valgrind.args(["--dump-before=*longest_call_*", "--dump-after=*longest_call_*"]);
    valgrind.arg(format!("--callgrind-out-file={}", out.display()));
    let output = valgrind.arg(std::env::current_exe()?).args(args).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    let mut longest = vec![(0, 0); CALLS.len()];
    for entry in std::fs::read_dir(folder.path())? {
        let path = entry?.path();
        if !path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("longest.out.")) {
            continue;
        }
        let profile = std::fs::read_to_string(&path)?;
        let summary = profile.lines().find_map(|l| l.strip_prefix("summary: ")?.trim().parse::<u64>().ok());
        let trigger = profile.lines().find(|l| l.starts_with("desc: Trigger: --dump-after=")).unwrap_or("");
        let call = CALLS.iter().position(|c| trigger.contains(c));
        if let (Some(n), Some(call)) = (summary, call) {
            longest[call] = (longest[call].0 + 1, longest[call].1.max(n));
        }
    }
    Ok(longest)
}

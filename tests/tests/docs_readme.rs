//! The README: its example works, and it stays what a stranger reads first.

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_tests::documents::document;

mod example {
    use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};

    pub(super) fn render(blob: &[u8], memory: &mut [u8]) -> Result<f64, Box<dyn core::error::Error>> {
        let scene = Scene::from_bytes(blob)?; // checks every byte, copies none
        let plan = Plan::new(&Settings { size: [64, 64], ..Settings::for_scene(&scene) })?;
        let (shared, rest) = memory.split_at_mut_checked(plan.session().size).ok_or("too little memory")?;
        let mut session = Session::new(scene, &plan, shared)?;
        let mut shard = Shard::new(&plan, 0, rest)?; // one per unit of parallel work: `Settings::shards`
        session.begin_iteration(16); // samples per pixel
        while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {} // or draw a frame in between
        session.end_iteration([&shard])?;
        Ok(session.film().error_estimate().rel_mse) // `film().pixels()`: mean and standard error of each pixel
    }
}

/// The example's function renders, and refuses too little memory. Killed by: an interface that the README does not know.
#[test]
fn the_example_renders() {
    let baked = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap();
    let mut memory = AlignedBytes::zeroed(1 << 20);
    assert!(example::render(&baked.bytes, memory.as_mut()).unwrap() > 0.0);
    assert!(example::render(&baked.bytes, &mut memory.as_mut()[..100_000]).is_err());
}

/// The example is the code that the test above runs. Killed by: a change to one of the two only.
#[test]
fn the_example_is_the_code_that_was_run() {
    let squeezed = |text: &str| text.replace("pub(super) ", "").split_whitespace().collect::<Vec<_>>().join(" ");
    let text = document("README.md");
    let shown = text.split("```rust\n").nth(1).and_then(|t| t.split("```").next()).expect("an example");
    let run = include_str!("docs_readme.rs");
    let run = run.split("mod example {").nth(1).and_then(|t| t.split("\n}\n").next()).expect("the module");
    assert_eq!(squeezed(shown), squeezed(run));
}

/// The README is short, and in the order in which strangers ask. Killed by: a section that is moved, a manual that grows
/// into it.
#[test]
fn readme_is_short_and_in_order() {
    let text = document("README.md");
    let mut shown = String::new();
    let mut rest = &*text;
    while let Some((before, comment)) = rest.split_once("<!--") {
        shown.push_str(before);
        rest = comment.split_once("-->").map_or("", |(_, after)| after);
    }
    shown.push_str(rest);
    let words = shown.split_whitespace().filter(|w| w.contains(char::is_alphanumeric)).count();
    assert!(words < 1500, "{words} words");
    let titles: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("## ")).collect();
    let order = ["In a Rust program", "Promises", "What it does not do", "The program", "Figures", "Limits"];
    let order = [&order[..], &["Instruction sets", "Where things are", "Licence"]].concat();
    assert_eq!(titles, order);
    let example = text.split("```rust\n").nth(1).and_then(|t| t.split("```").next()).unwrap_or("");
    let lines = example.lines().filter(|l| !l.starts_with('#') && !l.trim().is_empty()).count();
    assert!((5..=15).contains(&lines), "an example of {lines} lines");
    let manifest = text.split("```toml\n").nth(1).unwrap_or("");
    assert!(manifest.starts_with("[dependencies]\ncroupier = "), "no line of [dependencies]");
}

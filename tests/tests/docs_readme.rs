//! The README: its example works, and it stays what a stranger reads first.

use croupier::{Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::renderer::{Renderer, RendererError};
use croupier_tests::documents::document;

mod example {
    use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};

    pub(super) fn render(blob: &[u8], memory: &mut [u8]) -> Result<f64, Box<dyn core::error::Error>> {
        let scene = Scene::from_bytes(blob)?; // checks every byte, copies none
        let plan = Plan::new(&Settings { size: [64, 64], ..Settings::for_scene(&scene) })?;
        let (shared, rest) = memory.split_at_mut_checked(plan.session().size).ok_or("too little memory")?;
        let mut session = Session::new(scene, &plan, shared)?;
        let mut shard = Shard::new(&plan, 0, rest)?; // one per unit of parallel work: `Settings::shards`
        for _ in 0..2 {
            session.begin_iteration(8); // samples per pixel
            while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {} // or draw a frame in between
            session.end_iteration([&shard])?;
        }
        Ok(session.film().error_estimate().rel_mse) // `film().pixels()`: mean and standard error of each pixel
    }
}

mod frames {
    use croupier::{Budget, StepResult};
    use croupier_host::renderer::{Keep, Renderer, RendererError};

    pub(super) fn frame(renderer: &Renderer, x: f32) -> Result<f64, RendererError> {
        let mut camera = renderer.with_scene(|scene| *scene.camera);
        camera.origin[0] = x;
        renderer.edit(Keep::Statistics, |scene| scene.camera(camera))?; // however large the scene is
        renderer.begin_iteration(4);
        // one after another, or each on a thread of yours
        for shard in 0..renderer.plan().settings().shards {
            while renderer.step(shard, Budget { rays: 10_000 })? == StepResult::More {}
        }
        renderer.end_iteration()?; // `finish_iteration` does it in pieces
        Ok(renderer.with_film(|film| film.error_estimate().rel_mse))
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

/// The example of an engine renders one frame after another, and refuses a camera that is nowhere. Killed by: an edit
/// that needs another session, a frame that does not begin a picture anew.
#[test]
fn frames_render() {
    let baked = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap();
    let settings =
        Settings { size: [32, 32], ..Settings::for_scene(&Scene::from_bytes(baked.bytes.as_ref()).unwrap()) };
    let renderer: Renderer = Renderer::new(baked.bytes, &settings).unwrap();
    let x = renderer.with_scene(|scene| scene.camera.origin[0]);
    for moved in [0.0, 0.05, 0.1] {
        assert!(frames::frame(&renderer, x + moved).unwrap() > 0.0);
        assert!(renderer.with_film(|film| film.pixels().all(|p| p.samples == 4)));
    }
    assert!(matches!(frames::frame(&renderer, f32::NAN), Err(RendererError::Edit(_))));
}

/// The examples are the code that the tests above run; the first is also in the package's README. Killed by: a change to
/// one of them only.
#[test]
fn the_examples_are_the_code_that_was_run() {
    let squeezed = |text: &str| text.replace("pub(super) ", "").split_whitespace().collect::<Vec<_>>().join(" ");
    let run = include_str!("docs_readme.rs");
    for (file, index, module) in
        [("README.md", 1, "mod example {"), ("README.md", 2, "mod frames {"), ("core/README.md", 1, "mod example {")]
    {
        let text = document(file);
        let shown = text.split("```rust\n").nth(index).and_then(|t| t.split("```").next()).expect("an example");
        let run = run.split(module).nth(1).and_then(|t| t.split("\n}\n").next()).expect("the module");
        assert_eq!(squeezed(shown), squeezed(run), "{file}");
    }
}

/// The example in C, which CI compiles, is that of the manual. Killed by: a change to one of them only.
#[test]
fn the_example_in_c_is_that_of_the_manual() {
    let example = |file: &str| {
        let text = document(file);
        text.split("```c\n").nth(1).and_then(|t| t.split("```").next()).expect("an example").to_string()
    };
    assert_eq!(example("README.md"), example("docs/C.md"));
}

/// The sizes of the firmware that README names are those that CI found. Killed by: a firmware that grew.
#[test]
fn sizes_of_the_firmware_are_those_of_ci() {
    let sizes = document("embed-example/firmware/sizes.txt");
    let bytes = |name: &str| {
        let found = sizes.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse::<f64>().ok());
        found.expect("a size") / 1024.0
    };
    let stated = format!("{:.0} KiB of flash and {:.0} KiB of RAM", bytes("flash"), bytes("ram"));
    assert!(document("README.md").contains(&stated), "README does not say: {stated}");
}

/// Registry pages resolve no relative links, as no repository is named. Killed by: a link to a file in a package's README.
#[test]
fn links_of_packages_hold_on_registry_pages() {
    for folder in ["core", "simd", "embed-example/host"] {
        let text = document(&format!("{folder}/README.md"));
        for link in text.split("](").skip(1) {
            assert!(link.starts_with("https://"), "{folder}: {}", link.split(')').next().unwrap_or(""));
        }
    }
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
    assert!(words < 1900, "{words} words");
    let titles: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("## ")).collect();
    let order = ["In a Rust program", "In a C program", "Elsewhere", "Promises", "What it does not do", "The program"];
    let order = [&order[..], &["Figures", "Limits", "Instruction sets", "Where things are", "Licence"]].concat();
    assert_eq!(titles, order);
    let example = text.split("```rust\n").nth(1).and_then(|t| t.split("```").next()).unwrap_or("");
    let lines = example.lines().filter(|l| !l.starts_with('#') && !l.trim().is_empty()).count();
    assert!((5..=15).contains(&lines), "an example of {lines} lines");
    let manifest = text.split("```toml\n").nth(1).unwrap_or("");
    assert!(manifest.starts_with("[dependencies]\ncroupier = "), "no line of [dependencies]");
}

//! The frame loop of `embed-example/host/examples/frame_loop.rs`, as hosts copy it: whatever moves between frames, and
//! however the work is cut into calls, the picture is that of an offline render of the same scene.

#[expect(dead_code, unreachable_pub, reason = "a program, of which the test calls the parts")]
#[path = "../../embed-example/host/examples/frame_loop.rs"]
mod example;

use croupier::unstable::film::Aov;
use croupier::{Scene, Settings};
use croupier_host::description::SceneDescription;
use croupier_host::renderer::{Keep, Renderer};
use croupier_tests::runner::settings;
use croupier_tests::scenes::{blob, cornell, everything};
use example::{FrameLoop, SHARDS, hash, input, offline};

/// The example's own scene, small: a room in which an instance moves.
fn room() -> SceneDescription {
    let mut scene = example::scene();
    scene.camera.size = [40, 40];
    scene
}

/// Killed by: a change that keeps anything it must not, an edit that `into_blob` does not have, a call whose end moves a
/// bit, a loop that begins with a shard or a stage of before.
#[test]
fn frames_end_with_the_picture_of_an_offline_render() {
    let scenes =
        [(room(), "ears"), (room(), "classic"), (everything([48, 32]), "ears"), (cornell([64, 36]), "classic")];
    for (description, strategy) in scenes {
        let bytes = blob(&description);
        let untouched = blob(&description);
        let s = Settings { shards: SHARDS.min(6), aovs: true.into(), ..settings(&bytes, strategy) };
        let (mut engine, moving, mut frames) = (FrameLoop::new(bytes, &s).unwrap(), 20, 0);
        while frames <= moving || engine.finished() < 3 {
            engine.frame(input(frames, moving).as_ref()).unwrap();
            frames += 1;
            assert!(frames < 10_000, "{strategy}: the loop does not come to an end");
        }
        let renderer = engine.renderer;
        let (of_frames, s) = (hash(&renderer), *renderer.plan().settings());
        assert_eq!(of_frames, hash(&offline(renderer.into_blob(), &s, 3).unwrap()), "{strategy}");
        assert_ne!(of_frames, hash(&offline(untouched, &s, 3).unwrap()), "{strategy}: nothing has moved");
    }
}

/// The object is where the last input says, in the picture and in the blob that the renderer leaves: rays of a scene that
/// was baked with the instance there go as far, those of one with it elsewhere do not. Killed by: a move that tree, inverse
/// map or blob do not follow; a move of another instance, or on top of the one before.
#[test]
fn the_object_moves() {
    let mut target = room();
    let offset = input(20, 20).unwrap().offset;
    for (row, by) in target.instances[0].to_world.iter_mut().zip(offset) {
        row[3] = by;
    }
    let bytes = blob(&room());
    let s = Settings { shards: 2, aovs: true.into(), ..settings(&bytes, "classic") };
    let mut engine = FrameLoop::new(bytes, &s).unwrap();
    let mut frames = 0;
    while frames <= 20 || engine.finished() < 1 {
        engine.frame(input(frames, 20).as_ref()).unwrap();
        frames += 1;
    }
    let depths = |renderer: &Renderer| renderer.with_film(|film| film.plane(Aov::Depth, 0).unwrap().to_vec());
    let (camera, of_frames) = (engine.renderer.with_scene(|scene| *scene.camera), depths(&engine.renderer));
    let left = engine.renderer.into_blob();
    let found = Scene::from_bytes(&left).unwrap().instances[0];
    let baked = |description: &SceneDescription| {
        let renderer: Renderer = Renderer::new(blob(description), &s).unwrap();
        renderer.edit(Keep::Nothing, |scene| scene.camera(camera)).unwrap();
        depths(&offline(renderer.into_blob(), &s, 1).unwrap())
    };
    assert_eq!(found.to_world, Scene::from_bytes(&blob(&target)).unwrap().instances[0].to_world);
    assert!(of_frames == baked(&target), "distances are not those of a scene that was baked so");
    let elsewhere = baked(&room());
    let changed = elsewhere.iter().zip(&of_frames).filter(|(a, b)| a != b).count();
    assert!(changed > 30, "{changed} of 1600 pixels show that something has moved");
}

/// While the first iteration runs the preview has the pixels of the shards at work, then those of the film. Killed by: a
/// preview that shows nothing until the film does, pixels of a picture that was abandoned as ones of this.
#[test]
fn the_preview_shows_what_there_is() {
    let bytes = blob(&cornell([64, 36]));
    let s = Settings { shards: 1, ..settings(&bytes, "classic") };
    let mut engine = FrameLoop::new(bytes, &s).unwrap();
    engine.frame(None).unwrap();
    assert_eq!(engine.finished(), 0, "no film yet");
    let lit = |engine: &FrameLoop| engine.preview.iter().filter(|p| **p != [0.0; 3]).count();
    let some = lit(&engine);
    assert!(some > 50 && some < 64 * 36, "{some} pixels of an unfinished iteration");
    while engine.finished() < 1 {
        engine.frame(None).unwrap();
    }
    engine.frame(None).unwrap();
    let film: Vec<[f32; 3]> = engine.renderer.with_film(|f| f.pixels().map(|p| p.mean().map(|x| x as f32)).collect());
    assert!(engine.preview == film, "the film as it is");
    engine.frame(input(1, 5).as_ref()).unwrap();
    let mut pixels = 0;
    engine.renderer.with_unfinished(0, |_, _, _| pixels += 1);
    assert!(pixels > 50 && pixels < 64 * 36, "{pixels} pixels since the change");
    engine.renderer.begin_iteration(1);
    engine.renderer.with_unfinished(0, |_, _, _| panic!("a pixel of an iteration before"));
    engine.renderer.with_unfinished(1, |_, _, _| panic!("a pixel of no shard"));
}

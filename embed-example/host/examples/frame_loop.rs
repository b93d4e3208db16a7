//! An engine's frame loop with a path tracer in it: each frame applies what has moved, renders for some 4 ms on the
//! engine's own thread, and shows what there is. Camera, an object and a light change. Copy it.
//!
//! ```text
//! cargo run --release -p croupier-host --example frame_loop -- [COLUMNS ROWS [ITERATIONS [STRATEGY]]]
//! ```
//!
//! Nothing here reads a clock, so that two runs make the same calls: a frame is [`CALLS_PER_FRAME`] calls, each of which
//! takes less than 1 ms (`benches/results/frame.md`). An engine would look at its clock between two calls instead; the
//! picture does not depend on how it is cut into calls. At the end the same scene is rendered offline, with a new
//! renderer and in whole iterations: the bits are the same.
#![forbid(unsafe_code)]

use croupier::unstable::scene::blob::{Camera, Instance, LightKind, content_hash};
use croupier::{Budget, Scene, SceneEdit, Settings, StepResult, Strategy};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::description::{self, Prototype, SceneDescription};
use croupier_host::renderer::{Keep, Renderer, RendererError};
use std::error::Error;

/// Calls in a frame: 4 ms of 1 ms each.
pub const CALLS_PER_FRAME: u32 = 4;
/// A call of tracing: a ray takes up to 2,200 instructions, the call under 3 million.
pub const STEP: Budget = Budget { rays: 1_250 };
/// A call that ends an iteration: a unit of it takes some 300 instructions.
pub const FINISH: Budget = Budget { rays: 6_000 };
/// Pixels of the film that a frame reads for its preview.
const PREVIEW: usize = 16_384;
/// So many that one has few pixels: a frame reads those of one while the first iteration runs.
pub const SHARDS: u32 = 64;

/// What the next call does.
#[derive(Clone, Copy)]
enum Work {
    Begin,
    Step { shard: u32 },
    Finish,
}

/// What a user or a game changes between two frames.
pub struct Input {
    /// Angle of the camera about the vertical axis, radians.
    pub angle: f32,
    /// How far the object has moved from where it was baked, in world space.
    pub offset: [f32; 3],
    /// Radiance of the area light over that of the scene as baked.
    pub light: f32,
    /// Whether statistics serve on: they do while things move. The last change before a picture that is to be
    /// reproducible keeps nothing.
    pub keep: Keep,
}

/// What an engine stores: no lifetimes, and nothing is allocated after [`FrameLoop::new`].
pub struct FrameLoop {
    /// Scene, film and all memory.
    pub renderer: Renderer,
    work: Work,
    /// The camera as baked.
    camera: Camera,
    /// The first instance as baked: the object that moves. Scenes without instances have none.
    object: Option<Instance>,
    /// Material of the first area light, and its radiance as baked.
    light: Option<(u32, [f32; 3])>,
    /// What a frame shows, row by row.
    pub preview: Vec<[f32; 3]>,
    shown_until: usize,
    /// Iterations that have ended, also those of pictures that a change has ended.
    pub iterations: u64,
}

impl FrameLoop {
    /// Allocates all that frames need.
    pub fn new(blob: AlignedBytes, settings: &Settings) -> Result<Self, RendererError> {
        let renderer = Renderer::new(blob, settings)?;
        let (camera, object, light) = renderer.with_scene(|scene| {
            let light = scene.lights.iter().find(|l| l.kind == LightKind::Area as u32);
            let triangle = light.and_then(|l| scene.triangles.get(l.triangle as usize));
            let light = light.zip(triangle).map(|(l, t)| (t.material, l.emission));
            (*scene.camera, scene.instances.first().copied(), light)
        });
        let [columns, rows] = settings.size.map(|n| n as usize);
        let preview = vec![[0.0; 3]; columns * rows];
        Ok(Self { renderer, work: Work::Begin, camera, object, light, preview, shown_until: 0, iterations: 0 })
    }

    /// One frame of the engine.
    pub fn frame(&mut self, input: Option<&Input>) -> Result<(), RendererError> {
        if let Some(input) = input {
            let (camera, object, light) = (turned(&self.camera, input.angle), self.object, self.light);
            self.renderer.edit(input.keep, |scene: &mut SceneEdit<'_>| {
                // whatever else changes goes here
                scene.camera(camera)?;
                if let Some(object) = object {
                    scene.transform(0, moved(&object, input.offset))?;
                }
                match light {
                    Some((material, radiance)) => scene.emission(material, radiance.map(|x| x * input.light)).map(drop),
                    None => Ok(()),
                }
            })?;
            self.work = Work::Begin;
        }
        for _ in 0..CALLS_PER_FRAME {
            self.call()?;
        }
        self.show();
        Ok(())
    }

    /// One call of the renderer; an engine with a clock makes one after the other until the frame's time is used.
    fn call(&mut self) -> Result<(), RendererError> {
        self.work = match self.work {
            Work::Begin => {
                self.renderer.begin_iteration(samples(self.finished()));
                Work::Step { shard: 0 }
            }
            Work::Step { shard } => match self.renderer.step(shard, STEP)? {
                StepResult::More => Work::Step { shard },
                StepResult::Done if shard + 1 < self.renderer.plan().settings().shards => {
                    Work::Step { shard: shard + 1 }
                }
                StepResult::Done => Work::Finish,
            },
            Work::Finish => match self.renderer.finish_iteration(FINISH)? {
                StepResult::More => Work::Finish,
                StepResult::Done => {
                    self.iterations += 1;
                    Work::Begin
                }
            },
        };
        Ok(())
    }

    /// Iterations of the picture that have ended.
    pub fn finished(&self) -> u64 {
        self.renderer.iteration().number - u64::from(!matches!(self.work, Work::Begin))
    }

    /// Copies a part of the picture to the preview: of the film, or before there is one, of the shard that works.
    fn show(&mut self) {
        let (preview, number) = (&mut self.preview, self.renderer.iteration().number);
        match self.work {
            Work::Step { shard } if number <= 1 => self.renderer.with_unfinished(shard, |pixel, mean, _| {
                preview[pixel] = mean.map(|x| x as f32);
            }),
            Work::Finish if number <= 1 => (),
            _ => self.renderer.with_film(|film| {
                let first = self.shown_until;
                let last = preview.len().min(first + PREVIEW);
                for (shown, i) in preview[first..last].iter_mut().zip(first..) {
                    *shown = film.pixel(i).mean().map(|x| x as f32);
                }
                self.shown_until = if last < preview.len() { last } else { 0 };
            }),
        }
    }
}

/// Camera samples per pixel of an iteration: each as many as all before it, 16 at most.
pub fn samples(iteration: u64) -> u32 {
    1 << iteration.saturating_sub(1).min(4)
}

/// The camera, turned about the vertical axis of the world.
fn turned(camera: &Camera, angle: f32) -> Camera {
    let (sin, cos) = angle.sin_cos();
    let turn = |[x, y, z]: [f32; 3]| [cos * x + sin * z, y, cos * z - sin * x];
    let Camera { origin, forward, right, down, .. } = *camera;
    Camera { origin: turn(origin), forward: turn(forward), right: turn(right), down: turn(down), ..*camera }
}

/// The maps of an instance, as baked and then moved: when the shutter opens and when it closes. One that is given the
/// place of the last frame for its opening is blurred by its motion.
fn moved(object: &Instance, offset: [f32; 3]) -> [[[f32; 4]; 3]; 2] {
    let mut maps = object.to_world;
    for rows in &mut maps {
        rows.iter_mut().zip(offset).for_each(|(row, by)| row[3] += by);
    }
    maps
}

/// The scene of this program: the built-in Cornell box, whose metal sphere is an object that can move.
pub fn scene() -> SceneDescription {
    let mut scene = builtin::cornell_box();
    let starts: Vec<u32> = scene.objects.iter().map(|o| o.first_triangle).collect();
    if let Some(i) = scene.objects.iter().position(|o| o.name == "metal sphere") {
        let end = starts.get(i + 1).copied().unwrap_or(scene.triangles.len() as u32);
        let name = "metal sphere".to_string();
        let placed = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        scene.instances.push(description::Instance::new(&name, scene.prototypes.len() as u32, placed));
        scene.prototypes.push(Prototype { name, triangles: starts[i]..end, instances: Vec::new() });
    }
    scene
}

/// The script of this program: the camera turns and the object hops for `moving` frames, the light flickers now and
/// then, then all rests.
pub fn input(frame: u32, moving: u32) -> Option<Input> {
    (frame <= moving).then_some(Input {
        angle: 0.005 * frame as f32,
        offset: [0.0, 0.4 * (0.13 * frame as f32).sin().abs(), 0.002 * frame as f32],
        light: if frame % 7 == 3 { 0.5 } else { 1.0 },
        keep: if frame < moving { Keep::Statistics } else { Keep::Nothing },
    })
}

/// The same picture in whole iterations.
pub fn offline(blob: AlignedBytes, settings: &Settings, iterations: u64) -> Result<Renderer, RendererError> {
    let renderer = Renderer::new(blob, settings)?;
    for i in 0..iterations {
        renderer.begin_iteration(samples(i));
        for shard in 0..renderer.plan().settings().shards {
            while renderer.step(shard, Budget { rays: u64::MAX })? == StepResult::More {}
        }
        renderer.end_iteration()?;
    }
    Ok(renderer)
}

/// Identifies the bits of a picture.
pub fn hash(renderer: &Renderer) -> u64 {
    let image: Vec<_> = renderer.with_film(|film| film.pixels().map(|p| p.mean().map(|x| x as f32)).collect());
    content_hash(bytemuck::cast_slice(&image))
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default| args.get(i).map_or(Ok(default), |a| a.parse::<u32>());
    let (size, iterations) = ([number(0, 1920)?, number(1, 1080)?], u64::from(number(2, 2)?));
    let blob = bake(&scene(), &BakeOptions::default(), |_, _| {})?.bytes;
    let strategy = Strategy::parse(args.get(3).map_or("ears", |s| s))?;
    let scene = Scene::from_bytes(&blob)?;
    let settings = Settings { size, strategy, shards: SHARDS, aovs: true.into(), ..Settings::for_scene(&scene) };

    let (mut engine, mut frames, moving) = (FrameLoop::new(blob, &settings)?, 0, 120);
    while frames <= moving || engine.finished() < iterations {
        engine.frame(input(frames, moving).as_ref())?;
        frames += 1;
    }
    println!("{frames} frames, {:.1} s of a host with 60 per second", f64::from(frames) / 60.0);
    let renderer = engine.renderer;
    let (samples, rays) = (renderer.with_film(|film| film.pixel(0).samples), renderer.counters().rays());
    let error = renderer.with_film(|film| film.error_estimate().rel_mse);
    println!("{iterations} iterations, {samples} samples per pixel, {rays} rays, relMSE {error:.3e}");

    let (hash_of_frames, settings) = (hash(&renderer), *renderer.plan().settings());
    let hash_offline = hash(&offline(renderer.into_blob(), &settings, iterations)?);
    println!("hash {hash_of_frames:016x}, offline {hash_offline:016x}");
    if hash_of_frames == hash_offline { Ok(()) } else { Err("the pictures differ".into()) }
}

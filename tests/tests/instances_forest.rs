//! A forest of a billion triangles: memory, and a picture that shows it. Alone in its binary, because the counting
//! allocator is global.

use croupier::unstable::film::{Aov, AovSet};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::*;
use croupier_tests::allocator::{Counting, peak_of};
use croupier_tests::geometry::Rng;
use croupier_tests::placed::{Map, add_prototype};
use croupier_tests::runner::{finish, render, settings};
use croupier_tests::scenes::*;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A map that turns about y, scales, and moves.
fn standing(angle: f32, scale: f32, x: f32, z: f32) -> Map {
    let (s, c) = (scale * angle.sin(), scale * angle.cos());
    [[c, 0.0, s, x], [0.0, scale, 0.0, 0.0], [-s, 0.0, c, z]]
}

/// A tree of a trunk and many leaves; groves of trees; a forest of groves over a ground.
fn forest(leaves: u32, trees: u32, groves: u32, size: [u32; 2]) -> SceneDescription {
    let mut r = Rng(21);
    let mut s = SceneDescription { max_depth: 4, ..SceneDescription::default() };
    let side = (groves as f32).sqrt() * 40.0;
    s.camera = camera([0.0, 30.0, f64::from(-side) * 0.55], [0.0, 0.0, 0.0], 50.0, size);
    let ground = s.add_material("ground", diffuse([0.3, 0.22, 0.12]));
    let bark = s.add_material("bark", diffuse([0.25, 0.15, 0.1]));
    let leaf = s.add_material("leaf", diffuse([0.15, 0.4, 0.1]));
    add_quad(&mut s, "ground", ground, facing_y(side, 0.0, 1.0));
    let first = s.triangles.len() as u32;
    add_box(&mut s, bark, [-0.2, 0.0, -0.2], [0.2, 3.0, 0.2], false);
    let mut vertices = Vec::new();
    for _ in 0..leaves {
        let c = loop {
            let c = r.cube();
            if c.iter().map(|x| x * x).sum::<f32>() < 1.0 {
                break [2.0 * c[0], 5.0 + 2.8 * c[1], 2.0 * c[2]];
            }
        };
        vertices.extend([0; 3].map(|_| {
            let e = r.cube();
            Vertex { position: [0, 1, 2].map(|k| c[k] + 0.1 * e[k]), ..Vertex::default() }
        }));
    }
    let triangles: Vec<[u32; 3]> = (0..leaves).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    s.add_mesh("leaves", leaf, &vertices, &triangles, false);
    let tree = add_prototype(&mut s, "tree", first, vec![]);
    let place = |r: &mut Rng, name: &str, of: u32, reach: f32, size: [f32; 2]| {
        let (x, z) = (reach * r.signed(), reach * r.signed());
        Instance::new(name, of, standing(6.3 * r.unit(), size[0] + size[1] * r.unit(), x, z))
    };
    let of_grove = (0..trees).map(|_| place(&mut r, "tree", tree, 20.0, [0.7, 0.6])).collect();
    let none = s.triangles.len() as u32;
    let grove = add_prototype(&mut s, "grove", none, of_grove);
    s.instances = (0..groves).map(|_| place(&mut r, "grove", grove, side, [1.0, 0.0])).collect();
    s.emitters.push(Emitter::Directional { direction: [-0.4, -1.0, 0.5], irradiance: [3.0, 2.8, 2.4] });
    s.environment = Some(Environment::Constant { radiance: [0.4, 0.5, 0.7] });
    s
}

/// Material of the first hit of each pixel, and its mean radiance.
fn seen(bytes: &[u8], s: &Settings, samples: u32) -> (Vec<f32>, Vec<[f64; 3]>) {
    let s = Settings { shards: 1, aovs: AovSet::of(&[Aov::Material]), ..*s };
    let plan = Plan::new(&s).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut own = AlignedBytes::zeroed(plan.shard_of(0).size);
    let mut session = Session::new(Scene::from_bytes(bytes).unwrap(), &plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, own.as_mut()).unwrap();
    session.begin_iteration(samples);
    finish(&session, &mut shard, 1 << 20);
    session.end_iteration(&[shard]).unwrap();
    assert_eq!(session.counters().non_finite, 0);
    let film = session.film();
    (film.plane(Aov::Material, 0).unwrap().to_vec(), film.pixels().map(|p| p.mean()).collect())
}

/// 1e9 triangles in the world take a blob of a few megabytes, and render in it: leaves are seen in most of the picture's
/// lower half, and darken it. Killed by: an instance that copies what it places, a bound of memory that counts triangles in
/// the world, a forest that rays pass.
#[test]
fn a_billion_triangles_render_within_a_gibibyte() {
    let world: u64 = 1_000 * 50 * (20_000 + 12);
    assert!(world > 1_000_000_000);
    let (peak, (s, bytes, settings)) = peak_of(|| {
        let s = forest(20_000, 50, 1_000, [48, 32]);
        let bytes = bake(&s, &BakeOptions::default(), |_, _| {}).unwrap().bytes;
        let settings = Settings { size: [1920, 1080], ..settings(&bytes, "classic") };
        // memory of a large picture, and some of its rays
        let plan = Plan::new(&settings).unwrap();
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let mut own = AlignedBytes::zeroed(plan.shard_of(0).size);
        let mut session = Session::new(Scene::from_bytes(&bytes).unwrap(), &plan, shared.as_mut()).unwrap();
        let mut shard = Shard::new(&plan, 0, own.as_mut()).unwrap();
        session.begin_iteration(1);
        let _ = shard.step(&session, Budget { rays: 10_000 });
        (s, bytes, settings)
    });
    println!("{world} triangles: blob {} bytes, most in use {} MiB", bytes.len(), peak >> 20);
    assert!(bytes.len() < 8 << 20, "{} bytes", bytes.len());
    assert!(peak < 1 << 30, "{peak} bytes");
    assert_eq!(Scene::from_bytes(&bytes).unwrap().objects.len(), 3);

    let small = Settings { size: [48, 32], ..settings };
    let (materials, picture) = seen(&bytes, &small, 4);
    let mut empty = s.clone();
    empty.instances.clear();
    let (_, ground) = seen(&blob(&empty), &small, 4);
    let share = |rows: std::ops::Range<usize>, of: &[u32]| {
        let ids = &materials[48 * rows.start..48 * rows.end];
        ids.iter().filter(|id| of.iter().any(|m| **id == *m as f32)).count() as f64 / ids.len() as f64
    };
    let green = |picture: &[[f64; 3]]| picture[48 * 26..].iter().map(|p| p[1]).sum::<f64>() / (48.0 * 6.0);
    let tree = ["bark", "leaf"].map(|name| s.materials.iter().position(|m| m.name == name).unwrap() as u32);
    let [leaves, ground_seen] = [share(16..32, &tree), share(16..32, &[0])];
    let (with, without) = (green(&picture), green(&ground));
    println!("trees in {leaves}, ground in {ground_seen} of the lower half; {with} there, {without} without trees");
    assert!(leaves > 0.3 && leaves + ground_seen > 0.99, "{leaves}, {ground_seen}");
    assert!(share(0..1, &tree) < 0.5, "the sky is covered");
    assert!(with > 0.01 && with < 0.9 * without, "{with}, {without} without trees");
    if let Some(file) = std::env::var_os("FOREST_PNG") {
        let image = render(&bytes, &Settings { size: [480, 320], ..settings }, 16);
        let byte = |x: f64| (255.0 * (x / (x + 0.4)).powf(1.0 / 2.2)) as u8;
        let pixels: Vec<u8> = image.pixels.iter().flat_map(|p| p.mean().map(byte)).collect();
        std::fs::write(file, [b"P6 480 320 255\n".to_vec(), pixels].concat()).unwrap();
    }
}

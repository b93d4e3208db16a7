//! Scenes composed from arrays in the caller's memory, against those that the host bakes from the same description.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::compose::{LightSource, SceneParts, Sides, View};
use croupier::unstable::scene::blob::*;
use croupier::unstable::simd::Mask8;
use croupier::{EditableScene, Scene};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::description::{
    Camera as HostCamera, Emitter, LightShape, Projection, SceneDescription, ShapeLight, ThinLens,
};
use croupier_tests::arrays::{Arrays, composed};
use croupier_tests::geometry::{Ray, Rng, Tri, packet, soup};
use croupier_tests::runner::{render, settings};
use croupier_tests::scenes::{blob, cornell, everything};

/// Scenes that the host bakes.
fn scenes() -> Vec<(&'static str, SceneDescription)> {
    let mut showcase = builtin::showcase();
    showcase.camera.size = [40, 27];
    // tables of compensation are the host's
    showcase.materials.iter_mut().for_each(|m| m.compensated = false);
    let mut room = builtin::cornell_box();
    room.camera.size = [32, 32];
    vec![
        ("Cornell box", room),
        ("small Cornell box", cornell([24, 24])),
        ("everything", everything([40, 30])),
        ("showcase", showcase),
    ]
}

/// Everything but the tree and the choice among lights is what the host writes, to the last bit. Killed by: a formula
/// of
/// areas, normals or tables of plastics that differs from the host's, a light too many, an order that differs.
#[test]
fn composed_records_are_those_of_the_baker() {
    for (name, description) in scenes() {
        let baked = blob(&description);
        let host = Scene::from_bytes(&baked).unwrap();
        let arrays = Arrays::of(&host);
        let bytes = composed(&arrays.parts());
        let core = Scene::from_bytes(&bytes).unwrap();
        let nothing = bytemuck::Zeroable::zeroed();
        let bits = |s: &Scene<'_>| {
            let lists: [&[u8]; 12] = [
                bytemuck::bytes_of(s.info),
                bytemuck::bytes_of(s.camera),
                bytemuck::cast_slice(s.materials),
                bytemuck::cast_slice(s.tables),
                bytemuck::cast_slice(s.lights),
                bytemuck::cast_slice(s.textures),
                bytemuck::cast_slice(s.texels),
                bytemuck::cast_slice(s.env_texels),
                bytemuck::bytes_of(s.environment.unwrap_or(&nothing)),
                bytemuck::cast_slice(s.media),
                s.names,
                &[],
            ];
            lists.map(<[u8]>::to_vec)
        };
        let (ours, theirs) = (bits(&core), bits(&host));
        for (list, (a, b)) in ours.iter().zip(&theirs).enumerate().take(10) {
            assert!(a == b, "{name}: list {list}");
        }
        assert_eq!(core.effects, host.effects, "{name}");
        let flat = |t: &Triangle| Triangle { flags: t.flags & TRIANGLE_SMOOTH, ..*t };
        for (a, b) in core.triangles.iter().zip(host.triangles) {
            assert_eq!(bytemuck::bytes_of(&flat(a)), bytemuck::bytes_of(&flat(b)), "{name}");
        }
        assert_eq!(core.triangles.len(), host.triangles.len());
        for (a, b) in core.light_alias.iter().zip(host.light_alias) {
            assert!((a.probability - b.probability).abs() <= 1e-6 * b.probability + 1e-9, "{name}: {a:?} {b:?}");
        }
        for (a, b) in core.env_alias.iter().zip(host.env_alias) {
            assert!((a.probability - b.probability).abs() <= 1e-6 * b.probability + 1e-9, "{name}: {a:?} {b:?}");
        }
        assert_eq!(core.env_alias.len(), host.env_alias.len());
        assert!(EditableScene::new(bytes).is_ok(), "{name}");
    }
}

/// Expected visits of nodes and leaves by rays that meet the root's box.
fn sah(nodes: &[Node]) -> f64 {
    let area = |bounds: [[f32; 2]; 3]| {
        let e = bounds.map(|[lo, hi]| f64::from(hi) - f64::from(lo));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    };
    let of = |n: &Node, c: usize| area([0, 1, 2].map(|k| [n.bounds[k][c], n.bounds[k + 3][c]]));
    let all = nodes.iter().flat_map(|n| (0..8).filter(|c| n.child[*c] != NONE).map(|c| of(n, c)));
    let fold = |row: &[f32; 8], f: fn(f32, f32) -> f32, from| row.iter().fold(from, |m, x| f(m, *x));
    let root = &nodes[0].bounds;
    let whole =
        [0, 1, 2].map(|k| [fold(&root[k], f32::min, f32::INFINITY), fold(&root[k + 3], f32::max, f32::NEG_INFINITY)]);
    all.sum::<f64>() / area(whole)
}

/// Rolling ground of 2 n^2 triangles.
fn terrain(n: usize) -> Vec<Tri> {
    let at = |i: usize, j: usize| {
        let (x, z) = (i as f32 / n as f32, j as f32 / n as f32);
        [x, 0.1 * ((7.0 * x).sin() + (4.0 * z + x).cos()), z]
    };
    let quads = (0..n * n).flat_map(|k| {
        let (i, j) = (k % n, k / n);
        [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]
    });
    quads.collect()
}

/// Needles: long and thin, in all directions.
fn needles(n: usize, r: &mut Rng) -> Vec<Tri> {
    let needle = |_| {
        let (o, d, w) = (r.cube(), r.cube(), r.cube());
        let at = |s: f32, t: f32| [0, 1, 2].map(|k| o[k] + s * d[k] + t * w[k]);
        [at(-0.5, 0.0), at(0.5, 0.0), at(0.5, 0.002)]
    };
    (0..n).map(needle).collect()
}

/// Triangles around few points, as fans and shells have them: boxes of many sizes with the same centre.
fn same_centres(n: usize, r: &mut Rng) -> Vec<Tri> {
    let centres: Vec<_> = (0..n / 50).map(|_| r.cube().map(|x| 4.0 * x)).collect();
    let triangle = |i: usize| {
        let (c, s) = (centres[i % centres.len()], 0.01 + 0.3 * r.unit());
        let at = |x: f32, y: f32, z: f32| [c[0] + s * x, c[1] + s * y, c[2] + s * z];
        [at(-1.0, -1.0, -1.0), at(1.0, 1.0, -1.0), at(-1.0, 1.0, 1.0)]
    };
    (0..n).map(triangle).collect()
}

/// Triangles of a description.
fn triangles(scene: &SceneDescription) -> Vec<Tri> {
    scene.triangles.iter().map(|t| t.vertices.map(|v| scene.vertices[v as usize].position)).collect()
}

fn camera() -> Camera {
    View::default().record().unwrap()
}

/// A blob of these triangles, of one material.
fn of_triangles(triangles: &[Tri]) -> AlignedBytes {
    let indices: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let grey = Material { reflectance: [0.5; 3], ..Material::new(MaterialKind::Diffuse) };
    let parts = SceneParts {
        positions: triangles.as_flattened(),
        triangles: &indices,
        materials: &[grey],
        ..SceneParts::new(camera())
    };
    composed(&parts)
}

/// Composed trees are valid, find what the host's find, and cost about as much to walk. Killed by: triangles lost,
/// boxes too
/// small, leaves that were not moved up to the nodes, splits at medians.
#[test]
fn composed_trees_find_the_same_and_cost_no_more() {
    let mut r = Rng(5);
    let meshes = [
        ("Cornell box", triangles(&builtin::cornell_box())),
        ("showcase", triangles(&builtin::showcase())),
        ("terrain", terrain(60)),
        ("soup", soup(3000, [0.0; 3], 1.0, 0.05, &mut r)),
        ("needles", needles(3000, &mut r)),
        ("same centres", same_centres(3000, &mut r)),
        ("one", soup(1, [0.0; 3], 1.0, 0.5, &mut r)),
        ("nine", soup(9, [0.0; 3], 1.0, 0.5, &mut r)),
    ];
    for (name, mesh) in meshes {
        let bytes = of_triangles(&mesh);
        let scene = Scene::from_bytes(&bytes).unwrap();
        assert_eq!(scene.triangles.len(), mesh.len(), "{name}");
        let host = croupier_host::bvh::build(&mesh, croupier_host::bvh::Effort::Medium);
        let (ours, theirs) = (sah(scene.nodes), sah(&host.nodes));
        let (nodes, leaves) = (scene.nodes.len(), scene.leaves.len());
        println!(
            "{name}: {} triangles, {nodes} nodes, {leaves} leaves, cost {ours:.3}, of the host's {theirs:.3}: {:.3}",
            mesh.len(),
            ours / theirs
        );
        assert!(ours <= 1.15 * theirs, "{name}: cost {ours} against {theirs}");
        let (a, b) = (WideBvh::new(&scene), WideBvh::from_parts(&host.nodes, &host.leaves));
        let size = mesh.iter().flatten().flatten().fold(0.0f32, |m, x| m.max(x.abs()));
        let mut hits = 0;
        for _ in 0..500 {
            let rays: [Ray; 8] = std::array::from_fn(|_| {
                let (t, c) = (mesh[r.below(mesh.len())], r.cube());
                let o = r.cube().map(|x| 1.5 * size * x);
                let at = |k: usize| (t[0][k] + t[1][k] + t[2][k]) / 3.0 + 0.001 * size * c[k];
                Ray::new(o, [0, 1, 2].map(|k| at(k) - o[k]))
            });
            let rays = packet(&rays);
            let (x, y) = (a.closest(&rays, Mask8::all_lanes()), b.closest(&rays, Mask8::all_lanes()));
            assert_eq!(x.hit, y.hit, "{name}");
            assert_eq!(a.occluded(&rays, Mask8::all_lanes()), y.hit, "{name}");
            for i in x.hit.lanes() {
                hits += 1;
                let (s, t) = (x.t.lane(i), y.t.lane(i));
                // entries of boxes that differ may move a hit by a rounding; on edges two triangles are as near
                assert!((s - t).abs() <= 1e-6 * t, "{name}: {s} {t}");
                assert!(s != t || x.triangle.lane(i) == y.triangle.lane(i), "{name}");
            }
        }
        assert!(hits > 500, "{name}: {hits} hits");
    }
}

/// Pictures are the same but for noise. Killed by: a light that is not chosen or chosen with another probability than
/// the table
/// states, a wrong scale of the environment, lights that triangles do not refer to.
#[test]
fn composed_scenes_look_like_baked_ones() {
    for (name, description) in scenes() {
        let baked = blob(&description);
        let bytes = composed(&Arrays::of(&Scene::from_bytes(&baked).unwrap()).parts());
        let image = |bytes: &[u8]| render(bytes, &settings(bytes, "classic"), 64);
        let (host, core) = (image(&baked), image(&bytes));
        for c in 0..3 {
            let noise = host.error_of_channel(c).hypot(core.error_of_channel(c));
            let z = (host.channel(c) - core.channel(c)) / noise;
            println!("{name}: {:.5} and {:.5}, z {z:.2}", host.channel(c), core.channel(c));
            // 12 comparisons: a false alarm in 1e5 runs
            assert!(z.abs() < 5.0, "{name}: channel {c}: {} and {}", host.channel(c), core.channel(c));
            assert!(noise < 0.05 * host.channel(c), "{name}: too noisy to tell");
        }
    }
}

/// Records of lights and cameras are the host's to the last bit. Killed by: an angle that is halved twice, a direction
/// that is
/// not turned round, an axis in another order.
#[test]
fn lights_and_cameras_are_those_of_the_host() {
    let (position, direction) = ([0.3, -1.5, 2.25], [1.0, -3.0, 0.7]);
    let (radiance, radius) = ([1.0, 2.5, 0.0], 0.75);
    let edges = [[2.0, 0.0, 1.0], [-0.5, 3.0, 1.0]];
    let shape =
        |shape, two_sided, visible| Emitter::Shape(ShapeLight { shape, position, radiance, two_sided, visible });
    let sides = |two_sided, visible| Sides { two_sided, visible };
    let (inner_deg, outer_deg, angle_deg) = (12.5, 40.0, 0.53);
    let pairs = [
        (Emitter::Point { position, intensity: radiance }, LightSource::Point { position, intensity: radiance }),
        (
            Emitter::Spot { position, direction, intensity: radiance, inner_deg, outer_deg },
            LightSource::Spot { position, direction, intensity: radiance, inner_deg, outer_deg },
        ),
        (
            Emitter::Directional { direction, irradiance: radiance },
            LightSource::Directional { direction, irradiance: radiance },
        ),
        (
            Emitter::Sun { direction, irradiance: radiance, angle_deg },
            LightSource::Sun { direction, irradiance: radiance, angle_deg },
        ),
        (
            shape(LightShape::Sphere { radius }, false, true),
            LightSource::Sphere { position, radius, radiance, sides: sides(false, true) },
        ),
        (
            shape(LightShape::Disk { direction, radius }, true, true),
            LightSource::Disk { position, direction, radius, radiance, sides: sides(true, true) },
        ),
        (
            shape(LightShape::Rectangle { edges }, true, false),
            LightSource::Rectangle { position, edges, radiance, sides: sides(true, false) },
        ),
    ];
    for (emitter, source) in pairs {
        let scene = SceneDescription { emitters: vec![emitter], ..SceneDescription::default() };
        let bytes = blob(&scene);
        let baked = Scene::from_bytes(&bytes).unwrap();
        let light = source.record().unwrap();
        assert_eq!(bytemuck::bytes_of(&light), bytemuck::bytes_of(&baked.lights[0]), "{source:?}");
        let parts = SceneParts { lights: &[light], ..SceneParts::new(camera()) };
        assert!(Scene::from_bytes(&composed(&parts)).is_ok(), "{source:?}");
    }
    let views = [
        (Projection::Perspective, CameraKind::Perspective, 33.3, 0.125),
        (Projection::Orthographic { height: 2.5 }, CameraKind::Orthographic, 2.5, 0.0),
        (Projection::Panoramic, CameraKind::Panoramic, 0.0, 0.0),
    ];
    for (projection, kind, extent, lens_radius) in views {
        let (origin, target, up, size) = ([1.0, 2.0, 3.5], [-0.5, 0.25, 0.1], [0.1, 1.0, 0.2], [37, 19]);
        let lens = (lens_radius > 0.0).then_some(ThinLens { radius: lens_radius, focus_distance: 4.5 });
        let camera = HostCamera { projection, origin, target, up, vfov_deg: 33.3, size, lens };
        let bytes = blob(&SceneDescription { camera, ..SceneDescription::default() });
        let view = View { kind, origin, target, up, extent, size, lens_radius, focus_distance: 4.5 };
        let baked = Scene::from_bytes(&bytes).unwrap();
        let record = view.record().unwrap();
        assert_eq!(bytemuck::bytes_of(&record), bytemuck::bytes_of(baked.camera), "{kind:?}");
    }
}

//! The light tree: what it picks and what it states; `light_tree_pictures.rs` has its pictures.

mod many_kinds;

use croupier::unstable::light::{LightSelector, SURFACE_FLOOR, TreeSelector, light_importance, light_node_of};
use croupier::unstable::scene::blob::*;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{EditableScene, Scene};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{Emitter, Instance, Vertex as Corner};
use croupier_tests::light_oracle::{V, cross, dot, length, sub, unit, wide};
use croupier_tests::many_lights::cloud;
use croupier_tests::placed::{add_prototype, flatten};
use croupier_tests::scenes::blob;
use croupier_tests::stats::{SplitMix, chi_square_in_order};
use many_kinds::mixed;

/// Points above the floor and normals, some of which are 0.
fn points(rng: &mut SplitMix, n: usize) -> Vec<([f32; 3], [f32; 3])> {
    let point = |rng: &mut SplitMix| [rng.range(-7.0, 7.0), rng.range(0.0, 4.0), rng.range(-7.0, 7.0)];
    let one = |k| (point(rng).map(|x| x as f32), if k % 4 == 0 { [0.0; 3] } else { rng.direction().map(|x| x as f32) });
    (0..n).map(one).collect()
}

fn splat(v: [f32; 3]) -> Vec3x8 {
    Vec3x8::splat(v[0], v[1], v[2])
}

/// Stated probabilities of all lights for one point.
fn stated(selector: &impl LightSelector, lights: usize, p: [f32; 3], n: [f32; 3]) -> Vec<f32> {
    let of = |first: usize| {
        let light = U32x8::from_fn(|i| (first + i) as u32);
        selector.probability(splat(p), splat(n), light, Mask8::all_lanes()).to_array()
    };
    (0..lights).step_by(8).flat_map(of).take(lights).collect()
}

fn assert_selector_follows(scene: &Scene<'_>, what: &str, seed: u64) {
    let (lights, mut rng) = (scene.lights.len(), SplitMix(seed));
    let selector = TreeSelector(*scene);
    for (k, (p, n)) in points(&mut rng, 12).into_iter().enumerate() {
        let stated = stated(&selector, lights, p, n);
        let sum: f64 = stated.iter().map(|x| f64::from(*x)).sum();
        assert!(sum <= 1.0 + 1e-5, "{what}, point {k}: {sum}");
        let (mut counts, mut none, draws) = (vec![0u64; lights + 1], 0, 1u64 << 18);
        for _ in 0..draws / 8 {
            let r = U32x8::from_fn(|_| rng.word());
            let (light, probability) = selector.select(splat(p), splat(n), r, Mask8::all_lanes());
            for (light, probability) in light.to_array().into_iter().zip(probability.to_array()) {
                match stated.get(light as usize) {
                    Some(stated) if probability > 0.0 => {
                        assert_eq!(probability.to_bits(), stated.to_bits(), "{what}, point {k}, light {light}");
                        counts[light as usize] += 1;
                    }
                    _ => none += 1,
                }
            }
        }
        counts[lights] = none;
        let mut expected: Vec<f64> = stated.iter().map(|x| f64::from(*x) * draws as f64).collect();
        expected.push((1.0 - sum).max(0.0) * draws as f64);
        if expected[lights] < 1.0 {
            // the rounding of the sum
            assert!(none < 10, "{what}, point {k}: {none} without a light");
            (counts[lights], expected[lights]) = (0, 0.0);
        }
        let p = chi_square_in_order(&counts, &expected);
        println!("{what}, point {k}: sum {sum:.6}, p = {p:.3}");
        assert!(p > 1e-6, "{what}, point {k}: p = {p}");
    }
}

/// Chi-square of the choice against stated probabilities, which are the same from both functions to the bit. Killed
/// by: a random number that is not stretched, `before` of another child, shares of another level, a trail read from
/// its end.
#[test]
fn choice_follows_the_stated_probabilities() {
    for n in [40, 1000] {
        let bytes = blob(&mixed(n));
        let scene = Scene::from_bytes(&bytes).unwrap();
        // a full tree has one node for every seven lights
        let nodes = scene.light_nodes.len();
        println!("{n} emitters, {} lights: {nodes} nodes", scene.lights.len());
        assert!(nodes > 0 && nodes * 5 <= scene.lights.len());
        assert_selector_follows(&scene, &format!("{n} emitters"), u64::from(n));
    }
}

/// Killed by: the point, the normal or the random number of another lane, lanes that go on where others do.
#[test]
fn lanes_are_chosen_for_as_if_alone() {
    let bytes = blob(&mixed(300));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let (selector, mut rng) = (TreeSelector(scene), SplitMix(11));
    for eight in points(&mut rng, 8 * 500).chunks_exact(8) {
        let of = |f: &dyn Fn(usize, usize) -> f32| {
            let [x, y, z] = [0, 1, 2].map(|axis| F32x8::from_fn(|i| f(i, axis)));
            Vec3x8::new(x, y, z)
        };
        let (p, n) = (of(&|i, axis| eight[i].0[axis]), of(&|i, axis| eight[i].1[axis]));
        let (r, mask) = (U32x8::from_fn(|_| rng.word()), Mask8::from_bits(rng.word() & 255));
        let (light, probability) = selector.select(p, n, r, mask);
        for (i, (point, normal)) in eight.iter().enumerate().filter(|(i, _)| mask.lane(*i)) {
            let alone = selector.select(splat(*point), splat(*normal), U32x8::splat(r.lane(i)), Mask8::all_lanes());
            assert_eq!((light.lane(i), probability.lane(i)), (alone.0.lane(3), alone.1.lane(3)), "lane {i}");
        }
    }
}

/// Lights that no split tells apart, and lights of which each split takes a few off one end, have trees that validate, with
/// a trail for each light. Killed by: parts that are not halved in time, a range that is not split.
#[test]
fn lights_in_one_place_and_ever_closer_have_trees() {
    let scenes: [(u32, &dyn Fn(u32) -> f32); 3] =
        [(200, &|_| 1.0), (9600, &|k| (0.5f32).powi((k / 80) as i32)), (70, &|k| if k == 0 { -1e4 } else { k as f32 })];
    for (n, x) in scenes {
        let mut s = cloud(1, [4, 4]);
        let point = |k| Emitter::Point { position: [x(k), 2.0, 0.0], intensity: [1.0; 3] };
        s.emitters.extend((0..n).map(point));
        let bytes = blob(&s);
        let scene = Scene::from_bytes(&bytes).unwrap();
        assert!(!scene.light_nodes.is_empty() && scene.light_trails.len() == scene.lights.len());
        assert!(scene.light_trails.iter().all(|trail| *trail != NONE), "{n} lights");
        let stated = stated(&TreeSelector(scene), scene.lights.len(), [0.3, 0.0, 0.2], [0.0, 1.0, 0.0]);
        let sum: f64 = stated.iter().map(|x| f64::from(*x)).sum();
        assert!((sum - 1.0).abs() < 1e-4 && stated[scene.lights.len() - 1] > 0.0, "{n} lights: {sum}");
    }
}

/// The importance of a child in f64, with angles.
fn oracle(node: &LightNode, k: usize, p: V, n: V) -> f64 {
    let at = |rows: &[[f32; 8]; 3]| wide([rows[0][k], rows[1][k], rows[2][k]]);
    let (radius, weight) = (f64::from(node.radius[k]), f64::from(node.weight[k]));
    if radius.is_infinite() {
        return weight;
    }
    let d = sub(at(&node.middle), p);
    let (r, axis) = (length(d), at(&node.axis));
    if -dot(axis, d) <= f64::from(node.front[k]) {
        return 0.0;
    }
    let inside = r <= radius;
    let ball = if inside { std::f64::consts::PI } else { (radius / r).asin() };
    let between = |a: V, b: V| (dot(a, b) / length(a) / length(b)).clamp(-1.0, 1.0).acos();
    let cone = f64::from(node.sin[k]).atan2(f64::from(node.cos[k]));
    let at_light = (between(axis, d.map(|x| -x)) - cone - ball).max(0.0);
    if at_light >= std::f64::consts::FRAC_PI_2 {
        return 0.0;
    }
    let floor = f64::from(SURFACE_FLOOR);
    let at_surface = if length(n) == 0.0 {
        1.0
    } else {
        let angle = between(n, d).min(std::f64::consts::PI - between(n, d));
        floor + (1.0 - floor) * (angle - ball).max(0.0).cos()
    };
    weight * at_light.cos() * at_surface / (r * r).max(radius * radius)
}

/// Killed by: a cone that narrows what is bounded, a sine for a cosine, the floor left out, the ball's angle added, no
/// square.
#[test]
fn importance_agrees_with_the_oracle() {
    let bytes = blob(&mixed(300));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let mut rng = SplitMix(5);
    let (mut dark, mut bright) = (0, 0);
    for node in scene.light_nodes {
        for (p, n) in points(&mut rng, 40) {
            let got = light_importance(node, p, n).to_array();
            for (k, got) in got.into_iter().enumerate().filter(|(k, _)| node.weight[*k] > 0.0) {
                let want = oracle(node, k, wide(p), wide(n));
                let scale = f64::from(node.weight[k]) / length(sub(wide(p), wide(node_middle(node, k)))).powi(2);
                // cosines near 0 are good to 1e-3: f32 sines near a right angle
                let bound = 1e-3 * want + 2e-3 * scale.min(1e9);
                assert!((f64::from(got) - want).abs() <= bound, "{got} for {want}");
                *(if want > 0.0 { &mut bright } else { &mut dark }) += 1;
            }
        }
    }
    assert!(dark > 1000 && bright > 1000, "{dark} {bright}");
}

fn node_middle(node: &LightNode, k: usize) -> [f32; 3] {
    [0, 1, 2].map(|i| node.middle[i][k])
}

/// What emits towards a point may be picked there, and a triangle that faces away is not. Killed by: a ball or cone
/// that leaves something out, an axis of the back, a plane taken from the box's middle.
#[test]
fn what_shines_is_picked_and_what_faces_away_is_not() {
    let bytes = blob(&mixed(600));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let selector = TreeSelector(scene);
    let mut rng = SplitMix(6);
    let (mut front, mut back) = (0, 0);
    for (p, n) in points(&mut rng, 60) {
        for (i, (light, stated)) in scene.lights.iter().zip(stated(&selector, scene.lights.len(), p, n)).enumerate() {
            if light.kind != LightKind::Area as u32 {
                let behind = light.kind == LightKind::Disk as u32 && p[1] >= 2.0;
                let outside = light.kind == LightKind::Spot as u32;
                assert!(stated > 0.0 || behind || outside, "light {i} of kind {}", light.kind);
                continue;
            }
            let t = &scene.triangles[light.triangle as usize];
            let [a, b, c] = t.vertex.map(|v| wide(scene.vertices[v as usize].p));
            let normal = unit(cross(sub(b, a), sub(c, a)));
            let height = dot(sub(wide(p), a), normal);
            if height > 1e-3 {
                assert!(stated > 0.0, "light {i} shines from {height}");
                front += 1;
            } else if height < -1e-3 {
                assert_eq!(stated, 0.0, "light {i} faces away by {height}");
                back += 1;
            }
        }
    }
    assert!(front > 5000 && back > 5000);
}

/// Edits of emission and place refit the tree: choice and densities follow, the new place counts. Killed by: weights of
/// before, nodes that keep the old place, parents that are not refitted.
#[test]
fn edits_refit_the_tree() {
    let mut scene = EditableScene::new(blob(&mixed(100))).unwrap();
    let before: Vec<LightNode> = scene.scene().light_nodes.to_vec();
    let same = |a: &[LightNode], b: &[LightNode]| bytemuck::cast_slice::<_, u8>(a) == bytemuck::cast_slice::<_, u8>(b);
    let index = scene.scene().lights.iter().position(|l| l.kind == LightKind::Point as u32).unwrap() as u32;
    let old = scene.scene().lights[index as usize];
    let moved = Light { vector: [6.0, 0.5, -6.0], emission: [40.0, 40.0, 40.0], ..old };
    let at = |scene: &EditableScene<AlignedBytes>| {
        let scene = scene.scene();
        stated(&TreeSelector(scene), scene.lights.len(), [6.0, 0.0, -6.2], [0.0, 1.0, 0.0])[index as usize]
    };
    assert!(at(&scene) < 0.02, "{}", at(&scene));
    scene.edit().light(index, moved).unwrap();
    // its neighbours in the tree are far: it is in the ball of all of them
    assert!(at(&scene) > 0.3, "{}", at(&scene));
    assert_selector_follows(&scene.scene(), "after an edit", 9);
    // dark, then lit again
    scene.edit().light(index, Light { emission: [0.0; 3], ..moved }).unwrap();
    assert_eq!(at(&scene), 0.0);
    scene.edit().light(index, moved).unwrap();
    assert!(at(&scene) > 0.3);
    scene.edit().light(index, old).unwrap();
    let view = scene.scene();
    for (i, node) in view.light_nodes.iter().enumerate() {
        assert!(same(&[*node], &[light_node_of(&view, view.light_nodes, i).unwrap()]));
        // the alias table that was built anew states probabilities that differ by 2^-32
        let close = |a: &f32, b: &f32| a == b || (a - b).abs() <= 1e-3 * a.abs().max(b.abs());
        assert!(node.weight.iter().zip(&before[i].weight).all(|(a, b)| close(a, b)), "node {i}");
    }
    scene.seal();
    assert!(Scene::from_bytes(scene.bytes()).is_ok());
}

/// Places, directions and weights of all lights in a tree, by place.
fn leaves(scene: &Scene<'_>) -> Vec<[f32; 8]> {
    let of = |n: &LightNode, k: usize| {
        let [m, a] = [&n.middle, &n.axis].map(|rows| [rows[0][k], rows[1][k], rows[2][k]]);
        [m[0], m[1], m[2], a[0], a[1], a[2], n.radius[k], n.weight[k]]
    };
    let leaf = |n: &LightNode, k: usize| n.child[k] != NONE && n.child[k] & LEAF_BIT != 0;
    let all = scene.light_nodes.iter().flat_map(|n| (0..8).filter(|k| leaf(n, *k)).map(|k| of(n, k)));
    let mut out: Vec<_> = all.collect();
    out.sort_by(|a, b| a[..3].partial_cmp(&b[..3]).unwrap());
    out
}

/// Emitters of instances are in the tree where they are in the world, and move along with an edit. Killed by: lights of
/// instances in the space of their prototypes, mirrored ones that face the wrong way, a tree that moves leave as it is.
#[test]
fn instances_have_their_places_in_the_tree() {
    let mut scene = cloud(3, [4, 4]);
    let lamp = scene.triangles.last().unwrap().material;
    let first = scene.triangles.len() as u32;
    let at = |x, y, z| Corner { position: [x, y, z], ..Corner::default() };
    let corners = [at(0.0, 0.0, 0.0), at(0.3, 0.0, 0.0), at(0.0, 0.2, 0.1), at(0.1, 0.4, -0.2)];
    scene.add_mesh("lamp", lamp, &corners, &[[0, 1, 2], [1, 3, 2]], false);
    let prototype = add_prototype(&mut scene, "lamp", first, vec![]);
    for k in 0..30u8 {
        let [x, z] = [f32::from(k % 6), f32::from(k / 6)];
        let side = if k % 3 == 0 { -1.0 } else { 1.0 };
        let to_world = [[side, 0.2, 0.0, x], [0.0, 1.0, 0.1, 1.0 + 0.05 * x * z], [0.3, 0.0, 1.0, z]];
        let name = format!("lamp {k}");
        scene.instances.push(Instance { name, prototype, to_world, to_world_end: None, visible: true });
    }
    let agree = |a: &Scene<'_>, b: &Scene<'_>| {
        let (a, b) = (leaves(a), leaves(b));
        assert!(a.len() == b.len() && a.len() == 63, "{} {}", a.len(), b.len());
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).abs() <= 1e-4 * (1.0 + a.abs()), "{a} {b}");
        }
    };
    let placed = blob(&scene);
    agree(&Scene::from_bytes(&placed).unwrap(), &Scene::from_bytes(&blob(&flatten(&scene))).unwrap());
    let moved = [[1.0, 0.0, 0.0, -3.0], [0.0, 1.0, 0.0, 2.5], [0.0, 0.0, 1.0, -4.0]];
    let mut edited = EditableScene::new(placed).unwrap();
    edited.edit().transform(7, [moved; 2]).unwrap();
    scene.instances[7].to_world = moved;
    agree(&edited.scene(), &Scene::from_bytes(&blob(&scene)).unwrap());
}

/// Changes a section's bytes and makes the blob's hash right again.
fn damaged(blob: &[u8], kind: SectionKind, change: impl FnOnce(&mut [u8])) -> AlignedBytes {
    let mut out = AlignedBytes::zeroed(blob.len());
    let bytes = out.as_mut();
    bytes.copy_from_slice(blob);
    let mut header: Header = bytemuck::pod_read_unaligned(&bytes[..size_of::<Header>()]);
    let section = (0..header.sections as usize)
        .map(|i| size_of::<Header>() + i * size_of::<Section>())
        .map(|at| bytemuck::pod_read_unaligned::<Section>(&bytes[at..at + size_of::<Section>()]))
        .find(|s| s.kind == kind as u32)
        .unwrap();
    change(&mut bytes[section.offset as usize..][..section.count as usize * section.stride as usize]);
    header.hash = content_hash(&bytes[size_of::<Header>()..]);
    bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
    out
}

/// Blobs with few lights have no tree, and broken trees are refused. Killed by: a check of the validator that is left
/// out.
#[test]
fn broken_trees_are_refused() {
    let few = blob(&cloud(3, [4, 4]));
    assert!(Scene::from_bytes(&few).unwrap().light_nodes.is_empty());
    let bytes = blob(&mixed(100));
    let nodes = Scene::from_bytes(&bytes).unwrap().light_nodes.to_vec();
    let child = |bytes: &mut [u8], node: usize, slot: usize, to: u32| {
        bytemuck::cast_slice_mut::<u8, LightNode>(bytes)[node].child[slot] = to;
    };
    let inner = (0..8).find(|k| nodes[0].child[*k] & LEAF_BIT == 0).unwrap();
    type Change = Box<dyn Fn(&mut [u8])>;
    let of_nodes: Vec<(&str, Change)> = vec![
        ("a circle", Box::new(move |b| child(b, 0, inner, 0))),
        ("no such node", Box::new(move |b| child(b, 0, inner, 1 << 20))),
        ("no such light", Box::new(move |b| child(b, 0, inner, LEAF_BIT | 1 << 20))),
        ("a subtree cut off", Box::new(move |b| child(b, 0, inner, NONE))),
        ("a weight below 0", Box::new(|b| bytemuck::cast_slice_mut::<u8, LightNode>(b)[0].weight[0] = -1.0)),
        (
            "a weight that is no number",
            Box::new(|b| bytemuck::cast_slice_mut::<u8, LightNode>(b)[0].weight[1] = f32::NAN),
        ),
        (
            "a place that is no number",
            Box::new(|b| bytemuck::cast_slice_mut::<u8, LightNode>(b)[0].middle[1][0] = f32::NAN),
        ),
        ("a negative radius", Box::new(|b| bytemuck::cast_slice_mut::<u8, LightNode>(b)[0].radius[0] = -1.0)),
    ];
    for (what, change) in of_nodes {
        assert!(Scene::from_bytes(&damaged(&bytes, SectionKind::LightNodes, |b| change(b))).is_err(), "{what}");
    }
    let trails = |change: fn(&mut [u32])| {
        let damaged = damaged(&bytes, SectionKind::LightTrails, |b| change(bytemuck::cast_slice_mut(b)));
        Scene::from_bytes(&damaged).is_err()
    };
    assert!(trails(|t| t.swap(0, 1)), "trails of other lights");
    assert!(trails(|t| t[5] = NONE), "a light that is picked but has no density");
    assert!(trails(|t| t[7] |= 7 << 27), "a trail that goes on behind its light");
    assert!(Scene::from_bytes(&damaged(&bytes, SectionKind::LightNodes, |_| ())).is_ok());
}

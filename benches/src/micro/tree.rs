//! Rays against nodes, triangles and whole trees.
//!
//! Tests of boxes and triangles have no name outside of the traversal, so they are measured in trees that are nothing
//! but nodes in a chain, or leaves in a node: what is set up per ray is small against that. One ray takes eight boxes or
//! triangles at a time, eight rays together take them one after the other; figures are per eight tests in both.

use super::{Kernels, Outcome, PACKETS, each, expect, leak, mean_lanes};
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::Ray8;
use croupier::unstable::scene::blob::{LEAF_BIT, Leaf, NONE, Node};
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
use croupier_tests::geometry::{Mesh, Ray, Rng, Tri, Verdict, judge, packet, star};
use croupier_tests::stats::SplitMix;

/// Nodes of the chain.
const CHAIN: usize = 64;

pub(super) fn add(k: &mut Kernels) -> Outcome {
    each([nodes, triangles, trees], |add| add(k))
}

/// A node whose children are boxes `lo..hi`.
fn node(children: &[(u32, [[f32; 3]; 2])]) -> Node {
    let mut node = Node { bounds: [[0.0; 8]; 6], child: [NONE; 8], reserved: [0; 8] };
    for i in 0..8 {
        // what is not there is a box that no ray meets
        let (child, [lo, hi]) =
            children.get(i).copied().unwrap_or((NONE, [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]));
        node.child[i] = child;
        for a in 0..3 {
            (node.bounds[a][i], node.bounds[3 + a][i]) = (lo[a], hi[a]);
        }
    }
    node
}

/// Eight copies of a triangle at heights from `z` on.
fn leaf(z: f32, first: u32) -> Leaf {
    let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
    for i in 0..8 {
        let z = z + i as f32;
        let corners = [[-4.0, -4.0, z], [4.0, -4.0, z], [0.0, 6.0, z]];
        for (row, x) in corners.as_flattened().iter().enumerate() {
            leaf.p[row][i] = *x;
        }
        leaf.triangle[i] = first + i as u32;
    }
    leaf
}

/// Of a leaf with eight triangles.
fn reference(leaf: u32) -> u32 {
    LEAF_BIT | 8 << 27 | leaf
}

/// Rays upwards from below the middle.
fn upwards(rng: &mut SplitMix) -> Ray8 {
    let o = Vec3x8::from_fn(|_| [rng.range(-0.9, 0.9) as f32, rng.range(-0.9, 0.9) as f32, -1.0]);
    let d = Vec3x8::from_fn(|_| [rng.range(0.001, 0.003) as f32, rng.range(0.001, 0.003) as f32, 1.0]);
    Ray8::unbounded(o, d)
}

/// The hit is that of the lowest triangle, one unit ahead.
fn first(what: &str, triangle: u32, t: f32) -> Outcome {
    expect(triangle == 0 && (t - 1.0).abs() < 1e-6, format_args!("{what}: triangle {triangle} at {t}, expected 0 at 1"))
}

/// All lanes of a packet, or one alone.
const GROUPS: [(&str, u32, usize); 2] = [("one ray", 1, 1), ("eight rays", 255, 8)];

fn nodes(k: &mut Kernels) -> Outcome {
    // one child goes on, seven are beside the rays
    let beside = |i: u32| (reference(0), [[50.0 + i as f32, 50.0, 0.0], [50.5 + i as f32, 51.0, 9.0]]);
    let whole = [[-9.0, -9.0, 0.0], [9.0, 9.0, 8.0]];
    let chain = |i: usize| {
        let next = if i + 1 == CHAIN { reference(0) } else { i as u32 + 1 };
        let mut children = vec![(next, whole)];
        children.extend((0..7).map(beside));
        node(&children)
    };
    let tree: &'static (Vec<Node>, Vec<Leaf>) = leak(((0..CHAIN).map(chain).collect(), vec![leaf(0.0, 0)]));
    let accel = WideBvh::from_parts(&tree.0, &tree.1);
    let mut rng = SplitMix(10);
    let rays: Vec<Ray8> = (0..PACKETS / 8).map(|_| upwards(&mut rng)).collect();
    for r in &rays {
        let hit = accel.closest(r, Mask8::all_lanes());
        for i in 0..8 {
            first("a chain of nodes", hit.triangle.lane(i), hit.t.lane(i))?;
        }
    }
    for (name, lanes, n) in GROUPS {
        let rays = rays.clone();
        let mask = Mask8::from_bits(lanes);
        let tests = rays.len() * CHAIN * n;
        k.whole(("node", name), ("8 boxes", tests), move || {
            for r in std::hint::black_box(&rays) {
                std::hint::black_box(accel.closest(r, mask));
            }
        });
    }
    Ok(())
}

fn triangles(k: &mut Kernels) -> Outcome {
    let boxes: Vec<_> =
        (0..8).map(|i| (reference(i), [[-9.0, -9.0, 8.0 * i as f32], [9.0, 9.0, 8.0 * i as f32 + 7.0]])).collect();
    let tree: &'static (Vec<Node>, Vec<Leaf>) =
        leak((vec![node(&boxes)], (0..8).map(|i| leaf(8.0 * i as f32, 8 * i)).collect()));
    let accel = WideBvh::from_parts(&tree.0, &tree.1);
    let mut rng = SplitMix(11);
    // beside the triangles and through the boxes: no hit shortens the way
    let beside = |rng: &mut SplitMix| {
        let mut r = upwards(rng);
        r.o.x += F32x8::splat(6.0);
        r.o.y += F32x8::splat(4.0);
        r
    };
    let rays: Vec<Ray8> = (0..PACKETS / 8).map(|_| beside(&mut rng)).collect();
    for r in &rays {
        expect(accel.closest(r, Mask8::all_lanes()).hit.none(), "triangles: a hit beside all of them")?;
    }
    let met = accel.closest(&upwards(&mut rng), Mask8::all_lanes());
    for i in 0..8 {
        first("triangles", met.triangle.lane(i), met.t.lane(i))?;
    }
    for (name, lanes, n) in GROUPS {
        let rays = rays.clone();
        let mask = Mask8::from_bits(lanes);
        let tests = rays.len() * 8 * n;
        k.whole(("triangle", name), ("8 triangles", tests), move || {
            for r in std::hint::black_box(&rays) {
                std::hint::black_box(accel.closest(r, mask));
            }
        });
    }
    Ok(())
}

fn trees(k: &mut Kernels) -> Outcome {
    let mesh: &'static Mesh = leak(Mesh::new(star(32, [0.0; 3], 1.0, 3)));
    let accel = WideBvh::new(&mesh.scene());
    let mut rng = Rng(12);
    // from the middle outwards: side by side, or anywhere
    let side_by_side = |rng: &mut Rng| {
        let c = rng.cube();
        packet(&[(); 8].map(|()| Ray::new([0.0; 3], c.map(|x| x + 0.02 * rng.signed()))))
    };
    let anywhere = |rng: &mut Rng| packet(&[(); 8].map(|()| Ray::new(rng.cube().map(|x| 0.1 * x), rng.cube())));
    let kinds: [(&str, Vec<Ray8>); 2] = [
        ("coherent", (0..PACKETS).map(|_| side_by_side(&mut rng)).collect()),
        ("incoherent", (0..PACKETS).map(|_| anywhere(&mut rng)).collect()),
    ];
    for (name, rays) in kinds {
        // the oracle goes through all triangles
        for r in rays.iter().step_by(8) {
            answers(name, &mesh.triangles, &accel, r)?;
        }
        let all = Mask8::all_lanes();
        let hits = rays.iter().map(|r| accel.closest(r, all).hit.count() as usize);
        let lanes = mean_lanes(hits);
        k.packets(("tree closest", name), lanes, rays.clone(), move |r| accel.closest(r, all));
        k.packets(("tree occluded", name), lanes, rays, move |r| accel.occluded(r, all));
    }
    Ok(())
}

fn answers(name: &str, triangles: &[Tri], accel: &WideBvh<'_>, rays: &Ray8) -> Outcome {
    let hit = accel.closest(rays, Mask8::all_lanes());
    let occluded = accel.occluded(rays, Mask8::all_lanes());
    for i in 0..8 {
        let ray = Ray { o: rays.o.lane(i), d: rays.d.lane(i), tmin: 0.0, tmax: f32::INFINITY };
        let (mut nearest, mut unsure) = (f64::INFINITY, false);
        for t in triangles {
            match judge(&ray, t, 1e-6) {
                Verdict::Hit(t) => nearest = nearest.min(t),
                Verdict::Close(_) => unsure = true,
                Verdict::Miss => (),
            }
        }
        let got = f64::from(hit.t.lane(i));
        let right = unsure || (got - nearest).abs() <= 1e-4 * nearest;
        expect(right, format_args!("{name}: hit at {got}, expected {nearest}"))?;
        expect(occluded.lane(i) == hit.hit.lane(i), format_args!("{name}: occluded and closest disagree"))?;
    }
    Ok(())
}

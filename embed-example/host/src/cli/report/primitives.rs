//! Tests of triangles and boxes, and sums of the film, beside the alternatives that there are: errors against f64, what
//! is missed, and time. The core has one test of each kind, without a name outside of its traversal: it is measured in
//! trees that are nothing but leaves, or nothing but nodes in a chain.

use super::effort::Effort;
use super::kernels::{ARITHMETIC, Errors, Random};
use super::ledger::{Group, Kernel};
use super::timing::nanoseconds;
use super::twins::Twins;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::film::{FilmSum, PixelStats};
use croupier::unstable::geometry::Ray8;
use croupier::unstable::scene::blob::{LEAF_BIT, Leaf, NONE, Node};
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
use croupier::{Plan, Settings};
use croupier_host::blob::AlignedBytes;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::ray::Ray;
use obvhs::rt_triangle::RtTriangle;
use std::error::Error;

type Tri = [[f32; 3]; 3];

/// Half the spacing of f32 at 1, relative.
const U: f64 = 1.0 / 16_777_216.0;

/// Nodes of a chain, and leaves.
const CHAIN: usize = 64;

/// Rays that are timed.
const TIMED: usize = 16;

/// Additions to a pixel.
const ADDED: usize = 1 << 16;

/// A node whose first children are these, with their boxes.
fn node(children: &[(u32, [[f32; 3]; 2])]) -> Node {
    let mut node = Node { bounds: [[0.0; 8]; 6], child: [NONE; 8], reserved: [0; 8] };
    for i in 0..8 {
        // what is not there is a box that no ray meets
        let nowhere = (NONE, [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]);
        let (child, bounds) = children.get(i).copied().unwrap_or(nowhere);
        node.child[i] = child;
        for (row, x) in bounds.as_flattened().iter().enumerate() {
            node.bounds[row][i] = *x;
        }
    }
    node
}

/// Up to eight triangles.
fn leaf(triangles: &[Tri]) -> Leaf {
    let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
    for (i, triangle) in triangles.iter().enumerate() {
        leaf.triangle[i] = i as u32;
        for (row, x) in triangle.as_flattened().iter().enumerate() {
            leaf.p[row][i] = *x;
        }
    }
    leaf
}

/// Of a leaf of so many triangles.
fn reference(leaf: usize, triangles: usize) -> u32 {
    LEAF_BIT | (triangles as u32) << 27 | leaf as u32
}

/// A box around everything here.
const WHOLE: [[f32; 3]; 2] = [[-1e3; 3], [1e3; 3]];

/// One ray in lane 0.
fn one(o: [f32; 3], d: [f32; 3]) -> Ray8 {
    Ray8::unbounded(Vec3x8::splat(o[0], o[1], o[2]), Vec3x8::splat(d[0], d[1], d[2]))
}

fn library(o: [f32; 3], d: [f32; 3]) -> Ray {
    Ray::new_inf(Vec3A::from(o), Vec3A::from(d))
}

fn library_triangle(t: Tri) -> RtTriangle {
    let [a, b, c] = t.map(Vec3A::from);
    RtTriangle::new(a, b, c)
}

fn wide(a: [f32; 3]) -> [f64; 3] {
    a.map(f64::from)
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Distance of the plane of a triangle along a ray, and the cosine between the ray and its normal.
fn plane(t: &Tri, o: [f32; 3], d: [f32; 3]) -> (f64, f64) {
    let [a, b, c] = t.map(wide);
    let n = cross(sub(b, a), sub(c, a));
    let (o, d) = (wide(o), wide(d));
    let along = dot(d, n);
    (dot(sub(a, o), n) / along, along / (dot(n, n) * dot(d, d)).sqrt())
}

/// A point within the cube of half edge 1.
fn point(random: &mut Random) -> [f32; 3] {
    [(); 3].map(|()| 2.0 * random.number() - 1.0)
}

fn mix(points: &[[f32; 3]], weights: &[f32]) -> [f32; 3] {
    [0, 1, 2].map(|k| points.iter().zip(weights).map(|(p, w)| p[k] * w).sum())
}

/// Errors and misses of one variant.
#[derive(Default)]
struct Seen {
    errors: Errors,
    missed: u64,
    aimed: u64,
}

/// Rays at points of triangles: errors of the distance. Rays at the edge that two triangles share: those that pass
/// between. Of the core, and of Möller and Trumbore's test in the library.
fn triangles(rays: u64) -> [Seen; 2] {
    let mut random = Random(11);
    let mut seen = [Seen::default(), Seen::default()];
    for n in 0..rays {
        let [a, b, c, e, o] = [(); 5].map(|()| point(&mut random));
        let pair = [[a, b, c], [a, c, e]];
        let (u, v) = (random.number(), random.number());
        let at_edge = n % 2 == 0;
        let target = if at_edge {
            mix(&[a, c], &[1.0 - u, u])
        } else {
            // a little within, so that it is hit whatever is rounded
            let (u, v) = (0.01 + 0.97 * u * (1.0 - v), 0.01 + 0.97 * u * v);
            mix(&pair[0], &[1.0 - u - v, u, v])
        };
        let d = [0, 1, 2].map(|k| target[k] - o[k]);
        let (exact, cos) = plane(&pair[0], o, d);
        // along a surface an error of the ray's own numbers is large, whatever the test; neighbours that lie on one
        // side of the edge, seen from the ray, have a silhouette there
        let sides = pair.map(|t| plane(&t, o, d).1);
        if cos.abs() < 0.1 || at_edge && (sides[1].abs() < 0.1 || sides[0] * sides[1] < 0.0) {
            continue;
        }
        // at the edge both, else one alone, in the place of whose distance no other can stand
        let shown = if at_edge { &pair[..] } else { &pair[..1] };
        let (leaves, nodes) = ([leaf(shown)], [node(&[(reference(0, shown.len()), WHOLE)])]);
        let hit = WideBvh::from_parts(&nodes, &leaves).closest(&one(o, d), Mask8::from_bits(1));
        let ray = library(o, d);
        let nearest = shown.iter().map(|t| library_triangle(*t).intersect(&ray)).fold(f32::INFINITY, f32::min);
        let ours = if hit.hit.lane(0) { hit.t.lane(0) } else { f32::INFINITY };
        for (seen, t) in seen.iter_mut().zip([ours, nearest]) {
            if at_edge {
                seen.aimed += 1;
                seen.missed += u64::from(t.is_infinite());
            } else if t.is_finite() {
                seen.errors.see((f64::from(t) / exact - 1.0).abs() / (2.0 * U), &[t]);
            }
        }
    }
    seen
}

/// Distances in which the slabs of a box are all met: where they begin and where they end.
fn slabs([lo, hi]: [[f32; 3]; 2], o: [f32; 3], d: [f32; 3]) -> [f64; 2] {
    let (o, d) = (wide(o), wide(d));
    let mut ends = [0.0f64, f64::INFINITY];
    for k in 0..3 {
        let [a, b] = [lo, hi].map(|c| (f64::from(c[k]) - o[k]) / d[k]);
        ends = [ends[0].max(a.min(b)), ends[1].min(a.max(b))];
    }
    ends
}

/// Rays at edges of boxes. Missed are boxes that are met; the error is by how much a box is beside a ray that takes it
/// for met, over the distance.
fn boxes(rays: u64) -> [Seen; 2] {
    let mut random = Random(12);
    let mut seen = [Seen::default(), Seen::default()];
    // behind every box, and wide enough for every ray
    let back = leaf(&[[[-1e6, -1e6, 100.0], [1e6, -1e6, 100.0], [0.0, 1e6, 100.0]]]);
    for _ in 0..rays {
        let (a, b) = (point(&mut random), point(&mut random));
        let bounds = [[0, 1, 2].map(|k| a[k].min(b[k])), [0, 1, 2].map(|k| a[k].max(b[k]))];
        let o = {
            let p = point(&mut random);
            [p[0], p[1], p[2] - 3.0]
        };
        // on one of the edges
        let (axis, along) = ((random.number() * 3.0) as usize % 3, random.number());
        let corner = [(); 3].map(|()| usize::from(random.number() < 0.5));
        let target = [0, 1, 2].map(|k| match k == axis {
            true => bounds[0][k] + (bounds[1][k] - bounds[0][k]) * along,
            false => bounds[corner[k]][k],
        });
        let d = [0, 1, 2].map(|k| target[k] - o[k]);
        if d.iter().any(|x| x.abs() < 1e-3) || d[2] < 0.5 {
            continue;
        }
        let [begin, end] = slabs(bounds, o, d);
        let nodes = [node(&[(reference(0, 1), bounds)])];
        let hit = WideBvh::from_parts(&nodes, std::slice::from_ref(&back)).closest(&one(o, d), Mask8::from_bits(1));
        let [min, max] = bounds.map(Vec3A::from);
        let met = [hit.hit.lane(0), Aabb { min, max }.intersect_ray(&library(o, d)).is_finite()];
        for (seen, met) in seen.iter_mut().zip(met) {
            let inside = end >= begin;
            seen.aimed += u64::from(inside);
            seen.missed += u64::from(inside && !met);
            let beside = if met { (begin - end).max(0.0) / begin / (2.0 * U) } else { 0.0 };
            seen.errors.see(beside, &[]);
        }
    }
    seen
}

/// Rays along z that pass 64 boxes, or all boxes of 8 leaves beside their triangles.
fn timed(random: &mut Random, offset: f32) -> Vec<Ray8> {
    let mut ray = || {
        let small = |random: &mut Random| 0.001 + 0.002 * random.number();
        let o = Vec3x8::from_fn(|_| [offset + 0.2 * random.number(), offset + 0.2 * random.number(), -1.0]);
        let d = Vec3x8::from_fn(|_| [small(random), small(random), 1.0]);
        Ray8::unbounded(o, d)
    };
    (0..TIMED).map(|_| ray()).collect()
}

/// Nanoseconds of eight tests: of one ray, of eight rays together.
fn times(effort: &Effort, accel: &WideBvh<'_>, rays: &[Ray8], tests: usize) -> [super::ledger::Spread; 2] {
    [(1, 1), (255, 8)].map(|(bits, lanes)| {
        let mask = Mask8::from_bits(bits);
        nanoseconds(rays, effort.repeats, |r| accel.closest(&r, mask)).scaled(1.0 / (tests * lanes) as f64)
    })
}

fn row(function: &str, variant: &str, seen: Seen, ns: super::ledger::Spread) -> Kernel {
    let missed = (seen.aimed > 0).then_some([seen.missed, seen.aimed]);
    Kernel { missed, ..seen.errors.row(Group::Primitive, function, variant, false, ns) }
}

/// All of them.
pub(super) fn measure(effort: &Effort, twins: &Twins) -> Result<Vec<Kernel>, Box<dyn Error>> {
    let rays = (1u64 << 26) / effort.stride.clamp(8, 1 << 14) * 4;
    let mut random = Random(13);
    let mut rows = Vec::new();
    let ours = |lanes: &str| format!("croupier, {ARITHMETIC}, {lanes}");
    let copy = |s: &Seen| Seen { errors: s.errors.clone(), ..*s };
    let counted =
        |row: Kernel, group: &str, name: &str| Kernel { instructions: twins.instructions(group, name), ..row };

    let stacked = |n: usize| {
        let z = n as f32;
        [[-4.0, -4.0, z], [4.0, -4.0, z], [0.0, 6.0, z]]
    };
    let leaves: Vec<Leaf> = (0..8).map(|i| leaf(&std::array::from_fn::<_, 8, _>(|k| stacked(8 * i + k)))).collect();
    let at = |i: usize| (reference(i, 8), [[-9.0, -9.0, 8.0 * i as f32], [9.0, 9.0, 8.0 * i as f32 + 7.0]]);
    let nodes = [node(&std::array::from_fn::<_, 8, _>(at))];
    let [seen, fast] = triangles(rays);
    let beside = timed(&mut random, 5.0);
    let [single, packet] = times(effort, &WideBvh::from_parts(&nodes, &leaves), &beside, 8);
    rows.push(counted(row("triangle", &ours("1 ray"), copy(&seen), single), "triangle", "one ray"));
    rows.push(counted(row("triangle", &ours("8 rays"), seen, packet), "triangle", "eight rays"));
    let all: Vec<RtTriangle> = (0..64).map(|n| library_triangle(stacked(n))).collect();
    let scalar: Vec<Ray> = beside.iter().map(|r| library(r.o.lane(0), r.d.lane(0))).collect();
    let fastest = |r: Ray| all.iter().fold(f32::INFINITY, |t, tri| tri.intersect(&r).min(t));
    let ns = nanoseconds(&scalar, effort.repeats, fastest).scaled(1.0 / 8.0);
    rows.push(row("triangle", "obvhs, Möller-Trumbore", fast, ns));

    // one child goes on, seven are beside the rays
    let chain = |i: usize| {
        let next = if i + 1 == CHAIN { reference(0, 8) } else { i as u32 + 1 };
        let beside = |k: usize| (reference(0, 8), [[50.0 + k as f32, 50.0, 0.0], [50.5 + k as f32, 51.0, 9.0]]);
        node(&std::array::from_fn::<_, 8, _>(|k| {
            if k == 0 { (next, [[-9.0, -9.0, 0.0], [9.0, 9.0, 8.0]]) } else { beside(k) }
        }))
    };
    let nodes: Vec<Node> = (0..CHAIN).map(chain).collect();
    let [seen, plain] = boxes(rays / 2);
    let through = timed(&mut random, -0.1);
    let [single, packet] = times(effort, &WideBvh::from_parts(&nodes, &leaves), &through, CHAIN);
    rows.push(counted(row("box", &ours("1 ray"), copy(&seen), single), "node", "one ray"));
    rows.push(counted(row("box", &ours("8 rays"), seen, packet), "node", "eight rays"));
    let shapes: Vec<Aabb> = (0..64)
        .map(|k| Aabb { min: Vec3A::new(50.0 + k as f32, 50.0, 0.0), max: Vec3A::new(50.5 + k as f32, 51.0, 9.0) })
        .collect();
    let scalar: Vec<Ray> = through.iter().map(|r| library(r.o.lane(0), r.d.lane(0))).collect();
    let nearest = |r: Ray| shapes.iter().fold(f32::INFINITY, |t, b| b.intersect_ray(&r).min(t));
    let ns = nanoseconds(&scalar, effort.repeats, nearest).scaled(1.0 / 8.0);
    rows.push(row("box", "obvhs, slabs", plain, ns));
    rows.extend(sums(effort, twins)?);
    Ok(rows)
}

/// A pixel's mean after many additions of numbers that f64 holds exactly: of the film, of f32, and of f32 with Kahan's
/// compensation.
fn sums(effort: &Effort, twins: &Twins) -> Result<Vec<Kernel>, Box<dyn Error>> {
    let size = [16, 16];
    let plan = Plan::new(&Settings { size, max_depth: 1, ..Settings::default() })?;
    let mut block = AlignedBytes::zeroed(plan.film_sum().size);
    let mut film = FilmSum::new(&plan, block.as_mut())?;
    let mut random = Random(14);
    let sample = |x: f64| PixelStats { sum: [x; 3], weight: 1.0, weight_sqr: 1.0, samples: 1, ..PixelStats::default() };
    let (mut exact, mut plain) = (0u64, 0.0f32);
    let mut kahan = [0.0f32; 2];
    let step = |[sum, lost]: [f32; 2], x: f32| {
        let y = x - lost;
        let next = sum + y;
        [next, (next - sum) - y]
    };
    for _ in 0..ADDED {
        let x = random.number();
        // whole numbers of 2^-24
        exact += (x * 16_777_216.0) as u64;
        plain += x;
        kahan = step(kahan, x);
        film.add(|_| sample(f64::from(x)), |_, _| 0.0);
    }
    let exact = exact as f64 / 16_777_216.0;
    let found = film.finish(0.0).pixels().next().map_or(f64::NAN, |p| p.sum[0]);
    let seen = |sum: f64| {
        let mut seen = Seen::default();
        seen.errors.see((sum / exact - 1.0).abs() / (2.0 * U), &[]);
        seen
    };
    let iteration = nanoseconds(&[0.5f64; 4], effort.repeats, |x| film.add(|_| sample(x), |_, _| 0.0));
    let lanes: Vec<F32x8> = (0..256).map(|_| F32x8::from_fn(|_| random.number())).collect();
    let mut totals = vec![[F32x8::ZERO; 2]; lanes.len()];
    let simple = nanoseconds(&[(); 4], effort.repeats, |()| {
        totals.iter_mut().zip(&lanes).for_each(|(t, x)| t[0] += *x);
        std::hint::black_box(&mut totals);
    });
    let compensated = nanoseconds(&[(); 4], effort.repeats, |()| {
        for ([sum, lost], x) in totals.iter_mut().zip(&lanes) {
            let y = *x - *lost;
            let next = *sum + y;
            (*sum, *lost) = (next, (next - *sum) - y);
        }
        std::hint::black_box(&mut totals);
    });
    let whole =
        row("sum of a pixel", "croupier: f64, three channels, deviations", seen(found), iteration.scaled(1.0 / 32.0));
    Ok(vec![
        Kernel { instructions: twins.instructions("film", "add an iteration of 16 x 16"), ..whole },
        row("sum of a pixel", "f32, one channel", seen(f64::from(plain)), simple.scaled(1.0 / 256.0)),
        row(
            "sum of a pixel",
            "f32 and Kahan's remainder, one channel",
            seen(f64::from(kahan[0])),
            compensated.scaled(1.0 / 256.0),
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a watertight test that leaks, an oracle that misses as well, a film that sums in f32, boxes that are
    /// missed.
    #[test]
    fn nothing_of_ours_is_missed() {
        let [ours, fast] = triangles(40_000);
        assert!(ours.missed == 0 && ours.aimed > 2_000, "{} of {}", ours.missed, ours.aimed);
        assert!(
            fast.missed > 0,
            "rays that pass between triangles of the fast test: {} of {}",
            fast.missed,
            fast.aimed
        );
        assert!(ours.errors.max > 0.1 && ours.errors.mean() < 4.0, "{} {}", ours.errors.max, ours.errors.mean());
        let [ours, plain] = boxes(40_000);
        assert!(ours.missed == 0 && ours.aimed > 2_000, "{} of {}", ours.missed, ours.aimed);
        assert!(plain.missed > 0 && ours.errors.max > 0.0, "{} {}", plain.missed, ours.errors.max);
        let rows = measure(&Effort::TINY, &Twins::of_this_build()).unwrap();
        let error = |variant: &str| rows.iter().find(|r| r.variant.starts_with(variant)).map(|r| r.max_ulp).unwrap();
        assert!(error("croupier: f64") < 1e-6 && error("f32, one") > 10.0 && error("f32 and Kahan") < 2.0);
    }
}

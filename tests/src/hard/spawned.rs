//! Rays that start on surfaces: they must not hit what they leave, and shadow rays must not hit either end (NUMERICS
//! OFF-1, OFF-3).

use super::Found;
use crate::geometry::{Mesh, Rng, Tri};
use crate::hit::surface_point;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Ray8, offset, shadow_ray};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Packets from each triangle.
const ROUNDS: usize = 8;

/// Eight random barycentric weights (u, v).
pub fn weights(r: &mut Rng) -> (F32x8, F32x8) {
    let pairs: [(f32, f32); 8] = std::array::from_fn(|_| {
        let (s, t) = (r.unit().sqrt(), r.unit());
        (s * (1.0 - t), s * t)
    });
    (F32x8::from_fn(|i| pairs[i].0), F32x8::from_fn(|i| pairs[i].1))
}

/// A triangle of edges about `size` and `size / aspect` long, around a point within `offset` of the origin.
pub fn needle(r: &mut Rng, size: f32, aspect: f32, offset: f32) -> Tri {
    let (a, e, f, o) = (r.cube(), r.cube(), r.cube(), r.cube());
    let at = |x: [f32; 3]| [0, 1, 2].map(|k| offset * o[k] + size * x[k]);
    let b = [0, 1, 2].map(|k| a[k] + e[k]);
    [at(a), at(b), at([0, 1, 2].map(|k| b[k] + f[k] / aspect))]
}

/// A hard triangle of the kind `n`: of 11, five are needles of aspects 1 to 1e5 and sizes 1e-6 to 1e7, up to 1000 sizes
/// from the origin; five have coordinates of any magnitude from 1e-8 to 1e8; one is parallel to an axis, with one
/// coordinate near 0 and the others large.
fn hard_triangle(n: usize, r: &mut Rng) -> Tri {
    match n % 11 {
        0..5 => {
            let (size, aspect) = (r.log(-6.0, 7.0), [1.0, 10.0, 1e3, 1e5][n % 4]);
            let place = [0.0, size, 1e3 * size][n % 3];
            needle(r, size, aspect, place)
        }
        5..10 => [0, 1, 2].map(|_| [0, 1, 2].map(|_| r.log(-8.0, 8.0) * if r.unit() < 0.5 { -1.0 } else { 1.0 })),
        _ => {
            let (axis, height) = (n % 3, 1e-7 * r.signed());
            [0, 1, 2].map(|_| {
                let mut p = r.cube().map(|x| 1e3 * x);
                p[axis] = height;
                p
            })
        }
    }
}

/// Rays that leave `triangles` hard triangles, 64 each, one triangle in a scene at a time. A failure is a hit of that
/// triangle. The figure is the distance from the surface at which rays start, in 2^-24 of the triangle's largest
/// coordinate.
pub fn self_hits(seed: u64, triangles: usize) -> Found {
    let mut r = Rng(seed);
    let mut found = Found::default();
    for n in 0..triangles {
        let triangle = hard_triangle(n, &mut r);
        let mesh = Mesh::new(vec![triangle]);
        let (scene, all) = (mesh.scene(), Mask8::all_lanes());
        let bvh = WideBvh::new(&scene);
        let largest = triangle.as_flattened().iter().fold(0.0f32, |m, x| m.max(x.abs()));
        for _ in 0..ROUNDS {
            let (u, v) = weights(&mut r);
            let s = surface_point(&scene, U32x8::splat(0), u, v, all);
            let d = Vec3x8::from_fn(|_| r.cube());
            let o = offset(s.p, s.ng, s.error, d);
            let hit = bvh.closest(&Ray8::unbounded(o, d), all).hit;
            found.cases += 8;
            let moved = (o - s.p).length().to_array().into_iter().fold(0.0, f32::max);
            found.figure(f64::from(moved) / f64::from(largest) * 16_777_216.0);
            found.fail(u64::from(hit.count()), || {
                let i = hit.lanes().next().unwrap_or(0);
                format!("{triangle:?} at {:?} along {:?}", s.p.lane(i), d.lane(i))
            });
        }
    }
    found
}

/// Shadow rays between `pairs` x 8 points of two triangles that see each other, from 1e-5 to 1e5 sizes apart. A failure
/// is one that is occluded, or that is not when a third triangle is between them.
pub fn shadow_rays(seed: u64, pairs: usize) -> Found {
    let mut r = Rng(seed);
    let mut found = Found::default();
    for _ in 0..pairs {
        let (size, distance, place) = (r.log(-3.0, 3.0), r.log(-5.0, 5.0), [0.0, 10.0, 1000.0][r.below(3)]);
        let (c, tilt) = (r.cube(), r.cube());
        let base = |x: f32, y: f32, h: f32| [0, 1, 2].map(|k| size * (place * c[k] + [x, y, h][k]));
        let receiver = [base(-1.0, -1.0, 0.0), base(1.0, -1.0, 0.0), base(-1.0, 1.0, 0.0)];
        // above the receiver everywhere
        let h = |k: usize| distance * (1.0 + 0.3 * tilt[k]);
        let emitter = [base(-1.0, -1.0, h(0)), base(1.0, -1.0, h(1)), base(-1.0, 1.0, h(2))];
        // their separation must be more than the rounding of the coordinates
        if size * distance < 1e-4 * size * place.max(1.0) {
            continue;
        }
        let mesh = Mesh::new(vec![receiver, emitter]);
        let (scene, all) = (mesh.scene(), Mask8::all_lanes());
        let ((u, v), (s, t)) = (weights(&mut r), weights(&mut r));
        let p = surface_point(&scene, U32x8::splat(0), u, v, all);
        let q = surface_point(&scene, U32x8::splat(1), s, t, all);
        let ray = shadow_ray(p.p, p.ng, p.error, q.p, q.ng, q.error);
        let beyond = !ray.tmax.le(F32x8::ONE);
        let occluded = WideBvh::new(&scene).occluded(&ray, all);
        // a sheet half-way blocks all of them
        let sheet = [base(-9.0, -9.0, 0.0), base(30.0, -9.0, 0.0), base(-9.0, 30.0, 0.0)];
        let lift = |p: [f32; 3]| [p[0], p[1], p[2] + 0.35 * size * distance];
        let mesh = Mesh::new(vec![receiver, emitter, sheet.map(lift)]);
        let passed = !WideBvh::new(&mesh.scene()).occluded(&ray, all);
        let wrong = beyond | occluded | passed;
        found.cases += 8;
        found.fail(u64::from(wrong.count()), || {
            let i = wrong.lanes().next().unwrap_or(0);
            let (o, d) = (ray.o.lane(i), ray.d.lane(i));
            format!("{receiver:?}, {emitter:?}: {o:?} along {d:?}, occluded {}", occluded.lane(i))
        });
    }
    found
}

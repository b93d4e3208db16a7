//! Secondary rays: they neither hit the surface they left nor miss a close neighbour.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Ray8, offset, shadow_ray};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::geometry::{Mesh, Rng, Tri};
use croupier_tests::hit::surface_point;

/// Eight random barycentric weights (u, v).
fn weights(r: &mut Rng) -> (F32x8, F32x8) {
    let pairs: [(f32, f32); 8] = std::array::from_fn(|_| {
        let (s, t) = (r.unit().sqrt(), r.unit());
        (s * (1.0 - t), s * t)
    });
    (F32x8::from_fn(|i| pairs[i].0), F32x8::from_fn(|i| pairs[i].1))
}

fn directions(r: &mut Rng) -> Vec3x8 {
    Vec3x8::from_fn(|_| r.cube())
}

/// Hits of the own triangle among `rounds` x 8 rays spawned on the only triangle of a mesh.
fn self_hits(triangle: Tri, rounds: usize, r: &mut Rng) -> u32 {
    let mesh = Mesh::new(vec![triangle]);
    let (scene, all) = (mesh.scene(), Mask8::all_lanes());
    let bvh = WideBvh::new(&scene);
    let mut hits = 0;
    for _ in 0..rounds {
        let (u, v) = weights(r);
        let s = surface_point(&scene, U32x8::splat(0), u, v, all);
        let d = directions(r);
        let o = offset(s.p, s.ng, s.error, d);
        hits += bvh.closest(&Ray8::unbounded(o, d), all).hit.count();
    }
    hits
}

fn needle(r: &mut Rng, size: f32, aspect: f32, offset: f32) -> Tri {
    let (a, e, f, o) = (r.cube(), r.cube(), r.cube(), r.cube());
    let at = |x: [f32; 3]| [0, 1, 2].map(|k| offset * o[k] + size * x[k]);
    let b = [0, 1, 2].map(|k| a[k] + e[k]);
    [at(a), at(b), at([0, 1, 2].map(|k| b[k] + f[k] / aspect))]
}

// Killed by: offset 0, `o + t d` for the point, error without the factor 32, no check of the side for needles.
#[test]
fn rays_do_not_hit_the_triangle_they_leave() {
    let mut r = Rng(1);
    let (mut hits, mut rays) = (0, 0);
    for n in 0..3000 {
        let (size, aspect) = (r.log(-6.0, 7.0), [1.0, 10.0, 1e3, 1e5][n % 4]);
        let place = [0.0, size, 1e3 * size][n % 3];
        hits += self_hits(needle(&mut r, size, aspect, place), 8, &mut r);
        rays += 64;
    }
    // coordinates of any magnitude
    for _ in 0..3000 {
        let t = [0, 1, 2].map(|_| [0, 1, 2].map(|_| r.log(-8.0, 8.0) * if r.unit() < 0.5 { -1.0 } else { 1.0 }));
        hits += self_hits(t, 8, &mut r);
        rays += 64;
    }
    // axis-parallel, one coordinate near 0 and the others large
    for n in 0..600 {
        let (axis, height) = (n % 3, 1e-7 * r.signed());
        let t = [0, 1, 2].map(|_| {
            let mut p = r.cube().map(|x| 1e3 * x);
            p[axis] = height;
            p
        });
        hits += self_hits(t, 8, &mut r);
        rays += 64;
    }
    assert_eq!(hits, 0, "of {rays} rays");
}

// A gap of 256 2^-24 |p| between parallel planes is seen from both sides. Killed by: an error bound 16 times as large.
#[test]
fn offsets_do_not_jump_narrow_gaps() {
    let mut r = Rng(2);
    for n in 0..600 {
        let (axis, height) = (n % 3, r.log(-5.0, 6.0));
        let gap = height * (256.0 / 16_777_216.0);
        let plane = |h: f32| {
            [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|q| {
                let mut p = [h; 3];
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (height * q[0], height * q[1]);
                p
            })
        };
        let mesh = Mesh::new(vec![plane(height), plane(height + gap)]);
        let (scene, all) = (mesh.scene(), Mask8::all_lanes());
        let from = U32x8::new([0, 1, 0, 1, 0, 1, 0, 1]);
        let (u, v) = weights(&mut r);
        let s = surface_point(&scene, from, u, v, all);
        // into the gap, at most 60 degrees from the normal, which points along the axis
        let d = Vec3x8::from_fn(|i| {
            let mut d = r.cube();
            d[axis] = if i % 2 == 0 { 1.0 } else { -1.0 };
            d
        });
        let ray = Ray8::unbounded(offset(s.p, s.ng, s.error, d), d);
        let h = WideBvh::new(&scene).closest(&ray, all);
        // near the edge a ray may leave the gap sideways: the planes are far larger than it is wide
        for i in 0..8 {
            let margin = u.lane(i).min(v.lane(i)).min(1.0 - u.lane(i) - v.lane(i));
            if margin > 1e-3 {
                assert_eq!(h.triangle.lane(i), 1 - from.lane(i), "lane {i}, height {height}");
            }
        }
    }
}

// Points of two triangles that see each other, from touching to 1e5 sizes apart. Killed by: tmax above 1, only one end
// moved, the direction from the points before they moved.
#[test]
fn shadow_rays_see_what_is_not_occluded() {
    let mut r = Rng(3);
    let (mut wrong, mut blocked, mut rays) = (0, 0, 0);
    for _ in 0..4000 {
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
        assert_eq!(ray.tmax.lt(F32x8::ONE) | ray.tmax.eq(F32x8::ONE), all);
        wrong += WideBvh::new(&scene).occluded(&ray, all).count();
        rays += 8;
        // a sheet half-way blocks all of them
        let sheet = [base(-9.0, -9.0, 0.0), base(30.0, -9.0, 0.0), base(-9.0, 30.0, 0.0)];
        let lift = |p: [f32; 3]| [p[0], p[1], p[2] + 0.35 * size * distance];
        let mesh = Mesh::new(vec![receiver, emitter, sheet.map(lift)]);
        blocked += WideBvh::new(&mesh.scene()).occluded(&ray, all).count();
    }
    assert_eq!(wrong, 0, "of {rays} rays");
    assert_eq!(blocked, rays);
}

// Killed by: normalising without scaling (edges of 1e-12), a division by a length of 0.
#[test]
fn degenerate_surface_points_are_finite() {
    let far = f32::MAX / 8.0;
    let triangles: Vec<Tri> = vec![
        [[0.0; 3]; 3],
        [[1.0; 3], [1.0; 3], [2.0, 3.0, 4.0]],
        [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        [[0.0; 3], [1e-12, 0.0, 0.0], [0.0, 1e-12, 0.0]],
        [[0.0; 3], [1e-30, 0.0, 0.0], [0.0, 1e-30, 0.0]],
        [[far; 3], [-far, far, 0.0], [0.0, -far, far]],
    ];
    let mesh = Mesh::new(triangles);
    let scene = mesh.scene();
    let (u, v) = weights(&mut Rng(4));
    let s = surface_point(&scene, U32x8::new([0, 1, 2, 3, 4, 5, 6, u32::MAX]), u, v, Mask8::all_lanes());
    let unit = (s.ng.length() - F32x8::ONE).abs().le(F32x8::splat(1e-6));
    assert!((s.p.is_finite() & s.ng.is_finite() & s.error.is_finite() & unit).all());
    assert_eq!(s.ng.lane(3), [0.0, 0.0, 1.0]);
    // dead lanes may hold anything
    let (nan, none) = (F32x8::splat(f32::NAN), U32x8::splat(u32::MAX));
    let s = surface_point(&scene, none, nan, nan, Mask8::NONE);
    assert!((s.p.is_finite() & s.ng.is_finite() & s.error.is_finite()).all());
}

//! Closest and any hit against an f64 oracle, aimed rays, and every way a ray can be odd.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Hit8, Ray8};
use croupier::unstable::scene::blob::NONE;
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
use croupier_host::bvh::{Effort, build};
use croupier_tests::geometry::{Mesh, Ray, Rng, Tri, Verdict, judge, packet, soup, star, sub};
use croupier_tests::hard::{aimed, boxes};

// Killed by: a fused edge function (`p0 * q1 - p1 * q0` rounded once), axes that differ between triangles of a ray.
#[test]
fn no_ray_leaks_through_edges_and_vertices() {
    for (place, seed) in aimed::PLACEMENTS.into_iter().zip(99..) {
        let (offset, scale) = place;
        let mesh = Mesh::new(star(16, offset, scale, 7));
        // 200 000 of them aimed
        aimed::leaks(&mesh, place, seed, 37_500).assert_none(&format!("leaks at {offset:?}, scale {scale}"));
    }
}

/// Boxes far away and near, flat ones, rays in their faces: 400 000 rays. Killed by: no padding of the origins, one that
/// does not grow with them; near and far planes exchanged.
#[test]
fn no_box_that_is_met_is_missed() {
    let found = boxes::missed(1, 75_000);
    found.assert_none("boxes missed");
    // rounding takes a half of the padding at most
    assert!((0.5..1.5).contains(&found.worst), "{}", found.worst);
}

/// Distance of the point with weights `u` and `v` from the one at the parameter `t`, over the longest edge.
fn off_the_ray(ray: &Ray, triangle: &Tri, t: f64, [u, v]: [f32; 2]) -> f64 {
    let [a, b, c] = triangle.map(|p| p.map(f64::from));
    let length = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let edge = |p: [f64; 3], q: [f64; 3]| length([0, 1, 2].map(|k| p[k] - q[k]));
    let (u, v) = (f64::from(u), f64::from(v));
    let by_weights = [0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
    let by_ray = [0, 1, 2].map(|k| f64::from(ray.o[k]) + t * f64::from(ray.d[k]));
    edge(by_weights, by_ray) / edge(a, b).max(edge(b, c)).max(edge(c, a))
}

/// Compares both queries with the oracle over all triangles; returns how many hits were clear.
fn agree(mesh: &Mesh, rays: &[Ray], slack: f64) -> usize {
    let bvh = WideBvh::new(&mesh.scene());
    let mut clear = 0;
    for chunk in rays.chunks(8) {
        let active = Mask8::first(chunk.len());
        let rays8 = packet(chunk);
        let (hit, any) = (bvh.closest(&rays8, active), bvh.occluded(&rays8, active));
        assert_eq!(hit.hit, any);
        for (i, r) in chunk.iter().enumerate() {
            let verdicts: Vec<Verdict> = mesh.triangles.iter().map(|t| judge(r, t, slack)).collect();
            let sure = verdicts.iter().filter_map(|v| if let Verdict::Hit(t) = v { Some(*t) } else { None });
            let nearest = sure.fold(f64::INFINITY, f64::min);
            if hit.hit.lane(i) {
                let id = hit.triangle.lane(i) as usize;
                let t = f64::from(hit.t.lane(i));
                assert!(hit.t.lane(i) > r.tmin && hit.t.lane(i) < r.tmax, "{r:?}: t {t} outside its interval");
                match verdicts[id] {
                    Verdict::Miss => panic!("{r:?} reports a hit of triangle {id} that it misses"),
                    Verdict::Hit(exact) => {
                        clear += 1;
                        assert!((t - exact).abs() <= 1e-3 * exact.abs(), "{r:?}: t {t}, exactly {exact}");
                        assert!(t <= nearest * (1.0 + 1e-3), "{r:?}: t {t}, but {nearest} is closer");
                        let off = off_the_ray(r, &mesh.triangles[id], exact, [hit.u.lane(i), hit.v.lane(i)]);
                        assert!(off <= 0.01, "{r:?}: the point by the weights is {off} edges from the ray");
                    }
                    Verdict::Close(_) => assert!(t <= nearest * (1.0 + 1e-2), "{r:?}: t {t}, but {nearest} is closer"),
                }
                let (u, v) = (hit.u.lane(i), hit.v.lane(i));
                assert!((0.0..=1.000_01).contains(&u) && (0.0..=1.000_01).contains(&v) && u + v <= 1.000_01);
            } else {
                assert!(nearest.is_infinite(), "{r:?} misses a hit at {nearest}");
                assert_eq!(hit.triangle.lane(i), NONE);
                assert_eq!(hit.t.lane(i), r.tmax);
            }
        }
    }
    clear
}

// Killed by: swapped u and v, a wrong sign in the shear, near and far planes swapped, a stack that forgets entries.
#[test]
fn agrees_with_brute_force() {
    let mut r = Rng(1);
    let random = |n: usize, around: [f32; 3], size: f32, r: &mut Rng| -> Vec<Ray> {
        let at = |c: [f32; 3]| [0, 1, 2].map(|k| around[k] + size * c[k]);
        (0..n).map(|_| Ray::new(at(r.cube()), r.cube())).collect()
    };
    for (around, size) in [([0.0; 3], 1.0), ([1e6, -1e6, 1e6], 100.0), ([0.0; 3], 1e-4), ([0.0; 3], 1e6)] {
        let mesh = Mesh::new(soup(300, around, size, 0.3, &mut r));
        let rays = random(4000, around, size, &mut r);
        assert!(agree(&mesh, &rays, 1e-5) > 1500, "too few clear hits at {around:?}");
        // coherent packets, limited intervals
        let rays: Vec<Ray> = rays
            .iter()
            .flat_map(|ray| {
                let (d, limits) = (ray.d, [r.unit(), 3.0 * r.unit()]);
                let near = std::array::from_fn::<Ray, 8, _>(|_| {
                    let e = r.cube();
                    let d = [0, 1, 2].map(|k| d[k] + 0.02 * e[k]);
                    Ray { o: ray.o, d, tmin: size * limits[0], tmax: size * (limits[0] + limits[1]) }
                });
                near.into_iter().take(8)
            })
            .take(4000)
            .collect();
        assert!(agree(&mesh, &rays, 1e-5) > 800, "too few clear hits at {around:?}");
    }
}

// Killed by: dropping the comparison with `limit`, one edge function forgotten.
#[test]
fn needles_and_degenerate_triangles_do_no_harm() {
    let mut r = Rng(2);
    let mut triangles = soup(60, [0.0; 3], 1.0, 0.3, &mut r);
    for i in 0..240 {
        let (a, b, e) = (r.cube(), r.cube(), r.cube());
        let thin = 10f32.powi(-(i % 7));
        triangles.push(match i % 5 {
            0 => [a, a, a],
            1 => [a, b, a],
            2 => [a, b, [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]))],
            // 1e6 : 1
            _ => [a, b, [0, 1, 2].map(|k| b[k] + thin * e[k])],
        });
    }
    let aims: Vec<[f32; 3]> = triangles.iter().map(|t| t[r.below(3)]).collect();
    let mesh = Mesh::new(triangles);
    let mut rays: Vec<Ray> = (0..3000).map(|_| Ray::new(r.cube(), r.cube())).collect();
    rays.extend(aims.iter().cycle().take(3000).map(|p| {
        let o = r.cube();
        Ray::new(o, sub(*p, o))
    }));
    assert!(agree(&mesh, &rays, 1e-5) > 1000);
}

/// An 8 x 8 floor of unit squares in the plane `axis` = 0.
fn tiles(axis: usize) -> Vec<Tri> {
    let p = |i: usize, j: usize| {
        let mut p = [0.0; 3];
        (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (i as f32, j as f32);
        p
    };
    let square = |i, j| [[p(i, j), p(i + 1, j), p(i + 1, j + 1)], [p(i, j), p(i + 1, j + 1), p(i, j + 1)]];
    (0..64).flat_map(|n| square(n % 8, n / 8)).collect()
}

// Rays along faces and edges of flat boxes, exhaustively: every sign and zero of the direction, origins on and between
// the lattice. All quantities are exact. Killed by: no padding of the origins (rays in the outer faces miss).
#[test]
fn axis_parallel_rays_in_faces_of_boxes_hit() {
    let mut checked = 0;
    for axis in 0..3 {
        let mesh = Mesh::new(tiles(axis));
        let bvh = WideBvh::new(&mesh.scene());
        let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
        let components = [-1.0, -0.0, 0.0, 1.0f32];
        let mut rays = Vec::new();
        for n in 0..64 {
            let c = [components[n % 4], components[n / 4 % 4], components[n / 16]];
            if c[axis] == 0.0 {
                continue;
            }
            for i in -2..=18 {
                for j in -2..=18 {
                    let mut o = [0.0; 3];
                    (o[x], o[y], o[axis]) = (0.5 * i as f32, 0.5 * j as f32, -2.0 * c[axis]);
                    rays.push(Ray::new(o, c));
                }
            }
        }
        for chunk in rays.chunks(8) {
            let hit = bvh.closest(&packet(chunk), Mask8::first(chunk.len()));
            for (i, r) in chunk.iter().enumerate() {
                let p = |k: usize| r.o[k] + 2.0 * r.d[k];
                let inside = (0.0..=8.0).contains(&p(x)) && (0.0..=8.0).contains(&p(y));
                assert_eq!(hit.hit.lane(i), inside, "{r:?}");
                assert!(!inside || hit.t.lane(i) == 2.0, "{r:?}: t {}", hit.t.lane(i));
                checked += 1;
            }
        }
    }
    assert_eq!(checked, 3 * 32 * 21 * 21);
}

fn bits(h: &Hit8, i: usize) -> [u32; 5] {
    let f = |x: F32x8| x.lane(i).to_bits();
    [u32::from(h.hit.lane(i)), f(h.t), h.triangle.lane(i), f(h.u), f(h.v)]
}

// A lane alone, with garbage beside it, in a packet: the same bits. Killed by: a packet test that is not monotone, a
// different order of roundings alone and in packets, t not bounded by the entry of its leaf.
#[test]
fn lanes_do_not_see_each_other() {
    let mut r = Rng(3);
    let mut triangles = star(24, [0.0; 3], 1.0, 5);
    triangles.extend(soup(500, [0.0; 3], 3.0, 0.4, &mut r));
    // needles, whose t is so uncertain that it may come before their box
    triangles.extend(
        soup(2000, [0.0; 3], 1.0, 2.0, &mut r)
            .into_iter()
            .map(|[a, b, c]| [a, b, [0, 1, 2].map(|k| b[k] + 1e-6 * (c[k] - b[k]))]),
    );
    let mesh = Mesh::new(triangles);
    let bvh = WideBvh::new(&mesh.scene());
    let garbage = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 3e38, -3e38, 1e-40];
    let mut packed = 0;
    for n in 0..1500 {
        let (o, d, spread) = (r.cube(), r.cube(), [0.0, 0.01, 0.1, 2.0][n % 4]);
        let rays: [Ray; 8] = std::array::from_fn(|_| {
            let (e, f) = (r.cube(), r.cube());
            let at = |p: [f32; 3], e: [f32; 3]| [0, 1, 2].map(|k| p[k] + spread * e[k]);
            Ray { o: at(o, e), d: at(d, f), tmin: 0.1 * r.unit(), tmax: 10.0 * r.unit() }
        });
        let whole = packet(&rays);
        let hits = bvh.closest(&whole, Mask8::all_lanes());
        let any = bvh.occluded(&whole, Mask8::all_lanes());
        packed += hits.hit.count();
        for mask in [1 << (n % 8), r.bits() & 0xff, r.bits() & 0xff] {
            let active = Mask8::from_bits(mask);
            let junk = |r: &mut Rng| F32x8::from_fn(|_| garbage[r.below(8)]);
            let fill = |v: Vec3x8, r: &mut Rng| Vec3x8::select(active, v, Vec3x8::new(junk(r), junk(r), junk(r)));
            let mixed = Ray8 {
                o: fill(whole.o, &mut r),
                d: fill(whole.d, &mut r),
                tmin: active.select(whole.tmin, junk(&mut r)),
                tmax: active.select(whole.tmax, junk(&mut r)),
                time: junk(&mut r),
            };
            // inactive lanes hold garbage; then garbage lanes are active as well
            for active in [active, Mask8::all_lanes()] {
                let (h, a) = (bvh.closest(&mixed, active), bvh.occluded(&mixed, active));
                for i in Mask8::from_bits(mask).lanes() {
                    assert_eq!(bits(&h, i), bits(&hits, i), "lane {i} of mask {mask:08b}");
                    assert_eq!(a.lane(i), any.lane(i));
                }
            }
            let (h, a) = (bvh.closest(&mixed, active), bvh.occluded(&mixed, active));
            assert_eq!((h.hit & !active, a & !active), (Mask8::NONE, Mask8::NONE));
        }
    }
    assert!(packed > 3000, "{packed}");
}

// Killed by: comparisons that a NaN passes, a threshold for slow components that ignores the ray's length.
#[test]
fn invalid_rays_hit_nothing() {
    let mesh = Mesh::new(star(16, [0.0; 3], 1.0, 7));
    let bvh = WideBvh::new(&mesh.scene());
    let special = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let mut rays = vec![Ray::new([0.0; 3], [0.0; 3]), Ray::new([0.1; 3], [-0.0, 0.0, -0.0])];
    for (k, x) in (0..3).flat_map(|k| special.map(|x| (k, x))) {
        let (mut o, mut d) = ([0.0; 3], [1.0, 0.5, 0.25]);
        o[k] = x;
        rays.push(Ray::new(o, d));
        d[k] = x;
        rays.push(Ray::new([0.0; 3], d));
    }
    let limits =
        [(1.0, 1.0), (2.0, 1.0), (f32::NAN, f32::NAN), (0.0, f32::NAN), (f32::INFINITY, f32::INFINITY), (0.0, 0.0)];
    rays.extend(limits.map(|(tmin, tmax)| Ray { o: [0.0; 3], d: [0.0, 0.0, 1.0], tmin, tmax }));
    for chunk in rays.chunks(8) {
        let rays8 = packet(chunk);
        assert!(bvh.closest(&rays8, Mask8::first(chunk.len())).hit.none());
        assert!(bvh.occluded(&rays8, Mask8::first(chunk.len())).none());
    }
    // extreme but valid directions still hit
    let rays = [1e-30, 1e-15, 1.0, 1e15, 1e30f32].map(|s| {
        let d = [s, -0.5 * s, 0.25 * s];
        Ray { o: [0.0; 3], d, tmin: 0.1 / s, tmax: 10.0 / s }
    });
    assert_eq!(bvh.closest(&packet(&rays), Mask8::first(5)).hit.count(), 5);
    // and are not disturbed by others beside them, whichever lane those have
    let near = |i: usize| Ray::new([0.01 * i as f32, 0.0, 0.0], [1.0, 0.5, 0.25 + 0.01 * i as f32]);
    for (lane, axis, x) in (0..8).flat_map(|lane| special.map(|x| (lane, 1 + lane % 2, x))) {
        for of_origin in [false, true] {
            let mut rays = [0, 1, 2, 3, 4, 5, 6, 7].map(near);
            let changed = if of_origin { &mut rays[lane].o } else { &mut rays[lane].d };
            changed[axis] = x;
            let hit = bvh.closest(&packet(&rays), Mask8::all_lanes());
            let alone = rays.map(|r| bvh.closest(&packet(&[r]), Mask8::first(1)));
            assert_eq!(hit.hit.bits(), 255 ^ 1 << lane, "{x} in axis {axis} of lane {lane}");
            assert!((0..8).all(|i| hit.triangle.lane(i) == alone[i].triangle.lane(0)));
        }
    }
    let empty = WideBvh::from_parts(&[], &[]);
    assert!(empty.closest(&packet(&rays), Mask8::all_lanes()).hit.none());
    assert!(empty.occluded(&packet(&rays), Mask8::all_lanes()).none());
}

// Each of N parallel quads is found exactly once when every ray starts again behind its last hit, and none beyond tmax.
// Killed by: `>=` for `>` at tmin or tmax.
#[test]
fn restarting_behind_each_hit_enumerates_all() {
    let mut r = Rng(4);
    for stack in 0..300 {
        let (a, b, n) = (r.cube(), r.cube(), 12);
        let steps: Vec<f32> = (0..n).map(|i| i as f32 + 0.7 * r.unit()).collect();
        let corner = |h: f32, s: f32, t: f32| [0, 1, 2].map(|k| [s, t, h][k] + h * 0.2 * a[k] + 0.1 * b[k]);
        let triangles = steps.iter().flat_map(|&h| {
            let [p, q, s, t] = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(s, t)| corner(h, s, t));
            [[p, q, s], [p, s, t]]
        });
        let mesh = Mesh::new(triangles.collect());
        let bvh = WideBvh::new(&mesh.scene());
        // off the diagonals
        let mut rays: [Ray; 8] = std::array::from_fn(|_| {
            let e = r.cube();
            Ray::new([2.0 + 0.3 * e[0], -2.0 + 0.3 * e[1], -1.0 - r.unit()], [0.1 * e[1], 0.1 * e[2], 0.3 + r.unit()])
        });
        let mut seen = [[false; 12]; 8];
        for round in 0..=n {
            let h = bvh.closest(&packet(&rays), Mask8::all_lanes());
            assert_eq!(h.hit == Mask8::all_lanes(), round < n, "stack {stack}, round {round}");
            for i in h.hit.lanes() {
                let quad = h.triangle.lane(i) as usize / 2;
                assert!(!seen[i][quad], "stack {stack}: quad {quad} twice");
                seen[i][quad] = true;
                rays[i].tmin = h.t.lane(i);
                let mut until = rays;
                (until[i].tmin, until[i].tmax) = (0.0, h.t.lane(i));
                let before = bvh.closest(&packet(&until), Mask8::from_bits(1 << i));
                assert_eq!(before.hit.any(), round > 0, "tmax is exclusive");
            }
        }
        assert!(seen.iter().flatten().all(|s| *s));
    }
}

// The result is a function of the triangles: of two equal ones the lower index, whatever the tree. Killed by: `<=` for
// `<` in the comparison of t.
#[test]
fn ties_go_to_the_lower_index_in_every_tree() {
    let mut r = Rng(6);
    let base = soup(400, [0.0; 3], 1.0, 0.5, &mut r);
    let mut twice = base.clone();
    twice.extend(base.iter().rev());
    let trees = [Effort::Fast, Effort::Medium, Effort::Slow].map(|e| build(&twice, e));
    let single = build(&base, Effort::Medium);
    for n in 0..4000 {
        let (o, d, spread) = (r.cube(), r.cube(), [0.02, 1.0][n % 2]);
        let rays: [Ray; 8] = std::array::from_fn(|_| {
            let e = r.cube();
            Ray::new(o, [0, 1, 2].map(|k| d[k] + spread * e[k]))
        });
        let rays8 = packet(&rays);
        let expected = WideBvh::from_parts(&single.nodes, &single.leaves).closest(&rays8, Mask8::all_lanes());
        for t in &trees {
            let h = WideBvh::from_parts(&t.nodes, &t.leaves).closest(&rays8, Mask8::all_lanes());
            for i in 0..8 {
                assert_eq!(bits(&h, i), bits(&expected, i));
            }
        }
    }
}

// The same bits for every instruction set. Killed by: any fused or estimated operation, another order of roundings.
#[test]
fn hits_have_the_same_bits_on_every_target() {
    let mut r = Rng(8);
    let mesh = Mesh::new(soup(1000, [0.0; 3], 1.0, 0.2, &mut r));
    let bvh = WideBvh::new(&mesh.scene());
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    for n in 0..1000 {
        let (o, d, spread) = (r.cube(), r.cube(), [0.05, 1.0][n % 2]);
        let rays: [Ray; 8] = std::array::from_fn(|_| {
            let e = r.cube();
            Ray::new(o, [0, 1, 2].map(|k| d[k] + spread * e[k]))
        });
        let h = bvh.closest(&packet(&rays), Mask8::all_lanes());
        for x in (0..8).flat_map(|i| bits(&h, i)) {
            hash = (hash ^ u64::from(x)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    assert!(!croupier::unstable::simd::REPRODUCIBLE || hash == 0xaaee_4c40_f3be_465a, "{hash:016x}");
}

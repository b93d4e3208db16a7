//! Closest and any hit against an f64 oracle, aimed rays, and every way a ray can be odd.

use croupier::accel::{Intersector, WideBvh};
use croupier::scene::blob::NONE;
use croupier::simd::Mask8;
use croupier_tests::geometry::{Mesh, Ray, Rng, Tri, Verdict, judge, packet, star, sub};

// Killed by: fused edge functions, Moeller-Trumbore, no padding of the slabs on flat boxes.
#[test]
fn no_ray_leaks_through_edges_and_vertices() {
    let placements: [([f32; 3], f32); 5] = [
        ([0.0; 3], 1.0),
        ([0.0; 3], 1e-6),
        ([0.0; 3], 1e6),
        ([148_376.0, 1234.0, -223_423.0], 1.0),
        ([1e7, 1e7, -1e7], 1000.0),
    ];
    let mut leaks = 0;
    for (place, (offset, scale)) in placements.into_iter().enumerate() {
        let mesh = Mesh::new(star(16, offset, scale, 7));
        let bvh = WideBvh::new(&mesh.scene());
        let mut r = Rng(99 + place as u64);
        // 200 000 rays: a third random, a third at edges, a third at vertices; origins shared or not, so that packets
        // of all sizes and single rays occur
        let mut spread = 0.0;
        let (mut origin, mut target) = ([0.0; 3], 0);
        for n in 0..25_000 {
            if n % 8 == 0 {
                origin = r.cube().map(|x| 0.3 * x);
                target = r.below(mesh.triangles.len());
                spread = [0.0, 0.01, 0.3][r.below(3)];
            }
            let rays: [Ray; 8] = std::array::from_fn(|i| {
                let c = r.cube();
                let o = [0, 1, 2].map(|k| offset[k] + scale * (origin[k] + spread * c[k]));
                let d = match (n + i) % 3 {
                    0 => r.cube(),
                    kind => {
                        let j = if spread > 0.1 { r.below(mesh.triangles.len()) } else { target };
                        let (t, e) = (mesh.triangles[j], r.below(3));
                        let s = if kind == 1 { r.unit() } else { 0.0 };
                        let p: [f32; 3] = [0, 1, 2].map(|k| t[e][k] + s * (t[(e + 1) % 3][k] - t[e][k]));
                        sub(p, o)
                    }
                };
                Ray::new(o, d)
            });
            let rays8 = packet(&rays);
            let hit = bvh.closest(&rays8, Mask8::all_lanes());
            leaks += 8 - hit.hit.count() as usize;
            assert_eq!(bvh.occluded(&rays8, Mask8::all_lanes()), hit.hit);
        }
    }
    assert_eq!(leaks, 0, "of 1 000 000 rays");
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

#[test]
fn quick() {
    let mut r = Rng(1);
    let soup: Vec<Tri> = (0..300)
        .map(|_| {
            let c = r.cube();
            [0, 1, 2].map(|_| {
                let e = r.cube();
                [0, 1, 2].map(|k| c[k] + 0.3 * e[k])
            })
        })
        .collect();
    let mesh = Mesh::new(soup);
    let rays: Vec<Ray> = (0..4000).map(|_| Ray::new(r.cube(), r.cube())).collect();
    let clear = agree(&mesh, &rays, 1e-5);
    assert!(clear > 2000, "{clear}");
}

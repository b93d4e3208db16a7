//! Secondary rays: they neither hit the surface they left nor miss a close neighbour.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Ray8, offset};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::geometry::{Mesh, Rng, Tri};
use croupier_tests::hard::spawned::{self_hits, shadow_rays, weights};
use croupier_tests::hit::surface_point;

// Killed by: offset 0, `o + t d` for the point, error without the factor 32, no check of the side for needles.
#[test]
fn rays_do_not_hit_the_triangle_they_leave() {
    let found = self_hits(1, 6600);
    found.assert_none("self-hits");
    assert_eq!(found.cases, 422_400);
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
    let found = shadow_rays(3, 4000);
    found.assert_none("shadow rays");
    assert!(found.cases > 20_000);
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

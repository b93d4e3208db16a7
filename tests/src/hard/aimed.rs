//! Rays from within closed meshes, aimed at edges and vertices: each has to hit (NUMERICS TRI-1, BOX-1, BOX-2).

use super::Found;
use crate::geometry::{Mesh, Ray, Rng, packet, sub};
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::simd::Mask8;

/// Where a mesh lies, and its size.
pub type Placement = ([f32; 3], f32);

/// At the origin, tiny and huge, at coordinates of a map, 1e4 sizes away.
pub const PLACEMENTS: [Placement; 5] = [
    ([0.0; 3], 1.0),
    ([0.0; 3], 1e-6),
    ([0.0; 3], 1e6),
    ([148_376.0, 1234.0, -223_423.0], 1.0),
    ([1e7, 1e7, -1e7], 1000.0),
];

/// Traces `packets` x 8 rays in a [`star`](crate::geometry::star) of at least 16 x 16 vertices at `place`, a third of
/// them at edges, a third at vertices, a third anywhere; origins are shared or not, so that packets of all sizes and
/// single rays occur. A failure is a ray that hits nothing, or for which the query of any hit says otherwise than that
/// of the closest.
pub fn leaks(mesh: &Mesh, (offset, scale): Placement, seed: u64, packets: usize) -> Found {
    let bvh = WideBvh::new(&mesh.scene());
    let mut r = Rng(seed);
    let mut found = Found { cases: 8 * packets as u64, ..Found::default() };
    let mut spread = 0.0;
    let (mut origin, mut target) = ([0.0; 3], 0);
    for n in 0..packets {
        if n % 8 == 0 {
            // together at most 0.87 from the middle: no triangle comes as near as that
            origin = r.cube().map(|x| 0.25 * x);
            target = r.below(mesh.triangles.len());
            spread = [0.0, 0.01, 0.25][r.below(3)];
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
        let hit = bvh.closest(&rays8, Mask8::all_lanes()).hit;
        let wrong = !hit | !bvh.occluded(&rays8, Mask8::all_lanes());
        found.fail(u64::from(wrong.count()), || {
            let i = wrong.lanes().next().unwrap_or(0);
            format!("{:?}, hit {}, triangles {}", rays[i], hit.lane(i), mesh.triangles.len())
        });
    }
    found
}

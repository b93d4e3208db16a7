//! Boxes against a test of closed boxes in f64: none that a ray meets is left out (NUMERICS BOX-1 to BOX-4).
//!
//! Each box is the only child of a node, and below it is an octahedron around everything: a ray hits that whenever it
//! enters the box.

use super::Found;
use crate::geometry::{Ray, Rng, packet};
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::scene::blob::{LEAF_BIT, Leaf, NONE, Node};
use croupier::unstable::simd::Mask8;

/// Vertices of the octahedron are that far from the origin, boxes and rays start at most 2e7 from it.
const AROUND: f32 = 1e9;

/// The padding of origins, of |o| + S (`core/src/accel/setup.rs`).
const PADDING: f64 = 0.5 / 1_048_576.0;

fn octahedron() -> Leaf {
    let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: std::array::from_fn(|i| i as u32) };
    for i in 0..8 {
        for axis in 0..3 {
            leaf.p[3 * axis + axis][i] = if i >> axis & 1 == 0 { AROUND } else { -AROUND };
        }
    }
    leaf
}

/// A box, flat in some axes every other time.
fn random_box(r: &mut Rng) -> [[f32; 3]; 2] {
    let far = [0.0, 1.0, 1e3, 1e5, 1e7][r.below(5)];
    let size = r.log(-3.0, 3.0);
    let middle = r.cube().map(|x| far * x);
    let flat = r.below(6);
    let lo = [0, 1, 2].map(|k| middle[k] + size * r.signed());
    let hi = [0, 1, 2].map(|k| if flat == k { lo[k] } else { lo[k] + size * r.unit() });
    [lo, hi]
}

/// A ray that starts at the box or up to 10 sizes away, aimed at a point, an edge or a corner of the box, or anywhere;
/// some components of the direction are 0 or -0.
fn random_ray([lo, hi]: [[f32; 3]; 2], r: &mut Rng) -> Ray {
    let size = [0, 1, 2].map(|k| hi[k] - lo[k]).into_iter().fold(1e-3, f32::max);
    let pick = |k: usize, r: &mut Rng| match r.below(4) {
        0 => lo[k],
        1 => hi[k],
        _ => lo[k] + r.unit() * (hi[k] - lo[k]),
    };
    let aim = [0, 1, 2].map(|k| pick(k, r));
    let away = [0.0, 1.0, 10.0][r.below(3)] * size;
    // of some axes the origin has the coordinate of a face
    let o = [0, 1, 2].map(|k| if r.below(4) == 0 { pick(k, r) } else { aim[k] + away * r.signed() });
    let mut d = [0, 1, 2].map(|k| aim[k] - o[k]);
    match r.below(4) {
        0 => d = r.cube(),
        1 => {
            let k = r.below(3);
            d[k] = 0.0f32.copysign(r.signed());
        }
        _ => (),
    }
    let length = r.log(-3.0, 3.0);
    Ray::new(o, d.map(|x| x * length))
}

/// Parameters at which a ray enters and leaves a closed box, with the axes that decide, in f64; `None` if it stands
/// outside of a slab that it is parallel to.
fn slabs(ray: &Ray, [lo, hi]: [[f32; 3]; 2]) -> Option<[(f64, usize); 2]> {
    let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for k in 0..3 {
        let [o, d, lo, hi] = [ray.o[k], ray.d[k], lo[k], hi[k]].map(f64::from);
        if d == 0.0 {
            if o < lo || o > hi {
                return None;
            }
            continue;
        }
        let (a, b) = ((lo - o) / d, (hi - o) / d);
        if a.min(b) > enter.0 {
            enter = (a.min(b), k);
        }
        if a.max(b) < leave.0 {
            leave = (a.max(b), k);
        }
    }
    Some([enter, leave])
}

/// Tests `boxes` boxes with eight rays each. A failure is a box that a ray meets and does not enter. The figure is by
/// how much rays miss boxes that they enter all the same, in units of what the padding grants.
pub fn missed(seed: u64, boxes: usize) -> Found {
    let mut r = Rng(seed);
    let mut found = Found::default();
    let leaves = [octahedron()];
    for n in 0..boxes {
        let bounds = random_box(&mut r);
        let mut node = Node { bounds: [[f32::INFINITY; 8]; 6], child: [NONE; 8], reserved: [0; 8] };
        node.bounds[3..].fill([f32::NEG_INFINITY; 8]);
        for (row, bound) in node.bounds.iter_mut().zip(bounds.as_flattened()) {
            row[n % 8] = *bound;
        }
        node.child[n % 8] = LEAF_BIT | 8 << 27;
        let nodes = [node];
        let bvh = WideBvh::from_parts(&nodes, &leaves);
        let extent = bounds.as_flattened().iter().fold(0.0f32, |m, x| m.max(x.abs()));
        let rays: [Ray; 8] = std::array::from_fn(|_| random_ray(bounds, &mut r));
        // as a packet, or one by one
        let active = if n % 3 == 0 { Mask8::from_bits(1 << (n / 3 % 8)) } else { Mask8::all_lanes() };
        let entered = bvh.closest(&packet(&rays), active).hit;
        for i in active.lanes() {
            let ray = &rays[i];
            if ray.d == [0.0; 3] {
                continue;
            }
            let meets = slabs(ray, bounds);
            let met = meets.is_some_and(|[enter, leave]| enter.0 <= leave.0 && leave.0 > 0.0);
            found.case(entered.lane(i) || !met, || format!("{ray:?} and {bounds:?}"));
            // behind a ray that starts beside the box the gap says nothing
            if let Some([enter, leave]) = meets
                && entered.lane(i)
                && !met
                && leave.0 > 0.0
                && ray.d.iter().all(|d| *d != 0.0)
            {
                let grants = |(_, k): (f64, usize)| {
                    PADDING * (f64::from(ray.o[k].abs()) + f64::from(extent)) / f64::from(ray.d[k].abs())
                };
                found.figure((enter.0 - leave.0) / (grants(enter) + grants(leave)));
            }
        }
    }
    found
}

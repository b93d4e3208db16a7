//! What a guide has learned, as the camera sees it.

use croupier::Scene;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::camera::project;
use croupier::unstable::geometry::{Ray8, SurfaceHit8, SurfacePoint8, offset};
use croupier::unstable::learn::guiding::{Guide, Guide8};
use croupier::unstable::scene::blob::MaterialKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Directions of which a mean is taken: powers of 4 are spread evenly over the first choice that a guide makes.
const DIRECTIONS: u32 = 64;
/// Most clear surfaces that a ray passes.
const MOST_PASSED: usize = 8;

/// What a guide has learned where rays through the centres of the pixels meet surfaces first, row by row; 0 where they meet
/// none, or nothing was learned. They go straight through clear glass and water, where paths are not guided; mirrors count
/// as other surfaces do.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideView {
    /// Share of the samples that the guide would choose the direction of, 0 to 3/4.
    pub share: Vec<f32>,
    /// Mean of the directions that it would choose, world space: the shorter, the more of them there are.
    pub direction: Vec<[f32; 3]>,
}

impl GuideView {
    /// Of a scene's first frame, in a picture of this size.
    pub fn new(scene: &Scene<'_>, guide: &Guide<'_>, size: [u32; 2]) -> Self {
        let bvh = WideBvh::new(scene);
        let [width, height] = size.map(|s| s as usize);
        let mut view = Self { share: vec![0.0; width * height], direction: vec![[0.0; 3]; width * height] };
        let pixels = view.share.chunks_mut(8).zip(view.direction.chunks_mut(8)).enumerate();
        for (packet, (share, direction)) in pixels {
            let at = [0, 1].map(|axis| {
                F32x8::from_fn(|i| {
                    let pixel = packet * 8 + i;
                    [pixel % width, pixel / width][axis] as f32 + 0.5
                })
            });
            let (o, d) = project(scene.camera, size, at[0], at[1], [F32x8::splat(0.5); 2]);
            let (hit, point) = behind_glass(scene, &bvh, Ray8::unbounded(o, d), Mask8::first(share.len()));
            let facing = Vec3x8::select(point.ng.dot(d).gt(F32x8::ZERO), -point.ng, point.ng);
            let learned = guide.at(point.p, Some(facing), [F32x8::splat(0.5); 3], hit);
            let known = hit & learned.known & learned.fraction.gt(F32x8::ZERO);
            let mean = mean_direction(guide, &learned, known);
            for i in known.lanes() {
                (share[i], direction[i]) = (learned.fraction.lane(i), mean.lane(i));
            }
        }
        view
    }
}

/// The first surfaces that rays meet behind clear ones, through which they go straight on; lanes that meet any.
fn behind_glass(scene: &Scene<'_>, bvh: &WideBvh<'_>, mut rays: Ray8, lanes: Mask8) -> (Mask8, SurfacePoint8) {
    let is_clear = |material: u32| {
        let kind = scene.materials.get(material as usize).and_then(|m| MaterialKind::from_u32(m.kind));
        kind.is_some_and(|k| k.facts().transmissive && k.facts().delta)
    };
    let (mut left, mut met) = (lanes, Mask8::NONE);
    let mut found = SurfacePoint8 { p: Vec3x8::ZERO, ng: Vec3x8::ZERO, error: F32x8::ZERO };
    for _ in 0..=MOST_PASSED {
        let hit = bvh.closest(&rays, left);
        let mut surface = SurfaceHit8::gather(scene, &hit);
        let point = surface.place(scene, rays.time);
        let clear = hit.hit.lanes().filter(|i| is_clear(surface.material[*i])).fold(0, |bits, i| bits | 1 << i);
        let clear = Mask8::from_bits(clear);
        let ends = hit.hit.and_not(clear);
        found.p = Vec3x8::select(ends, point.p, found.p);
        found.ng = Vec3x8::select(ends, point.ng, found.ng);
        (met, left) = (met | ends, clear);
        if left.none() {
            break;
        }
        rays.o = Vec3x8::select(clear, offset(point.p, point.ng, point.error, rays.d), rays.o);
    }
    (met, found)
}

/// Mean of directions that a guide chooses.
fn mean_direction(guide: &Guide<'_>, at: &Guide8, lanes: Mask8) -> Vec3x8 {
    let mut sum = Vec3x8::ZERO;
    for i in 0..DIRECTIONS {
        // a lattice (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018), and for the cells below
        let word = |step: u32| U32x8::splat(i.wrapping_mul(step).wrapping_add(step >> 1));
        sum += guide.sample(at, [0xcd17_f8ff, 0xa7ea_f0a5, 0x895b_7175, 0x708c_d5cf].map(word), lanes).0;
    }
    sum * F32x8::splat(1.0 / DIRECTIONS as f32)
}

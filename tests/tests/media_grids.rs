//! Density grids of media: look-ups against the f64 oracle, and the walk through their bricks of majorants.

use croupier::unstable::media::*;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::media_flights::*;
use croupier_tests::media_oracle::*;
use croupier_tests::stats::SplitMix;

/// Densities are the oracle's within 1e-6 of the largest, clamped to the border cells, 0 outside.
/// Killed by: cell corners in place of centres, strides of another axis, an extrapolation at the border.
#[test]
fn densities_are_trilinear() {
    let all = random_grid(homogeneous([0.0; 3], [1.0; 3], [0.0; 3]), 14);
    let thin = MediaScene::default().with_grid(all.media[0], BOX, [1, 2, 1], &[0.25, 0.75]);
    let mut rng = SplitMix(15);
    for scene in [&all, &thin] {
        for _ in 0..20_000 {
            let p: [[f32; 3]; 8] = std::array::from_fn(|_| {
                std::array::from_fn(|a| rng.range(f64::from(BOX[0][a]) - 0.05, f64::from(BOX[1][a]) + 0.05) as f32)
            });
            let active = Mask8::from_bits(rng.word());
            let got = density(&scene.scene(), U32x8::splat(0), Vec3x8::from_fn(|i| p[i]), active);
            for (i, p) in p.into_iter().enumerate() {
                let want = if active.lane(i) { scene.density(0, p.map(f64::from)) } else { 0.0 };
                assert!((f64::from(got.lane(i)) - want).abs() < 4e-6, "{p:?}: {} {want}", got.lane(i));
            }
        }
        let corner = Vec3x8::splat(BOX[1][0], BOX[1][1], BOX[1][2]);
        let at_corner = density(&scene.scene(), U32x8::splat(0), corner, Mask8::first(1));
        assert_eq!(at_corner.lane(0), *scene.densities.last().unwrap());
        let nan = density(&scene.scene(), U32x8::splat(7), Vec3x8::grey(F32x8::splat(f32::NAN)), Mask8::all_lanes());
        assert_eq!(nan, F32x8::ZERO);
    }
}

/// Random walks through random grids of random shape: bricks follow each other without a gap from the entry to the exit, as
/// many as planes are crossed; in 1.5e6 look-ups no density exceeds its majorant, and positions are those of the ray.
/// Killed by: majorants without their margin or their ring of cells; distances that accumulate; an entry by the origin.
#[test]
fn majorants_hold_along_every_walk() {
    let mut rng = SplitMix(16);
    let (mut looked, mut walks) = (0u64, 0u64);
    while looked < 1_500_000 {
        let cells: [u32; 3] = std::array::from_fn(|_| 1 + rng.word() % 21);
        let low: [f32; 3] = std::array::from_fn(|_| rng.range(-5.0, 5.0) as f32);
        let bounds = [low, low.map(|x| x + rng.range(0.1, 4.0) as f32)];
        let spikes = rng.f64() < 0.3;
        let value = |rng: &mut SplitMix| if spikes && rng.f64() < 0.9 { 0.0 } else { rng.f32() };
        let densities: Vec<f32> = (0..cells.iter().product()).map(|_| value(&mut rng)).collect();
        let all = MediaScene::default().with_grid(homogeneous([0.0; 3], [1.0; 3], [0.0; 3]), bounds, cells, &densities);
        let scene = all.scene();
        let grids = Grids8::gather(&scene, U32x8::splat(0), Mask8::all_lanes());
        for _ in 0..40 {
            let far = [0.0, 3.0, 1000.0][rng.word() as usize % 3];
            let inside: [V; 8] = std::array::from_fn(|_| {
                std::array::from_fn(|a| rng.range(f64::from(bounds[0][a]), f64::from(bounds[1][a])))
            });
            let d: [V; 8] = std::array::from_fn(|_| {
                let mut d = rng.direction();
                match rng.word() % 4 {
                    0 => d[rng.word() as usize % 3] = 0.0,
                    1 => {
                        let keep = rng.word() as usize % 3;
                        (0..3).filter(|a| *a != keep).for_each(|a| d[a] = -0.0);
                    }
                    _ => {}
                }
                d
            });
            let o = Vec3x8::from_fn(|i| std::array::from_fn(|a| (inside[i][a] - far * d[i][a]) as f32));
            let s = Segment8 { o, d: Vec3x8::from_fn(|i| d[i].map(|x| x as f32)), tmax: F32x8::INFINITY };
            let path = Span8::new(&s, Mask8::all_lanes());
            let mut walk = BrickWalk8::new(&grids, &path, Mask8::all_lanes());
            assert!(far > 3.0 || walk.inside.all());
            let (mut live, mut at, mut bricks) = (walk.inside, F32x8::ZERO, 0);
            walks += u64::from(live.count());
            while live.any() {
                let (majorant, exit) = (walk.majorant(&scene, live), walk.exit());
                assert!(exit.ge(at).bits() & live.bits() == live.bits(), "the walk turns back");
                for k in 0..4 {
                    let f = [0.0, rng.f32(), rng.f32(), 1.0][k];
                    let here = at + (exit - at) * f;
                    let found = grids.at(&scene, walk.position(here), live);
                    // and at the world's point, where that is accurate to a fraction of a cell
                    let world = path.o + path.d * (walk.begin + here);
                    // the walk is where its distance says, in f64
                    let positions = walk.position(here);
                    let [o, d] = [path.o, path.d].map(|v| [v.x, v.y, v.z]);
                    let along = |i: usize, a: usize| {
                        let t = f64::from(walk.begin.lane(i)) + f64::from(here.lane(i));
                        let [low, high] = [0, 1].map(|k| f64::from(bounds[k][a]));
                        let at = f64::from(o[a].lane(i)) + t * f64::from(d[a].lane(i));
                        (at - low) / (high - low) * f64::from(cells[a])
                    };
                    let world = density(&scene, U32x8::splat(0), world, live);
                    for i in live.lanes() {
                        for (a, x) in [positions.x, positions.y, positions.z].into_iter().enumerate() {
                            let off = (f64::from(x.lane(i)) - along(i, a)).abs();
                            assert!(far > 3.0 || off < 2e-3, "{off} cells beside");
                        }
                        assert!(found.lane(i) <= majorant.lane(i), "{} above {}", found.lane(i), majorant.lane(i));
                        assert!(far > 3.0 || world.lane(i) <= majorant.lane(i));
                        looked += 1;
                    }
                }
                live = live.and_not(exit.ge(walk.length));
                at = exit;
                live = walk.advance(live);
                bricks += 1;
                assert!(bricks <= 3 * 7, "more steps than bricks");
            }
        }
    }
    println!("{looked} look-ups, {walks} walks");
}

//! Camera rays, and texture look-ups.

use super::{Kernels, Outcome, PACKETS, close, leak};
use croupier::unstable::camera::{image_point, project};
use croupier::unstable::scene::blob::{Camera, CameraKind, Texture, TextureRecord};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::unstable::texture::{lookup, referenced};
use croupier_tests::light_oracle::{cross, dot, sub, unit, wide};
use croupier_tests::light_scene::LightScene;
use croupier_tests::stats::SplitMix;
use croupier_tests::texture_oracle;

const SIZE: [u32; 2] = [320, 180];

pub(super) fn add(k: &mut Kernels) -> Outcome {
    cameras(k)?;
    textures(k)
}

/// A pixel sample: x, y, two numbers for the lens.
type Sample = [F32x8; 4];

fn cameras(k: &mut Kernels) -> Outcome {
    let mut rng = SplitMix(8);
    let forward = unit([-0.3, -0.5, -0.8]);
    let right = unit(cross(forward, [0.0, 1.0, 0.0]));
    let down = cross(forward, right);
    let scaled = |v: [f64; 3], s: f64| v.map(|x| (x * s) as f32);
    let pinhole = Camera {
        kind: CameraKind::Perspective as u32,
        origin: [0.8, 3.3, 5.6],
        forward: scaled(forward, 1.0),
        right: scaled(right, 0.4 * 16.0 / 9.0),
        down: scaled(down, 0.4),
        lens_radius: 0.0,
        focus_distance: 0.0,
        size: SIZE,
    };
    let lens = Camera { lens_radius: 0.05, focus_distance: 3.0, ..pinhole };
    let orthographic = Camera { kind: CameraKind::Orthographic as u32, ..pinhole };
    let panoramic =
        Camera { kind: CameraKind::Panoramic as u32, right: scaled(right, 1.0), down: scaled(down, 1.0), ..pinhole };
    let samples: Vec<Sample> = (0..PACKETS)
        .map(|_| [320.0, 180.0, 1.0, 1.0].map(|end: f64| F32x8::from_fn(|_| rng.range(0.0, end * 0.999) as f32)))
        .collect();
    for (name, camera) in
        [("pinhole", pinhole), ("thin lens", lens), ("orthographic", orthographic), ("panoramic", panoramic)]
    {
        let rays = move |[x, y, a, b]: &Sample| project(&camera, SIZE, *x, *y, [*a, *b]);
        for s in &samples {
            let (o, d) = rays(s);
            // where the ray is in focus; seen from the pinhole, it is the point of the image again
            let distance = F32x8::from_fn(|i| {
                let along = dot(wide(d.lane(i)), forward);
                if name == "thin lens" { (3.0 / along) as f32 } else { 3.0 }
            });
            let ([x, y], seen) = image_point(&camera, SIZE, o + d * distance);
            for i in seen.lanes() {
                let off = [(x, s[0]), (y, s[1])].map(|(got, want)| f64::from(got.lane(i) - want.lane(i)));
                close(format_args!("{name}: pixels off in x"), off[0], 0.0, 1e-2)?;
                close(format_args!("{name}: pixels off in y"), off[1], 0.0, 1e-2)?;
                close(format_args!("{name}: length"), dot(wide(d.lane(i)), wide(d.lane(i))), 1.0, 1e-6)?;
                if name == "pinhole" {
                    // the plane at distance 1
                    let [sx, sy] = [(0, 320.0), (1, 180.0)].map(|(c, n)| 2.0 * f64::from(s[c].lane(i)) / n - 1.0);
                    let through = sub(forward, right.map(|x| -x * 0.4 * 16.0 / 9.0 * sx));
                    let through = unit(sub(through, down.map(|x| -x * 0.4 * sy)));
                    close("pinhole: direction", dot(through, wide(d.lane(i))), 1.0, 1e-6)?;
                }
            }
            if seen.none() {
                return Err(format!("{name}: no ray is seen"));
            }
        }
        k.packets(("camera", name), 8.0, samples.clone(), rays);
    }
    Ok(())
}

fn textures(k: &mut Kernels) -> Outcome {
    let mut rng = SplitMix(9);
    let [w, h] = [64, 32];
    let texels: Vec<[u8; 3]> = (0..w * h).map(|_| std::array::from_fn(|_| rng.word() as u8)).collect();
    let mut owner = LightScene::default();
    owner.textures.push(Texture { first: 0, width: w, height: h, flags: 0 });
    owner.texels.extend(texels.iter().map(|t| u32::from_le_bytes([t[0], t[1], t[2], 255])));
    let scene = leak(owner).scene();
    let coordinates: Vec<[F32x8; 2]> =
        (0..PACKETS).map(|_| [(); 2].map(|()| F32x8::from_fn(|_| rng.range(-2.0, 2.0) as f32))).collect();
    let plain = move |uv: &[F32x8; 2]| lookup(&scene, U32x8::splat(0), *uv, Mask8::all_lanes());
    let record = leak(TextureRecord { texture: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] });
    let transformed = move |uv: &[F32x8; 2]| referenced(&scene, &[Some(record); 8], *uv).1;
    for uv in &coordinates {
        for got in [plain(uv), transformed(uv)] as [Vec3x8; 2] {
            for i in 0..8 {
                let at = uv.map(|x| f64::from(x.lane(i)));
                let want = texture_oracle::lookup(&texels, i64::from(w), i64::from(h), at);
                for (got, want) in got.lane(i).into_iter().zip(want) {
                    close("texture", f64::from(got), want, 3e-5)?;
                }
            }
        }
    }
    k.packets(("texture", "64 x 32, bilinear"), 8.0, coordinates.clone(), plain);
    k.packets(("texture", "the same with a transform"), 8.0, coordinates, transformed);
    Ok(())
}

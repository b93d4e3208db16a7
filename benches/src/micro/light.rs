//! Lights: samples, and the densities of directions that scattered rays take to them.

use super::{Kernels, Outcome, PACKETS, close, each, expect, leak, mean_lanes};
use croupier::Scene;
use croupier::unstable::light::{
    LightSample8, LightSelector, PowerSelector, ShapeRays8, environment_pdf, meet_shapes, power_heuristic,
};
use croupier::unstable::scene::blob::LightKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::hit;
use croupier_tests::light_oracle::{Map, V, area, cross, dot, length, sub, unit, wide};
use croupier_tests::light_scene::{IDENTITY, LightScene};
use croupier_tests::stats::SplitMix;
use std::f64::consts::{PI, TAU};

const UP: Vec3x8 = Vec3x8::splat(0.0, 1.0, 0.0);
const CORNERS: [[f32; 3]; 3] = [[-1.0, 3.0, -1.0], [1.0, 3.0, -1.0], [0.0, 3.0, 1.0]];
const MIDDLE: [f32; 3] = [0.0, 3.0, 0.0];
/// What every light emits: radiance, intensity or irradiance.
const EMISSION: [f32; 3] = [3.0, 2.0, 1.0];

/// What one sample of a light must be, in f64: its density if it has one, and its radiance or irradiance.
type Expected = fn(&V, &LightSample8, usize) -> (Option<f64>, V);

pub(super) fn add(k: &mut Kernels) -> Outcome {
    let kinds = each(LightKind::ALL, |kind| rows(k, *kind));
    let (texels, size) = map();
    let scene = leak(LightScene::default().map(texels, size, 1.0, IDENTITY).finish());
    let oracle = leak(Map::new(&scene.env_texels, size[0] as usize, size[1] as usize));
    each([kinds, environment(k, "environment map", scene, Some(oracle)), heuristic(k)], |outcome| outcome)
}

/// Texels of a sky with a bright spot, and its size.
fn map() -> (Vec<[f32; 3]>, [u32; 2]) {
    let texel = |i: u32| {
        let bright = if i == 37 { 40.0 } else { 0.0 };
        [(i % 7) as f32 / 7.0 + bright, (i % 5) as f32 / 5.0 + bright, 0.5 + bright]
    };
    ((0..16 * 8).map(texel).collect(), [16, 8])
}

fn rows(k: &mut Kernels, kind: LightKind) -> Outcome {
    let base = LightScene::default();
    let e = EMISSION;
    let (name, scene): (&str, _) = match kind {
        LightKind::Area => ("area", base.triangle(CORNERS, Some(e))),
        LightKind::Environment => {
            return environment(k, "constant environment", leak(base.constant(e).finish()), None);
        }
        LightKind::Point => ("point", base.delta(kind, MIDDLE, e)),
        LightKind::Directional => ("directional", base.delta(kind, [0.0, 1.0, 0.0], e)),
        LightKind::Spot => ("spot", base.delta(kind, MIDDLE, e).cone([0.0, -1.0, 0.0], [1.0, 0.9])),
        LightKind::Sun => ("sun", base.delta(kind, [0.0, 1.0, 0.0], e).disk(0.1)),
        LightKind::Sphere => ("sphere", base.shape(kind, MIDDLE, &[0.7], e)),
        LightKind::Rectangle => ("rectangle", base.shape(kind, MIDDLE, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0], e)),
        LightKind::Disk => ("disk", base.shape(kind, MIDDLE, &[0.0, -1.0, 0.0, 0.8], e)),
    };
    let owner = leak(scene.finish());
    let scene = owner.scene();
    let (draws, samples) = sampled(owner, k.compared);
    let expected: Expected = match kind {
        LightKind::Area => |p, s, i| {
            let [a, b, c] = CORNERS.map(wide);
            let (offset, n) = (sub(wide(s.point.lane(i)), *p), unit(cross(sub(b, a), sub(c, a))));
            let cos = dot(unit(offset), n).abs();
            (Some(dot(offset, offset) / (area(CORNERS) * cos)), wide(EMISSION))
        },
        LightKind::Point | LightKind::Spot => |p, _, _| {
            let r = length(sub(wide(MIDDLE), *p));
            (None, wide(EMISSION).map(|x| x / (r * r)))
        },
        LightKind::Directional => |_, _, _| (None, wide(EMISSION)),
        // the mean cosine of the disk
        LightKind::Sun => |_, _, _| (None, wide(EMISSION).map(|x| x / (1.0 - (1.0 - 0.1f64.cos()) / 2.0))),
        LightKind::Sphere => |p, _, _| {
            let s = f64::from(0.7f32) / length(sub(wide(MIDDLE), *p));
            (Some(1.0 / (TAU * (1.0 - (1.0 - s * s).sqrt()))), wide(EMISSION))
        },
        LightKind::Rectangle => |p, _, _| (Some(1.0 / rectangle(*p)), wide(EMISSION)),
        // from afar, as all of the points are, uniform over its area
        LightKind::Disk => |p, s, i| {
            let offset = sub(wide(s.point.lane(i)), *p);
            let r2 = dot(offset, offset);
            let cos = offset[1] / r2.sqrt();
            (Some(r2 / (PI * f64::from(0.8f32).powi(2) * cos)), wide(EMISSION))
        },
        LightKind::Environment => |_, s, i| (Some(f64::from(s.pdf.lane(i))), wide(EMISSION)),
    };
    for ((p, _), s) in draws.iter().zip(&samples) {
        for i in s.valid.lanes() {
            let (pdf, radiance) = expected(&wide(p.lane(i)), s, i);
            close(format_args!("{name}: density"), f64::from(s.pdf.lane(i)), pdf.unwrap_or(1.0), 2e-5)?;
            if let Some(pdf) = pdf {
                k.note(("light sample", name), f64::from(s.pdf.lane(i)), pdf);
            }
            for (got, want) in s.radiance.lane(i).into_iter().zip(radiance) {
                close(format_args!("{name}: radiance"), f64::from(got), want, 2e-5)?;
                k.note(("light sample", name), f64::from(got), want);
            }
        }
    }
    let lanes = used(&samples);
    expect(lanes > 4.0, format_args!("{name}: {lanes} of 8 lanes have a sample"))?;
    sample_row(k, name, lanes, scene, &draws);
    match kind {
        LightKind::Area => area_rows(k, scene, &draws, &samples, expected),
        LightKind::Sphere | LightKind::Rectangle | LightKind::Disk => {
            shape_rows(k, name, scene, (&draws, &samples), expected)
        }
        _ => Ok(()),
    }
}

/// Solid angle of the rectangle as of two triangles, which the sampler does not have.
fn rectangle(p: V) -> f64 {
    let at = |x: f32, z: f32| [x, 3.0, z];
    let [a, b, c, d] = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
    let p = p.map(|x| x as f32);
    croupier_tests::light_oracle::solid_angle([a, b, c], p) + croupier_tests::light_oracle::solid_angle([a, c, d], p)
}

type Draw = (Vec3x8, [U32x8; 4]);

/// Reference points below the light, random words, and the samples from there.
fn sampled(owner: &'static LightScene, packets: usize) -> (Vec<Draw>, Vec<LightSample8>) {
    let mut rng = SplitMix(3);
    let scene = owner.scene();
    let draws: Vec<Draw> = (0..packets)
        .map(|_| {
            let p = Vec3x8::from_fn(|_| [-2.0, -1.0, -2.0].map(|x| rng.range(x, x + 2.0 * x.abs()) as f32 * 0.6));
            (p, std::array::from_fn(|_| U32x8::from_fn(|_| rng.word())))
        })
        .collect();
    let sample = |(p, words): &Draw| hit::sample(&scene, &PowerSelector(scene), *p, UP, *words, Mask8::all_lanes());
    let samples = draws.iter().map(sample).collect();
    (draws, samples)
}

fn sample_row(k: &mut Kernels, name: &str, lanes: f64, scene: Scene<'static>, draws: &[Draw]) {
    k.packets(("light sample", name), lanes, draws[..PACKETS].to_vec(), move |(p, words)| {
        hit::sample(&scene, &PowerSelector(scene), *p, UP, *words, Mask8::all_lanes())
    });
}

/// Lanes that have a sample, of the packets of a kernel.
fn used(samples: &[LightSample8]) -> f64 {
    mean_lanes(samples.iter().take(PACKETS).map(|s| s.valid.count() as usize))
}

/// Densities that rays are told, beside those that their samples must have.
fn told(k: &mut Kernels, name: &str, draws: &[Draw], told: &[F32x8], samples: &[LightSample8], expected: Expected) {
    for (((p, _), pdf), s) in draws.iter().zip(told).zip(samples) {
        for i in s.valid.lanes() {
            if let Some(want) = expected(&wide(p.lane(i)), s, i).0 {
                k.note(("light pdf", name), f64::from(pdf.lane(i)), want);
            }
        }
    }
}

fn area_rows(
    k: &mut Kernels,
    scene: Scene<'static>,
    draws: &[Draw],
    samples: &[LightSample8],
    expected: Expected,
) -> Outcome {
    let first = U32x8::splat(0);
    let pdf = move |(p, wi, t): &(Vec3x8, Vec3x8, F32x8)| {
        hit::area_pdf(&scene, &PowerSelector(scene), *p, UP, first, *wi, *t, Mask8::all_lanes())
    };
    let mut rays: Vec<_> = draws.iter().zip(samples).map(|((p, _), s)| (*p, s.wi, (s.point - *p).length())).collect();
    let densities: Vec<_> = rays.iter().map(pdf).collect();
    agree("area", &densities, samples)?;
    told(k, "area", draws, &densities, samples, expected);
    let lanes = used(samples);
    rays.truncate(PACKETS);
    k.packets(("light pdf", "area"), lanes, rays, pdf);
    Ok(())
}

/// Densities that rays are told are those of the samples in the same directions.
fn agree(name: &str, told: &[F32x8], samples: &[LightSample8]) -> Outcome {
    for (pdf, s) in told.iter().zip(samples) {
        for i in s.valid.lanes() {
            let ratio = f64::from(pdf.lane(i)) / f64::from(s.pdf.lane(i));
            close(format_args!("{name}: density that a ray is told over that of the sample"), ratio, 1.0, 1e-4)?;
        }
    }
    Ok(())
}

fn shape_rows(
    k: &mut Kernels,
    name: &str,
    scene: Scene<'static>,
    (draws, samples): (&[Draw], &[LightSample8]),
    expected: Expected,
) -> Outcome {
    let pdf = move |rays: &ShapeRays8| {
        let mut found = F32x8::ZERO;
        meet_shapes(&scene, &PowerSelector(scene), rays, UP, Mask8::all_lanes(), |lanes, _, pdf| {
            found = lanes.select(pdf, found);
        });
        found
    };
    let ray = |(p, d)| ShapeRays8 {
        p,
        d,
        after: F32x8::ZERO,
        upto: F32x8::INFINITY,
        camera: Mask8::NONE,
        mask: Mask8::all_lanes(),
    };
    let mut rays: Vec<_> = draws.iter().zip(samples).map(|((p, _), s)| ray((*p, s.wi))).collect();
    let densities: Vec<_> = rays.iter().map(pdf).collect();
    agree(name, &densities, samples)?;
    told(k, name, draws, &densities, samples, expected);
    let lanes = used(samples);
    rays.truncate(PACKETS);
    k.packets(("light pdf", name), lanes, rays, pdf);
    Ok(())
}

fn environment(k: &mut Kernels, name: &str, owner: &'static LightScene, map: Option<&'static Map>) -> Outcome {
    let scene = owner.scene();
    let (draws, samples) = sampled(owner, k.compared);
    let pdf = move |(p, wi): &(Vec3x8, Vec3x8)| {
        environment_pdf(&scene, &PowerSelector(scene), *p, UP, *wi, Mask8::all_lanes())
    };
    let mut rays: Vec<_> = draws.iter().zip(&samples).map(|((p, _), s)| (*p, s.wi)).collect();
    let densities: Vec<_> = rays.iter().map(pdf).collect();
    agree(name, &densities, &samples)?;
    let cells = map.map(Map::probabilities);
    for (s, told) in samples.iter().zip(&densities) {
        for i in s.valid.lanes() {
            let want = match map.zip(cells.as_ref()) {
                None => 1.0 / (4.0 * PI),
                Some((map, cells)) => {
                    let (at, [columns, _]) = (map.at(wide(s.wi.lane(i))), map.cells());
                    let [above, below] = map.cosines(at.row);
                    let solid_angle = (above - below) * TAU / columns as f64;
                    cells[at.row * columns + at.column] * map.inside(at.column, at.row, at.x, at.t) / solid_angle
                }
            };
            let got = f64::from(s.pdf.lane(i));
            close(format_args!("{name}: density"), got / want, 1.0, if map.is_some() { 0.02 } else { 1e-6 })?;
            k.note(("light sample", name), got, want);
            k.note(("light pdf", name), f64::from(told.lane(i)), want);
        }
    }
    let lanes = used(&samples);
    sample_row(k, name, lanes, scene, &draws);
    rays.truncate(PACKETS);
    k.packets(("light pdf", name), lanes, rays, pdf);
    Ok(())
}

/// Choice of one of a thousand lights, and the weights of multiple importance sampling.
fn heuristic(k: &mut Kernels) -> Outcome {
    let mut rng = SplitMix(4);
    let weights: Vec<f64> = (0..1000).map(|_| rng.f64()).collect();
    let mut many = LightScene::default();
    for _ in &weights {
        many = many.delta(LightKind::Point, MIDDLE, EMISSION);
    }
    let scene = leak(many.select_by(&weights)).scene();
    let words: Vec<U32x8> = (0..PACKETS).map(|_| U32x8::from_fn(|_| rng.word())).collect();
    let select = move |r: &U32x8| PowerSelector(scene).select(Vec3x8::ZERO, UP, *r, Mask8::all_lanes());
    let total: f64 = weights.iter().sum();
    for r in &words {
        let (light, p) = select(r);
        for i in 0..8 {
            let want = weights[light.lane(i) as usize] / total;
            close("probability of a light", f64::from(p.lane(i)) / want, 1.0, 1e-3)?;
        }
    }
    k.packets(("light select", "one of 1000 by power"), 8.0, words, select);
    let densities: Vec<_> =
        (0..PACKETS).map(|_| [(); 2].map(|()| F32x8::from_fn(|_| rng.range(0.01, 9.0) as f32))).collect();
    for [own, other] in &densities {
        let w = power_heuristic(*own, *other);
        for i in 0..8 {
            let [own, other] = [own, other].map(|x| f64::from(x.lane(i)).powi(2));
            close("power heuristic", f64::from(w.lane(i)), own / (own + other), 3e-7)?;
        }
    }
    k.packets(("light select", "power heuristic"), 8.0, densities, |[own, other]| power_heuristic(*own, *other));
    Ok(())
}

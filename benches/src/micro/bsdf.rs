//! Scattering models and the phase function: gathering their parameters, values, densities alone, samples.

use super::{Kernels, Outcome, PACKETS, close, each, expect, leak, mean_lanes};
use croupier::Scene;
use croupier::unstable::bsdf::{Bsdf, HenyeyGreenstein, Inputs8, Lobes, Visitor, dispatch};
use croupier::unstable::scene::blob::MaterialKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_host::description::Principled;
use croupier_tests::bsdf::{Case, Lobe, V, Value, combine, lane, splat};
use croupier_tests::media_oracle::{MediaScene, henyey_greenstein, homogeneous};
use croupier_tests::model;
use croupier_tests::principled::Layered;
use croupier_tests::stats::SplitMix;

/// Models in f64: what is expected of them.
trait Expected {
    /// Value and density.
    fn value(&self, wo: V, wi: V) -> Value;
    /// Scatters light from behind as well.
    fn two_sided(&self) -> bool;
    /// Relative error that the model may have; that of tables and of parameters in few bits, where there are any.
    fn tolerance(&self) -> f64;
    /// Delta lobes: directions and weights.
    fn lobes(&self, _wo: V) -> Vec<Lobe> {
        vec![]
    }
    /// Share of the light that passes straight on.
    fn straight(&self, _wo: V) -> f64 {
        0.0
    }
    /// The direction to the viewer that takes the place of `wo`.
    fn view(&self, wo: [f32; 3]) -> [f32; 3] {
        wo
    }
}

impl Expected for Case {
    fn value(&self, wo: V, wi: V) -> Value {
        self.eval(wo, wi)
    }

    fn two_sided(&self) -> bool {
        Case::two_sided(self)
    }

    fn tolerance(&self) -> f64 {
        2e-3
    }

    fn lobes(&self, wo: V) -> Vec<Lobe> {
        Case::lobes(self, wo)
    }

    fn straight(&self, wo: V) -> f64 {
        let through = Case::lobes(self, wo).into_iter().filter(|l| l.wi == wo.map(|x| -x));
        through.map(|l| l.weight[0]).sum()
    }
}

impl Expected for Layered {
    fn value(&self, wo: V, wi: V) -> Value {
        self.eval(wo, wi)
    }

    fn two_sided(&self) -> bool {
        self.p.transmission > 0.0
    }

    fn tolerance(&self) -> f64 {
        1e-2
    }
}

/// The phase function of mean cosine `g` and albedo 1.
struct Phase(f64);

impl Expected for Phase {
    fn value(&self, wo: V, wi: V) -> Value {
        let cos = -(wo[0] * wi[0] + wo[1] * wi[1] + wo[2] * wi[2]);
        let pdf = henyey_greenstein(self.0, cos);
        Value { f: [pdf; 3], pdf }
    }

    fn two_sided(&self) -> bool {
        true
    }

    fn tolerance(&self) -> f64 {
        1e-4
    }

    /// The frame of a phase function is that of the ray.
    fn view(&self, _: [f32; 3]) -> [f32; 3] {
        [0.0, 0.0, 1.0]
    }
}

pub(super) fn add(k: &mut Kernels) -> Outcome {
    let models = each(MaterialKind::ALL, |kind| match kind {
        MaterialKind::Principled => principled(k),
        // a host's
        MaterialKind::Own => Ok(()),
        _ => model_of(k, *kind),
    });
    each([models, phase(k)], |outcome| outcome)
}

fn phase(k: &mut Kernels) -> Outcome {
    let mut medium = homogeneous([0.0; 3], [1.0; 3], [0.0; 3]);
    medium.g = 0.6;
    let scene = leak(MediaScene::default().with(medium)).scene();
    let inputs = Inputs8 { material: U32x8::splat(0), reflectance: Vec3x8::ONE };
    Rows { k, name: "henyey-greenstein", scene, inputs, expected: &Phase(f64::from(0.6f32)) }
        .visit::<HenyeyGreenstein>()
}

/// Rows of a model with textbook parameters; where it knows compensation, more rows with it.
fn model_of(k: &mut Kernels, kind: MaterialKind) -> Outcome {
    use MaterialKind::*;
    let (gold, gold_k) = ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603]);
    let (eta, extinction) = match kind {
        Conductor | RoughConductor => (gold, gold_k),
        _ => ([1.5; 3], [0.0; 3]),
    };
    let rough = matches!(kind, RoughConductor | RoughDielectric | RoughPlastic);
    let case = Case::new(kind, [0.8, 0.5, 0.2], eta, extinction, if rough { 0.3 } else { 0.0 });
    let compensated = rough.then(|| case.clone().compensated());
    for case in [Some(case), compensated].into_iter().flatten() {
        let (scene, inputs) = model::inputs([&case; 8], Mask8::all_lanes());
        let name = if case.is_compensated() { format!("{}, compensated", kind.name()) } else { kind.name().into() };
        delta_lobes(&case)?;
        dispatch(kind, Rows { k: &mut *k, name: &name, scene, inputs, expected: &case })?;
    }
    Ok(())
}

fn principled(k: &mut Kernels) -> Outcome {
    let plain = Principled { base_color: [0.8, 0.5, 0.2], roughness: 0.5, ..Principled::default() };
    let coated = Principled { coat: 1.0, metalness: 0.5, transmission: 0.5, ..plain };
    for (name, p) in [("principled", plain), ("principled, all layers", coated)] {
        let layered = Layered::new(p, true);
        let (scene, inputs) = layered.inputs();
        dispatch(MaterialKind::Principled, Rows { k: &mut *k, name, scene, inputs, expected: &layered })?;
    }
    Ok(())
}

/// Delta lobes are sampled as often as their weights say: a stratified run of the number that chooses the lobe.
fn delta_lobes(case: &Case) -> Outcome {
    let wo = croupier_tests::bsdf::at_angle(50.0, 0.7);
    let lobes = case.lobes(wo);
    let model = case.model(Mask8::all_lanes());
    const N: usize = 2048;
    let mut sums = vec![0.0; lobes.len()];
    for n in (0..N).step_by(8) {
        let u = F32x8::from_fn(|i| ((n + i) as f64 + 0.5) as f32 / N as f32);
        let s = model.sample(splat(wo), [F32x8::splat(0.3), F32x8::splat(0.6), u]);
        for i in (s.valid & s.delta).lanes() {
            let wi = lane(s.wi, i);
            let apart = |w: V| combine(w, 1.0, wi, -1.0).iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let found = lobes.iter().position(|l| apart(l.wi) < 1e-6);
            let found = found.ok_or_else(|| format!("{}: a sample to {wi:?}, where no lobe is", case.name()))?;
            sums[found] += f64::from(s.weight.lane(i)[0]) / N as f64;
        }
    }
    for (lobe, sum) in lobes.iter().zip(sums) {
        close(format_args!("{}: weight of a lobe", case.name()), sum, lobe.weight[0], 2e-3)?;
    }
    Ok(())
}

struct Rows<'k, E> {
    k: &'k mut Kernels,
    name: &'k str,
    scene: Scene<'static>,
    inputs: Inputs8,
    expected: &'k E,
}

/// What is sampled: where to, three numbers.
type Draw = (Vec3x8, [F32x8; 3]);

impl<E: Expected> Visitor<'static> for Rows<'_, E> {
    type Out = Outcome;

    fn visit<B: Bsdf<'static>>(self) -> Outcome {
        let Self { k, name, scene, inputs, expected } = self;
        let model = B::gather(&scene, &inputs, Mask8::all_lanes());
        let mut rng = SplitMix(2);
        let (two_sided, tolerance) = (expected.two_sided(), expected.tolerance());
        let draws: Vec<Draw> = (0..k.compared)
            .map(|_| {
                let wo = Vec3x8::from_fn(|_| {
                    let [x, y, z] = rng.direction();
                    // not along the surface, where the oracle's own error grows
                    let z = if z.abs() < 0.05 { 0.05 } else { z };
                    let l = (x * x + y * y + z * z).sqrt();
                    expected.view([x, y, if two_sided { z } else { z.abs() }].map(|c| (c / l) as f32))
                });
                (wo, [(); 3].map(|()| F32x8::from_fn(|_| rng.f32())))
            })
            .collect();
        let samples: Vec<_> = draws.iter().map(|(wo, u)| model.sample(*wo, *u)).collect();
        for ((wo, _), s) in draws.iter().zip(&samples) {
            for i in s.valid.and_not(s.delta).lanes() {
                let v = expected.value(lane(*wo, i), lane(s.wi, i));
                let (pdf, weight) = (f64::from(s.pdf.lane(i)), s.weight.lane(i));
                close(format_args!("{name}: density of a sample"), pdf / v.pdf, 1.0, tolerance)?;
                k.note(("bsdf sample", name), pdf, v.pdf);
                for (f, weight) in v.f.into_iter().zip(weight) {
                    close(format_args!("{name}: weight of a sample"), f64::from(weight), f / v.pdf, tolerance)?;
                    k.note(("bsdf sample", name), f64::from(weight), f / v.pdf);
                }
            }
            for i in (s.valid & s.delta).lanes() {
                let (wi, lobes) = (lane(s.wi, i), expected.lobes(lane(*wo, i)));
                let apart = |l: &Lobe| combine(l.wi, 1.0, wi, -1.0).iter().fold(0.0f64, |m, x| m.max(x.abs()));
                if let Some(off) = lobes.iter().map(apart).reduce(f64::min) {
                    // a direction is of length 1
                    k.note(("bsdf sample", name), 1.0 + off, 1.0);
                }
            }
            expect(s.weight.is_finite().all(), format_args!("{name}: a weight that is not finite"))?;
        }
        let lanes = mean_lanes(samples.iter().take(PACKETS).map(|s| s.valid.count() as usize));
        k.packets(("bsdf gather", name), 8.0, vec![inputs; PACKETS], move |inputs| {
            B::gather(&scene, inputs, Mask8::all_lanes())
        });
        if B::LOBES.contains(Lobes::STRAIGHT) {
            for (wo, _) in &draws {
                let got = model.straight(*wo);
                for i in 0..8 {
                    let want = expected.straight(lane(*wo, i));
                    close(format_args!("{name}: share that passes"), f64::from(got.lane(i)), want, 1e-5)?;
                    k.note(("bsdf straight", name), f64::from(got.lane(i)), want);
                }
            }
            k.packets(("bsdf straight", name), 8.0, draws[..PACKETS].to_vec(), move |(wo, _)| model.straight(*wo));
        }
        // what lets all pass has no samples
        if lanes > 0.0 {
            k.packets(("bsdf sample", name), lanes, draws[..PACKETS].to_vec(), move |(wo, u)| model.sample(*wo, *u));
        }
        if B::DELTA {
            return Ok(());
        }
        let mut pairs: Vec<_> = draws.iter().zip(&samples).map(|((wo, _), s)| (*wo, s.wi)).collect();
        let mut used = vec![];
        for (wo, wi) in &pairs {
            let e = model.eval(*wo, *wi);
            for i in 0..8 {
                let v = expected.value(lane(*wo, i), lane(*wi, i));
                let what = format_args!("{name}: density from {:?} to {:?}", lane(*wo, i), lane(*wi, i)).to_string();
                close(what, f64::from(e.pdf.lane(i)), v.pdf, tolerance)?;
                k.note(("bsdf pdf", name), f64::from(e.pdf.lane(i)), v.pdf);
                for (f, got) in v.f.into_iter().zip(e.f.lane(i)) {
                    close(format_args!("{name}: value"), f64::from(got), f, tolerance)?;
                    k.note(("bsdf eval", name), f64::from(got), f);
                }
            }
            used.push(e.pdf.gt(F32x8::ZERO).count() as usize);
        }
        let lanes = mean_lanes(used.into_iter().take(PACKETS));
        pairs.truncate(PACKETS);
        k.packets(("bsdf eval", name), lanes, pairs.clone(), move |(wo, wi)| model.eval(*wo, *wi));
        k.packets(("bsdf pdf", name), lanes, pairs, move |(wo, wi)| model.eval(*wo, *wi).pdf);
        Ok(())
    }
}

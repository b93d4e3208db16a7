//! Stage `scatter`: eight samples of vertices of one class. Each sample is one scattered ray and, unless roulette
//! spares it, one light sample (EARS' atomic sample), combined by multiple importance sampling.

use super::flight::RayState8;
use super::ledger::{NO_BIN, NO_RECORD};
use super::settle::Found8;
use super::shard::Shard;
use super::vertex::{Batch, CLASSES, RINGS, Vertex8};
use crate::accel::{self, Intersector, Ray8};
use crate::bsdf::{self, Bsdf, Eval8, Inputs8, Sample8, Visitor};
use crate::light::{self, LightSample8, LightSelector, power_heuristic};
use crate::profile::Profile;
use crate::rng::Key8;
use crate::scene::Scene;
use crate::scene::blob::MaterialKind;
use crate::session::Session;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Random numbers of a sample: block 0 scatters, block 1 samples lights, block 2 plays for shadow rays.
const SCATTER_BLOCK: u32 = 0;
const LIGHT_BLOCK: u32 = 1;
const SHADOW_BLOCK: u32 = 2;

/// Samples of vertices that light samples are drawn for.
pub(super) struct LitSamples<'a> {
    pub vertex: &'a Vertex8,
    pub ledger: U32x8,
    pub key: Key8,
}

/// What one class's kernel does to a packet.
struct Scatter<'a, 's> {
    scene: &'a Scene<'s>,
    vertex: &'a Vertex8,
    active: Mask8,
    /// World directions of light samples; `None` where light sampling does not apply.
    light: Option<Vec3x8>,
    u: [F32x8; 3],
}

/// What comes out of it.
struct Scattered {
    /// Towards the light sample.
    light: Eval8,
    /// The scattered direction, world space in `wi`.
    sample: Sample8,
    /// The vertices' shading frames.
    frame: Frame8,
}

impl<'s> Visitor<'s> for Scatter<'_, 's> {
    type Out = Scattered;

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) -> Scattered {
        let v = self.vertex;
        let frame = Frame8::from_normal(v.ns);
        let wo = frame.to_local(v.wo);
        let inputs = Inputs8 { material: v.material, reflectance: v.reflectance };
        let b = B::gather(self.scene, &inputs, self.active);
        let light = match self.light {
            Some(wi) if !B::DELTA => b.eval(wo, frame.to_local(wi)),
            _ => Eval8 { f: Vec3x8::ZERO, pdf: F32x8::ZERO },
        };
        Scattered { light, sample: b.sample(wo, self.u), frame }
    }
}

impl Shard<'_> {
    /// Scatters a packet of the fullest ring, or of the next from which a sample fits.
    pub(super) fn scatter<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
    ) -> Option<RayState8> {
        let (fullest, _) = self.pool.fullest();
        let mut taken = self.take(fullest).map(|b| (fullest, b));
        for ring in 0..RINGS {
            taken = taken.or_else(|| self.take(ring).map(|b| (ring, b)));
        }
        let (ring, batch) = taken?;
        let v = &batch.vertex;
        let scene = session.scene();
        let kind = MaterialKind::ALL[ring % CLASSES];
        let active = Mask8::first(batch.lanes);
        self.counters.scatter.count(batch.lanes as u32);
        self.counters.vertex_samples += batch.lanes as u64;

        let lit = ring < CLASSES;
        let ledger = self.open_records(&batch, lit);
        let key = v.key.child(batch.sample);
        let [u0, u1, u2, _] = key.uniforms(SCATTER_BLOCK);
        let going = active & v.depth.lt(U32x8::splat(session.max_depth()));
        let delta = bsdf::delta_kinds() >> kind as u32 & 1 == 1;
        let light = if !lit || delta || going.none() || scene.lights.is_empty() {
            None
        } else {
            Some(sample_lights::<P>(scene, session, v, key, going))
        };
        let kernel = Scatter { scene, vertex: v, active, light: light.map(|l| l.wi), u: [u0, u1, u2] };
        let out = bsdf::dispatch_in(P::EFFECTS, kind, kernel)?;
        if let Some(l) = light {
            self.counters.distances_clamped += u64::from((going & l.clamped).count());
            self.light_contribution(session, &LitSamples { vertex: v, ledger, key }, &l, &out.light, going & l.valid);
        }

        let s = &out.sample;
        let wi = out.frame.to_world(s.wi);
        let beta = v.beta * s.weight;
        let flying = going & s.valid & beta.any_positive();
        let broken = going & s.valid & !beta.is_finite();
        let root = v.root.to_array();
        for i in broken.lanes() {
            self.count_non_finite(root[i]);
            self.ledger.mark_incomplete(ledger.lane(i));
        }
        let flying = flying.and_not(broken);
        self.close_lanes(active.and_not(flying), v.root, ledger, v.depth);
        Some(RayState8 {
            active: flying,
            ray: Ray8 { o: accel::offset(v.p, v.ng, v.error, wi), d: wi, tmin: F32x8::ZERO, tmax: F32x8::INFINITY },
            from: v.p,
            normal: v.ng,
            beta,
            weight: s.weight,
            pdf: s.pdf,
            alone: s.delta,
            root: v.root,
            ledger,
            key: key.child(U32x8::splat(0)),
            depth: v.depth + U32x8::splat(1),
            albedo_product: v.albedo_product,
            error_weight: v.error_weight,
        })
    }

    /// Takes samples from a ring and books them on their roots and ledger records: a lane each, less the vertex if it
    /// is drained.
    fn take(&mut self, ring: usize) -> Option<Batch> {
        let (roots, ledger) = (&mut self.roots, &mut self.ledger);
        self.pool.take(ring, |v, lanes, drained| {
            roots.get(v.root()).open += lanes - u32::from(drained);
            ledger.draw(v.ledger(), lanes, drained);
        })
    }

    /// A ledger record for each sample of a packet, as long as there are any.
    fn open_records(&mut self, batch: &Batch, lit: bool) -> U32x8 {
        let mut out = [NO_RECORD; 8];
        if self.ledger.is_on() {
            let parents = batch.vertex.ledger.to_array();
            for (record, &parent) in out.iter_mut().zip(&parents).take(batch.lanes) {
                if parent == NO_RECORD {
                    continue;
                }
                *record = self.ledger.open(parent, lit);
                if *record == NO_RECORD {
                    self.counters.ledger_full += 1;
                    self.ledger.mark_incomplete(parent);
                    self.settle_record(parent);
                }
            }
        }
        U32x8::new(out)
    }

    /// Adds the light samples' radiance where nothing is in the way.
    fn light_contribution<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        s: &LitSamples<'_>,
        l: &LightSample8,
        f: &Eval8,
        mask: Mask8,
    ) {
        let v = s.vertex;
        let weight = l.delta.select(F32x8::ONE, power_heuristic(l.pdf, f.pdf)) / (l.pdf * v.drawn);
        let radiance = v.beta * f.f * l.radiance * weight;
        let mut found = Found8 { pixel: radiance, local: f.f * l.radiance * weight };
        let mut mask = mask & (radiance.any_positive() | !radiance.is_finite());
        let towards = if mask.any() && self.job.settings.shadow_roulette {
            let towards = session.learned().bins_towards(v.bin, l.wi, mask);
            mask = self.shadow_roulette(session, s, towards, &mut found, mask);
            towards
        } else {
            U32x8::splat(NO_BIN)
        };
        if mask.none() {
            return;
        }
        let clear = self.occlude(session, s, l, mask);
        if self.training.is_some() {
            self.learn_light(s, towards, mask, clear, &found);
        }
        self.gather(clear, v.root, s.ledger, &found);
    }

    /// Plays roulette for shadow rays, of light samples in directions of the bins `bin`. The lanes that go on.
    fn shadow_roulette<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        s: &LitSamples<'_>,
        bin: U32x8,
        found: &mut Found8,
        mask: Mask8,
    ) -> Mask8 {
        let learned = session.learned();
        let p = learned.image8(s.vertex.error_weight).shadow_ray_probability(found.pixel, learned.visibility_root(bin));
        let [u, ..] = s.key.uniforms(SHADOW_BLOCK);
        let on = mask & (u.lt(p) | p.ge(F32x8::ONE));
        self.counters.shadow_rays_terminated += u64::from(mask.count() - on.count());
        found.pixel = found.pixel / p;
        found.local = found.local / p;
        on
    }

    /// Tells the statistics what came of the shadow rays of `traced`: those of `clear` met nothing, and found what they
    /// say. With roulette for light samples, `towards` are the bins of their directions.
    fn learn_light(&mut self, s: &LitSamples<'_>, towards: U32x8, traced: Mask8, clear: Mask8, found: &Found8) {
        let v = s.vertex;
        let logged = traced.and_not(s.ledger.eq(U32x8::splat(NO_RECORD)));
        if logged.none() {
            return;
        }
        let local = found.local * self.firefly_scale(clear & logged, found.pixel, v.root);
        let Some(training) = &mut self.training else { return };
        for i in (logged & towards.lt(U32x8::splat(NO_BIN))).lanes() {
            let taken = training.log_shadow(towards.lane(i), clear.lane(i));
            self.counters.shadows_refused += u64::from(!taken);
        }
        for i in (clear & logged).lanes() {
            let (x, scale) = (local.lane(i), self.ledger.scale(v.ledger.lane(i)));
            training.log_light(v.bin.lane(i), [0, 1, 2].map(|c| x[c] * scale[c]), v.drawn.lane(i));
        }
    }
}

/// One light sample per lane.
#[inline(never)]
fn sample_lights<P: Profile>(
    scene: &Scene<'_>,
    session: &Session<'_, '_, P, impl Intersector, impl LightSelector>,
    v: &Vertex8,
    key: Key8,
    active: Mask8,
) -> LightSample8 {
    light::sample_of(P::EFFECTS, scene, session.selector(), v.p, v.ng, key.words(LIGHT_BLOCK), active)
}

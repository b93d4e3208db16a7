//! Stage `roulette`: how many samples each arrived vertex gets. The masks n = 0 (the path ends) and n >= 1 (it waits with
//! n samples) are the packet's roulette masks; one comb rounds the whole packet.

use super::settle::Found8;
use super::shard::Shard;
use super::vertex::{RESERVE, Vertex8};
use crate::accel::Intersector;
use crate::bsdf::{self, Bsdf, Inputs8, Visitor};
use crate::learn::cache::Kind;
use crate::profile::Profile;
use crate::rrs::{self, Learned8, Space, Vertices8};
use crate::scene::Scene;
use crate::scene::blob::MaterialKind;
use crate::session::Session;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Albedos below this are taken for this when samples are logged.
const DARKEST: f32 = 1e-3;

/// Phong exponent of a perfect mirror.
const MIRROR_SHININESS: f32 = 1e4;

/// Eight vertices that paths have arrived at.
pub(super) struct Arrival8 {
    pub vertex: Vertex8,
    /// Weight of the bounce that led here.
    pub weight: Vec3x8,
    /// [`MaterialKind`] per lane.
    pub kind: [u32; 8],
    pub active: Mask8,
}

struct AlbedoOf<'a, 's> {
    scene: &'a Scene<'s>,
    vertex: &'a Vertex8,
    mask: Mask8,
}

impl<'s> Visitor<'s> for AlbedoOf<'_, 's> {
    type Out = Vec3x8;

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) -> Vec3x8 {
        let v = self.vertex;
        let inputs = Inputs8 { material: v.material, reflectance: v.reflectance };
        let wo = Frame8::from_normal(v.ns).to_local(v.wo);
        B::gather(self.scene, &inputs, self.mask).albedo(wo)
    }
}

/// Albedos of eight vertices of any classes.
fn albedo<P: Profile>(scene: &Scene<'_>, a: &Arrival8) -> Vec3x8 {
    let mut out = Vec3x8::ZERO;
    let mut left = a.active.bits();
    while left != 0 {
        let kind = a.kind[left.trailing_zeros() as usize & 7];
        let bits = a.active.lanes().filter(|&i| a.kind[i] == kind).fold(0, |m, i| m | 1 << i);
        left &= !bits;
        let mask = Mask8::from_bits(bits);
        let of = MaterialKind::from_u32(kind)
            .and_then(|k| bsdf::dispatch_in(P::EFFECTS, k, AlbedoOf { scene, vertex: &a.vertex, mask }));
        out = Vec3x8::select(mask, of.unwrap_or(Vec3x8::ONE), out);
    }
    out
}

/// Blocks of a vertex's random numbers beyond those of its samples, see `scatter`.
const JITTER_BLOCK: u32 = 3;

/// Where a vertex's samples are logged, and how its bin's values become its own.
struct Place8 {
    bin: U32x8,
    /// Samples are logged times this.
    scale: Vec3x8,
    /// What was logged counts times this here.
    unscale: Vec3x8,
}

/// Kinds without a preferred direction but the normal.
const MATTE: u32 = 1 << MaterialKind::Diffuse as u32;

/// Kinds that light passes through: what they show hangs on the viewing direction.
const THROUGH: u32 = 1 << MaterialKind::Dielectric as u32
    | 1 << MaterialKind::RoughDielectric as u32
    | 1 << MaterialKind::ThinDielectric as u32
    | 1 << MaterialKind::Null as u32;

fn lanes_of(kinds: u32, a: &Arrival8) -> Mask8 {
    Mask8::from_bits((0..8).fold(0, |m, i| m | (kinds >> (a.kind[i] & 31) & 1) << i))
}

/// 1 / x where x is at least `floor`, 0 elsewhere.
fn inverse(x: Vec3x8, floor: f32) -> Vec3x8 {
    let one = |x: F32x8| x.ge(F32x8::splat(floor)).zero_unless(F32x8::ONE / x.max(F32x8::splat(floor)));
    Vec3x8::new(one(x.x), one(x.y), one(x.z))
}

/// The bins of arrived vertices. What matte surfaces reflect hangs on where they face; what shiny ones reflect on the
/// mirrored direction; what others let through on the viewing direction. Samples are logged over the albedo, so that a
/// texture or a black and a white thing in one cell do not pass for noise.
fn place<P: Profile, I: Intersector>(
    session: &Session<'_, '_, P, I>,
    a: &Arrival8,
    albedo: Vec3x8,
    space: Space,
    mut root_film: impl FnMut(usize) -> u32,
) -> Place8 {
    let v = &a.vertex;
    let knowledge = session.knowledge();
    match space {
        Space::Scene => {
            let [u0, u1, u2, _] = v.key.uniforms(JITTER_BLOCK);
            let mirrored = v.ns * (v.ns.dot(v.wo) * F32x8::splat(2.0)) - v.wo;
            let matte = lanes_of(MATTE, a);
            let dir = Vec3x8::select(lanes_of(THROUGH, a), v.wo, Vec3x8::select(matte, v.ns, mirrored));
            let seen = v.depth.eq(U32x8::splat(1));
            let kind = U32x8::select(matte, U32x8::splat(Kind::Matte as u32), U32x8::splat(Kind::Shiny as u32));
            let first = U32x8::splat(Kind::FirstMatte as u32 - Kind::Matte as u32);
            let kind = kind + U32x8::select(seen, first, U32x8::splat(0));
            let known = if knowledge.weighs_pixels() { a.active } else { a.active.and_not(seen) };
            let bin = knowledge.scene_bins(kind, v.p, dir, [u0, u1, u2], known);
            // in one cell bright pixels see bright samples: only their ratio is alike
            // however many samples the pixel has in this iteration
            let own: [_; 8] = core::array::from_fn(|i| match seen.lane(i) && a.active.lane(i) {
                true => knowledge.pixel_importance(root_film(i)),
                false => [1.0; 3],
            });
            let pixel = inverse(Vec3x8::from_fn(|i| own[i]), f32::MIN_POSITIVE);
            let pixel = Vec3x8::new(pixel.x.sqrt(), pixel.y.sqrt(), pixel.z.sqrt());
            let unscale = Vec3x8::select(seen, pixel, albedo);
            Place8 { bin, scale: inverse(unscale, DARKEST), unscale }
        }
        Space::Image => {
            let depth = v.depth.to_array();
            let mut bin = [0; 8];
            for i in a.active.lanes() {
                bin[i] = knowledge.image_bin(root_film(i), depth[i]);
            }
            Place8 { bin: U32x8::new(bin), scale: v.beta, unscale: inverse(v.beta, f32::MIN_POSITIVE) }
        }
    }
}

/// Phong exponents that correspond to the materials' GGX widths: 2 / alpha^2 - 2.
fn shininess(scene: &Scene<'_>, a: &Arrival8) -> F32x8 {
    let material = a.vertex.material.to_array();
    F32x8::from_fn(|i| {
        let m = scene.materials.get(material[i] as usize);
        match MaterialKind::from_u32(a.kind[i]) {
            Some(MaterialKind::Diffuse | MaterialKind::Plastic | MaterialKind::RoughPlastic) | None => 0.0,
            Some(MaterialKind::RoughConductor | MaterialKind::RoughDielectric) => {
                m.map_or(0.0, |m| (2.0 / (m.alpha * m.alpha) - 2.0).clamp(0.0, MIRROR_SHININESS))
            }
            Some(_) => MIRROR_SHININESS,
        }
    })
}

impl Shard<'_> {
    /// Rounds the factors of a packet and stores what goes on.
    pub(super) fn roulette<P: Profile, I: Intersector>(&mut self, session: &Session<'_, '_, P, I>, a: Arrival8) {
        let settings = *self.plan.settings();
        let strategy = settings.strategy;
        let knowledge = session.knowledge();
        let mut v = a.vertex;
        let albedo = if strategy.needs_albedo() { albedo::<P>(session.scene(), &a) } else { Vec3x8::ZERO };
        let mut logged = None;
        let mut learned = Learned8::NONE;
        if strategy.needs_image() {
            learned = knowledge.image8(self.importance(v.root, a.active));
        }
        if let Some(space) = strategy.space() {
            let root = v.root.to_array();
            let found = place(session, &a, albedo, space, |i| self.roots.get(root[i]).film);
            knowledge.local8(&mut learned, found.bin, found.unscale, a.active);
            self.counters.look_ups.count(a.active.count());
            logged = Some(found);
        }
        let s = strategy.factor(&Vertices8 {
            beta: v.beta,
            last_weight: a.weight,
            albedo,
            albedo_product: v.albedo_product,
            depth: v.depth,
            shininess: if strategy.needs_shininess() { shininess(session.scene(), &a) } else { F32x8::ZERO },
            learned,
        });
        let [least, most] = settings.learning.factors;
        let s = if logged.is_some() { s.clamp(least, most) } else { s };
        let s = self.bound(s, v.root, a.active);
        let n = rrs::comb(a.active.zero_unless(s), self.comb_bits());
        self.record_factors(a.active, s, &v);
        if let Some(c) = settings.constant.of(&learned) {
            // what the samples rounded away, or added, is expected to have given (Szecsi et al. 2003)
            let rounded = F32x8::ONE - F32x8::from_fn(|i| n[i] as f32) / s;
            let found = Found8 { pixel: v.beta * c * rounded, local: a.weight * c * rounded };
            self.gather(a.active, v.root, v.ledger, &found);
        }
        if let Some(p) = logged {
            self.record_places(a.active, &v, &p, a.weight / s);
        }
        v.beta = v.beta / s;
        v.albedo_product *= albedo.mean();
        v.count = U32x8::new(n);
        let (root, ledger, depth) = (v.root.to_array(), v.ledger.to_array(), v.depth.to_array());
        let records = v.to_records();
        for i in a.active.lanes() {
            let Some(class) = MaterialKind::from_u32(a.kind[i]).filter(|_| n[i] > 0) else {
                self.counters.roulette_kills += 1;
                self.close(root[i], ledger[i], depth[i]);
                continue;
            };
            let extra = n[i] - 1;
            self.counters.splits += u64::from(extra);
            let r = self.roots.get(root[i]);
            r.splits = r.splits.saturating_add(extra);
            // the lane's share of `open` passes to the waiting vertex
            self.pool.push(class as usize, records[i]);
        }
    }

    /// What squared errors count in the pixels of eight roots.
    pub(super) fn importance(&mut self, root: U32x8, mask: Mask8) -> Vec3x8 {
        let root = root.to_array();
        let mut out = [[0.0; 3]; 8];
        for i in mask.lanes() {
            out[i] = self.roots.get(root[i]).importance;
        }
        Vec3x8::from_fn(|i| out[i])
    }

    /// Tells the samples that led here where the vertex's samples are logged and what they count.
    fn record_places(&mut self, active: Mask8, v: &Vertex8, place: &Place8, inner: Vec3x8) {
        let (ledger, bin) = (v.ledger.to_array(), place.bin.to_array());
        for i in active.lanes() {
            self.ledger.arrive(ledger[i], bin[i], place.scale.lane(i), inner.lane(i));
        }
    }

    /// Factors above 1 fall to 1 where waiting room or the camera sample's split budget is short: before any weight is
    /// computed, so that the estimate stays unbiased.
    fn bound(&mut self, s: F32x8, root: U32x8, active: Mask8) -> F32x8 {
        let splitting = active & s.gt(F32x8::ONE);
        if splitting.none() {
            return s;
        }
        let mut cut = Mask8::NONE;
        if self.pool.free() < active.count() as usize + RESERVE {
            cut = splitting;
            self.counters.ring_capped += u64::from(splitting.count());
        } else {
            let budget = self.plan.settings().split_budget;
            let root = root.to_array();
            let bits =
                splitting.lanes().filter(|&i| self.roots.get(root[i]).splits >= budget).fold(0, |m, i| m | 1 << i);
            cut |= Mask8::from_bits(bits);
            self.counters.budget_capped += u64::from(cut.count());
        }
        cut.select(F32x8::ONE, s)
    }

    fn record_factors(&mut self, active: Mask8, s: F32x8, v: &Vertex8) {
        if self.aovs.is_empty() {
            return;
        }
        let (s, root, depth) = (s.to_array(), v.root.to_array(), v.depth.to_array());
        for i in active.lanes() {
            let pixel = self.roots.get(root[i]).pixel as usize;
            if let Some(aov) = self.aovs.get_mut(pixel) {
                let d = (depth[i].clamp(1, 4) - 1) as usize;
                aov.factor[d] += f64::from(s[i]);
                aov.vertices[d] += 1.0;
            }
        }
    }
}

//! Scalar f64 oracle of every scattering model, from the textbook formulas (Walter et al. 2007, Heitz 2014, Fresnel's
//! equations over complex indices), written without looking at the vector code, and the table of cases under test.

pub use crate::model::Model;
use crate::quadrature::{jittered, midpoint};
use croupier::unstable::scene::blob::{MATERIAL_COMPENSATED, Material, MaterialKind, NONE};
use croupier::unstable::simd::Vec3x8;
use croupier_host::{compensation, microfacet};
use std::f64::consts::{FRAC_1_PI, PI, TAU};

/// A vector or colour.
pub type V = [f64; 3];

/// Dot product.
pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Sum of `a s` and `b t`.
pub fn combine(a: V, s: f64, b: V, t: f64) -> V {
    std::array::from_fn(|i| a[i] * s + b[i] * t)
}

/// Unit vector.
pub fn unit(a: V) -> V {
    let l = dot(a, a).sqrt();
    a.map(|x| x / l)
}

/// The unit vector in the xz plane turned by `phi`, at `degrees` from +z.
pub fn at_angle(degrees: f64, phi: f64) -> V {
    let t = degrees.to_radians();
    [t.sin() * phi.cos(), t.sin() * phi.sin(), t.cos()]
}

/// Reflectance of a dielectric by Snell and Fresnel; `n1` before the interface, `n2` behind.
pub fn fresnel_dielectric(cos: f64, n1: f64, n2: f64) -> f64 {
    let sin_t = n1 / n2 * (1.0 - cos * cos).max(0.0).sqrt();
    if sin_t >= 1.0 {
        return 1.0;
    }
    let cos_t = ((1.0 - sin_t) * (1.0 + sin_t)).sqrt();
    let s = (n1 * cos - n2 * cos_t) / (n1 * cos + n2 * cos_t);
    let p = (n2 * cos - n1 * cos_t) / (n2 * cos + n1 * cos_t);
    if n1 == n2 { 0.0 } else { (s * s + p * p) / 2.0 }
}

/// Reflectance of a conductor from the complex Fresnel equations.
pub fn fresnel_conductor(cos: f64, n: f64, k: f64) -> f64 {
    type C = (f64, f64);
    let mul = |a: C, b: C| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let norm = |a: C| a.0 * a.0 + a.1 * a.1;
    let eps = mul((n, k), (n, k));
    // sqrt(eps - sin^2), branch with a positive imaginary part
    let z = (eps.0 - (1.0 - cos * cos), eps.1);
    let r = norm(z).sqrt();
    let root = if z.0 >= 0.0 {
        let a = ((r + z.0) / 2.0).sqrt();
        (a, if a > 0.0 { z.1 / (2.0 * a) } else { 0.0 })
    } else {
        let b = ((r - z.0) / 2.0).sqrt();
        (z.1 / (2.0 * b), b)
    };
    let s = norm((cos - root.0, -root.1)) / norm((cos + root.0, root.1));
    let e = (eps.0 * cos, eps.1 * cos);
    let p = norm((e.0 - root.0, e.1 - root.1)) / norm((e.0 + root.0, e.1 + root.1));
    (s + p) / 2.0
}

/// GGX distribution of the unit normal `h`.
pub fn ggx_d(h: V, alpha: f64) -> f64 {
    let tan2 = (h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2]);
    1.0 / (PI * alpha * alpha * h[2].powi(4) * (1.0 + tan2 / (alpha * alpha)).powi(2))
}

/// Smith masking of `w` for the normal `h`.
pub fn ggx_g1(w: V, h: V, alpha: f64) -> f64 {
    if dot(w, h) * w[2] <= 0.0 {
        return 0.0;
    }
    let tan2 = (w[0] * w[0] + w[1] * w[1]) / (w[2] * w[2]);
    2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt())
}

/// `f |cos wi|` and density.
#[derive(Clone, Copy, Debug, Default)]
pub struct Value {
    /// Per channel.
    pub f: V,
    /// 1/sr.
    pub pdf: f64,
}

/// One parameter set of one model.
#[derive(Clone, Debug)]
pub struct Case {
    /// Model.
    pub kind: MaterialKind,
    /// Parameters as in the blob.
    pub material: Material,
    /// T table of a rough plastic.
    pub table: Vec<f32>,
}

/// A delta lobe.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    /// Direction.
    pub wi: V,
    /// Factor on radiance.
    pub weight: V,
}

impl Case {
    /// The case compensated for what single scattering loses, with its tables.
    pub fn compensated(mut self) -> Self {
        let (alpha, eta) = (self.alpha(), self.eta());
        let s = compensation::conductor(alpha);
        // not at the start, so that a lost offset shows
        self.table = vec![0.25; 5];
        self.material.table = 5;
        self.material.flags = MATERIAL_COMPENSATED;
        if self.kind == MaterialKind::RoughDielectric {
            self.table.extend(compensation::dielectric(alpha, eta).as_flattened().iter().map(|e| *e as f32));
            return self;
        }
        if self.kind == MaterialKind::RoughPlastic {
            let t = compensation::rough_plastic(alpha, eta, &s);
            self.material.fdr = t.r;
            self.table.extend(t.transmittance);
        }
        self.table.extend(s.map(|s| s as f32));
        self
    }

    /// Is it compensated?
    pub fn is_compensated(&self) -> bool {
        self.material.flags & MATERIAL_COMPENSATED != 0
    }

    /// A case from its parameters; plastics get their tables.
    pub fn new(kind: MaterialKind, reflectance: [f32; 3], eta: [f32; 3], k: [f32; 3], alpha: f32) -> Self {
        let mut material: Material = bytemuck::Zeroable::zeroed();
        material.kind = kind as u32;
        material.texture = NONE;
        material.table = NONE;
        (material.reflectance, material.eta, material.k, material.alpha) = (reflectance, eta, k, alpha);
        let mut table = vec![];
        if kind == MaterialKind::Plastic {
            material.fdr = microfacet::diffuse_fresnel_inside(f64::from(eta[0]));
        }
        if kind == MaterialKind::RoughPlastic {
            let t = microfacet::rough_plastic(f64::from(alpha), f64::from(eta[0]));
            // not at the start, so that a lost offset shows
            table = vec![0.25; 3];
            material.table = 3;
            material.fdr = t.r;
            table.extend(t.transmittance);
        }
        Self { kind, material, table }
    }

    /// For messages.
    pub fn name(&self) -> String {
        let m = &self.material;
        let compensated = if self.is_compensated() { "compensated " } else { "" };
        format!("{compensated}{} alpha {} eta {} k {}", self.kind.name(), m.alpha, m.eta[0], m.k[0])
    }

    /// Does `wo` below the surface scatter?
    pub fn two_sided(&self) -> bool {
        use MaterialKind::*;
        match self.kind {
            Dielectric | RoughDielectric | ThinDielectric | Null | Principled => true,
            Diffuse | Mirror | Conductor | RoughConductor | Plastic | RoughPlastic => false,
        }
    }

    /// Is transmission of a rough dielectric a delta lobe by contract?
    pub fn narrow(&self) -> bool {
        let contrast = (self.material.eta[0] - 1.0).abs();
        self.kind == MaterialKind::RoughDielectric && (contrast < 1e-4 || self.alpha() as f32 * contrast < 1e-5)
    }

    /// Width.
    pub fn alpha(&self) -> f64 {
        f64::from(self.material.alpha)
    }

    /// Relative index.
    pub fn eta(&self) -> f64 {
        f64::from(self.material.eta[0])
    }

    /// Index on the side of `w`.
    pub fn index(&self, w: V) -> f64 {
        let interface = matches!(self.kind, MaterialKind::Dielectric | MaterialKind::RoughDielectric);
        if w[2] < 0.0 && interface { self.eta() } else { 1.0 }
    }

    fn rho(&self) -> V {
        self.material.reflectance.map(f64::from)
    }

    /// rho / (1 - rho Fdr).
    fn base(&self) -> V {
        self.rho().map(|r| r / (1.0 - r * f64::from(self.material.fdr)))
    }

    /// T of a rough plastic, 1 - F of a smooth one.
    pub fn coat(&self, mu: f64) -> f64 {
        if self.kind == MaterialKind::Plastic {
            return 1.0 - fresnel_dielectric(mu, 1.0, self.eta());
        }
        let t = &self.table[self.material.table as usize..];
        let x = mu.clamp(0.0, 1.0) * 63.0;
        let i = (x as usize).min(62);
        f64::from(t[i]) + (x - i as f64) * (f64::from(t[i + 1]) - f64::from(t[i]))
    }

    /// Probability of the coat's lobe of a plastic.
    pub fn coat_share(&self, wo: V) -> f64 {
        let t = self.coat(wo[2]);
        let s = if self.kind == MaterialKind::Plastic { 1.0 - t } else { (1.0 - t).max(1.0 / 1024.0) };
        let base = self.base();
        let d = t * (1.0 - f64::from(self.material.fdr)) * (base[0] + base[1] + base[2]) / 3.0;
        s / (s + d)
    }

    /// Fresnel reflectance per channel at `cos` for light on the side of index `n1`.
    fn fresnel(&self, cos: f64, n1: f64) -> V {
        let m = &self.material;
        if self.kind == MaterialKind::RoughConductor || self.kind == MaterialKind::Conductor {
            let rho = self.rho();
            return std::array::from_fn(|i| rho[i] * fresnel_conductor(cos, f64::from(m.eta[i]), f64::from(m.k[i])));
        }
        let n2 = if n1 == 1.0 { self.eta() } else { 1.0 };
        [fresnel_dielectric(cos, n1, n2); 3]
    }

    /// Entry of the table of compensation that begins `skip` entries behind the start of this material's tables.
    fn compensation_entry(&self, skip: usize, mu: f64) -> f64 {
        let t = &self.table[self.material.table as usize + skip..][..64];
        // half of the entries by cosine, half by where the visible normals lie
        let by_width = mu * (1.0 + self.alpha()) / (mu + self.alpha());
        let x = 63.0 * ((mu + by_width) / 2.0).min(1.0);
        let i = (x as usize).min(62);
        f64::from(t[i]) + (x - i as f64) * (f64::from(t[i + 1]) - f64::from(t[i]))
    }

    /// What compensation makes of a Fresnel reflectance `f`, its factor included.
    fn with_compensation(&self, f: f64, wo: V, wi: V) -> f64 {
        let skip = if self.kind == MaterialKind::RoughPlastic { 64 } else { 0 };
        let m = self.compensation_entry(skip, wo[2]) * self.compensation_entry(skip, wi[2]);
        // a geometric series of 1 - 1 / m, attenuated by f each time
        f / (1.0 - f * (1.0 - 1.0 / m))
    }

    /// The microfacet part alone.
    pub fn microfacets(&self, wo: V, wi: V) -> Value {
        use MaterialKind::*;
        match self.kind {
            RoughConductor | RoughDielectric | RoughPlastic => {}
            Diffuse | Mirror | Conductor | Dielectric | ThinDielectric | Plastic | Null | Principled => {
                return Value::default();
            }
        }
        if wo[2] == 0.0 || wi[2] == 0.0 {
            return Value::default();
        }
        if self.kind != RoughDielectric && (wo[2] <= 0.0 || wi[2] <= 0.0) {
            return Value::default();
        }
        let (alpha, no, ni) = (self.alpha(), self.index(wo), self.index(wi));
        let reflects = wo[2] * wi[2] > 0.0;
        if !reflects && self.narrow() {
            return Value::default();
        }
        let h = unit(combine(wo, no, wi, ni));
        let h = if h[2] < 0.0 { h.map(|x| -x) } else { h };
        let (oh, ih) = (dot(wo, h), dot(wi, h));
        let (g_o, g_i) = (ggx_g1(wo, h, alpha), ggx_g1(wi, h, alpha));
        let d = ggx_d(h, alpha);
        let fresnel = self.fresnel(oh.abs(), no);
        let visible = g_o * oh.abs() * d / wo[2].abs();
        if g_o * g_i == 0.0 {
            return Value::default();
        }
        let dielectric = self.kind == RoughDielectric;
        let scale = match self.is_compensated() {
            true if dielectric => 1.0 / self.compensation_entry(if wo[2] > 0.0 { 0 } else { 64 }, wo[2].abs()),
            _ => 1.0,
        };
        if reflects {
            let raised = |r| if self.is_compensated() && !dielectric { self.with_compensation(r, wo, wi) } else { r };
            let f = fresnel.map(|r| scale * raised(r) * d * g_o * g_i / (4.0 * wo[2].abs()));
            let lobe = if self.kind == RoughDielectric { fresnel[0] } else { 1.0 };
            return Value { f, pdf: lobe * visible / (4.0 * oh.abs()) };
        }
        let denominator = (ni * ih + no * oh).powi(2);
        let through = 1.0 - fresnel[0];
        let f = scale * (ih * oh / wo[2]).abs() * no * no * through * g_o * g_i * d / denominator;
        Value { f: [f; 3], pdf: through * visible * ni * ni * ih.abs() / denominator }
    }

    /// The diffuse part alone; its density without the share of the lobe.
    pub fn diffuse(&self, wo: V, wi: V) -> Value {
        if wo[2] <= 0.0 || wi[2] <= 0.0 {
            return Value::default();
        }
        use MaterialKind::*;
        let pdf = wi[2] * FRAC_1_PI;
        match self.kind {
            Diffuse => Value { f: self.rho().map(|r| r * pdf), pdf },
            Plastic | RoughPlastic => {
                let scale = self.coat(wo[2]) * self.coat(wi[2]) / self.eta().powi(2) * pdf;
                Value { f: self.base().map(|r| r * scale), pdf }
            }
            Mirror | Conductor | RoughConductor | Dielectric | RoughDielectric | ThinDielectric | Null | Principled => {
                Value::default()
            }
        }
    }

    /// All that is not a delta lobe.
    pub fn eval(&self, wo: V, wi: V) -> Value {
        let (m, d) = (self.microfacets(wo, wi), self.diffuse(wo, wi));
        let f = combine(m.f, 1.0, d.f, 1.0);
        match self.kind {
            MaterialKind::Plastic | MaterialKind::RoughPlastic => {
                let s = self.coat_share(wo);
                Value { f, pdf: s * m.pdf + (1.0 - s) * d.pdf }
            }
            _ => Value { f, pdf: m.pdf + d.pdf },
        }
    }

    /// The delta lobes.
    pub fn lobes(&self, wo: V) -> Vec<Lobe> {
        use MaterialKind::*;
        let mirror = |weight: V| Lobe { wi: [-wo[0], -wo[1], wo[2]], weight };
        let through = |w: f64| Lobe { wi: wo.map(|x| -x), weight: [w; 3] };
        if wo[2] <= 0.0 && !self.two_sided() {
            return vec![];
        }
        let no = self.index(wo);
        let cos = wo[2].abs();
        match self.kind {
            Mirror => vec![mirror(self.rho())],
            Conductor => vec![mirror(self.fresnel(cos, 1.0))],
            Plastic => vec![mirror(self.fresnel(cos, 1.0))],
            Null => vec![through(1.0)],
            ThinDielectric => {
                let r = self.fresnel(cos, 1.0)[0];
                vec![mirror([2.0 * r / (1.0 + r); 3]), through(1.0 - 2.0 * r / (1.0 + r))]
            }
            Dielectric => {
                let (r, ni) = (self.fresnel(cos, no)[0], if wo[2] > 0.0 { self.eta() } else { 1.0 });
                let mut lobes = vec![mirror([r; 3])];
                if r < 1.0 {
                    let (x, y) = (-wo[0] * no / ni, -wo[1] * no / ni);
                    let z = (1.0 - x * x - y * y).max(0.0).sqrt().copysign(-wo[2]);
                    lobes.push(Lobe { wi: [x, y, z], weight: [(1.0 - r) * no * no / (ni * ni); 3] });
                }
                lobes
            }
            Diffuse | RoughConductor | RoughDielectric | RoughPlastic | Principled => vec![],
        }
    }

    /// Where `m` (unit, m.z > 0) mirrors `wo` or lets it through, and d wi / d m; `None` where it cannot.
    pub fn through_facet(&self, wo: V, m: V, reflect: bool) -> Option<(V, f64)> {
        let c = dot(wo, m);
        if c * wo[2] <= 0.0 {
            return None;
        }
        if reflect {
            let wi = combine(m, 2.0 * c, wo, -1.0);
            return (wi[2] * wo[2] > 0.0).then_some((wi, 4.0 * c.abs()));
        }
        let (no, ni) = if wo[2] > 0.0 { (1.0, self.eta()) } else { (self.eta(), 1.0) };
        let s2 = (1.0 - c * c) * (no / ni).powi(2);
        if s2 >= 1.0 || no == ni {
            return None;
        }
        let ct = (1.0 - s2).sqrt() * -c.signum();
        let wi = combine(combine(m, c, wo, -1.0), no / ni, m, ct);
        let jacobian = (no * c + ni * ct).powi(2) / (ni * ni * ct.abs());
        (wi[2] * wo[2] < 0.0).then_some((wi, jacobian))
    }

    /// The normal of the half-vector coordinates (s, t) in the unit square, tan = alpha tan(pi s / 2), which spread GGX
    /// normals evenly enough for quadrature at grazing angles, and its measure d m / (ds dt).
    pub fn facet(&self, s: f64, t: f64) -> (V, f64) {
        let (alpha, stretched) = (self.alpha(), (s * PI / 2.0).tan());
        let tan = alpha * stretched;
        let z = 1.0 / (1.0 + tan * tan).sqrt();
        let m = [tan * z * (TAU * t).cos(), tan * z * (TAU * t).sin(), z];
        // d m = sin dtheta dphi, dtheta = z^2 dtan
        (m, tan * z.powi(3) * alpha * (1.0 + stretched * stretched) * (PI / 2.0) * TAU)
    }

    /// The coordinates of [`Self::facet`] of the normal that takes `wo` to `wi`, and whether it reflects.
    pub fn facet_coordinates(&self, wo: V, wi: V) -> (f64, f64, bool) {
        let reflect = wo[2] * wi[2] > 0.0;
        let h = unit(combine(wo, self.index(wo), wi, self.index(wi)));
        let h = if h[2] < 0.0 { h.map(|x| -x) } else { h };
        let tan2 = (h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2]);
        let t = h[1].atan2(h[0]) / TAU;
        ((tan2.sqrt() / self.alpha()).atan() * 2.0 / PI, if t < 0.0 { t + 1.0 } else { t }, reflect)
    }

    /// Integral over `wi` by quadrature: of f cos and of the density, delta lobes and the density of [`Self::narrow`]
    /// transmission excluded.
    pub fn integral(&self, wo: V, n: usize) -> Value {
        let mut sum = Value::default();
        let n = if self.alpha() > 0.0 { n } else { 0 };
        for (_, [s, t]) in jittered(n, n) {
            let (m, dm) = self.facet(s, t);
            for reflect in [true, false] {
                let Some((wi, d)) = self.through_facet(wo, m, reflect) else { continue };
                let v = self.microfacets(wo, wi);
                let weight = d * dm / (n * n) as f64;
                sum.pdf += v.pdf * weight;
                sum.f = combine(sum.f, 1.0, v.f, weight);
            }
        }
        let diffuse = midpoint(4096, 0.0, 1.0, |z| self.diffuse(wo, [(1.0 - z * z).sqrt(), 0.0, z]).f[0] * TAU);
        if self.kind == MaterialKind::Diffuse {
            return Value { f: self.rho(), pdf: 1.0 };
        }
        if matches!(self.kind, MaterialKind::Plastic | MaterialKind::RoughPlastic) {
            let (s, base) = (self.coat_share(wo), self.base());
            sum.f = std::array::from_fn(|i| sum.f[i] + diffuse * base[i] / base[0]);
            sum.pdf = s * sum.pdf + (1.0 - s);
        }
        sum
    }
}

/// Every model with parameter sets from narrow to wide and from weak to strong contrast.
pub fn cases() -> &'static [Case] {
    static CASES: std::sync::OnceLock<Vec<Case>> = std::sync::OnceLock::new();
    CASES.get_or_init(all_cases)
}

fn all_cases() -> Vec<Case> {
    use MaterialKind::*;
    let colour = [0.8, 0.5, 0.02];
    let (gold, gold_k) = ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603]);
    let zero = [0.0; 3];
    let mut all = vec![
        Case::new(Diffuse, colour, zero, zero, 0.0),
        Case::new(Mirror, colour, zero, zero, 0.0),
        Case::new(Conductor, [1.0, 0.9, 0.5], gold, gold_k, 0.0),
        Case::new(Conductor, [1.0; 3], [0.01, 1.5, 4.0], [100.0, 0.0, 1e4], 0.0),
        Case::new(Null, zero, zero, zero, 0.0),
    ];
    for eta in [1.0, 1.0001, 1.33, 1.5, 2.4] {
        for e in [eta, 1.0 / eta] {
            all.push(Case::new(Dielectric, zero, [e; 3], zero, 0.0));
            all.push(Case::new(ThinDielectric, zero, [e; 3], zero, 0.0));
        }
        all.push(Case::new(Plastic, colour, [eta; 3], zero, 0.0));
    }
    for alpha in [1e-3, 0.02, 0.2, 1.0] {
        all.push(Case::new(RoughConductor, [1.0, 0.9, 0.5], gold, gold_k, alpha));
        all.push(Case::new(RoughConductor, [1.0; 3], [1.5, 0.01, 1.0], [0.0, 100.0, 1e4], alpha));
        for eta in [1.0, 1.0001, 1.01, 1.5, 2.4] {
            for e in [eta, 1.0 / eta] {
                all.push(Case::new(RoughDielectric, zero, [e; 3], zero, alpha));
            }
        }
        for eta in [1.0001, 1.5, 2.4] {
            all.push(Case::new(RoughPlastic, colour, [eta; 3], zero, alpha));
        }
    }
    all.push(Case::new(Plastic, colour, [1.0 / 1.5; 3], zero, 0.0));
    all.push(Case::new(RoughPlastic, colour, [1.0 / 1.5; 3], zero, 0.3));
    for alpha in [1e-3, 0.02, 0.2, 1.0] {
        all.push(Case::new(RoughConductor, [1.0, 0.9, 0.5], gold, gold_k, alpha).compensated());
        for eta in [1.0, 1.5, 1.0 / 1.5] {
            all.push(Case::new(RoughDielectric, zero, [eta; 3], zero, alpha).compensated());
        }
        all.push(Case::new(RoughPlastic, colour, [1.5; 3], zero, alpha).compensated());
    }
    all
}

/// Panics unless `tried` has every kind that `wanted` asks for: a row of the table without a case in this test. The
/// principled material has an oracle and tests of its own (`tests/bsdf_principled.rs`).
#[track_caller]
pub fn assert_every_kind(tried: &[MaterialKind], wanted: impl Fn(&MaterialKind) -> bool) {
    let missing: Vec<_> = MaterialKind::ALL.iter().filter(|k| wanted(k) && !tried.contains(k)).collect();
    let missing: Vec<_> = missing.into_iter().filter(|k| **k != MaterialKind::Principled).collect();
    assert!(missing.is_empty(), "no case of {missing:?}");
}

/// Has it lobes that `eval` knows?
pub fn has_density(kind: &MaterialKind) -> bool {
    !kind.facts().delta
}

/// Viewing angles in degrees, normal to grazing.
pub const ANGLES: [f64; 6] = [0.0, 15.0, 45.0, 75.0, 89.0, 89.99];

/// Viewing directions of a case: [`ANGLES`], and their mirror images below where the model has two sides.
pub fn views(case: &Case) -> Vec<V> {
    let above = ANGLES.iter().enumerate().map(|(i, &a)| at_angle(a, 0.4 + 1.1 * i as f64));
    let mut all: Vec<V> = above.collect();
    if case.two_sided() {
        all.extend(all.clone().iter().map(|w| [w[0], w[1], -w[2]]));
    }
    all
}

/// The same direction in all lanes.
pub fn splat(w: V) -> Vec3x8 {
    Vec3x8::splat(w[0] as f32, w[1] as f32, w[2] as f32)
}

/// Lane `i` as exact f64.
pub fn lane(v: Vec3x8, i: usize) -> V {
    v.lane(i).map(f64::from)
}

//! Where and in which directions lights emit.

use super::super::area;
use super::super::shape::sides;
use crate::scene::Scene;
use crate::scene::blob::{Light, LightKind};
use croupier_simd::{F32x8, Vec3x8};

/// Largest offset of a point from a middle: all points are in front.
const BEHIND_ALL: f32 = -f32::MAX;

/// What bounds the emission of one light or of several; see [`LightNode`](crate::scene::blob::LightNode).
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub middle: [f32; 3],
    pub radius: f32,
    pub axis: [f32; 3],
    pub cos: f32,
    pub sin: f32,
    pub front: f32,
    pub weight: f32,
}

pub(super) fn sqrt(x: f32) -> f32 {
    F32x8::splat(x).sqrt().lane(0)
}

pub(super) fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    core::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The unit vector along `v`; none of what has no length.
pub(super) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let length = Vec3x8::splat(v[0], v[1], v[2]).length().lane(0);
    let out = v.map(|x| x / length);
    (length > 0.0 && out.iter().all(|x| x.is_finite())).then_some(out)
}

impl Extent {
    /// A ball that emits in all directions.
    fn ball(middle: [f32; 3], radius: f32, weight: f32) -> Self {
        Self { middle, radius, axis: [0.0, 0.0, 1.0], cos: -1.0, sin: 0.0, front: BEHIND_ALL, weight }
    }

    /// Lights at infinity.
    pub(super) fn infinite(weight: f32) -> Self {
        Self::ball([0.0; 3], f32::INFINITY, weight)
    }

    /// Something flat around `middle` that emits to the side of its unit normal only.
    fn flat(middle: [f32; 3], radius: f32, axis: [f32; 3], weight: f32) -> Self {
        Self { middle, radius, axis, cos: 1.0, sin: 0.0, front: 0.0, weight }
    }

    /// Is it flat?
    pub(super) fn is_flat(&self) -> bool {
        self.cos == 1.0 && self.front > BEHIND_ALL
    }

    /// The light `index`, chosen with `probability` by power, in a scene whose radius squared is `square`. `None` if
    /// it is never chosen or its place is no number.
    pub(super) fn of(scene: &Scene<'_>, index: u32, light: &Light, probability: f32, square: f32) -> Option<Self> {
        let [a, b, c, d, e, f] = light.params;
        let at = light.vector;
        // irradiance at distance 1 in front of it over power, times pi
        let out = match LightKind::from_u32(light.kind)? {
            LightKind::Area => {
                let (corners, normal) = area::in_world(scene, index, light);
                let [p, q, r] = corners;
                let middle: [f32; 3] = core::array::from_fn(|i| (p[i] + q[i] + r[i]) / 3.0);
                let farthest = corners.map(|k| dot(sub(k, middle), sub(k, middle)));
                let radius = sqrt(farthest.into_iter().fold(0.0, f32::max));
                match unit(normal) {
                    Some(axis) => Self::flat(middle, radius, axis, probability),
                    None => Self::ball(middle, radius, probability),
                }
            }
            LightKind::Environment => Self::infinite(0.25 * probability / square),
            LightKind::Directional | LightKind::Sun => Self::infinite(probability / square),
            LightKind::Point => Self::ball(at, 0.0, 0.25 * probability),
            LightKind::Spot => {
                // 1 - cos of the outer and of the inner half angle
                let (cos, share) = ((1.0 - d).max(-1.0), 2.0 * (e + (d - e) / 3.0));
                let sin = sqrt((1.0 - cos * cos).max(0.0));
                let weight = probability / share.max(f32::MIN_POSITIVE);
                Self { axis: [a, b, c], cos, sin, ..Self::ball(at, 0.0, weight) }
            }
            LightKind::Sphere => Self::ball(at, a, 0.25 * probability),
            LightKind::Rectangle => {
                let (u, v) = ([a, b, c], [d, e, f]);
                let normal = [b * f - c * e, c * d - a * f, a * e - b * d];
                let radius = sqrt(dot(u, u) + dot(v, v));
                Self::sided(light, at, radius, unit(normal), probability)
            }
            LightKind::Disk => Self::sided(light, at, d, unit([a, b, c]), probability),
        };
        let finite = out.middle.iter().chain(&out.axis).all(|x| x.is_finite()) && out.weight.is_finite();
        (probability > 0.0 && out.weight > 0.0 && finite && !out.radius.is_nan()).then_some(out)
    }

    /// A flat light with one side or two.
    fn sided(light: &Light, middle: [f32; 3], radius: f32, normal: Option<[f32; 3]>, probability: f32) -> Self {
        match normal.filter(|_| sides(light) == 1.0) {
            Some(axis) => Self::flat(middle, radius, axis, probability),
            None => Self::ball(middle, radius, 0.5 * probability),
        }
    }
}

/// Bounds of several lights in the making: what all of them add to, then how far each reaches.
pub(super) struct Group {
    low: [f32; 3],
    high: [f32; 3],
    normals: [f32; 3],
    weight: f32,
    infinite: bool,
}

impl Group {
    pub(super) const EMPTY: Self =
        Self { low: [f32::MAX; 3], high: [-f32::MAX; 3], normals: [0.0; 3], weight: 0.0, infinite: false };

    pub(super) fn add(&mut self, e: &Extent) {
        self.weight += e.weight;
        self.infinite |= !e.radius.is_finite();
        for i in 0..3 {
            self.low[i] = self.low[i].min(e.middle[i] - e.radius);
            self.high[i] = self.high[i].max(e.middle[i] + e.radius);
            self.normals[i] += e.axis[i] * e.weight;
        }
    }

    /// The start of the bounds, which [`Self::reach`] then widens for every light.
    pub(super) fn begin(&self) -> Extent {
        if self.infinite {
            return Extent::infinite(self.weight);
        }
        let middle = core::array::from_fn(|i| 0.5 * self.low[i] + 0.5 * self.high[i]);
        let axis = unit(self.normals).unwrap_or([0.0, 0.0, 1.0]);
        Extent { middle, radius: 0.0, axis, cos: 1.0, sin: 0.0, front: f32::MAX, weight: self.weight }
    }

    /// Widens bounds so that they hold a light.
    pub(super) fn reach(out: &mut Extent, e: &Extent) {
        if !out.radius.is_finite() {
            return;
        }
        let d = sub(e.middle, out.middle);
        // rounded up, so that the light is inside
        out.radius = out.radius.max((sqrt(dot(d, d)) + e.radius) * (1.0 + 1e-5));
        let along = dot(e.axis, out.axis);
        if e.is_flat() && along > 1.0 - 1e-6 {
            let slack = 1e-5 * out.radius;
            out.front = out.front.min(dot(d, out.axis) - slack);
        } else {
            out.front = BEHIND_ALL;
        }
        // cosine of the sum of the angles to the light's axis and of its own cone, at most pi
        let cos_between = (along - 1e-6).clamp(-1.0, 1.0);
        let sin_between = sqrt((1.0 - cos_between * cos_between).max(0.0));
        let sin = sin_between * e.cos + cos_between * e.sin;
        let cos = if sin < 0.0 { -1.0 } else { cos_between * e.cos - sin_between * e.sin };
        if cos < out.cos {
            let cos = cos.max(-1.0);
            (out.cos, out.sin) = (cos, sqrt((1.0 - cos * cos).max(0.0)));
        }
    }
}

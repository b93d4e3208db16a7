//! Which of two hits is right, by the tests' oracle over all triangles (`judge`, in f64).

use crate::embree::Hit;
use crate::rays::Tri;
use croupier_tests::geometry::{Ray, Verdict, judge};

/// What f64 cannot tell, in units of the operands: two roundings of products of differences, which are exact for
/// coordinates of one scene.
const EXACT: f64 = 1e-14;
/// What is granted to f32, as much as in the tests of traversal: a hit that this makes doubtful is at the edge of its
/// triangle, seen edge-on, or at the end of the ray.
const ROUNDING: f64 = 1e-5;

/// What a hit is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finding {
    /// Nothing exact speaks against it.
    Right,
    /// A triangle that the ray meets before is missed.
    Misses {
        /// Is it met within rounding of its edge?
        edge: bool,
    },
    /// A triangle that the ray does not meet is hit.
    Adds {
        /// Does it pass within rounding of the edge?
        edge: bool,
    },
}

/// A triangle near a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    pub triangle: u32,
    exact: Verdict,
    rounded: Verdict,
}

/// All triangles of a scene.
pub(crate) struct Oracle<'a> {
    triangles: &'a [Tri],
    /// Centre and squared radius of a ball around each.
    balls: Vec<[f64; 4]>,
}

impl<'a> Oracle<'a> {
    pub(crate) fn new(triangles: &'a [Tri]) -> Self {
        let ball = |t: &Tri| {
            let p = t.map(|p| p.map(f64::from));
            let c = [0, 1, 2].map(|k| (p[0][k] + p[1][k] + p[2][k]) / 3.0);
            let radius = p.iter().map(|p| square([0, 1, 2].map(|k| p[k] - c[k]))).fold(0.0, f64::max);
            [c[0], c[1], c[2], radius]
        };
        Self { triangles, balls: triangles.iter().map(ball).collect() }
    }

    /// The triangles that the ray meets or passes within rounding.
    pub(crate) fn near(&self, ray: &Ray) -> Vec<Near> {
        let (o, d) = (ray.o.map(f64::from), ray.d.map(f64::from));
        let length = square(d);
        let passes = |b: &[f64; 4]| {
            let c = [b[0] - o[0], b[1] - o[1], b[2] - o[2]];
            let along = dot(c, d);
            // the distance of the centre from the line, against the radius and what `judge` grants
            (square(c) - along * along / length).sqrt() <= 1.001 * b[3].sqrt() + 1e-4 * square(c).sqrt()
        };
        let judged = |(i, _): (usize, _)| {
            let [exact, rounded] = [EXACT, ROUNDING].map(|slack| judge(ray, &self.triangles[i], slack));
            Near { triangle: i as u32, exact, rounded }
        };
        let near = self.balls.iter().enumerate().filter(|(_, b)| passes(b)).map(judged);
        near.filter(|n| n.exact != Verdict::Miss || n.rounded != Verdict::Miss).collect()
    }

    /// Is neither hit before the other by more than rounding?
    pub(crate) fn level(&self, ray: &Ray, a: u32, b: u32) -> bool {
        let t = |i: u32| parameter(judge(ray, &self.triangles[i as usize], ROUNDING));
        let Some((s, t)) = t(a).zip(t(b)) else { return false };
        !self.before(ray, (a, s), (b, t)) && !self.before(ray, (b, t), (a, s))
    }

    /// Is `s` nearer than `t` to where the ray meets the triangle?
    pub(crate) fn nearer(&self, ray: &Ray, triangle: u32, s: f32, t: f32) -> bool {
        let exact = parameter(judge(ray, &self.triangles[triangle as usize], EXACT)).unwrap_or(0.0);
        (f64::from(s) - exact).abs() < (f64::from(t) - exact).abs()
    }

    /// Is triangle `a`, met at `s`, before `b`, met at `t`, by more than the rounding of either?
    fn before(&self, ray: &Ray, (a, s): (u32, f64), (b, t): (u32, f64)) -> bool {
        let missed = |i: u32, ray: &Ray| judge(ray, &self.triangles[i as usize], ROUNDING) == Verdict::Miss;
        s < t && missed(a, &Ray { tmin: t as f32, ..*ray }) && missed(b, &Ray { tmax: s as f32, ..*ray })
    }

    /// What a closest hit is worth.
    pub(crate) fn closest(&self, ray: &Ray, near: &[Near], hit: Hit) -> Finding {
        let sure = near.iter().filter_map(|n| if let Verdict::Hit(t) = n.exact { Some((n, t)) } else { None });
        let nearest = sure.min_by(|a, b| a.1.total_cmp(&b.1));
        let missed = nearest.map(|(n, _)| Finding::Misses { edge: !matches!(n.rounded, Verdict::Hit(_)) });
        let Some((_, triangle)) = hit else { return missed.unwrap_or(Finding::Right) };
        let Some(found) = near.iter().find(|n| n.triangle == triangle) else { return Finding::Adds { edge: false } };
        let t = parameter(found.exact).or(parameter(found.rounded)).unwrap_or(f64::INFINITY);
        let at = nearest.map(|(n, t)| (n.triangle, t));
        if at.is_some_and(|at| self.before(ray, at, (triangle, t))) {
            return missed.unwrap_or(Finding::Right);
        }
        let early = at.is_none_or(|at| self.before(ray, (triangle, t), at));
        if found.exact == Verdict::Miss && early { Finding::Adds { edge: true } } else { Finding::Right }
    }

    /// What it is worth that anything is met.
    pub(crate) fn any(near: &[Near], met: bool) -> Finding {
        let sure = |v: Verdict| matches!(v, Verdict::Hit(_));
        if !met {
            let clear = near.iter().any(|n| sure(n.exact) && sure(n.rounded));
            return match near.iter().any(|n| sure(n.exact)) {
                true => Finding::Misses { edge: !clear },
                false => Finding::Right,
            };
        }
        match near.iter().any(|n| n.exact != Verdict::Miss) {
            true => Finding::Right,
            false => Finding::Adds { edge: !near.is_empty() },
        }
    }

    /// The nearest triangle that the ray certainly meets, in words.
    pub(crate) fn nearest(near: &[Near]) -> String {
        let sure = near.iter().filter_map(|n| if let Verdict::Hit(t) = n.exact { Some((t, n.triangle)) } else { None });
        match sure.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((t, triangle)) => format!("{t:.9} {triangle}"),
            None => "none".into(),
        }
    }
}

fn parameter(v: Verdict) -> Option<f64> {
    match v {
        Verdict::Miss => None,
        Verdict::Hit(t) | Verdict::Close(t) => Some(t),
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn square(a: [f64; 3]) -> f64 {
    dot(a, a)
}

//! Kernels of lights with shapes, against f64: where samples lie, that their density is that of the shape's solid angle
//! and what a ray in the same direction states, that they fill it evenly, and what they add up to.

use croupier::unstable::light::{LightSample8, PowerSelector, ShapeRays8, meet_shapes, nearest_shape};
use croupier::unstable::scene::blob::LightKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::hit::sample;
use croupier_tests::light_oracle::{V, cross, dot, length, polygon_irradiance, sub, unit, wide};
use croupier_tests::light_scene::LightScene;
use std::f64::consts::{PI, TAU};

const BELOW_ONE: f64 = 1.0 - 1.0 / 16_777_216.0;

/// One light and a point that it is seen from.
#[derive(Clone, Copy, Debug)]
struct Case {
    kind: LightKind,
    middle: [f32; 3],
    params: [f32; 6],
    p: [f32; 3],
}

impl Case {
    fn sphere(middle: [f32; 3], radius: f32, p: [f32; 3]) -> Self {
        Self { kind: LightKind::Sphere, middle, params: [radius, 0.0, 0.0, 0.0, 0.0, 0.0], p }
    }

    fn rectangle(middle: [f32; 3], [u, v]: [[f32; 3]; 2], p: [f32; 3]) -> Self {
        let params = [u[0], u[1], u[2], v[0], v[1], v[2]];
        Self { kind: LightKind::Rectangle, middle, params, p }
    }

    fn disk(middle: [f32; 3], [x, y, z]: [f32; 3], radius: f32, p: [f32; 3]) -> Self {
        Self { kind: LightKind::Disk, middle, params: [x, y, z, radius, 0.0, 0.0], p }
    }

    /// All lengths times `scale`, a power of two.
    fn scaled(self, scale: f32) -> Self {
        let mut params = self.params.map(|x| x * scale);
        if self.kind == LightKind::Disk {
            params[..3].copy_from_slice(&self.params[..3]);
        }
        Self { middle: self.middle.map(|x| x * scale), params, p: self.p.map(|x| x * scale), ..self }
    }

    fn scene(&self) -> LightScene {
        LightScene::default().shape(self.kind, self.middle, &self.params, [1.0; 3])
    }

    /// Middle as seen from the point.
    fn offset(&self) -> V {
        sub(wide(self.middle), wide(self.p))
    }

    fn radius(&self) -> f64 {
        f64::from(self.params[if self.kind == LightKind::Disk { 3 } else { 0 }])
    }

    /// Of a rectangle: unit vectors along the shorter edge, the longer one and the normal; half lengths.
    fn axes(&self) -> ([V; 3], [f64; 2]) {
        let [u, v] = [[0, 1, 2], [3, 4, 5]].map(|k| k.map(|k| f64::from(self.params[k])));
        let n = unit(cross(u, v));
        let (short, long) = if length(v) < length(u) { (v, u) } else { (u, v) };
        ([unit(short), unit(long), n], [length(short), length(long)])
    }

    /// Unit normal of a flat shape.
    fn normal(&self) -> V {
        if self.kind == LightKind::Disk {
            unit(wide([self.params[0], self.params[1], self.params[2]]))
        } else {
            self.axes().0[2]
        }
    }

    /// A sphere around everything: distances relative to it are rounded by some 1e-7.
    fn extent(&self) -> f64 {
        length(wide(self.middle))
            + length(wide(self.p))
            + self.params.iter().fold(0.0, |m: f64, x| m.max(f64::from(x.abs())))
    }
}

/// Solid angle of the rectangle `x` by `y` in a plane at distance h: four arc tangents.
fn rectangle_solid_angle(x: [f64; 2], y: [f64; 2], h: f64) -> f64 {
    let part = |x: f64, y: f64| (x * y / (h * (x * x + y * y + h * h).sqrt())).atan();
    part(x[1], y[1]) - part(x[0], y[1]) - part(x[1], y[0]) + part(x[0], y[0])
}

/// Samples of the only light of a scene at `p`, in the order of `u`.
fn samples(s: &LightScene, p: [f32; 3], u: &[[f64; 2]]) -> Vec<LightSample8> {
    let scene = s.scene();
    let word = |x: f64| (x.clamp(0.0, BELOW_ONE) * 4_294_967_296.0) as u32;
    let packet = |u: &[[f64; 2]]| {
        let words = [0, 1].map(|k| U32x8::from_fn(|i| word(u[i][k])));
        let words = [U32x8::splat(0), words[0], words[1], U32x8::splat(0)];
        let p = Vec3x8::splat(p[0], p[1], p[2]);
        sample(&scene, &PowerSelector(scene), p, Vec3x8::ZERO, words, Mask8::all_lanes())
    };
    u.chunks_exact(8).map(packet).collect()
}

/// Midpoints of n by n squares.
fn grid(n: usize) -> Vec<[f64; 2]> {
    (0..n * n).map(|k| [k / n, k % n].map(|k| (k as f64 + 0.5) / n as f64)).collect()
}

/// What rays from `p` in the directions of samples meet: lanes, density.
fn meet(s: &LightScene, p: [f32; 3], l: &LightSample8) -> (Mask8, F32x8) {
    let scene = s.scene();
    let rays = ShapeRays8 {
        p: Vec3x8::splat(p[0], p[1], p[2]),
        d: l.wi,
        after: F32x8::ZERO,
        upto: F32x8::INFINITY,
        mask: l.valid,
        camera: Mask8::NONE,
    };
    let mut out = (Mask8::NONE, F32x8::ZERO);
    meet_shapes(&scene, &PowerSelector(scene), &rays, Vec3x8::ZERO, Mask8::all_lanes(), |met, radiance, pdf| {
        assert_eq!(radiance.x.to_array(), [1.0; 8]);
        out = (met, pdf);
    });
    assert_eq!(nearest_shape(&scene, &rays).is_finite().bits(), out.0.bits());
    out
}

const SQUARE: [[f32; 3]; 2] = [[0.5, 0.0, 0.0], [0.0, 0.0, 0.5]];
const TILTED: [[f32; 3]; 2] = [[0.6, 0.8, 0.0], [-0.4, 0.3, 0.25]];

/// Lights as they are seen from points in front of them: in the middle, at an edge, a corner, low above the plane within
/// and beyond, far away, near, needles.
fn cases() -> Vec<Case> {
    let mut all = vec![
        Case::sphere([1.0, 2.0, -0.5], 0.7, [0.0; 3]),
        Case::sphere([1.0, 2.0, -0.5], 2.25, [0.0; 3]),
        // nearly a hemisphere
        Case::sphere([0.0, 1.0, 0.0], 1.0 - 1e-3, [0.0; 3]),
        Case::sphere([0.0, 1.0, 0.0], 1.0 - 1e-5, [0.0; 3]),
        Case::sphere([300.0, -400.0, 100.0], 0.01, [1.0, 2.0, 3.0]),
        Case::sphere([0.0, 1e6, 1e5], 1.0, [0.0; 3]),
        Case::sphere([0.0, 1e6, 1e5], 1e-6, [0.0; 3]),
        Case::sphere([0.0, 1e-6, 2e-6], 1e-6, [0.0; 3]),
        Case::sphere([1e6, 2e6, 0.0], 2e6, [0.0; 3]),
    ];
    // points relative to the square, whose front is down
    for p in [
        [0.0f32, -1.0, 0.0],
        [0.5, -1.0, 0.0],
        [0.5, -1.0, 0.5],
        [0.1, -0.01, -0.2],
        [0.1, -1e-4, -0.2],
        [0.7, -0.1, 0.2],
        [0.7, -0.1, -0.9],
        [0.501, -0.01, 0.3],
        [0.499, -1e-3, -0.499],
        [-0.6, -1e-3, 0.0],
        [-0.6, -0.3, 0.1],
        [3.0, -1.0, -4.0],
        [0.0, -1000.0, 0.0],
        [1000.0, -10.0, 300.0],
        [1e6, -1e5, 0.0],
    ] {
        all.push(Case::rectangle([0.0; 3], SQUARE, p).facing());
        all.push(Case::rectangle([0.25, 0.0, -0.5], [[50.0, 0.0, 0.0], [0.0, 0.0, 0.01]], p).facing());
        all.push(Case::rectangle([2.0, 1.0, 0.75], TILTED, p).facing());
        all.push(Case::disk([0.0; 3], [0.0, -1.0, 0.0], 0.5, p));
        all.push(Case::disk([2.0, 1.0, 0.5], [0.36, -0.8, 0.48], 1.5, p).facing());
    }
    let scaled: Vec<Case> = all.iter().flat_map(|c| [-20i32, 20].map(|k| c.scaled(2f32.powi(k)))).collect();
    all.extend(scaled);
    // the ends of the range of coordinates and sizes
    let huge = [[1e9, 0.0, 0.0], [0.0, 0.0, 1e9]];
    all.push(Case::rectangle([0.0, 1e9, 1e9], huge, [0.0, -1e9, -1e9]).facing());
    all.push(Case::rectangle([1e9, 1e9, 0.0], huge, [-1e9, -1e9, -1e9]).facing());
    all.push(Case::rectangle([1e9, 1e9, 0.0], huge.map(|e| e.map(|x| 1e-18 * x)), [-1e9, -1e9, -1e9]).facing());
    all.push(Case::disk([0.0, 1e9, 1e9], [0.0, -1.0, 0.0], 1e9, [0.0, -1e9, -1e9]));
    all.push(Case::disk([0.0, 1e9, 1e9], [0.0, -1.0, 0.0], 1e-9, [0.0, -1e9, -1e9]));
    all.push(Case::sphere([0.0, 1e9, 1e9], 1e9, [0.0, -1e9, -1e9]));
    all.push(Case::sphere([0.0, 1e9, 1e9], 1e-9, [0.0, -1e9, -1e9]));
    all
}

impl Case {
    /// The light turned round if the point is behind it.
    fn facing(mut self) -> Self {
        if dot(self.offset(), self.normal()) > 0.0 {
            for k in 0..3 {
                self.params[k] = -self.params[k];
            }
        }
        self
    }

    /// Density of directions to the light, and of which part of the directions drawn; `t` is the distance of the point.
    fn density(&self, to_point: V) -> f64 {
        let (offset, r2) = (self.offset(), dot(to_point, to_point));
        let by_area = |area: f64| r2 / (area * dot(to_point, self.normal()).abs() / r2.sqrt());
        match self.kind {
            LightKind::Sphere => {
                let (d2, radius) = (dot(offset, offset), self.radius());
                let sin2 = radius * radius / d2;
                // 1 - cos without cancellation
                1.0 / (TAU * sin2 / (1.0 + (1.0 - sin2).sqrt()))
            }
            LightKind::Rectangle => {
                let solid_angle = self.solid_angle();
                let [a, b] = self.axes().1;
                if solid_angle >= 1.0 / 64.0 { 1.0 / solid_angle } else { by_area(4.0 * a * b) }
            }
            _ => {
                let (n, radius) = (self.normal(), self.radius());
                let h = dot(offset, n);
                let x = (dot(offset, offset) - h * h).max(0.0).sqrt();
                let square = rectangle_solid_angle([x - radius, x + radius], [-radius, radius], h.abs());
                let near = dot(offset, offset) < (1.25 * radius).powi(2) && square >= 1.0 / 64.0;
                if near { 1.0 / square } else { by_area(PI * radius * radius) }
            }
        }
    }

    /// Solid angle of a rectangle.
    fn solid_angle(&self) -> f64 {
        let ([u, v, n], [a, b]) = self.axes();
        let o = self.offset();
        let [x, y, h] = [dot(o, u), dot(o, v), dot(o, n).abs()];
        rectangle_solid_angle([x - a, x + a], [y - b, y + b], h)
    }

    /// How far a point is from the light, relative to its size and place.
    fn distance(&self, q: V) -> f64 {
        let w = sub(q, wide(self.middle));
        let off = match self.kind {
            LightKind::Sphere => (length(w) - self.radius()).abs(),
            LightKind::Rectangle => {
                let ([u, v, n], [a, b]) = self.axes();
                (dot(w, u).abs() - a).max(dot(w, v).abs() - b).max(0.0) + dot(w, n).abs()
            }
            _ => {
                let h = dot(w, self.normal());
                ((dot(w, w) - h * h).max(0.0).sqrt() - self.radius()).max(0.0) + h.abs()
            }
        };
        off / self.extent()
    }
}

/// Samples are points of the light in the direction that they state, their density is that of f64, and a ray in that
/// direction meets the light and states the same density. Killed by: a frame that is mirrored, a point at the far side, the
/// area of another shape, 1 - cos by subtraction, a solid angle as a difference of angles, a density that forgets which
/// technique is used.
#[test]
fn samples_lie_on_lights_and_densities_agree() {
    for case in cases() {
        let s = case.scene().select_by(&[1.0]);
        let (mut valid, mut missed, all) = (0, 0, grid(32));
        for l in samples(&s, case.p, &all) {
            let (met, pdf) = meet(&s, case.p, &l);
            for i in l.valid.lanes() {
                valid += 1;
                let (wi, q) = (wide(l.wi.lane(i)), wide(l.point.lane(i)));
                assert!((length(wi) - 1.0).abs() < 1e-6, "{case:?}: {wi:?}");
                assert!(case.distance(q) < 1e-6, "{case:?}: {q:?} is off by {:e}", case.distance(q));
                let to_point = sub(q, wide(case.p));
                let off = length(cross(to_point, wi)) / case.extent();
                assert!(off < 2e-6 && dot(to_point, wi) > 0.0, "{case:?}: the point is off the ray by {off:e}");
                // the cosine at the light is of a difference that is rounded with the coordinates
                let height = dot(case.offset(), if case.kind == LightKind::Sphere { wi } else { case.normal() }).abs();
                let rounding = 2e-5 + 1e-6 * case.extent() / height;
                let rounding = if case.kind == LightKind::Sphere { 1e-3 } else { rounding };
                let (stated, wanted) = (f64::from(l.pdf.lane(i)), case.density(to_point));
                assert!((stated / wanted - 1.0).abs() < rounding, "{case:?}: {stated} for {wanted}");
                if met.lane(i) {
                    let of_ray = f64::from(pdf.lane(i));
                    assert!((stated / of_ray - 1.0).abs() < rounding, "{case:?}: {stated}, the ray has {of_ray}");
                } else {
                    missed += 1;
                }
            }
        }
        assert!(valid >= all.len() / 2, "{case:?}: {valid} valid samples");
        // what is smaller than a direction's rounding is missed at its edge
        let size = if case.kind == LightKind::Sphere {
            case.radius()
        } else {
            case.density(case.offset()).sqrt().recip() * length(case.offset())
        };
        let allowed = 0.004 + 2e-6 * case.extent() / size;
        assert!(f64::from(missed) <= allowed * f64::from(valid as u32), "{case:?}: {missed} of {valid} rays miss");
    }
}

/// Sorted, both marginals of samples in a grid are the grid's: the solid angle up to the sample's x, and what of the
/// strip there lies below its y, both over the whole. Killed by: an inversion that is right for some u only, one that
/// loses its digits near the plane or for needles, a swap of the axes that forgets the middle.
#[test]
fn rectangles_and_spheres_are_filled_evenly() {
    let n = 64;
    let mut tried = 0;
    for case in cases() {
        let (offset, s) = (case.offset(), case.scene().select_by(&[1.0]));
        let mut marginals = [vec![], vec![]];
        let mut add = |a: f64, b: f64| {
            marginals[0].push(a);
            marginals[1].push(b);
        };
        match case.kind {
            LightKind::Rectangle if case.solid_angle() >= 1.0 / 64.0 => {
                let ([u, v, normal], [a, b]) = case.axes();
                let (cx, cy, h) = (dot(offset, u), dot(offset, v), dot(offset, normal).abs());
                let y = [cy - b, cy + b];
                let root = |x: f64, y: f64| y / (x * x + y * y + h * h).sqrt();
                for l in samples(&s, case.p, &grid(n)) {
                    for i in l.valid.lanes() {
                        // the point: near the plane a direction's rounding moves far points
                        let w = sub(wide(l.point.lane(i)), wide(case.p));
                        let at = [dot(w, u), dot(w, v)];
                        let first = rectangle_solid_angle([cx - a, at[0]], y, h) / case.solid_angle();
                        add(first, (root(at[0], at[1]) - root(at[0], y[0])) / (root(at[0], y[1]) - root(at[0], y[0])));
                    }
                }
            }
            LightKind::Sphere if case.radius() / length(offset) > 1e-3 => {
                let axis = unit(offset);
                let across = unit(cross(axis, [0.3, 0.2, 0.9]));
                let third = cross(axis, across);
                let cone = 1.0 / (TAU * case.density(offset));
                for l in samples(&s, case.p, &grid(n)) {
                    for i in l.valid.lanes() {
                        let w = wide(l.wi.lane(i));
                        let d = sub(w, axis);
                        add(dot(d, d) / 2.0 / cone, (dot(w, third).atan2(dot(w, across)) / TAU).rem_euclid(1.0));
                    }
                }
            }
            _ => continue,
        }
        tried += 1;
        for (k, marginal) in marginals.iter_mut().enumerate() {
            assert_eq!(marginal.len(), n * n, "{case:?}: samples that are not valid");
            marginal.sort_by(f64::total_cmp);
            // angles start anywhere
            let turn = if case.kind == LightKind::Sphere && k == 1 { 1.0 / n as f64 } else { 0.0 };
            let worst = marginal.iter().enumerate().map(|(i, x)| (x - ((i / n) as f64 + 0.5) / n as f64).abs());
            let worst = worst.fold(0.0, f64::max);
            assert!(worst < 1e-3 + turn, "{case:?}: marginal {k} is off by {worst}");
        }
    }
    assert!(tried > 60, "{tried} cases");
}

/// Irradiance over the emission of a surface of this normal by the samples of a grid.
fn irradiance(case: &Case, s: &LightScene, n: V) -> f64 {
    let all = grid(256);
    let mut sum = 0.0;
    for l in samples(s, case.p, &all) {
        for i in l.valid.lanes() {
            let cos = dot(wide(l.wi.lane(i)), n).max(0.0);
            sum += f64::from(l.radiance.lane(i)[0]) * cos / f64::from(l.pdf.lane(i));
        }
    }
    sum / all.len() as f64
}

/// What a sphere gives a surface of the cosine `cos` to its middle, whose horizon may cut it; by quadrature over its cone.
fn sphere_irradiance(sin_max: f64, cos: f64) -> f64 {
    let (n, cone) = (2000, 1.0 - (1.0 - sin_max * sin_max).sqrt());
    let sin = (1.0 - cos * cos).sqrt();
    let mut sum = 0.0;
    for i in 0..n {
        let z = 1.0 - cone * (f64::from(i) + 0.5) / f64::from(n);
        let r = (1.0 - z * z).sqrt();
        for k in 0..n {
            sum += (z * cos + r * sin * (PI * (f64::from(k) + 0.5) / f64::from(n)).cos()).max(0.0);
        }
    }
    sum * TAU * cone / f64::from(n * n)
}

/// Spheres above the horizon (closed form), cut by it, below it. Killed by: a cone of another size, a cosine of the
/// middle alone.
#[test]
fn spheres_light_like_their_cone() {
    for (sin_max, cos) in
        [(0.1, 0.8), (0.7, 0.9), (0.999, 1.0), (0.5, 0.3), (0.9, 0.1), (0.9, -0.3), (0.3, -0.5), (1e-5, 0.5)]
    {
        for scale in [-20i32, 0, 20] {
            let case = Case::sphere([0.0, 0.0, 2.0], 2.0 * sin_max as f32, [0.0; 3]).scaled(2f32.powi(scale));
            let s = case.scene().select_by(&[1.0]);
            let n = [(1.0f64 - cos * cos).sqrt(), 0.0, cos];
            let above = cos > sin_max;
            let wanted = if above { PI * sin_max * sin_max * cos } else { sphere_irradiance(sin_max, cos) };
            let got = irradiance(&case, &s, n);
            assert!((got - wanted).abs() <= 1e-3 * wanted, "{sin_max} {cos} {scale}: {got} for {wanted}");
        }
    }
}

/// Lambert's formula for all rectangles, Howell's configuration factors B-14 and B-15 for disks. Killed by: a solid angle
/// of one half of the rectangle, missed samples of a disk that are drawn again without their share.
#[test]
fn rectangles_and_disks_light_by_formula() {
    for case in cases() {
        let (offset, s) = (case.offset(), case.scene().select_by(&[1.0]));
        let got = |n: V| irradiance(&case, &s, n);
        let up = [0.0, 1.0, 0.0];
        let (found, wanted) = match case.kind {
            // by area a grid is too coarse for what is near a needle
            LightKind::Rectangle if case.solid_angle() < 1.0 / 64.0 && case.axes().1[1] > length(offset) => continue,
            LightKind::Rectangle => {
                let [u, v] = [[0, 1, 2], [3, 4, 5]].map(|k| k.map(|k| f64::from(case.params[k])));
                let corner = |s: f64, t: f64| -> V { std::array::from_fn(|k| offset[k] + s * u[k] + t * v[k]) };
                (
                    got(up),
                    polygon_irradiance(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]),
                )
            }
            LightKind::Disk => {
                let n = case.normal().map(|x| -x);
                let height = dot(offset, n);
                let lateral: V = std::array::from_fn(|k| offset[k] - n[k] * height);
                let l = length(lateral);
                let radius = case.radius();
                if l < 1e-9 * radius {
                    (got(n), PI * radius * radius / (radius * radius + height * height))
                } else {
                    let (h, r) = (height / l, radius / l);
                    let z = 1.0 + h * h + r * r;
                    let root = (z * z - 4.0 * r * r).sqrt();
                    // facing the disk, and turned by a right angle towards its axis
                    let side = PI * h / 2.0 * (z / root - 1.0);
                    let facing = PI / 2.0 * (1.0 - (1.0 + h * h - r * r) / root);
                    if r > 1e-3 && r < 1.0 && h > 1e-3 {
                        let found = got(unit(lateral));
                        // much of it comes from the horizon, where the disk ends
                        assert!((found - side).abs() <= 0.02 * side, "{case:?}: {found} for {side} from the side");
                    }
                    if r <= 1e-3 {
                        continue;
                    }
                    (got(n), facing)
                }
            }
            _ => continue,
        };
        // the height above the plane is a difference of coordinates
        let height = dot(offset, case.normal()).abs();
        let tolerance = 4e-3 + 1e-6 * case.extent() / height;
        assert!((found - wanted).abs() <= tolerance * wanted.max(1e-12), "{case:?}: {found} for {wanted}");
    }
}

/// Nothing comes from the back, along the plane, or to the inside of a sphere, and nothing is NaN; of a light of both
/// sides it does. Inside of a sphere it comes from everywhere. Killed by: a side that is not asked for, a sphere whose
/// inside has the cone of its outside.
#[test]
fn sides_that_do_not_emit_are_black() {
    for (case, lit) in [
        (Case::rectangle([0.0; 3], SQUARE, [0.1, 1.0, 0.2]), true),
        (Case::rectangle([0.0; 3], SQUARE, [0.1, 0.0, 0.2]), false),
        (Case::rectangle([0.0; 3], SQUARE, [2.0, 0.0, 0.2]), false),
        (Case::rectangle([0.0; 3], SQUARE, [0.5, 0.0, 0.5]), false),
        (Case::disk([0.0; 3], [0.0, -1.0, 0.0], 0.5, [0.1, 1.0, 0.2]), true),
        (Case::disk([0.0; 3], [0.0, -1.0, 0.0], 0.5, [0.0, 0.0, 0.0]), false),
        (Case::disk([0.0; 3], [0.0, -1.0, 0.0], 0.5, [0.5, 0.0, 0.0]), false),
        (Case::disk([0.0; 3], [0.0, -1.0, 0.0], 0.5, [3.0, 0.0, 0.0]), false),
        (Case::sphere([1.0, 2.0, 3.0], 2.0, [1.5, 1.0, 2.5]), true),
        (Case::sphere([1.0, 2.0, 3.0], 2.0, [1.0, 2.0, 3.0]), true),
        (Case::sphere([0.0, 1.0, 0.0], 1.0, [0.0; 3]), true),
    ] {
        let one = case.scene().select_by(&[1.0]);
        let two = case.scene().two_sided().select_by(&[1.0]);
        let count = |s: &LightScene| {
            samples(s, case.p, &grid(16))
                .iter()
                .map(|l| {
                    let (met, pdf) = meet(s, case.p, l);
                    assert!((met.and_not(pdf.is_finite())).none(), "{case:?}");
                    l.valid.count()
                })
                .sum::<u32>()
        };
        let (front, both) = (count(&one), count(&two));
        assert_eq!(front, 0, "{case:?}: from the back");
        assert_eq!(both > 0, lit, "{case:?}: {both} samples of both sides");
        if case.kind == LightKind::Sphere {
            assert_eq!(both, 256, "{case:?}");
            let got = irradiance(&case, &two, [0.0, 0.6, 0.8]);
            assert!((got - PI).abs() < 1e-3 * PI, "{case:?}: {got} inside");
        }
    }
}

//! Elementary functions and operations of the SIMD layer, against f64.

use super::{Kernels, Outcome, PACKETS, close, expect};
use croupier::unstable::simd::{F32x8, Frame8, Vec3x8};
use croupier_tests::math::{BINARY, UNARY, error_ulp};
use croupier_tests::stats::SplitMix;

const GROUP: &str = "math";

/// A range of arguments.
type Range = [f64; 2];

fn arguments(rng: &mut SplitMix, [lo, hi]: Range) -> Vec<F32x8> {
    (0..PACKETS).map(|_| F32x8::from_fn(|_| rng.range(lo, hi) as f32)).collect()
}

/// Adds `f` over one argument; its error is at most `ulp` of the exact `want`.
fn one(
    k: &mut Kernels,
    rng: &mut SplitMix,
    name: &str,
    range: Range,
    f: impl Fn(F32x8) -> F32x8 + 'static,
    (want, ulp): (impl Fn(f64) -> f64, f64),
) -> Outcome {
    let inputs = arguments(rng, range);
    for x in &inputs {
        let y = f(*x);
        for i in 0..8 {
            let error = error_ulp(y.lane(i), want(f64::from(x.lane(i))));
            expect(error <= ulp, format_args!("{name}({}): {} is off by {error} ULP", x.lane(i), y.lane(i)))?;
        }
    }
    k.packets((GROUP, name), 8.0, inputs, move |x| f(*x));
    Ok(())
}

/// Adds `f` over two arguments, as [`one`].
fn two(
    k: &mut Kernels,
    rng: &mut SplitMix,
    name: &str,
    ranges: [Range; 2],
    f: impl Fn(F32x8, F32x8) -> F32x8 + 'static,
    (want, ulp): (impl Fn(f64, f64) -> f64, impl Fn(f64, f64) -> f64),
) -> Outcome {
    let [a, b] = ranges.map(|r| arguments(rng, r));
    let inputs: Vec<_> = a.into_iter().zip(b).collect();
    for (a, b) in &inputs {
        let y = f(*a, *b);
        for i in 0..8 {
            let (a, b) = (f64::from(a.lane(i)), f64::from(b.lane(i)));
            let error = error_ulp(y.lane(i), want(a, b));
            expect(error <= ulp(a, b), format_args!("{name}({a}, {b}): {} is off by {error} ULP", y.lane(i)))?;
        }
    }
    k.packets((GROUP, name), 8.0, inputs, move |(a, b)| f(*a, *b));
    Ok(())
}

pub(super) fn add(k: &mut Kernels) -> Outcome {
    let rng = &mut SplitMix(1);
    // the oracles and promises are those of the tests
    for u in &UNARY {
        let promise = (u.oracle, u.bound());
        match u.name {
            "exp" => one(k, rng, u.name, [-20.0, 20.0], |x| x.exp(), promise)?,
            "ln" => one(k, rng, u.name, [1e-6, 1e3], |x| x.ln(), promise)?,
            "sin_2pi" => one(k, rng, u.name, [0.0, 1.0], |x| x.sin_cos_2pi().0, promise)?,
            "cos_2pi" => one(k, rng, u.name, [0.0, 1.0], |x| x.sin_cos_2pi().1, promise)?,
            "acos" => one(k, rng, u.name, [-1.0, 1.0], |x| x.acos(), promise)?,
            "asin" => one(k, rng, u.name, [-1.0, 1.0], |x| x.asin(), promise)?,
            other => return Err(format!("no microbenchmark of {other}")),
        }
    }
    for b in &BINARY {
        let promise = (b.oracle, b.bound);
        match b.name {
            "powf" => two(k, rng, b.name, [[0.1, 10.0], [-3.0, 3.0]], F32x8::powf, promise)?,
            "atan2" => two(k, rng, b.name, [[-4.0, 4.0]; 2], F32x8::atan2, promise)?,
            other => return Err(format!("no microbenchmark of {other}")),
        }
    }
    one(k, rng, "sqrt", [0.0, 100.0], F32x8::sqrt, (f64::sqrt, 0.5))?;
    one(k, rng, "floor", [-100.0, 100.0], F32x8::floor, (f64::floor, 0.0))?;
    two(k, rng, "divide", [[-9.0, 9.0], [1.0, 9.0]], |a, b| a / b, (|a, b| a / b, |_, _| 0.5))?;
    vectors(k, rng)
}

fn vectors(k: &mut Kernels, rng: &mut SplitMix) -> Outcome {
    let anywhere: Vec<Vec3x8> =
        (0..PACKETS).map(|_| Vec3x8::from_fn(|_| [(); 3].map(|()| rng.range(-5.0, 5.0) as f32))).collect();
    let unit: Vec<Vec3x8> = (0..PACKETS).map(|_| Vec3x8::from_fn(|_| rng.direction().map(|x| x as f32))).collect();
    let length = |v: Vec3x8, i: usize| v.lane(i).map(|x| f64::from(x).powi(2)).iter().sum::<f64>().sqrt();
    for v in &anywhere {
        for (name, n) in [("normalize", v.normalize()), ("normalize_fast", v.normalize_fast())] {
            for i in 0..8 {
                close(format_args!("length of {name}"), length(n, i), 1.0, 3e-7)?;
                let along = f64::from(n.dot(*v).lane(i));
                close(format_args!("direction of {name}"), along / length(*v, i), 1.0, 5e-7)?;
            }
        }
    }
    for (n, v) in unit.iter().zip(&anywhere) {
        let frame = Frame8::from_normal(*n);
        let back = frame.to_world(frame.to_local(*v)) - *v;
        for i in 0..8 {
            close("z of the normal in its own frame", f64::from(frame.to_local(*n).z.lane(i)), 1.0, 4e-7)?;
            close("to_world of to_local", length(back, i), 0.0, 4e-6)?;
        }
    }
    k.packets((GROUP, "normalize"), 8.0, anywhere.clone(), |v| v.normalize());
    k.packets((GROUP, "normalize_fast"), 8.0, anywhere.clone(), |v| v.normalize_fast());
    k.packets((GROUP, "frame of a normal"), 8.0, unit.clone(), |n| Frame8::from_normal(*n));
    let pairs: Vec<_> = unit.into_iter().zip(anywhere).collect();
    k.packets((GROUP, "frame and to_local"), 8.0, pairs, |(n, v)| Frame8::from_normal(*n).to_local(*v));
    Ok(())
}

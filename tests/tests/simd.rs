//! The eight-lane types: masks, selection, minima, rounding, integers, reductions, frames, normalisation.

use croupier::unstable::simd::{F32x8, Frame8, I32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::math::{Random, canonical_bits};

/// Zeros, subnormal and normal limits, 1 and neighbours, halves, integer limits, largest, infinity, NaN; both signs.
fn specials() -> Vec<f32> {
    let mut v: Vec<f32> = [0u32, 1, 0x007f_ffff, 0x0080_0000, 0x3eff_ffff, 0x3f00_0000, 0x3f00_0001, 0x3f7f_ffff]
        .into_iter()
        .chain([0x3f80_0000, 0x3f80_0001, 0x7f7f_ffff, 0x7f80_0000, 0x7fc0_0000])
        .map(f32::from_bits)
        .collect();
    v.extend([1.5, 2.5, 4_194_303.5, 8_388_607.5, 8_388_608.0, 8_388_609.0, 16_777_216.0, 2_147_483_648.0]);
    let negative: Vec<f32> = v.iter().map(|x| -x).collect();
    v.extend(negative);
    v
}

fn same_bits(what: &str, got: F32x8, want: [f32; 8]) {
    let (got, want) = (got.to_array().map(canonical_bits), want.map(canonical_bits));
    assert_eq!(got, want, "{what}");
}

// Killed by: `from_bits` with two equal constants in BITS; `bits` over seven lanes; `first` without its limit.
#[test]
fn all_256_masks_are_distinct_and_keep_their_lanes() {
    let x = F32x8::new([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    let dead = F32x8::splat(f32::NAN);
    for bits in 0..256u32 {
        let m = Mask8::from_bits(bits);
        let on = |i: usize| bits >> i & 1 == 1;
        assert_eq!(m.bits(), bits);
        assert_eq!(m, Mask8::from_bits(bits | 0xabcd_ef00), "higher bits are ignored");
        assert_eq!(m.lanes().collect::<Vec<_>>(), (0..8).filter(|i| on(*i)).collect::<Vec<_>>());
        assert_eq!(m.count(), bits.count_ones());
        assert_eq!((m.any(), m.all(), m.none()), (bits != 0, bits == 255, bits == 0));
        assert_eq!((!m).bits(), 255 - bits);
        assert!((0..10).all(|i| m.lane(i) == (i < 8 && on(i))));
        assert_eq!(m, x.to_bits().eq(m.select(x, dead).to_bits()), "a selected lane keeps its bits");
        // NaN in lanes that are not taken, on either side
        let want = std::array::from_fn(|i| if on(i) { x.lane(i) } else { -1.0 });
        same_bits("select", m.select(m.select(x, dead), (!m).select(F32x8::splat(-1.0), dead)), want);
        same_bits("zero_unless", m.zero_unless(m.select(x, dead)), want.map(|w| w.max(0.0)));
        let i = U32x8::select(m, U32x8::splat(7), U32x8::splat(u32::MAX));
        assert_eq!(i.to_array(), std::array::from_fn(|i| if on(i) { 7 } else { u32::MAX }));
        for other in [0x00u32, 0x0f, 0xaa, 0xff] {
            let o = Mask8::from_bits(other);
            assert_eq!((m & o).bits(), bits & other);
            assert_eq!((m | o).bits(), bits | other);
            assert_eq!((m ^ o).bits(), bits ^ other);
            assert_eq!(m.and_not(o).bits(), bits & !other);
        }
    }
    assert_eq!((0..=9).map(|n| Mask8::first(n).bits()).collect::<Vec<_>>(), [0, 1, 3, 7, 15, 31, 63, 127, 255, 255]);
    assert_eq!(Mask8::first(usize::MAX), Mask8::all_lanes());
    assert_eq!((Mask8::splat(true), Mask8::splat(false)), (Mask8::all_lanes(), Mask8::NONE));
    assert_eq!(format!("{:?}", Mask8::from_bits(5)), "Mask8(00000101)");
}

// Killed by: operands of `max` or `min` exchanged (NaN and signed zeros); `le` for `lt`; clamp with min before max.
#[test]
fn comparisons_minima_and_maxima_on_special_values() {
    let all = |b: bool| if b { 255 } else { 0 };
    for a in specials() {
        for b in specials() {
            let (x, y) = (F32x8::splat(a), F32x8::splat(b));
            let what = format!("{a:e} and {b:e}");
            same_bits(&what, x.max(y), [if a < b { b } else { a }; 8]);
            same_bits(&what, x.min(y), [if b < a { b } else { a }; 8]);
            let got = [x.lt(y), x.le(y), x.gt(y), x.ge(y), x.eq(y)].map(|m| m.bits());
            assert_eq!(got, [a < b, a <= b, a > b, a >= b, a == b].map(all), "{what}");
            same_bits(&what, x.copysign(y), [a.copysign(b); 8]);
            same_bits(&what, x + y, [a + b; 8]);
            same_bits(&what, x - y, [a - b; 8]);
            same_bits(&what, x * y, [a * b; 8]);
            same_bits(&what, x / y, [a / b; 8]);
        }
        let x = F32x8::splat(a);
        assert_eq!(x.is_finite().bits(), all(a.is_finite()), "{a:e}");
        assert_eq!(x.is_sign_negative().bits(), all(a.is_sign_negative()), "{a:e}");
        same_bits("abs", x.abs(), [a.abs(); 8]);
        same_bits("sqrt", x.sqrt(), [a.sqrt(); 8]);
        same_bits("safe_sqrt", x.safe_sqrt(), [if a > 0.0 { a.sqrt() } else { 0.0 }; 8]);
        assert_eq!((-x).to_bits().lane(0), a.to_bits() ^ 0x8000_0000, "negation is the sign bit");
        same_bits("clamp", x.clamp(-0.5, 2.0), [if a.is_nan() { -0.5 } else { a.clamp(-0.5, 2.0) }; 8]);
    }
}

// Killed by: rounding ties away from zero; losing the sign of zero; `<=` at 2^23; a conversion that wraps.
#[test]
fn rounding_and_conversion_match_ieee_754() {
    let check = |x: [f32; 8]| {
        let v = F32x8::new(x);
        same_bits(&format!("round {x:?}"), v.round(), x.map(f32::round_ties_even));
        same_bits(&format!("floor {x:?}"), v.floor(), x.map(f32::floor));
        assert_eq!(v.to_i32().to_array(), x.map(|x| x as i32), "to_i32 {x:?}");
    };
    specials().iter().for_each(|x| check([*x; 8]));
    for bits in (0..=u32::MAX - 4096).step_by(4093) {
        check(std::array::from_fn(|i| f32::from_bits(bits + i as u32)));
    }
    let mut r = Random(1);
    for _ in 0..100_000 {
        let i: [i32; 8] = std::array::from_fn(|_| (r.next() as i32) >> (r.next() & 31));
        same_bits("to_f32", I32x8::new(i).to_f32(), i.map(|i| i as f32));
    }
}

// Killed by: >> 7 or the divisor 2^24 - 1 in to_unit (reaches 1); signed comparison of unsigned lanes.
#[test]
fn integers_wrap_and_unit_floats_stay_below_one() {
    let below_one = 1.0 - 1.0 / 16_777_216.0;
    assert_eq!(U32x8::splat(0).to_unit().to_array(), [0.0; 8]);
    assert_eq!(U32x8::splat(255).to_unit().to_array(), [0.0; 8]);
    assert_eq!(U32x8::splat(256).to_unit().to_array(), [1.0 / 16_777_216.0; 8]);
    assert_eq!(U32x8::splat(u32::MAX).to_unit().to_array(), [below_one; 8]);
    let mut r = Random(2);
    for _ in 0..50_000 {
        let a: [u32; 8] = std::array::from_fn(|_| r.next() as u32);
        let b: [u32; 8] = std::array::from_fn(|i| if r.next() & 7 == 0 { a[i] } else { r.next() as u32 });
        let (x, y) = (U32x8::new(a), U32x8::new(b));
        let each = |f: fn(u32, u32) -> u32| -> [u32; 8] { std::array::from_fn(|i| f(a[i], b[i])) };
        let mask = |f: &dyn Fn(usize) -> bool| (0..8).map(|i| u32::from(f(i)) << i).sum::<u32>();
        assert_eq!((x + y).to_array(), each(u32::wrapping_add));
        assert_eq!((x - y).to_array(), each(u32::wrapping_sub));
        assert_eq!((x * y).to_array(), each(u32::wrapping_mul));
        assert_eq!((x & y).to_array(), each(|a, b| a & b));
        assert_eq!((x | y).to_array(), each(|a, b| a | b));
        assert_eq!((x ^ y).to_array(), each(|a, b| a ^ b));
        assert_eq!((!x).to_array(), each(|a, _| !a));
        assert_eq!((x.lt(y).bits(), x.eq(y).bits()), (mask(&|i| a[i] < b[i]), mask(&|i| a[i] == b[i])));
        let (sa, sb) = (a.map(|a| a as i32), b.map(|b| b as i32));
        assert_eq!(I32x8::new(sa).lt(I32x8::new(sb)).bits(), mask(&|i| sa[i] < sb[i]));
        let n = r.next() as u32 & 31;
        assert_eq!((x << n).to_array(), a.map(|a| a << n));
        assert_eq!((x >> n).to_array(), a.map(|a| a >> n));
        assert_eq!((I32x8::new(sa) >> n).to_array(), sa.map(|a| a >> n), "signed shifts keep the sign");
        let u = x.to_unit().to_array();
        assert_eq!(u.map(f64::from), a.map(|a| f64::from(a >> 8) / 16_777_216.0));
    }
}

// Killed by: a reduction from left to right; two rows exchanged in transpose; lane numbers not masked; a minimum of
// signed numbers.
#[test]
fn lanes_move_and_sum_in_the_documented_order() {
    let rows: [F32x8; 8] = std::array::from_fn(|r| F32x8::from_fn(|c| (10 * r + c) as f32));
    for (r, row) in F32x8::transpose(rows).into_iter().enumerate() {
        assert_eq!(row.to_array(), std::array::from_fn(|c| (10 * c + r) as f32));
    }
    assert_eq!((rows[1].lane(3), rows[1].lane(11)), (13.0, 13.0));
    assert_eq!(rows[0].with_lane(10, -1.0).to_array(), [0.0, 1.0, -1.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let mut r = Random(5);
    let mut order_matters = false;
    for _ in 0..10_000 {
        let a: [f32; 8] = std::array::from_fn(|_| (r.between(-20.0, 20.0).exp2() * r.between(-1.0, 1.0)) as f32);
        let want = ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]));
        let v = F32x8::new(a);
        assert_eq!(v.sum().to_bits(), want.to_bits());
        order_matters |= a.iter().sum::<f32>() != want;
        assert_eq!(v.min_lane(), a.into_iter().fold(f32::INFINITY, f32::min));
        assert_eq!(v.max_lane(), a.into_iter().fold(f32::NEG_INFINITY, f32::max));
        let bits = a.map(|x| x.to_bits() << 1);
        assert_eq!(U32x8::new(bits).min_lane(), bits.into_iter().min().unwrap());
    }
    assert!(order_matters, "the sums must be able to tell the order");
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A unit vector: uniform, or within 10^-8..1 of an axis.
fn direction(r: &mut Random) -> [f32; 3] {
    let (z, phi) = (r.between(-1.0, 1.0), r.between(0.0, std::f64::consts::TAU));
    let s = (1.0 - z * z).sqrt();
    let mut v = [s * phi.cos(), s * phi.sin(), z];
    if r.next() & 1 == 0 {
        let (axis, tilt) = ((r.next() % 3) as usize, 10f64.powf(r.between(-8.5, 0.0)));
        v = v.map(|c| c * tilt);
        v[axis] = if r.next() & 1 == 0 { 1.0 } else { -1.0 };
    }
    let l = dot(v, v).sqrt();
    v.map(|c| (c / l) as f32)
}

// Killed by: Frisvad's frame (no sign: 0.6 near n.z = -1); s and t exchanged; one sign lost in `t`.
#[test]
fn frames_are_orthonormal_everywhere() {
    let mut r = Random(11);
    let mut worst = 0f64;
    let fixed =
        [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 0.0, -0.0], [0.0, -1.0, -0.0], [1e-8, 0.0, -1.0]];
    for packet in 0..125_000 {
        let n: [[f32; 3]; 8] = std::array::from_fn(|i| match fixed.get(i) {
            Some(n) if packet == 0 => *n,
            _ => direction(&mut r),
        });
        let v: [[f32; 3]; 8] = std::array::from_fn(|_| direction(&mut r));
        let frame = Frame8::from_normal(Vec3x8::from_fn(|i| n[i]));
        let round_trip = frame.to_world(frame.to_local(Vec3x8::from_fn(|i| v[i])));
        for (i, v) in v.iter().enumerate() {
            let [s, t, n] = [frame.s, frame.t, frame.n].map(|v| v.lane(i).map(f64::from));
            let off = [dot(s, t), dot(s, n), dot(t, n), dot(s, s).sqrt() - 1.0, dot(t, t).sqrt() - 1.0];
            let e = off.iter().fold(0f64, |m, x| m.max(x.abs()));
            assert!(e <= 3e-7, "{e:e} off for the normal {n:?}");
            worst = worst.max(e);
            let cross = [s[1] * t[2] - s[2] * t[1], s[2] * t[0] - s[0] * t[2], s[0] * t[1] - s[1] * t[0]];
            assert!(dot(cross, n) > 0.999_999, "left-handed for the normal {n:?}");
            let back = round_trip.lane(i);
            let e = (0..3).map(|k| (back[k] - v[k]).abs()).fold(0.0, f32::max);
            assert!(e <= 1e-6, "{v:?} came back as {back:?}");
        }
    }
    println!("frames: worst deviation {worst:e}");
}

// Killed by: normalize without the division by the largest component (infinite or zero length from 2^-75, 2^64 on).
#[test]
fn normalize_over_all_exponents() {
    let mut r = Random(13);
    let mut worst = [0f64; 2];
    for e in -149..=127 {
        for _ in 0..200 {
            let v: [[f32; 3]; 8] = std::array::from_fn(|_| {
                let scale = f64::from(e).exp2();
                let spread = r.between(0.0, 30.0);
                let mut v: [f32; 3] = std::array::from_fn(|_| {
                    (scale * r.between(-1.999, 1.999) * (-r.between(0.0, spread)).exp2()) as f32
                });
                v[(r.next() % 3) as usize] = scale as f32;
                v
            });
            let got = Vec3x8::from_fn(|i| v[i]).normalize();
            for (i, v) in v.iter().enumerate() {
                let (exact, got) = (v.map(f64::from), got.lane(i).map(f64::from));
                let l = dot(exact, exact).sqrt();
                let off = (0..3).map(|k| (got[k] - exact[k] / l).abs()).fold(0.0, f64::max);
                let length = (dot(got, got).sqrt() - 1.0).abs();
                worst = [worst[0].max(off), worst[1].max(length)];
                assert!(off <= 2.4e-7 && length <= 2.4e-7, "{v:?}: {got:?}, off {off:e}, length {length:e}");
            }
        }
    }
    println!("normalize: components off by {:e}, length by {:e}", worst[0], worst[1]);
    assert!(Vec3x8::ZERO.normalize().lane(0).iter().all(|c| c.is_nan()));
}

// Killed by: a dot product in another order; `select` or `zero_unless` on one component only.
#[test]
fn vectors_work_lane_by_lane() {
    let mut r = Random(17);
    for _ in 0..5_000 {
        let live = r.next() as u32 & 0xff;
        let mask = Mask8::from_bits(live);
        let draw = |r: &mut Random| -> [[f32; 3]; 8] {
            std::array::from_fn(|_| std::array::from_fn(|_| r.between(-2.0, 2.0) as f32))
        };
        let (a, b) = (draw(&mut r), draw(&mut r));
        let corrupt = |v: [[f32; 3]; 8]| {
            Vec3x8::from_fn(|i| if live >> i & 1 == 1 { v[i] } else { [f32::NAN, f32::INFINITY, -0.0] })
        };
        let (x, y) = (corrupt(a), corrupt(b));
        let (d, c, n) = (x.dot(y), x.cross(y), x.normalize());
        let frame = Frame8::from_normal(n);
        let clean = Frame8::from_normal(Vec3x8::from_fn(|i| a[i]).normalize());
        let kept = x.zero_unless(mask);
        for i in 0..8 {
            let (p, q) = (a[i], b[i]);
            if live >> i & 1 == 0 {
                assert_eq!(kept.lane(i).map(f32::to_bits), [0; 3]);
                continue;
            }
            if croupier::unstable::simd::REPRODUCIBLE {
                assert_eq!(d.lane(i), p[2] * q[2] + (p[1] * q[1] + p[0] * q[0]));
            }
            let want = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
            assert_eq!(c.lane(i), want);
            assert_eq!((frame.s.lane(i), frame.t.lane(i)), (clean.s.lane(i), clean.t.lane(i)), "dead lanes leak");
            assert_eq!(kept.lane(i), p);
            assert_eq!(x.abs().max_component().lane(i), p.map(f32::abs).into_iter().fold(0.0, f32::max));
            assert_eq!(x.any_positive().lane(i), p.iter().any(|c| *c > 0.0));
        }
        assert_eq!(x.is_finite() | !mask, Mask8::all_lanes());
        assert_eq!(x.is_finite() & !mask, Mask8::NONE);
    }
}

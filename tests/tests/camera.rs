//! Camera rays against f64 geometry.

use croupier::unstable::camera::{concentric_disk, generate, image_point, project};
use croupier::unstable::scene::blob::{Camera, CameraKind};
use croupier::unstable::simd::F32x8;
use croupier_tests::light_oracle::{cross, dot, length, sub, unit, wide};
use croupier_tests::stats::{SplitMix, chi_square_in_order};

const SIZE: [u32; 2] = [320, 180];

/// Camera of the scene format, `right = cross(target - origin, up)`, in f64; returns it with its f64 axes.
fn camera(vfov_deg: f64, lens_radius: f32, focus_distance: f32) -> (Camera, [[f64; 3]; 3]) {
    let origin = [0.8f32, 3.3, 5.6];
    let forward = unit(sub([-0.15, -0.75, 0.25], wide(origin)));
    let right = unit(cross(forward, [0.0, 1.0, 0.0]));
    let down = cross(forward, right);
    let half = (vfov_deg.to_radians() / 2.0).tan();
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let camera = Camera {
        kind: 0,
        origin,
        forward: forward.map(|x| x as f32),
        right: right.map(|x| (x * half * aspect) as f32),
        down: down.map(|x| (x * half) as f32),
        lens_radius,
        focus_distance,
        size: SIZE,
    };
    (camera, [forward, right, down])
}

fn axes(c: &Camera) -> [[f64; 3]; 3] {
    [unit(wide(c.forward)), unit(wide(c.right)), unit(wide(c.down))]
}

/// Killed by: y upwards, `right` not scaled by the image's shape (or scaled on y), x / width without the 2.
#[test]
fn pixels_map_to_the_image_plane() {
    let (c, [forward, right, down]) = camera(44.0, 0.0, 0.0);
    let half = 22f64.to_radians().tan();
    let mut rng = SplitMix(3);
    for size in [SIZE, [640, 360], [180, 320], [1, 1], [4096, 16]] {
        let [w, h] = size.map(f64::from);
        for _ in 0..2000 {
            let x = F32x8::from_fn(|i| (rng.f64() * w) as f32 * f32::from(u8::from(i != 0)));
            let y = F32x8::from_fn(|i| (rng.f64() * h) as f32 * f32::from(u8::from(i != 1)));
            let (o, d) = generate(&c, size, x, y, [F32x8::splat(f32::NAN); 2]);
            for i in 0..8 {
                let d = wide(d.lane(i));
                assert_eq!(o.lane(i), c.origin);
                assert!((length(d) - 1.0).abs() < 3e-7);
                // The vertical field of view is kept and pixels are square, whatever the image's shape.
                let want_y = half * (2.0 * f64::from(y.lane(i)) / h - 1.0);
                let want_x = half * (2.0 * f64::from(x.lane(i)) - w) / h;
                let [z, gx, gy] = [forward, right, down].map(|a| dot(d, a));
                let scale = 1.0 + want_x.abs() + want_y.abs();
                assert!((gx / z - want_x).abs() < 1e-6 * scale * scale, "{size:?}");
                assert!((gy / z - want_y).abs() < 1e-6 * scale * scale, "{size:?}");
            }
        }
    }
}

/// All rays of an image point meet in the plane in focus, where the pinhole's ray meets it; the origins lie on the
/// lens. Killed by: focus distance along the ray instead of the axis, lens offset not subtracted from the direction.
#[test]
fn lens_rays_meet_in_the_plane_in_focus() {
    let (pinhole, _) = camera(60.0, 0.0, 0.0);
    let mut rng = SplitMix(4);
    for (radius, focus) in [(0.05f32, 3.0f32), (0.5, 1.5), (0.01, 80.0)] {
        let (c, _) = camera(60.0, radius, focus);
        let [forward, right, down] = axes(&c);
        for _ in 0..2000 {
            let x = F32x8::splat((rng.f64() * 320.0) as f32);
            let y = F32x8::splat((rng.f64() * 180.0) as f32);
            let u = [F32x8::from_fn(|_| rng.f64() as f32), F32x8::from_fn(|_| rng.f64() as f32)];
            let (po, pd) = generate(&pinhole, SIZE, x, y, u);
            let (o, d) = generate(&c, SIZE, x, y, u);
            let meet = |o: [f32; 3], d: [f32; 3]| {
                let (o, d) = (sub(wide(o), wide(c.origin)), wide(d));
                let t = (f64::from(focus) - dot(o, forward)) / dot(d, forward);
                [0, 1, 2].map(|k| o[k] + t * d[k])
            };
            let want = meet(po.lane(0), pd.lane(0));
            for i in 0..8 {
                let got = meet(o.lane(i), d.lane(i));
                assert!(length(sub(got, want)) < 4e-6 * f64::from(focus + 10.0), "{got:?} for {want:?}");
                let on_lens = sub(wide(o.lane(i)), wide(c.origin));
                assert!(dot(on_lens, forward).abs() < 2e-6);
                let r = dot(on_lens, right).hypot(dot(on_lens, down));
                assert!(r <= f64::from(radius) + 2e-6, "{r}");
            }
        }
    }
}

/// Orthographic rays are parallel and start on the image; panoramic ones follow longitude and latitude. Killed by: axes
/// swapped or mirrored, full for half angles, a panorama that stretches with the image's shape, an orthographic one that
/// does not.
#[test]
fn other_projections_follow_their_formulas() {
    let (base, [forward, right, down]) = camera(44.0, 0.0, 0.0);
    let unit_axes = [right, down].map(|a| a.map(|x| x as f32));
    let panoramic = Camera { kind: CameraKind::Panoramic as u32, right: unit_axes[0], down: unit_axes[1], ..base };
    let [wide_right, half_down] = [(right, 4.0), (down, 2.25)].map(|(a, k)| a.map(|x| (x * k) as f32));
    let parallel = Camera { kind: CameraKind::Orthographic as u32, right: wide_right, down: half_down, ..base };
    let mut rng = SplitMix(6);
    for size in [SIZE, [180, 320], [64, 64], [1, 1]] {
        let [w, h] = size.map(f64::from);
        for _ in 0..1000 {
            let x = F32x8::from_fn(|_| (rng.f64() * w) as f32);
            let y = F32x8::from_fn(|_| (rng.f64() * h) as f32);
            let nan = [F32x8::splat(f32::NAN); 2];
            let (po, pd) = project(&panoramic, size, x, y, nan);
            let (oo, od) = project(&parallel, size, x, y, nan);
            for i in 0..8 {
                let (x, y) = (f64::from(x.lane(i)) / w, f64::from(y.lane(i)) / h);
                let (longitude, polar) = ((2.0 * x - 1.0) * std::f64::consts::PI, y * std::f64::consts::PI);
                let flat = |k: usize| forward[k] * longitude.cos() + right[k] * longitude.sin();
                let want = [0, 1, 2].map(|k| flat(k) * polar.sin() - down[k] * polar.cos());
                assert_eq!(po.lane(i), base.origin);
                assert!(length(sub(wide(pd.lane(i)), want)) < 2e-6, "{size:?}: {:?} for {want:?}", pd.lane(i));
                // 4.5 units high in any shape, with square pixels
                let (across, below) = (4.5 * (x - 0.5) * w / h, 4.5 * (y - 0.5));
                let from = sub(wide(oo.lane(i)), wide(base.origin));
                let scale = 10.0 + 4.5 * w / h;
                for (axis, want) in [(forward, 0.0), (right, across), (down, below)] {
                    assert!((dot(from, axis) - want).abs() < 1e-6 * scale, "{size:?}: {from:?}");
                }
                assert!(length(sub(wide(od.lane(i)), forward)) < 1e-6);
            }
        }
    }
    // A perspective camera is what it was, bit for bit.
    let (x, y) = (F32x8::from_fn(|i| i as f32 * 31.7), F32x8::from_fn(|i| i as f32 * 19.3));
    let (a, b) = (generate(&base, SIZE, x, y, [F32x8::ZERO; 2]), project(&base, SIZE, x, y, [F32x8::ZERO; 2]));
    assert_eq!((0..8).map(|i| a.1.lane(i)).collect::<Vec<_>>(), (0..8).map(|i| b.1.lane(i)).collect::<Vec<_>>());
}

/// Uniform over the disk: 8 rings of equal area x 16 sectors. Killed by: radius not equal to the larger coordinate
/// (e.g. its square root), 1/8 turn -> 1/4.
#[test]
fn lens_samples_are_uniform() {
    let (rings, sectors, n) = (8usize, 16usize, 400_000u64);
    let mut counts = vec![0u64; rings * sectors];
    let mut rng = SplitMix(5);
    for _ in 0..n / 8 {
        let u = [F32x8::from_fn(|_| rng.f64() as f32), F32x8::from_fn(|_| rng.f64() as f32)];
        let [a, b] = concentric_disk(u);
        for i in 0..8 {
            let (a, b) = (f64::from(a.lane(i)), f64::from(b.lane(i)));
            let ring = (((a * a + b * b) * rings as f64) as usize).min(rings - 1);
            let turn = (b.atan2(a) / std::f64::consts::TAU).rem_euclid(1.0);
            counts[ring * sectors + ((turn * sectors as f64) as usize).min(sectors - 1)] += 1;
        }
    }
    let p = chi_square_in_order(&counts, &vec![n as f64 / (rings * sectors) as f64; rings * sectors]);
    println!("p = {p:.3}");
    assert!(p > 1e-6, "p = {p}");
}

/// The map's Jacobian is pi, the area of the disk, everywhere inside the four triangles. Killed by: any distortion of
/// radius or angle.
#[test]
fn the_lens_map_preserves_area() {
    let (n, h) = (64, 1.0 / 512.0);
    for i in 0..n {
        for j in 0..n {
            let (u, v) = ((i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32);
            // Differences must not cross the diagonals.
            if (u - v).abs() < 0.01 || (u + v - 1.0).abs() < 0.01 {
                continue;
            }
            let mut us = [u; 8];
            let mut vs = [v; 8];
            (us[0], us[1], vs[2], vs[3]) = (u - h, u + h, v - h, v + h);
            let [a, b] = concentric_disk([F32x8::new(us), F32x8::new(vs)]);
            let d = |x: F32x8, k: usize| f64::from(x.lane(k + 1) - x.lane(k)) / f64::from(2.0 * h);
            let jacobian = d(a, 0) * d(b, 2) - d(a, 2) * d(b, 0);
            assert!((jacobian.abs() / std::f64::consts::PI - 1.0).abs() < 2e-3, "{u} {v}: {jacobian}");
        }
    }
}

/// Corners, centre and diagonals of the square. Killed by: 0 / 0 at the centre.
#[test]
fn special_lens_numbers_stay_on_the_disk() {
    let top = 1.0 - f32::EPSILON / 2.0;
    let s = [0.0, f32::EPSILON / 2.0, 0.25, 0.5 - f32::EPSILON / 4.0, 0.5, 0.5 + f32::EPSILON / 2.0, 0.75, top];
    for u in s {
        let [a, b] = concentric_disk([F32x8::splat(u), F32x8::new(s)]);
        assert!((a * a + b * b).le(F32x8::splat(1.0 + 3e-7)).all(), "{u}: {a:?} {b:?}");
    }
    let [a, b] = concentric_disk([F32x8::splat(0.5); 2]);
    assert_eq!((a, b), (F32x8::ZERO, F32x8::ZERO));
}

/// Killed by: an axis, a sign or a stretch of another projection's, a distance that is divided by twice, points behind the
/// camera that are seen, longitudes that grow to the left.
#[test]
fn points_are_seen_where_their_rays_came_from() {
    let mut rng = SplitMix(9);
    let (perspective, axes) = camera(44.0, 0.3, 2.0);
    let unit_axes = Camera { right: axes[1].map(|x| x as f32), down: axes[2].map(|x| x as f32), ..perspective };
    for kind in CameraKind::ALL {
        let c = match kind {
            CameraKind::Perspective => perspective,
            _ => Camera { lens_radius: 0.0, ..unit_axes },
        };
        let c = Camera { kind: *kind as u32, ..c };
        for size in [SIZE, [180, 320], [1, 1]] {
            for _ in 0..500 {
                // near the edges of a panorama, both sides are
                let within =
                    |n: u32, rng: &mut SplitMix| F32x8::from_fn(|_| ((0.01 + 0.98 * rng.f64()) * f64::from(n)) as f32);
                let (x, y) = (within(size[0], &mut rng), within(size[1], &mut rng));
                let (o, d) = project(&Camera { lens_radius: 0.0, ..c }, size, x, y, [F32x8::splat(0.5); 2]);
                let t = F32x8::from_fn(|_| (0.1 + 20.0 * rng.f64()) as f32);
                let ([px, py], seen) = image_point(&c, size, o + d * t);
                assert!(seen.all());
                let largest = size[0].max(size[1]) as f32;
                for i in 0..8 {
                    let off = (px.lane(i) - x.lane(i)).abs().max((py.lane(i) - y.lane(i)).abs());
                    assert!(off < 5e-6 * largest, "{kind:?} {size:?}: {off}");
                }
                let (_, behind) = image_point(&c, size, o - d * t);
                assert_eq!(behind.any(), *kind != CameraKind::Perspective);
            }
        }
    }
}

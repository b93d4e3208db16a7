//! Scenes with as many emitters as wanted.

use crate::scenes::{add_quad, camera, facing_y, grey};
use crate::stats::SplitMix;
use croupier_host::description::*;

/// A floor of 16 x 16 below a cloud of `n` emitting triangles of random size, place, direction and radiance, 0.3 to 3
/// above it, which bring the floor about the same light whatever `n` is.
pub fn cloud(n: u32, size: [u32; 2]) -> SceneDescription {
    let mut scene = SceneDescription { camera: camera([0.0, 9.0, 12.0], [0.0; 3], 60.0, size), ..Default::default() };
    let floor = scene.add_material("floor", grey(0.6));
    add_quad(&mut scene, "floor", floor, facing_y(8.0, 0.0, 1.0));
    let mut rng = SplitMix(77);
    let lamps = [[8.0, 6.0, 4.0], [2.0, 4.0, 8.0], [1.0; 3], [16.0, 14.0, 2.0]].map(|radiance| {
        let material = scene.add_material("lamp", grey(0.2));
        scene.emitters.push(Emitter::Area { material, radiance });
        material
    });
    let edge = 2.0 / f64::from(n).sqrt();
    for k in 0..n {
        let middle = [rng.range(-7.5, 7.5), rng.range(0.3, 3.0), rng.range(-7.5, 7.5)];
        let (u, v) = (rng.direction(), rng.direction());
        let length = edge * rng.range(0.5, 1.5);
        let corner = |a: f64, b: f64| Vertex {
            position: std::array::from_fn(|i| (middle[i] + length * (a * u[i] + b * v[i])) as f32),
            ..Vertex::default()
        };
        let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)];
        scene.add_mesh("lamp", lamps[k as usize % 4], &corners, &[[0, 1, 2]], false);
    }
    scene.max_depth = 2;
    scene
}

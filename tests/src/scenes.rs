//! Small scenes in code, for tests of the machine and for pictures whose radiance is known.
//!
//! World space has y upwards. Corners of quads run counter-clockwise seen from the front.

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::*;

/// The scene blob of a description.
pub fn blob(scene: &SceneDescription) -> AlignedBytes {
    bake(scene, &BakeOptions::default(), |_, _| {}).expect("the scene can be baked").bytes
}

/// A grey diffuse model.
pub fn grey(rho: f32) -> Model {
    diffuse([rho; 3])
}

/// A diffuse model.
pub fn diffuse(rho: [f32; 3]) -> Model {
    Model::Diffuse { reflectance: Reflectance::Constant(rho) }
}

/// A camera with square pixels.
pub fn camera(origin: [f64; 3], target: [f64; 3], vfov_deg: f64, size: [u32; 2]) -> Camera {
    // the axis may be vertical
    let vertical = origin[0] == target[0] && origin[2] == target[2];
    let up = if vertical { [0.0, 0.0, -1.0] } else { [0.0, 1.0, 0.0] };
    Camera { origin, target, up, vfov_deg, size, ..Camera::default() }
}

/// A scene that only the constant environment of radiance 1 lights.
pub fn in_white_environment(camera: Camera) -> SceneDescription {
    SceneDescription {
        environment: Some(Environment::Constant { radiance: [1.0; 3] }),
        camera,
        ..SceneDescription::default()
    }
}

/// Adds a flat quad of two triangles.
pub fn add_quad(scene: &mut SceneDescription, name: &str, material: u32, corners: [[f32; 3]; 4]) {
    let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let vertices: Vec<Vertex> =
        corners.into_iter().zip(uv).map(|(position, uv)| Vertex { position, uv, ..Vertex::default() }).collect();
    scene.add_mesh(name, material, &vertices, &[[0, 1, 2], [0, 2, 3]], false);
}

/// A quad in the plane z = `z` around the axis, facing +z (`towards` > 0) or -z.
pub fn facing_z(half: f32, z: f32, towards: f32) -> [[f32; 3]; 4] {
    let x = half.copysign(towards);
    [[-x, -half, z], [x, -half, z], [x, half, z], [-x, half, z]]
}

/// A quad in the plane y = `y` around the axis, facing +y (`towards` > 0) or -y.
pub fn facing_y(half: f32, y: f32, towards: f32) -> [[f32; 3]; 4] {
    let x = half.copysign(towards);
    [[-x, y, half], [x, y, half], [x, y, -half], [-x, y, -half]]
}

/// Adds the six sides of the box `lo..hi` as quads that face inwards (`inwards`) or outwards.
pub fn add_box(scene: &mut SceneDescription, material: u32, lo: [f32; 3], hi: [f32; 3], inwards: bool) {
    for axis in 0..3 {
        for high in [false, true] {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |hb: bool, hc: bool| {
                let mut p = [0.0; 3];
                p[axis] = if high { hi[axis] } else { lo[axis] };
                p[b] = if hb { hi[b] } else { lo[b] };
                p[c] = if hc { hi[c] } else { lo[c] };
                p
            };
            // counter-clockwise seen from +axis
            let mut corners = [corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
            if high == inwards {
                corners.reverse();
            }
            add_quad(scene, "side", material, corners);
        }
    }
}

/// Adds a sphere as a subdivided octahedron (8 * 4^subdivisions triangles, vertices on the sphere), facing outwards or
/// inwards.
pub fn add_sphere(scene: &mut SceneDescription, material: u32, centre: [f32; 3], radius: f32, shape: Sphere) {
    let mut faces: Vec<[[f64; 3]; 3]> = Vec::new();
    for sx in [-1.0, 1.0] {
        for sy in [-1.0, 1.0] {
            for sz in [-1.0, 1.0] {
                let (x, y, z) = ([sx, 0.0, 0.0], [0.0, sy, 0.0], [0.0, 0.0, sz]);
                faces.push(if sx * sy * sz > 0.0 { [x, y, z] } else { [x, z, y] });
            }
        }
    }
    let middle = |p: [f64; 3], q: [f64; 3]| {
        let m: [f64; 3] = std::array::from_fn(|i| p[i] + q[i]);
        let l = m.iter().map(|x| x * x).sum::<f64>().sqrt();
        m.map(|x| x / l)
    };
    for _ in 0..shape.subdivisions {
        let split = |[a, b, c]: [[f64; 3]; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    let sign = if shape.inwards { -1.0 } else { 1.0 };
    let place = |p: [f64; 3]| Vertex {
        position: std::array::from_fn(|i| (f64::from(centre[i]) + f64::from(radius) * p[i]) as f32),
        normal: p.map(|x| (sign * x) as f32),
        uv: [0.0; 2],
    };
    let vertices: Vec<Vertex> = faces.iter().flatten().map(|p| place(*p)).collect();
    let corners = |i: u32| if shape.inwards { [3 * i, 3 * i + 2, 3 * i + 1] } else { [3 * i, 3 * i + 1, 3 * i + 2] };
    let triangles: Vec<[u32; 3]> = (0..faces.len() as u32).map(corners).collect();
    scene.add_mesh("sphere", material, &vertices, &triangles, shape.smooth);
}

/// How a sphere is made.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sphere {
    /// Each makes four triangles of one.
    pub subdivisions: u32,
    /// Shading normals of the sphere.
    pub smooth: bool,
    /// Front inside.
    pub inwards: bool,
}

/// Moves and scales all positions: `p * scale + offset`. Exact if `scale` is a power of two and the sums are.
pub fn place(scene: &mut SceneDescription, scale: f32, offset: f32) {
    let at = |p: f32| p * scale + offset;
    let at64 = |p: f64| p * f64::from(scale) + f64::from(offset);
    for v in &mut scene.vertices {
        v.position = v.position.map(at);
    }
    let c = &mut scene.camera;
    (c.origin, c.target) = (c.origin.map(at64), c.target.map(at64));
}

/// The Cornell box with coloured walls and an emitter over most of the ceiling, 2 x 2 x 2 around the origin, seen
/// through its open front. Every pixel sees floor or walls; the emitter itself is out of view, large, and the walls are
/// dim, so that the noise of one sample stays below its mean.
pub fn cornell(size: [u32; 2]) -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([0.0, 0.0, 4.4], [0.0, -0.35, 0.0], 12.0, size),
        ..SceneDescription::default()
    };
    let white = s.add_material("white", diffuse([0.6, 0.55, 0.5]));
    let red = s.add_material("red", diffuse([0.55, 0.1, 0.08]));
    let green = s.add_material("green", diffuse([0.12, 0.45, 0.15]));
    let emitter = s.add_material("emitter", diffuse([0.0; 3]));
    let z = |z: f32, to: f32| facing_z(1.0, z, to);
    add_quad(&mut s, "floor", white, facing_y(1.0, -1.0, 1.0));
    add_quad(&mut s, "ceiling", white, facing_y(1.0, 1.0, -1.0));
    add_quad(&mut s, "back", white, z(-1.0, 1.0));
    add_quad(&mut s, "left", red, [[-1.0, -1.0, 1.0], [-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, 1.0, 1.0]]);
    add_quad(&mut s, "right", green, [[1.0, -1.0, -1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]]);
    add_quad(&mut s, "emitter", emitter, facing_y(0.875, 0.984_375, -1.0));
    s.emitters.push(Emitter::Area { material: emitter, radiance: [6.0, 5.0, 4.0] });
    s
}

/// A bit of everything: textured floor, rough plastic, glass, rough and smooth metal, thin sheet, a null box, an
/// environment map, an area light, point and directional light, a thin lens, shading normals.
pub fn everything(size: [u32; 2]) -> SceneDescription {
    let eye = camera([0.3, 1.3, 5.0], [0.0, 0.6, 0.0], 34.0, size);
    let mut s = SceneDescription {
        camera: Camera { lens: Some(ThinLens { radius: 0.05, focus_distance: 5.0 }), ..eye },
        ..SceneDescription::default()
    };
    let texel = |x: u32, y: u32| {
        let light = (x / 2 + y / 2).is_multiple_of(2);
        [if light { 220 } else { 40 }, (60 + 20 * x) as u8, (250 - 25 * y) as u8, 255]
    };
    s.textures.push(Texture {
        name: "checks".into(),
        width: 8,
        height: 8,
        texels: (0..64).map(|i| texel(i % 8, i / 8)).collect(),
        ..Texture::default()
    });
    let floor = s.add_material("floor", Model::Diffuse { reflectance: Reflectance::Texture(0) });
    let emitter = s.add_material("emitter", grey(0.3));
    let glass = s.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    let sheet = s.add_material("sheet", Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 });
    let air = s.add_material("air", Model::Null);
    let red = Reflectance::Constant([0.7, 0.15, 0.1]);
    let (int_ior, ext_ior) = (1.5, 1.0);
    let coat = s.add_material("coat", Model::RoughPlastic { reflectance: red, int_ior, ext_ior, alpha: 0.15 });
    let (eta, k) = ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603]);
    let white = Reflectance::Constant([1.0; 3]);
    let metal = s.add_material("metal", Model::RoughConductor { eta, k, reflectance: white, alpha: 0.2 });
    add_quad(&mut s, "floor", floor, facing_y(4.0, 0.0, 1.0));
    add_quad(&mut s, "emitter", emitter, facing_y(0.5, 3.0, -1.0));
    let smooth = Sphere { subdivisions: 3, smooth: true, inwards: false };
    add_sphere(&mut s, glass, [-1.1, 0.6, 0.6], 0.5, smooth);
    add_sphere(&mut s, coat, [0.0, 0.7, -0.4], 0.6, smooth);
    add_sphere(&mut s, metal, [1.2, 0.6, 0.3], 0.5, smooth);
    add_quad(&mut s, "sheet", sheet, facing_z(0.4, 1.6, 1.0).map(|[x, y, z]| [x - 0.2, y + 0.5, z]));
    add_box(&mut s, air, [0.5, 0.05, 1.0], [1.0, 0.5, 1.5], false);
    s.emitters.push(Emitter::Area { material: emitter, radiance: [8.0, 7.0, 6.0] });
    s.emitters.push(Emitter::Point { position: [-2.0, 2.0, 1.5], intensity: [2.0, 3.0, 4.0] });
    s.emitters.push(Emitter::Directional { direction: [-1.0, -2.0, -0.5], irradiance: [0.5, 0.45, 0.4] });
    s.environment = Some(croupier_host::builtin::sky());
    s
}

/// A closed box of one material that also emits, seen from inside: its radiance is the same everywhere.
pub fn glowing_box(rho: f32, radiance: f32, size: [u32; 2]) -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([0.1, -0.2, 0.3], [0.4, 0.3, -1.0], 70.0, size),
        max_depth: 200,
        ..SceneDescription::default()
    };
    let wall = s.add_material("wall", grey(rho));
    add_box(&mut s, wall, [-1.0; 3], [1.0; 3], true);
    if radiance > 0.0 {
        s.emitters.push(Emitter::Area { material: wall, radiance: [radiance; 3] });
    }
    s
}

/// A small diffuse floor spot at the origin, seen in all pixels from half a unit away at a slant (0, 0.6, 0.8), in the
/// dark.
pub fn spot(rho: f32, size: [u32; 2]) -> SceneDescription {
    let mut s =
        SceneDescription { camera: camera([0.0, 0.3, 0.4], [0.0; 3], 0.01, size), ..SceneDescription::default() };
    let floor = s.add_material("floor", grey(rho));
    add_quad(&mut s, "floor", floor, facing_y(1.0, 0.0, 1.0));
    s
}

/// A closed diffuse box with an emitter, which the camera sees in its 4 x 4 pixels.
pub fn box_with_emitter() -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([0.1, -0.1, 0.9], [0.1, 0.4, -1.0], 80.0, [4, 4]),
        ..SceneDescription::default()
    };
    let wall = s.add_material("wall", diffuse([0.7, 0.5, 0.3]));
    let emitter = s.add_material("emitter", grey(0.4));
    add_box(&mut s, wall, [-1.0; 3], [1.0; 3], true);
    add_quad(&mut s, "emitter", emitter, facing_y(0.3, 0.96, -1.0));
    s.emitters.push(Emitter::Area { material: emitter, radiance: [5.0, 6.0, 7.0] });
    s
}

/// The same with a mirror and a block of glass, whose caustics are rare and bright.
pub fn mirror_and_glass() -> SceneDescription {
    let mut s = box_with_emitter();
    let mirror = s.add_material("mirror", Model::Mirror { reflectance: Reflectance::Constant([0.9, 0.8, 0.7]) });
    let glass = s.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_quad(&mut s, "mirror", mirror, facing_z(0.7, -0.9, 1.0));
    add_box(&mut s, glass, [-0.6, -0.9, -0.4], [0.2, 0.1, 0.2], false);
    s
}

//! Descriptions into blobs: what is kept, what is dropped, what is refused, and the same bytes every time.

use croupier::Scene;
use croupier::unstable::scene::Effects;
use croupier::unstable::scene::blob::{
    ALIGN, Header, LightKind, NONE, Section, TRIANGLE_OBJECT_SHIFT, TRIANGLE_SMOOTH, content_hash,
};
use croupier_host::bake::{BakeOptions, Baked, Stage, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin::{cornell_box, sky};
use croupier_host::description::*;
use std::cell::RefCell;

fn baked(scene: &SceneDescription) -> Baked {
    bake(scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{e}"))
}

fn diffuse(y: f32) -> Model {
    Model::Diffuse { reflectance: Reflectance::Constant([y; 3]) }
}

fn vertices<const N: usize>(positions: [[f32; 3]; N]) -> [Vertex; N] {
    positions.map(|position| Vertex { position, normal: [0.0, 0.0, 2.0], uv: [0.5, 0.25] })
}

/// A unit right triangle in z = 0, front towards +z, of a grey material.
fn one_triangle() -> SceneDescription {
    let mut scene = SceneDescription::default();
    let grey = scene.add_material("grey", diffuse(0.5));
    scene.add_mesh("tri", grey, &vertices([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), &[[0, 1, 2]], true);
    scene
}

/// Killed by: a hash over the header too; sections that are not aligned; leaving `length` unpadded.
#[test]
fn the_blob_is_laid_out_as_its_header_says() {
    let first = baked(&cornell_box());
    let second = baked(&cornell_box());
    assert_eq!(&first.bytes[..], &second.bytes[..]);
    assert_eq!(first.bytes.as_ptr() as usize % ALIGN, 0);
    let (head, rest) = first.bytes.split_at(size_of::<Header>());
    let header: &Header = bytemuck::from_bytes(head);
    assert_eq!((header.length, header.hash), (first.bytes.len() as u64, content_hash(rest)));
    let table: &[Section] = bytemuck::cast_slice(&rest[..header.sections as usize * size_of::<Section>()]);
    let mut end = (size_of::<Header>() + size_of_val(table)) as u64;
    for s in table {
        assert!(s.offset % ALIGN as u64 == 0 && s.offset >= end && s.count > 0, "{s:?}");
        end = s.offset + s.count * u64::from(s.stride);
    }
    assert!(end <= header.length);
    assert_eq!(table.len(), first.report.sections.len());
    // Any change of content is another scene.
    let mut other = cornell_box();
    other.materials[0].model = diffuse(0.724);
    let other = baked(&other);
    assert_ne!(Scene::from_bytes(&other.bytes).unwrap().hash, header.hash);
}

#[test]
fn aligned_bytes_have_their_length() {
    for n in [0usize, 1, 63, 64, 65, 1000] {
        let source: Vec<u8> = (0..n).map(|i| i as u8).collect();
        let mut copy = AlignedBytes::zeroed(n);
        copy.as_mut().copy_from_slice(&source);
        assert_eq!((&copy[..], copy.as_ptr() as usize % ALIGN), (&source[..], 0));
    }
}

/// Killed by: a sphere wound inwards; the emitter facing up; normals not of the sphere.
#[test]
fn the_cornell_box_faces_inwards_and_its_spheres_outwards() {
    let scene = cornell_box();
    let point = |v: u32| glam::Vec3::from_array(scene.vertices[v as usize].position);
    for (i, t) in scene.triangles.iter().enumerate() {
        let [a, b, c] = t.vertices.map(point);
        let (normal, middle) = ((b - a).cross(c - a), (a + b + c) / 3.0);
        let centre = match scene.object_of(i as u32) {
            "metal sphere" => glam::vec3(-0.42, 0.4, -0.35),
            "glass sphere" => glam::vec3(0.45, 0.4, 0.3),
            _ => middle + normal.normalize(),
        };
        let outwards = normal.dot(middle - centre);
        assert_eq!(t.smooth, outwards > 0.0, "triangle {i}");
        if !t.smooth {
            // Inside of the box.
            assert!(normal.dot(glam::vec3(0.0, 1.0, 0.0) - middle) > 0.0, "triangle {i}");
        }
        for v in t.vertices.iter().filter(|_| t.smooth) {
            let n = glam::Vec3::from_array(scene.vertices[*v as usize].normal);
            assert!((point(*v) - centre - 0.4 * n).length() < 1e-6);
        }
    }
    let report = baked(&scene).report;
    assert_eq!((report.triangles, report.lights, report.dropped_degenerate), (12 + 2 * 20480, 2, 0));
    let bytes = baked(&scene).bytes;
    let effects = Scene::from_bytes(&bytes).unwrap().effects;
    let wanted = Effects::DIFFUSE.with(Effects::CONDUCTOR).with(Effects::DIELECTRIC).with(Effects::AREA_LIGHTS);
    assert_eq!(effects, wanted.with(Effects::SMOOTH_NORMALS));
}

/// Killed by: dropping by area below a threshold such as 1e-12 (the needles); not counting lights; keeping indices of
/// triangles before dropping in the lights.
#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let mut scene = one_triangle();
    let emitter = scene.add_material("emitter", diffuse(0.0));
    let p = [[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1e-6, 0.0]];
    // Collinear, a doubled index, doubled positions; then a proper light; then a needle of 1e6:1.
    let bad = [[0, 1, 2], [3, 3, 1], [4, 4, 4]];
    scene.add_mesh("lines", emitter, &vertices(p), &bad, false);
    scene.add_mesh("emitter", emitter, &vertices(p), &[[0, 4, 3]], false);
    scene.add_mesh("needle", 0, &vertices(p), &[[0, 4, 5]], false);
    let tiny = [[0.0; 3], [1e-16, 0.0, 0.0], [0.0, 1e-16, 0.0]];
    scene.add_mesh("tiny", 0, &vertices(tiny), &[[0, 1, 2]], false);
    scene.emitters.push(Emitter::Area { material: emitter, radiance: [1.0, 2.0, 3.0] });
    let baked = baked(&scene);
    let r = &baked.report;
    assert_eq!((r.triangles, r.dropped_degenerate, r.dropped_lights, r.lights), (4, 3, 3, 1));
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    assert_eq!(view.info.dropped_triangles, 3);
    assert_eq!(view.triangles.iter().map(|t| t.light).collect::<Vec<_>>(), [NONE, 0, NONE, NONE]);
    let l = view.lights[0];
    assert_eq!((l.kind, l.triangle, l.area, l.emission), (0, 1, 0.5, [1.0, 2.0, 3.0]));
    assert_eq!(view.light_alias[0].probability, 1.0);
}

/// Killed by: normals stored as given; a zero normal interpolated.
#[test]
fn normals_are_unit_or_not_used() {
    let mut scene = one_triangle();
    let other = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    scene.add_mesh("dull", 0, &vertices(other), &[[0, 1, 2]], true);
    scene.vertices[4].normal = [0.0; 3];
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    assert_eq!(baked.report.flattened, 1);
    let second = 1 << TRIANGLE_OBJECT_SHIFT;
    assert_eq!(view.triangles.iter().map(|t| t.flags).collect::<Vec<_>>(), [TRIANGLE_SMOOTH, second]);
    assert_eq!((view.vertices[0].n, view.vertices[0].uv), ([0.0, 0.0, 1.0], [0.5, 0.25]));
}

#[test]
fn an_empty_scene_is_legal() {
    let empty = SceneDescription { environment: Some(sky()), ..SceneDescription::default() };
    let baked = baked(&empty);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    assert!(view.nodes.is_empty() && view.triangles.is_empty() && view.lights.len() == 1);
    assert_eq!(
        (view.info.bounds_min, view.info.bounds_max, view.light_alias[0].probability),
        ([0.0; 3], [0.0; 3], 1.0)
    );
}

/// Against f64 trigonometry. Killed by: the aspect upside down; half angle forgotten; right = up x axis.
#[test]
fn camera_axes_reach_the_edges_of_the_picture() {
    let mut scene = one_triangle();
    scene.camera = Camera {
        origin: [1e6, 2.0, 3.0],
        target: [1e6, 2.0, -7.0],
        up: [0.1, 3.0, 0.7],
        vfov_deg: 60.0,
        size: [200, 100],
        lens: Some(ThinLens { radius: 0.5, focus_distance: 4.0 }),
        ..Camera::default()
    };
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    let c = view.camera;
    // The axis is -z. Right is -z x up, normalised: (3, -0.1, 0) / length. Down is axis x right.
    let (h, l) = ((30f64).to_radians().tan(), (9.01f64).sqrt());
    let right = [3.0 / l * 2.0 * h, -0.1 / l * 2.0 * h, 0.0];
    let down = [-0.1 / l * h, -3.0 / l * h, 0.0];
    for (found, wanted) in [(c.forward, [0.0, 0.0, -1.0]), (c.right, right), (c.down, down)] {
        for (a, b) in found.iter().zip(wanted) {
            assert!((f64::from(*a) - b).abs() < 1e-6, "{found:?} {wanted:?}");
        }
    }
    assert_eq!((c.origin, c.lens_radius, c.focus_distance, c.size), ([1e6, 2.0, 3.0], 0.5, 4.0, [200, 100]));
}

/// Killed by: the direction's sign; `to_world` copied instead of inverted; keeping black lights.
#[test]
fn lights_come_out_as_the_core_reads_them() {
    let mut scene = one_triangle();
    let black = scene.add_material("black", diffuse(0.0));
    scene.add_mesh(
        "black emitter",
        black,
        &vertices([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]),
        &[[0, 1, 2]],
        false,
    );
    scene.emitters = vec![
        Emitter::Area { material: black, radiance: [0.0; 3] },
        Emitter::Point { position: [1.0, 2.0, 3.0], intensity: [4.0, 5.0, 6.0] },
        Emitter::Directional { direction: [0.0, -2.0, 0.0], irradiance: [1.0, 0.5, 0.25] },
        Emitter::Point { position: [1.0; 3], intensity: [0.0; 3] },
    ];
    // A quarter turn about y: map -z (u = 0) becomes world -x.
    let to_world = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let (texels, scale) = (vec![[1.0, 2.0, 3.0]; 4 * 3], [2.0, 2.0, 2.0]);
    scene.environment = Some(Environment::Map { width: 4, height: 3, texels, scale, to_world });
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    let [point, sun, env] = view.lights else { panic!("{} lights", view.lights.len()) };
    assert_eq!((point.kind, point.vector, point.emission), (LightKind::Point as u32, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
    assert_eq!(
        (sun.kind, sun.vector, sun.emission),
        (LightKind::Directional as u32, [0.0, 1.0, 0.0], [1.0, 0.5, 0.25])
    );
    assert_eq!(env.kind, LightKind::Environment as u32);
    let e = view.environment.unwrap();
    // World -x times the rows of to_local is map -z.
    assert_eq!(e.to_local.map(|row| -row[0]), [0.0, 0.0, -1.0]);
    assert_eq!((e.light, e.width, e.height, e.radiance), (2, 4, 3, [2.0; 3]));
    assert_eq!((view.env_texels.len(), view.env_alias.len()), (12, 2 + 2 * 4));
    assert!(view.triangles.iter().all(|t| t.light == NONE));
    for black in [
        Environment::Constant { radiance: [0.0; 3] },
        Environment::Map { width: 2, height: 2, texels: vec![[0.0; 3]; 4], scale, to_world },
        Environment::Map { width: 2, height: 2, texels: vec![[1.0; 3]; 4], scale: [0.0; 3], to_world },
    ] {
        scene.environment = Some(black);
        let baked = self::baked(&scene);
        let view = Scene::from_bytes(&baked.bytes).unwrap();
        assert!(view.environment.is_none() && view.env_texels.is_empty() && view.env_alias.is_empty());
        assert_eq!(view.lights.len(), 2);
    }
}

/// Killed by: one table per material; sharing by alpha alone; tables for smooth plastics.
#[test]
fn rough_plastics_share_tables() {
    let mut scene = one_triangle();
    let reflectance = Reflectance::Constant([0.5; 3]);
    let rough = |alpha, int_ior, ext_ior| Model::RoughPlastic { reflectance, int_ior, ext_ior, alpha };
    for (i, model) in [
        rough(0.1, 1.5, 1.0),
        rough(0.2, 1.5, 1.0),
        rough(0.1, 3.0, 2.0),
        rough(0.1, 1.3, 1.0),
        Model::Plastic { reflectance, int_ior: 1.5, ext_ior: 1.0 },
    ]
    .into_iter()
    .enumerate()
    {
        scene.add_material(&format!("coat\n{i}"), model);
    }
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    let tables: Vec<u32> = view.materials.iter().map(|m| m.table).collect();
    assert_eq!(tables, [NONE, 0, 64, 0, 128, NONE]);
    assert_eq!(view.tables.len(), 3 * 64);
    assert_eq!(view.materials[3].eta[0], 1.5);
    assert!((view.materials[5].fdr - 0.5963).abs() < 1e-3, "{}", view.materials[5].fdr);
    assert_eq!(view.names, b"grey\ncoat 0\ncoat 1\ncoat 2\ncoat 3\ncoat 4\ntri\n");
}

/// Killed by: texels without alpha, or in another order.
#[test]
fn textures_are_packed_row_by_row() {
    let mut scene = one_triangle();
    for (name, texel) in [("a", [1, 2, 3, 4]), ("b", [5, 6, 7, 8])] {
        scene.textures.push(Texture {
            name: name.into(),
            width: 3,
            height: 2,
            texels: vec![texel; 6],
            ..Texture::default()
        });
    }
    scene.materials[0].model = Model::Mirror { reflectance: Reflectance::Texture(1) };
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    assert_eq!((view.texels[0], view.texels[11]), (0x0403_0201, 0x0807_0605));
    assert_eq!((view.textures[1].first, view.materials[0].texture, view.materials[0].reflectance[0]), (6, 1, 1.0));
    assert!(view.effects.contains(Effects::TEXTURES));
}

#[test]
fn progress_names_every_stage_in_order() {
    let heard = RefCell::new(Vec::new());
    bake(&one_triangle(), &BakeOptions::default(), |s, f| heard.borrow_mut().push((s, f))).unwrap();
    let wanted: Vec<(Stage, f32)> = Stage::ALL.iter().flat_map(|s| [(*s, 0.0), (*s, 1.0)]).collect();
    assert_eq!(*heard.borrow(), wanted);
}

/// One thing wrong at a time. Killed by: leaving out any of the checks.
#[test]
fn what_cannot_be_baked_is_named() {
    type Break = fn(&mut SceneDescription);
    let cases: &[(Break, &[&str])] = &[
        (|s| s.vertices[1].position[2] = f32::NAN, &["object `tri`", "position of vertex 1", "NaN"]),
        (|s| s.vertices[2].position[0] = f32::INFINITY, &["object `tri`", "position of vertex 2", "inf"]),
        (|s| s.vertices[2].position[0] = 2e9, &["position of vertex 2", "2e9"]),
        (|s| s.vertices[0].normal[0] = f32::NAN, &["normal of vertex 0"]),
        (|s| s.vertices[0].uv[1] = f32::NAN, &["texture coordinate of vertex 0"]),
        (|s| s.vertices.push(Vertex { uv: [f32::NAN; 2], ..Vertex::default() }), &["object `unused`", "vertex 3"]),
        (|s| s.triangles[0].vertices[1] = 7, &["object `tri`", "triangle 0", "vertex 7", "there are 3"]),
        (|s| s.triangles[0].material = 9, &["object `tri`", "triangle 0", "material 9", "there are 1"]),
        (|s| s.materials[0].model = diffuse(1.5), &["material `grey`", "reflectance is 1.5", "from 0 to 1"]),
        (|s| s.materials[0].model = diffuse(f32::NAN), &["material `grey`", "reflectance is NaN"]),
        (
            |s| s.materials[0].model = Model::RoughDielectric { int_ior: 1.5, ext_ior: 1.0, alpha: 0.0 },
            &["material `grey`", "alpha is 0"],
        ),
        (
            |s| s.materials[0].model = Model::Dielectric { int_ior: 1.5, ext_ior: 0.0 },
            &["material `grey`", "ext_ior is 0"],
        ),
        (
            |s| s.materials[0].model = Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 / 1024.0 },
            &["material `grey`", "int_ior / ext_ior is 1536"],
        ),
        (
            |s| {
                let reflectance = Reflectance::Constant([1.0; 3]);
                s.materials[0].model = Model::Conductor { eta: [1.0, 0.0, 1.0], k: [1.0, 0.0, 1.0], reflectance };
            },
            &["material `grey`", "larger of eta and k is 0"],
        ),
        (
            |s| s.materials[0].model = Model::Mirror { reflectance: Reflectance::Texture(2) },
            &["material `grey`", "texture 2", "there are 0"],
        ),
        (
            |s| {
                s.textures.push(Texture {
                    name: "t.png".into(),
                    width: 2,
                    height: 2,
                    texels: vec![[0; 4]; 3],
                    ..Texture::default()
                })
            },
            &["`t.png`", "2 x 2", "3 texels"],
        ),
        (
            |s| {
                s.textures.push(Texture {
                    name: "t.png".into(),
                    width: 0,
                    height: 2,
                    texels: vec![],
                    ..Texture::default()
                })
            },
            &["`t.png`", "0 x 2"],
        ),
        (|s| s.emitters.push(Emitter::Area { material: 4, radiance: [1.0; 3] }), &["emitter 0 (area)", "material 4"]),
        (
            |s| s.emitters = vec![Emitter::Area { material: 0, radiance: [1.0; 3] }; 2],
            &["emitter 1 (area)", "material 0 already emits"],
        ),
        (
            |s| s.emitters.push(Emitter::Area { material: 0, radiance: [1.0, -1.0, 0.0] }),
            &["emitter 0 (area)", "radiance is -1"],
        ),
        (
            |s| s.emitters.push(Emitter::Point { position: [f32::NAN; 3], intensity: [1.0; 3] }),
            &["emitter 0 (point)", "position is NaN"],
        ),
        (
            |s| s.emitters.push(Emitter::Directional { direction: [0.0; 3], irradiance: [1.0; 3] }),
            &["emitter 0 (directional)", "length of the direction is 0"],
        ),
        (
            |s| {
                let (position, direction) = ([0.0; 3], [1.0, 0.0, 0.0]);
                let (inner_deg, outer_deg) = (31.0, 30.0);
                s.emitters.push(Emitter::Spot { position, direction, intensity: [1.0; 3], inner_deg, outer_deg });
            },
            &["emitter 0 (spot)", "inner half angle in degrees is 31"],
        ),
        (
            |s| {
                let (position, direction) = ([0.0; 3], [1.0, 0.0, 0.0]);
                let (inner_deg, outer_deg) = (0.0, 181.0);
                s.emitters.push(Emitter::Spot { position, direction, intensity: [1.0; 3], inner_deg, outer_deg });
            },
            &["emitter 0 (spot)", "outer half angle in degrees is 181"],
        ),
        (
            |s| {
                let (direction, irradiance) = ([0.0, -1.0, 0.0], [1.0; 3]);
                s.emitters.push(Emitter::Sun { direction, irradiance, angle_deg: 91.0 });
            },
            &["emitter 0 (sun)", "angular diameter in degrees is 91"],
        ),
        (|s| s.camera.projection = Projection::Orthographic { height: 0.0 }, &["camera", "orthographic height is 0"]),
        (
            |s| {
                s.camera.projection = Projection::Panoramic;
                s.camera.lens = Some(ThinLens { radius: 0.5, focus_distance: 4.0 });
            },
            &["camera", "lens radius of a camera that is not perspective is 0.5"],
        ),
        (|s| s.environment = Some(Environment::Constant { radiance: [f32::INFINITY; 3] }), &["environment", "inf"]),
        (
            |s| {
                let Environment::Map { width, height, texels, scale, .. } = sky() else { return };
                let to_world = [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                s.environment = Some(Environment::Map { width, height, texels, scale, to_world });
            },
            &["environment", "not a rotation"],
        ),
        (
            |s| {
                let Environment::Map { width, height, mut texels, scale, to_world } = sky() else { return };
                texels[5][1] = f32::NAN;
                s.environment = Some(Environment::Map { width, height, texels, scale, to_world });
            },
            &["environment map", "NaN"],
        ),
        (|s| s.camera.target = s.camera.origin, &["camera", "distance from origin to target is 0"]),
        (|s| s.camera.up = [0.0, 0.0, 1.0], &["camera", "angle between axis and up"]),
        (|s| s.camera.vfov_deg = 180.0, &["camera", "field of view", "180"]),
        (|s| s.camera.origin[0] = f64::NAN, &["camera", "origin is NaN"]),
        (|s| s.camera.size = [0, 0], &["camera", "width is 0"]),
        (|s| s.camera.lens = Some(ThinLens { radius: 0.1, focus_distance: 0.0 }), &["camera", "focus distance is 0"]),
        (|s| s.camera.lens = Some(ThinLens { radius: -1.0, focus_distance: 1.0 }), &["camera", "lens radius is -1"]),
    ];
    for (i, (break_it, parts)) in cases.iter().enumerate() {
        let mut scene = one_triangle();
        break_it(&mut scene);
        let error = bake(&scene, &BakeOptions::default(), |_, _| {}).err();
        let text = error.unwrap_or_else(|| panic!("case {i} {parts:?} was baked")).to_string();
        for part in *parts {
            assert!(text.contains(part), "case {i}: `{text}` lacks `{part}`");
        }
    }
}

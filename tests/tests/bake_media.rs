//! Media in descriptions: what the blob has of them, their majorants, boundaries that leak, flags of materials.

use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::scene::blob::{
    MATERIAL_COMPENSATED, MATERIAL_CUTOUT, MATERIAL_TWO_SIDED, MAX_MEDIA, MediumKind, NONE,
};
use croupier_host::bake::{BakeError, BakeOptions, Baked, bake};
use croupier_host::description::*;
use croupier_tests::blob::majorants;
use croupier_tests::stats::SplitMix;
use std::array;

fn baked(scene: &SceneDescription) -> Baked {
    try_bake(scene).unwrap_or_else(|e| panic!("{e}"))
}

fn try_bake(scene: &SceneDescription) -> Result<Baked, BakeError> {
    bake(scene, &BakeOptions::default(), |_, _| {})
}

/// The box from `lo` to `hi`, front sides outwards: four corners for each of its six sides.
fn add_box(scene: &mut SceneDescription, name: &str, material: u32, lo: [f32; 3], hi: [f32; 3]) {
    let mut corners = Vec::new();
    for axis in 0..3 {
        for side in [0, 1] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let ring = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]| {
                let mut p = [0.0; 3];
                for (axis, end) in [(axis, side), (u, i), (v, j)] {
                    p[axis] = if end == 0 { lo[axis] } else { hi[axis] };
                }
                Vertex { position: p, ..Vertex::default() }
            });
            corners.extend(if side == 1 { ring } else { [ring[0], ring[3], ring[2], ring[1]] });
        }
    }
    let triangles: Vec<[u32; 3]> =
        (0..6).flat_map(|q| [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]]).collect();
    scene.add_mesh(name, material, &corners, &triangles, false);
}

fn fog() -> Medium {
    Medium { name: "fog".into(), sigma_a: [0.1, 0.2, 0.3], sigma_s: [1.0, 2.0, 3.0], g: 0.25, ..Medium::default() }
}

/// A box of null material with fog in it.
fn foggy() -> SceneDescription {
    let mut scene = SceneDescription { media: vec![fog()], ..SceneDescription::default() };
    let null = scene.add_material("edge", Model::Null);
    scene.materials[0].medium = Some(0);
    add_box(&mut scene, "box", null, [-1.0; 3], [1.0, 2.0, 1.0]);
    scene
}

/// Killed by: majorants over the brick alone, or in another order; a grid that starts where the one before it does;
/// `medium` off by one.
#[test]
fn media_and_grids_are_kept() {
    let mut scene = foggy();
    let mut random = SplitMix(7);
    let sizes = [[6u32, 3, 5], [1, 1, 1], [9, 8, 4]];
    for (i, cells) in (1u32..).zip(sizes) {
        let values: Vec<f32> = (0..cells.iter().product()).map(|_| (random.word() % 1000) as f32 / 7.0).collect();
        let density = Density::Grid { cells, bounds: [[-1.0; 3], [1.0, 2.0, 3.0]], values };
        scene.media.push(Medium { name: format!("grid {i}"), emission: [0.0, 1.0, 0.5], density, ..fog() });
        let material = scene.add_material(&format!("edge {i}"), Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
        scene.materials[material as usize].medium = Some(i);
        add_box(&mut scene, "grid", material, [i as f32 * 4.0; 3], [i as f32 * 4.0 + 1.0; 3]);
    }
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    assert!(view.effects.contains(Effects::MEDIA.with(Effects::GRID_MEDIA)));
    assert_eq!(view.materials.iter().map(|m| m.medium).collect::<Vec<_>>(), [0, 1, 2, 3]);
    let m = &view.media[0];
    assert_eq!(
        (m.kind, m.sigma_a, m.sigma_s, m.g),
        (MediumKind::Homogeneous as u32, fog().sigma_a, fog().sigma_s, 0.25)
    );
    let (mut densities, mut expected) = (Vec::new(), Vec::new());
    for (described, m) in scene.media.iter().zip(view.media).skip(1) {
        let Density::Grid { cells, bounds, values } = &described.density else { panic!("{}", described.name) };
        assert_eq!((m.kind, m.cells, m.emission), (MediumKind::Grid as u32, *cells, [0.0, 1.0, 0.5]));
        assert_eq!([m.bounds_min, m.bounds_max], *bounds);
        assert_eq!((m.first_density as usize, m.first_majorant as usize), (densities.len(), expected.len()));
        densities.extend_from_slice(values);
        expected.extend(majorants(*cells, values));
    }
    assert_eq!((view.densities, view.majorants), (&densities[..], &expected[..]));
}

/// No density exceeds the majorant of its brick anywhere between cell centres. Killed by: a majorant without the cells
/// around the brick, or without the margin.
#[test]
fn interpolated_densities_stay_below_their_majorants() {
    let cells = [7u32, 6, 9];
    let mut random = SplitMix(3);
    let values: Vec<f32> = (0..cells.iter().product()).map(|_| random.f32() * 1e4).collect();
    let mut scene = foggy();
    scene.media[0].density = Density::Grid { cells, bounds: [[0.0; 3], [1.0; 3]], values: values.clone() };
    let baked = baked(&scene);
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    let bricks = view.media[0].bricks();
    for _ in 0..200_000 {
        let at: [f32; 3] = array::from_fn(|axis| random.f32() * cells[axis] as f32);
        let brick: [u32; 3] = array::from_fn(|axis| at[axis] as u32 / 4);
        let mut density = 0.0f32;
        for corner in 0..8u32 {
            let (mut weight, mut index) = (1.0f32, 0);
            for axis in [2, 1, 0] {
                let x = at[axis] - 0.5;
                let up = corner >> axis & 1;
                weight *= if up == 1 { x - x.floor() } else { 1.0 - (x - x.floor()) };
                let i = (x.floor() as i64 + i64::from(up)).clamp(0, i64::from(cells[axis]) - 1);
                index = index * cells[axis] as usize + i as usize;
            }
            density += weight * values[index];
        }
        let majorant = view.majorants[((brick[2] * bricks[1] + brick[1]) * bricks[0] + brick[0]) as usize];
        assert!(density <= majorant, "{density} above {majorant} at {at:?}");
    }
}

/// Killed by: no weld, a weld that tells the zeros apart; dropping triangles without area first; open edges found by
/// counting triangles alone.
#[test]
fn closed_boundaries_pass() {
    // Each side has corners of its own.
    let mut scene = foggy();
    // both zeros, in some triangles only
    for (i, v) in scene.vertices.iter_mut().enumerate() {
        v.position[0] = if v.position[0] < 0.0 { if i % 2 == 0 { 0.0 } else { -0.0 } } else { 1.0 };
    }
    baked(&scene);
    // A side with a T-junction that a triangle without area joins: the corner 1 of the first triangle lies on an edge.
    let [a, b, c, d] = [[0.0f32, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    let middle = [1.0, 0.0, 0.0];
    let vertices = [a, b, c, d, middle].map(|position| Vertex { position, ..Vertex::default() });
    let faces = [[0, 2, 4], [4, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    for (sliver, passes) in [(true, true), (false, false)] {
        let mut scene = SceneDescription { media: vec![fog()], ..SceneDescription::default() };
        scene.add_material("edge", Model::Null);
        scene.materials[0].medium = Some(0);
        let mut faces = faces.to_vec();
        faces.extend(sliver.then_some([0, 4, 1]));
        scene.add_mesh("tetrahedron", 0, &vertices, &faces, false);
        match try_bake(&scene) {
            Ok(baked) => assert_eq!((passes, baked.report.dropped_degenerate), (true, 1)),
            Err(e) => assert!(!passes && matches!(e, BakeError::Leak { .. }), "{e}"),
        }
    }
    // A boundary of two materials; a shell, whose inner side faces its hole.
    let mut scene = foggy();
    let other = scene.add_material("lid", Model::Dielectric { int_ior: 1.3, ext_ior: 1.0 });
    scene.materials[other as usize].medium = Some(0);
    scene.triangles.iter_mut().take(2).for_each(|t| t.material = other);
    baked(&scene);
    let first = scene.triangles.len();
    add_box(&mut scene, "hole", 0, [-0.5; 3], [0.5; 3]);
    scene.triangles[first..].iter_mut().for_each(|t| t.vertices.swap(0, 1));
    baked(&scene);
}

/// One thing wrong at a time. Killed by: leaving out any of the checks.
#[test]
fn media_that_cannot_be_baked_are_named() {
    type Break = fn(&mut SceneDescription);
    fn grid(s: &mut SceneDescription, edit: fn(&mut [u32; 3], &mut [[f32; 3]; 2], &mut Vec<f32>)) {
        let (mut cells, mut bounds, mut values) = ([2, 3, 4], [[0.0; 3], [1.0; 3]], vec![0.5; 24]);
        edit(&mut cells, &mut bounds, &mut values);
        s.media[0].density = Density::Grid { cells, bounds, values };
    }
    let cases: &[(Break, &[&str])] = &[
        (|s| s.media[0].sigma_a[1] = -0.5, &["medium `fog`", "sigma_a is -0.5", "from 0 to"]),
        (|s| s.media[0].sigma_a[1] = f32::NAN, &["medium `fog`", "sigma_a is NaN"]),
        (|s| s.media[0].sigma_s[2] = f32::INFINITY, &["medium `fog`", "sigma_s is inf"]),
        (|s| s.media[0].sigma_s[2] = 2e18, &["sigma_s is 2e18"]),
        (|s| s.media[0].emission[0] = -1.0, &["medium `fog`", "emission is -1"]),
        (|s| s.media[0].g = -0.995, &["medium `fog`", "g is -0.995", "from -0.99 to 0.99"]),
        (|s| grid(s, |_, _, v| _ = v.pop()), &["medium `fog`", "2 x 3 x 4 cells", "23 values"]),
        (|s| grid(s, |c, _, v| (c[1], *v) = (0, vec![])), &["2 x 0 x 4 cells", "0 values"]),
        (|s| grid(s, |c, _, _| *c = [1 << 31; 3]), &["2147483648 x"]),
        (|s| grid(s, |_, _, v| v[7] = f32::NAN), &["medium `fog`", "density is NaN"]),
        (|s| grid(s, |_, _, v| v[7] = -1e-9), &["medium `fog`", "density is -1e-9"]),
        (|s| grid(s, |_, b, _| b[0][1] = f32::NAN), &["medium `fog`", "bound of the grid is NaN"]),
        (|s| grid(s, |_, b, _| b[0][1] = 1.0), &["medium `fog`", "width of the grid is 0"]),
        (|s| grid(s, |_, b, _| b[0][1] = 1.5), &["medium `fog`", "width of the grid is -0.5"]),
        (|s| s.materials[0].medium = Some(3), &["medium `fog`", "no triangle"]),
        (
            |s| {
                s.add_material("other", Model::Null);
                s.materials[1].medium = Some(3);
            },
            &["material `other`", "medium 3", "there are 1"],
        ),
        (|s| s.media.push(Medium { name: "smoke".into(), ..fog() }), &["medium `smoke`", "no triangle"]),
        (|s| s.media = vec![fog(); MAX_MEDIA + 1], &["25 media", "24"]),
        // One triangle less: the diagonal that it shared with the first one.
        (
            |s| _ = s.triangles.remove(1),
            &[
                "medium `fog`",
                "object `box`",
                "edge from [-1.0, 2.0, 1.0] to [-1.0, -1.0, -1.0] (triangles that way: 1, the other way: 0)",
            ],
        ),
        (|s| s.triangles.push(s.triangles[0]), &["not closed", "(triangles that way: 2, the other way: 1)"]),
        (|s| s.triangles[0].vertices.swap(0, 1), &["not closed", "the other way: 0)"]),
        (
            |s| s.vertices[5].position[1] = f32::from_bits(s.vertices[5].position[1].to_bits() + 1),
            &["medium `fog`", "not closed"],
        ),
        (
            |s| s.triangles.iter_mut().for_each(|t| t.vertices.swap(0, 1)),
            &["medium `fog`", "object `box`", "face inwards"],
        ),
    ];
    for (i, (break_it, parts)) in cases.iter().enumerate() {
        let mut scene = foggy();
        break_it(&mut scene);
        let error = try_bake(&scene).err();
        let text = error.unwrap_or_else(|| panic!("case {i} {parts:?} was baked")).to_string();
        for part in *parts {
            assert!(text.contains(part), "case {i}: `{text}` lacks `{part}`");
        }
    }
}

/// Killed by: a flag of a material that it changes nothing for.
#[test]
fn flags_are_set_where_they_change_something() {
    let reflectance = Reflectance::Constant([0.5; 3]);
    let texture = |i| Model::Diffuse { reflectance: Reflectance::Texture(i) };
    let rough = Model::RoughPlastic { reflectance, int_ior: 1.5, ext_ior: 1.0, alpha: 0.2 };
    let cases = [
        (Model::Diffuse { reflectance }, MATERIAL_TWO_SIDED, Effects::DIFFUSE),
        (texture(0), MATERIAL_TWO_SIDED, Effects::DIFFUSE.with(Effects::TEXTURES)),
        (
            texture(1),
            MATERIAL_TWO_SIDED | MATERIAL_CUTOUT,
            Effects::DIFFUSE.with(Effects::TEXTURES).with(Effects::ALPHA),
        ),
        (rough, MATERIAL_TWO_SIDED | MATERIAL_COMPENSATED, Effects::ROUGH_PLASTIC.with(Effects::MULTIPLE_SCATTERING)),
        (
            Model::RoughDielectric { int_ior: 1.5, ext_ior: 1.0, alpha: 0.2 },
            MATERIAL_COMPENSATED,
            Effects::ROUGH_DIELECTRIC.with(Effects::MULTIPLE_SCATTERING),
        ),
        (Model::Plastic { reflectance, int_ior: 1.5, ext_ior: 1.0 }, MATERIAL_TWO_SIDED, Effects::PLASTIC),
        (Model::Null, 0, Effects::NULL),
    ];
    for (model, flags, effects) in cases {
        let mut scene = SceneDescription::default();
        for (name, alpha) in [("opaque", 255), ("holes", 254)] {
            let texels = vec![[9, 9, 9, 255], [9, 9, 9, alpha]];
            scene.textures.push(Texture { name: name.into(), width: 2, height: 1, texels, ..Texture::default() });
        }
        scene.add_material("m", model);
        let m = &mut scene.materials[0];
        (m.cutout, m.compensated) = (true, true);
        add_box(&mut scene, "box", 0, [-1.0; 3], [1.0; 3]);
        let all = baked(&scene);
        let view = Scene::from_bytes(&all.bytes).unwrap();
        assert_eq!(
            (view.materials[0].flags, view.materials[0].medium, view.effects),
            (flags, NONE, effects),
            "{model:?}"
        );
        let m = &mut scene.materials[0];
        (m.cutout, m.compensated) = (false, false);
        let none = baked(&scene);
        let view = Scene::from_bytes(&none.bytes).unwrap();
        assert_eq!(view.materials[0].flags, flags & MATERIAL_TWO_SIDED, "{model:?}");
    }
}

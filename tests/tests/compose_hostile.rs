//! Parts that cannot be a scene are refused by name and number, whatever is wrong with them; nothing panics.

use croupier::unstable::compose::{
    ComposeError, FieldError, LightSource, PerRecord, SceneParts, Sides, Surround, View,
};
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Field, SceneError};
use croupier::{EditableScene, MemoryError, Scene};
use croupier_host::blob::AlignedBytes;
use croupier_tests::arrays::{Arrays, composed};
use croupier_tests::scenes::{blob, everything};
use proptest::prelude::*;

fn material(kind: MaterialKind) -> Material {
    let eta = if kind == MaterialKind::Conductor { [0.2; 3] } else { [1.5, 0.0, 0.0] };
    Material { reflectance: [0.5; 3], alpha: 0.2, eta, k: [3.0; 3], ..Material::new(kind) }
}

/// A square of two triangles that emit, a light of each kind, and a map around.
fn square() -> Arrays {
    let sides = Sides::default();
    let (position, radiance, direction) = ([0.0, 1.0, 0.0], [1.0; 3], [0.0, -1.0, 0.0]);
    let lights = [
        LightSource::Sphere { position, radius: 0.1, radiance, sides },
        LightSource::Point { position, intensity: radiance },
        LightSource::Sun { direction, irradiance: radiance, angle_deg: 0.5 },
        LightSource::Disk { position, direction, radius: 0.1, radiance, sides },
        LightSource::Spot { position, direction, intensity: radiance, inner_deg: 10.0, outer_deg: 20.0 },
    ];
    let view = View { size: [4, 4], ..View::default() };
    let environment = Environment {
        kind: EnvironmentKind::Map as u32,
        light: 0,
        width: 2,
        height: 3,
        to_local: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        radiance: [1.0; 3],
    };
    let kinds = [MaterialKind::Diffuse, MaterialKind::Plastic, MaterialKind::Conductor, MaterialKind::Dielectric];
    Arrays {
        positions: vec![[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]],
        normals: vec![[0.0, 2.0, 0.0]; 4],
        uvs: vec![[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        triangle_materials: vec![0, 1],
        materials: kinds.map(material).to_vec(),
        emission: vec![[0.0; 3], [2.0; 3], [0.0; 3], [0.0; 3]],
        texels: vec![0xff80_4020; 6],
        textures: vec![Texture { first: 1, width: 2, height: 2, flags: 0 }],
        media: vec![],
        lights: lights.map(|l| l.record().unwrap()).to_vec(),
        environment: Some((environment, vec![[0.5, 1.0, 2.0]; 6])),
        names: b"a\nb\nc\nd\n".to_vec(),
        camera: view.record().unwrap(),
        max_depth: 8,
    }
}

fn error(arrays: &Arrays) -> ComposeError {
    let mut memory = AlignedBytes::zeroed(1 << 16);
    let mut scratch = AlignedBytes::zeroed(1 << 12);
    let parts = arrays.parts();
    let error = parts.layout().unwrap_err();
    // NaN is not what it is
    let again = parts.compose(memory.as_mut(), scratch.as_mut()).unwrap_err();
    assert_eq!(format!("{again:?}"), format!("{error:?}"));
    error
}

fn number(of: SectionKind, index: u32, field: Field, found: f32) -> ComposeError {
    ComposeError::Scene(SceneError::Number { of, index, field, found })
}

/// Killed by: a part that is not checked, a number or an index that is not told.
#[test]
fn errors_name_the_part_and_the_number() {
    type Damage = fn(&mut Arrays);
    use SectionKind as S;
    let reference = |index, to, found, count| {
        ComposeError::Scene(SceneError::Reference { of: S::Triangles, index, to, found, count })
    };
    let length = |what, found, records| ComposeError::Length { what, found, records };
    let cases: [(Damage, ComposeError, &str); 26] = [
        (|a| a.triangles[1][2] = 99, reference(1, S::Vertices, 99, 4), "triangles[1]: wrong reference to vertices[99]"),
        (
            |a| a.triangle_materials[1] = 7,
            reference(1, S::Materials, 7, 4),
            "triangles[1]: wrong reference to materials[7]",
        ),
        (|a| a.positions[3][1] = 2e9, number(S::Vertices, 3, Field::Position, 2e9), "vertices[3]: position"),
        (|a| a.positions[0][0] = f32::INFINITY, number(S::Vertices, 0, Field::Position, f32::INFINITY), "inf"),
        (
            |a| a.normals[2][0] = f32::NEG_INFINITY,
            number(S::Vertices, 2, Field::Direction, f32::NEG_INFINITY),
            "direction",
        ),
        (|a| a.uvs[1][0] = 3e9, number(S::Vertices, 1, Field::TextureCoordinate, 3e9), "texture coordinate"),
        (|a| a.normals.truncate(3), length(PerRecord::Normals, 3, 4), "3 normals for 4 vertices"),
        (|a| a.uvs.truncate(1), length(PerRecord::Uvs, 1, 4), "1 texture coordinates for 4 vertices"),
        (|a| a.triangle_materials.push(0), length(PerRecord::TriangleMaterials, 3, 2), "3 material indices for 2"),
        (|a| a.emission.truncate(2), length(PerRecord::Emission, 2, 4), "2 emitted radiances for 4 materials"),
        (|a| a.emission[1][0] = -1.0, number(S::Materials, 1, Field::Emission, -1.0), "materials[1]: emission is -1"),
        (|a| a.materials[0].reflectance[1] = 1.5, number(S::Materials, 0, Field::Reflectance, 1.5), "reflectance"),
        (
            |a| (a.materials[2].k, a.materials[2].eta) = ([0.0; 3], [0.0; 3]),
            number(S::Materials, 2, Field::Extinction, 0.0),
            "materials[2]: k is 0",
        ),
        (|a| a.materials[3].eta[0] = 0.0, number(S::Materials, 3, Field::Eta, 0.0), "materials[3]: eta"),
        (
            |a| a.materials[2].kind = 77,
            ComposeError::Scene(SceneError::Kind { of: S::Materials, index: 2, found: 77 }),
            "kind 77",
        ),
        (
            |a| a.materials[0] = material(MaterialKind::Principled),
            ComposeError::Tables { index: 0 },
            "materials[0]: its tables must be given",
        ),
        (
            |a| {
                let m = &mut a.materials[2];
                *m = Material { kind: MaterialKind::RoughConductor as u32, flags: MATERIAL_COMPENSATED, ..*m };
            },
            ComposeError::Tables { index: 2 },
            "materials[2]",
        ),
        (
            |a| a.lights[1].kind = LightKind::Area as u32,
            ComposeError::Light { index: 1 },
            "lights[1]: emitting triangles",
        ),
        (|a| a.lights[4].kind = LightKind::Environment as u32, ComposeError::Light { index: 4 }, "lights[4]"),
        (|a| a.lights[1].emission[2] = -2.0, number(S::Lights, 1, Field::Emission, -2.0), "lights[1]: emission is -2"),
        (|a| a.lights[0].params[0] = 0.0, number(S::Lights, 0, Field::ShapeSize, 0.0), "lights[0]: radius"),
        (|a| a.camera.size[1] = 0, number(S::Cameras, 0, Field::Height, 0.0), "camera[0]: height is 0"),
        (
            |a| a.environment.as_mut().unwrap().1[4][2] = -1.0,
            number(S::EnvTexels, 4, Field::Emission, -1.0),
            "environment texels[4]",
        ),
        (
            |a| a.environment.as_mut().unwrap().0.height = 1,
            number(S::Environment, 0, Field::Height, 1.0),
            "height is 1",
        ),
        (
            |a| a.media = vec![Medium { kind: MediumKind::Grid as u32, ..bytemuck::Zeroable::zeroed() }],
            ComposeError::Grid { index: 0 },
            "media[0]",
        ),
        (
            |a| a.names.truncate(3),
            ComposeError::Scene(SceneError::Names { lines: 1, materials: 4 }),
            "names must be UTF-8",
        ),
    ];
    assert!(Scene::from_bytes(&composed(&square().parts())).is_ok());
    for (damage, expected, text) in cases {
        let mut arrays = square();
        damage(&mut arrays);
        let found = error(&arrays);
        assert_eq!(found, expected);
        assert!(found.to_string().contains(text), "{found} lacks {text}");
    }
    let mut arrays = square();
    arrays.positions[2][0] = f32::NAN;
    let text = error(&arrays).to_string();
    assert_eq!(text, "vertices[2]: position is NaN, out of range");
    arrays = square();
    arrays.environment.as_mut().unwrap().1.pop();
    assert!(error(&arrays).to_string().contains("environment texels"), "{}", error(&arrays));
    arrays = square();
    arrays.lights = vec![arrays.lights[0]; 1025];
    assert!(matches!(error(&arrays), ComposeError::TooMany { found: 1025, most: 1024, .. }));
}

/// Killed by: a light or camera that is made of numbers out of their ranges.
#[test]
fn records_of_wrong_numbers_are_refused() {
    let (position, radiance, direction, sides) = ([0.0; 3], [1.0; 3], [0.0, 1.0, 0.0], Sides::default());
    let spot =
        |inner_deg, outer_deg| LightSource::Spot { position, direction, intensity: radiance, inner_deg, outer_deg };
    let edges = |edges| LightSource::Rectangle { position, edges, radiance, sides };
    for (source, field) in [
        (LightSource::Point { position: [f32::NAN; 3], intensity: radiance }, Field::Position),
        (LightSource::Point { position, intensity: [0.0, f32::INFINITY, 0.0] }, Field::Emission),
        (LightSource::Directional { direction: [0.0; 3], irradiance: radiance }, Field::Direction),
        (LightSource::Directional { direction: [f32::NAN; 3], irradiance: radiance }, Field::Direction),
        (LightSource::Sun { direction, irradiance: radiance, angle_deg: 0.0 }, Field::Cone),
        (spot(30.0, 20.0), Field::Cone),
        (spot(f32::NAN, 20.0), Field::Cone),
        (spot(0.0, 181.0), Field::Cone),
        (LightSource::Sphere { position, radius: 0.0, radiance, sides }, Field::ShapeSize),
        (LightSource::Disk { position, direction, radius: f32::NAN, radiance, sides }, Field::ShapeSize),
        (edges([[1.0, 0.0, 0.0], [0.0; 3]]), Field::ShapeSize),
        (edges([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]), Field::Edges),
    ] {
        let found = source.record().unwrap_err();
        assert_eq!(found.field, field, "{source:?}");
    }
    let view = View::default();
    for (view, field) in [
        (View { origin: [f64::NAN; 3], ..view }, Field::Position),
        (View { target: view.origin, ..view }, Field::Direction),
        (View { up: [0.0, 0.0, 3.0], ..view }, Field::ImagePlane),
        (View { up: [0.0; 3], ..view }, Field::ImagePlane),
        (View { extent: 180.0, ..view }, Field::ImagePlane),
        (View { extent: f64::NAN, ..view }, Field::ImagePlane),
        (View { kind: CameraKind::Orthographic, extent: 0.0, ..view }, Field::ImagePlane),
        (View { size: [0, 4], ..view }, Field::Width),
        (View { size: [4, 65_537], ..view }, Field::Height),
        (View { lens_radius: -1.0, ..view }, Field::LensRadius),
        (View { kind: CameraKind::Panoramic, lens_radius: 1.0, focus_distance: 1.0, ..view }, Field::LensRadius),
        (View { lens_radius: 1.0, ..view }, Field::FocusDistance),
    ] {
        assert_eq!(view.record().unwrap_err().field, field, "{view:?}");
    }
    let text = FieldError { field: Field::Cone, found: 181.0 }.to_string();
    assert_eq!(text, "1 - cosine of a cone is 181, out of range");
}

/// Killed by: a triangle without area in a blob, lights of it, triangles that take the place of others.
#[test]
fn triangles_without_area_are_left_out() {
    let mut arrays = square();
    arrays.triangles = vec![[0, 0, 1], [0, 1, 2], [1, 1, 1], [0, 2, 3], [0, 1, 2]];
    arrays.triangle_materials = vec![1, 0, 1, 1, 1];
    // three points on a line
    arrays.positions.extend([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    (arrays.normals.clear(), arrays.uvs.clear());
    arrays.triangles.push([4, 5, 6]);
    arrays.triangle_materials.push(1);
    let bytes = composed(&arrays.parts());
    let scene = Scene::from_bytes(&bytes).unwrap();
    assert_eq!((scene.triangles.len(), scene.info.dropped_triangles), (3, 3));
    assert_eq!(scene.triangles[1].vertex, [0, 2, 3]);
    let lights: Vec<u32> = scene.triangles.iter().map(|t| t.light).collect();
    assert_eq!(lights, [NONE, 0, 1]);
    assert!(scene.triangles.iter().all(|t| t.flags == 0), "no normals: flat");
}

/// Killed by: a tree over nothing, a light table without lights that is not empty.
#[test]
fn scenes_of_nothing_are_scenes() {
    let camera = View::default().record().unwrap();
    let none = SceneParts::new(camera);
    let dead = SceneParts {
        positions: &[[1.0; 3]],
        triangles: &[[0, 0, 0]],
        materials: &[material(MaterialKind::Diffuse)],
        ..none
    };
    let black = Surround::Map {
        size: [1, 2],
        texels: &[[0.0; 3]; 2],
        scale: [1.0; 3],
        to_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    };
    for parts in [none, dead, SceneParts { environment: Some(black), ..none }] {
        let bytes = composed(&parts);
        let scene = Scene::from_bytes(&bytes).unwrap();
        assert_eq!((scene.triangles.len(), scene.lights.len(), scene.nodes.len()), (0, 0, 0));
        assert!(scene.environment.is_none());
    }
    let white = SceneParts { environment: Some(Surround::Constant { radiance: [1.0; 3] }), ..none };
    let bytes = composed(&white);
    assert_eq!(Scene::from_bytes(&bytes).unwrap().light_alias.len(), 1);
}

/// A block that is too small says how large it must be; one as large as the blob turned out will do or say so. Killed
/// by: a
/// section that is written beyond the end, a tree that is cut off, sizes that are not told.
#[test]
fn small_blocks_are_refused() {
    let arrays = Arrays::of(&Scene::from_bytes(&blob(&everything([8, 8]))).unwrap());
    for arrays in [arrays, square()] {
        let parts = arrays.parts();
        let layout = parts.layout().unwrap();
        let mut memory = AlignedBytes::zeroed(layout.blob.size + 64);
        let mut scratch = AlignedBytes::zeroed(layout.scratch.size + 64);
        let whole = composed(&parts);
        assert!(whole.len() <= layout.blob.size);
        println!("blob {} of {} bytes, scratch {}", whole.len(), layout.blob.size, layout.scratch.size);
        let step = layout.blob.size / 97 + 1;
        let mut fitted = 0;
        for given in (0..layout.blob.size).step_by(step).chain([layout.blob.size]) {
            match parts.compose(&mut memory.as_mut()[..given], scratch.as_mut()) {
                Ok(bytes) => {
                    assert_eq!(&*bytes, &whole[..], "{given}");
                    fitted += 1;
                }
                Err(e) => {
                    assert!(given < layout.blob.size);
                    let needed = layout.blob.size;
                    assert_eq!(e, ComposeError::Blob(MemoryError::TooSmall { needed, given }));
                }
            }
        }
        assert!(fitted > 0);
        let needed = layout.scratch.size;
        let given = needed - 64;
        let error = parts.compose(memory.as_mut(), &mut scratch.as_mut()[..given]).unwrap_err();
        assert_eq!(error, ComposeError::Scratch(MemoryError::TooSmall { needed, given }));
        let error = parts.compose(&mut memory.as_mut()[4..], scratch.as_mut()).unwrap_err();
        assert_eq!(error, ComposeError::Blob(MemoryError::Misaligned));
        let error = parts.compose(memory.as_mut(), &mut scratch.as_mut()[32..]).unwrap_err();
        assert_eq!(error, ComposeError::Scratch(MemoryError::Misaligned));
    }
}

/// A composed scene may be edited, also a light that was black. Killed by: black lights that are left out, a table that
/// lacks
/// them.
#[test]
fn composed_scenes_can_be_edited() {
    let mut arrays = square();
    arrays.lights[1].emission = [0.0; 3];
    let parts = arrays.parts();
    let layout = parts.layout().unwrap();
    let mut memory = AlignedBytes::zeroed(layout.blob.size);
    let mut scratch = AlignedBytes::zeroed(layout.scratch.size);
    let bytes = parts.compose(memory.as_mut(), scratch.as_mut()).unwrap();
    let mut scene = EditableScene::new(bytes).unwrap();
    // behind the light of the triangle
    let index = 1;
    let light = scene.scene().lights[index];
    assert_eq!(light.kind, LightKind::Point as u32);
    scene.edit().light(index as u32, Light { emission: [3.0; 3], ..light }).unwrap();
    assert!(scene.scene().light_alias[index].probability > 0.0);
    scene.seal();
    assert!(Scene::from_bytes(scene.bytes()).is_ok());
}

/// Numbers that nobody expects.
const ODD: [f32; 12] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1.0, 0.0, -0.0, 1e-45, 1.0, 1e9, 1e18, 0.999];

/// One thing that is wrong, or is not.
fn damage(a: &mut Arrays, what: u32, at: usize, number: u32, word: u32) {
    let x = ODD.get(number as usize % 16).copied().unwrap_or(f32::from_bits(word));
    fn pick<T>(v: &mut [T], at: usize) -> Option<&mut T> {
        let n = v.len();
        v.get_mut(at.checked_rem(n)?)
    }
    let k = at % 3;
    let words = |v: &mut [u8]| {
        if let Some(w) = pick(bytemuck::cast_slice_mut::<u8, u32>(v), at) {
            *w = if number % 16 < 12 { x.to_bits() } else { word };
        }
    };
    match what % 20 {
        0 => pick(&mut a.positions, at).into_iter().for_each(|p| p[k] = x),
        1 => pick(&mut a.normals, at).into_iter().for_each(|p| p[k] = x),
        2 => pick(&mut a.uvs, at).into_iter().for_each(|p| p[k % 2] = x),
        3 => pick(&mut a.triangles, at).into_iter().for_each(|t| t[k] = word % 6),
        4 => pick(&mut a.triangle_materials, at).into_iter().for_each(|m| *m = word % 6),
        5 => words(bytemuck::cast_slice_mut(&mut a.materials)),
        6 => pick(&mut a.emission, at).into_iter().for_each(|e| e[k] = x),
        7 => words(bytemuck::cast_slice_mut(&mut a.textures)),
        8 => words(bytemuck::cast_slice_mut(&mut a.lights)),
        9 => words(bytemuck::bytes_of_mut(&mut a.camera)),
        10 => pick(&mut a.names, at).into_iter().for_each(|b| *b = word as u8),
        11 => a.environment.iter_mut().for_each(|(_, t)| pick(t, at).into_iter().for_each(|t| t[k] = x)),
        12 => a.environment.iter_mut().for_each(|(e, _)| words(bytemuck::bytes_of_mut(e))),
        13 => a.triangles.extend([[word % 5, number % 5, 2]; 9]),
        14 => a.triangles.truncate(at % 3),
        15 => a.positions.truncate(at % 5),
        16 => a.materials.truncate(at % 5),
        17 => a.lights.truncate(at % 6),
        18 => a.texels.truncate(at % 7),
        _ => {
            a.media = vec![bytemuck::Zeroable::zeroed(); at % 30];
            words(bytemuck::cast_slice_mut(&mut a.media));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the parts are: an error, or a scene that validates. Killed by: a rule of the blob that composing does
    /// not know,
    /// arithmetic that overflows, an index out of its range.
    #[test]
    fn any_parts_are_an_error_or_a_scene(
        damages in prop::collection::vec((any::<u32>(), any::<usize>(), any::<u32>(), any::<u32>()), 1..4),
        room in 0usize..12_000,
    ) {
        let mut arrays = square();
        for (what, at, number, word) in damages {
            damage(&mut arrays, what, at, number, word);
        }
        let parts = arrays.parts();
        let mut memory = AlignedBytes::zeroed(12_000);
        let mut scratch = AlignedBytes::zeroed(4096);
        let layout = parts.layout();
        match parts.compose(&mut memory.as_mut()[..room], scratch.as_mut()) {
            Ok(bytes) => {
                let bytes: &[u8] = bytes;
                let scene = Scene::from_bytes(bytes);
                prop_assert!(scene.is_ok(), "{:?} of {parts:?}", scene.err());
            }
            Err(ComposeError::Blob(MemoryError::TooSmall { needed, given })) => {
                prop_assert!(given == room && needed > room && layout.map(|l| l.blob.size) == Ok(needed));
            }
            // NaN is not what it is
            Err(e) => prop_assert_eq!(format!("{:?}", layout.err()), format!("{:?}", Some(e))),
        }
    }
}

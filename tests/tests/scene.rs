//! The one door from bytes to a scene: what is valid passes, each fault has its error. That no bytes do harm is in
//! `scene_hostile.rs`, media are in `scene_media.rs`.

use croupier::Scene;
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{ChildFault, Effects, Field, SceneError, SectionFault, SlotFault};
use croupier_tests::blob::{Blob, Parts, alias, widths};
use croupier_tests::walk;

const INF: f32 = f32::INFINITY;
const NAN: f32 = f32::NAN;

/// Kinds of materials; the tiny scene has one of each.
const KINDS: u32 = MaterialKind::ALL.len() as u32;
/// Kinds of lights.
const LIGHTS: u32 = LightKind::ALL.len() as u32;

fn error(blob: &Blob) -> Option<SceneError> {
    Scene::from_bytes(blob.bytes()).err()
}

/// Killed by: any check that refuses what the layout allows.
#[test]
fn valid_scenes_pass() {
    let tiny = Parts::tiny();
    let blob = tiny.blob();
    let scene = Scene::from_bytes(blob.bytes()).unwrap();
    assert_eq!((scene.nodes.len(), scene.leaves.len(), scene.triangles.len()), (2, 3, 4));
    assert_eq!(scene.material_name(4), "dielectric");
    assert_eq!(scene.material_name(KINDS), "");
    assert!(walk::everything(&scene) > 0);
    for (name, parts) in
        [("empty", Parts::empty()), ("one quad of quads", Parts::sheet(1)), ("sheet", Parts::sheet(40))]
    {
        let blob = parts.blob();
        walk::everything(&Scene::from_bytes(blob.bytes()).unwrap_or_else(|e| panic!("{name}: {e}")));
    }
    // Bytes after the blob's own are not looked at; 4-byte alignment is enough.
    let mut padded = vec![0u8; 4];
    padded.extend_from_slice(blob.bytes());
    padded.extend_from_slice(&[7; 61]);
    let padded = Blob::new(&padded);
    assert_eq!(Scene::from_bytes(&padded.bytes()[4..]).unwrap().hash, scene.hash);
    assert_eq!(Scene::from_bytes(&padded.bytes()[3..]).err(), Some(SceneError::Magic));
    let mut moved = vec![0u8; 2];
    moved.extend_from_slice(blob.bytes());
    assert_eq!(Scene::from_bytes(&Blob::new(&moved).bytes()[2..]).err(), Some(SceneError::Misaligned));
    // A black map needs no tables.
    let mut black = tiny.clone();
    black.env_texels.fill([0.0; 3]);
    black.env_alias.clear();
    assert_eq!(error(&black.blob()), None);
    // Lights that emit nothing need no table: a black environment, a map whose scale leaves nothing of it.
    let mut dark = Parts::sheet(3);
    dark.environment[0].radiance = [0.0; 3];
    assert_eq!(error(&dark.blob()), None);
    dark.light_alias.clear();
    assert_eq!(error(&dark.blob()), None);
    let mut scaled = tiny.clone();
    scaled.env_texels.fill([1.0, 0.0, 0.0]);
    scaled.environment[0].radiance = [0.0, 2.0, 2.0];
    (scaled.lights, scaled.light_alias) = (vec![tiny.lights[2]], vec![]);
    scaled.triangles.iter_mut().for_each(|t| t.light = NONE);
    scaled.environment[0].light = 0;
    assert_eq!(error(&scaled.blob()), None);
    scaled.environment[0].radiance[0] = 1.0;
    assert_eq!(error(&scaled.blob()), Some(count(SectionKind::LightAlias, 0)));
}

/// Killed by: taking effects from all materials instead of those in use (`tiny` has every kind, uses two).
#[test]
fn effects_are_those_in_use() {
    let blob = Parts::tiny().blob();
    let lit = Effects::AREA_LIGHTS.with(Effects::ENVIRONMENT).with(Effects::DELTA_LIGHTS).with(Effects::LENS);
    let surfaces = Effects::DIFFUSE.with(Effects::ROUGH_PLASTIC).with(Effects::TEXTURES).with(Effects::SMOOTH_NORMALS);
    assert_eq!(Scene::from_bytes(blob.bytes()).unwrap().effects, lit.with(surfaces));
    let blob = Parts::sheet(2).blob();
    let few = Effects::DIFFUSE.with(Effects::CONSTANT).with(Effects::LENS);
    assert_eq!(Scene::from_bytes(blob.bytes()).unwrap().effects, few);
    let mut pinhole = Parts::empty();
    pinhole.cameras[0].lens_radius = 0.0;
    assert_eq!(Scene::from_bytes(pinhole.blob().bytes()).unwrap().effects, Effects::default());
    for (kind, length) in [(CameraKind::Orthographic, 7.0), (CameraKind::Panoramic, 1.0)] {
        let c = &mut pinhole.cameras[0];
        (c.kind, c.right, c.down) = (kind as u32, [length, 0.0, 0.0], [0.0, -length, 0.0]);
        assert_eq!(Scene::from_bytes(pinhole.blob().bytes()).unwrap().effects, Effects::PROJECTIONS, "{kind:?}");
    }
}

/// Killed by: a path array one longer or shorter.
#[test]
fn depth_is_bounded() {
    let mut parts = Parts::tiny();
    parts.chain(MAX_TREE_DEPTH as usize);
    assert_eq!(error(&parts.blob()), None);
    parts.chain(MAX_TREE_DEPTH as usize + 1);
    let slot = (MAX_TREE_DEPTH - 1) % 8;
    let deep = SceneError::Child { node: MAX_TREE_DEPTH - 1, slot, fault: ChildFault::Deep };
    assert_eq!(error(&parts.blob()), Some(deep));
}

fn number(of: SectionKind, index: u32, field: Field, found: f32) -> SceneError {
    SceneError::Number { of, index, field, found }
}

fn reference(of: SectionKind, index: u32, to: SectionKind, found: u32, count: u32) -> SceneError {
    SceneError::Reference { of, index, to, found, count }
}

fn child(node: u32, slot: u32, fault: ChildFault) -> SceneError {
    SceneError::Child { node, slot, fault }
}

fn slot(leaf: u32, slot: u32, fault: SlotFault) -> SceneError {
    SceneError::Slot { leaf, slot, fault }
}

fn count(kind: SectionKind, n: u64) -> SceneError {
    SceneError::Section { kind, fault: SectionFault::Count(n) }
}

/// Compares through text, so that NaN equals NaN.
fn expect(name: &str, blob: &Blob, expected: SceneError) {
    let found = error(blob).unwrap_or_else(|| panic!("{name}: accepted"));
    assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{name}");
    assert!(!found.to_string().is_empty());
}

type Corruption = (fn(&mut Parts), SceneError);

/// Each row kills the deletion of one check: without it the row's scene is accepted or gives another error.
#[test]
fn every_fault_of_the_records_has_its_error() {
    let tables = Parts::tiny().tables.len() as u32;
    use SectionKind as S;
    let tree: &[Corruption] = &[
        (|p| p.nodes[0].child[4] = 0, child(0, 4, ChildFault::Order { expected: 1, found: 0 })),
        (|p| p.nodes[0].child[4] = 2, child(0, 4, ChildFault::Order { expected: 1, found: 2 })),
        (|p| p.nodes[1].child[7] -= 1, child(1, 7, ChildFault::Order { expected: 2, found: 1 })),
        (|p| p.nodes[1].child[7] += 1, child(1, 7, ChildFault::Order { expected: 2, found: 3 })),
        (|p| p.nodes[1].child[0] &= !(15 << 27), child(1, 0, ChildFault::Count(0))),
        (|p| p.nodes[1].child[0] |= 9 << 27, child(1, 0, ChildFault::Count(9))),
        (|p| p.nodes[0].bounds[0][0] = 1.0, child(0, 0, ChildFault::EmptyBox(1.0))),
        (|p| p.nodes[0].bounds[5][7] = 1.0, child(0, 7, ChildFault::EmptyBox(1.0))),
        (|p| p.nodes[0].bounds[4][1] = NAN, child(0, 1, ChildFault::Bounds(NAN))),
        (|p| p.nodes[0].bounds[4][1] = INF, child(0, 1, ChildFault::Bounds(INF))),
        (|p| p.nodes[0].bounds[1][1] = 1.0, child(0, 1, ChildFault::Bounds(1.0))),
        (|p| p.nodes[0].bounds[0][1] = -2.5, child(0, 1, ChildFault::Outside(-2.5))),
        (|p| p.nodes[1].bounds[5][7] = 0.75, child(1, 7, ChildFault::Outside(0.75))),
        (|p| p.nodes[0].bounds[0][1] = -1.9, slot(0, 0, SlotFault::Outside(-2.0))),
        (|p| p.nodes[0].reserved[3] = 1, SceneError::Reserved { of: S::Nodes, index: 0 }),
        (
            |p| (p.nodes[1].child, p.nodes[1].bounds) = ([NONE; 8], p.nodes[1].bounds),
            SceneError::Unreached { of: S::Nodes, index: 1 },
        ),
        (|p| p.nodes.push(p.nodes[1]), SceneError::Unreached { of: S::Nodes, index: 2 }),
        (|p| p.leaves.push(p.leaves[1]), SceneError::Unreached { of: S::Leaves, index: 3 }),
        (|p| p.nodes.clear(), SceneError::Unreached { of: S::Leaves, index: 0 }),
        (|p| p.leaves[0].triangle[1] = 4, reference(S::Leaves, 0, S::Triangles, 4, 4)),
        (|p| p.leaves[0].triangle[1] = NONE, reference(S::Leaves, 0, S::Triangles, NONE, 4)),
        (|p| p.leaves[0].p[6][1] += 0.5, slot(0, 1, SlotFault::Vertex(2.5))),
        (|p| p.leaves[0].p[1][1] = -0.0, slot(0, 1, SlotFault::Vertex(-0.0))),
        (|p| p.leaves[0].p[8][1] = NAN, slot(0, 1, SlotFault::Vertex(NAN))),
        (|p| p.leaves[0].p[8][2] = 1.0, slot(0, 2, SlotFault::Unused)),
        (|p| p.leaves[0].triangle[7] = 0, slot(0, 7, SlotFault::Unused)),
        (|p| p.leaves[0].triangle[1] = 1, slot(0, 1, SlotFault::Vertex(-2.0))),
        // One triangle twice, its twin never: same vertices, so only the census tells.
        (
            |p| {
                p.triangles[0] = p.triangles[1];
                p.leaves[0].triangle[1] = 1;
                for row in 0..9 {
                    p.leaves[0].p[row][1] = p.leaves[0].p[row][0];
                }
            },
            SceneError::Coverage { triangles: 4, slots: 4 },
        ),
        (|p| p.triangles.push(p.triangles[0]), SceneError::Coverage { triangles: 5, slots: 4 }),
        (|p| p.info[0].bounds_max[1] = 2.5, child(0, 4, ChildFault::Outside(3.0))),
    ];
    let geometry: &[Corruption] = &[
        (|p| p.triangles[1].vertex[2] = 8, reference(S::Triangles, 1, S::Vertices, 8, 8)),
        (|p| p.triangles[3].material = KINDS, reference(S::Triangles, 3, S::Materials, KINDS, KINDS)),
        (|p| p.triangles[0].light = 5, reference(S::Triangles, 0, S::Lights, 5, 5)),
        (|p| p.triangles[0].light = 1, reference(S::Triangles, 0, S::Lights, 1, 5)),
        (|p| p.triangles[0].light = 3, reference(S::Triangles, 0, S::Lights, 3, 5)),
        (|p| p.triangles[0].flags = 2, SceneError::Reserved { of: S::Triangles, index: 0 }),
        (|p| p.vertices[5].p[1] = NAN, number(S::Vertices, 5, Field::Position, NAN)),
        (|p| p.vertices[5].p[0] = -1.1e9, number(S::Vertices, 5, Field::Position, -1.1e9)),
        (|p| p.vertices[5].n[2] = INF, number(S::Vertices, 5, Field::Direction, INF)),
        (|p| p.vertices[2].n[1] = 0.99, number(S::Vertices, 2, Field::Direction, 0.99 * 0.99)),
        (|p| p.vertices[2].n[0] = 3.0, number(S::Vertices, 2, Field::Direction, 3.0)),
        (|p| p.vertices[7].uv[1] = NAN, number(S::Vertices, 7, Field::TextureCoordinate, NAN)),
        (|p| p.info[0].bounds_min[0] = NAN, number(S::Info, 0, Field::Bounds, NAN)),
        (|p| p.info[0].bounds_max[0] = INF, number(S::Info, 0, Field::Bounds, INF)),
        (|p| p.info[0].bounds_min[0] = 5.0, number(S::Info, 0, Field::Bounds, 5.0)),
    ];
    let materials: &[Corruption] = &[
        (|p| p.materials[3].kind = KINDS, SceneError::Kind { of: S::Materials, index: 3, found: KINDS }),
        (|p| p.materials[3].flags = 8, SceneError::Reserved { of: S::Materials, index: 3 }),
        (
            |p| p.materials[3].medium = 0,
            SceneError::Reference { of: S::Materials, index: 3, to: S::Media, found: 0, count: 0 },
        ),
        (|p| p.materials[3].texture = 1, reference(S::Materials, 3, S::Textures, 1, 1)),
        (|p| p.materials[3].table = 0, reference(S::Materials, 3, S::Tables, 0, tables)),
        (
            |p| p.materials[8].table = p.tables.len() as u32 - 63,
            reference(S::Materials, 8, S::Tables, tables - 63, tables),
        ),
        (|p| p.materials[8].table = NONE, reference(S::Materials, 8, S::Tables, NONE, tables)),
        (|p| p.tables[63] = 1.5, number(S::Materials, 8, Field::Reflectance, 1.5)),
        (|p| p.materials[0].reflectance[1] = 1.01, number(S::Materials, 0, Field::Reflectance, 1.01)),
        (|p| p.materials[0].reflectance[1] = NAN, number(S::Materials, 0, Field::Reflectance, NAN)),
        (|p| p.materials[0].alpha = NAN, number(S::Materials, 0, Field::Alpha, NAN)),
        (|p| p.materials[3].alpha = 0.0, number(S::Materials, 3, Field::Alpha, 0.0)),
        (|p| p.materials[5].alpha = 1.5, number(S::Materials, 5, Field::Alpha, 1.5)),
        (|p| p.materials[8].alpha = -0.1, number(S::Materials, 8, Field::Alpha, -0.1)),
        (|p| p.materials[2].eta[1] = -0.2, number(S::Materials, 2, Field::Eta, -0.2)),
        (|p| p.materials[3].k[1] = 1e5, number(S::Materials, 3, Field::Extinction, 1e5)),
        (
            |p| (p.materials[2].eta[1], p.materials[2].k[1]) = (0.0, 0.0),
            number(S::Materials, 2, Field::Extinction, 0.0),
        ),
        (|p| p.materials[4].eta[0] = 0.0, number(S::Materials, 4, Field::Eta, 0.0)),
        (|p| p.materials[6].eta[0] = 1e9, number(S::Materials, 6, Field::Eta, 1e9)),
        (|p| p.materials[7].fdr = 1.0, number(S::Materials, 7, Field::InternalReflectance, 1.0)),
        (|p| p.materials[9].fdr = INF, number(S::Materials, 9, Field::InternalReflectance, INF)),
        (|p| p.textures[0].width = 0, number(S::Textures, 0, Field::Width, 0.0)),
        (|p| p.textures[0].height = 1 << 17, number(S::Textures, 0, Field::Height, 131072.0)),
        (|p| p.textures[0].height = 4, reference(S::Textures, 0, S::Texels, 1, 7)),
        (|p| p.textures[0].first = NONE, reference(S::Textures, 0, S::Texels, NONE, 7)),
        (|p| p.textures[0].flags = 32, SceneError::Reserved { of: S::Textures, index: 0 }),
        (|p| p.names[0] = 0xff, SceneError::Names { lines: u64::from(KINDS), materials: KINDS }),
        (|p| p.names.extend(b"more"), SceneError::Names { lines: u64::from(KINDS), materials: KINDS }),
        (|p| _ = p.names.pop(), SceneError::Names { lines: u64::from(KINDS) - 1, materials: KINDS }),
    ];
    let lights: &[Corruption] = &[
        (|p| p.lights[3].kind = LIGHTS, SceneError::Kind { of: S::Lights, index: 3, found: LIGHTS }),
        (|p| p.lights[3].instance = 1, SceneError::Reserved { of: S::Lights, index: 3 }),
        (|p| p.lights[3].params[5] = 1.0, SceneError::Reserved { of: S::Lights, index: 3 }),
        (|p| p.lights[4].params[0] = -0.0, SceneError::Reserved { of: S::Lights, index: 4 }),
        (|p| p.light_alias[3].probability = 1.5, number(S::LightAlias, 3, Field::Probability, 1.5)),
        (|p| p.light_alias.push(p.light_alias[3]), count(S::LightAlias, 6)),
        (|p| p.lights[3].emission[0] = NAN, number(S::Lights, 3, Field::Emission, NAN)),
        (|p| p.lights[3].vector[0] = 2e9, number(S::Lights, 3, Field::Position, 2e9)),
        (|p| p.lights[4].vector[0] = 0.6, number(S::Lights, 4, Field::Direction, 0.6 * 0.6 + 0.6 * 0.6 + 0.8 * 0.8)),
        (|p| p.lights[4].area = NAN, number(S::Lights, 4, Field::Area, NAN)),
        (|p| p.lights[0].area = 0.0, number(S::Lights, 0, Field::Area, 0.0)),
        (|p| p.lights[0].area = 0.502, number(S::Lights, 0, Field::Area, 0.502)),
        (|p| p.lights[0].emission[1] = -3.5, number(S::Lights, 0, Field::Emission, -3.5)),
        (|p| p.triangles[2].light = NONE, reference(S::Lights, 0, S::Triangles, 2, 4)),
        (|p| p.lights[3] = Light { kind: 1, ..p.lights[3] }, reference(S::Lights, 3, S::Environment, 0, 1)),
        (|p| p.environment.clear(), reference(S::Lights, 2, S::Environment, 0, 0)),
        (|p| _ = p.light_alias.pop(), count(S::LightAlias, 4)),
        (|p| p.light_alias.clear(), count(S::LightAlias, 0)),
        (|p| p.light_alias[3].alias = 5, reference(S::LightAlias, 3, S::LightAlias, 5, 5)),
        (|p| p.light_alias[3].threshold = u32::MAX, {
            let a = alias(&[3, 3, 8, 1, 1])[3].alias;
            reference(S::LightAlias, 3, S::LightAlias, a, 5)
        }),
        (|p| p.light_alias[3].probability = NAN, number(S::LightAlias, 3, Field::Probability, NAN)),
        (|p| p.light_alias[3].probability = 0.0, number(S::LightAlias, 3, Field::Probability, 0.0)),
    ];
    let environment: &[Corruption] = &[
        (|p| p.environment[0].kind = 9, count(S::EnvTexels, 16)),
        (|p| p.environment[0].light = 5, reference(S::Lights, 2, S::Environment, 0, 1)),
        (|p| p.environment.push(p.environment[0]), count(S::Environment, 2)),
        (|p| p.environment[0].radiance[0] = -1.0, number(S::Environment, 0, Field::Emission, -1.0)),
        (|p| p.environment[0].to_local[1] = [0.0, 0.5, 0.0], number(S::Environment, 0, Field::Direction, 0.25)),
        (
            |p| p.environment[0].to_local[1] = p.environment[0].to_local[0],
            number(S::Environment, 0, Field::Direction, 1.0),
        ),
        (|p| p.environment[0].width = 0, number(S::Environment, 0, Field::Width, 0.0)),
        (|p| p.environment[0].height = 1, number(S::Environment, 0, Field::Height, 1.0)),
        (|p| p.environment[0].width = 5, count(S::EnvTexels, 16)),
        (|p| p.env_texels[9][1] = -1.0, number(S::EnvTexels, 9, Field::Emission, -1.0)),
        (|p| p.env_texels[9][1] = NAN, number(S::EnvTexels, 9, Field::Emission, NAN)),
        (
            |p| (p.env_texels[9][1], p.environment[0].radiance[2]) = (1e10, 1e10),
            number(S::Environment, 0, Field::Emission, 1e20),
        ),
        (|p| _ = p.env_alias.pop(), count(S::EnvAlias, 14)),
        (|p| p.env_alias.clear(), count(S::EnvAlias, 0)),
        (|p| p.env_alias[2].alias = 3, reference(S::EnvAlias, 2, S::EnvAlias, 3, 3)),
        (|p| p.env_alias[14].alias = 4, reference(S::EnvAlias, 14, S::EnvAlias, 4, 4)),
        // The black row is never picked, but must not lead out of its table either.
        (|p| (p.env_alias[3].threshold, p.env_alias[3].alias) = (7, 4), reference(S::EnvAlias, 3, S::EnvAlias, 4, 4)),
    ];
    let camera: &[Corruption] = &[
        (|p| p.cameras.clear(), count(S::Cameras, 0)),
        (|p| p.cameras.push(p.cameras[0]), count(S::Cameras, 2)),
        (|p| p.info.clear(), count(S::Info, 0)),
        (|p| p.cameras[0].origin[2] = INF, number(S::Cameras, 0, Field::Position, INF)),
        (|p| p.cameras[0].forward[2] = -1.5, number(S::Cameras, 0, Field::Direction, 2.25)),
        (|p| p.cameras[0].right[1] = NAN, number(S::Cameras, 0, Field::ImagePlane, NAN)),
        (|p| p.cameras[0].down = [0.0; 3], number(S::Cameras, 0, Field::ImagePlane, 0.0)),
        (|p| p.cameras[0].down = [3.0, 0.0, 0.0], number(S::Cameras, 0, Field::ImagePlane, 0.0)),
        (|p| p.cameras[0].kind = 3, SceneError::Kind { of: S::Cameras, index: 0, found: 3 }),
        (|p| p.cameras[0].kind = 1, number(S::Cameras, 0, Field::LensRadius, 0.1)),
        (|p| (p.cameras[0].kind, p.cameras[0].lens_radius) = (2, 0.0), number(S::Cameras, 0, Field::Direction, 0.25)),
        (|p| p.cameras[0].lens_radius = -0.1, number(S::Cameras, 0, Field::LensRadius, -0.1)),
        (|p| p.cameras[0].focus_distance = 0.0, number(S::Cameras, 0, Field::FocusDistance, 0.0)),
        (|p| p.cameras[0].size[0] = 0, number(S::Cameras, 0, Field::Width, 0.0)),
        (|p| p.cameras[0].size[1] = 1 << 20, number(S::Cameras, 0, Field::Height, 1048576.0)),
    ];
    for (topic, rows) in [
        ("tree", tree),
        ("geometry", geometry),
        ("materials", materials),
        ("lights", lights),
        ("environment", environment),
        ("camera", camera),
    ] {
        for (i, (corrupt, expected)) in rows.iter().enumerate() {
            let mut parts = Parts::tiny();
            corrupt(&mut parts);
            expect(&format!("{topic} row {i}"), &parts.blob(), *expected);
        }
    }
    // Faults that need another scene than `tiny`.
    let mut parts = Parts::sheet(1);
    parts.environment[0].kind = 9;
    expect("environment kind", &parts.blob(), SceneError::Kind { of: S::Environment, index: 0, found: 9 });
    let mut parts = Parts::sheet(1);
    parts.env_alias = alias(&[1]);
    expect("tables without a map", &parts.blob(), count(S::EnvAlias, 1));
    let mut parts = Parts::empty();
    parts.environment = Parts::sheet(1).environment;
    expect("environment without light", &parts.blob(), reference(S::Environment, 0, S::Lights, 0, 0));
    let mut parts = Parts::tiny();
    parts.environment[0].light = 3;
    expect("environment of a point light", &parts.blob(), reference(S::Lights, 2, S::Environment, 0, 1));
}

/// Every parameter of every kind just outside its range. Killed by: a parameter that its row lacks or the validator
/// does not check; by the second half, one that is checked where it is not used.
#[test]
fn every_parameter_of_every_kind_is_checked() {
    for (index, kind) in (0u32..).zip(MaterialKind::ALL) {
        let used = kind.facts().parameters;
        for parameter in used {
            let [lo, hi] = parameter.range();
            for bad in [lo.next_down(), hi.next_up(), NAN, INF] {
                let mut parts = Parts::tiny();
                if parameter.compensates() {
                    parts.compensate(index as usize);
                }
                let m = &mut parts.materials[index as usize];
                let field = match parameter {
                    Parameter::Reflectance => (m.reflectance[2] = bad, Field::Reflectance).1,
                    Parameter::Alpha => (m.alpha = bad, Field::Alpha).1,
                    Parameter::RelativeEta => (m.eta[0] = bad, Field::Eta).1,
                    Parameter::ComplexEta => (m.eta[1] = bad, Field::Eta).1,
                    Parameter::InternalReflectance => (m.fdr = bad, Field::InternalReflectance).1,
                    Parameter::TransmittanceTable => (parts.tables[40] = bad, Field::Reflectance).1,
                    Parameter::Principled => {
                        // its first number; the record has a test of its own
                        parts.tables[m.table as usize] = bad;
                        Field::Reflectance
                    }
                    // of the last table of this material alone
                    Parameter::CompensationTable | Parameter::EnergyTable => {
                        *parts.tables.last_mut().unwrap() = bad;
                        Field::Compensation
                    }
                };
                let what = format!("{} with {parameter:?} {bad}", kind.name());
                // all share one table: the first that refers to it is told
                let shares = |k: &MaterialKind| k.facts().parameters.contains(&Parameter::TransmittanceTable);
                let first = MaterialKind::ALL.iter().position(shares).map_or(index, |i| i as u32);
                let index = if *parameter == Parameter::TransmittanceTable { first } else { index };
                expect(&what, &parts.blob(), number(SectionKind::Materials, index, field, bad));
            }
        }
        let unused = |p| !used.contains(&p);
        let mut parts = Parts::tiny();
        let m = &mut parts.materials[index as usize];
        if unused(Parameter::Alpha) {
            m.alpha = -7.0;
        }
        if unused(Parameter::RelativeEta) && unused(Parameter::ComplexEta) {
            m.eta = [-7.0; 3];
        }
        if unused(Parameter::ComplexEta) {
            (m.k, m.eta[1]) = ([-7.0; 3], -7.0);
        }
        if unused(Parameter::InternalReflectance) {
            m.fdr = 7.0;
        }
        assert_eq!(error(&parts.blob()), None, "{}", kind.name());
        if kind.facts().compensates() {
            let mut parts = Parts::tiny();
            parts.compensate(index as usize);
            assert_eq!(error(&parts.blob()), None, "compensated {}", kind.name());
            parts.tables.pop();
            let (found, count) = (parts.materials[index as usize].table, parts.tables.len() as u32);
            let short = reference(SectionKind::Materials, index, SectionKind::Tables, found, count);
            expect("a table that is one entry short", &parts.blob(), short);
        }
        if unused(Parameter::TransmittanceTable) && unused(Parameter::Principled) {
            let tables = parts.tables.len() as u32;
            parts.materials[index as usize].table = 0;
            expect(
                kind.name(),
                &parts.blob(),
                reference(SectionKind::Materials, index, SectionKind::Tables, 0, tables),
            );
        }
    }
}

/// Killed by: dropping a check of `Sections`, in its order.
#[test]
fn every_fault_of_the_frame_has_its_error() {
    use SectionKind as S;
    let good = Parts::tiny().blob();
    let given = good.bytes().len() as u64;
    let header = |edit: fn(&mut Header)| {
        let mut b = good.clone();
        b.header(edit);
        b
    };
    expect("magic", &header(|h| h.magic[7] = b'!'), SceneError::Magic);
    expect("version", &header(|h| h.version = 1), SceneError::Version(1));
    expect("huge", &header(|h| h.length = u64::MAX), SceneError::Truncated { needed: u64::MAX, given });
    expect("reserved", &header(|h| h.reserved[7] = 1), SceneError::Header);
    expect("sections", &header(|h| h.sections = u32::MAX), SceneError::SectionCount(u32::MAX));
    expect("nothing", &Blob::new(&[]), SceneError::Truncated { needed: 64, given: 0 });
    let short = header(|h| h.length = 63);
    expect("shorter than a header", &short, SceneError::Truncated { needed: 64, given: 63 });
    let mut bare = Blob::new(&good.bytes()[..64]);
    bare.header(|h| h.length = 64);
    bare.rehash();
    expect("no table", &bare, SceneError::Truncated { needed: 64 + 21 * 24, given: 64 });
    bare.header(|h| h.sections = 0);
    expect("no sections", &bare, count(S::Info, 0));
    let mut flipped = good.clone();
    let last = flipped.bytes().len() - 1;
    flipped.bytes_mut()[last] ^= 1;
    assert!(matches!(error(&flipped), Some(SceneError::Hash { .. })));

    let entry = |i: usize, edit: fn(&mut Section)| {
        let mut b = good.clone();
        b.section(i, edit);
        b
    };
    let section = |kind, fault| SceneError::Section { kind, fault };
    expect("kind", &entry(4, |s| s.kind = 23), SceneError::UnknownSection(23));
    expect("twice", &entry(4, |s| s.kind = 3), section(S::Triangles, SectionFault::Repeated));
    expect("stride", &entry(4, |s| s.stride = 16), section(S::Vertices, SectionFault::Stride(16)));
    expect("stride 0", &entry(4, |s| s.stride = 0), section(S::Vertices, SectionFault::Stride(0)));
    expect("in the table", &entry(0, |s| s.offset = 384), section(S::Info, SectionFault::Offset(384)));
    expect("off the grid", &entry(20, |s| s.offset += 4), {
        section(S::Names, SectionFault::Offset(table(&good)[20].offset + 4))
    });
    expect("beyond the end", &entry(20, |s| s.count += 1), count(S::Names, table(&good)[20].count + 1));
    expect("overflow", &entry(20, |s| s.count = u64::MAX), count(S::Names, u64::MAX));
    expect("offset overflow", &entry(20, |s| s.offset = u64::MAX - 63), count(S::Names, table(&good)[20].count));
    expect("more than 31 bits", &entry(4, |s| (s.stride, s.count) = (0, 1 << 31)), count(S::Vertices, 1 << 31));
    let mut overlapping = good.clone();
    let offset = table(&good)[3].offset;
    overlapping.section(4, |s| s.offset = offset);
    expect("overlap", &overlapping, section(S::Vertices, SectionFault::Overlaps(S::Triangles)));
}

fn table(blob: &Blob) -> &[Section] {
    bytemuck::cast_slice(&blob.bytes()[64..64 + 21 * size_of::<Section>()])
}

/// The message names the object, its index and the number. Killed by: leaving one of them out.
#[test]
fn messages_name_object_index_and_number() {
    let messages = [
        (number(SectionKind::Vertices, 77, Field::Position, NAN), ["vertices[77]", "position", "NaN"]),
        (reference(SectionKind::Triangles, 5, SectionKind::Materials, 9, 3), ["triangles[5]", "materials[9]", "3"]),
        (child(12, 3, ChildFault::Outside(2.5)), ["nodes[12]", "child 3", "2.5"]),
        (slot(12, 3, SlotFault::Vertex(2.5)), ["leaves[12]", "slot 3", "2.5"]),
        (SceneError::Version(9), ["version 9", "version 4", "blob"]),
        (SceneError::Truncated { needed: 90, given: 12 }, ["90", "12", "bytes"]),
    ];
    for (e, parts) in messages {
        let text = e.to_string();
        assert!(parts.iter().all(|p| text.contains(p)), "{text}");
    }
}

/// The combination of relative errors finds one wrong item among many, and accepts right tables of any length.
/// Killed by: a weight of 0, dropping the rest's share, a tolerance of 1e-2.
#[test]
fn alias_tables_are_checked_to_small_errors() {
    let weights = |n: u32| -> Vec<u32> { (0..n).map(|i| i.wrapping_mul(2654435761) >> 20).collect() };
    for n in [2, 3, 7, 8, 100, 1000, 4096] {
        let mut parts = Parts::sheet(1);
        let mut w = weights(n);
        w[0] = 1000;
        parts.light_alias = alias(&w);
        let total: u64 = w.iter().map(|w| u64::from(*w)).sum();
        for (item, width) in widths(&parts.light_alias).iter().enumerate() {
            let ideal = u64::from(w[item]) as f64 / total as f64 * 4_294_967_296.0;
            assert!((*width as f64 - ideal).abs() < 2.0 * n as f64, "the test's own tables: {width} {ideal}");
        }
        let point = Light { kind: LightKind::Point as u32, triangle: NONE, ..parts.lights[0] };
        parts.lights.resize(n as usize, point);
        assert_eq!(error(&parts.blob()), None, "n = {n}");
        // One item off by 32 sqrt(n) 2^-20 in its probability, or in its threshold.
        let off = 1.0 + 32.0 * f64::from(n).sqrt() as f32 / 1048576.0;
        for item in [0, n as usize / 2, n as usize - 1] {
            let mut wrong = parts.clone();
            wrong.light_alias[item].probability *= off;
            if wrong.light_alias[item].probability > 0.0 {
                assert!(matches!(error(&wrong.blob()), Some(SceneError::AliasTable { .. })), "n = {n}, item {item}");
            }
        }
    }
}

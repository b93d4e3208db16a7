//! Lights of blobs: every field of every kind is checked, and each kind calls for one of its effects.

use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Effects, Field};
use croupier::{Scene, SceneError};
use croupier_tests::blob::{Blob, Parts, alias};

const NAN: f32 = f32::NAN;

fn number(of: SectionKind, index: u32, field: Field, found: f32) -> SceneError {
    SceneError::Number { of, index, field, found }
}

fn reference(of: SectionKind, index: u32, to: SectionKind, found: u32, count: u32) -> SceneError {
    SceneError::Reference { of, index, to, found, count }
}

fn error(blob: &Blob) -> Option<SceneError> {
    Scene::from_bytes(blob.bytes()).err()
}

/// Errors compared as text, because NaN is not itself.
fn expect(name: &str, blob: &Blob, expected: SceneError) {
    let found = error(blob).unwrap_or_else(|| panic!("{name}: accepted"));
    assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{name}");
    assert!(!found.to_string().is_empty());
}

/// Every field of every light kind just outside what it may hold. Killed by: a field that its row lacks or the
/// validator does not check.
#[test]
fn every_field_of_every_light_is_checked() {
    use SectionKind as S;
    let mut tiny = Parts::tiny();
    tiny.lights.push(Light {
        kind: LightKind::Spot as u32,
        triangle: NONE,
        vector: [0.0, 2.0, 0.0],
        emission: [1.0; 3],
        params: [0.0, -0.6, 0.8, 0.5, 0.25, 0.0],
        ..tiny.lights[3]
    });
    tiny.lights.push(Light {
        kind: LightKind::Sun as u32,
        params: [1e-5, 0.0, 0.0, 0.0, 0.0, 0.0],
        vector: [0.0, 0.6, 0.8],
        ..tiny.lights[5]
    });
    let shape =
        |kind: LightKind, params| Light { kind: kind as u32, triangle: SHAPE_TWO_SIDED, params, ..tiny.lights[3] };
    let shapes = [
        shape(LightKind::Sphere, [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),
        shape(LightKind::Rectangle, [0.5, 0.0, 0.0, 0.0, 0.0, 0.25]),
        shape(LightKind::Disk, [0.0, -0.6, 0.8, 0.5, 0.0, 0.0]),
    ];
    tiny.lights.extend(shapes);
    tiny.light_alias = alias(&[3, 3, 8, 1, 1, 1, 1, 1, 1, 1]);
    assert_eq!(error(&tiny.blob()), None);
    for (params, field, found) in [
        ([0.0, -0.6, 0.8, 0.0, 0.0, 0.0], Field::Cone, 0.0),
        ([0.0, -0.6, 0.8, 2.5, 0.0, 0.0], Field::Cone, 2.5),
        ([0.0, -0.6, 0.8, NAN, 0.0, 0.0], Field::Cone, NAN),
        ([0.0, -0.6, 0.8, 0.5, -0.5, 0.0], Field::Cone, -0.5),
    ] {
        let mut parts = tiny.clone();
        parts.lights[5].params = params;
        expect("a cone", &parts.blob(), number(S::Lights, 5, field, found));
    }
    for kind in LightKind::ALL {
        let i = tiny.lights.iter().position(|l| l.kind == *kind as u32).unwrap_or_else(|| panic!("no {kind:?}"));
        let index = i as u32;
        for field in kind.fields() {
            let mut parts = tiny.clone();
            let l = &mut parts.lights[i];
            let expected = match field {
                LightField::Triangle => {
                    l.area *= 1.01;
                    number(S::Lights, index, Field::Area, 0.505)
                }
                LightField::Environment => {
                    parts.environment[0].light = 9;
                    reference(S::Lights, index, S::Environment, 0, 1)
                }
                LightField::Position => {
                    l.vector[1] = MAX_COORDINATE.next_up();
                    number(S::Lights, index, Field::Position, MAX_COORDINATE.next_up())
                }
                LightField::Direction => {
                    l.vector = [0.0, 0.0, 0.9];
                    number(S::Lights, index, Field::Direction, 0.9 * 0.9)
                }
                LightField::Disk => {
                    l.params[0] = 1.5;
                    number(S::Lights, index, Field::Cone, 1.5)
                }
                LightField::Shape => {
                    l.triangle = 4;
                    SceneError::Reserved { of: S::Lights, index }
                }
                LightField::Radius => {
                    l.params[0] = 0.0;
                    number(S::Lights, index, Field::ShapeSize, 0.0)
                }
                LightField::Circle => {
                    l.params[3] = NAN;
                    number(S::Lights, index, Field::ShapeSize, NAN)
                }
                LightField::HalfEdges => {
                    l.params[3] = 0.125;
                    number(S::Lights, index, Field::Edges, 0.2)
                }
                LightField::Cone => {
                    l.params[4] = 0.75;
                    number(S::Lights, index, Field::Cone, 0.75)
                }
                LightField::Emission => {
                    l.emission[2] = MAX_EMISSION.next_up();
                    number(S::Lights, index, Field::Emission, MAX_EMISSION.next_up())
                }
            };
            expect(&format!("{} with {field:?}", kind.name()), &parts.blob(), expected);
        }
        let mut parts = tiny.clone();
        parts.lights[i].params[5] = 1.0;
        let unused = SceneError::Reserved { of: S::Lights, index };
        if *kind == LightKind::Rectangle {
            parts.lights[i].instance = 1;
        }
        expect(kind.name(), &parts.blob(), unused);
        // each kind calls for one of its effects
        let effects = Scene::from_bytes(tiny.blob().bytes()).unwrap().effects;
        assert!(effects.intersects(Effects::of_light(*kind)), "{}", kind.name());
    }
}

//! Principled materials in scene blobs: each fault of their records, tables and textures has its error.

use croupier::Scene;
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Field, SceneError};
use croupier_tests::blob::{Blob, Parts};

fn error(blob: &Blob) -> Option<SceneError> {
    Scene::from_bytes(blob.bytes()).err()
}

#[track_caller]
fn expect(name: &str, blob: &Blob, expected: SceneError) {
    assert_eq!(error(blob), Some(expected), "{name}");
}

fn number(of: SectionKind, index: u32, field: Field, found: f32) -> SceneError {
    SceneError::Number { of, index, field, found }
}

fn reference(of: SectionKind, index: u32, to: SectionKind, found: u32, count: u32) -> SceneError {
    SceneError::Reference { of, index, to, found, count }
}

/// Every field of a principled material's record and of its tables. Killed by: a field that is not checked.
#[test]
fn records_of_principled_materials_are_checked() {
    use SectionKind as S;
    let tiny = Parts::tiny();
    let index = MaterialKind::Principled as u32;
    let m = tiny.materials[index as usize];
    let at = m.table as usize;
    let [record] = *PrincipledRecord::read::<1>(&tiny.tables, m.table).unwrap();
    type Corrupt = fn(&mut PrincipledRecord);
    let shares: [Corrupt; 12] = [
        |r| r.metalness = -0.1,
        |r| r.roughness = -0.1,
        |r| r.transmission = -0.1,
        |r| r.coat = -0.1,
        |r| r.opacity = -0.1,
        |r| r.f90 = -0.1,
        |r| r.f0[1] = -0.1,
        |r| r.sheen_color[2] = -0.1,
        |r| r.coat_layer.albedo[31] = -0.1,
        |r| r.coat_layer.nodes[3] = -0.1,
        |r| r.sheen_layer.albedo[0] = -0.1,
        |r| r.sheen_layer.nodes[0] = -0.1,
    ];
    let others: [(Corrupt, SceneError); 12] = [
        (|r| r.coat_alpha = 0.0, number(S::Materials, index, Field::Alpha, 0.0)),
        (|r| r.sheen_alpha = 0.001, number(S::Materials, index, Field::SheenWidth, 0.001)),
        (|r| r.eta = 11.0, number(S::Materials, index, Field::Eta, 11.0)),
        (|r| r.eta = 1.001, number(S::Materials, index, Field::Eta, 1.001)),
        (|r| r.normal_scale = 1001.0, number(S::Materials, index, Field::NormalScale, 1001.0)),
        (|r| r.flags = 4, SceneError::Reserved { of: S::Materials, index }),
        (|r| r.textures[5].texture = 1, reference(S::Materials, index, S::Textures, 1, 1)),
        (|r| r.textures[3].transform[1][2] = 2e9, number(S::Materials, index, Field::TextureCoordinate, 2e9)),
        (|r| r.reflection = NONE, reference(S::Materials, index, S::Tables, NONE, 0)),
        (|r| r.reflection += 1 << 20, reference(S::Materials, index, S::Tables, 0, 0)),
        (|r| r.energy = NONE - 1, reference(S::Materials, index, S::Tables, NONE - 1, 0)),
        (|r| r.energy = 1 << 20, reference(S::Materials, index, S::Tables, 1 << 20, 0)),
    ];
    let shares = shares.map(|corrupt| (corrupt, number(S::Materials, index, Field::Reflectance, -0.1)));
    for (i, (corrupt, expected)) in shares.into_iter().chain(others).enumerate() {
        let (mut parts, mut r) = (tiny.clone(), record);
        corrupt(&mut r);
        parts.tables[at..at + PrincipledRecord::ENTRIES].copy_from_slice(bytemuck::cast_slice(&[r]));
        let count = parts.tables.len() as u32;
        let expected = match expected {
            SceneError::Reference { of, index, to: S::Tables, found: 0, .. } => {
                SceneError::Reference { of, index, to: S::Tables, found: r.reflection, count }
            }
            SceneError::Reference { of, index, to: S::Tables, found, .. } => {
                SceneError::Reference { of, index, to: S::Tables, found, count }
            }
            other => other,
        };
        expect(&format!("record, row {i}"), &parts.blob(), expected);
    }
    let (rows, energy) = (record.reflection as usize, record.energy as usize);
    for (entry, bad, field) in [
        (rows, 1.5, Field::Reflectance),
        (rows + 2, 5.0, Field::Compensation),
        (rows + ReflectionRow::ENTRIES - 1, -0.5, Field::Reflectance),
        (energy + EnergyRow::ENTRIES - 1, 0.0, Field::Compensation),
        (energy, 2.0, Field::Compensation),
    ] {
        let mut parts = tiny.clone();
        parts.tables[entry] = bad;
        expect(&format!("entry {entry}"), &parts.blob(), number(S::Materials, index, field, bad));
    }
    let mut parts = tiny.clone();
    parts.textures[0].flags = TEXTURE_LINEAR | TEXTURE_MIRROR << TEXTURE_WRAP_V;
    parts.materials[8].texture = NONE;
    assert_eq!(error(&parts.blob()), None, "a linear texture of a principled material");
    parts.materials[0].texture = 0;
    expect("a linear texture elsewhere", &parts.blob(), SceneError::Reserved { of: S::Materials, index: 0 });
    parts.textures[0].flags = 3 << TEXTURE_WRAP_U;
    expect("an unknown wrapping", &parts.blob(), SceneError::Reserved { of: S::Textures, index: 0 });
}

//! Media in scene blobs: what is valid passes, each fault has its error, and effects are those of media in use.

use croupier::Scene;
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Effects, Field, SceneError, SectionFault};
use croupier_tests::blob::{Blob, Parts, majorants};
use croupier_tests::walk;

const INF: f32 = f32::INFINITY;
const NAN: f32 = f32::NAN;

fn error(blob: &Blob) -> Option<SceneError> {
    Scene::from_bytes(blob.bytes()).err()
}

fn number(of: SectionKind, index: u32, field: Field, found: f32) -> SceneError {
    SceneError::Number { of, index, field, found }
}

fn reference(to: SectionKind, found: u32, count: u32) -> SceneError {
    SceneError::Reference { of: SectionKind::Media, index: 1, to, found, count }
}

/// Killed by: any check that refuses what the layout allows; effects of all materials instead of those in use.
#[test]
fn valid_media_pass_and_call_for_their_effects() {
    let mut parts = Parts::smoky();
    let blob = parts.blob();
    let scene = Scene::from_bytes(blob.bytes()).unwrap();
    walk::everything(&scene);
    let media = |parts: &Parts| {
        let blob = parts.blob();
        let effects = Scene::from_bytes(blob.bytes()).unwrap().effects;
        (effects.contains(Effects::MEDIA), effects.contains(Effects::GRID_MEDIA))
    };
    assert_eq!(media(&parts), (true, true));
    parts.triangles[2].material = 0;
    assert_eq!(media(&parts), (true, true));
    parts.triangles[3].material = 0;
    assert_eq!(media(&parts), (true, false));
    parts.triangles.iter_mut().for_each(|t| t.material = 0);
    assert_eq!(media(&parts), (false, false));
    assert_eq!(media(&Parts::tiny()), (false, false));

    // The ends of every range, as many media as there may be, all with the one grid.
    let mut parts = Parts::smoky();
    parts.media[1].sigma_a = [0.0, MAX_COEFFICIENT, 0.0];
    parts.media[1].sigma_s = [MAX_COEFFICIENT; 3];
    parts.media[1].emission = [MAX_EMISSION; 3];
    parts.media[1].g = MAX_ANISOTROPY;
    parts.media[0].g = -MAX_ANISOTROPY;
    parts.media[1].bounds_max[1] = MAX_COORDINATE;
    parts.densities[7] = MAX_COEFFICIENT;
    parts.majorants.fill(MAX_MAJORANT);
    parts.media.resize(MAX_MEDIA, parts.media[1]);
    walk::everything(&Scene::from_bytes(parts.blob().bytes()).unwrap());
}

type Corruption = (fn(&mut Parts), SceneError);

/// Each row kills the deletion of one check: without it the row's scene is accepted or gives another error.
#[test]
fn every_fault_of_media_has_its_error() {
    use SectionKind as S;
    let reserved = |index| SceneError::Reserved { of: S::Media, index };
    let rows: &[Corruption] = &[
        (
            |p| p.media.resize(MAX_MEDIA + 1, p.media[0]),
            SceneError::Section { kind: S::Media, fault: SectionFault::Count(MAX_MEDIA as u64 + 1) },
        ),
        (|p| p.media[1].kind = 2, SceneError::Kind { of: S::Media, index: 1, found: 2 }),
        (|p| p.media[0].reserved[1] = 1, reserved(0)),
        (|p| p.media[1].reserved[0] = 1, reserved(1)),
        (|p| p.media[0].sigma_a[2] = -0.1, number(S::Media, 0, Field::Absorption, -0.1)),
        (|p| p.media[0].sigma_a[0] = NAN, number(S::Media, 0, Field::Absorption, NAN)),
        (|p| p.media[1].sigma_a[1] = INF, number(S::Media, 1, Field::Absorption, INF)),
        (|p| p.media[0].sigma_a[1] = 1.1e18, number(S::Media, 0, Field::Absorption, 1.1e18)),
        (|p| p.media[0].sigma_s[2] = -0.1, number(S::Media, 0, Field::Scattering, -0.1)),
        (|p| p.media[1].sigma_s[0] = NAN, number(S::Media, 1, Field::Scattering, NAN)),
        (|p| p.media[0].sigma_s[1] = 1.1e18, number(S::Media, 0, Field::Scattering, 1.1e18)),
        (|p| p.media[0].emission[2] = -1.0, number(S::Media, 0, Field::Emission, -1.0)),
        (|p| p.media[1].emission[0] = INF, number(S::Media, 1, Field::Emission, INF)),
        (|p| p.media[0].g = 0.995, number(S::Media, 0, Field::Anisotropy, 0.995)),
        (|p| p.media[1].g = -1.0, number(S::Media, 1, Field::Anisotropy, -1.0)),
        (|p| p.media[1].g = NAN, number(S::Media, 1, Field::Anisotropy, NAN)),
        // What a homogeneous medium has no use for.
        (|p| p.media[0].bounds_min[2] = 1.0, reserved(0)),
        (|p| p.media[0].bounds_max[0] = -0.0, reserved(0)),
        (|p| p.media[0].cells[1] = 1, reserved(0)),
        (|p| p.media[0].first_density = 1, reserved(0)),
        (|p| p.media[0].first_majorant = 1, reserved(0)),
        // Boxes.
        (|p| p.media[1].bounds_min[0] = NAN, number(S::Media, 1, Field::Bounds, NAN)),
        (|p| p.media[1].bounds_max[2] = INF, number(S::Media, 1, Field::Bounds, INF)),
        (|p| p.media[1].bounds_min[1] = -1.1e9, number(S::Media, 1, Field::Bounds, -1.1e9)),
        (|p| p.media[1].bounds_max[1] = -0.5, number(S::Media, 1, Field::Bounds, -0.5)),
        (|p| p.media[1].bounds_max[1] = -0.6, number(S::Media, 1, Field::Bounds, -0.6)),
        (
            |p| (p.media[1].bounds_min[0], p.media[1].bounds_max[0]) = (0.0, 1e-40),
            number(S::Media, 1, Field::Bounds, 1e-40),
        ),
        (|p| p.media[1].cells[0] = 0, number(S::Media, 1, Field::Cells, 0.0)),
        (|p| p.media[1].cells[2] = (1 << 16) + 1, number(S::Media, 1, Field::Cells, 65537.0)),
        // Values outside their sections; the largest grid has 2^48 cells.
        (|p| p.media[1].cells = [1 << 16; 3], reference(S::Densities, 2, 93)),
        (|p| p.media[1].cells[0] = 7, reference(S::Densities, 2, 93)),
        (|p| p.media[1].first_density = 4, reference(S::Densities, 4, 93)),
        (|p| p.media[1].first_density = NONE, reference(S::Densities, NONE, 93)),
        (|p| p.media[1].first_majorant = 2, reference(S::Majorants, 2, 5)),
        (|p| p.media[1].first_majorant = NONE, reference(S::Majorants, NONE, 5)),
        (|p| p.densities.clear(), reference(S::Densities, 2, 0)),
        (|p| p.majorants.truncate(4), reference(S::Majorants, 1, 4)),
        (|p| p.densities[2] = -1e-30, number(S::Densities, 2, Field::Density, -1e-30)),
        (|p| p.densities[91] = NAN, number(S::Densities, 91, Field::Density, NAN)),
        (|p| p.densities[50] = INF, number(S::Densities, 50, Field::Density, INF)),
        (|p| p.densities[50] = 1.1e18, number(S::Densities, 50, Field::Density, 1.1e18)),
        (|p| p.media[1].first_density = 1, number(S::Densities, 1, Field::Density, -1.0)),
        (|p| p.majorants[3] = NAN, number(S::Majorants, 3, Field::Majorant, NAN)),
        (|p| p.majorants[3] = INF, number(S::Majorants, 3, Field::Majorant, INF)),
        (|p| p.majorants[4] = 0.0, number(S::Majorants, 4, Field::Majorant, 0.0)),
        // Media come before the materials that refer to them.
        (
            |p| p.materials[3].medium = 2,
            SceneError::Reference { of: S::Materials, index: 3, to: S::Media, found: 2, count: 2 },
        ),
        (|p| (p.materials[3].medium, p.media[1].g) = (2, 2.0), number(S::Media, 1, Field::Anisotropy, 2.0)),
    ];
    for (i, (corrupt, expected)) in rows.iter().enumerate() {
        let mut parts = Parts::smoky();
        corrupt(&mut parts);
        let found = error(&parts.blob()).unwrap_or_else(|| panic!("row {i}: accepted"));
        // Through text, so that NaN equals NaN.
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "row {i}");
        assert!(!found.to_string().is_empty());
    }
}

/// Every majorant at its least value passes, one step below it does not, for each cell that may be the largest.
/// Killed by: a brick without its neighbours, or with two layers of them; a margin in `f32`; bricks counted in another
/// order.
#[test]
fn majorants_are_checked_to_the_last_bit() {
    for cells in [[6u32, 3, 5], [1, 1, 1], [4, 4, 4], [5, 1, 9], [13, 2, 2]] {
        let mut parts = Parts::smoky();
        let n = cells.iter().product::<u32>() as usize;
        parts.media[1] = Medium { cells, first_density: 0, first_majorant: 0, ..parts.media[1] };
        for peak in 0..n {
            parts.densities = (0..n).map(|i| if i == peak { 1.3 } else { 0.01 }).collect();
            parts.majorants = majorants(cells, &parts.densities);
            assert_eq!(error(&parts.blob()), None, "{cells:?}, peak {peak}");
            let brick = peak % parts.majorants.len();
            let less = parts.majorants[brick].next_down();
            parts.majorants[brick] = less;
            let expected = number(SectionKind::Majorants, brick as u32, Field::Majorant, less);
            assert_eq!(error(&parts.blob()), Some(expected), "{cells:?}, peak {peak}");
        }
    }
}

//! Scenes composed from arrays in the caller's memory, against those that the host bakes from the same description.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::compose::{ComposeError, LightSource, PerRecord, SceneParts, Sides, Surround, View};
use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Field, SceneError};
use croupier::unstable::simd::Mask8;
use croupier::{EditableScene, MemoryError, Scene};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::description::*;
use croupier_tests::arrays::{Arrays, composed};
use croupier_tests::geometry::{Ray, Rng, Tri, packet, soup};
use croupier_tests::scenes::{blob, cornell, everything};

/// Scenes that the host bakes.
fn scenes() -> Vec<(&'static str, SceneDescription)> {
    let mut showcase = builtin::showcase();
    showcase.camera.size = [40, 27];
    // tables of compensation are the host's
    showcase.materials.iter_mut().for_each(|m| m.compensated = false);
    let mut room = builtin::cornell_box();
    room.camera.size = [32, 32];
    vec![
        ("Cornell box", room),
        ("small Cornell box", cornell([24, 24])),
        ("everything", everything([40, 30])),
        ("showcase", showcase),
    ]
}

/// Everything but the tree and the choice among lights is what the host writes, to the last bit. Killed by: a formula of
/// areas, normals or tables of plastics that differs from the host's, a light too many, an order that differs.
#[test]
fn composed_records_are_those_of_the_baker() {
    for (name, description) in scenes() {
        let baked = blob(&description);
        let host = Scene::from_bytes(&baked).unwrap();
        let arrays = Arrays::of(&host);
        let bytes = composed(&arrays.parts());
        let core = Scene::from_bytes(&bytes).unwrap();
        let bits = |s: &Scene<'_>| {
            let lists: [&[u8]; 12] = [
                bytemuck::bytes_of(s.info),
                bytemuck::bytes_of(s.camera),
                bytemuck::cast_slice(s.materials),
                bytemuck::cast_slice(s.tables),
                bytemuck::cast_slice(s.lights),
                bytemuck::cast_slice(s.textures),
                bytemuck::cast_slice(s.texels),
                bytemuck::cast_slice(s.env_texels),
                bytemuck::bytes_of(s.environment.unwrap_or(&bytemuck::Zeroable::zeroed())),
                bytemuck::cast_slice(s.media),
                s.names,
                &[],
            ];
            lists.map(<[u8]>::to_vec)
        };
        let (ours, theirs) = (bits(&core), bits(&host));
        for (list, (a, b)) in ours.iter().zip(&theirs).enumerate().take(10) {
            assert!(a == b, "{name}: list {list}");
        }
        assert_eq!(core.effects, host.effects, "{name}");
        let flat = |t: &Triangle| Triangle { flags: t.flags & TRIANGLE_SMOOTH, ..*t };
        for (a, b) in core.triangles.iter().zip(host.triangles) {
            assert_eq!(bytemuck::bytes_of(&flat(a)), bytemuck::bytes_of(&flat(b)), "{name}");
        }
        assert_eq!(core.triangles.len(), host.triangles.len());
        for (a, b) in core.light_alias.iter().zip(host.light_alias) {
            assert!((a.probability - b.probability).abs() <= 1e-6 * b.probability + 1e-9, "{name}: {a:?} {b:?}");
        }
        for (a, b) in core.env_alias.iter().zip(host.env_alias) {
            assert!((a.probability - b.probability).abs() <= 1e-6 * b.probability + 1e-9, "{name}: {a:?} {b:?}");
        }
        assert_eq!(core.env_alias.len(), host.env_alias.len());
        assert!(EditableScene::new(bytes).is_ok(), "{name}");
    }
}

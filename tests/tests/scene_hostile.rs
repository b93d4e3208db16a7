//! The one door from bytes to a scene, for bytes that nobody meant: truncated, flipped, replaced. Each is an error, or a
//! scene in which everything can be followed.

use croupier::Scene;
use croupier::unstable::scene::blob::LEAF_BIT;
use croupier_tests::blob::{Blob, Parts};
use croupier_tests::walk;
use proptest::prelude::*;

fn is_refused(blob: &Blob) -> bool {
    Scene::from_bytes(blob.bytes()).is_err()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Killed by: any slice access in `Sections` that is not checked.
    #[test]
    fn truncation_is_an_error(cut in 0usize..1 << 14, fix in any::<bool>()) {
        let good = Parts::tiny().blob();
        let cut = cut % good.bytes().len();
        let mut b = Blob::new(&good.bytes()[..cut]);
        if fix && cut >= 64 {
            b.header(|h| h.length = cut as u64);
            b.rehash();
        }
        // The last section's bytes end the blob, so every cut loses something.
        prop_assert!(is_refused(&b));
    }

    /// Killed by: not verifying the hash.
    #[test]
    fn flipped_bits_are_an_error(flips in prop::collection::hash_set(0usize..1 << 20, 1..4)) {
        let mut b = Parts::tiny().blob();
        let bits = b.bytes().len() * 8;
        let flips: std::collections::HashSet<usize> = flips.iter().map(|f| f % bits).collect();
        for f in flips {
            b.bytes_mut()[f / 8] ^= 1 << (f % 8);
        }
        prop_assert!(is_refused(&b));
    }

    /// With a valid hash: an error, or a scene in which following every index stays in range (the walk would panic).
    /// Killed by: dropping any range check of an index.
    #[test]
    fn flipped_bits_with_a_valid_hash_do_no_harm(flips in prop::collection::vec((0usize..1 << 20, 0u32..32), 1..4)) {
        let mut b = Parts::smoky().blob();
        let words = (b.bytes().len() - 64) / 4;
        for (word, bit) in flips {
            b.bytes_mut()[64 + word % words * 4 + bit as usize / 8] ^= 1 << (bit % 8);
        }
        b.rehash();
        if let Ok(scene) = Scene::from_bytes(b.bytes()) {
            walk::everything(&scene);
        }
    }

    /// Words replaced by telling numbers: small, huge, all ones, NaN, infinities.
    #[test]
    fn hostile_words_do_no_harm(edits in prop::collection::vec((0usize..1 << 20, hostile()), 1..4)) {
        let mut b = Parts::smoky().blob();
        let words = (b.bytes().len() - 64) / 4;
        for (word, x) in edits {
            let at = 64 + word % words * 4;
            b.bytes_mut()[at..at + 4].copy_from_slice(&x.to_le_bytes());
        }
        b.rehash();
        if let Ok(scene) = Scene::from_bytes(b.bytes()) {
            walk::everything(&scene);
        }
    }

    /// Killed by: unchecked sums or products in `Sections`.
    #[test]
    fn hostile_section_tables_do_no_harm(
        edits in prop::collection::vec((0usize..19, 0u32..23, 0u32..5, hostile(), hostile(), any::<bool>()), 1..6),
        sections in 0u32..40,
    ) {
        let mut b = Parts::tiny().blob();
        for (entry, kind, which, low, high, wide) in edits {
            let x = u64::from(low) | if wide { u64::from(high) << 32 } else { 0 };
            b.section(entry, |s| match which {
                0 => s.kind = kind,
                1 => s.stride = low,
                2 => s.offset = x,
                3 => s.offset = u64::from(low % 256) * 64,
                _ => s.count = x,
            });
        }
        if sections > 20 {
            b.header(|h| h.sections = sections - 20);
        }
        if let Ok(scene) = Scene::from_bytes(b.bytes()) {
            walk::everything(&scene);
        }
    }

    /// Noise after a plausible header.
    #[test]
    fn noise_does_no_harm(noise in prop::collection::vec(any::<u8>(), 0..2048), sections in 0u32..17) {
        let mut bytes = Parts::tiny().blob().bytes()[..64].to_vec();
        bytes.extend_from_slice(&noise);
        let mut b = Blob::new(&bytes);
        let length = bytes.len() as u64;
        b.header(|h| (h.length, h.sections) = (length, sections));
        b.rehash();
        prop_assert!(is_refused(&b));
    }
}

/// Numbers at the edges of what an index, a size or a float can be.
fn hostile() -> impl Strategy<Value = u32> {
    prop_oneof![
        0u32..20,
        Just(u32::MAX),
        Just(1 << 31),
        Just(LEAF_BIT | 1 << 27),
        Just(LEAF_BIT | 8 << 27 | 1),
        Just(f32::NAN.to_bits()),
        Just(f32::INFINITY.to_bits()),
        Just((-1.0f32).to_bits()),
        Just(1e38f32.to_bits()),
        Just(1e-40f32.to_bits()),
        (0u32..32).prop_map(|b| 1 << b),
        any::<u32>(),
    ]
}

//! Guides in media.

use super::*;

/// Vertices in media learn apart from surfaces, whichever way those face, and keep that when saved, loaded and merged.
/// Killed by: an octree that both share, one that is not saved, one that is not merged, or into that of surfaces.
#[test]
fn media_have_leaves_of_their_own() {
    let mut random = Random(12);
    with_guide(1 << 18, |guide, log| {
        let p = Vec3x8::splat(0.4, 0.4, 0.4);
        let at = |g: &Guide<'_>, n| g.at(p, n, [F32x8::splat(0.5); 3], Mask8::all_lanes());
        let leaf = at(guide, None).leaf.lane(0);
        log.clear();
        (0..1000).for_each(|_| {
            log.add(leaf, UNKNOWN_SHARE, random.next(), 1.0, 0.1);
        });
        guide.learn(0.0, core::iter::once(&*log));
        let check = |g: &Guide<'_>| {
            assert!(at(g, None).known.all());
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    let n: [f32; 3] = core::array::from_fn(|i| if i == axis { sign } else { 0.2 });
                    assert!(at(g, Some(Vec3x8::splat(n[0], n[1], n[2]))).known.none(), "{n:?}");
                }
            }
        };
        check(guide);
        let mut bytes = std::vec![0; guide.saved_len()];
        guide.save(&mut bytes).expect("room for the guide");
        guide.reset();
        assert!(at(guide, None).known.none());
        guide.load(&bytes).expect("a guide");
        check(guide);
        guide.reset();
        guide.merge(&bytes).expect("a guide");
        check(guide);
    });
}

//! What a guide has learned, as the camera sees it.

use croupier::unstable::film::{Aov, AovSet};
use croupier::unstable::learn::Guiding;
use croupier::{Scene, Settings, Strategy};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::description::{Model, SceneDescription};
use croupier_host::drive::{GuideView, Options, Rendered, Target, Unobserved, drive};
use croupier_tests::scenes::{add_quad, facing_z};

fn render(guiding: Guiding, guide_view: bool) -> Rendered {
    render_scene(&builtin::cornell_blocks(), guiding, guide_view)
}

/// The box with blocks in it, a picture of another shape than its own, so that some rays meet nothing.
fn render_scene(scene: &SceneDescription, guiding: Guiding, guide_view: bool) -> Rendered {
    let bytes = bake(scene, &BakeOptions::default(), |_, _| {}).unwrap().bytes;
    let scene = Scene::from_bytes(&bytes).unwrap();
    let mut s = Settings { size: [61, 20], strategy: Strategy::parse("ears").unwrap(), ..Settings::for_scene(&scene) };
    s.aovs = AovSet::of(&[Aov::Normal, Aov::Alpha]);
    s.learning.guiding = guiding;
    drive(&bytes, &Options { guide_view, ..Options::new(s, Target::Spp(64)) }, &Unobserved).unwrap()
}

fn view(r: &Rendered) -> &GuideView {
    r.guide_view.as_ref().unwrap()
}

/// Pixels that show something on a surface with one normal, those whose mean direction is behind it, and the longest of the
/// others. `first_hits`: a render with the normals of what is seen.
fn facing(view: &GuideView, first_hits: &Rendered) -> (u32, u32, f32) {
    let normals = first_hits.channels(Aov::Normal).unwrap();
    let (mut known, mut away, mut longest) = (0, 0, 0.0f32);
    for (i, (share, d)) in view.share.iter().zip(&view.direction).enumerate() {
        let n = [0, 1, 2].map(|axis| normals[axis][i]);
        // not at edges, where the pixel has several normals
        if *share > 0.0 && n.iter().map(|x| x * x).sum::<f32>() > 0.98 {
            known += 1;
            away += u32::from(n.iter().zip(d).map(|(n, d)| n * d).sum::<f32>() <= 0.0);
            longest = longest.max(d.iter().map(|x| x * x).sum::<f32>().sqrt());
        }
    }
    (known, away, longest)
}

/// Killed by: normals away from the camera, pixels in another order, directions that are not the guide's, a view of what no
/// ray meets.
#[test]
fn guides_are_seen_where_they_have_learned() {
    let r = render(Guiding::On, true);
    let alpha = &r.channels(Aov::Alpha).unwrap()[0];
    for (i, (share, d)) in view(&r).share.iter().zip(&view(&r).direction).enumerate() {
        let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!((0.0..=0.75).contains(share) && length < 1.0 && (*share > 0.0 || length == 0.0), "{i}: {share} {d:?}");
        assert!(*share == 0.0 || alpha[i] > 0.0, "{i}: what no ray meets");
    }
    let (known, away, longest) = facing(view(&r), &r);
    assert!(known > 200 && away == 0, "{away} of {known}");
    assert!((0.3..0.95).contains(&longest), "{longest}");
}

/// Killed by: a view of a render without a guide, one that nobody has asked for.
#[test]
fn there_is_a_view_of_what_there_is() {
    assert!(render(Guiding::Off, true).guide_view.is_none());
    assert!(render(Guiding::On, false).guide_view.is_none());
    let r = render(Guiding::Auto, true);
    assert_eq!((view(&r).share.len(), view(&r).direction.len()), (61 * 20, 61 * 20));
}

/// Killed by: a view that ends at glass, or stays in front of it.
#[test]
fn guides_are_seen_through_glass() {
    let mut scene = builtin::cornell_blocks();
    let glass = scene.add_material("glass", Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 });
    for z in [2.0, 2.5] {
        add_quad(&mut scene, "pane", glass, facing_z(3.0, z, 1.0));
    }
    let (r, without) = (render_scene(&scene, Guiding::On, true), render(Guiding::Off, false));
    let (known, away, _) = facing(view(&r), &without);
    assert!(known > 200 && away == 0, "{away} of {known}");
}

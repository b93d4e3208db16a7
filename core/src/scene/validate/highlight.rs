//! How bright the light is that camera samples show by chance alone. What a mirror or another narrow lobe shows of an
//! emitter, seen from a surface that scatters widely, is hardly found by light samples: they would have to find the
//! surface that shows it. Few samples of a picture find such a highlight, and each is as bright as the emitter. Where no
//! lobe is narrow, and where rays cannot meet the emitter, light samples find all there is.

use crate::scene::Records;
use crate::scene::blob::*;

/// GGX width below which a lobe is narrow. A wider one meets a small light with a density so far below that of light samples
/// that multiple importance sampling leaves little of it.
const NARROW: f32 = 0.05;

/// Largest radiance, of any channel, that narrow lobes may show of the emitters of a validated scene that rays can meet;
/// 0 without such lobes. `brightest` are the largest values of the environment map by channel.
pub(super) fn highlight(scene: &Records<'_>, brightest: [f32; 3]) -> f32 {
    if !scene.materials.iter().any(|m| is_narrow(scene, m)) {
        return 0.0;
    }
    let sky = scene.environment.map_or([0.0; 3], |e| match EnvironmentKind::from_u32(e.kind) {
        Some(EnvironmentKind::Constant) => e.radiance,
        _ => {
            let [r, g, b] = brightest;
            let [x, y, z] = e.radiance;
            [r * x, g * y, b * z]
        }
    });
    let met = |l: &&Light| LightKind::from_u32(l.kind).is_some_and(|k| k == LightKind::Area || k.has_shape());
    let lights = scene.lights.iter().filter(met).flat_map(|l| &l.emission);
    sky.iter().chain(lights).fold(0.0, |all, x| x.max(all))
}

/// Has a material a lobe that is narrow? Textures that make it so count as if they did.
fn is_narrow(scene: &Records<'_>, m: &Material) -> bool {
    let Some(kind) = MaterialKind::from_u32(m.kind) else { return false };
    let has = |p: Parameter| kind.facts().parameters.contains(&p);
    if has(Parameter::Principled) {
        let Some([r]) = PrincipledRecord::read::<1>(scene.tables, m.table) else { return false };
        let textured = r.textures.get(PrincipledTexture::MetalRough as usize).is_some_and(|t| t.texture != NONE);
        return textured || r.roughness * r.roughness < NARROW || (r.coat > 0.0 && r.coat_alpha < NARROW);
    }
    if has(Parameter::Alpha) {
        return m.alpha < NARROW;
    }
    // what has no width is smooth; the boundary of a medium, which has no parameter, shows what is behind it
    has(Parameter::RelativeEta) || has(Parameter::ComplexEta) || kind == MaterialKind::Mirror
}

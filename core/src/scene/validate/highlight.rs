//! How bright the light is that camera samples show by chance alone. What a mirror or another narrow lobe shows of an
//! emitter, seen from a surface that scatters widely, is hardly found by light samples: they would have to find the
//! surface that shows it. Few samples of a picture find such a highlight, and each is about as bright as the emitter. Where no
//! lobe is narrow, and where rays cannot meet the emitter, light samples find all there is.

use crate::scene::Records;
use crate::scene::blob::*;

/// GGX width below which a lobe is narrow. The samples of a wider one that meet a small light count little, because light
/// samples are much denser there (multiple importance sampling).
const NARROW: f32 = 0.05;

/// Largest radiance, of any channel, that narrow lobes may show of the emitters of a validated scene that rays can meet;
/// 0 without such lobes. Hidden emitters count, and so do materials that no triangle has. `brightest` are the largest
/// values of the environment map by channel.
pub(super) fn highlight(scene: &Records<'_>, brightest: [f32; 3]) -> f32 {
    if !scene.materials.iter().any(|m| is_narrow(scene, m)) {
        return 0.0;
    }
    let mut all = 0.0f32;
    let mut take = |rgb: [f32; 3], scale: [f32; 3]| {
        for (x, scale) in rgb.iter().zip(scale) {
            if x * scale > all {
                all = x * scale;
            }
        }
    };
    if let Some(e) = scene.environment {
        let constant = e.kind == EnvironmentKind::Constant as u32;
        take(e.radiance, if constant { [1.0; 3] } else { brightest });
    }
    let lights = scene.lights.iter().filter(|l| has(MET, l.kind));
    lights.for_each(|l| take(l.emission, [1.0; 3]));
    all
}

/// Has a material a lobe that is narrow? A texture of its roughness counts as one: the texels are not read.
fn is_narrow(scene: &Records<'_>, m: &Material) -> bool {
    if has(WITH_WIDTH, m.kind) {
        return m.alpha < NARROW;
    }
    let record = if has(LAYERED_KINDS, m.kind) { PrincipledRecord::read::<1>(scene.tables, m.table) } else { None };
    let Some([r]) = record else { return has(SMOOTH, m.kind) };
    let textured = r.textures.get(PrincipledTexture::MetalRough as usize).is_some_and(|t| t.texture != NONE);
    textured || r.roughness * r.roughness < NARROW || (r.coat > 0.0 && r.coat_alpha < NARROW)
}

/// Is a kind in a set of bits?
fn has(set: u32, kind: u32) -> bool {
    kind < u32::BITS && set >> kind & 1 != 0
}

/// Kinds of lights that rays meet, but for the environment.
const MET: u32 = {
    let (mut bits, mut rest) = (1 << LightKind::Area as u32, LightKind::ALL);
    while let [kind, others @ ..] = rest {
        bits |= (kind.has_shape() as u32) << *kind as u32;
        rest = others;
    }
    bits
};

/// Kinds of materials with a GGX width, and those that are smooth where they have none: with delta lobes alone, or with a
/// refractive index. The boundary of a medium, which has no parameter, shows what is behind it.
const BY_WIDTH: [u32; 2] = {
    let ([mut wide, mut smooth], mut rest) = ([0, 0], MaterialKind::ALL);
    while let [kind, others @ ..] = rest {
        let mut parameters = kind.facts().parameters;
        while let [parameter, more @ ..] = parameters {
            let index = matches!(parameter, Parameter::RelativeEta | Parameter::ComplexEta);
            wide |= (matches!(parameter, Parameter::Alpha) as u32) << *kind as u32;
            smooth |= ((index || kind.facts().delta) as u32) << *kind as u32;
            parameters = more;
        }
        rest = others;
    }
    [wide, smooth]
};

/// Kinds of materials with a GGX width.
const WITH_WIDTH: u32 = BY_WIDTH[0];

/// Kinds of materials that are smooth where they have none.
const SMOOTH: u32 = BY_WIDTH[1];

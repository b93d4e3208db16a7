//! Records of principled materials.

use super::BakeError;
use crate::description::{Material, Principled, SceneDescription, TextureRef};
use crate::principled;
use croupier::unstable::scene::blob::{
    self, ALPHA_RANGE, MATERIAL_CUTOUT, MAX_COORDINATE, MAX_NORMAL_SCALE, NONE, PRINCIPLED_ALPHA, PRINCIPLED_CONTRAST,
    PRINCIPLED_ETA_RANGE, PRINCIPLED_TEXTURES, PRINCIPLED_THIN, PrincipledRecord, SHEEN_RANGE, TextureRecord,
};
use std::collections::HashMap;

/// Tables that the principled materials of a scene share.
#[derive(Default)]
pub(super) struct Shared {
    /// First entry of the tables of reflection.
    reflection: Option<u32>,
    /// First entry of the tables of solid transmission, by the bits of the index.
    energy: HashMap<u32, u32>,
}

/// First entry of `records`, added to `tables`.
fn add<T: bytemuck::Pod>(tables: &mut Vec<f32>, records: &[T]) -> u32 {
    let first = tables.len() as u32;
    tables.extend_from_slice(bytemuck::cast_slice(records));
    first
}

/// Does the alpha of the base texture cut holes?
fn by_alpha(scene: &SceneDescription, m: &Material, p: &Principled) -> bool {
    let texture = p.base_texture.and_then(|t| scene.textures.get(t.texture as usize));
    m.cutout && texture.is_some_and(|t| t.texels.iter().any(|[_, _, _, alpha]| *alpha < 255))
}

/// The flags that the material gets for what light passes straight on.
pub(super) fn cutout(scene: &SceneDescription, m: &Material, p: &Principled) -> u32 {
    if p.opacity < 1.0 || by_alpha(scene, m, p) { MATERIAL_CUTOUT } else { 0 }
}

/// Adds the record of a material and the tables that it needs, and tells the material.
pub(super) fn bake(
    scene: &SceneDescription,
    m: &Material,
    p: &Principled,
    shared: &mut Shared,
    tables: &mut Vec<f32>,
    out: &mut blob::Material,
) -> Result<(), BakeError> {
    let within = |what: &'static str, found: f32, range: [f32; 2]| {
        let error = || BakeError::Material { material: m.name.clone(), what, found, range };
        if found >= range[0] && found <= range[1] { Ok(found) } else { Err(error()) }
    };
    let share = |what, found| within(what, found, [0.0, 1.0]);
    let colour = |what, rgb: [f32; 3]| rgb.into_iter().try_for_each(|x| share(what, x).map(|_| ())).map(|()| rgb);
    let least = |roughness: f32, range: [f32; 2]| (roughness * roughness).clamp(range[0], range[1]);
    let texture = |t: Option<TextureRef>| {
        let Some(TextureRef { texture, transform }) = t else { return Ok(TextureRecord::NONE) };
        if texture as usize >= scene.textures.len() {
            let (material, count) = (m.name.clone(), scene.textures.len());
            return Err(BakeError::TextureIndex { material, found: texture, count });
        }
        let limits = [-MAX_COORDINATE, MAX_COORDINATE];
        transform.as_flattened().iter().try_for_each(|x| within("texture transform", *x, limits).map(|_| ()))?;
        Ok(TextureRecord { texture, transform })
    };

    out.reflectance = colour("base_color", p.base_color)?;
    let (metalness, transmission) = (share("metalness", p.metalness)?, share("transmission", p.transmission)?);
    let roughness = share("roughness", p.roughness)?;
    let [lo, hi] = PRINCIPLED_ETA_RANGE;
    let ior = within("ior", p.ior, [lo, hi])?;
    // closer to 1 light would pass without being bent: a delta lobe
    let eta = if (ior - 1.0).abs() < PRINCIPLED_CONTRAST { 1.0 + 1.01 * PRINCIPLED_CONTRAST } else { ior };
    let specular = share("specular", p.specular)?;
    for x in p.specular_color {
        within("specular_color", x, [0.0, f32::MAX])?;
    }
    let normal = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let sheen_color = colour("sheen_color", p.sheen_color)?;
    let coat = share("coat", p.coat)?;
    let coat_alpha = least(share("coat_roughness", p.coat_roughness)?, ALPHA_RANGE);
    let sheen_alpha = least(share("sheen_roughness", p.sheen_roughness)?, SHEEN_RANGE);

    let reflection = *shared.reflection.get_or_insert_with(|| add(tables, principled::reflection()));
    let solid = transmission > 0.0 && !p.thin_walled;
    let energy = if solid {
        *shared.energy.entry(eta.to_bits()).or_insert_with(|| add(tables, &principled::energy(f64::from(eta))))
    } else {
        NONE
    };
    let mut textures = [TextureRecord::NONE; PRINCIPLED_TEXTURES];
    let given = [
        p.base_texture,
        p.metal_rough_texture,
        p.transmission_texture,
        p.coat_texture,
        p.normal_texture,
        p.emission_texture,
    ];
    for (record, given) in textures.iter_mut().zip(given) {
        *record = texture(given)?;
    }
    let is_sheen = sheen_color != [0.0; 3];
    let alpha = if by_alpha(scene, m, p) { PRINCIPLED_ALPHA } else { 0 };
    let record = PrincipledRecord {
        metalness,
        roughness,
        transmission,
        coat,
        opacity: share("opacity", p.opacity)?,
        f90: specular,
        f0: p.specular_color.map(|c| (normal * c).min(1.0) * specular),
        sheen_color,
        coat_alpha,
        sheen_alpha,
        eta,
        normal_scale: within("normal_scale", p.normal_scale, [-MAX_NORMAL_SCALE, MAX_NORMAL_SCALE])?,
        flags: alpha | if p.thin_walled { PRINCIPLED_THIN } else { 0 },
        reflection,
        energy,
        textures,
        coat_layer: if coat > 0.0 { principled::coat(f64::from(coat_alpha)) } else { principled::NO_LAYER },
        sheen_layer: if is_sheen { principled::sheen(f64::from(sheen_alpha)) } else { principled::NO_LAYER },
    };
    out.table = add(tables, &[record]);
    // roulette by shininess knows the material alone
    out.alpha = if metalness.max(transmission) >= 0.5 { least(roughness, ALPHA_RANGE) } else { 1.0 };
    Ok(())
}

//! Materials, the tables they share, textures.

use super::BakeError;
use crate::description::{Model, Reflectance, SceneDescription};
use crate::microfacet;
use bytemuck::Zeroable;
use croupier::scene::blob::{self, MATERIAL_TWO_SIDED, MaterialKind, NONE};
use croupier::scene::blob::{ALPHA_RANGE, ETA_RANGE, MAX_CONDUCTOR, MAX_SIDE};
use std::collections::HashMap;

/// Sections of the blob.
#[derive(Default)]
pub(super) struct Materials {
    pub materials: Vec<blob::Material>,
    pub tables: Vec<f32>,
    pub textures: Vec<blob::Texture>,
    pub texels: Vec<u32>,
    pub names: Vec<u8>,
}

/// A material in the making; collects parameters, checks their ranges.
struct Draft<'a> {
    name: &'a str,
    textures: usize,
    out: blob::Material,
}

impl Draft<'_> {
    fn within(&self, what: &'static str, found: f32, range: [f32; 2]) -> Result<f32, BakeError> {
        if found >= range[0] && found <= range[1] {
            return Ok(found);
        }
        Err(BakeError::Material { material: self.name.into(), what, found, range })
    }

    fn reflectance(&mut self, r: Reflectance) -> Result<(), BakeError> {
        match r {
            Reflectance::Constant(rgb) => {
                rgb.iter().try_for_each(|x| self.within("reflectance", *x, [0.0, 1.0]).map(|_| ()))?;
                self.out.reflectance = rgb;
            }
            Reflectance::Texture(found) if found as usize >= self.textures => {
                let (material, count) = (self.name.into(), self.textures);
                return Err(BakeError::TextureIndex { material, found, count });
            }
            Reflectance::Texture(texture) => {
                self.out.texture = texture;
                self.out.reflectance = [1.0; 3];
            }
        }
        Ok(())
    }

    fn alpha(&mut self, alpha: f32) -> Result<(), BakeError> {
        self.out.alpha = self.within("alpha", alpha, ALPHA_RANGE)?;
        Ok(())
    }

    /// Returns int_ior / ext_ior in full precision.
    fn eta(&mut self, int_ior: f32, ext_ior: f32) -> Result<f64, BakeError> {
        let [lo, hi] = ETA_RANGE;
        self.within("int_ior", int_ior, [f32::MIN_POSITIVE, f32::MAX])?;
        self.within("ext_ior", ext_ior, [f32::MIN_POSITIVE, f32::MAX])?;
        let eta = f64::from(int_ior) / f64::from(ext_ior);
        self.out.eta[0] = self.within("int_ior / ext_ior", eta as f32, [lo, hi])?;
        Ok(eta)
    }

    fn conductor(&mut self, eta: [f32; 3], k: [f32; 3]) -> Result<(), BakeError> {
        for (eta, k) in eta.into_iter().zip(k) {
            self.within("eta", eta, [0.0, MAX_CONDUCTOR])?;
            self.within("k", k, [0.0, MAX_CONDUCTOR])?;
            // Both 0 has no Fresnel reflectance.
            self.within("larger of eta and k", eta.max(k), [1e-4, MAX_CONDUCTOR])?;
        }
        (self.out.eta, self.out.k) = (eta, k);
        Ok(())
    }
}

/// `emission` holds the radiance per material.
pub(super) fn bake(scene: &SceneDescription, emission: &[[f32; 3]]) -> Result<Materials, BakeError> {
    let mut out = Materials::default();
    // Quadrature takes long; many materials of a scene have the same coat.
    let mut rough_coats: HashMap<(u32, u64), (u32, f32)> = HashMap::new();
    for (m, emission) in scene.materials.iter().zip(emission) {
        let blank = blob::Material { texture: NONE, table: NONE, emission: *emission, ..Zeroable::zeroed() };
        let mut d = Draft { name: &m.name, textures: scene.textures.len(), out: blank };
        if let Some(r) = m.model.reflectance() {
            d.reflectance(r)?;
        }
        let kind = match m.model {
            Model::Diffuse { .. } => MaterialKind::Diffuse,
            Model::Mirror { .. } => MaterialKind::Mirror,
            Model::Conductor { eta, k, .. } => {
                d.conductor(eta, k)?;
                MaterialKind::Conductor
            }
            Model::RoughConductor { eta, k, alpha, .. } => {
                d.conductor(eta, k)?;
                d.alpha(alpha)?;
                MaterialKind::RoughConductor
            }
            Model::Dielectric { int_ior, ext_ior } => {
                d.eta(int_ior, ext_ior)?;
                MaterialKind::Dielectric
            }
            Model::RoughDielectric { int_ior, ext_ior, alpha } => {
                d.eta(int_ior, ext_ior)?;
                d.alpha(alpha)?;
                MaterialKind::RoughDielectric
            }
            Model::ThinDielectric { int_ior, ext_ior } => {
                d.eta(int_ior, ext_ior)?;
                MaterialKind::ThinDielectric
            }
            Model::Plastic { int_ior, ext_ior, .. } => {
                let eta = d.eta(int_ior, ext_ior)?;
                d.out.fdr = inside(microfacet::diffuse_fresnel_inside(eta));
                MaterialKind::Plastic
            }
            Model::RoughPlastic { int_ior, ext_ior, alpha, .. } => {
                let eta = d.eta(int_ior, ext_ior)?;
                d.alpha(alpha)?;
                let (table, fdr) = *rough_coats.entry((alpha.to_bits(), eta.to_bits())).or_insert_with(|| {
                    let table = microfacet::rough_plastic(f64::from(alpha), eta);
                    let first = out.tables.len() as u32;
                    out.tables.extend(table.transmittance.map(|t| t.clamp(0.0, 1.0)));
                    (first, inside(table.r))
                });
                (d.out.table, d.out.fdr) = (table, fdr);
                MaterialKind::RoughPlastic
            }
            Model::Null => MaterialKind::Null,
        };
        d.out.kind = kind as u32;
        d.out.flags = if m.two_sided && !m.model.is_transmissive() { MATERIAL_TWO_SIDED } else { 0 };
        out.materials.push(d.out);
        out.names.extend(m.name.bytes().map(|b| if b == b'\n' { b' ' } else { b }));
        out.names.push(b'\n');
    }
    textures(scene, &mut out)?;
    Ok(out)
}

/// Internal reflectance stays below 1, so that the series of internal reflections converges.
fn inside(r: f32) -> f32 {
    r.clamp(0.0, 1.0 - f32::EPSILON)
}

fn textures(scene: &SceneDescription, out: &mut Materials) -> Result<(), BakeError> {
    for t in &scene.textures {
        let texels = u64::from(t.width) * u64::from(t.height);
        let side = 1..=MAX_SIDE;
        if !side.contains(&t.width) || !side.contains(&t.height) || texels != t.texels.len() as u64 {
            let size = [t.width, t.height];
            return Err(BakeError::Image { image: t.name.clone(), size, texels: t.texels.len() });
        }
        let count = out.texels.len() + t.texels.len();
        if count >= 1 << 31 {
            return Err(BakeError::TooMany { what: "texels", count });
        }
        let first = out.texels.len() as u32;
        out.textures.push(blob::Texture { first, width: t.width, height: t.height, reserved: 0 });
        out.texels.extend(t.texels.iter().map(|[r, g, b, _]| u32::from_le_bytes([*r, *g, *b, 0])));
    }
    Ok(())
}

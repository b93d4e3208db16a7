//! Materials, the tables they share, textures.

use super::{BakeError, principled};
use crate::description::{Encoding, Material, Model, ModelParameters, Reflectance, SceneDescription, Texture, Wrap};
use crate::{compensation, microfacet};
use bytemuck::Zeroable;
use croupier::unstable::scene::blob::{
    self, COMPENSATION_ENTRIES, MATERIAL_COMPENSATED, MATERIAL_CUTOUT, MATERIAL_TWO_SIDED, MAX_SIDE, MIN_CONDUCTOR,
    NONE, Parameter, TEXTURE_CLAMP, TEXTURE_LINEAR, TEXTURE_MIRROR, TEXTURE_REPEAT, TEXTURE_WRAP_U, TEXTURE_WRAP_V,
};
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

/// A material in the making.
struct Draft<'a> {
    name: &'a str,
    textures: &'a [Texture],
    out: blob::Material,
    /// int_ior / ext_ior in full precision, 0 without them.
    eta: f64,
}

impl Draft<'_> {
    fn within(&self, what: &'static str, found: f32, range: [f32; 2]) -> Result<f32, BakeError> {
        if found >= range[0] && found <= range[1] {
            return Ok(found);
        }
        Err(BakeError::Material { material: self.name.into(), what, found, range })
    }

    /// Takes over a parameter that is not derived, within its range.
    fn take(&mut self, parameter: Parameter, from: &ModelParameters) -> Result<(), BakeError> {
        // a parameter that is missing is out of every range
        let number = |x: Option<f32>| x.unwrap_or(f32::NAN);
        let range = parameter.range();
        match parameter {
            Parameter::Reflectance => {
                self.reflectance(from.reflectance.unwrap_or(Reflectance::Constant([f32::NAN; 3])), range)
            }
            Parameter::Alpha => self.within("alpha", number(from.alpha), range).map(|x| self.out.alpha = x),
            Parameter::RelativeEta => self.relative_eta(number(from.int_ior), number(from.ext_ior), range),
            Parameter::ComplexEta => {
                self.complex_eta(from.eta.unwrap_or([f32::NAN; 3]), from.k.unwrap_or([f32::NAN; 3]), range)
            }
            Parameter::Principled
            | Parameter::InternalReflectance
            | Parameter::TransmittanceTable
            | Parameter::CompensationTable
            | Parameter::EnergyTable => Ok(()),
        }
    }

    fn reflectance(&mut self, r: Reflectance, range: [f32; 2]) -> Result<(), BakeError> {
        match r {
            Reflectance::Constant(rgb) => {
                rgb.iter().try_for_each(|x| self.within("reflectance", *x, range).map(|_| ()))?;
                self.out.reflectance = rgb;
            }
            Reflectance::Texture(found) if found as usize >= self.textures.len() => {
                let (material, count) = (self.name.into(), self.textures.len());
                return Err(BakeError::TextureIndex { material, found, count });
            }
            Reflectance::Texture(t) if texture_flags(&self.textures[t as usize]) != 0 => {
                let texture = self.textures[t as usize].name.clone();
                return Err(BakeError::TextureUse { material: self.name.into(), texture });
            }
            Reflectance::Texture(texture) => {
                self.out.texture = texture;
                self.out.reflectance = [1.0; 3];
            }
        }
        Ok(())
    }

    fn relative_eta(&mut self, int_ior: f32, ext_ior: f32, range: [f32; 2]) -> Result<(), BakeError> {
        self.within("int_ior", int_ior, [f32::MIN_POSITIVE, f32::MAX])?;
        self.within("ext_ior", ext_ior, [f32::MIN_POSITIVE, f32::MAX])?;
        self.eta = f64::from(int_ior) / f64::from(ext_ior);
        self.out.eta[0] = self.within("int_ior / ext_ior", self.eta as f32, range)?;
        Ok(())
    }

    fn complex_eta(&mut self, eta: [f32; 3], k: [f32; 3], range: [f32; 2]) -> Result<(), BakeError> {
        for (eta, k) in eta.into_iter().zip(k) {
            self.within("eta", eta, range)?;
            self.within("k", k, range)?;
            self.within("larger of eta and k", eta.max(k), [MIN_CONDUCTOR, range[1]])?;
        }
        (self.out.eta, self.out.k) = (eta, k);
        Ok(())
    }
}

/// First entry of a material's tables and its internal reflectance, 0 without.
type Derived = (u32, f32);

/// The tables of rough materials; quadrature takes long, and many materials of a scene have the same ones.
#[derive(Default)]
struct Tables {
    entries: Vec<f32>,
    /// What was derived by kind, width, relative index and whether it is compensated.
    known: HashMap<(u32, u32, u64, bool), Derived>,
    /// Factors of compensated reflection by width.
    factors: HashMap<u32, [f64; COMPENSATION_ENTRIES]>,
}

impl Tables {
    /// Derives what follows from the parameters that were taken over.
    fn derive(&mut self, used: &[Parameter], d: &mut Draft<'_>) {
        let compensated = d.out.flags & MATERIAL_COMPENSATED != 0;
        if used.iter().any(|p| p.entries() > 0 && (compensated || !p.compensates())) {
            let key = (d.out.kind, d.out.alpha.to_bits(), d.eta.to_bits(), compensated);
            let derived = self.known.get(&key).copied();
            let derived = derived.unwrap_or_else(|| self.compute(used, f64::from(d.out.alpha), d.eta, compensated));
            self.known.insert(key, derived);
            (d.out.table, d.out.fdr) = derived;
        } else if used.contains(&Parameter::InternalReflectance) {
            d.out.fdr = inside(microfacet::diffuse_fresnel_inside(d.eta));
        }
    }

    /// Adds the tables of a material, in the order of its parameters.
    fn compute(&mut self, used: &[Parameter], alpha: f64, eta: f64, compensated: bool) -> Derived {
        let (first, mut fdr) = (self.entries.len() as u32, 0.0);
        for p in used.iter().filter(|p| compensated || !p.compensates()) {
            let [lo, hi] = p.range();
            match p {
                Parameter::TransmittanceTable => {
                    let table = if compensated {
                        compensation::rough_plastic(alpha, eta, self.factors(alpha))
                    } else {
                        microfacet::rough_plastic(alpha, eta)
                    };
                    self.entries.extend(table.transmittance.map(|t| t.clamp(lo, hi)));
                    fdr = inside(table.r);
                }
                Parameter::CompensationTable => {
                    let factors = *self.factors(alpha);
                    self.entries.extend(factors.map(|s| (s as f32).clamp(lo, hi)));
                }
                Parameter::EnergyTable => {
                    let sides = compensation::dielectric(alpha, eta);
                    self.entries.extend(sides.as_flattened().iter().map(|e| (*e as f32).clamp(lo, hi)));
                }
                Parameter::Reflectance
                | Parameter::Alpha
                | Parameter::RelativeEta
                | Parameter::ComplexEta
                | Parameter::Principled
                | Parameter::InternalReflectance => {}
            }
        }
        (first, fdr)
    }

    fn factors(&mut self, alpha: f64) -> &[f64; COMPENSATION_ENTRIES] {
        self.factors.entry((alpha as f32).to_bits()).or_insert_with(|| compensation::conductor(alpha))
    }
}

/// Materials, tables, textures and names.
pub(super) fn bake(scene: &SceneDescription) -> Result<Materials, BakeError> {
    let mut out = Materials::default();
    let mut tables = Tables::default();
    let mut shared = principled::Shared::default();
    for m in &scene.materials {
        let (kind, parameters) = (m.model.kind(), m.model.parameters());
        let facts = kind.facts();
        let medium = match m.medium {
            Some(found) if found as usize >= scene.media.len() => {
                return Err(BakeError::MediumIndex { material: m.name.clone(), found, count: scene.media.len() });
            }
            medium => medium.unwrap_or(NONE),
        };
        let flags = flags(scene, m);
        let blank =
            blob::Material { kind: kind as u32, flags, texture: NONE, table: NONE, medium, ..Zeroable::zeroed() };
        let mut draft = Draft { name: &m.name, textures: &scene.textures, out: blank, eta: 0.0 };
        facts.parameters.iter().try_for_each(|p| draft.take(*p, &parameters))?;
        tables.derive(facts.parameters, &mut draft);
        if let Model::Principled(p) = &m.model {
            principled::bake(scene, m, p, &mut shared, &mut tables.entries, &mut draft.out)?;
        }
        out.materials.push(draft.out);
    }
    let of_materials = scene.materials.iter().map(|m| &m.name);
    let of_objects = scene.instances.iter().map(|i| &i.name).chain(scene.objects.iter().map(|o| &o.name));
    for name in of_materials.chain(of_objects) {
        out.names.extend(name.bytes().map(|b| if b"\n\r".contains(&b) { b' ' } else { b }));
        out.names.push(b'\n');
    }
    out.tables = tables.entries;
    textures(scene, &mut out)?;
    Ok(out)
}

/// Flags of a material: those that it asks for and that change something.
fn flags(scene: &SceneDescription, m: &Material) -> u32 {
    let facts = m.model.kind().facts();
    if let Model::Principled(p) = &m.model {
        return principled::cutout(scene, m, p) | if m.two_sided { MATERIAL_TWO_SIDED } else { 0 };
    }
    let cut = match m.model.parameters().reflectance {
        Some(Reflectance::Texture(t)) if m.cutout => {
            scene.textures.get(t as usize).is_some_and(|t| t.texels.iter().any(|[_, _, _, alpha]| *alpha < 255))
        }
        _ => false,
    };
    let flags = [
        (m.two_sided && !facts.transmissive, MATERIAL_TWO_SIDED),
        (cut, MATERIAL_CUTOUT),
        (m.compensated && facts.compensates(), MATERIAL_COMPENSATED),
    ];
    flags.iter().filter(|(set, _)| *set).fold(0, |all, (_, flag)| all | flag)
}

/// Internal reflectance stays below 1, so that the series of internal reflections converges.
fn inside(r: f32) -> f32 {
    let [lo, hi] = Parameter::InternalReflectance.range();
    r.clamp(lo, hi)
}

/// Encoding and wrapping of a texture.
fn texture_flags(t: &Texture) -> u32 {
    let mode = |w: Wrap| match w {
        Wrap::Repeat => TEXTURE_REPEAT,
        Wrap::Clamp => TEXTURE_CLAMP,
        Wrap::Mirror => TEXTURE_MIRROR,
    };
    let linear = if t.encoding == Encoding::Linear { TEXTURE_LINEAR } else { 0 };
    linear | mode(t.wrap[0]) << TEXTURE_WRAP_U | mode(t.wrap[1]) << TEXTURE_WRAP_V
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
        out.textures.push(blob::Texture { first, width: t.width, height: t.height, flags: texture_flags(t) });
        out.texels.extend(t.texels.iter().map(|rgba| u32::from_le_bytes(*rgba)));
    }
    Ok(())
}

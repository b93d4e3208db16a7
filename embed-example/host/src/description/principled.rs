//! The principled material: the subset of OpenPBR that glTF 2.0 has, with glTF's defaults.

/// A texture with an affine map of its coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index of the texture.
    pub texture: u32,
    /// Rows of the 2 x 3 matrix that maps (u, v, 1) of the surface to texture coordinates, v upwards.
    pub transform: [[f32; 3]; 2],
}

impl TextureRef {
    /// The texture at the coordinates of the surface.
    pub const fn new(texture: u32) -> Self {
        Self { texture, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] }
    }
}

/// Parameters of a principled material; colours are linear Rec. 709. The layers, from the outside: sheen, coat, and a
/// mix of metal and dielectric by `metalness`; the dielectric is a specular interface over a mix of a diffuse base and
/// transmission by `transmission`. The formulas are in the core, at `bsdf::Principled`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principled {
    /// Diffuse albedo of the dielectric, colour of what it transmits, reflectance of the metal at normal incidence;
    /// 0 to 1.
    pub base_color: [f32; 3],
    /// Colour that multiplies `base_color`. Its alpha times `opacity` is the share of light that meets the surface,
    /// where [`Material::cutout`](super::Material::cutout) asks for it.
    pub base_texture: Option<TextureRef>,
    /// 0 dielectric, 1 metal.
    pub metalness: f32,
    /// Square root of the GGX width of metal, dielectric and transmission; 0 to 1.
    pub roughness: f32,
    /// Numbers that multiply: green `roughness`, blue `metalness`. Linear.
    pub metal_rough_texture: Option<TextureRef>,
    /// Refractive index of the dielectric; its outside has 1.
    pub ior: f32,
    /// Strength of the dielectric's reflection at every angle; 0 to 1. Transmitting dielectrics ignore it.
    pub specular: f32,
    /// Colour of the dielectric's reflection at normal incidence, as far as the reflectance stays below 1.
    pub specular_color: [f32; 3],
    /// Share of the light that enters the dielectric that is transmitted, not scattered diffusely; 0 to 1.
    pub transmission: f32,
    /// Red multiplies `transmission`. Linear.
    pub transmission_texture: Option<TextureRef>,
    /// The surface is a sheet without an inside: light passes without refraction. Else light that passes enters or
    /// leaves a solid.
    pub thin_walled: bool,
    /// Strength of a clear coat of refractive index 1.5; 0 to 1.
    pub coat: f32,
    /// Red multiplies `coat`. Linear.
    pub coat_texture: Option<TextureRef>,
    /// Square root of the coat's GGX width; 0 to 1.
    pub coat_roughness: f32,
    /// Colour and strength of a layer of fibres; 0 to 1.
    pub sheen_color: [f32; 3],
    /// Square root of the width of the fibres' distribution; 0 to 1.
    pub sheen_roughness: f32,
    /// Radiance that the front side emits. A material with an [`Emitter::Area`](super::Emitter::Area) must not have
    /// it as well.
    pub emission: [f32; 3],
    /// Colour that multiplies `emission`.
    pub emission_texture: Option<TextureRef>,
    /// Normals in tangent space, red towards increasing u, green towards increasing v, 0.5 is zero. Linear.
    pub normal_texture: Option<TextureRef>,
    /// Factor on the red and green parts of these normals.
    pub normal_scale: f32,
    /// Share of light that meets the surface; the rest passes straight on. 0 to 1.
    pub opacity: f32,
}

impl Default for Principled {
    /// White, fully rough, without metal: glTF 2.0 has the same defaults but for `metalness`, which is 1 there.
    fn default() -> Self {
        Self {
            base_color: [1.0; 3],
            base_texture: None,
            metalness: 0.0,
            roughness: 1.0,
            metal_rough_texture: None,
            ior: 1.5,
            specular: 1.0,
            specular_color: [1.0; 3],
            transmission: 0.0,
            transmission_texture: None,
            thin_walled: false,
            coat: 0.0,
            coat_texture: None,
            coat_roughness: 0.0,
            sheen_color: [0.0; 3],
            sheen_roughness: 0.0,
            emission: [0.0; 3],
            emission_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            opacity: 1.0,
        }
    }
}

impl Principled {
    /// Every texture that the material refers to.
    pub fn textures(&self) -> impl Iterator<Item = TextureRef> {
        let all = [
            self.base_texture,
            self.metal_rough_texture,
            self.transmission_texture,
            self.coat_texture,
            self.emission_texture,
            self.normal_texture,
        ];
        all.into_iter().flatten()
    }
}

//! Lightmaps: the irradiance of surfaces, texel by texel, rendered by a session of its own with all that sessions have:
//! strategies that learn, shards, iterations, targets.
//!
//! | file | holds |
//! |---|---|
//! | `surface` | the triangles that a map covers |
//! | `texels` | which texels they cover, where samples begin |
//! | `clip` | polygons in texels |
//! | `charts` | which triangles hang together |
//! | `source` | texels as camera samples |
//! | `validity` | texels inside of other geometry |
//! | `smooth` | the denoised map |
//! | `gutter` | texels without samples of their own |
//! | `error` | why there is no map |
//!
//! **Irradiance** is that of the front, linear Rec. 709, in units of radiance times steradian, power per area: pi L under
//! a constant environment of radiance L. A diffuse surface of albedo a that is lit by it shows the radiance
//! `a irradiance / pi`. What the surface emits itself is not in it. Its cosine is that of the shading normal.
//!
//! **The map** is the unit square of the texture coordinates; row 0 is at v = 1, as in textures.
//!
//! ```
//! use croupier::Scene;
//! use croupier_host::bake::{BakeOptions, bake};
//! use croupier_host::builtin;
//! use croupier_host::drive::Unobserved;
//! use croupier_host::lightmap::{LightmapOptions, Surface, render_lightmap};
//! use croupier_host::render::Target;
//!
//! let description = builtin::cornell_box();
//! let blob = bake(&description, &BakeOptions::default(), |_, _| {})?.bytes;
//! let floor = Surface::of(&description, &["floor"])?;
//! let mut options = LightmapOptions::new([16, 16]);
//! options.target = Target::Spp(4);
//! let map = render_lightmap(Scene::from_bytes(&blob)?, &floor, &options, &Unobserved)?;
//! // most of it is lit; with so few samples not all
//! assert!(map.irradiance.iter().filter(|e| e[0] > 0.0).count() > 200);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod charts;
mod clip;
mod error;
mod gutter;
mod smooth;
mod source;
mod surface;
mod texels;
mod validity;

pub use error::{LightmapError, MAX_TEXELS};
pub use surface::Surface;
pub use texels::Overlap;

use crate::drive::{Observer, Options, Rendered, Target, drive_extended};
use crate::image::{Channel, Picture};
use croupier::unstable::film::{Aov, AovSet};
use croupier::unstable::profile::Full;
use croupier::{Scene, Settings};
use gutter::grow;
use source::TexelSource;
use texels::{NO_CHART, Texels};

/// Options of a lightmap.
#[derive(Clone, Debug, PartialEq)]
pub struct LightmapOptions {
    /// Settings of the core; their size is that of the map, in texels.
    pub settings: Settings,
    /// Stop condition; samples are those of each texel. Texels that are not covered have no error, so that the estimated
    /// error of a map is that of its covered part times the share of it.
    pub target: Target,
    /// Threads; 0 is one per processor. The map does not depend on them.
    pub threads: usize,
    /// Denoise the map.
    pub denoise: bool,
    /// Rings of texels around charts that take the value of a neighbour.
    pub gutter: u32,
    /// Share of a texel's rays that may first meet the back of an opaque surface, from 0 to 1; a texel with more is taken
    /// to be inside of something, and filled from its neighbours. With 1 none is.
    pub most_backs: f32,
}

impl LightmapOptions {
    /// Auxiliary values that maps are made with, besides those of the settings.
    pub const AOVS: AovSet = AovSet::of(&[Aov::Normal, Aov::Direct, Aov::Indirect]);

    /// 64 samples for each texel with the strategy and the settings of [`crate::render::RenderOptions`], a gutter of 4
    /// texels, texels filled that see more backs than fronts.
    pub fn new(size: [u32; 2]) -> Self {
        let settings = Settings { size, ..crate::render::unguided(crate::render::RenderOptions::default().settings) };
        Self { settings, target: Target::Spp(64), threads: 0, denoise: false, gutter: 4, most_backs: 0.5 }
    }
}

/// Where the irradiance of a texel is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelOrigin {
    /// Its own samples.
    Samples,
    /// Its neighbours in the same chart: it is inside of other geometry.
    Filled,
    /// A neighbour: it is not covered, but near to a chart.
    Gutter,
    /// Nowhere: it is black. Not covered, or inside of other geometry with all of its chart.
    Nowhere,
}

/// A lightmap. All planes have one value per texel, row by row from the top.
#[derive(Clone, Debug)]
pub struct Lightmap {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Irradiance: denoised if asked for, with filled texels and gutter.
    pub irradiance: Vec<[f32; 3]>,
    /// Irradiance by each texel's own samples alone, 0 where it has none.
    pub raw: Vec<[f32; 3]>,
    /// Standard error of `raw`.
    pub stderr: Vec<[f32; 3]>,
    /// Part of `raw` that comes straight from lights, and the part that other surfaces or media scatter.
    pub parts: [Vec<[f32; 3]>; 2],
    /// Mean shading normals of the covered parts, world space, 0 where nothing is covered.
    pub normals: Vec<[f32; 3]>,
    /// Share of each texel's square that is covered, 0 to 1.
    pub coverage: Vec<f32>,
    /// Number of samples, 0 where nothing is covered.
    pub samples: Vec<u32>,
    /// Share of rays that first meet the back of an opaque surface.
    pub backs: Vec<f32>,
    /// Where `irradiance` is from.
    pub origin: Vec<TexelOrigin>,
    /// Number of each texel's chart, the one with the largest part of it; `u32::MAX` where nothing is covered.
    pub chart: Vec<u32>,
    /// Charts of the surface.
    pub charts: u32,
    /// Objects whose charts overlap: their texels mix places, and light leaks between them.
    pub overlaps: Vec<Overlap>,
    /// What the map was made of: sums, counters, iterations.
    pub rendered: Rendered,
}

/// Renders the lightmap of a surface. `scene` must be baked from the description that the surface is of.
///
/// The map depends on scene, surface and options, never on threads.
///
/// # Errors
/// A scene that is not the surface's, a map without texels or with too many, and what [`crate::drive`] refuses.
pub fn render_lightmap(
    scene: Scene<'_>,
    surface: &Surface,
    options: &LightmapOptions,
    observer: &dyn Observer,
) -> Result<Lightmap, LightmapError> {
    if scene.triangles.len() != surface.triangles {
        let (given, wanted) = (scene.triangles.len(), surface.triangles);
        return Err(LightmapError::OtherScene { given, wanted });
    }
    let size = options.settings.size;
    if !(1..=MAX_TEXELS).contains(&(u64::from(size[0]) * u64::from(size[1]))) {
        return Err(LightmapError::Size { size });
    }
    let texels = Texels::new(surface, size);
    let source = TexelSource(&texels);
    let backs = validity::back_shares(&scene, &surface.opaque, &source);
    let aovs = options.settings.aovs.with(LightmapOptions::AOVS);
    let settings = Settings { size, aovs, ..crate::render::unguided(options.settings.with_scene(&scene)) };
    let drive = Options { threads: options.threads, ..Options::new(settings, options.target) };
    let rendered = drive_extended::<Full, _>(scene, source, &drive, observer)?;
    let plane = |aov: Aov| -> Vec<[f32; 3]> {
        let channels = rendered.channels(aov).unwrap_or_default();
        (0..texels.coverage.len()).map(|i| std::array::from_fn(|c| channels.get(c).map_or(0.0, |p| p[i]))).collect()
    };
    let valid: Vec<bool> =
        (0..texels.coverage.len()).map(|i| texels.is_covered(i) && backs[i] <= options.most_backs).collect();
    let (raw, normals) = (rendered.image(), plane(Aov::Normal));
    let mut irradiance: Vec<[f32; 3]> =
        raw.iter().zip(&valid).map(|(e, valid)| if *valid { *e } else { [0.0; 3] }).collect();
    if options.denoise {
        smooth::denoise(&texels, &rendered.pixels, &normals, &valid, &mut irradiance);
    }
    let origin = fill(&texels, &valid, options.gutter, &mut irradiance);
    let samples = |i: usize| if texels.is_covered(i) { rendered.pixels[i].samples as u32 } else { 0 };
    Ok(Lightmap {
        size,
        irradiance,
        stderr: rendered.stderr(),
        parts: [plane(Aov::Direct), plane(Aov::Indirect)],
        normals,
        samples: (0..texels.coverage.len()).map(samples).collect(),
        backs,
        origin,
        raw,
        coverage: texels.coverage,
        chart: texels.chart,
        charts: texels.charts,
        overlaps: texels.overlaps,
        rendered,
    })
}

/// Fills texels that are not `valid`: those of charts with the mean of their neighbours in the chart, ring by ring, then
/// the gutter with its neighbours' values.
fn fill(texels: &Texels, valid: &[bool], gutter: u32, irradiance: &mut [[f32; 3]]) -> Vec<TexelOrigin> {
    let mut origin: Vec<TexelOrigin> =
        valid.iter().map(|v| if *v { TexelOrigin::Samples } else { TexelOrigin::Nowhere }).collect();
    let mut filled = valid.to_vec();
    let chart = |texel: usize| texels.chart[texel];
    let same = |texel: usize, other: usize| chart(texel) != NO_CHART && chart(texel) == chart(other);
    grow(texels.size, &mut filled, u32::MAX, same, |texel, from| {
        let n = from.len() as f32;
        irradiance[texel] = std::array::from_fn(|c| from.iter().map(|i| irradiance[*i][c]).sum::<f32>() / n);
        origin[texel] = TexelOrigin::Filled;
    });
    grow(
        texels.size,
        &mut filled,
        gutter,
        |texel, _| chart(texel) == NO_CHART,
        |texel, from| {
            irradiance[texel] = from.first().map_or([0.0; 3], |i| irradiance[*i]);
            origin[texel] = TexelOrigin::Gutter;
        },
    );
    origin
}

impl Lightmap {
    /// Texels of an origin.
    pub fn count(&self, origin: TexelOrigin) -> usize {
        self.origin.iter().filter(|o| **o == origin).count()
    }

    /// The planes as layers: irradiance (R, G, B), `raw`, `stderr`, `direct`, `indirect`, `normal`, `coverage`, `samples`,
    /// `backs`, and `origin` (1 samples, 2 filled, 3 gutter, 0 nowhere).
    pub fn picture(&self) -> Picture {
        const RGB: [&str; 3] = ["R", "G", "B"];
        let mut picture = Picture::new(self.size[0] as usize, self.size[1] as usize);
        picture.add3("", RGB, &self.irradiance);
        let [direct, indirect] = &self.parts;
        let layers = [("raw", &self.raw), ("stderr", &self.stderr), ("direct", direct), ("indirect", indirect)];
        layers.into_iter().for_each(|(name, plane)| picture.add3(name, RGB, plane));
        picture.add3("normal", ["X", "Y", "Z"], &self.normals);
        let mut add = |layer: &str, name: &str, values: Vec<f32>| {
            picture.layer_mut(layer.into()).channels.push(Channel { name: name.into(), values });
        };
        add("coverage", "Y", self.coverage.clone());
        add("samples", "N", self.samples.iter().map(|n| *n as f32).collect());
        add("backs", "Y", self.backs.clone());
        let number = |o: &TexelOrigin| match o {
            TexelOrigin::Nowhere => 0.0,
            TexelOrigin::Samples => 1.0,
            TexelOrigin::Filled => 2.0,
            TexelOrigin::Gutter => 3.0,
        };
        add("origin", "Y", self.origin.iter().map(number).collect());
        picture
    }

    /// Bilinear irradiance at texture coordinates, as renderers look it up; texels beyond the edges are those at the
    /// edge.
    pub fn lookup(&self, [u, v]: [f32; 2]) -> [f32; 3] {
        let [width, height] = self.size.map(|n| n as usize);
        let at = |x: f32, n: usize| {
            let x = (x * n as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let i = (x as usize).min(n.saturating_sub(2));
            (i, (i + 1).min(n - 1), x - i as f32)
        };
        let ((l, r, s), (t, b, q)) = (at(u, width), at(1.0 - v, height));
        let texel = |x: usize, y: usize, c: usize| self.irradiance[y * width + x][c];
        std::array::from_fn(|c| {
            let top = texel(l, t, c) * (1.0 - s) + texel(r, t, c) * s;
            let bottom = texel(l, b, c) * (1.0 - s) + texel(r, b, c) * s;
            top * (1.0 - q) + bottom * q
        })
    }
}

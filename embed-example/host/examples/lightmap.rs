//! Lightmaps of the built-in Cornell box: the irradiance of each wall, denoised, with a gutter, as an EXR file and a PNG
//! beside it. Copy it.
//!
//! ```text
//! cargo run --release -p croupier-host --example lightmap -- [FOLDER [SIDE [SAMPLES]]]
//! ```

use croupier::Scene;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::drive::{Target, Unobserved};
use croupier_host::image::write_png;
use croupier_host::lightmap::{LightmapOptions, Surface, TexelOrigin, render_lightmap};
use croupier_host::tonemap::{Curve, tonemap};
use std::error::Error;
use std::path::PathBuf;

/// Walls that get a map: their texture coordinates fill the unit square.
const WALLS: [&str; 5] = ["floor", "ceiling", "back wall", "left wall", "right wall"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = PathBuf::from(args.next().unwrap_or_else(|| ".".into()));
    let side = args.next().map_or(Ok(64), |n| n.parse())?;
    let samples = args.next().map_or(Ok(64), |n| n.parse())?;

    // what an engine has already: a scene, and the blob of it
    let description = builtin::cornell_box();
    let blob = bake(&description, &BakeOptions::default(), |_, _| {})?.bytes;
    let scene = Scene::from_bytes(&blob)?;

    for wall in WALLS {
        let surface = Surface::of(&description, &[wall])?;
        let mut options = LightmapOptions::new([side, side]);
        options.target = Target::Spp(samples);
        options.denoise = true;
        let map = render_lightmap(scene, &surface, &options, &Unobserved)?;
        for overlap in &map.overlaps {
            println!("note: {}", overlap);
        }
        let name = wall.replace(' ', "-");
        let mut picture = map.picture();
        picture.write_exr(&folder.join(&name).with_extension("exr"))?;
        // as a white wall would show it: irradiance over pi
        picture.layers.truncate(1);
        let white = picture.main().ok_or("a map without colours")?;
        let white = tonemap(&white, -std::f32::consts::PI.log2(), Curve::Shoulder);
        write_png(&folder.join(&name).with_extension("png"), picture.width, picture.height, &white)?;
        let (filled, rays) = (map.count(TexelOrigin::Filled), map.rendered.counters.rays());
        println!("{wall}: {side}x{side} texels, {rays} rays, {filled} texels filled");
    }
    Ok(())
}

//! Loading of files that tests make.

use croupier_host::description::{Environment, SceneDescription, Vertex};
use croupier_host::load::{LoadOptions, LoadReport, load_with};
use croupier_host::look::Look;
use std::fs;

/// No ground is added, and the environment is a constant, so that no sky has to be computed.
pub fn plain_look() -> Look {
    let environment = Some(Environment::Constant { radiance: [1.0; 3] });
    Look { without_ground: true, environment, ..Look::default() }
}

/// Loads bytes under a name; the error as its text, in which the folder is `@`.
///
/// # Errors
/// That of loading.
pub fn try_load_with(
    name: &str,
    bytes: &[u8],
    options: &LoadOptions,
    look: &Look,
) -> Result<(SceneDescription, LoadReport), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = folder.path().join(name);
    fs::write(&path, bytes).map_err(|e| e.to_string())?;
    let shown = folder.path().display().to_string();
    load_with(&path, options, look).map_err(|e| e.to_string().replace(&shown, "@"))
}

/// As [`try_load_with`], with the default options and the [`plain_look`].
///
/// # Errors
/// That of loading.
pub fn try_load(name: &str, bytes: &[u8]) -> Result<(SceneDescription, LoadReport), String> {
    try_load_with(name, bytes, &LoadOptions::default(), &plain_look())
}

/// Vertices of the triangles.
pub fn corners(scene: &SceneDescription) -> Vec<[Vertex; 3]> {
    scene.triangles.iter().map(|t| t.vertices.map(|v| scene.vertices[v as usize])).collect()
}

/// Positions of the triangles' vertices.
pub fn positions(scene: &SceneDescription) -> Vec<[[f32; 3]; 3]> {
    corners(scene).iter().map(|t| t.map(|v| v.position)).collect()
}

/// A baseline JPEG of flat blocks of 8x8 pixels in a row; of each block the value of every channel (grey, or YCbCr).
pub fn jpeg(blocks: &[&[u8]]) -> Vec<u8> {
    let channels = blocks[0].len() as u8;
    let per_channel = |f: &dyn Fn(u8) -> Vec<u8>| (1..=channels).flat_map(f).collect::<Vec<u8>>();
    let mut file = vec![0xff, 0xd8];
    let mut segment = |marker: u8, parts: &[&[u8]]| {
        let data = parts.concat();
        file.extend([0xff, marker, 0, data.len() as u8 + 2]);
        file.extend(data);
    };
    // quantised by 1; 8 bits a channel, none subsampled
    segment(0xdb, &[&[0], &[1; 64]]);
    segment(0xc0, &[&[8, 0, 8, 0, 8 * blocks.len() as u8, channels], &per_channel(&|c| vec![c, 0x11, 0])]);
    // codes: lengths of differences are themselves in four bits, the end of a block is one bit of 0
    segment(0xc4, &[&[0x00, 0, 0, 0, 12], &[0; 12], &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]]);
    segment(0xc4, &[&[0x10, 1], &[0; 15], &[0]]);
    segment(0xda, &[&[channels], &per_channel(&|c| vec![c, 0]), &[0, 63, 0]]);
    let (mut bits, mut last) = (String::new(), [0; 3]);
    for block in blocks {
        for (value, last) in block.iter().zip(&mut last) {
            let mean = 8 * (i32::from(*value) - 128);
            let difference = mean - std::mem::replace(last, mean);
            let length = (32 - difference.unsigned_abs().leading_zeros()) as usize;
            bits += &format!("{length:04b}");
            if length > 0 {
                let coded = if difference < 0 { difference + (1 << length) - 1 } else { difference };
                bits += &format!("{coded:0length$b}");
            }
            bits.push('0');
        }
    }
    while bits.len() % 8 > 0 {
        bits.push('1');
    }
    for byte in bits.as_bytes().chunks(8) {
        let byte = byte.iter().fold(0, |b, bit| b << 1 | (bit - b'0'));
        file.push(byte);
        if byte == 0xff {
            file.push(0);
        }
    }
    file.extend([0xff, 0xd9]);
    file
}

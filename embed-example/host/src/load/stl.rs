//! STL, binary and text.
//!
//! Read here, without a crate: `stl_io` takes binary files whose header begins with `solid ` for text, knows no capital
//! keywords, no `solid` without a name and no second solid, and does not say where an error is.
//!
//! A file is binary if its length is what the number of triangles in byte 80 asks for, or longer and without `solid` at
//! its start; else it is a text. Equal positions become one vertex. Normals of the file are ignored: triangles are flat,
//! and their order of vertices says where the front is. Up is usually +z.

use super::LoadError;
use super::bare::{self, Mesh};
use super::loader::Loader;
use crate::description::{SceneDescription, Vertex};
use crate::look::Up;
use std::collections::HashMap;
use std::path::Path;

/// Bytes before the first triangle of a binary file.
const HEADER: usize = 84;
/// Bytes of a triangle: normal, three vertices, attributes.
const TRIANGLE: usize = 50;

/// Whether a file is binary, by what it states about its length.
fn is_binary(bytes: &[u8]) -> Result<bool, String> {
    let count = bytes.get(HEADER - 4..).and_then(|b| b.first_chunk()).map(|c| u32::from_le_bytes(*c));
    let stated = count.map(|n| HEADER as u64 + TRIANGLE as u64 * u64::from(n));
    let length = bytes.len() as u64;
    match stated {
        Some(n) if n == length => Ok(true),
        _ if starts_as_text(bytes) => Ok(false),
        Some(n) if n < length => Ok(true),
        Some(n) => {
            Err(format!("not STL: no `solid`, and {length} bytes where the header of a binary file asks for {n}"))
        }
        None => Err(format!("not STL: no `solid`, and {length} bytes are less than the header of a binary file")),
    }
}

/// Whether a file begins with `solid`.
pub(super) fn starts_as_text(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().get(..5).is_some_and(|b| b.eq_ignore_ascii_case(b"solid"))
}

/// Loads a bare `.stl` file.
pub(super) fn load(loader: &mut Loader, path: &Path) -> Result<SceneDescription, LoadError> {
    let bytes = loader.read(path, None)?;
    let mut welder = Welder::default();
    if is_binary(&bytes).map_err(|what| LoadError::file(path, what))? {
        binary(path, &bytes, &mut welder)?;
    } else {
        text(path, &String::from_utf8_lossy(&bytes), &mut welder)?;
    }
    if welder.mesh.triangles.is_empty() {
        return Err(LoadError::file(path, "no triangles"));
    }
    bare::scene(loader, path, welder.mesh, Up::Z)
}

/// A mesh that grows by triangles.
#[derive(Default)]
struct Welder {
    mesh: Mesh,
    indices: HashMap<[u32; 3], u32>,
}

impl Welder {
    /// Vertex indices fit `u32`: a file that had more triangles would not fit its own counter, or memory.
    fn triangle(&mut self, corners: [[f32; 3]; 3]) {
        let triangle = corners.map(|position| {
            // adding 0 makes one zero of both
            let key = position.map(|x| (x + 0.0).to_bits());
            let next = self.mesh.vertices.len() as u32;
            *self.indices.entry(key).or_insert_with(|| {
                self.mesh.vertices.push(Vertex { position, ..Vertex::default() });
                next
            })
        });
        self.mesh.triangles.push(triangle);
    }
}

fn binary(path: &Path, bytes: &[u8], welder: &mut Welder) -> Result<(), LoadError> {
    let count = bytes.get(HEADER - 4..).and_then(|b| b.first_chunk()).map_or(0, |c| u32::from_le_bytes(*c));
    let triangles = bytes.get(HEADER..).unwrap_or_default().chunks_exact(TRIANGLE).take(count as usize);
    for (i, triangle) in triangles.enumerate() {
        let mut numbers = triangle.as_chunks().0.iter().skip(3).map(|b| f32::from_le_bytes(*b));
        let corners = [0; 3].map(|_| [0; 3].map(|_| numbers.next().unwrap_or(f32::NAN)));
        if let Some(x) = corners.as_flattened().iter().find(|x| !x.is_finite()) {
            let offset = (HEADER + i * TRIANGLE) as u64;
            return Err(LoadError::binary(path, offset, format!("a corner of triangle {i} is at {x}")));
        }
        welder.triangle(corners);
    }
    Ok(())
}

fn text(path: &Path, text: &str, welder: &mut Welder) -> Result<(), LoadError> {
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let mut facet = None;
    let mut number = 0;
    for line in text.lines() {
        number += 1;
        let error = |what: String| LoadError::line(path, number, what);
        let mut words = line.split_ascii_whitespace();
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                // Names have spaces.
                "solid" | "endsolid" | "color" => words.by_ref().for_each(drop),
                "facet" => {
                    facet = Some(number);
                    corners.clear();
                }
                // Degenerate triangles have normals of NaN, in many spellings.
                "normal" => words.by_ref().take(3).for_each(drop),
                "outer" | "loop" | "endloop" => {}
                "vertex" if facet.is_some() && corners.len() < 3 => {
                    let mut corner = [0.0f32; 3];
                    for x in &mut corner {
                        let word = words.next().ok_or_else(|| error("`vertex` needs 3 numbers".into()))?;
                        *x = word
                            .parse()
                            .map_err(|_| error(format!("{} is not a number", super::error::quoted(word))))?;
                        if !x.is_finite() {
                            return Err(error(format!("a vertex is at {x}")));
                        }
                    }
                    corners.push(corner);
                }
                "endfacet" if facet.is_some() => match *corners {
                    [a, b, c] => {
                        welder.triangle([a, b, c]);
                        facet = None;
                    }
                    _ => return Err(error(format!("a facet of {} vertices, not 3", corners.len()))),
                },
                "vertex" if facet.is_some() => return Err(error("a facet of more than 3 vertices".into())),
                _ => return Err(error(format!("{} is unexpected here", super::error::quoted(word)))),
            }
        }
    }
    match facet {
        Some(line) => Err(LoadError::line(path, line, "the file ends within this facet")),
        None => Ok(()),
    }
}

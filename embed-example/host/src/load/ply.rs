//! PLY (Stanford polygon format), text and binary of both byte orders, through `ply-rs-bw`.
//!
//! | element | properties that are read |
//! |---|---|
//! | `vertex` | `x`, `y`, `z`; `nx`, `ny`, `nz`; `u`, `v` or `s`, `t` or `texture_u`, `texture_v`; `red`, `green`, `blue` (also `r`, `g`, `b` and `diffuse_red`, ...) |
//! | `face` | the list `vertex_indices` or `vertex_index`; the list `texcoord` of two numbers for each corner |
//! | `tristrips` | the list `vertex_indices`: strips that -1 separates |
//!
//! Others are skipped. Polygons become triangles. Colours are taken as sRGB: integers over their type's range, floats
//! from 0 to 1. The crate's parser is asked for one element at a time, so that counts in the header, which may be
//! anything, decide no allocation.

use super::bare::{self, Mesh};
use super::error::quoted;
use super::loader::Loader;
use super::{LoadError, polygon};
use crate::description::{SceneDescription, Vertex};
use crate::look::Up;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult};
use std::io::{BufRead, Cursor, ErrorKind};
use std::path::Path;

/// First bytes of every file.
pub(super) fn is_ply(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
}

/// Loads a bare `.ply` file.
pub(super) fn load(loader: &mut Loader, path: &Path) -> Result<SceneDescription, LoadError> {
    let bytes = loader.read(path, None)?;
    let mut file = File::open(path, &bytes)?;
    let header = file.header.clone();
    for element in header.elements.values() {
        file.element(element)?;
    }
    let mesh = file.polygons.mesh(path, file.vertices, &mut loader.report.polygons)?;
    bare::scene(loader, path, mesh, Up::Y)
}

/// Names of the numbers of a vertex, in the order of [`Corner::numbers`].
const NAMES: [&[&str]; 11] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["u", "s", "texture_u", "texture_s"],
    &["v", "t", "texture_v", "texture_t"],
    &["red", "r", "diffuse_red"],
    &["green", "g", "diffuse_green"],
    &["blue", "b", "diffuse_blue"],
];
/// First colour in [`NAMES`].
const RED: usize = 8;

/// One element of a file; what it is not has stays as it is.
struct Element {
    numbers: [f32; NAMES.len()],
    /// Vertex indices.
    corners: Vec<i64>,
    /// Texture coordinates, two for each corner.
    uvs: Vec<f32>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { numbers: [0.0; NAMES.len()], corners: Vec::new(), uvs: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let slot = NAMES.iter().position(|names| names.contains(&name));
        let done = match (slot, name) {
            (Some(slot), _) => number(&property, slot >= RED).map(|x| self.numbers[slot] = x),
            (None, "vertex_indices" | "vertex_index") => integers(&property).map(|list| self.corners = list),
            (None, "texcoord") => floats(property).map(|list| self.uvs = list),
            _ => return PropertyAccessResult::Ignored,
        };
        match done {
            Some(()) => PropertyAccessResult::Set,
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// A number; of a colour its share of the type's range.
fn number(property: &Property, color: bool) -> Option<f32> {
    let (x, range) = match *property {
        Property::Char(x) => (f32::from(x), 127.0),
        Property::UChar(x) => (f32::from(x), 255.0),
        Property::Short(x) => (f32::from(x), 32767.0),
        Property::UShort(x) => (f32::from(x), 65535.0),
        Property::Int(x) => (x as f32, 255.0),
        Property::UInt(x) => (x as f32, 255.0),
        Property::Float(x) => (x, 1.0),
        Property::Double(x) => (x as f32, 1.0),
        _ => return None,
    };
    Some(if color { x / range } else { x })
}

fn integers(property: &Property) -> Option<Vec<i64>> {
    Some(match property {
        Property::ListChar(list) => list.iter().map(|x| i64::from(*x)).collect(),
        Property::ListUChar(list) => list.iter().map(|x| i64::from(*x)).collect(),
        Property::ListShort(list) => list.iter().map(|x| i64::from(*x)).collect(),
        Property::ListUShort(list) => list.iter().map(|x| i64::from(*x)).collect(),
        Property::ListInt(list) => list.iter().map(|x| i64::from(*x)).collect(),
        Property::ListUInt(list) => list.iter().map(|x| i64::from(*x)).collect(),
        _ => return None,
    })
}

fn floats(property: Property) -> Option<Vec<f32>> {
    match property {
        Property::ListFloat(list) => Some(list),
        Property::ListDouble(list) => Some(list.into_iter().map(|x| x as f32).collect()),
        _ => None,
    }
}

/// A file while it is read.
struct File<'b> {
    path: &'b Path,
    header: Header,
    /// The elements.
    body: Cursor<&'b [u8]>,
    /// Where they begin in the file.
    start: usize,
    /// Last line that was read, of a text.
    line: u32,
    vertices: Vertices,
    polygons: Polygons,
}

#[derive(Default)]
struct Vertices {
    vertices: Vec<Vertex>,
    colors: Vec<[u8; 3]>,
    smooth: bool,
}

impl<'b> File<'b> {
    /// Reads the header. It is made plain first: the parser knows UTF-8 alone, in comments as well, and no line that
    /// ends in a carriage return only.
    fn open(path: &'b Path, bytes: &'b [u8]) -> Result<Self, LoadError> {
        if !is_ply(bytes) {
            return Err(LoadError::line(path, 1, "a PLY file begins with a line `ply`"));
        }
        const END: &[u8] = b"end_header";
        let ends = |i: &usize| bytes[*i..].starts_with(END) && matches!(bytes[i - 1], b'\n' | b'\r');
        let end = (4..bytes.len()).find(ends).ok_or_else(|| LoadError::file(path, "the header has no `end_header`"))?;
        let mut start = end + END.len();
        while bytes.get(start).is_some_and(|b| matches!(b, b' ' | b'\t')) {
            start += 1;
        }
        let newline: &[u8] = match bytes[3..5] {
            [b'\r', b'\n'] => b"\r\n",
            [b'\r', _] => b"\r",
            _ => b"\n",
        };
        start += [newline, b"\n"].iter().find(|n| bytes[start..].starts_with(n)).map_or(0, |n| n.len());
        let text = String::from_utf8_lossy(&bytes[..end]).replace("\r\n", "\n").replace('\r', "\n");
        let text = text + "end_header\n";
        let parser = Parser::<Element>::new();
        let header = parser.read_header(&mut Reader::new(Cursor::new(text.as_bytes())));
        let header = header.map_err(|e| LoadError::line(path, line_of(&e), reason(&e)))?;
        let line = text.lines().count() as u32;
        let (vertices, polygons) = Default::default();
        Ok(Self { path, header, body: Cursor::new(&bytes[start..]), start, line, vertices, polygons })
    }

    fn error(&self, offset: u64, what: String) -> LoadError {
        match self.header.encoding {
            Encoding::Ascii => LoadError::line(self.path, self.line, what),
            _ => LoadError::binary(self.path, self.start as u64 + offset, what),
        }
    }

    /// Reads all elements of a kind.
    fn element(&mut self, definition: &ElementDef) -> Result<(), LoadError> {
        let kind = definition.name.as_str();
        let has = |slot: usize| NAMES[slot].iter().any(|name| definition.properties.contains_key(*name));
        let colored = (RED..NAMES.len()).all(has);
        let oversize = definition.count > self.body.get_ref().len();
        if definition.properties.is_empty() || oversize {
            // Every element takes a byte or more.
            return match definition.count {
                0 => Ok(()),
                n if oversize => Err(self.error(0, format!("{n} elements {} do not fit into the file", quoted(kind)))),
                _ => Err(self.error(0, format!("elements {} have no properties", quoted(kind)))),
            };
        }
        if kind == "vertex" {
            if let Some(name) = ["x", "y", "z"].into_iter().zip(0..).find(|(_, slot)| !has(*slot)) {
                return Err(LoadError::file(self.path, format!("vertices have no property `{}`", name.0)));
            }
            self.vertices.smooth = [3, 4, 5].into_iter().all(has);
        }
        for i in 0..definition.count {
            let offset = self.body.position();
            let element = self.next(definition).map_err(|what| self.error(offset, format!("{kind} {i}: {what}")))?;
            let taken = match kind {
                "vertex" => self.vertices.push(&element, colored),
                "face" => self.polygons.push(&element.corners, &element.uvs),
                "tristrips" => self.polygons.strips(&element.corners),
                _ => Ok(()),
            };
            taken.map_err(|what| self.error(offset, format!("{kind} {i}: {what}")))?;
        }
        Ok(())
    }

    /// The next element.
    fn next(&mut self, definition: &ElementDef) -> Result<Element, String> {
        let parser = Parser::<Element>::new();
        let read = match self.header.encoding {
            Encoding::BinaryLittleEndian => parser.read_little_endian_element(&mut self.body, definition),
            Encoding::BinaryBigEndian => parser.read_big_endian_element(&mut self.body, definition),
            Encoding::Ascii => {
                let mut line = Vec::new();
                while line.trim_ascii().is_empty() {
                    line.clear();
                    self.line = self.line.saturating_add(1);
                    match self.body.read_until(b'\n', &mut line) {
                        Ok(n) if n > 0 => {}
                        _ => return Err("the file ends before it".into()),
                    }
                }
                parser.read_ascii_element(String::from_utf8_lossy(&line).trim(), definition)
            }
        };
        read.map_err(
            |e| if e.kind() == ErrorKind::UnexpectedEof { "the file ends within it".into() } else { reason(&e) },
        )
    }
}

/// Line of an error in the header.
fn line_of(e: &ParseError) -> u32 {
    e.line().map_or(0, |line| u32::try_from(line).unwrap_or(u32::MAX))
}

/// The first line of the parser's words, and what it had before it.
fn reason(e: &ParseError) -> String {
    let text = e.to_string();
    let mut lines = text.lines().map(str::trim);
    let first = lines.next().unwrap_or_default();
    let first = first.split_once(": ").filter(|(head, _)| head.starts_with("Line ")).map_or(first, |(_, tail)| tail);
    match lines.find_map(|l| l.strip_prefix("String: ")) {
        Some(found) => format!("{} {}", first.trim_end_matches('.'), quoted(found.trim_matches('\''))),
        None => first.chars().take(200).collect(),
    }
}

impl Vertices {
    fn push(&mut self, element: &Element, colored: bool) -> Result<(), String> {
        let [x, y, z, nx, ny, nz, u, v, r, g, b] = element.numbers;
        if let Some(bad) = [x, y, z].into_iter().find(|x| !x.is_finite()) {
            return Err(format!("a coordinate is {bad}"));
        }
        // Meshes of scanners have normals of NaN where there are too few points.
        let finite = |numbers: &[f32]| numbers.iter().all(|x| x.is_finite());
        let normal = if finite(&[nx, ny, nz]) { [nx, ny, nz] } else { [0.0; 3] };
        let uv = if finite(&[u, v]) { [u, v] } else { [0.0; 2] };
        self.vertices.push(Vertex { position: [x, y, z], normal, uv });
        if colored {
            self.colors.push([r, g, b].map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8));
        }
        Ok(())
    }
}

/// Polygons, with corners that may come before the vertices.
#[derive(Default)]
struct Polygons {
    corners: Vec<u32>,
    /// End of each polygon in `corners`.
    ends: Vec<usize>,
    /// Texture coordinates of `corners`; empty, or one for each.
    uvs: Vec<[f32; 2]>,
}

impl Polygons {
    fn push(&mut self, corners: &[i64], uvs: &[f32]) -> Result<(), String> {
        for i in corners {
            let vertex = u32::try_from(*i).map_err(|_| format!("there is no vertex {i}"))?;
            self.corners.push(vertex);
        }
        self.ends.push(self.corners.len());
        match uvs.as_chunks() {
            ([], _) => {}
            (uvs, []) if uvs.len() == corners.len() && self.uvs.len() + uvs.len() == self.corners.len() => {
                self.uvs.extend(uvs);
            }
            _ => return Err(format!("{} numbers `texcoord` for {} corners", uvs.len(), corners.len())),
        }
        Ok(())
    }

    fn strips(&mut self, strips: &[i64]) -> Result<(), String> {
        for strip in strips.split(|i| *i < 0) {
            for (k, t) in strip.windows(3).enumerate() {
                let [a, b, c] = [t[0], t[1], t[2]];
                self.push(&if k.is_multiple_of(2) { [a, b, c] } else { [b, a, c] }, &[])?;
            }
        }
        Ok(())
    }

    /// The mesh; counts what has more than three corners.
    fn mesh(self, path: &Path, all: Vertices, polygons: &mut u32) -> Result<Mesh, LoadError> {
        let Vertices { mut vertices, mut colors, smooth } = all;
        let error = |what: String| LoadError::file(path, what);
        if self.ends.is_empty() {
            let count = vertices.len();
            return Err(error(format!("{count} vertices, but no faces: clouds of points cannot be rendered")));
        }
        if vertices.len().max(self.corners.len()) > u32::MAX as usize {
            return Err(error("too many vertices".into()));
        }
        let mut corners = self.corners;
        if let Some(v) = corners.iter().find(|v| **v as usize >= vertices.len()) {
            return Err(error(format!("a face has vertex {v}, but there are {}", vertices.len())));
        }
        if self.uvs.len() == corners.len() && !corners.is_empty() {
            // Texture coordinates by corner: every corner becomes a vertex.
            vertices =
                corners.iter().zip(&self.uvs).map(|(v, uv)| Vertex { uv: *uv, ..vertices[*v as usize] }).collect();
            if !colors.is_empty() {
                colors = corners.iter().map(|v| colors[*v as usize]).collect();
            }
            corners = (0..corners.len() as u32).collect();
        }
        let mut triangles = Vec::new();
        let mut start = 0;
        for end in self.ends {
            let polygon = &corners[start..end];
            start = end;
            *polygons = polygons.saturating_add(u32::from(polygon.len() > 3));
            let points: Vec<[f32; 3]> = polygon.iter().map(|v| vertices[*v as usize].position).collect();
            triangles.extend(polygon::triangulate(&points).into_iter().map(|t| t.map(|i| polygon[i as usize])));
        }
        if triangles.is_empty() {
            return Err(error("no face has three corners".into()));
        }
        Ok(Mesh { vertices, triangles, smooth, colors })
    }
}

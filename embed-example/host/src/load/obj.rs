//! Wavefront OBJ geometry through `tobj`.
//!
//! `tobj` parses numbers and builds meshes; it does not say where an error is, it forgets which faces have no normals,
//! and it drops material names that it does not know. So a pass before it checks every line (numbers finite, indices in
//! range) and rewrites the text into a plainer dialect: joined lines, bare `v`/`vt`/`vn`, a new group wherever the form
//! of the faces (with or without texture coordinates and normals) changes, materials as numbers. Each mesh that comes
//! out then has normals for all faces or for none, and `tobj` has nothing left to refuse.

use super::json::Place;
use super::loader::{Decoding, Loader};
use super::mtl_principled::{self, Maps};
use super::{LoadError, files, mtl, polygon};
use crate::description::{Emitter, Encoding, Object, SceneDescription, Triangle, Vertex};
use crate::look::Given;
use crate::text::{self, excerpt};
use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Name under which faces without `usemtl` appear.
pub(super) const NO_MATERIAL: &str = "default";

/// The text for `tobj`, and what the check found.
struct Prepared {
    text: String,
    /// Names that faces use and the line of the first such face; the text calls them m0, m1, ...
    materials: Vec<(String, u32)>,
    /// Names of `o` and `g` in the order of the file; the text calls them 0, 1, ..., as it repeats them with every
    /// change of material or form. The first one is that of faces before any.
    objects: Vec<String>,
    /// Material libraries and the lines that name them.
    libraries: Vec<(String, u32)>,
    polygons: u32,
    skipped_elements: u32,
    /// Faces of which some corners have texture coordinates or normals, and the line of the first.
    partial: Option<(u32, u32)>,
    /// Lines that nothing is made of, the first of them and its keyword.
    unknown: Option<(u32, u32, String)>,
    vertices: usize,
    faces: u32,
}

impl Prepared {
    /// What a file without faces has instead.
    fn instead(&self) -> String {
        let Self { vertices, skipped_elements, .. } = self;
        match &self.unknown {
            Some((_, line, keyword)) if FREE_FORM.contains(&keyword.as_str()) => {
                format!("free-form curves and surfaces are not supported (`{keyword}` in line {line})")
            }
            _ if *vertices > 0 => format!("{vertices} vertices, {skipped_elements} points and lines, no faces"),
            Some((_, line, word)) => format!("no line of OBJ geometry, line {line} begins with `{}`", excerpt(word)),
            None => "there is nothing in it".into(),
        }
    }
}

/// Keywords of OBJ that say nothing about triangles.
const IGNORED: &[&str] = &[
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "maplib",
    "usemap",
    "shadow_obj",
    "trace_obj",
    "call",
    "csh",
    "vp",
];

/// Keywords of curves and surfaces of OBJ.
const FREE_FORM: &[&str] = &[
    "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end", "con",
    "ctech", "stech",
];

/// Corner of a face: numbers of position, texture coordinate and normal as they are written.
type Corner = [Option<i64>; 3];

/// Data of a face's corners besides positions.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
struct Form {
    uv: bool,
    normal: bool,
}

/// The pass before `tobj`.
struct Checker<'t> {
    path: &'t Path,
    line: u32,
    out: Prepared,
    /// Numbers of `v`, `vt`, `vn` so far.
    counts: [usize; 3],
    positions: Vec<[f32; 3]>,
    strict: bool,
    /// Memory of the face under way.
    corners: Vec<Corner>,
    points: Vec<[f32; 3]>,
    numbers: HashMap<String, usize>,
    material: String,
    /// Number of `material`, once a face has it.
    number: Option<usize>,
    /// Material and form of the text's current group; `None` before its first face.
    current: Option<(usize, Form)>,
}

impl Checker<'_> {
    fn error(&self, what: impl Into<String>) -> LoadError {
        LoadError::line(self.path, self.line, what)
    }

    fn check(&mut self, line: &str) -> Result<(), LoadError> {
        let mut words = line.split_ascii_whitespace();
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            "v" => self.vector(0, "v", 3, words),
            "vt" => self.vector(1, "vt", 2, words),
            "vn" => self.vector(2, "vn", 3, words),
            "f" | "fo" => self.face(words),
            "p" | "l" => {
                self.out.skipped_elements += 1;
                Ok(())
            }
            "o" | "g" => {
                self.out.objects.push(rest(line, keyword).into());
                self.current = None;
                Ok(())
            }
            "usemtl" => {
                self.material = rest(line, keyword).into();
                self.number = None;
                Ok(())
            }
            "mtllib" => {
                self.out.libraries.push((rest(line, keyword).into(), self.line));
                Ok(())
            }
            // Comments, smoothing groups: nothing here is made of them.
            _ if keyword.starts_with('#') || IGNORED.contains(&keyword) => Ok(()),
            _ => {
                let line = self.line;
                self.out.unknown.get_or_insert_with(|| (0, line, excerpt(keyword).into_owned())).0 += 1;
                Ok(())
            }
        }
    }

    /// `v`, `vt` or `vn`; weights and vertex colours behind the `n` coordinates are dropped.
    fn vector<'w>(
        &mut self,
        kind: usize,
        keyword: &str,
        n: usize,
        words: impl Iterator<Item = &'w str>,
    ) -> Result<(), LoadError> {
        self.counts[kind] += 1;
        self.out.text.push_str(keyword);
        let mut found = 0;
        let mut numbers = [0.0; 3];
        for (word, number) in words.take(n).zip(&mut numbers) {
            let x: f32 = word.parse().map_err(|_| self.error(format!("`{}` is not a number", excerpt(word))))?;
            if !x.is_finite() {
                let (object, index, word) = (self.object_name(), self.counts[kind], excerpt(word));
                return Err(self.error(format!("object `{object}`: `{keyword}` number {index} is {word}")));
            }
            *number = x;
            self.out.text.push(' ');
            self.out.text.push_str(word);
            found += 1;
        }
        if kind == 1 && found == 1 {
            self.out.text.push_str(" 0");
        } else if found < n {
            return Err(self.error(format!("`{keyword}` needs {n} numbers")));
        }
        if kind == 0 {
            self.positions.push(numbers);
        }
        self.out.text.push('\n');
        Ok(())
    }

    fn object_name(&self) -> Cow<'_, str> {
        match self.out.objects.last() {
            Some(name) if !name.is_empty() => excerpt(name),
            _ => "unnamed object".into(),
        }
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w str>) -> Result<(), LoadError> {
        let mut corners = std::mem::take(&mut self.corners);
        corners.clear();
        let read = words.map(|word| self.corner(word)).try_for_each(|c| c.map(|c| corners.push(c)));
        let done = read.and_then(|()| self.corners_of_face(&corners));
        self.corners = corners;
        done
    }

    fn corners_of_face(&mut self, corners: &[Corner]) -> Result<(), LoadError> {
        if corners.len() < 3 {
            self.out.skipped_elements += 1;
            return Ok(());
        }
        let has = |kind: usize| corners.iter().all(|c| c[kind].is_some());
        let form = Form { uv: has(1), normal: has(2) };
        let some = |kind: usize| corners.iter().any(|c| c[kind].is_some());
        if form != (Form { uv: some(1), normal: some(2) }) {
            if self.strict {
                return Err(self.error("corners with and without texture coordinates or normals in one face"));
            }
            let line = self.line;
            self.out.partial.get_or_insert((0, line)).0 += 1;
        }
        self.out.faces = self.out.faces.saturating_add(1);
        self.enter(form);
        if corners.len() == 3 {
            self.triangle([&corners[0], &corners[1], &corners[2]], form);
            return Ok(());
        }
        self.out.polygons += 1;
        let mut points = std::mem::take(&mut self.points);
        points.clear();
        points.extend(corners.iter().map(|c| self.position(c)));
        for t in polygon::triangulate(&points) {
            self.triangle(t.map(|i| &corners[i as usize]), form);
        }
        self.points = points;
        Ok(())
    }

    fn position(&self, corner: &Corner) -> [f32; 3] {
        let index = match corner[0] {
            Some(i @ 1..) => usize::try_from(i - 1).ok(),
            Some(i) => usize::try_from(i.unsigned_abs()).ok().and_then(|back| self.positions.len().checked_sub(back)),
            None => None,
        };
        index.and_then(|i| self.positions.get(i)).copied().unwrap_or_default()
    }

    fn triangle(&mut self, corners: [&Corner; 3], form: Form) {
        let text = &mut self.out.text;
        text.push('f');
        for [v, uv, normal] in corners {
            let (v, uv, normal) = (v.unwrap_or(0), uv.unwrap_or(0), normal.unwrap_or(0));
            // Writing to a String cannot fail.
            let _ = match (form.uv, form.normal) {
                (false, false) => write!(text, " {v}"),
                (true, false) => write!(text, " {v}/{uv}"),
                (false, true) => write!(text, " {v}//{normal}"),
                (true, true) => write!(text, " {v}/{uv}/{normal}"),
            };
        }
        text.push('\n');
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`, from 1, or from the last one backwards with -1.
    fn corner(&self, word: &str) -> Result<Corner, LoadError> {
        let wrong = || self.error(format!("`{}` is not a corner of a face", excerpt(word)));
        let mut corner = [None; 3];
        for (kind, part) in word.split('/').enumerate() {
            if kind == 3 {
                return Err(wrong());
            }
            if part.is_empty() {
                continue;
            }
            let index: i64 = part.parse().map_err(|_| wrong())?;
            let count = self.counts[kind];
            if index == 0 || index.unsigned_abs() > count as u64 {
                let what = ["vertex", "texture coordinate", "normal"][kind];
                let object = self.object_name();
                return Err(self.error(format!("object `{object}`: there is no {what} {index}, only {count} so far")));
            }
            corner[kind] = Some(index);
        }
        if corner[0].is_none() {
            return Err(self.error(format!("`{}` has no vertex", excerpt(word))));
        }
        Ok(corner)
    }

    /// Starts a new group in the text if the material or the form changes.
    fn enter(&mut self, form: Form) {
        let known = self.number.or_else(|| self.numbers.get(&self.material).copied());
        let material = known.unwrap_or_else(|| {
            self.out.materials.push((self.material.clone(), self.line));
            self.numbers.insert(self.material.clone(), self.out.materials.len() - 1);
            self.out.materials.len() - 1
        });
        self.number = Some(material);
        if self.current != Some((material, form)) {
            self.current = Some((material, form));
            // Writing to a String cannot fail.
            let _ = writeln!(self.out.text, "g {}\nusemtl m{material}", self.out.objects.len() - 1);
        }
    }
}

/// Text after the keyword.
fn rest<'t>(line: &'t str, keyword: &str) -> &'t str {
    line.trim().get(keyword.len()..).unwrap_or_default().trim()
}

fn prepare(path: &Path, text: &str, strict: bool) -> Result<Prepared, LoadError> {
    let mut prepared = String::with_capacity(text.len() + text.len() / 64 + 64);
    // Makes `tobj` ask for the materials before the first face.
    prepared.push_str("mtllib materials\n");
    let mut checker = Checker {
        path,
        line: 0,
        out: Prepared {
            text: prepared,
            materials: Vec::new(),
            objects: vec![String::new()],
            libraries: Vec::new(),
            polygons: 0,
            skipped_elements: 0,
            partial: None,
            unknown: None,
            vertices: 0,
            faces: 0,
        },
        counts: [0; 3],
        positions: Vec::new(),
        strict,
        corners: Vec::new(),
        points: Vec::new(),
        numbers: HashMap::new(),
        material: String::new(),
        number: None,
        current: None,
    };
    let mut joined = String::new();
    for line in text.lines() {
        checker.line = checker.line.saturating_add(1);
        if let Some(head) = line.strip_suffix('\\') {
            joined.push_str(head);
            joined.push(' ');
        } else if joined.is_empty() {
            checker.check(line)?;
        } else {
            joined.push_str(line);
            checker.check(&joined)?;
            joined.clear();
        }
    }
    // a last line that promises another
    checker.check(&joined)?;
    checker.out.vertices = checker.counts[0];
    Ok(checker.out)
}

/// Name of objects that have none.
const UNNAMED: &str = "unnamed_object";

/// Appends the meshes to the scene; `materials` maps the prepared text's numbers to the scene's.
fn append(path: &Path, scene: &mut SceneDescription, prepared: Prepared, materials: &[u32]) -> Result<(), LoadError> {
    let Prepared { text, mut objects, .. } = prepared;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..tobj::LoadOptions::default() };
    let names = |_: &Path| {
        let named = |i| tobj::Material { name: format!("m{i}"), ..tobj::Material::default() };
        let list: Vec<_> = (0..materials.len()).map(named).collect();
        let map = list.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
        Ok((list, map))
    };
    let refused =
        |what: &str| LoadError::Format { path: path.into(), what: format!("refused by the OBJ parser: {what}") };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, names).map_err(|e| refused(&e.to_string()))?;
    drop(text);
    let mut object = None;
    for model in models {
        let mesh = model.mesh;
        if mesh.indices.is_empty() {
            continue;
        }
        let count = mesh.positions.len() / 3;
        let (smooth, textured) = (!mesh.normals.is_empty(), !mesh.texcoords.is_empty());
        let fits = (!smooth || mesh.normals.len() == 3 * count) && (!textured || mesh.texcoords.len() == 2 * count);
        let material = mesh.material_id.and_then(|id| materials.get(id));
        let (Some(&material), true) = (material, fits) else { return Err(refused("mixed forms of faces")) };
        let base =
            u32::try_from(scene.vertices.len() + count).map_err(|_| refused("too many vertices"))? - count as u32;
        let first_triangle = scene.triangles.len() as u32;
        let number: usize = model.name.parse().map_err(|_| refused("an object of no number"))?;
        // one may be of several materials
        if object.replace(number) != Some(number) {
            let name = objects.get_mut(number).map(std::mem::take).filter(|name| !name.is_empty());
            scene.objects.push(Object { name: name.unwrap_or_else(|| UNNAMED.into()), first_triangle });
        }
        let mut normals = mesh.normals.chunks_exact(3);
        let mut uvs = mesh.texcoords.chunks_exact(2);
        scene.vertices.extend(mesh.positions.chunks_exact(3).map(|p| Vertex {
            position: [p[0], p[1], p[2]],
            normal: normals.next().map_or([0.0; 3], |n| [n[0], n[1], n[2]]),
            uv: uvs.next().map_or([0.0; 2], |t| [t[0], t[1]]),
        }));
        scene.triangles.extend(mesh.indices.chunks_exact(3).map(|t| Triangle {
            vertices: [t[0] + base, t[1] + base, t[2] + base],
            material,
            smooth,
        }));
    }
    Ok(())
}

/// Reads and checks; counts go to the report.
fn read(loader: &mut Loader, path: &Path, referrer: Option<&str>) -> Result<Prepared, LoadError> {
    let text = loader.read_text(path, referrer)?;
    let prepared = prepare(path, &text, loader.options.strict)?;
    drop(text);
    if prepared.faces == 0 {
        return Err(LoadError::Empty { path: path.into(), what: prepared.instead() });
    }
    let name = text::path(path);
    if let Some((count, line)) = prepared.partial {
        let what = "with texture coordinates or normals at some corners only, which were left out";
        loader.note(format!("{name}:{line}: the first of {count} faces {what}"));
    }
    if let Some((count, line, keyword)) = &prepared.unknown {
        loader.note(format!("{name}:{line}: `{keyword}` is not known; lines of that kind that were ignored: {count}"));
    }
    loader.report.polygons += prepared.polygons;
    loader.report.skipped_elements += prepared.skipped_elements;
    Ok(prepared)
}

/// Adds the geometry of an OBJ file whose materials are the scene's, defined in the file of `referrer`, which names it.
pub(super) fn load_geometry(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    path: &Path,
    referrer: &Place<'_>,
) -> Result<(), LoadError> {
    let prepared = read(loader, path, Some(&referrer.referrer()))?;
    let find = |(name, line): &(String, u32)| {
        let index = scene.materials.iter().position(|m| m.name == *name);
        index.map(|i| i as u32).ok_or_else(|| {
            let what = match name.as_str() {
                "" => "a face before any `usemtl`".into(),
                name => {
                    let file = text::path(referrer.file);
                    format!("a face of material `{}`, which {file} does not define", excerpt(name))
                }
            };
            LoadError::line(path, *line, what)
        })
    };
    let materials: Vec<u32> = prepared.materials.iter().map(find).collect::<Result<_, _>>()?;
    append(path, scene, prepared, &materials)
}

/// Loads a bare OBJ file with its material libraries. Camera, light and ground are left open.
pub(super) fn load_bare(loader: &mut Loader, path: &Path) -> Result<SceneDescription, LoadError> {
    let mut scene = SceneDescription::default();
    let prepared = read(loader, path, None)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut defined: HashMap<String, (mtl::Definition, PathBuf)> = HashMap::new();
    for (names, line) in &prepared.libraries {
        let referrer = format!("{}:{line}", text::path(path));
        for file in libraries(folder, names) {
            let (bytes, file) = match loader.read_near(&file, &referrer) {
                Err(e) if e.is_missing() => {
                    loader.replace(e, "its materials are grey")?;
                    continue;
                }
                read => read?,
            };
            let text = files::text(bytes).map_err(|what| LoadError::Format { path: file.clone(), what })?;
            for definition in mtl::parse(loader, &file, &text)? {
                defined.insert(definition.material.name.clone(), (definition, file.clone()));
            }
        }
    }
    let mut materials = Vec::new();
    for (name, line) in &prepared.materials {
        let index = scene.materials.len() as u32;
        match defined.get(name) {
            Some((definition, file)) => {
                let texture = match &definition.texture {
                    Some((texture, line)) => {
                        let referrer = format!("{}:{line} (material `{}`)", text::path(file), excerpt(name));
                        loader.texture(&mut scene, &mtl::sibling(file, texture), &referrer)?
                    }
                    None => None,
                };
                let holes = opacity(loader, &mut scene, definition, texture, file)?;
                let (texture, cut_out) = (holes.or(texture), holes.is_some());
                let (material, radiance) = if mtl_principled::applies(definition) {
                    let maps = Maps { base: texture, cut_out, ..maps(loader, &mut scene, definition, file)? };
                    mtl_principled::map(definition, maps)
                } else {
                    let mapped = mtl::map(definition, texture, cut_out);
                    loader.report.notes.extend(mapped.notes);
                    (mapped.material, mapped.radiance)
                };
                scene.materials.push(material);
                if let Some(radiance) = radiance {
                    scene.emitters.push(Emitter::Area { material: index, radiance });
                }
            }
            None if name.is_empty() => {
                loader.note(format!("faces from line {line} on have no material: grey"));
                scene.add_material(NO_MATERIAL, mtl::GREY);
            }
            None => {
                let what = format!("a face of material `{}`, which no material library defines", excerpt(name));
                loader.replace(LoadError::line(path, *line, what), "it is grey")?;
                scene.add_material(name, mtl::GREY);
            }
        }
        materials.push(index);
    }
    append(path, &mut scene, prepared, &materials)?;
    loader.given = Given::MESH;
    Ok(scene)
}

/// The files that a `mtllib` names: one whose name may hold blanks, or, if there is none, several.
fn libraries(folder: &Path, names: &str) -> Vec<PathBuf> {
    let whole = folder.join(names);
    let several = || names.split_ascii_whitespace().map(|n| folder.join(n)).collect::<Vec<_>>();
    if whole.exists() || !several().iter().any(|f| f.exists()) { vec![whole] } else { several() }
}

/// The texture of the colour with the holes of `map_d`; `None` without those.
fn opacity(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    definition: &mtl::Definition,
    base: Option<u32>,
    file: &Path,
) -> Result<Option<u32>, LoadError> {
    let Some((texture, line)) = &definition.opacity else { return Ok(None) };
    let name = excerpt(&definition.material.name);
    let referrer = format!("{}:{line} (material `{name}`)", text::path(file));
    let decoding = Decoding { encoding: Encoding::Linear, ..Decoding::default() };
    let Some(mask) = loader.texture_as(scene, &mtl::sibling(file, texture), &referrer, decoding)? else {
        return Ok(None);
    };
    let made = mtl::cut_out(loader, scene, definition, base, mask);
    let failed = |what| LoadError::file(file, format!("material `{name}`: colour and holes as one texture: {what}"));
    made.map(Some).map_err(failed)
}

/// The textures of a definition besides that of its colour.
fn maps(
    loader: &mut Loader,
    scene: &mut SceneDescription,
    definition: &mtl::Definition,
    file: &Path,
) -> Result<Maps, LoadError> {
    let mut maps = Maps::default();
    for (key, texture, line) in &definition.maps {
        let encoding = if key == "map_Ke" { Encoding::Srgb } else { Encoding::Linear };
        let decoding = Decoding { encoding, ..Decoding::default() };
        let referrer = format!("{}:{line} (material `{}`)", text::path(file), excerpt(&definition.material.name));
        let index = loader.texture_as(scene, &mtl::sibling(file, texture), &referrer, decoding)?;
        let slot = match key.as_str() {
            "map_Pr" => &mut maps.roughness,
            "map_Pm" => &mut maps.metalness,
            "map_Ke" => &mut maps.emission,
            _ => &mut maps.normal,
        };
        *slot = index;
    }
    maps.combined = mtl_principled::combine(loader, scene, &maps).map_err(|what| {
        let name = excerpt(&definition.material.name);
        LoadError::file(file, format!("material `{name}`: roughness and metalness as one texture: {what}"))
    })?;
    Ok(maps)
}

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
use super::{LoadError, mtl};
use crate::description::{Emitter, Encoding, Object, SceneDescription, Triangle, Vertex};
use crate::look::Given;
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
    /// Material libraries and the lines that name them.
    libraries: Vec<(String, u32)>,
    polygons: u32,
    skipped_elements: u32,
}

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
    numbers: HashMap<String, usize>,
    material: String,
    /// Material and form of the text's current group; `None` before its first face.
    current: Option<(usize, Form)>,
    object: String,
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
                self.object = rest(line, keyword).into();
                self.current = None;
                Ok(())
            }
            "usemtl" => {
                self.material = rest(line, keyword).into();
                Ok(())
            }
            "mtllib" => {
                self.out.libraries.push((rest(line, keyword).into(), self.line));
                Ok(())
            }
            // Comments, smoothing groups, curves: nothing here is made of them.
            _ => Ok(()),
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
        for word in words.take(n) {
            let x: f32 = word.parse().map_err(|_| self.error(format!("`{word}` is not a number")))?;
            if !x.is_finite() {
                let (object, index) = (self.object_name(), self.counts[kind]);
                return Err(self.error(format!("object `{object}`: `{keyword}` number {index} is {word}")));
            }
            self.out.text.push(' ');
            self.out.text.push_str(word);
            found += 1;
        }
        if kind == 1 && found == 1 {
            self.out.text.push_str(" 0");
        } else if found < n {
            return Err(self.error(format!("`{keyword}` needs {n} numbers")));
        }
        self.out.text.push('\n');
        Ok(())
    }

    fn object_name(&self) -> &str {
        if self.object.is_empty() { "unnamed object" } else { &self.object }
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w str> + Clone) -> Result<(), LoadError> {
        let mut form = None;
        let mut corners = 0u32;
        for word in words.clone() {
            let f = self.corner(word)?;
            if form.is_some_and(|form| form != f) {
                return Err(self.error("corners with and without texture coordinates or normals in one face"));
            }
            form = Some(f);
            corners += 1;
        }
        let Some(form) = form.filter(|_| corners >= 3) else {
            self.out.skipped_elements += 1;
            return Ok(());
        };
        self.out.polygons += u32::from(corners > 3);
        self.enter(form);
        self.out.text.push('f');
        for word in words {
            self.out.text.push(' ');
            self.out.text.push_str(word);
        }
        self.out.text.push('\n');
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`, from 1, or from the last one backwards with -1.
    fn corner(&self, word: &str) -> Result<Form, LoadError> {
        let mut form = [false; 3];
        for (kind, part) in word.split('/').enumerate() {
            if kind == 3 {
                return Err(self.error(format!("`{word}` is not a corner of a face")));
            }
            if part.is_empty() {
                continue;
            }
            let index: i64 = part.parse().map_err(|_| self.error(format!("`{word}` is not a corner of a face")))?;
            let count = self.counts[kind];
            if index == 0 || index.unsigned_abs() > count as u64 {
                let what = ["vertex", "texture coordinate", "normal"][kind];
                let object = self.object_name();
                return Err(self.error(format!("object `{object}`: there is no {what} {index}, only {count} so far")));
            }
            form[kind] = true;
        }
        if !form[0] {
            return Err(self.error(format!("`{word}` has no vertex")));
        }
        Ok(Form { uv: form[1], normal: form[2] })
    }

    /// Starts a new group in the text if the material or the form changes.
    fn enter(&mut self, form: Form) {
        let known = self.numbers.get(&self.material).copied();
        let material = known.unwrap_or_else(|| {
            self.out.materials.push((self.material.clone(), self.line));
            self.numbers.insert(self.material.clone(), self.out.materials.len() - 1);
            self.out.materials.len() - 1
        });
        if self.current != Some((material, form)) {
            self.current = Some((material, form));
            // Writing to a String cannot fail.
            let _ = writeln!(self.out.text, "g {}\nusemtl m{material}", self.object);
        }
    }
}

/// Text after the keyword.
fn rest<'t>(line: &'t str, keyword: &str) -> &'t str {
    line.trim().get(keyword.len()..).unwrap_or_default().trim()
}

fn prepare(path: &Path, text: &str) -> Result<Prepared, LoadError> {
    let mut prepared = String::with_capacity(text.len() + text.len() / 64 + 64);
    // Makes `tobj` ask for the materials before the first face.
    prepared.push_str("mtllib materials\n");
    let mut checker = Checker {
        path,
        line: 0,
        out: Prepared {
            text: prepared,
            materials: Vec::new(),
            libraries: Vec::new(),
            polygons: 0,
            skipped_elements: 0,
        },
        counts: [0; 3],
        numbers: HashMap::new(),
        material: String::new(),
        current: None,
        object: String::new(),
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
    Ok(checker.out)
}

/// Appends the meshes to the scene; `materials` maps the prepared text's numbers to the scene's.
fn append(path: &Path, scene: &mut SceneDescription, prepared: Prepared, materials: &[u32]) -> Result<(), LoadError> {
    let Prepared { text, .. } = prepared;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..tobj::LoadOptions::default() };
    let names = |_: &Path| {
        let named = |i| tobj::Material { name: format!("m{i}"), ..tobj::Material::default() };
        let list: Vec<_> = (0..materials.len()).map(named).collect();
        let map = list.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
        Ok((list, map))
    };
    let refused = |what: &str| LoadError::line(path, 0, format!("refused by the OBJ parser: {what}"));
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, names).map_err(|e| refused(&e.to_string()))?;
    drop(text);
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
        scene.objects.push(Object { name: model.name, first_triangle });
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
    let prepared = prepare(path, &text)?;
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
                name => format!("a face of material `{name}`, which {} does not define", referrer.file.display()),
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
    for (file, line) in &prepared.libraries {
        let file = folder.join(file);
        let text = loader.read_text(&file, Some(&format!("{}:{line}", path.display())))?;
        for definition in mtl::parse(&file, &text)? {
            defined.insert(definition.material.name.clone(), (definition, file.clone()));
        }
    }
    let mut materials = Vec::new();
    for (name, line) in &prepared.materials {
        let index = scene.materials.len() as u32;
        match defined.get(name) {
            Some((definition, file)) => {
                let texture = definition.texture.as_ref().map(|(texture, line)| {
                    let referrer = format!("{}:{line} (material `{name}`)", file.display());
                    loader.texture(&mut scene, &mtl::sibling(file, texture), &referrer)
                });
                let texture = texture.transpose()?;
                let (material, radiance) = if mtl_principled::applies(definition) {
                    let maps = Maps { base: texture, ..maps(loader, &mut scene, definition, file)? };
                    mtl_principled::map(&mut scene, definition, maps)
                } else {
                    let mapped = mtl::map(definition, texture);
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
                let what = format!("a face of material `{name}`, which no material library defines");
                return Err(LoadError::line(path, *line, what));
            }
        }
        materials.push(index);
    }
    append(path, &mut scene, prepared, &materials)?;
    loader.given = Given::MESH;
    Ok(scene)
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
        let referrer = format!("{}:{line} (material `{}`)", file.display(), definition.material.name);
        let index = loader.texture_as(scene, &mtl::sibling(file, texture), &referrer, decoding)?;
        let slot = match key.as_str() {
            "map_Pr" => &mut maps.roughness,
            "map_Pm" => &mut maps.metalness,
            "map_Ke" => &mut maps.emission,
            _ => &mut maps.normal,
        };
        *slot = Some(index);
    }
    Ok(maps)
}

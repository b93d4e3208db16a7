//! A glTF document with its buffers, and values of accessors.
//!
//! `gltf-json` gives the document's types. What refers to something in it is followed here and nowhere else: indices,
//! lengths and counts may be anything.

use super::super::LoadError;
use super::super::loader::Loader;
use super::container;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index, Root, buffer};
use std::borrow::Cow;
use std::path::Path;

/// A document with its buffers.
pub(super) struct Asset<'b> {
    pub path: &'b Path,
    pub root: Root,
    buffers: Vec<Cow<'b, [u8]>>,
}

impl<'b> Asset<'b> {
    /// Reads the buffers of a document; `binary` is the binary chunk of the file.
    pub(super) fn new(
        loader: &mut Loader,
        path: &'b Path,
        root: Root,
        binary: Option<&'b [u8]>,
    ) -> Result<Self, LoadError> {
        let mut buffers = Vec::with_capacity(root.buffers.len());
        for (i, buffer) in root.buffers.iter().enumerate() {
            let at = format!("buffers[{i}]");
            let bytes = match (&buffer.uri, binary) {
                (Some(uri), _) => Cow::Owned(container::read(loader, path, uri, &format!("{at}.uri"))?),
                (None, Some(binary)) if i == 0 => Cow::Borrowed(binary),
                // Fallbacks of compressed buffers have no bytes. Whoever reads from it says that it is too short.
                (None, _) => Cow::Borrowed([].as_slice()),
            };
            if (bytes.len() as u64) < buffer.byte_length.0 && buffer.uri.is_some() {
                let what = format!("{} bytes, but {} are stated", bytes.len(), buffer.byte_length.0);
                return Err(LoadError::json(path, at, what));
            }
            buffers.push(bytes);
        }
        Ok(Self { path, root, buffers })
    }

    /// Most triangles that may be made of the document. A triangle takes two bytes or more, of indices that it does not
    /// share, or of a node that places it again; small documents may repeat themselves more often.
    pub(super) fn most_triangles(&self) -> usize {
        self.buffers.iter().map(|b| b.len()).sum::<usize>().saturating_mul(2).max(1 << 22)
    }

    /// Most meshes in the scene, those of `EXT_mesh_gpu_instancing` included: one for each node, and for every two bytes,
    /// as several nodes may share an accessor; small documents may repeat themselves more often. The scene takes up to
    /// half a kilobyte for each.
    pub(super) fn most_placements(&self) -> usize {
        let bytes: usize = self.buffers.iter().map(|b| b.len()).sum();
        (bytes / 2).saturating_add(self.root.nodes.len()).clamp(1 << 17, 1 << 21)
    }

    pub(super) fn error(&self, at: impl Into<String>, what: impl Into<String>) -> LoadError {
        LoadError::json(self.path, at, what)
    }

    /// Element of a list of the document, which `at` refers to.
    pub(super) fn get<'a, T>(
        &'a self,
        list: &'a [T],
        index: Index<T>,
        at: &str,
        name: &str,
    ) -> Result<&'a T, LoadError> {
        let i = index.value();
        list.get(i).ok_or_else(|| self.error(at, format!("there is no {name}[{i}], there are {}", list.len())))
    }

    /// Bytes of a buffer view.
    pub(super) fn view(&self, index: Index<buffer::View>, at: &str) -> Result<(&[u8], Option<usize>), LoadError> {
        let view = self.get(&self.root.buffer_views, index, at, "bufferViews")?;
        let at = format!("bufferViews[{}]", index.value());
        self.get(&self.root.buffers, view.buffer, &at, "buffers")?;
        let buffer = &self.buffers[view.buffer.value()];
        let (start, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let range =
            start.checked_add(length).and_then(|end| Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        let bytes = range.and_then(|range| buffer.get(range)).ok_or_else(|| {
            let compressed = view.extensions.as_ref().and_then(|e| e.others.keys().find(|k| k.contains("meshopt")));
            match compressed {
                Some(name) => self.error(&at, format!("compressed with {name}, which is not supported")),
                None => {
                    let what = format!("bytes {start} to {start} + {length} of a buffer of {}", buffer.len());
                    self.error(&at, what)
                }
            }
        })?;
        Ok((bytes, view.byte_stride.map(|s| s.0)))
    }

    /// Values of an accessor, of one of the types `wanted`.
    pub(super) fn numbers(&self, index: Index<Accessor>, at: &str, wanted: &[Type]) -> Result<Numbers<'_>, LoadError> {
        let accessor = self.get(&self.root.accessors, index, at, "accessors")?;
        let name = format!("accessors[{}]", index.value());
        let (Checked::Valid(kind), Checked::Valid(component)) = (accessor.type_, accessor.component_type) else {
            return Err(self.error(name, "a type that glTF does not have"));
        };
        if !wanted.contains(&kind) {
            return Err(self.error(name, format!("{kind:?}, but {at} needs {wanted:?}")));
        }
        let component = component.0;
        let size = component.size() * kind.multiplicity();
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let base = match accessor.buffer_view {
            Some(view) => Some(self.elements(view, offset, count, size, &name)?),
            None => {
                // As many zeros as there are bytes for something, so that a number in the file decides no allocation.
                let most = self.buffers.iter().map(|b| b.len()).sum::<usize>() + 65536;
                if count > most {
                    return Err(self.error(name, format!("{count} elements without a buffer view")));
                }
                None
            }
        };
        let sparse = match &accessor.sparse {
            None => Vec::new(),
            Some(sparse) => {
                let n = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
                let Checked::Valid(index_type) = sparse.indices.component_type else {
                    return Err(self.error(name, "sparse indices of a type that glTF does not have"));
                };
                let size_of_index = index_type.0.size();
                let indices = sparse.indices.byte_offset.0;
                let indices = self.elements(sparse.indices.buffer_view, indices, n, size_of_index, &name)?;
                let values = self.elements(sparse.values.buffer_view, sparse.values.byte_offset.0, n, size, &name)?;
                let pairs = (0..n).map(|i| (number(index_type.0, indices.element(i), 0) as usize, values.element(i)));
                let mut pairs: Vec<_> = pairs.collect();
                pairs.sort_by_key(|(i, _)| *i);
                if let Some((i, _)) = pairs.last().filter(|(i, _)| *i >= count) {
                    return Err(self.error(name, format!("a sparse value for element {i} of {count}")));
                }
                pairs
            }
        };
        Ok(Numbers { base, sparse, count, component, normalized: accessor.normalized })
    }

    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        size: usize,
        at: &str,
    ) -> Result<Elements<'_>, LoadError> {
        let (bytes, stride) = self.view(view, at)?;
        // 0 would let a count be anything
        let stride = stride.filter(|s| *s > 0).unwrap_or(size);
        let length = match count.checked_sub(1) {
            None => Some(0),
            Some(last) => stride.checked_mul(last).and_then(|n| n.checked_add(size)),
        };
        let start = usize::try_from(offset).ok();
        let range = start.zip(length).and_then(|(start, length)| Some(start..start.checked_add(length)?));
        let bytes = range.and_then(|range| bytes.get(range)).ok_or_else(|| {
            let view = view.value();
            let stated = format!("{count} elements of {size} bytes, every {stride}, from byte {offset}");
            self.error(at, format!("{stated}, are more than the {} bytes of bufferViews[{view}]", bytes.len()))
        })?;
        Ok(Elements { bytes, stride, size })
    }
}

/// Elements at equal distances.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Elements<'a> {
    fn element(&self, i: usize) -> &'a [u8] {
        &self.bytes[i * self.stride..][..self.size]
    }
}

/// Values of an accessor.
pub(super) struct Numbers<'a> {
    base: Option<Elements<'a>>,
    /// Replaced elements by ascending index.
    sparse: Vec<(usize, &'a [u8])>,
    pub count: usize,
    component: ComponentType,
    normalized: bool,
}

/// Component `c` of an element.
fn number(component: ComponentType, element: &[u8], c: usize) -> f64 {
    fn at<const N: usize>(element: &[u8], c: usize) -> [u8; N] {
        element.get(c * N..).and_then(|b| b.first_chunk()).copied().unwrap_or([0; N])
    }
    match component {
        ComponentType::I8 => f64::from(i8::from_le_bytes(at(element, c))),
        ComponentType::U8 => f64::from(u8::from_le_bytes(at(element, c))),
        ComponentType::I16 => f64::from(i16::from_le_bytes(at(element, c))),
        ComponentType::U16 => f64::from(u16::from_le_bytes(at(element, c))),
        ComponentType::U32 => f64::from(u32::from_le_bytes(at(element, c))),
        ComponentType::F32 => f64::from(f32::from_le_bytes(at(element, c))),
    }
}

impl Numbers<'_> {
    fn element(&self, i: usize) -> &[u8] {
        match self.sparse.binary_search_by_key(&i, |(i, _)| *i) {
            Ok(k) => self.sparse[k].1,
            Err(_) => self.base.as_ref().map_or(&[], |base| base.element(i)),
        }
    }

    /// The first `N` components of element `i < count`, those that it does not have 0; normalised where the accessor
    /// says so.
    pub(super) fn get<const N: usize>(&self, i: usize) -> [f32; N] {
        let element = self.element(i);
        let range = match (self.normalized, self.component) {
            (true, ComponentType::I8) => 127.0,
            (true, ComponentType::U8) => 255.0,
            (true, ComponentType::I16) => 32767.0,
            (true, ComponentType::U16) => 65535.0,
            _ => 1.0,
        };
        std::array::from_fn(|c| {
            let x = number(self.component, element, c) / range;
            (if self.normalized { x.max(-1.0) } else { x }) as f32
        })
    }

    /// Components as integers.
    pub(super) fn integers<const N: usize>(&self, i: usize) -> [u32; N] {
        let element = self.element(i);
        std::array::from_fn(|c| number(self.component, element, c) as u32)
    }

    /// Whether the values are integers without a sign.
    pub(super) fn unsigned(&self) -> bool {
        matches!(self.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32)
    }
}

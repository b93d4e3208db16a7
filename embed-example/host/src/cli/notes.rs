//! Notes on what loading and baking assumed, ignored or left out: printed on stderr, and part of every JSON report
//! about a scene.

use super::console::note;
use croupier_host::bake::BakeReport;
use croupier_host::load::LoadReport;
use croupier_host::text;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

/// Most notes that are printed; JSON has them all.
const PRINTED: usize = 20;

/// Notes of one sentence each, and counts by name. There are none about a baked file: they were printed when it was
/// baked.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Notes {
    notes: Vec<String>,
    /// Counts above 0, by name.
    scene_counts: BTreeMap<&'static str, u32>,
}

impl Notes {
    /// Notes of a scene that was loaded and baked just now.
    pub(crate) fn of(load: &LoadReport, bake: &BakeReport) -> Self {
        let counts = [
            ("split_polygons", "faces of more than three corners, split into triangles", load.polygons),
            ("skipped_elements", "points and lines, left out", load.skipped_elements),
            ("dropped_triangles", "triangles without area, left out", bake.dropped_degenerate),
            ("dropped_lights", "triangles without area that would have been lights", bake.dropped_lights),
            ("flattened", "smooth triangles with a vertex normal of length 0, shaded flat", bake.flattened),
        ];
        let mut all = Self { notes: load.notes.clone(), ..Self::default() };
        for (name, what, count) in counts.into_iter().filter(|(.., count)| *count > 0) {
            all.notes.push(format!("{what}: {count}"));
            all.scene_counts.insert(name, count);
        }
        all
    }

    /// Adds a note, and prints it.
    pub(crate) fn add(&mut self, path: Option<&Path>, text: String) {
        note(&about(path)(&text));
        self.notes.push(text);
    }

    /// Prints all notes, with the scene's name in front.
    pub(crate) fn print(&self, path: Option<&Path>) {
        self.notes.iter().take(PRINTED).for_each(|text| note(&about(path)(text)));
        if let Some(more @ 1..) = self.notes.len().checked_sub(PRINTED) {
            note(&about(path)(&format!("... and {more} more notes; --json has them all")));
        }
    }
}

/// Puts the scene's name in front of an error or a note about its content.
pub(crate) fn about<'a>(path: Option<&'a Path>) -> impl Fn(&dyn Display) -> String + 'a {
    move |e| match path {
        Some(path) => format!("{}: {e}", text::path(path)),
        None => format!("built-in scene: {e}"),
    }
}

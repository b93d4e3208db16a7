//! Files of a render: checked before it begins, and every one of them written when it has ended, whatever happens to
//! the others. An hour of rendering must not be lost to a full disk or a mistyped name.

use super::values::Exposure;
use croupier_host::false_color::{Scale, draw};
use croupier_host::image::{ImageError, Picture, try_write, write_png, write_whole};
use croupier_host::look::exposure::auto;
use croupier_host::text;
use croupier_host::tonemap::{Curve, tonemap};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Layers drawn in false colours, and the titles of their legends.
const FALSE_COLOR: [(&str, &str); 7] = [
    ("factor1", "factor 1"),
    ("factor2", "factor 2"),
    ("factor3", "factor 3"),
    ("factor4", "factor 4+"),
    ("cost", "rays"),
    ("paths", "paths"),
    ("guide", "share of guided samples"),
];

/// Paths of all files of a render.
#[derive(Debug)]
pub(crate) struct Outputs<'a> {
    /// EXR file with all layers, or a part of a picture.
    pub(crate) exr: &'a Path,
    /// Tone-mapped picture, beside the EXR; parts have none.
    pub(crate) png: Option<PathBuf>,
    /// Saved cache, if asked for.
    pub(crate) cache: Option<&'a Path>,
    /// Checkpoint, if asked for.
    pub(crate) checkpoint: Option<&'a Path>,
    /// Pictures of the layers in [`FALSE_COLOR`], if asked for.
    pub(crate) false_color: Vec<PathBuf>,
}

/// Files that were written, and the first error.
#[derive(Debug, Default)]
pub(crate) struct Written {
    /// Complete files, in the order in which they were written.
    pub(crate) files: Vec<PathBuf>,
    /// Error of the first file that is not complete.
    pub(crate) error: Option<ImageError>,
}

impl Written {
    fn add(&mut self, path: &Path, outcome: Result<(), ImageError>) {
        match outcome {
            Ok(()) => self.files.push(path.into()),
            Err(e) => self.error = self.error.take().or(Some(e)),
        }
    }
}

impl<'a> Outputs<'a> {
    /// Names of all files.
    pub(crate) fn new(exr: &'a Path, cache: Option<&'a Path>, checkpoint: Option<&'a Path>, false_color: bool) -> Self {
        let drawings = FALSE_COLOR.iter().filter(|_| false_color);
        let false_color = drawings.map(|(layer, _)| exr.with_extension(format!("{layer}.png"))).collect();
        Self { exr, png: Some(exr.with_extension("png")), cache, checkpoint, false_color }
    }

    /// Names of the files of a part of a picture.
    pub(crate) fn part(part: &'a Path, cache: Option<&'a Path>, checkpoint: Option<&'a Path>) -> Self {
        Self { exr: part, png: None, cache, checkpoint, false_color: Vec::new() }
    }

    /// Every file.
    fn all(&self) -> Vec<&Path> {
        let pictures = [self.exr].into_iter().chain(self.png.as_deref());
        let pictures = pictures.chain(self.false_color.iter().map(PathBuf::as_path));
        pictures.chain(self.cache).chain(self.checkpoint).collect()
    }

    /// Checks that all files can be written, none over another.
    pub(crate) fn check(&self) -> Result<(), String> {
        let all = self.all();
        for (i, path) in all.iter().enumerate() {
            if all[..i].iter().any(|other| same(path, other)) {
                return Err(format!("cannot write {}: two outputs cannot share it", text::path(path)));
            }
        }
        all.into_iter().try_for_each(writable)
    }

    /// Checks that none of the files was read. A checkpoint may be written over the one that the render resumes.
    pub(crate) fn spare(&self, read: &[PathBuf], resumed: Option<&Path>) -> Result<(), String> {
        let all = self.all();
        spares(&all, read)?;
        let others: Vec<&Path> = all.into_iter().filter(|p| Some(*p) != self.checkpoint).collect();
        spares(&others, &resumed.map(Path::to_path_buf).into_iter().collect::<Vec<_>>())
    }

    /// Pictures in false colours of layers that there are: files, names and titles of the layers, and what is drawn.
    fn drawings<'p>(&'p self, picture: &'p Picture) -> impl Iterator<Item = (&'p Path, [&'static str; 2], &'p [f32])> {
        self.false_color.iter().zip(FALSE_COLOR).filter_map(|(path, (layer, title))| {
            let channel = picture.layer(layer)?.channels.first()?;
            Some((path.as_path(), [layer, title], channel.values.as_slice()))
        })
    }

    /// Files of pictures in false colours.
    pub(crate) fn drawn(&self, picture: &Picture) -> Vec<PathBuf> {
        self.drawings(picture).map(|(path, ..)| path.into()).collect()
    }

    /// Writes everything: the PNG and the false colours are made from `picture`. `image` names the layer of the PNG.
    pub(crate) fn write(&self, picture: &Picture, cache: Option<&[u8]>, image: &str, exposure: Exposure) -> Written {
        let mut written = Written::default();
        written.add(self.exr, picture.write_exr(self.exr));
        self.write_cache(cache, &mut written);
        if let Some(png) = &self.png {
            written.add(png, self.write_png(png, picture, image, exposure));
        }
        for (path, [layer, title], values) in self.drawings(picture) {
            let factors = layer.starts_with("factor");
            let scale = if factors { Scale::FACTORS } else { Scale::sequential(values) };
            let drawing = draw(values, picture.width, &scale, title);
            written.add(path, write_png(path, drawing.width, drawing.height, &drawing.pixels));
        }
        written
    }

    /// Writes a part, and the saved cache.
    pub(crate) fn write_part(
        &self,
        part: impl FnOnce(&Path) -> Result<(), ImageError>,
        cache: Option<&[u8]>,
    ) -> Written {
        let mut written = Written::default();
        written.add(self.exr, part(self.exr));
        self.write_cache(cache, &mut written);
        written
    }

    fn write_cache(&self, cache: Option<&[u8]>, written: &mut Written) {
        if let Some((path, bytes)) = self.cache.zip(cache) {
            let all = write_whole(path, |out| out.write_all(bytes).map_err(|e| ImageError::Write(path.into(), e)));
            written.add(path, all);
        }
    }

    fn write_png(&self, png: &Path, picture: &Picture, layer: &str, exposure: Exposure) -> Result<(), ImageError> {
        let image = picture.rgb(layer).ok_or_else(|| ImageError::NoRgb(self.exr.into()))?;
        let stops = match exposure {
            Exposure::Stops(stops) => stops,
            Exposure::Auto => auto(&image),
        };
        write_png(png, picture.width, picture.height, &tonemap(&image, stops, Curve::Shoulder))
    }
}

/// Checks that a file of this name can be written: makes and removes the temporary file that is written first.
pub(crate) fn writable(path: &Path) -> Result<(), String> {
    let failed = |why: &dyn std::fmt::Display| format!("cannot write {}: {why}", text::path(path));
    // What is not there yet can be made.
    if let Ok(found) = fs::metadata(path)
        && !found.is_file()
    {
        let what = if found.is_dir() { "it is a folder" } else { "it is not a regular file" };
        return Err(failed(&what));
    }
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty() && !f.is_dir()) {
        return Err(failed(&format!("{} is not a folder", text::path(folder))));
    }
    try_write(path).map_err(|e| failed(&e))
}

/// Checks that no output is one of the files that were read, by its name, or by a link.
pub(crate) fn spares(outputs: &[&Path], read: &[PathBuf]) -> Result<(), String> {
    let clash = |out: &&Path| read.iter().find(|input| same(out, input)).map(|input| (out.to_path_buf(), input));
    match outputs.iter().find_map(clash) {
        None => Ok(()),
        Some((out, input)) => {
            let (out, input) = (text::path(&out), text::path(input));
            Err(format!("cannot write {out}: it is {input}, which was read; give the output another name"))
        }
    }
}

/// Whether both names lead to one file, or would if it were made.
fn same(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        fs::canonicalize(path).ok().or_else(|| {
            let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
        })
    };
    let (place_a, place_b) = (place(a), place(b));
    place_a.is_some() && place_a == place_b || hard_link(a, b)
}

/// Whether both names are entries of one file.
#[cfg(unix)]
fn hard_link(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |path| fs::metadata(path).map(|m| (m.dev(), m.ino())).ok();
    identity(a).is_some_and(|a| Some(a) == identity(b))
}

#[cfg(not(unix))]
fn hard_link(_: &Path, _: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder that vanishes while a render runs costs no other file. Killed by: giving up at the first error,
    /// returning the last one or none, leaving out a file that could be written.
    #[test]
    fn one_error_does_not_stop_the_rest() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let mut picture = Picture::new(2, 1);
        picture.add3("", ["R", "G", "B"], &[[0.5; 3]; 2]);
        FALSE_COLOR.iter().for_each(|(layer, _)| picture.add1(layer, "s", &[1.0; 2]));
        let [exr, cache, lost] = ["a.exr", "a.cache", "no/where"].map(at);
        let whole = Outputs::new(&exr, Some(&cache), None, true);
        // The EXR, the cache and the PNG.
        let count = 3 + FALSE_COLOR.len();
        assert_eq!(whole.write(&picture, Some(&[7]), "", Exposure::Stops(0.0)).files.len(), count);
        for i in 0..count {
            let dir = tempfile::tempdir().unwrap();
            let mut names: Vec<PathBuf> = (0..count).map(|n| dir.path().join(n.to_string())).collect();
            names[i] = lost.join(i.to_string());
            let (png, false_color) = (Some(names[2].clone()), names[3..].to_vec());
            let outputs = Outputs { exr: &names[0], png, cache: Some(&names[1]), checkpoint: None, false_color };
            assert!(outputs.check().unwrap_err().contains("not a folder"));
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
            let written = outputs.write(&picture, Some(&[7]), "", Exposure::Stops(0.0));
            assert!(written.error.unwrap().to_string().contains(&format!("where/{i}")));
            names.remove(i);
            assert_eq!(written.files, names);
            assert!(names.iter().all(|n| n.is_file()));
        }
        let both = Outputs { exr: &lost.join("1"), cache: Some(&lost.join("2")), ..whole };
        let written = both.write(&picture, Some(&[7]), "", Exposure::Stops(0.0));
        assert!(written.error.unwrap().to_string().contains("where/1"));
        assert_eq!(written.files.len(), count - 2);
    }
}

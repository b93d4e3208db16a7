//! Until the modules of these names are merged into the library: the same calls, which say so.

use std::path::Path;

#[derive(Debug)]
pub struct NotAvailable;

impl std::fmt::Display for NotAvailable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "loading scenes is not part of this build; bake them first")
    }
}

impl std::error::Error for NotAvailable {}

pub struct SceneDescription;

pub mod load {
    use super::*;

    pub struct LoadReport;

    pub fn load(_: &Path) -> Result<(SceneDescription, LoadReport), NotAvailable> {
        Err(NotAvailable)
    }
}

pub mod builtin {
    use super::*;

    pub fn cornell_box() -> SceneDescription {
        SceneDescription
    }
}

pub mod bake {
    use super::*;

    #[derive(Default)]
    pub struct BakeOptions {
        _private: (),
    }

    #[derive(Debug)]
    pub struct Stage;

    pub struct Baked {
        pub bytes: Vec<u8>,
    }

    pub fn bake(_: &SceneDescription, _: &BakeOptions, _: impl Fn(Stage, f32)) -> Result<Baked, NotAvailable> {
        Err(NotAvailable)
    }
}

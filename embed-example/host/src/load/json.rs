//! JSON values with their paths, so that every message can name them.

use super::LoadError;
use crate::text::{self, excerpt};
use serde_json::{Map, Value};
use std::path::Path;

/// A value of a JSON file. Keys that nobody asks for are tolerated.
#[derive(Clone)]
pub(super) struct Place<'v> {
    pub file: &'v Path,
    /// `materials.Glass.int_ior`, `emitters[0].radiance`; empty for the document.
    pub at: String,
    value: &'v Value,
}

/// The document in `text`.
pub(super) fn parse(file: &Path, text: &str) -> Result<Value, LoadError> {
    serde_json::from_str(text).map_err(|e| LoadError::Json {
        path: file.into(),
        at: format!("line {} column {}", e.line(), e.column()),
        what: "not JSON: ".to_string() + &excerpt(e.to_string().split(" at line ").next().unwrap_or_default()),
    })
}

impl<'v> Place<'v> {
    pub(crate) fn document(file: &'v Path, value: &'v Value) -> Self {
        Self { file, at: String::new(), value }
    }

    pub(crate) fn error(&self, what: impl Into<String>) -> LoadError {
        let at = if self.at.is_empty() { "document".into() } else { self.at.clone() };
        LoadError::Json { path: self.file.into(), at, what: what.into() }
    }

    /// File and value, for messages about what it names.
    pub(crate) fn referrer(&self) -> String {
        format!("{} ({})", text::path(self.file), excerpt(&self.at))
    }

    fn child(&self, at: String, value: &'v Value) -> Self {
        Self { file: self.file, at, value }
    }

    fn object(&self) -> Result<&'v Map<String, Value>, LoadError> {
        self.value.as_object().ok_or_else(|| self.error("expected an object"))
    }

    /// The value of a key, if it is there and not null.
    pub(crate) fn find(&self, key: &str) -> Result<Option<Self>, LoadError> {
        let value = self.object()?.get(key).filter(|v| !v.is_null());
        let at = if self.at.is_empty() { key.into() } else { format!("{}.{key}", self.at) };
        Ok(value.map(|v| self.child(at, v)))
    }

    /// The value of a key.
    pub(crate) fn get(&self, key: &str) -> Result<Self, LoadError> {
        self.find(key)?.ok_or_else(|| self.error(format!("`{key}` is missing")))
    }

    /// Keys and values of an object.
    pub(crate) fn entries(&self) -> Result<impl Iterator<Item = (&'v str, Self)> + use<'v, '_>, LoadError> {
        Ok(self.object()?.iter().map(|(k, v)| (k.as_str(), self.child(format!("{}.{k}", self.at), v))))
    }

    /// Elements of an array.
    pub(crate) fn elements(&self) -> Result<Vec<Self>, LoadError> {
        let values = self.value.as_array().ok_or_else(|| self.error("expected an array"))?;
        Ok(values.iter().enumerate().map(|(i, v)| self.child(format!("{}[{i}]", self.at), v)).collect())
    }

    pub(crate) fn text(&self) -> Result<&'v str, LoadError> {
        self.value.as_str().ok_or_else(|| self.error("expected a text"))
    }

    pub(crate) fn flag(&self) -> Result<bool, LoadError> {
        self.value.as_bool().ok_or_else(|| self.error("expected true or false"))
    }

    pub(crate) fn number(&self) -> Result<f64, LoadError> {
        self.value.as_f64().ok_or_else(|| self.error("expected a number"))
    }

    pub(crate) fn float(&self) -> Result<f32, LoadError> {
        Ok(self.number()? as f32)
    }

    /// A whole number from `least`.
    pub(crate) fn count(&self, least: u32) -> Result<u32, LoadError> {
        let n = self.value.as_u64().and_then(|n| u32::try_from(n).ok()).filter(|n| *n >= least);
        n.ok_or_else(|| self.error(format!("expected a whole number from {least}")))
    }

    /// `N` numbers.
    pub(crate) fn numbers<const N: usize>(&self) -> Result<[f64; N], LoadError> {
        let wrong = || self.error(format!("expected {N} numbers"));
        let values = self.value.as_array().ok_or_else(wrong)?;
        let numbers: Option<Vec<f64>> = values.iter().map(Value::as_f64).collect();
        numbers.and_then(|n| n.try_into().ok()).ok_or_else(wrong)
    }

    /// Three numbers.
    pub(crate) fn rgb(&self) -> Result<[f32; 3], LoadError> {
        Ok(self.numbers::<3>()?.map(|x| x as f32))
    }

    pub(crate) fn is_number(&self) -> bool {
        self.value.is_number()
    }

    pub(crate) fn is_object(&self) -> bool {
        self.value.is_object()
    }
}

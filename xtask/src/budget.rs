//! The budgets of the project, `xtask/budgets.toml`.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::sources;

/// The file.
const FILE: &str = "xtask/budgets.toml";

/// Budgets of the project.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budgets {
    pub lines: Lines,
    pub part: Vec<Part>,
    /// Modules of the firmware that an image may leave out, by folder: feature, and most files outside the folder that name it.
    pub modules: BTreeMap<String, (String, usize)>,
    pub cycles: Cycles,
}

/// Lines of Rust without blanks, comments and documentation, of all parts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lines {
    pub code: usize,
    pub test_code: usize,
}

/// A part of the sources.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    pub name: String,
    /// Beginnings of the paths of its files.
    pub paths: Vec<String>,
    /// Most lines of code, if the part has a budget of its own.
    pub code: Option<usize>,
}

/// Estimated cycles of the control interrupt.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cycles {
    pub to_last_compare: u32,
    pub whole: u32,
}

/// Reads the budgets.
pub fn read() -> Result<Budgets> {
    toml::from_str(&sources::read(FILE)?).context(FILE)
}

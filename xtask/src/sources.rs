//! The source files of the repository.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use walkdir::WalkDir;

use crate::run;

/// Directories with build results.
const BUILT: [&str; 2] = ["target", "out"];

/// All files below the root with this ending, sorted, as paths relative to it.
pub fn files(extension: &str) -> Result<Vec<PathBuf>> {
    let kept = |name: &str| !name.starts_with('.') && !BUILT.contains(&name);
    let entries = WalkDir::new(run::root())
        .sort_by_file_name()
        .into_iter()
        .filter_entry(|entry| entry.depth() == 0 || kept(&entry.file_name().to_string_lossy()));
    let mut files = Vec::new();
    for entry in entries {
        let path = entry?.into_path();
        if path.extension().is_some_and(|found| found == extension) {
            files.push(path.strip_prefix(run::root())?.to_owned());
        }
    }
    Ok(files)
}

/// The text of a file of the repository.
pub fn read(path: impl AsRef<Path>) -> Result<String> {
    let path = run::root().join(path);
    fs::read_to_string(&path).with_context(|| path.display().to_string())
}

//! Copies of files and folders.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use walkdir::{DirEntry, WalkDir};

/// Copies a file, or everything below a folder, into a folder.
pub fn copy(from: &Path, to: &Path) -> Result<()> {
    let base = if from.is_dir() { from } else { from.parent().unwrap_or(from) };
    files(from)?.iter().try_for_each(|file| copy_as(file, &to.join(file.strip_prefix(base)?)))
}

/// Copies a file to a place, and makes the folder of that place.
pub fn copy_as(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::copy(from, to).map(drop).with_context(|| from.display().to_string())
}

/// All files below a folder.
pub fn files(from: &Path) -> Result<Vec<PathBuf>> {
    let entries = WalkDir::new(from).into_iter().collect::<Result<Vec<_>, _>>()?;
    let files = entries.into_iter().filter(|entry| entry.file_type().is_file());
    Ok(files.map(DirEntry::into_path).collect())
}

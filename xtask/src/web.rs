//! `cargo xtask web`: the drive in a browser, as a folder of files for any server of static files.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context as _, Result};

use crate::{paths, run, toolchain};

/// Largest folder, bytes.
const FOLDER_BYTES: u64 = 700_000;

/// Builds the folder; fails if it is too large, or names a directory of this machine.
pub fn build() -> Result<PathBuf> {
    let wasm = toolchain::compiler(run::BROWSER)?.browser("drive-web")?;
    paths::check(&fs::read(&wasm)?)?;
    let folder = run::folder("web")?;
    fs::remove_dir_all(&folder)?;
    let mut files = vec![(wasm, folder.join("drive.wasm"))];
    for part in ["", "uplot"] {
        let from = run::root().join("live/page").join(part);
        for entry in from.read_dir().with_context(|| from.display().to_string())? {
            let entry = entry?;
            if entry.file_type()?.is_file() {
                files.push((entry.path(), folder.join(part).join(entry.file_name())));
            }
        }
        fs::create_dir_all(folder.join(part))?;
    }
    let mut bytes = 0;
    for (from, to) in files {
        bytes += fs::copy(&from, to).with_context(|| from.display().to_string())?;
    }
    run::limit("drive in a browser", bytes, FOLDER_BYTES, "bytes")?;
    println!("{}: put it on any server of static files", folder.display());
    Ok(folder)
}

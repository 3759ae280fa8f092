//! `cargo xtask web`: the drive in a browser, as a folder of files for any server of static files.

use std::fs;
use std::path::PathBuf;

use anyhow::Result;

use crate::{files, paths, run, toolchain};

/// Largest folder, bytes.
const FOLDER_BYTES: u64 = 700_000;

/// Builds the folder; fails if it is too large, or names a directory of this machine.
pub fn build() -> Result<PathBuf> {
    let wasm = toolchain::compiler(run::BROWSER)?.browser("drive-web")?;
    paths::check(&fs::read(&wasm)?)?;
    let folder = run::folder("web")?;
    fs::remove_dir_all(&folder)?;
    files::copy(&run::root().join("live/page"), &folder)?;
    files::copy_as(&wasm, &folder.join("drive.wasm"))?;
    let all = files::files(&folder)?;
    let bytes = all.iter().flat_map(|file| file.metadata()).map(|file| file.len()).sum();
    run::limit("drive in a browser", bytes, FOLDER_BYTES, "bytes")?;
    println!("{}: put it on any server of static files", folder.display());
    Ok(folder)
}

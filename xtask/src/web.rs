//! `cargo xtask web`: the drive in a browser, as a folder of files for any server of static files.

use std::fs;
use std::path::PathBuf;

use anyhow::Result;

use crate::{dist, paths, run, toolchain};

/// Largest folder, bytes.
const FOLDER_BYTES: u64 = 700_000;

/// Builds the folder; fails if it is too large, or names a directory of this machine.
pub fn build() -> Result<PathBuf> {
    let wasm = toolchain::compiler(run::BROWSER)?.browser("drive-web")?;
    paths::check(&fs::read(&wasm)?)?;
    let folder = run::folder("web")?;
    fs::remove_dir_all(&folder)?;
    dist::copy(&run::root().join("live/page"), &folder)?;
    dist::copy_as(&wasm, &folder.join("drive.wasm"))?;
    let files = dist::files(&folder)?;
    let bytes = files.iter().flat_map(|file| file.metadata()).map(|file| file.len()).sum();
    run::limit("drive in a browser", bytes, FOLDER_BYTES, "bytes")?;
    println!("{}: put it on any server of static files", folder.display());
    Ok(folder)
}

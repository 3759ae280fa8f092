//! `cargo xtask web`: the drive in a browser, as a folder of files for any server of static files.

use std::fs;
use std::path::PathBuf;

use anyhow::Result;

use crate::{files, paths, run, toolchain};

/// Largest folder, bytes.
const FOLDER_BYTES: u64 = 700_000;

/// Optimise for size; instructions that every browser with WebAssembly 2.0 has, which the compiler uses.
const SMALLER: [&str; 4] =
    ["-Oz", "--enable-bulk-memory", "--enable-sign-ext", "--enable-nontrapping-float-to-int"];

/// Builds the folder; fails if it is too large, or names a directory of this machine.
pub fn build() -> Result<PathBuf> {
    let wasm = toolchain::compiler(run::BROWSER)?.browser("drive-web")?;
    paths::check(&fs::read(&wasm)?)?;
    let folder = run::folder("web")?;
    fs::remove_dir_all(&folder)?;
    files::copy(&run::root().join("live/page"), &folder)?;
    toolchain::ensure_binaryen()?;
    let mut optimiser = run::command("wasm-opt");
    optimiser.args(SMALLER).arg(&wasm).arg("-o").arg(folder.join("drive.wasm"));
    run::step("size of the library", &mut optimiser)?;
    let all = files::files(&folder)?;
    let bytes = all.iter().flat_map(|file| file.metadata()).map(|file| file.len()).sum();
    run::limit("drive in a browser", bytes, FOLDER_BYTES, "bytes")?;
    println!("{}: put it on any server of static files", folder.display());
    Ok(folder)
}

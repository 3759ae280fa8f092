//! Finds the folder of the motors, which is compiled into this crate.

use std::path::PathBuf;
use std::{env, fs};

/// Candidate folders: the one in the repository, and the one in a package of this crate, where the link `motors`
/// becomes the folder itself. A clone of the repository may hold a text file in place of the link, so the repository's
/// own folder comes first.
const FOLDERS: [&str; 2] = ["../../motors", "motors"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    let here = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    let folder = FOLDERS.into_iter().find(|folder| here.join(folder).is_dir());
    let folder = fs::canonicalize(here.join(folder.ok_or("the folder `motors` is missing")?))?;
    println!("cargo::rerun-if-changed={}", folder.display());
    println!("cargo::rustc-env=MOTORS={}", folder.display());
    Ok(())
}

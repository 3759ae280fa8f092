//! Gives the program a number of its sources: a run that was begun by other sources is not continued, though the
//! version is the same.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Sources that a result of an experiment depends on, beside the packages of `Cargo.lock`. A published package has no
/// neighbours: the versions of these are fixed then.
const SOURCES: [&str; 7] =
    ["src", "scenarios", "bench/src", "lab/src", "plant/src", "../drive-core/src", "../motors"];

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    for source in SOURCES {
        let folder = root.join(source);
        if folder.is_dir() {
            println!("cargo::rerun-if-changed={source}");
            collect(&folder, &mut files)?;
        }
    }
    files.sort();
    let crc = crc::Crc::<u64>::new(&crc::CRC_64_XZ);
    let mut digest = crc.digest();
    for file in files {
        let name = file.strip_prefix(&root).unwrap_or(&file).to_string_lossy().replace('\\', "/");
        digest.update(name.as_bytes());
        digest.update(&fs::read(&file)?);
    }
    println!("cargo::rustc-env=HIL_SIM_SOURCES={:016x}", digest.finalize());
    Ok(())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}

//! Keeps the paths of this machine out of the image.
//!
//! The locations of panics are in the flash, and the names of all source files are in the debug information, which the hash of the image
//! covers. With short names for the directories of this machine, two machines build the same image.

use std::env;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};

use crate::run;

/// Directories of this machine, and their short names in the image. If several match, the last one is used.
fn short_names() -> Result<Vec<(PathBuf, &'static str)>> {
    let mut names = vec![(run::root().to_owned(), "."), (run::target_dir()?, "target")];
    // One directory for each registry, with a directory for each package. It exists, since this program
    // has dependencies too.
    for registry in cargo_home()?.join("registry/src").read_dir().into_iter().flatten().flatten() {
        names.push((registry.path(), ""));
    }
    Ok(names)
}

/// The folder of cargo, with the sources of all packages.
pub fn cargo_home() -> Result<PathBuf> {
    match env::var_os("CARGO_HOME") {
        Some(home) => std::path::absolute(home).context("CARGO_HOME"),
        None => Ok(env::home_dir().context("there is no home directory")?.join(".cargo")),
    }
}

/// An option of cargo that makes the compiler for a target write the short names. It adds to the flags of the target in
/// `.cargo/config.toml`; environment variables would replace these.
pub fn option(target: &str) -> Result<String> {
    let flag =
        |(long, short): (PathBuf, _)| format!("--remap-path-prefix={}={short}", long.display());
    let flags: Vec<String> = short_names()?.into_iter().map(flag).collect();
    // The debug format of a list of strings is TOML.
    Ok(format!("--config=target.{target}.rustflags={flags:?}"))
}

/// Fails if an image contains a path of this machine.
pub fn check(image: &[u8]) -> Result<()> {
    for (long, _) in short_names()? {
        let text = long.as_os_str().as_encoded_bytes();
        let is_inside = image.windows(text.len()).any(|part| part == text);
        ensure!(!is_inside, "{} is in the image: its hash is of this machine only", long.display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_with_a_path_of_this_machine_is_refused() {
        assert!(check(b"src/main.rs\0defmt-1.2.0/src/lib.rs").is_ok());
        let inside = format!("\0{}/src/main.rs\0", run::root().display());
        let error = check(inside.as_bytes()).unwrap_err().to_string();
        assert!(error.starts_with(&run::root().display().to_string()), "{error}");
    }

    #[test]
    fn the_registry_is_known() {
        let names = short_names().unwrap();
        assert!(
            names
                .iter()
                .any(|(long, short)| long.starts_with(cargo_home().unwrap()) && short.is_empty())
        );
    }
}

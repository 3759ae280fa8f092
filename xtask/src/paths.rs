//! Paths of this machine, and keeping them out of the image.
//!
//! A panic's location is in the flash, and the names of all source files are in the debug information,
//! which the hash of the image covers: with short names instead, two machines build the same image.

use std::env;
use std::ffi::OsStr;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::run;
use crate::toolchain::TARGET;

/// Directories of this machine, and what stands for them in the image. Where several fit, the last counts.
fn short_names() -> Result<Vec<(PathBuf, &'static str)>> {
    let mut names = vec![(run::root().to_owned(), "."), (run::target_dir()?, "target")];
    // One directory for each registry; it is there, since this program has dependencies too. What is
    // under it begins with the name of the package.
    for registry in cargo_home()?.join("registry/src").read_dir().into_iter().flatten().flatten() {
        names.push((registry.path(), ""));
    }
    Ok(names)
}

fn cargo_home() -> Result<PathBuf> {
    match env::var_os("CARGO_HOME") {
        Some(home) => std::path::absolute(home).context("CARGO_HOME"),
        None => Ok(env::home_dir().context("there is no home directory")?.join(".cargo")),
    }
}

/// An option of cargo by which the compiler writes the short names. It adds to the flags of the target in
/// `.cargo/config.toml`; the variables of the environment would replace them.
pub fn option() -> Result<String> {
    let flag = |(long, short): (PathBuf, &str)| {
        format!("{:?}", format!("--remap-path-prefix={}={short}", long.display()))
    };
    let flags: Vec<String> = short_names()?.into_iter().map(flag).collect();
    Ok(format!("--config=target.{TARGET}.rustflags=[{}]", flags.join(", ")))
}

/// Fails if a file of an image has a path of this machine in it.
pub fn check(image: &[u8]) -> Result<()> {
    for (long, _) in short_names()? {
        if contains(image, long.as_os_str()) {
            bail!("{} is in the image: its hash is of this machine only", long.display());
        }
    }
    Ok(())
}

fn contains(image: &[u8], text: &OsStr) -> bool {
    let text = text.as_encoded_bytes();
    image.windows(text.len()).any(|part| part == text)
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

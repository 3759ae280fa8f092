//! `cargo xtask dist`: everything of a release in one folder, the same byte for byte wherever the same compiler builds it.

use std::collections::{BTreeMap, BTreeSet};
use std::env::consts::EXE_SUFFIX;
use std::path::{Path, PathBuf};
use std::{env, fs};

use anyhow::{Context, Result, ensure};
use clap::Args;
use glob::glob;
use sha2::{Digest, Sha256};

use crate::files::{copy, copy_as, files};
use crate::results::outdated;
use crate::sbom::Sbom;
use crate::toolchain::{self, Target};
use crate::{fmu, image, paths, python, run, tools, web};

/// The file of the check sums, in the form of `sha256sum`.
const SUMS: &str = "SHA256SUMS";
/// Programs for this machine; each is named as its package.
const PROGRAMS: [&str; 2] = ["hil-sim", "drive-live"];
/// Texts of the repository, with the folder that they are copied to.
const TEXTS: [(&str, &str); 3] = [
    ("description", "docs/settings.md docs/modbus.md docs/faults.md tests/numbers.txt"),
    ("licences", "LICENSE-APACHE LICENSE-MIT"),
    ("", "CHANGELOG.md SECURITY.md"),
];
/// Names of files with a licence.
const LICENCES: [&str; 5] = ["LICEN*", "[lL]icen*", "UNLICENSE*", "COPYING*", "NOTICE*"];

/// Options of the release.
#[derive(Args)]
pub struct Dist {
    /// A folder to which target/dist is copied
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Only the programs for this machine, with their licences and lists of crates
    #[arg(long)]
    programs: bool,
    /// Also with results in the book that are older than their inputs
    #[arg(long)]
    older_results: bool,
    /// Builds everything again in a clone elsewhere; fails if a file differs
    #[arg(long, conflicts_with = "programs")]
    twice: bool,
}

/// Makes the folder `target/dist`. Existing wheels of this version in `target/wheels` are included.
pub fn dist(options: &Dist) -> Result<()> {
    let older = if options.programs || options.older_results { Vec::new() } else { outdated()? };
    let names: Vec<_> = older.iter().map(|result| &*result.name).collect();
    ensure!(
        names.is_empty(),
        "results/ has numbers that are older than control, plant or experiment: {}. `cargo xtask prove results` measures them \
         again; --older-results ships them as they are",
        names.join(", ")
    );
    let folder = run::folder("dist")?;
    fs::remove_dir_all(&folder)?;
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let mut built: Vec<_> = PROGRAMS.map(|name| (name, &*host, Target::InUse)).into();
    programs(&host, &folder.join("programs").join(&host))?;
    if !options.programs {
        let target = toolchain::for_target()?;
        // The reference board comes last, because each build leaves its image at the same path.
        for board in image::boards()?.iter().rev() {
            let elf = image::build_for(&target, board, image::FULL)?;
            for (from, to) in [("", "elf"), ("bin", "bin"), ("hex", "hex")] {
                let to = folder.join("firmware").join(format!("{board}.{to}"));
                copy_as(&elf.with_extension(from), &to)?;
            }
        }
        built.push(("induction-drive", run::TARGET, target));
        built.push(("drive-web", run::BROWSER, toolchain::compiler(run::BROWSER)?));
        built.push(("induction-drive-fmu", &*host, Target::InUse));
        copy(&fmu::build()?, &folder.join("fmu"))?;
        copy(&web::build()?, &folder.join("web"))?;
        copy(&tools::book()?, &folder.join("book"))?;
    }
    for wheel in python::wheels()? {
        built.push(("induction-drive-python", &*host, Target::InUse));
        copy(&wheel, &folder.join("wheels"))?;
    }
    for (to, texts) in TEXTS {
        texts.split(' ').try_for_each(|text| copy(&run::root().join(text), &folder.join(to)))?;
    }
    let mut others = BTreeSet::new();
    for (package, target, compiler) in built {
        let list = Sbom::new(package, target)?;
        if target == run::TARGET {
            let elf = folder.join("firmware").join(image::REFERENCE).with_extension("elf");
            list.check(&fs::read(elf)?)?;
        }
        let kind = if target == run::TARGET { "firmware" } else { "application" };
        let text = list.document(package, kind, &compiler.version()?)?;
        fs::write(run::folder("dist/sbom")?.join(format!("{package}.cdx.json")), text)?;
        others.extend(list.of_others().map(|one| one.replace('@', "-")));
    }
    for (name, licence) in others.iter().flat_map(|name| LICENCES.map(|one| (name, one))) {
        let files = paths::cargo_home()?.join("registry/src/*").join(name).join(licence);
        for file in glob(&files.to_string_lossy())? {
            copy(&file?, &folder.join("licences").join(name))?;
        }
    }
    let lines = |(name, sum)| format!("{sum}  {name}\n");
    let text: String = sums(&folder)?.into_iter().map(lines).collect();
    fs::write(folder.join(SUMS), text)?;
    println!("\n{}", folder.display());
    if options.twice {
        same_elsewhere(&folder)?;
    }
    options.out.as_ref().map_or(Ok(()), |out| copy(&folder, out))
}

/// Builds the programs for this machine into a folder.
fn programs(host: &str, folder: &Path) -> Result<()> {
    let mut command = run::cargo("build --locked --profile");
    command.args([run::SHIPPED, &paths::option(host)?]);
    command.args(PROGRAMS.map(|name| format!("--package={name}")));
    run::step("programs", run::plain(&mut command))?;
    PROGRAMS.iter().try_for_each(|name| {
        let program = run::target_dir()?.join(run::SHIPPED).join(format!("{name}{EXE_SUFFIX}"));
        paths::check(&fs::read(&program)?).with_context(|| name.to_string())?;
        copy(&program, folder)
    })
}

/// Builds the release of this commit again in a clone in another folder; fails if one of the files differs.
fn same_elsewhere(here: &Path) -> Result<()> {
    let elsewhere = env::temp_dir().join(format!("induction-drive-{}", std::process::id()));
    let clone = elsewhere.join("clone");
    let mut git = run::command("git");
    run::step("clone", git.args(["clone", "--quiet"]).arg(run::root()).arg(&clone))?;
    // The release builds neither the program that makes the book nor a wheel.
    for made in ["tools", "wheels"] {
        copy(&run::folder(made)?, &clone.join("target").join(made))?;
    }
    let mut command = run::cargo("xtask dist --older-results");
    command.current_dir(&clone).env("CARGO_TARGET_DIR", clone.join("target"));
    run::step("release in another folder", &mut command)?;
    let (ours, theirs) = (sums(here)?, sums(&clone.join("target/dist"))?);
    let mut names: BTreeSet<_> = ours.keys().chain(theirs.keys()).collect();
    println!("{} files", names.len());
    names.retain(|name| ours.get(*name) != theirs.get(*name));
    ensure!(names.is_empty(), "not the same as in {}: {names:?}", clone.display());
    fs::remove_dir_all(&elsewhere).with_context(|| elsewhere.display().to_string())
}

/// The sum of each file below a folder, by its path.
fn sums(folder: &Path) -> Result<BTreeMap<String, String>> {
    let sum = |file: PathBuf| {
        let path = file.strip_prefix(folder)?.to_string_lossy().replace('\\', "/");
        let sum = Sha256::digest(fs::read(&file)?);
        Ok((path, sum.iter().map(|byte| format!("{byte:02x}")).collect()))
    };
    files(folder)?.into_iter().map(sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_sha256sum() {
        let folder = run::folder("tmp/sums/a").unwrap();
        fs::write(folder.join("b"), "abc").unwrap();
        let sums = sums(&folder.join("..")).unwrap();
        // FIPS 180-4, example 1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sums, BTreeMap::from([("a/b".to_owned(), abc.to_owned())]));
    }
}

//! `cargo xtask dist`: everything of a release in one folder, the same byte for byte wherever it is built by the same compiler.

use std::collections::{BTreeMap, BTreeSet};
use std::env::consts::EXE_SUFFIX;
use std::path::{Path, PathBuf};
use std::{env, fs};

use anyhow::{Context, Result, ensure};
use clap::Args;
use sha2::{Digest, Sha256};
use walkdir::WalkDir;

use crate::sbom::Sbom;
use crate::{image, paths, run, toolchain, tools, web};

/// The file of the check sums, in the form of `sha256sum`.
const SUMS: &str = "SHA256SUMS";
/// Programs for this machine; each is named as its package.
const PROGRAMS: [&str; 2] = ["hil-sim", "drive-live"];
/// Their profile.
const PROFILE: &str = "shipped";
/// Texts of the repository, and where they are put.
const TEXTS: [(&str, &str); 8] = [
    ("docs/settings.md", "description"),
    ("docs/modbus.md", "description"),
    ("docs/faults.md", "description"),
    ("tests/numbers.txt", "description"),
    ("CHANGELOG.md", ""),
    ("SECURITY.md", ""),
    ("LICENSE-APACHE", "licences"),
    ("LICENSE-MIT", "licences"),
];
/// How the name of a file with a licence begins.
const LICENCES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"];

/// What is built, and where to.
#[derive(Args)]
pub struct Dist {
    /// A new folder [default: target/dist, which is emptied]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The programs for this machine alone, with what belongs to them
    #[arg(long)]
    programs: bool,
    /// A folder with wheels of this version, which are taken in
    #[arg(long, value_name = "DIR")]
    wheels: Option<PathBuf>,
    /// Builds again in a clone elsewhere; fails if a file differs
    #[arg(long, conflicts_with_all = ["out", "programs", "wheels"])]
    twice: bool,
}

/// Makes the folder, by default `target/dist`.
pub fn dist(options: &Dist) -> Result<()> {
    let folder = build(options)?;
    if options.twice { same_elsewhere(&folder) } else { Ok(()) }
}

fn build(options: &Dist) -> Result<PathBuf> {
    let folder = match &options.out {
        Some(folder) => std::path::absolute(folder)?,
        None => run::target_dir()?.join("dist"),
    };
    if options.out.is_none() && folder.is_dir() {
        fs::remove_dir_all(&folder)?;
    }
    let is_new = !folder.read_dir().is_ok_and(|mut entries| entries.next().is_some());
    ensure!(is_new, "{} is not empty", folder.display());
    let rustc = run::output("rustc", &["--version"])?;
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let mut lists = Vec::new();

    let mut command = run::cargo("build --locked --profile");
    command.args([PROFILE, &paths::option(&host, &[])?]);
    command.args(PROGRAMS.map(|name| format!("--package={name}")));
    // Increments, which two packages of the profile are built by, leave traces.
    command.env("CARGO_INCREMENTAL", "0").env_remove("RUSTFLAGS");
    run::step("programs", command.env_remove("CARGO_ENCODED_RUSTFLAGS"))?;
    for name in PROGRAMS {
        let program = run::target_dir()?.join(PROFILE).join(format!("{name}{EXE_SUFFIX}"));
        paths::check(&fs::read(&program)?).with_context(|| name.to_owned())?;
        copy(&program, &folder.join("programs").join(&host))?;
        lists.push((Sbom::new(name, &host)?, name, "application", rustc.clone()));
    }
    if !options.programs {
        let target = toolchain::for_target()?;
        let list = Sbom::new("induction-drive", run::TARGET)?;
        // The reference board last: the others leave their image at its path.
        for board in image::boards()?.iter().rev() {
            let elf = image::build_for(&target, board)?;
            list.check(&fs::read(&elf)?)?;
            for (from, to) in [("", "elf"), ("bin", "bin"), ("hex", "hex")] {
                let to = folder.join("firmware").join(format!("{board}.{to}"));
                write(&to, &fs::read(elf.with_extension(from))?)?;
            }
        }
        lists.push((list, "induction-drive", "firmware", target.version()?));
        let browser = toolchain::compiler(run::BROWSER)?.version()?;
        lists.push((Sbom::new("drive-web", run::BROWSER)?, "drive-web", "application", browser));
        copy(&web::build()?, &folder.join("web"))?;
        copy(&tools::book()?, &folder.join("book"))?;
    }
    if let Some(wheels) = &options.wheels {
        copy(wheels, &folder.join("wheels"))?;
    }
    for (file, to) in TEXTS {
        copy(&run::root().join(file), &folder.join(to))?;
    }
    for (list, package, kind, compiler) in &lists {
        let text = list.document(package, kind, compiler)?;
        write(&folder.join("sbom").join(format!("{package}.cdx.json")), text.as_bytes())?;
    }
    for name in lists.iter().flat_map(|(list, ..)| list.of_others()).collect::<BTreeSet<_>>() {
        for source in paths::registries()?.iter().map(|registry| registry.join(&name)) {
            for entry in source.read_dir().into_iter().flatten().flatten() {
                let file = entry.file_name().to_string_lossy().to_uppercase();
                if LICENCES.iter().any(|begin| file.starts_with(begin)) {
                    copy(&entry.path(), &folder.join("licences").join(&name))?;
                }
            }
        }
    }
    let text: String =
        sums(&folder)?.iter().map(|(name, sum)| format!("{sum}  {name}\n")).collect();
    write(&folder.join(SUMS), text.as_bytes())?;
    println!("\n{}", folder.display());
    Ok(folder)
}

/// Builds the release of this commit again in a clone in another folder; fails if one of the files differs.
fn same_elsewhere(here: &Path) -> Result<()> {
    let elsewhere = env::temp_dir().join(format!("induction-drive-{}", std::process::id()));
    let clone = elsewhere.join("clone");
    let mut git = run::command("git");
    run::step("clone", git.args(["clone", "--quiet"]).arg(run::root()).arg(&clone))?;
    let built = clone.join("target");
    // The program that makes the book is no part of the release.
    copy(&run::folder("tools")?, &built.join("tools"))?;
    let mut command = run::cargo("xtask dist");
    command.current_dir(&clone).env("CARGO_TARGET_DIR", &built);
    run::step("release in another folder", &mut command)?;
    let (ours, theirs) = (sums(here)?, sums(&built.join("dist"))?);
    let mut names: BTreeSet<_> = ours.keys().chain(theirs.keys()).collect();
    println!("{} files", names.len());
    names.retain(|name| ours.get(*name) != theirs.get(*name));
    ensure!(names.is_empty(), "not the same as in {}: {names:?}", clone.display());
    fs::remove_dir_all(&elsewhere).with_context(|| elsewhere.display().to_string())
}

/// The sum of each file below a folder but [`SUMS`], by its path.
fn sums(folder: &Path) -> Result<BTreeMap<String, String>> {
    let mut sums = BTreeMap::new();
    for file in files(folder)? {
        let path = file.strip_prefix(folder)?.to_string_lossy().replace('\\', "/");
        let sum = Sha256::digest(fs::read(&file)?);
        sums.insert(path, sum.iter().map(|byte| format!("{byte:02x}")).collect());
    }
    sums.remove(SUMS);
    Ok(sums)
}

/// Copies a file, or all below a folder, into a folder.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let base = if from.is_dir() { from } else { from.parent().unwrap_or(from) };
    for file in files(from)? {
        let to = to.join(file.strip_prefix(base)?);
        fs::create_dir_all(to.parent().unwrap_or(&to))?;
        fs::copy(&file, &to).with_context(|| file.display().to_string())?;
    }
    Ok(())
}

fn write(to: &Path, bytes: &[u8]) -> Result<()> {
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::write(to, bytes).with_context(|| to.display().to_string())
}

fn files(from: &Path) -> Result<Vec<PathBuf>> {
    let entries = WalkDir::new(from).into_iter().collect::<Result<Vec<_>, _>>()?;
    let files = entries.into_iter().filter(|entry| entry.file_type().is_file());
    Ok(files.map(walkdir::DirEntry::into_path).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_of_every_file_but_their_own() {
        let folder = run::folder("tmp/sums").unwrap();
        write(&folder.join("a/b"), b"abc").unwrap();
        write(&folder.join(SUMS), b"old").unwrap();
        let sums = sums(&folder).unwrap();
        // FIPS 180-4, example 1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sums, BTreeMap::from([("a/b".to_owned(), abc.to_owned())]));
    }
}

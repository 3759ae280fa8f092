//! The programs that build for the microcontroller and for this machine, and their installation.
//!
//! If rustup may install, it adds the target. Otherwise Debian's compiler builds the core library from Debian's sources, with results in
//! a directory of its own, so that the two compilers do not replace each other's. Root installs Debian's packages; other users are told
//! the command. No step is ever skipped.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail, ensure};

use crate::paths;
use crate::run::{self, BROWSER, PROFILE, TARGET};

/// Debian's compiler, cargo, sources of the core library, lints and linker; cmake for the virtual board.
const DEBIAN_PACKAGES: &str = "rustc-web cargo-web rust-web-src rust-web-clippy lld cmake";

/// The compiler for the microcontroller.
pub enum Target {
    /// The toolchain in use.
    InUse,
    /// Debian's toolchain, with the core library built from source.
    Debian,
}

impl Target {
    /// A cargo command for the microcontroller, for any workspace and profile.
    pub fn bare(&self, subcommand: &str) -> Command {
        self.with_library(subcommand, "core")
    }

    /// A cargo command for any target that has no operating system, with these crates of the standard library.
    fn with_library(&self, subcommand: &str, library: &str) -> Command {
        let mut command = run::cargo(subcommand);
        if let Self::Debian = self {
            command = run::command("/usr/bin/cargo");
            let path = std::env::var("PATH").unwrap_or_default();
            command
                .args([subcommand, &format!("-Zbuild-std={library}")])
                // A stable compiler builds the core library only with this variable.
                .env("RUSTC_BOOTSTRAP", "1")
                // Debian's programs before those of rustup.
                .env("PATH", format!("/usr/bin:{path}"))
                .env("RUSTC", "/usr/bin/rustc")
                .env("CARGO_BUILD_BUILD_DIR", run::root().join("target/debian"))
                .env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", "ld.lld")
                .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", "wasm-ld");
            for name in ["LD_LIBRARY_PATH", "RUSTUP_TOOLCHAIN", "CARGO", "RUSTDOC"] {
                command.env_remove(name);
            }
        }
        // These variables would replace the flags of the target in .cargo/config.toml.
        command.env_remove("RUSTFLAGS").env_remove("CARGO_ENCODED_RUSTFLAGS");
        command
    }

    /// A cargo command for the microcontroller, in the profile of the image.
    pub fn cargo(&self, subcommand: &str) -> Result<Command> {
        let mut command = self.bare(subcommand);
        command.args(["--profile", PROFILE, "--target", TARGET, &paths::option(TARGET)?]);
        command.arg("--target-dir").arg(self.target_dir()?);
        Ok(command)
    }

    /// Builds the library of a package for a browser; returns its path.
    pub fn browser(&self, package: &str) -> Result<PathBuf> {
        // A library that Rust can use as well would not be optimised as a whole.
        let mut command = self.with_library("rustc", "std,panic_abort");
        command.args(["--lib", "--crate-type", "cdylib"]);
        command.args(["--profile", "web", "--target", BROWSER, "--package", package]);
        command.arg(paths::option(BROWSER)?).arg("--target-dir").arg(self.target_dir()?);
        if let Self::Debian = self {
            // Where a panic was is in the library: some thirty long names of Debian's own sources.
            let short = "--remap-path-prefix=/usr/lib/rustlib/src/rust/library=std";
            command.arg(format!("--config=target.{BROWSER}.rustflags=[{short:?}]"));
        }
        run::step("library for a browser", &mut command)?;
        let name = package.replace('-', "_") + ".wasm";
        Ok(self.target_dir()?.join(BROWSER).join("web").join(name))
    }

    /// The full image that this compiler builds.
    pub fn image(&self) -> Result<PathBuf> {
        Ok(self.target_dir()?.join(TARGET).join(PROFILE).join("induction-drive"))
    }

    /// Name and version of the compiler.
    pub fn version(&self) -> Result<String> {
        let rustc = if let Self::Debian = self { "/usr/bin/rustc" } else { "rustc" };
        run::output(rustc, &["--version"])
    }

    fn target_dir(&self) -> Result<PathBuf> {
        let base = run::target_dir()?;
        Ok(match self {
            Self::InUse => base,
            Self::Debian => base.join("debian"),
        })
    }
}

/// Finds or installs a compiler for the microcontroller.
pub fn for_target() -> Result<Target> {
    compiler(TARGET)
}

/// Finds or installs a compiler for a target: [`TARGET`] or [`BROWSER`].
pub fn compiler(target: &str) -> Result<Target> {
    let (has_target, rustup) = (|| has(target), format!("rustup target add {target}"));
    if has_target() || rustup_may_install() {
        provide("the target", has_target, &rustup, "")?;
        return Ok(Target::InUse);
    }
    println!("\nThe toolchain in use has no {target}, so Debian's compiler builds for it.");
    let there =
        || run::said(run::command("dpkg").arg("--status").args(DEBIAN_PACKAGES.split(' '))).is_ok();
    provide(&format!("a compiler for {target}"), there, &rustup, DEBIAN_PACKAGES)?;
    Ok(Target::Debian)
}

/// Finds or installs `cargo fmt` and `cargo clippy` for the toolchain in use.
pub fn ensure_format_and_lints() -> Result<()> {
    let tools = ["fmt --version", "clippy --version"];
    let there = || tools.iter().all(|words| run::said(&mut run::cargo(words)).is_ok());
    let rustup = "rustup component add rustfmt clippy";
    provide("cargo fmt or cargo clippy", there, rustup, "rustfmt-web rust-web-clippy")
}

/// Finds or installs a C compiler, for the emulator of the virtual board.
pub fn ensure_c_compiler() -> Result<()> {
    let packages = "cmake gcc libc6-dev make pkg-config";
    let there = || ["cmake", "cc", "make", "pkg-config"].into_iter().all(answers);
    provide("cmake, make, pkg-config or a C compiler", there, "", packages)
}

/// Finds or installs Chromium, for pictures of pages.
pub fn ensure_chromium() -> Result<()> {
    provide("chromium", || answers("chromium"), "", "chromium")
}

/// Finds or installs `wasm-opt`, which makes a library for a browser smaller.
pub fn ensure_binaryen() -> Result<()> {
    provide("wasm-opt", || answers("wasm-opt"), "", "binaryen")
}

/// Finds or installs the clients of the field bus that are programs of Debian: mbpoll, and LinuxCNC with its `vfdb_vfd`.
pub fn ensure_bus_clients() -> Result<()> {
    let there = || {
        [("mbpoll", "-V"), ("halcmd", "-V"), ("vfdb_vfd", "-h")]
            .into_iter()
            .all(|(program, option)| run::said(run::command(program).arg(option)).is_ok())
    };
    provide("mbpoll or LinuxCNC", there, "", "mbpoll linuxcnc-uspace")
}

/// Installs a missing program, by a command of rustup or as packages of Debian.
fn provide(what: &str, there: impl Fn() -> bool, rustup: &str, packages: &str) -> Result<()> {
    if there() {
        return Ok(());
    }
    let install = format!("apt-get install -y -q --no-install-recommends {packages}");
    let is_root = run::output("id", &["-u"]).is_ok_and(|id| id == "0");
    let mut commands = vec!["apt-get update -q", &install];
    if !rustup.is_empty() && rustup_may_install() {
        commands = vec![rustup];
    } else if !is_root || !Path::new("/etc/debian_version").is_file() {
        let debian = format!("as root on Debian: {}", commands.join(" && "));
        bail!("{what} is missing. Type {debian}\nElsewhere: {rustup}");
    }
    for mut words in commands.iter().map(|command| command.split(' ')) {
        let mut command = run::command(words.next().unwrap_or_default());
        run::step(what, command.args(words).env("DEBIAN_FRONTEND", "noninteractive"))?;
    }
    ensure!(there(), "{what} is still missing");
    Ok(())
}

/// Whether a program is installed.
fn answers(program: &str) -> bool {
    run::said(run::command(program).arg("--version")).is_ok()
}

fn rustup_may_install() -> bool {
    std::env::var("RUSTUP_AUTO_INSTALL").as_deref() != Ok("0") && answers("rustup")
}

/// Whether the toolchain in use has the core library of a target.
fn has(target: &str) -> bool {
    let library = run::output("rustc", &["--print", "target-libdir", "--target", target]);
    let entries = library.ok().and_then(|dir| Path::new(&dir).read_dir().ok());
    let mut files = entries.into_iter().flatten().flatten();
    files.any(|entry| entry.file_name().to_string_lossy().starts_with("libcore-"))
}

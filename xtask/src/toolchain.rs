//! What builds for the microcontroller on this machine, and how it gets here.
//!
//! In this order:
//!
//! 1. the toolchain in use has the target: plain cargo;
//! 2. rustup may install: it adds the target;
//! 3. Debian: its compiler builds the core library from Debian's sources, in a directory of its own,
//!    so that the two compilers do not throw away each other's work. Root gets the packages.
//!
//! Elsewhere it fails, and says what to type. Nothing is ever skipped.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::paths;
use crate::run::{self, Step};

/// The microcontroller: Cortex-M4 with a single-precision floating-point unit.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// Profile of the image that is flashed.
pub const PROFILE: &str = "firmware";

/// Debian's packages for the target: compiler, cargo, sources of the core library, lints, linker,
/// and cmake for C code in tests.
const PACKAGES: &str = "rustc-web cargo-web rust-web-src rust-web-clippy lld cmake";
/// What of [`PACKAGES`] must be there.
const NEEDED: [&str; 5] = [
    "/usr/bin/rustc",
    "/usr/bin/cargo",
    "/usr/bin/cargo-clippy",
    "/usr/bin/ld.lld",
    "/usr/lib/rustlib/src/rust/library/Cargo.lock",
];

/// How to build for the target.
pub enum Target {
    /// With the toolchain in use.
    InUse,
    /// With Debian's compiler, and the core library from source.
    Debian,
}

impl Target {
    /// A cargo command for the target, in the profile of the image.
    pub fn cargo(&self, subcommand: &str) -> Result<Command> {
        let mut command = match self {
            Self::InUse => run::cargo()(),
            Self::Debian => {
                let mut command = run::command("/usr/bin/cargo");
                let path = std::env::var("PATH").unwrap_or_default();
                command
                    // The command shown is complete; this keeps rustup's programs out of the way.
                    .env("PATH", format!("/usr/bin:{path}"))
                    .env("RUSTC", "/usr/bin/rustc")
                    // Cargo builds the core library only for those who ask for unstable features.
                    .env("RUSTC_BOOTSTRAP", "1")
                    .env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", "ld.lld");
                for name in ["LD_LIBRARY_PATH", "RUSTUP_TOOLCHAIN", "CARGO", "RUSTDOC"] {
                    command.env_remove(name);
                }
                command
            }
        };
        // They would replace the flags of the target in .cargo/config.toml.
        command.env_remove("RUSTFLAGS").env_remove("CARGO_ENCODED_RUSTFLAGS");
        command.arg(subcommand).args(["--profile", PROFILE, "--target", TARGET]);
        command.arg(paths::option()?);
        if let Self::Debian = self {
            command.arg("-Zbuild-std=core").arg("--target-dir").arg(self.target_dir()?);
        }
        Ok(command)
    }

    /// Where this way of building puts its results.
    pub fn target_dir(&self) -> Result<PathBuf> {
        let base = run::target_dir()?;
        Ok(match self {
            Self::InUse => base,
            Self::Debian => base.join("debian"),
        })
    }
}

/// What this machine has.
#[derive(Clone, Copy, Debug, Default)]
struct Machine {
    target_installed: bool,
    rustup: bool,
    rustup_may_install: bool,
    debian: bool,
    debian_ready: bool,
    root: bool,
}

impl Machine {
    fn look() -> Self {
        let library = run::output("rustc", &["--print", "target-libdir", "--target", TARGET]);
        Self {
            target_installed: library.is_some_and(|dir| holds_core(Path::new(&dir))),
            rustup: run::succeeds("rustup", &["--version"]),
            rustup_may_install: std::env::var("RUSTUP_AUTO_INSTALL").as_deref() != Ok("0"),
            debian: Path::new("/etc/debian_version").is_file(),
            debian_ready: NEEDED.iter().all(|file| Path::new(file).exists())
                && new_enough(&run::output("/usr/bin/rustc", &["--version"]).unwrap_or_default()),
            root: run::output("id", &["-u"]).as_deref() == Some("0"),
        }
    }
}

fn holds_core(dir: &Path) -> bool {
    let Ok(entries) = dir.read_dir() else { return false };
    entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("libcore-"))
}

/// Whether `rustc --version` gives at least the version this workspace needs.
fn new_enough(version: &str) -> bool {
    let numbers = |text: &str| -> Option<(u32, u32)> {
        let mut parts = text.split('.').map(|part| part.parse().ok());
        Some((parts.next()??, parts.next()??))
    };
    let have = version.split_whitespace().nth(1).and_then(numbers);
    have >= numbers(env!("CARGO_PKG_RUST_VERSION")) && have.is_some()
}

#[derive(Debug, PartialEq, Eq)]
enum Plan {
    InUse,
    AddByRustup,
    Debian,
    InstallThenDebian,
    /// Nothing we may do: what to type.
    Ask(String),
}

fn plan(machine: Machine) -> Plan {
    let rustup = format!("rustup target add {TARGET}");
    match machine {
        Machine { target_installed: true, .. } => Plan::InUse,
        Machine { rustup: true, rustup_may_install: true, .. } => Plan::AddByRustup,
        Machine { debian: true, debian_ready: true, .. } => Plan::Debian,
        Machine { debian: true, root: true, .. } => Plan::InstallThenDebian,
        Machine { debian: true, .. } => Plan::Ask(format!(
            "sudo apt-get update && sudo apt-get install -y --no-install-recommends {PACKAGES}"
        )),
        Machine { rustup: true, .. } => Plan::Ask(rustup),
        _ => Plan::Ask(format!(
            "curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh && {rustup}"
        )),
    }
}

/// Finds or gets what builds for the target.
pub fn for_target() -> Result<Target> {
    let machine = Machine::look();
    match plan(machine) {
        Plan::InUse => Ok(Target::InUse),
        Plan::AddByRustup => {
            println!("\nThe toolchain in use has no {TARGET}; rustup gets it.");
            Step::new("target").run(run::command("rustup").args(["target", "add", TARGET]))?;
            Ok(Target::InUse)
        }
        Plan::Debian => {
            println!(
                "\nThe toolchain in use has no {TARGET} and rustup may not install it: Debian's \
                 compiler builds it."
            );
            Ok(Target::Debian)
        }
        Plan::InstallThenDebian => {
            println!(
                "\nThe toolchain in use has no {TARGET} and rustup may not install it: Debian's \
                 compiler will build it."
            );
            install(PACKAGES)?;
            if !Machine::look().debian_ready {
                bail!(
                    "Debian's compiler is older than {}, or incomplete. Type: rustup target add \
                     {TARGET}",
                    env!("CARGO_PKG_RUST_VERSION")
                );
            }
            Ok(Target::Debian)
        }
        Plan::Ask(command) => bail!("nothing here builds for {TARGET}. Type:\n    {command}"),
    }
}

/// Installs Debian packages, as root.
fn install(packages: &str) -> Result<()> {
    let apt = || {
        let mut command = run::command("apt-get");
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command
    };
    Step::new("package lists").run(apt().args(["update", "-q"]))?;
    Step::new("packages").run(
        apt()
            .args(["install", "-y", "-q", "--no-install-recommends"])
            .args(packages.split_whitespace()),
    )
}

/// Finds or gets `cargo fmt` and `cargo clippy` for the toolchain in use.
pub fn ensure_format_and_lints() -> Result<()> {
    let there = || {
        ["fmt", "clippy"].iter().all(|tool| {
            let output = run::cargo()().args([tool, "--version"]).output();
            output.is_ok_and(|output| output.status.success())
        })
    };
    if there() {
        return Ok(());
    }
    let machine = Machine::look();
    let rustup = "rustup component add rustfmt clippy";
    let packages = "rustfmt-web rust-web-clippy";
    println!("\nThe toolchain in use lacks cargo fmt or cargo clippy.");
    match machine {
        Machine { rustup: true, rustup_may_install: true, .. } => {
            let mut words = rustup.split_whitespace();
            let program = words.next().context("no program")?;
            Step::new("components").run(run::command(program).args(words))?;
        }
        Machine { rustup: false, debian: true, root: true, .. } => install(packages)?,
        Machine { rustup: false, debian: true, .. } => bail!(
            "cargo fmt or cargo clippy is missing. Type:\n    sudo apt-get update && sudo apt-get \
             install -y --no-install-recommends {packages}"
        ),
        _ => bail!("cargo fmt or cargo clippy is missing. Type:\n    {rustup}"),
    }
    if !there() {
        bail!("cargo fmt or cargo clippy is still missing");
    }
    Ok(())
}

/// Debian's packages for C code: the emulator of the virtual board.
const C_PACKAGES: &str = "cmake gcc libc6-dev make pkg-config";

/// Finds or gets what builds C code.
pub fn ensure_c_compiler() -> Result<()> {
    let there = || {
        ["cmake", "cc", "make", "pkg-config"].iter().all(|tool| run::succeeds(tool, &["--version"]))
    };
    if there() {
        return Ok(());
    }
    println!(
        "\nThe emulator of the virtual board is written in C; cmake or a compiler is missing."
    );
    match Machine::look() {
        Machine { debian: true, root: true, .. } => install(C_PACKAGES)?,
        Machine { debian: true, .. } => bail!(
            "cmake, make, pkg-config or a C compiler is missing. Type:\n    sudo apt-get update && \
             sudo apt-get install -y --no-install-recommends {C_PACKAGES}"
        ),
        _ => bail!("cmake, make, pkg-config or a C compiler (cc) is missing: install them"),
    }
    if !there() {
        bail!("cmake, make, pkg-config or a C compiler is still missing");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Machine = Machine {
        target_installed: false,
        rustup: false,
        rustup_may_install: false,
        debian: false,
        debian_ready: false,
        root: false,
    };

    #[test]
    fn an_installed_target_is_used_whatever_else_is_there() {
        let machine = Machine {
            target_installed: true,
            rustup: true,
            rustup_may_install: true,
            debian: true,
            debian_ready: true,
            root: true,
        };
        assert_eq!(plan(machine), Plan::InUse);
    }

    #[test]
    fn rustup_installs_only_where_it_may() {
        let may = Machine { rustup: true, rustup_may_install: true, ..NOTHING };
        assert_eq!(plan(may), Plan::AddByRustup);
        let may_not = Machine { rustup: true, ..NOTHING };
        assert_eq!(plan(may_not), Plan::Ask(format!("rustup target add {TARGET}")));
    }

    #[test]
    fn debian_installs_as_root_and_asks_for_sudo_otherwise() {
        let debian = Machine { rustup: true, debian: true, ..NOTHING };
        assert_eq!(plan(Machine { debian_ready: true, ..debian }), Plan::Debian);
        assert_eq!(plan(Machine { root: true, ..debian }), Plan::InstallThenDebian);
        let Plan::Ask(command) = plan(debian) else { panic!("neither root nor ready") };
        assert!(command.starts_with("sudo apt-get update && sudo apt-get install"));
        assert!(command.ends_with(PACKAGES));
    }

    #[test]
    fn a_bare_machine_is_told_where_rustup_is() {
        let Plan::Ask(command) = plan(NOTHING) else { panic!("there is nothing") };
        assert!(command.contains("sh.rustup.rs") && command.contains("rustup target add"));
    }

    #[test]
    fn versions_compare_by_number() {
        assert!(new_enough("rustc 1.95.0 (59807616e 2026-04-14)"));
        assert!(new_enough("rustc 1.100.0"));
        assert!(new_enough("rustc 2.0.0-nightly"));
        assert!(!new_enough("rustc 1.85.0 (built from a source tarball)"));
        assert!(!new_enough("rustc 1.9.0"));
        assert!(!new_enough(""));
    }
}

//! The drive of an earlier commit, which `hil-sim/before` depends on under another name.

use std::process::Command;

use crate::run;

/// The command that builds it and runs the battery with it. Cargo checks the commit out of this repository itself, without
/// a network: git is told that the address in `hil-sim/before/Cargo.toml` is here.
///
/// A worktree with a path to it would not do: it would be a second package `drive-core 0.1.0` without an address, and a
/// lock file cannot tell two of these apart.
pub fn command() -> Command {
    let mut command = run::cargo("run --release --quiet --manifest-path hil-sim/before/Cargo.toml");
    command
        .env("CARGO_NET_GIT_FETCH_WITH_CLI", "true")
        .env("GIT_CONFIG_COUNT", "1")
        .env("GIT_CONFIG_KEY_0", format!("url.file://{}.insteadOf", run::root().display()))
        .env("GIT_CONFIG_VALUE_0", env!("CARGO_PKG_REPOSITORY"));
    command
}

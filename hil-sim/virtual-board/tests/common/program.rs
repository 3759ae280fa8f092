//! The program of `cargo sim board`, and a folder for its output.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

/// Returns a session that writes to a folder.
pub fn command(out: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_board"));
    command.arg("--out").arg(out).args(arguments);
    command
}

/// The process of a board, which does not outlast a test that fails.
pub struct Running(pub Child);

impl Running {
    /// Ends the process, if it still runs.
    pub fn end(&mut self) -> io::Result<()> {
        self.0.kill()?;
        self.0.wait().map(drop)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

/// Returns a folder for a test.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

//! A pseudo-terminal: the serial port of the board for programs on this computer.

use std::collections::VecDeque;
use std::ffi::OsStr;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// Number of bytes that are kept for a slow reader; further bytes are lost, as on a port without a listener.
const KEPT: usize = 64 * 1024;

/// A pseudo-terminal.
pub struct Pty {
    ours: OwnedFd,
    /// Kept open, so that programs may come and go.
    _theirs: OwnedFd,
    /// The device file for programs.
    pub path: PathBuf,
    waiting: VecDeque<u8>,
}

impl Pty {
    /// Opens a new pseudo-terminal, which changes and echoes no bytes.
    ///
    /// # Errors
    /// The system has no free pseudo-terminal, or no /dev/pts.
    pub fn open() -> Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC);
        let ours = ours.context("cannot open a pseudo-terminal (/dev/ptmx)")?;
        grantpt(&ours).and_then(|()| unlockpt(&ours)).context("cannot unlock a pseudo-terminal")?;
        let name = ptsname(&ours, Vec::new()).context("a pseudo-terminal without a name")?;
        let path = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
        let cannot = || format!("cannot open the pseudo-terminal {}", path.display());
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let theirs = rustix::fs::open(&path, flags, Mode::empty()).with_context(cannot)?;
        let mut settings = tcgetattr(&theirs).with_context(cannot)?;
        settings.make_raw();
        tcsetattr(&theirs, OptionalActions::Now, &settings).with_context(cannot)?;
        let flags = fcntl_getfl(&ours).with_context(cannot)?;
        fcntl_setfl(&ours, flags | OFlags::NONBLOCK).with_context(cannot)?;
        Ok(Self { ours, _theirs: theirs, path, waiting: VecDeque::new() })
    }

    /// Returns the bytes written to it since the last call, at most a few thousand; never waits.
    ///
    /// # Errors
    /// An error of the system.
    pub fn read(&mut self) -> Result<Vec<u8>> {
        let mut buffer = vec![0; 4096];
        let read = match rustix::io::read(&self.ours, &mut buffer) {
            Err(Errno::AGAIN | Errno::INTR) => 0,
            other => other.context("reading from the pseudo-terminal")?,
        };
        buffer.truncate(read);
        Ok(buffer)
    }

    /// Sends bytes to the reader; never waits.
    ///
    /// # Errors
    /// An error of the system.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let room = KEPT - self.waiting.len();
        self.waiting.extend(&bytes[..bytes.len().min(room)]);
        while !self.waiting.is_empty() {
            match rustix::io::write(&self.ours, self.waiting.as_slices().0) {
                Ok(written) => drop(self.waiting.drain(..written)),
                Err(Errno::AGAIN | Errno::INTR) => break,
                Err(error) => return Err(error).context("writing to the pseudo-terminal"),
            }
        }
        Ok(())
    }
}

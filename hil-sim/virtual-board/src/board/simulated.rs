//! Simulated seconds of each test, in a file. A file is used because the output of a test may be captured, and because
//! sessions, which are separate processes, write to it too.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::thread::Builder;

use super::Board;
use crate::chip::TICKS_PER_S;

/// Environment variable with the name of the file. Each board appends a line `TEST SECONDS` when it is dropped; the
/// lines of a test add up.
pub const FILE: &str = "INDUCTION_DRIVE_SIMULATED";

/// Environment variable with the name of the test that started this process. If it is not set, the name of the thread is the test.
pub const TEST: &str = "INDUCTION_DRIVE_TEST";

/// Returns the test that runs in this thread, or that started this process.
pub fn test() -> String {
    let thread = || std::thread::current().name().unwrap_or("unnamed").to_owned();
    std::env::var(TEST).unwrap_or_else(|_| thread())
}

/// Returns a builder of threads that work for the present test.
pub fn worker() -> Builder {
    Builder::new().name(test())
}

impl Drop for Board {
    fn drop(&mut self) {
        let Some(file) = std::env::var_os(FILE) else { return };
        let seconds = (self.gone_back + self.cpu.chip().now) as f64 / TICKS_PER_S as f64;
        // A single write, so that lines of several processes do not mix. A lost count does not make a test fail.
        let line = format!("{} {seconds:.3}\n", test());
        if let Ok(mut file) = OpenOptions::new().create(true).append(true).open(file) {
            file.write_all(line.as_bytes()).ok();
        }
    }
}

//! The repository around the program.

use std::path::{Path, PathBuf};

/// Returns the repository around this program, or otherwise around the current folder; `None` if there is none. A shipped program
/// contains no path of the machine that built it.
pub fn root() -> Option<PathBuf> {
    let places = [std::env::current_exe(), std::env::current_dir()];
    let mut folders = places.iter().flatten().flat_map(|place| place.ancestors());
    folders.find(|folder| folder.join("hil-sim/virtual-board").is_dir()).map(Path::to_owned)
}

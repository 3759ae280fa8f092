//! Results for people: tables on the console, one page with plots, CSV, and files written whole.
#![deny(clippy::use_debug)]

mod console;
mod csv;
mod envelope;
mod page;
mod plot;
mod prose;

use std::io::Write as _;

use std::path::{Path, PathBuf};

use sim_bench::outcome::Origin;
use sim_bench::prelude::*;

pub use console::{paragraph, table, text};
pub use csv::csv;
pub use page::{Section, page};
pub use plot::svg;

/// Writes a file completely or not at all: into a temporary file beside it, which is then renamed.
/// Missing folders are created.
///
/// # Errors
/// [`Error::Write`] with the path that could not be written.
pub fn write_whole(path: &Path, contents: impl AsRef<[u8]>) -> Result<(), Error> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = folder.join(format!(".{name}.{}.part", std::process::id()));
    let written = std::fs::File::create(&beside)
        .and_then(|mut file| file.write_all(contents.as_ref()).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|e| {
        // The unfinished file is removed; it need not exist.
        let _ = std::fs::remove_file(&beside);
        Error::write(path)(e)
    })
}

/// Writes the page of an experiment, and its plots beside it; returns the path of the page.
///
/// # Errors
/// As [`page()`] and [`write_whole`].
pub fn write(folder: &Path, origin: &Origin, section: Section<'_>) -> Result<PathBuf, Error> {
    let (name, figures) = (section.name, &section.outcome.figures);
    let path = folder.join(format!("{name}.html"));
    write_whole(&path, &page("Induction drive", origin, &[section])?)?;
    for figure in figures {
        write_whole(&folder.join(format!("{name}-{}.svg", figure.name)), &svg(figure)?)?;
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
        let folder = std::env::temp_dir().join(format!("hil-sim-{}", std::process::id()));
        let path = folder.join("new/page.html");
        write_whole(&path, "first").unwrap();
        write_whole(&path, "second").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "second");
        // A folder is in the way: the error names it, and no part stays.
        let blocked = folder.join("new/blocked.html");
        std::fs::create_dir_all(blocked.join("inside")).unwrap();
        let error = write_whole(&blocked, "third").unwrap_err();
        assert!(error.to_string().contains("blocked.html") && error.exit_code() == 1, "{error}");
        let entries = std::fs::read_dir(folder.join("new")).unwrap();
        let names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(names.len(), 2, "{names:?}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}

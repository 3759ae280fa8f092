//! Generated blocks of the pages in `docs/`, for the tests of all crates.
//!
//! A block stands between `<!-- generated: NAME (COMMAND) -->` and `<!-- end -->`. A test that renders it fails if the page has another
//! text; with the environment variable `WRITE_DOCS` the same test writes it.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::{env, fs};

/// Serialises the writes: two tests may write the same page.
static WRITES: Mutex<()> = Mutex::new(());

/// The folder of the repository.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = here.ancestors().find(|folder| folder.join("docs/SUMMARY.md").is_file());
    root.expect("a folder with the book").to_owned()
}

/// Compares the block of a page with its required text, or writes it.
pub fn check(page: &str, name: &str, block: &str) {
    let _one = WRITES.lock();
    let path = root().join("docs").join(page);
    let text = fs::read_to_string(&path).expect("the page");
    let begin = format!("<!-- generated: {name} (");
    let (before, after) =
        text.split_once(&begin).unwrap_or_else(|| panic!("docs/{page}: no {begin}"));
    let (command, after) = after.split_once(") -->").expect("the end of the marker");
    let (found, after) = after.split_once("<!-- end -->").expect("the end of the block");
    if found.trim() == block.trim() {
        return;
    }
    let same = "`WRITE_DOCS=1` before the command writes it";
    assert!(
        env::var_os("WRITE_DOCS").is_some(),
        "docs/{page}, {name}: {command}; {same}:\n{block}"
    );
    let block = block.trim();
    let text = format!("{before}{begin}{command}) -->\n\n{block}\n\n<!-- end -->{after}");
    fs::write(&path, text).expect("the page is written");
}

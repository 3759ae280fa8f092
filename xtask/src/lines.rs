//! `cargo xtask lines`: lines of code per package, and their limits.
//!
//! Blank lines count nowhere outside tests. Documentation is `///` and `//!`, a comment any other line
//! that begins with `//`; everything else is code. Test lines are files below `tests/` and `benches/`,
//! files named `tests.rs`, and items under `#[cfg(test)]` in column 0 that have a body in the same file.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

use anyhow::Result;

use crate::{run, sources};

/// Most lines of code without tests, in the whole repository.
const LIMIT: usize = 52_600;
/// Most lines of code without tests in the control code: `drive-core` with all below it.
const CONTROL_LIMIT: usize = 12_100;
/// A longer file gives its reason in its head. A person reads the reason.
const FILE_LINES: usize = 400;

/// Rows of the table, and what the paths of their files begin with. The first that fits counts.
const ROWS: [(&str, &str); 10] = [
    ("drive-design", "drive-core/design"),
    ("drive-core", "drive-core"),
    ("firmware", "src"),
    ("firmware", "build.rs"),
    ("virtual-board", "hil-sim/virtual-board"),
    ("hil-sim", "hil-sim"),
    ("live", "live"),
    ("stream", "stream"),
    ("xtask", "xtask"),
    ("root tests, benches, fuzz", ""),
];

/// Lines of code, documentation, comments, test code, and all else in tests.
type Counts = [usize; 5];

/// Prints the table; fails above the limits.
pub fn report() -> Result<()> {
    let mut rows: BTreeMap<&str, Counts> = BTreeMap::new();
    let mut long = Vec::new();
    for path in sources::rust_files()? {
        let text = sources::read(&path)?;
        let row = ROWS.iter().find(|(_, begin)| path.starts_with(begin)).unwrap_or(&ROWS[9]);
        add(rows.entry(row.0).or_default(), count(&path, &text));
        if text.lines().count() > FILE_LINES {
            long.push(format!("{:>6}  {}", text.lines().count(), path.display()));
        }
    }
    let mut all = Counts::default();
    rows.values().for_each(|counts| add(&mut all, *counts));
    let control = ["drive-core", "drive-design"].iter().filter_map(|name| rows.get(name));
    let control: usize = control.map(|counts| counts[0]).sum();

    println!("{}", row("lines", ["code", "docs", "comments", "test code", "test other"]));
    rows.iter().chain([(&"all", &all)]).for_each(|(name, n)| println!("{}", row(name, *n)));
    println!("\nfiles over {FILE_LINES} lines:\n{}\n", long.join("\n"));
    run::limit("control code", control, CONTROL_LIMIT, "lines")?;
    run::limit("code without tests", all[0], LIMIT, "lines")
}

fn row<T: Display>(name: &str, cells: [T; 5]) -> String {
    format!("{name:<26}{}", cells.map(|cell| format!("{cell:>12}")).concat())
}

fn add(sum: &mut Counts, counts: Counts) {
    sum.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
}

fn count(path: &Path, text: &str) -> Counts {
    let is_test_file = path.file_name().is_some_and(|name| name == "tests.rs")
        || path.iter().any(|part| part == "tests" || part == "benches");
    let mut in_test_item = false;
    let mut counts = Counts::default();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" {
            in_test_item = lines.peek().is_some_and(|next| !next.ends_with(';'));
        }
        let in_test = is_test_file || in_test_item;
        let kind = match line.trim_start() {
            "" if !in_test => continue,
            "" => 4,
            doc if doc.starts_with("///") || doc.starts_with("//!") => 1,
            comment if comment.starts_with("//") => 2,
            _ => 0,
        };
        counts[if in_test { (kind + 3).min(4) } else { kind }] += 1;
        in_test_item &= line != "}";
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_told_apart() {
        let text = "//! Head.\n\n// Comment.\n#[cfg(test)]\nmod tests;\n/// Doc.\nfn f() {\n    1 // one\n}\n";
        assert_eq!(count(Path::new("src/a.rs"), text), [5, 2, 1, 0, 0]);
        assert_eq!(count(Path::new("src/a/tests.rs"), text), [0, 0, 0, 5, 4]);
        assert_eq!(count(Path::new("tests/a.rs"), text), [0, 0, 0, 5, 4]);
    }

    #[test]
    fn code_behind_a_test_item_counts_as_code() {
        let text =
            "#[cfg(test)]\nmod tests {\n    // Comment.\n\n    fn f() {\n    }\n}\n\nfn g() {}\n";
        assert_eq!(count(Path::new("src/a.rs"), text), [1, 0, 0, 5, 2]);
    }
}

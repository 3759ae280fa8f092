//! `cargo xtask lines`: lines of code by room, and their budgets.
//!
//! Blank lines count nowhere outside tests. Documentation is `///` and `//!`, a comment any other line
//! that begins with `//`; everything else is code. Test lines are files below `tests/` and `benches/`,
//! files named `tests.rs`, and items under `#[cfg(test)]` in column 0 that have a body in the same file.

use std::fmt::Display;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::budget::{self, Room};
use crate::sources;

/// Lines of code, documentation, comments, test code, and all else in tests.
type Counts = [usize; 5];

/// Prints the table; fails above a budget.
pub fn report() -> Result<()> {
    let rooms = budget::read()?.lines;
    let mut rows = vec![Counts::default(); rooms.len()];
    for path in sources::rust_files()? {
        let text = sources::read(&path)?;
        let room = room_of(&rooms, &path).with_context(|| path.display().to_string())?;
        add(&mut rows[room], count(&path, &text));
    }
    let mut all = Counts::default();
    rows.iter().for_each(|counts| add(&mut all, *counts));
    let whole: usize = rooms.iter().map(|room| room.budget).sum();

    let heads = ["budget", "code", "docs", "comments", "test code", "test other"];
    println!("{}", row("lines", heads));
    let named = rooms.iter().map(|room| (room.name.as_str(), room.budget)).zip(rows);
    let mut over = Vec::new();
    for ((name, budget), [code, docs, comments, tests, other]) in
        named.chain([(("all", whole), all)])
    {
        println!("{}", row(name, [budget, code, docs, comments, tests, other]));
        if code > budget {
            over.push(format!("{name} {code} of {budget}"));
        }
    }
    println!();
    ensure!(over.is_empty(), "more lines of code than the budget: {}", over.join(", "));
    Ok(())
}

/// The first room with a path that this one begins with.
fn room_of(rooms: &[Room], path: &Path) -> Option<usize> {
    let path = path.to_string_lossy();
    rooms.iter().position(|room| room.paths.iter().any(|begin| path.starts_with(begin)))
}

fn row<T: Display>(name: &str, cells: [T; 6]) -> String {
    format!("{name:<20}{}", cells.map(|cell| format!("{cell:>12}")).concat())
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
    fn the_first_room_that_fits_takes_a_file() {
        let room = |paths: &[&str]| Room {
            name: String::new(),
            budget: 0,
            paths: paths.iter().map(|path| (*path).to_owned()).collect(),
        };
        let rooms = [room(&["a/b/", "a/c."]), room(&["a/"])];
        let of = |path: &str| room_of(&rooms, Path::new(path));
        assert_eq!(of("a/b/x.rs"), Some(0));
        assert_eq!(of("a/c.rs"), Some(0));
        assert_eq!(of("a/cd.rs"), Some(1));
        assert_eq!(of("x.rs"), None);
    }

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

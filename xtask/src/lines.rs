//! `cargo xtask lines`: lines of code by room, and their budgets.
//!
//! Blank lines count nowhere outside tests. Documentation is `///` and `//!`, a comment any other line
//! that begins with `//`; everything else is code. Test lines are files below `tests/` and `benches/`,
//! files named `tests.rs`, and items under `#[cfg(test)]` in column 0 that have a body in the same file.
//! Beside Rust: JavaScript, Python and tables in TOML, without blank lines and comments, manifests and code of others.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::budget::{self, Room};
use crate::sources;

/// Lines of Rust (code, documentation, comments, test code, all else in tests), and of each of [`OTHERS`].
type Counts = [usize; 8];

/// Other languages: ending of the files, and how a comment begins.
const OTHERS: [(&str, &str); 3] = [("js", "//"), ("py", "#"), ("toml", "#")];

/// Prints the table; fails above a budget.
pub fn report() -> Result<()> {
    let rooms = budget::read()?.lines;
    let mut rows = vec![Counts::default(); rooms.len()];
    let ours = |path: &&PathBuf| {
        !path.ends_with("Cargo.toml") && !path.to_string_lossy().ends_with(".min.js")
    };
    for ending in OTHERS.map(|(ending, _)| ending).into_iter().chain(["rs"]) {
        for path in sources::files(ending)?.iter().filter(ours) {
            let room = room_of(&rooms, path).with_context(|| path.display().to_string())?;
            add(&mut rows[room], count(path, &sources::read(path)?));
        }
    }
    let mut all = Counts::default();
    rows.iter().for_each(|counts| add(&mut all, *counts));
    let whole: usize = rooms.iter().map(|room| room.budget).sum();

    let heads =
        ["budget", "code", "docs", "comments", "test code", "test other", "JS", "Python", "TOML"];
    println!("{}", row("lines", heads));
    let named = rooms.iter().map(|room| (room.name.as_str(), room.budget)).zip(rows);
    let mut over = Vec::new();
    for ((name, budget), counts) in named.chain([(("all", whole), all)]) {
        let [code, docs, comments, tests, other, js, python, toml] = counts;
        println!("{}", row(name, [budget, code, docs, comments, tests, other, js, python, toml]));
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

fn row<T: Display>(name: &str, cells: [T; 9]) -> String {
    format!("{name:<20}{}", cells.map(|cell| format!("{cell:>11}")).concat())
}

fn add(sum: &mut Counts, counts: Counts) {
    sum.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
}

fn count(path: &Path, text: &str) -> Counts {
    let mut counts = Counts::default();
    let is_it = |(ending, _): &(&str, &str)| path.extension().is_some_and(|found| found == *ending);
    if let Some(language) = OTHERS.iter().position(is_it) {
        let comment = OTHERS[language].1;
        let lines = text.lines().map(str::trim_start);
        counts[5 + language] =
            lines.filter(|line| !line.is_empty() && !line.starts_with(comment)).count();
        return counts;
    }
    let is_test_file = path.file_name().is_some_and(|name| name == "tests.rs")
        || path.iter().any(|part| part == "tests" || part == "benches");
    let mut in_test_item = false;
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
        assert_eq!(count(Path::new("src/a.rs"), text), [5, 2, 1, 0, 0, 0, 0, 0]);
        assert_eq!(count(Path::new("src/a/tests.rs"), text), [0, 0, 0, 5, 4, 0, 0, 0]);
        assert_eq!(count(Path::new("tests/a.rs"), text), [0, 0, 0, 5, 4, 0, 0, 0]);
    }

    #[test]
    fn blank_lines_and_comments_of_other_languages_do_not_count() {
        let text = "# One\n\n[motor]\nr_s = 5.4 # ohm\n";
        assert_eq!(count(Path::new("motors/a.toml"), text), [0, 0, 0, 0, 0, 0, 0, 2]);
        assert_eq!(count(Path::new("a.js"), "// One\nf();\n"), [0, 0, 0, 0, 0, 1, 0, 0]);
    }

    #[test]
    fn code_behind_a_test_item_counts_as_code() {
        let text =
            "#[cfg(test)]\nmod tests {\n    // Comment.\n\n    fn f() {\n    }\n}\n\nfn g() {}\n";
        assert_eq!(count(Path::new("src/a.rs"), text), [1, 0, 0, 5, 2, 0, 0, 0]);
    }
}

//! `cargo xtask lines`: lines of code by part of the sources, and the budgets of the whole.
//!
//! Blank lines count nowhere outside tests. Documentation is `///`, `//!` and `#[doc(...)]`, a comment any other line
//! that begins with `//`; everything else is code. Test lines are files below `tests/` and `benches/`,
//! files named `tests.rs`, and items under `#[cfg(test)]` in column 0 that have a body in the same file.
//! Other languages are JavaScript, Python and tables in TOML, without blank lines and comments, manifests and third-party code.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::budget::{self, Part};
use crate::{run, sources};

/// Lines of Rust (code, documentation, comments, test code, all else in tests), and of each of [`OTHERS`].
type Counts = [usize; 8];

/// Other languages: extension of the files, and the beginning of a comment.
const OTHERS: [(&str, &str); 3] = [("js", "//"), ("py", "#"), ("toml", "#")];

/// Prints the table; fails above a budget.
pub fn report() -> Result<()> {
    let budget::Budgets { lines: budget, part: parts, .. } = budget::read()?;
    let mut rows = vec![Counts::default(); parts.len()];
    let ours = |path: &&PathBuf| {
        !path.ends_with("Cargo.toml") && !path.to_string_lossy().ends_with(".min.js")
    };
    for ending in OTHERS.map(|(ending, _)| ending).into_iter().chain(["rs"]) {
        for path in sources::files(ending)?.iter().filter(ours) {
            let part = part_of(&parts, path).with_context(|| path.display().to_string())?;
            add(&mut rows[part], count(path, &sources::read(path)?));
        }
    }
    for (part, counts) in parts.iter().zip(&rows) {
        if let Some(limit) = part.code {
            run::limit(&format!("lines of the {}", part.name), counts[0], limit, "lines")?;
        }
    }
    let mut all = Counts::default();
    rows.iter().for_each(|counts| add(&mut all, *counts));

    let heads = ["code", "docs", "comments", "test code", "test other", "JS", "Python", "TOML"];
    println!("{}", row("lines", heads));
    let named = parts.iter().map(|part| part.name.as_str()).zip(rows);
    named.chain([("all", all)]).for_each(|(name, counts)| println!("{}", row(name, counts)));
    println!();
    run::limit("lines of code", all[0], budget.code, "lines")?;
    run::limit("lines of tests", all[3], budget.test_code, "lines")
}

/// The first part with a path that is a beginning of this one.
fn part_of(parts: &[Part], path: &Path) -> Option<usize> {
    let path = path.to_string_lossy();
    parts.iter().position(|part| part.paths.iter().any(|begin| path.starts_with(begin)))
}

fn row<T: Display>(name: &str, cells: [T; 8]) -> String {
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
            doc if ["///", "//!", "#[doc("].iter().any(|begin| doc.starts_with(begin)) => 1,
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
    fn the_first_part_that_fits_takes_a_file() {
        let part = |paths: &[&str]| Part {
            name: String::new(),
            paths: paths.iter().map(|path| (*path).to_owned()).collect(),
            code: None,
        };
        let parts = [part(&["a/b/", "a/c."]), part(&["a/"])];
        let of = |path: &str| part_of(&parts, Path::new(path));
        assert_eq!(of("a/b/x.rs"), Some(0));
        assert_eq!(of("a/c.rs"), Some(0));
        assert_eq!(of("a/cd.rs"), Some(1));
        assert_eq!(of("x.rs"), None);
    }

    #[test]
    fn lines_are_told_apart() {
        let text = "//! Head.\n\n// Comment.\n#[cfg(test)]\nmod tests;\n/// Doc.\n#[doc(hidden)]\nfn f() {\n    1 // one\n}\n";
        assert_eq!(count(Path::new("src/a.rs"), text), [5, 3, 1, 0, 0, 0, 0, 0]);
        assert_eq!(count(Path::new("src/a/tests.rs"), text), [0, 0, 0, 5, 5, 0, 0, 0]);
        assert_eq!(count(Path::new("tests/a.rs"), text), [0, 0, 0, 5, 5, 0, 0, 0]);
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

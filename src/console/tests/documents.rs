//! The console lines of the pages.

use std::fs;

use super::grammar::{HELP, parse};
use crate::generated;

/// A typed line follows `> ` in a block `console`.
#[test]
fn every_line_of_the_pages_is_understood() {
    let docs = generated::root().join("docs");
    let mut understood = 0;
    for page in fs::read_dir(docs).unwrap().map(|page| page.unwrap().path()) {
        if page.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let text = fs::read_to_string(&page).unwrap();
        let blocks = text.split("```console").skip(1).filter_map(|rest| rest.split("```").next());
        for line in blocks.flat_map(str::lines).filter_map(|line| line.trim().strip_prefix("> ")) {
            assert!(parse(line).is_ok(), "{}: {line}", page.display());
            understood += 1;
        }
    }
    assert!(understood > 20, "{understood} lines");
}

#[test]
fn the_manual_lists_the_commands() {
    let mut table = "| command | effect |\n|---|---|\n".to_owned();
    for (usage, meaning) in HELP {
        table += &format!("| `{}` | {meaning} |\n", usage.trim_end().replace('|', "\\|"));
    }
    generated::check("console.md", "commands", &table);
}

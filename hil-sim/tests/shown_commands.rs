//! Every command that a document shows either runs, or is in `shown_commands.txt` with the reason why it does not.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::cli_common::{folder, hil_sim, text};

/// Documents whose Rust code is compiled and run: doctests of the control crates and `motor-plant`, a test of `hil-sim`.
const RUST: [&str; 4] = [
    "drive-core/README.md",
    "drive-core/settings/README.md",
    "hil-sim/plant/README.md",
    "docs/developing.md",
];

/// Collects the documents about the present state; the change log describes the past.
fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy();
        if path.is_dir() && !name.starts_with('.') && !["target", "out"].contains(&&*name) {
            documents(&path, found);
        } else if name.ends_with(".md") && name != "CHANGELOG.md" {
            found.push(path);
        }
    }
}

#[test]
#[ignore = "minutes; cargo xtask test runs it"]
fn commands_of_the_documents_run() {
    let mut found = Vec::new();
    documents(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."), &mut found);
    let mut commands: BTreeMap<String, PathBuf> = BTreeMap::new();
    let mut wrong = Vec::new();
    for path in found {
        let text = std::fs::read_to_string(&path).unwrap();
        if text.contains("```rust") && !RUST.iter().any(|known| path.ends_with(known)) {
            wrong.push(format!("{}: nothing compiles its Rust", path.display()));
        }
        for command in commands_of(&text) {
            commands.entry(command).or_insert_with(|| path.clone());
        }
    }
    let folder = folder("documents");
    let mut ran = 0;
    for (command, document) in &commands {
        let document = document.display();
        if elsewhere(command).is_some() {
            continue;
        }
        if let Some(arguments) = command.strip_prefix("cargo sim") {
            let arguments: Vec<_> = arguments.split_whitespace().map(of_repository).collect();
            let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
            let output = hil_sim(&folder, &arguments);
            if !output.status.success() {
                wrong.push(format!("{document}: `{command}` fails: {}", text(&output.stderr)));
            }
            ran += 1;
        } else {
            wrong.push(format!("{document}: `{command}` neither runs here nor stands in a list"));
        }
    }
    assert!(wrong.is_empty() && ran > 20, "{ran} ran\n{}", wrong.join("\n"));
}

/// Returns a word of a command; a file of the repository with a path that holds in any folder.
fn of_repository(word: &str) -> String {
    match Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(word) {
        path if word.contains('/') && path.is_file() => path.display().to_string(),
        _ => word.to_owned(),
    }
}

/// Returns the beginning of the command in the list of those that are not run, and the reason.
fn elsewhere(command: &str) -> Option<(&'static str, &'static str)> {
    let fits = |begin: &str| {
        command
            .strip_prefix(begin)
            .is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
    };
    let lines = include_str!("shown_commands.txt").lines().filter(|line| !line.starts_with('#'));
    let known = lines.filter_map(|line| line.split_once(" => "));
    known.filter(|(begin, _)| fits(begin)).max_by_key(|(begin, _)| begin.len())
}

/// Returns the commands of a document: lines of code blocks and inline code that begin with `cargo`.
fn commands_of(text: &str) -> Vec<String> {
    let mut commands = Vec::new();
    let mut in_block = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
        } else if in_block {
            let line = line.trim().trim_start_matches("$ ");
            commands.push(line.split(" #").next().unwrap_or_default().trim().to_owned());
        } else {
            commands.extend(line.split('`').skip(1).step_by(2).map(|code| code.trim().to_owned()));
        }
    }
    commands.retain(|command| command.starts_with("cargo "));
    commands
}

/// A block `text` whose first line is `$ cargo sim` with its arguments shows what this command prints; a line `...` stands for lines left out. The
/// commands of a page run in one folder, which has the motor of the nameplate on that page.
#[test]
fn shown_output_is_what_the_command_prints() {
    let mut pages = Vec::new();
    documents(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."), &mut pages);
    let mut shown = 0;
    for page in pages {
        let document = std::fs::read_to_string(&page).unwrap();
        let folder = folder("shown-output");
        if let Some(plate) = document.split("--plate \"").nth(1).and_then(|s| s.split('"').next()) {
            let made = hil_sim(&folder, &["motors", "--plate", plate]);
            std::fs::write(folder.join("my-motor.toml"), made.stdout).unwrap();
        }
        for block in document.split("```text\n$ cargo sim").skip(1) {
            let (command, rest) = block.split_once('\n').unwrap();
            let (words, quoted) = command.split_once(" \"").unwrap_or((command, ""));
            let quoted = quoted.strip_suffix('"');
            let words = words.split_whitespace().map(of_repository);
            let words: Vec<_> = words.chain(quoted.map(str::to_owned)).collect();
            let output = hil_sim(&folder, &words.iter().map(String::as_str).collect::<Vec<_>>());
            let printed = format!("{}{}", text(&output.stdout), text(&output.stderr));
            let mut lines = printed.lines().map(str::trim_end);
            let mut skips = false;
            for line in rest.split("```").next().unwrap().lines() {
                let found = match skips {
                    _ if line == "..." => true,
                    true => lines.any(|one| one == line),
                    false => lines.next() == Some(line),
                };
                assert!(found, "{}: {command}: {line}", page.display());
                skips = line == "...";
            }
            shown += 1;
        }
    }
    assert!(shown > 12, "{shown}");
}

/// A block `text` without a command shows what a drive says: each line stands in a session, which is played, or in the code of the chip.
#[test]
fn shown_answers_are_those_of_the_sessions() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let files = ["tests/sessions", "tests/sessions/board", "src/chip"].map(|one| root.join(one));
    let files = files.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let files = files.map(|file| file.unwrap().path()).filter(|path| path.is_file());
    let said: String = files.map(|path| std::fs::read_to_string(path).unwrap()).collect();
    let mut pages = Vec::new();
    documents(&root.join("docs"), &mut pages);
    let mut lines = 0;
    for page in pages {
        let document = std::fs::read_to_string(&page).unwrap();
        let blocks = document.split("```text\n").skip(1).filter(|block| !block.starts_with('$'));
        for line in blocks.flat_map(|block| block.split("```").next().unwrap().lines()) {
            assert!(line == "..." || said.contains(line), "{}: {line}", page.display());
            lines += 1;
        }
    }
    assert!(lines > 5, "{lines}");
}

#[test]
fn commands_are_found_in_blocks_and_in_lines() {
    let text = "Type `cargo sim list` or:\n\n```\n$ cargo sim   # the drive\nokay\n```\nand `cargo sim` too.\n";
    assert_eq!(commands_of(text), ["cargo sim list", "cargo sim", "cargo sim"]);
    assert_eq!(elsewhere("cargo xtask flash").unwrap().1, "needs a board");
    assert_eq!(elsewhere("cargo sim boards"), None);
}

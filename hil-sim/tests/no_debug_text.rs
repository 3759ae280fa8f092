//! No Debug text reaches a user. Clippy's `use_debug` checks `print!` and `write!`, but not `format!`.

use std::path::{Path, PathBuf};

fn sources(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let entries = std::fs::read_dir(path).expect("a folder of sources");
    entries.flat_map(|entry| sources(&entry.expect("an entry").path())).collect()
}

#[test]
fn texts_for_people_are_made_without_debug_formatting() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let parts = [
        "bench/src",
        "lab/src",
        "src/cli.rs",
        "src/cli",
        "src/experiments.rs",
        "src/experiments",
        "src/input.rs",
        "src/report",
    ];
    let files: Vec<_> = parts.iter().flat_map(|part| sources(&root.join(part))).collect();
    assert!(files.len() > 50, "{}", files.len());
    for file in files {
        let source = std::fs::read_to_string(&file).expect("a source");
        // Messages of assertions are for developers, also those outside of unit tests.
        let shipped = source.split("#[cfg(test)]").next().unwrap_or_default();
        for line in shipped.lines().filter(|line| !line.contains("assert")) {
            assert!(!line.contains(":?}") && !line.contains(":#?}"), "{}: {line}", file.display());
        }
    }
}

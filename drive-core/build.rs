//! Takes the causes and the cure of every fault from the documentation page of the faults, so that the console says the same as the
//! page.

use std::path::Path;
use std::{env, fs};

/// Places of the page of the faults: in the repository, and in a package of this crate, where the link `faults.txt` becomes the page
/// itself. The repository's own page comes first, because a clone may hold a text file in place of the link.
const PAGES: [&str; 2] = ["../docs/faults.md", "faults.txt"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    let path = PAGES.into_iter().find(|path| Path::new(path).is_file());
    let path = path.ok_or("the page of the faults is missing: docs/faults.md")?;
    println!("cargo::rerun-if-changed={path}");
    // The console prints the names of settings without the backquotes of the page.
    let page = fs::read_to_string(path)?.replace('`', "");
    let mut arms = String::new();
    for section in page.split("\n## ") {
        let cure = section.lines().find_map(|line| line.strip_prefix("Cure: ")?.strip_suffix('.'));
        let Some(cure) = cure else { continue };
        let causes: Vec<&str> =
            section.lines().filter_map(|line| line.strip_prefix("* ")).collect();
        let heading = section.lines().next().unwrap_or_default();
        let codes =
            codes(heading).ok_or_else(|| format!("{path}: no fault numbers in: {heading}"))?;
        arms += &format!("{} => (&{causes:?}, {cure:?}),\n", codes);
    }
    if arms.is_empty() {
        return Err(format!("{path} describes no fault: it holds {page:?}").into());
    }
    let out = Path::new(&env::var("OUT_DIR")?).join("remedies.rs");
    Ok(fs::write(out, format!("match code {{\n{arms}_ => (&[], \"\"),\n}}\n"))?)
}

/// The pattern of the faults in a heading: `Fault 4: ...`, `Faults 1 to 3: ...`, `Faults 7, 8 and 38: ...`.
fn codes(heading: &str) -> Option<String> {
    let (_, list) = heading.split_once(':')?.0.split_once(' ')?;
    let Some((first, last)) = list.split_once(" to ") else {
        return Some(list.replace(" and ", "|").replace(", ", "|"));
    };
    let all = first.parse::<u8>().ok()?..=last.parse().ok()?;
    Some(all.map(|code| code.to_string()).collect::<Vec<_>>().join("|"))
}

//! Takes causes and cure of every fault from the page of the faults, so that console and page say the same.

use std::path::Path;
use std::{env, fs};

/// A link to `docs/faults.md`: a package of this crate holds the page, too.
const PAGE: &str = "faults.txt";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={PAGE}");
    // The console prints the names of settings without the marks of the page.
    let page = fs::read_to_string(PAGE)?.replace('`', "");
    let mut arms = String::new();
    for section in page.split("\n## ") {
        let cure = section.lines().find_map(|line| line.strip_prefix("Cure: ")?.strip_suffix('.'));
        let Some(cure) = cure else { continue };
        let causes: Vec<&str> =
            section.lines().filter_map(|line| line.strip_prefix("* ")).collect();
        let link = format!("(#{})", anchor(section.lines().next().unwrap_or_default()));
        let rows = page.lines().filter(|line| line.contains(&link));
        let codes: Vec<&str> = rows.filter_map(|row| row.split('|').nth(1)).collect();
        arms += &format!("{} => (&{causes:?}, {cure:?}),\n", codes.join("|"));
    }
    let out = Path::new(&env::var("OUT_DIR")?).join("remedies.rs");
    Ok(fs::write(out, format!("match code {{\n{arms}_ => (&[], \"\"),\n}}\n"))?)
}

/// The anchor of a heading, as links within the page name it.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_ascii_alphanumeric() || " -".contains(*c));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

use super::*;
use crate::generated;

/// The codes are those of `codes.txt`.
#[test]
fn codes_never_change() {
    let listed = include_str!("codes.txt").lines().filter(|line| !line.starts_with('#'));
    let declared = Fault::ALL.iter().map(|fault| format!("{} {fault:?}", fault.code()));
    assert_eq!(listed.collect::<Vec<_>>(), declared.collect::<Vec<_>>());
}

/// Texts are plain ASCII, and short enough for a line of the console together with the state of the drive.
#[test]
fn texts_fit_a_line_of_the_console() {
    for fault in Fault::ALL {
        for text in fault.causes().iter().chain([&fault.text(), &fault.cure()]) {
            assert!(text.is_ascii() && text.len() <= 110, "{text}");
            assert!(!text.ends_with('.') && !text.contains(['"', '\\']), "{text}");
        }
        assert!(fault.text().len() <= 80, "{fault}");
    }
}

/// The page of the faults lists each fault with its text and a link to its section, which gives at least one cause, and the cure.
#[test]
fn the_manual_says_the_same() {
    let manual = std::fs::read_to_string(generated::root().join("docs/faults.md")).unwrap();
    let sections: Vec<_> =
        manual.lines().filter_map(|line| line.strip_prefix("## Fault")).collect();
    let mut table = "| | meaning | cause and cure |\n|---|---|---|\n".to_owned();
    for fault in Fault::ALL {
        let section = sections.iter().find(|heading| numbers(heading).contains(&fault.code()));
        let section = section.unwrap_or_else(|| panic!("no section for {}", fault.code()));
        let anchor: String =
            section.chars().filter(|c| c.is_ascii_alphanumeric() || " -".contains(*c)).collect();
        let anchor = anchor.to_lowercase().replace(' ', "-");
        table += &format!("| {} | {fault} | [cure](#fault{anchor}) |\n", fault.code());
        assert!(!fault.causes().is_empty() && !fault.cure().is_empty(), "{fault}");
    }
    generated::check("faults.md", "faults", &table);
}

/// Returns the faults of a heading: " 4: ...", "s 1 to 3: ...", "s 7, 8 and 38: ...".
fn numbers(heading: &str) -> Vec<u8> {
    let (list, _) = heading.split_once(':').expect("numbers");
    let found: Vec<u8> = list.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    if list.contains(" to ") { (found[0]..=found[1]).collect() } else { found }
}

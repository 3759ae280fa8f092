//! Checks that each input-section pattern of `memory.x` matches something in the link. A pattern that matches nothing hides a renamed
//! module, whose code then stays in the slower flash.
//!
//! A pattern that may match nothing is marked by `/* optional: REASON */` on its line.

use anyhow::{Context, Result, ensure};
use glob::Pattern;

use crate::map::{self, Level};

/// The mark of an optional pattern, before its reason.
const OPTIONAL: &str = "/* optional: ";

/// Fails if a pattern matches no section that earlier ones have left; `map` is the map of lld.
pub fn check(memory_x: &str, map: &str) -> Result<()> {
    let empty = empty_patterns(memory_x, map)?;
    ensure!(
        empty.is_empty(),
        "patterns of memory.x that match nothing, or nothing that an earlier one leaves:\n    {}\n\
         Delete them, or mark them on their lines: {OPTIONAL}REASON */",
        empty.join("\n    ")
    );
    Ok(())
}

fn empty_patterns<'a>(memory_x: &'a str, map: &str) -> Result<Vec<&'a str>> {
    let entries = map::entries(map, Level::Input);
    let inputs = entries.iter().filter_map(|e| e.name.strip_suffix(')')?.rsplit_once(":("));
    let mut sections: Vec<&str> = inputs.map(|(_, section)| section).collect();
    let mut empty = Vec::new();
    for statement in memory_x.split("*(").skip(1) {
        let (patterns, rest) = statement.split_once(')').context("memory.x: a bracket is open")?;
        let reason = rest.lines().next().and_then(|line| Some(line.split_once(OPTIONAL)?.1));
        let is_optional = reason.is_some_and(|reason| !reason.starts_with("*/"));
        for name in patterns.split_whitespace() {
            let pattern = Pattern::new(name).with_context(|| name.to_owned())?;
            let before = sections.len();
            sections.retain(|section| !pattern.matches(section));
            if sections.len() == before && !is_optional {
                empty.push(name);
            }
        }
    }
    Ok(empty)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "     VMA      LMA     Size Align Out     In      Symbol
10000000  803a000     50d0     8 .ccm
10000000  803a000        0     1         __sccm = .
10000000  803a000      3ba     4         a.o:(.text.ADC1_2)
10000000  803a000      3ba     1                 ADC1_2
100003bc  803a3bc       1c     4         b.rlib(c.o):(.text._RNv10drive_core5drive4step)
";

    fn empty(memory_x: &str) -> Vec<&str> {
        empty_patterns(memory_x, MAP).unwrap()
    }

    #[test]
    fn each_pattern_takes_a_section() {
        assert!(empty(".ccm : { *(.text.ADC1_2); *(.text.*10drive_core*4step*); }").is_empty());
        assert!(empty(".ccm : { KEEP(*(.text.ADC? .text.ADC1_2)) }") == [".text.ADC?"]);
        assert!(
            empty(".ccm : { *(.text.*10drive_core*5steps*) }") == [".text.*10drive_core*5steps*"]
        );
        // A star matches dots, underscores, and nothing at all.
        assert!(empty(".ccm : { *(.t*A*DC1_2*) *(*drive_core*) }").is_empty());
    }

    #[test]
    fn a_pattern_behind_one_that_takes_the_same_is_empty() {
        let memory_x = "*(.text.*10drive_core*);\n*(.text.*4step*);\n";
        assert_eq!(empty(memory_x), [".text.*4step*"]);
    }

    #[test]
    fn an_optional_pattern_gives_its_reason() {
        assert!(empty("*(.text.memcpy); /* optional: the compiler decides */").is_empty());
        assert_eq!(empty("*(.text.memcpy); /* the compiler decides */"), [".text.memcpy"]);
        assert_eq!(empty("*(.text.memcpy); /* optional: */"), [".text.memcpy"]);
        assert_eq!(empty("/* optional: not this line */\n*(.text.memcpy);\n"), [".text.memcpy"]);
    }
}

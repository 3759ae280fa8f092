//! `cargo xtask rooms`: checks that the modules of a crate do not refer to each other in a circle.
//!
//! A module refers to another by a path, an import, or a name that a third module re-exports; a name from the root of the crate counts
//! for the module that defines it. A name that the root itself defines counts for none: in the firmware's library these are the table that
//! ties modules and kernel. References are compared between siblings: a reference from `a::b` to `c::d` is an arrow from `a` to
//! `c`. References between a module and its own children do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Result, ensure};

use crate::modules::{self, Modules, Name};
use crate::sources;

/// Most modules that a path goes through; a longer path counts as one that leads to itself.
const LONGEST: usize = 64;

/// Arrows between siblings, each with one of its places.
type Arrows = BTreeMap<Name, BTreeMap<Name, String>>;

/// Prints the arrows within circles of every crate; fails if there is one.
pub fn check() -> Result<()> {
    let (mut count, mut in_circles) = (0, 0);
    let files = sources::files("rs")?;
    for root in files.iter().filter(|file| is_root(file)) {
        if root.iter().any(|part| part == "tests") {
            let known =
                modules::parse(&mut Modules::new(), Name::new(), root, &sources::read(root)?)?;
            for file in files.iter().filter(|file| *file != root && file.parent() == root.parent())
            {
                let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let is_module = known.contains(&vec![name]);
                ensure!(is_module, "{}: no module of {}", file.display(), root.display());
            }
            continue;
        }
        let modules = modules::read(root)?;
        let arrows = arrows(&modules);
        let circles = circles(&arrows);
        for [from, to] in &circles {
            let place = &arrows[*from][*to];
            println!("{}: {} -> {}  {place}", root.display(), from.join("::"), to.join("::"));
        }
        count += modules.len();
        in_circles += circles.len();
    }
    println!("\n{count} modules, {in_circles} arrows in circles");
    ensure!(in_circles == 0, "modules refer to each other in circles");
    Ok(())
}

fn is_root(file: &Path) -> bool {
    let is_bin = file.parent().is_some_and(|dir| dir.ends_with("src/bin"));
    let is_test = file.ends_with("main.rs") && file.iter().any(|part| part == "tests");
    is_bin || is_test || file.ends_with("src/lib.rs") || file.ends_with("src/main.rs")
}

fn arrows(modules: &Modules) -> Arrows {
    let mut arrows = Arrows::new();
    for (name, module) in modules {
        for (path, place) in &module.paths {
            let mut through = Vec::new();
            follow(modules, name, path, &mut through);
            for target in through {
                let common = name.iter().zip(&target).take_while(|(a, b)| a == b).count();
                if let (Some(from), Some(to)) = (name.get(..=common), target.get(..=common)) {
                    let from = arrows.entry(from.to_vec()).or_default();
                    from.entry(to.to_vec()).or_insert_with(|| place.clone());
                }
            }
        }
    }
    arrows
}

/// Lists the modules that a path goes `through`; the path is written in the module `at`.
fn follow(modules: &Modules, at: &[String], path: &[String], through: &mut Vec<Name>) {
    through.push(at.to_vec());
    let Some((first, rest)) = path.split_first().filter(|_| through.len() < LONGEST) else {
        return;
    };
    let child = [at, std::slice::from_ref(first)].concat();
    let module = &modules[at];
    match first.as_str() {
        "crate" => follow(modules, &[], rest, through),
        "self" => follow(modules, at, rest, through),
        "super" => follow(modules, &at[..at.len().saturating_sub(1)], rest, through),
        _ if modules.contains_key(&child) => follow(modules, &child, rest, through),
        _ => match module.imports.get(first) {
            Some(from) => follow(modules, at, &[from, rest].concat(), through),
            // The name can come from any of these modules.
            None => module.globs.iter().for_each(|glob| {
                follow(modules, at, &[glob, path].concat(), through);
            }),
        },
    }
}

/// Arrows that are a part of a circle.
fn circles(arrows: &Arrows) -> Vec<[&Name; 2]> {
    let all = arrows.iter().flat_map(|(from, to)| to.keys().map(move |to| [from, to]));
    all.filter(|[from, to]| leads(arrows, to, from)).collect()
}

fn leads(arrows: &Arrows, from: &Name, to: &Name) -> bool {
    let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
    while let Some(name) = next.pop() {
        if seen.insert(name) {
            next.extend(arrows.get(name).into_iter().flat_map(BTreeMap::keys));
        }
    }
    seen.contains(to)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The circles of a crate with this root file.
    fn found(text: &str) -> Vec<String> {
        let mut modules = Modules::new();
        modules::parse(&mut modules, Name::new(), "lib.rs".as_ref(), text).unwrap();
        let shown = |[from, to]: [&Name; 2]| format!("{} {}", from.join("::"), to.join("::"));
        circles(&arrows(&modules)).into_iter().map(shown).collect()
    }

    #[test]
    fn arrows_in_one_direction_are_no_circle() {
        assert!(
            found("mod a { use crate::b::B; } mod b { pub struct B; use super::c; } mod c {}")
                .is_empty()
        );
    }

    #[test]
    fn circles_are_found_by_imports_and_by_paths() {
        assert_eq!(
            found("mod a { use crate::b::B; } mod b { fn f() { super::a::g(); } }"),
            ["a b", "b a"]
        );
        assert_eq!(
            found("mod a { use super::{b, c}; } mod b {} mod c { fn f(x: crate::a::A) {} }"),
            ["a c", "c a"]
        );
        // In arguments of a macro or an attribute.
        assert_eq!(
            found("mod a { fn f() { g!(x = [crate::b::C]); } } mod b { use crate::a; }"),
            ["a b", "b a"]
        );
        assert_eq!(
            found("mod a { #[d(e = super::b::C)] struct S; } mod b { use crate::a; }"),
            ["a b", "b a"]
        );
    }

    #[test]
    fn a_name_from_the_root_counts_for_its_module() {
        let root = "pub use b::B; mod b { pub struct B; use crate::a::A; }";
        assert_eq!(found(&format!("{root} mod a {{ fn f(b: crate::B) {{}} }}")), ["a b", "b a"]);
        assert_eq!(found(&format!("{root} mod a {{ use crate::B as Other; }}")), ["a b", "b a"]);
        assert_eq!(
            found(&format!("{root} mod a {{ use super::*; fn f(b: B) {{}} }}")),
            ["a b", "b a"]
        );
        // Through two re-exports, the second of which covers all names.
        let text = "pub use a::*; pub use b::B; mod a { pub struct A; pub use super::c::C; use crate::B; }";
        let rest = "mod b { pub struct B; } mod c { pub struct C; fn f() -> crate::A {} }";
        assert_eq!(found(&format!("{text} {rest}")), ["a c", "c a"]);
    }

    #[test]
    fn circles_are_looked_for_at_every_level() {
        let inner = "mod a { mod c { use super::d::D; } mod d { use super::c; } }";
        assert_eq!(found(inner), ["a::c a::d", "a::d a::c"]);
        let lifted = "mod a { mod c { use crate::b::B; } } mod b { mod d { use crate::a::A; } }";
        assert_eq!(found(lifted), ["a b", "b a"]);
    }

    #[test]
    fn parents_tests_documentation_and_other_crates_do_not_count() {
        assert!(
            found("mod a { use self::b::B; struct A; mod b { use super::A; struct B; } }")
                .is_empty()
        );
        let from_b = |item: &str| found(&format!("mod a {{ use super::b; }} mod b {{ {item} }}"));
        assert!(from_b("#[cfg(test)] mod tests { use crate::a::A; }").is_empty());
        assert!(
            from_b(
                "#[cfg(doc)] use crate::a::A; /// See [`crate::a::A`].
 struct B;"
            )
            .is_empty()
        );
        assert!(from_b("use a::A; use other::a::B; fn f() { let a = 1; }").is_empty());
        assert_eq!(from_b("#[cfg(unix)] use crate::a::A;"), ["a b", "b a"]);
    }
}

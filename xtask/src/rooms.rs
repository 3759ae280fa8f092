//! `cargo xtask rooms`: checks that the modules of a crate do not refer to each other in a circle.
//!
//! A module refers to another by a path, an import, or a name that a third module re-exports; a name from the root of the crate counts
//! for the module that defines it. A name that the root itself defines counts for none: in the firmware's library these are the table that
//! ties modules and kernel. References are compared between siblings: a reference from `a::b` to `c::d` is an arrow from `a` to
//! `c`. References between a module and its own children do not count, nor do those in tests and documentation.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, ensure};
use proc_macro2::{Delimiter, TokenStream, TokenTree};

use crate::{run, sources};

/// Most modules that a path goes through; a longer path counts as one that leads to itself.
const LONGEST: usize = 64;

/// The segments of a path, such as `crate::a::B`. For a module, the segments below the root of its crate.
type Name = Vec<String>;
/// The modules of a crate.
type Modules = BTreeMap<Name, Module>;
/// Arrows between siblings.
type Arrows = BTreeMap<Name, BTreeSet<Name>>;

/// One module.
#[derive(Default)]
struct Module {
    /// The names that it imports, with the modules that they come from.
    imports: BTreeMap<String, Name>,
    /// The modules from which it imports all names.
    globs: Vec<Name>,
    /// The paths in its code.
    paths: Vec<Name>,
}

/// Prints the arrows within circles of every crate; fails if there is one, or if a file of tests is in no program.
pub fn check() -> Result<()> {
    let mut crates: BTreeMap<PathBuf, Modules> = BTreeMap::new();
    for file in sources::files("rs")? {
        if let Some((folder, name)) = module(&file) {
            let module = crates.entry(folder).or_default().entry(name).or_default();
            let tokens = sources::read(&file)?.parse();
            let tokens = tokens.map_err(|why| anyhow!("{}: {why}", file.display()))?;
            module.read(tokens, &[], false);
        }
        let main = file.with_file_name("main.rs");
        let is_test = file.parent().is_some_and(|folder| folder.ends_with("tests"));
        if is_test && file != main && run::root().join(&main).is_file() {
            let declared = file.file_stem().unwrap_or_default().to_string_lossy();
            let is_module = sources::read(&main)?.contains(&format!("mod {declared};"));
            ensure!(is_module, "{}: no module of {}", file.display(), main.display());
        }
    }
    let mut in_circles = 0;
    for (folder, modules) in &crates {
        let arrows = arrows(modules);
        for [from, to] in circles(&arrows) {
            println!("{}: {} -> {}", folder.display(), from.join("::"), to.join("::"));
            in_circles += 1;
        }
    }
    let count: usize = crates.values().map(Modules::len).sum();
    println!("\n{count} modules, {in_circles} arrows in circles");
    ensure!(in_circles == 0, "modules refer to each other in circles");
    Ok(())
}

/// The folder of the crate, and the name of the module in a file; `None` for tests, and for a program beside a library.
fn module(file: &Path) -> Option<(PathBuf, Name)> {
    let folder = file.ancestors().find(|folder| folder.ends_with("src"))?;
    let below = file.strip_prefix(folder).ok()?.with_extension("");
    let mut name: Name = below.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    name.pop_if(|last| ["lib", "main", "mod"].contains(&last.as_str()));
    let is_program = name.first().is_some_and(|first| first == "bin");
    let is_test = name.iter().any(|part| part == "tests");
    (!is_program && !is_test).then(|| (folder.to_owned(), name))
}

impl Module {
    /// Reads the paths in code, including arguments of macros and attributes. Paths in a group after `a::` begin with `prefix`.
    fn read(&mut self, tokens: TokenStream, prefix: &[String], mut is_import: bool) {
        let mut tokens = tokens.into_iter();
        let (mut path, mut colons) = (prefix.to_vec(), 2);
        while let Some(token) = tokens.next() {
            let continues = colons == 2;
            match token {
                TokenTree::Punct(mark) if mark.as_char() == ':' => colons += 1,
                TokenTree::Ident(name) if continues => {
                    path.push(name.to_string());
                    colons = 0;
                }
                TokenTree::Ident(name) if is_import && name == "as" => {
                    let alias = tokens.next().map(|alias| alias.to_string());
                    self.imports.extend(alias.map(|alias| (alias, path.clone())));
                }
                TokenTree::Group(group) if continues && !path.is_empty() => {
                    self.read(group.stream(), &path, is_import);
                }
                other => {
                    let text = other.to_string();
                    if is_import && continues && text == "*" {
                        self.globs.push(path.clone());
                    }
                    let begins_import = path == ["use"];
                    self.refer(std::mem::replace(&mut path, prefix.to_vec()), is_import);
                    is_import = begins_import || is_import && text != ";";
                    colons = 2;
                    match other {
                        TokenTree::Ident(_) => {
                            path.push(text);
                            colons = 0;
                        }
                        TokenTree::Group(group) if is_left_out(&group.stream()) => {
                            // The item after this attribute ends with a semicolon or with its body.
                            tokens.find(|token| match token {
                                TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
                                other => other.to_string() == ";",
                            });
                        }
                        TokenTree::Group(group) => self.read(group.stream(), &[], false),
                        _ => {}
                    }
                }
            }
        }
        self.refer(path, is_import);
    }

    fn refer(&mut self, mut path: Name, is_import: bool) {
        if path.len() > 1 {
            path.pop_if(|last| last == "self");
        }
        if let (true, Some(name)) = (is_import, path.last()) {
            self.imports.entry(name.clone()).or_insert_with(|| path.clone());
        }
        self.paths.push(path);
    }
}

/// Whether an attribute leaves out its item. A module with a path of its own is a file of tests elsewhere.
fn is_left_out(attribute: &TokenStream) -> bool {
    let text = attribute.to_string().replace(' ', "");
    text.starts_with("path=") || ["cfg(test)", "cfg(doc)"].contains(&&*text)
}

fn arrows(modules: &Modules) -> Arrows {
    let mut arrows = Arrows::new();
    for (name, module) in modules {
        let mut through = Vec::new();
        module.paths.iter().for_each(|path| follow(modules, name, path, &mut through, LONGEST));
        for target in through {
            let common = name.iter().zip(&target).take_while(|(a, b)| a == b).count();
            if let (Some(from), Some(to)) = (name.get(..=common), target.get(..=common)) {
                arrows.entry(from.to_vec()).or_default().insert(to.to_vec());
            }
        }
    }
    arrows
}

/// Lists the modules that a path goes `through`, at most so many; the path is written in the module `at`.
fn follow(modules: &Modules, at: &[String], path: &[String], through: &mut Vec<Name>, most: usize) {
    through.push(at.to_vec());
    let (Some((first, rest)), Some(module), 1..) = (path.split_first(), modules.get(at), most)
    else {
        return;
    };
    let child = [at, std::slice::from_ref(first)].concat();
    let mut go = |at: &[String], path: &[String]| follow(modules, at, path, through, most - 1);
    match first.as_str() {
        "crate" => go(&[], rest),
        "self" => go(at, rest),
        "super" => go(&at[..at.len().saturating_sub(1)], rest),
        _ if modules.contains_key(&child) => go(&child, rest),
        _ => match module.imports.get(first) {
            Some(from) if *from == path => {}
            Some(from) => go(at, &[from, rest].concat()),
            // The name can come from any of these modules.
            None => module.globs.iter().for_each(|glob| go(at, &[glob, path].concat())),
        },
    }
}

/// Arrows that are a part of a circle.
fn circles(arrows: &Arrows) -> Vec<[&Name; 2]> {
    let all = arrows.iter().flat_map(|(from, to)| to.iter().map(move |to| [from, to]));
    all.filter(|[from, to]| leads(arrows, to, from)).collect()
}

fn leads(arrows: &Arrows, from: &Name, to: &Name) -> bool {
    let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
    while let Some(name) = next.pop() {
        if seen.insert(name) {
            next.extend(arrows.get(name).into_iter().flatten());
        }
    }
    seen.contains(to)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The circles of a crate with these modules: name and text, the root first.
    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let mut modules = Modules::new();
        for (name, text) in files {
            let name = name.split("::").filter(|part| !part.is_empty()).map(str::to_owned);
            let module: &mut Module = modules.entry(name.collect()).or_default();
            module.read(text.parse().unwrap(), &[], false);
        }
        let shown = |[from, to]: [&Name; 2]| format!("{} {}", from.join("::"), to.join("::"));
        circles(&arrows(&modules)).into_iter().map(shown).collect()
    }

    #[test]
    fn arrows_in_one_direction_are_no_circle() {
        let b = "pub struct B; use super::c;";
        assert!(found(&[("", ""), ("a", "use crate::b::B;"), ("b", b), ("c", "")]).is_empty());
    }

    #[test]
    fn circles_are_found_by_imports_and_by_paths() {
        let ab = |a: &str, b: &str| found(&[("", "mod a; mod b;"), ("a", a), ("b", b)]);
        let circle = ["a b", "b a"];
        assert_eq!(ab("use crate::b::B;", "fn f() { super::a::g(); }"), circle);
        assert_eq!(ab("use crate::b::{self, B};", "fn f(x: crate::a::A) {}"), circle);
        // In arguments of a macro or an attribute.
        assert_eq!(ab("fn f() { g!(x = [crate::b::C]); }", "use crate::a;"), circle);
        assert_eq!(ab("#[d(e = super::b::C)] struct S;", "use crate::a;"), circle);
        let of_c = "use super::{b, c::{D as E}}; fn f(e: E) {}";
        let c = [("", ""), ("a", of_c), ("b", ""), ("c", "fn f(x: crate::a::A) {}")];
        assert_eq!(found(&c), ["a c", "c a"]);
    }

    #[test]
    fn a_name_from_the_root_counts_for_its_module() {
        let root = "pub use b::B; mod a; mod b;";
        for a in ["fn f(b: crate::B) {}", "use crate::B as Other;", "use super::*; fn f(b: B) {}"] {
            let files = [("", root), ("a", a), ("b", "pub struct B; use crate::a::A;")];
            assert_eq!(found(&files), ["a b", "b a"], "{a}");
        }
        // Through two re-exports, the second of which covers all names.
        let files = [
            ("", "pub use a::*; pub use b::B;"),
            ("a", "pub struct A; pub use super::c::C; use crate::B;"),
            ("b", "pub struct B;"),
            ("c", "pub struct C; fn f() -> crate::A {}"),
        ];
        assert_eq!(found(&files), ["a c", "c a"]);
    }

    #[test]
    fn circles_are_looked_for_at_every_level() {
        let inner = [("", ""), ("a", ""), ("a::c", "use super::d::D;"), ("a::d", "use super::c;")];
        assert_eq!(found(&inner), ["a::c a::d", "a::d a::c"]);
        let lifted = [
            ("", ""),
            ("a", ""),
            ("a::c", "use crate::b::B;"),
            ("b", ""),
            ("b::d", "use crate::a::A;"),
        ];
        assert_eq!(found(&lifted), ["a b", "b a"]);
    }

    #[test]
    fn parents_tests_documentation_and_other_crates_do_not_count() {
        let parent = [("", ""), ("a", "use self::b::B; struct A;"), ("a::b", "use super::A;")];
        assert!(found(&parent).is_empty());
        let from_b = |item: &str| found(&[("", ""), ("a", "use super::b;"), ("b", item)]);
        for left_out in [
            "#[cfg(test)] mod tests { use crate::a::A; }",
            "#[cfg(doc)] use crate::a::A; /// See [`crate::a::A`].\n struct B;",
            "use a::A; use other::a::B; fn f() { let a = 1; }",
        ] {
            assert!(from_b(left_out).is_empty(), "{left_out}");
        }
        assert_eq!(from_b("#[cfg(unix)] use crate::a::A;"), ["a b", "b a"]);
    }

    #[test]
    fn files_are_modules_of_the_crate_in_whose_folder_they_are() {
        let of = |file: &str| {
            let (folder, name) = module(Path::new(file))?;
            Some(format!("{} {}", folder.display(), name.join("::")))
        };
        assert_eq!(of("a/src/lib.rs").unwrap(), "a/src ");
        assert_eq!(of("a/src/b/mod.rs").unwrap(), "a/src b");
        assert_eq!(of("src/b/c.rs").unwrap(), "src b::c");
        for left_out in ["src/bin/b.rs", "a/src/b/tests.rs", "a/src/b/tests/c.rs", "tests/a.rs"] {
            assert_eq!(of(left_out), None, "{left_out}");
        }
    }
}

//! The modules of a crate and the paths in their code, read from the source files.
//!
//! Tests (`#[cfg(test)]`, and files of tests that another crate shares by `#[path]`), documentation and `#[cfg(doc)]` are left out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;
use syn::{Attribute, Ident, Item, UseTree};

use crate::{run, sources};

/// The segments of a path, such as `crate::a::B`. For a module, the segments below the root of its crate.
pub type Name = Vec<String>;
/// The modules of a crate.
pub type Modules = BTreeMap<Name, Module>;

/// One module.
#[derive(Default)]
pub struct Module {
    /// The names that it imports, with the modules that they come from.
    pub imports: BTreeMap<String, Name>,
    /// The modules from which it imports all names.
    pub globs: Vec<Name>,
    /// The paths in its code, each with its file and line.
    pub paths: Vec<(Name, String)>,
}

/// Reads the crate with this root file.
pub fn read(root: &Path) -> Result<Modules> {
    let mut modules = Modules::new();
    let dir = root.parent().context("the root of a crate lies in a directory")?;
    let mut files = vec![(Name::new(), root.to_owned())];
    while let Some((name, file)) = files.pop() {
        for child in parse(&mut modules, name, &file, &sources::read(&file)?)? {
            let base = dir.join(child.iter().collect::<PathBuf>());
            let file = base.with_extension("rs");
            let is_file = run::root().join(&file).is_file();
            files.push((child, if is_file { file } else { base.join("mod.rs") }));
        }
    }
    Ok(modules)
}

/// Adds a module from the text of its file; returns the modules inside it that have files of their own.
pub fn parse(modules: &mut Modules, name: Name, file: &Path, text: &str) -> Result<Vec<Name>> {
    let items = syn::parse_file(text).with_context(|| file.display().to_string())?.items;
    let mut inside = vec![(name, items)];
    let mut elsewhere = Vec::new();
    while let Some((name, items)) = inside.pop() {
        let mut reader = Reader { module: Module::default(), file };
        for item in items {
            match item {
                Item::Mod(item) if has_left_out(&item.attrs) => {}
                Item::Use(item) if has_left_out(&item.attrs) => {}
                Item::Use(item) => reader.import(&item.tree, Vec::new()),
                Item::Mod(item) => {
                    let child = [&name[..], &[item.ident.to_string()]].concat();
                    match item.content {
                        Some((_, items)) => inside.push((child, items)),
                        None => elsewhere.push(child),
                    }
                }
                other => reader.tokens(other.into_token_stream(), &[]),
            }
        }
        modules.insert(name, reader.module);
    }
    Ok(elsewhere)
}

struct Reader<'a> {
    module: Module,
    file: &'a Path,
}

impl Reader<'_> {
    fn refer(&mut self, path: &[Ident]) {
        if let Some(first) = path.first() {
            let place = format!("{}:{}", self.file.display(), first.span().start().line);
            self.module.paths.push((names(path), place));
        }
    }

    fn import(&mut self, tree: &UseTree, mut path: Vec<Ident>) {
        let (ident, alias) = match tree {
            UseTree::Path(inner) => {
                path.push(inner.ident.clone());
                return self.import(&inner.tree, path);
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.import(tree, path.clone()));
            }
            UseTree::Glob(_) => {
                self.module.globs.push(names(&path));
                return self.refer(&path);
            }
            UseTree::Name(inner) => (&inner.ident, &inner.ident),
            UseTree::Rename(inner) => (&inner.ident, &inner.rename),
        };
        if ident != "self" {
            path.push(ident.clone());
        }
        let alias = if alias == "self" { path.last().unwrap_or(alias) } else { alias };
        self.module.imports.insert(alias.to_string(), names(&path));
        self.refer(&path);
    }

    /// Reads the paths in other code, including arguments of macros and attributes. Paths in a group after `a::` begin with `prefix`.
    fn tokens(&mut self, tokens: TokenStream, prefix: &[Ident]) {
        let mut tokens = tokens.into_iter();
        let (mut path, mut colons) = (prefix.to_vec(), 2);
        while let Some(token) = tokens.next() {
            let mark = matches!(token, TokenTree::Punct(_) | TokenTree::Literal(_));
            let ends = mark && token.to_string() != ":" || !mark && colons != 2;
            if ends {
                self.refer(&path);
                (path, colons) = (prefix.to_vec(), 2);
            }
            match token {
                TokenTree::Ident(ident) => {
                    path.push(ident);
                    colons = 0;
                }
                TokenTree::Group(group) if !ends && !path.is_empty() => {
                    self.tokens(group.stream(), &path);
                }
                TokenTree::Group(group) if is_left_out(&group.stream().to_string()) => {
                    // The item after this attribute ends with a semicolon or with its body.
                    tokens.find(|token| match token {
                        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
                        other => other.to_string() == ";",
                    });
                }
                TokenTree::Group(group) => self.tokens(group.stream(), &[]),
                _ if !ends => colons += 1,
                _ => {}
            }
        }
        self.refer(&path);
    }
}

fn names(path: &[Ident]) -> Name {
    path.iter().map(Ident::to_string).collect()
}

fn has_left_out(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| is_left_out(&attribute.meta.to_token_stream().to_string()))
}

/// Whether an attribute leaves out its item. A module with a path of its own is a file of tests elsewhere.
fn is_left_out(text: &str) -> bool {
    text.starts_with("path") || ["cfg(test)", "cfg(doc)"].contains(&&*text.replace(' ', ""))
}

//! Configuration files: TOML with the names of the keys, in tables or dotted.

use std::collections::BTreeMap;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use super::{Config, Key, Value, flattened};
use crate::bounded;
use crate::error::{Error, parser_text};

/// An assignment of a file.
pub struct FileAssignment {
    /// Name of the key, as written.
    pub name: String,
    /// Its value.
    pub value: toml::Value,
    /// Its line, counted from 1.
    pub line: u64,
}

/// Returns the assignments of a file; those for the drive alone come last.
///
/// # Errors
/// [`Error::Data`] when the file cannot be read or is not TOML.
pub fn read(path: &Path) -> Result<Vec<FileAssignment>, Error> {
    let failed = |problem: String| Error::data(path, None, problem);
    let text = bounded::text(path).map_err(|e| failed(e.to_string()))?;
    let no_toml = |e: toml::de::Error| failed(parser_text(e));
    let table: toml::Table = text.parse().map_err(no_toml)?;
    let places = DeTable::parse(&text).map_err(no_toml)?;
    let mut offsets = BTreeMap::new();
    find("", places.get_ref(), &mut offsets);
    let ends: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
    let line_of = |name: &str| {
        let offset = offsets.get(name).copied().unwrap_or(0);
        1 + ends.partition_point(|end| *end < offset) as u64
    };
    let assignments = flattened(&table).into_iter();
    Ok(assignments
        .map(|(name, value)| FileAssignment { line: line_of(&name), name, value })
        .collect())
}

/// Finds the names of the values in a table, and the positions of their keys in the text.
fn find(prefix: &str, table: &DeTable<'_>, into: &mut BTreeMap<String, usize>) {
    for (key, value) in table {
        let name = format!("{prefix}{}", key.get_ref());
        match value.get_ref() {
            DeValue::Table(inner) => find(&format!("{name}."), inner, into),
            _ => drop(into.insert(name, key.span().start)),
        }
    }
}

/// Writes keys of the configuration as a file that [`read`] accepts, with units and meanings as comments.
pub fn toml(config: &Config, keys: &[Key]) -> String {
    let names: Vec<&str> = Key::all().map(Key::name).collect();
    // A name that is also the beginning of other names cannot be a table.
    let table_of = |name: &str| {
        let split = name.split_once('.').filter(|(table, _)| !names.contains(table));
        split.map(|(table, rest)| (table.to_owned(), rest.to_owned()))
    };
    let mut tables: Vec<(String, String)> = vec![(String::new(), String::new())];
    for key in keys {
        let name = key.assigned_name();
        let (table, rest) =
            table_of(&name).unwrap_or_else(|| (String::new(), format!("\"{name}\"")));
        let place = tables.iter().position(|(known, _)| *known == table);
        let place = place.unwrap_or_else(|| {
            tables.push((table.clone(), format!("\n[{table}]\n")));
            tables.len() - 1
        });
        tables[place].1.push_str(&line(*key, &rest, &key.get(config)));
    }
    tables.into_iter().map(|(_, text)| text).collect()
}

fn line(key: Key, name: &str, value: &Value) -> String {
    let unit = match key.unit() {
        "" => String::new(),
        unit => format!("{unit}; "),
    };
    let comment = format!("# {unit}{}", key.help());
    let quote = if matches!(value, Value::Word(_) | Value::Auto) { "\"" } else { "" };
    format!("{name} = {quote}{value}{quote}  {comment}\n")
}

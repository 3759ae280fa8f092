//! The public interface of the control crate: what a release has to keep.

use std::collections::BTreeSet;
use std::fs;

use anyhow::Result;
use serde_json::Value;

use crate::run;

/// Largest number of items that a release has to keep.
const LARGEST_INTERFACE: usize = 150;

/// Counts the items that the documentation of the control crate shows; fails above [`LARGEST_INTERFACE`].
pub fn check() -> Result<()> {
    let folder = run::folder("surface")?;
    let options = "--all-features -- -Z unstable-options --output-format json";
    let mut rustdoc = run::cargo(&format!("rustdoc -p induction-drive-core {options}"));
    // Only the nightly compiler has this output otherwise. A folder of its own, because other crates are built again for the variable.
    rustdoc.env("RUSTC_BOOTSTRAP", "1");
    rustdoc.env("CARGO_BUILD_BUILD_DIR", &folder).env("CARGO_TARGET_DIR", &folder);
    run::step("public interface of the control", &mut rustdoc)?;
    let json = fs::read(folder.join("doc/induction_drive_core.json"))?;
    let json: Value = serde_json::from_slice(&json)?;
    let mut shown = BTreeSet::new();
    show(&json["index"], &json["root"], &mut shown);
    run::limit("public interface of the control", shown.len(), LARGEST_INTERFACE, "items")
}

/// Adds an item and the items below it. Hidden items are not in the index; fields and variants belong to their type, and implementations
/// of a trait to the trait.
fn show(index: &Value, id: &Value, shown: &mut BTreeSet<String>) {
    let inner = index[id.to_string()]["inner"].as_object();
    let Some((kind, item)) = inner.and_then(|inner| inner.iter().next()) else { return };
    if kind == "use" {
        return show(index, &item["id"], shown);
    }
    if kind == "impl" && !item["trait"].is_null() {
        return;
    }
    if kind != "impl" {
        shown.insert(id.to_string());
    }
    let below = [&item["items"], &item["impls"]].into_iter().filter_map(Value::as_array);
    below.flatten().for_each(|id| show(index, id, shown));
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn methods_and_exported_items_count_once_and_hidden_ones_not() {
        let index = json!({
            "0": { "inner": { "module": { "items": [1, 2, 9] } } },
            "1": { "inner": { "use": { "id": 3 } } },
            "2": { "inner": { "module": { "items": [3] } } },
            "3": { "inner": { "struct": { "impls": [4, 6] } } },
            "4": { "inner": { "impl": { "trait": null, "items": [5] } } },
            "5": { "inner": { "function": {} } },
            "6": { "inner": { "impl": { "trait": { "path": "Clone" }, "items": [7] } } },
            "7": { "inner": { "function": {} } },
        });
        let mut shown = BTreeSet::new();
        show(&index, &json!(0), &mut shown);
        assert_eq!(Vec::from_iter(shown), ["0", "2", "3", "5"]);
    }
}

//! Runs as one flat table, with one row per run.

use serde_json::Value;

use super::Run;

use crate::prelude::*;

/// Makes the table: the number of the run, and the fields of its record by their names. Names of inner fields follow an
/// underscore, and values of a list have their number from 1. Statistics are those of the angle error, in degrees.
/// Lists of lists, which are curves and texts, are left out.
pub fn rows(runs: &[Run]) -> Table {
    let flat = |run: &Run| {
        let mut cells = vec![("run".to_owned(), Cell::from(run.run.to_string()))];
        flatten(String::new(), &run.record, &mut cells);
        cells
    };
    let flat: Vec<Vec<(String, Cell)>> = runs.iter().map(flat).collect();
    let mut columns: Vec<String> = Vec::new();
    for (name, _) in flat.iter().flatten() {
        if !columns.contains(name) {
            columns.push(name.clone());
        }
    }
    let cell = |row: &[(String, Cell)], name: &String| {
        row.iter().find(|(known, _)| known == name).map_or("".into(), |(_, cell)| cell.clone())
    };
    let rows =
        flat.iter().map(|row| columns.iter().map(|name| cell(row, name)).collect()).collect();
    Table { columns, rows, ..Table::default() }
}

fn flatten(name: String, value: &Value, into: &mut Vec<(String, Cell)>) {
    let under = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}_{key}") };
    let number = |value: f64| Cell::Number { value, text: value.to_string() };
    match value {
        Value::Null => {}
        Value::Bool(is) => into.push((name, Cell::from(if *is { "yes" } else { "no" }))),
        Value::Number(value) if value.is_u64() => into.push((name, Cell::from(value.to_string()))),
        Value::Number(value) => into.push((name, number(value.as_f64().unwrap_or(f64::NAN)))),
        Value::String(text) => into.push((name, Cell::from(text.as_str()))),
        Value::Array(values) if values.iter().any(Value::is_array) => {}
        Value::Array(values) => {
            for (n, value) in values.iter().enumerate() {
                flatten(under(&(n + 1).to_string()), value, into);
            }
        }
        Value::Object(fields) => {
            match (serde_json::from_value::<Stats>(value.clone()), fields.iter().next()) {
                (Ok(error), _) if error.count() > 0 => {
                    into.extend([
                        (under("rms_deg"), number(error.rms())),
                        (under("mean_deg"), number(error.mean())),
                        (under("max_deg"), number(error.largest())),
                    ]);
                }
                (Ok(_), _) => {}
                // The variants of an enumeration.
                (_, Some((variant, value))) if variant == "Ok" => flatten(name, value, into),
                (_, Some((variant, value))) if variant.starts_with(char::is_uppercase) => {
                    into.push((name, Cell::from(format!("{variant} {value}"))));
                }
                _ => fields.iter().for_each(|(key, value)| flatten(under(key), value, into)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_becomes_a_row_and_columns_are_those_of_all_rows() {
        let error = Stats::of([3.0, -4.0]);
        let one = serde_json::json!({
            "case": { "iq_a": 1.5, "seed": u64::MAX }, "error": error, "kind": { "Constant": 30 },
            "dc_link_v": [300.0, 311.5], "loss": [[0.0, 1.0]], "trip": null, "lost": false,
        });
        let two = serde_json::json!({ "trip": 11, "after": { "Ok": [true, 2.5] } });
        let runs = [Run { run: 0, record: one }, Run { run: 7, record: two }];
        let text = crate::report::of_table(&rows(&runs)).unwrap();
        let mut lines = text.lines();
        let first = lines.next().unwrap();
        assert!(first.starts_with("run,case_iq_a,case_seed,dc_link_v_1,dc_link_v_2,error_rms_deg,error_mean_deg,error_max_deg,kind,lost,"), "{first}");
        let row = lines.next().unwrap();
        assert!(
            row.starts_with(
                "0,1.5,18446744073709551615,300,311.5,3.5355339059327378,-0.5,4,Constant 30,no,"
            ),
            "{row}"
        );
        assert_eq!(lines.next().unwrap(), "7,,,,,,,,,,yes,2.5,11");
    }
}

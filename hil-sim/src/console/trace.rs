//! Traces: lines of comma-separated values as the drive prints them, and a plot of them.

use crate::outcome::name::split_unit;
use crate::outcome::{Figure, Panel, Series};

/// Names of the first column: the time from the trigger, or the number of the record.
const HEADS: [&str; 2] = ["t_s", "record"];

/// A table of numbers whose first column is the time or the number of the record: the last such table among the lines of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Trace {
    /// Processes a line: the head of a trace, one of its rows, or anything else.
    pub fn push(&mut self, line: &str) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let numbers: Result<Vec<f64>, _> = fields.iter().map(|field| field.parse()).collect();
        match numbers {
            Ok(row) if row.len() == self.names.len() => self.rows.push(row),
            Err(_) if HEADS.contains(&fields[0]) => {
                let names = fields.into_iter().map(str::to_owned).collect();
                *self = Self { names, rows: Vec::new() };
            }
            _ => {}
        }
    }

    /// Draws a panel for every unit, in the order of the columns.
    pub fn figure(&self) -> Figure {
        let (x, columns) = match self.names.split_first() {
            Some((x, columns)) => (label(x), columns),
            None => return Figure::default(),
        };
        let mut panels: Vec<(&str, Panel)> = Vec::new();
        for (index, name) in columns.iter().enumerate() {
            let points = self.rows.iter().map(|row| (row[0], row[index + 1])).collect();
            let unit = split_unit(name).map_or("", |(_, unit)| unit);
            match panels.iter_mut().find(|(known, _)| !unit.is_empty() && *known == unit) {
                Some((_, panel)) => {
                    panel.series.push(Series::line(name, points));
                    unit.clone_into(&mut panel.y_label);
                }
                None => {
                    let panel = Panel::new(&x, label(name)).with(Series::line(name, points));
                    panels.push((unit, panel));
                }
            }
        }
        let figure = Figure::new("trace", "Trace of the drive", "");
        panels.into_iter().fold(figure, |figure, (_, panel)| figure.panel(panel))
    }

    /// Number of records.
    pub fn records(&self) -> usize {
        self.rows.len()
    }
}

/// Returns a name with its unit in parentheses: `speed (rpm)` for `speed_rpm`.
fn label(name: &str) -> String {
    split_unit(name).map_or(name.to_owned(), |(quantity, unit)| format!("{quantity} ({unit})"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(lines: &[&str]) -> Option<Trace> {
        let mut trace = Trace::default();
        lines.iter().for_each(|line| trace.push(line));
        (trace.records() > 0).then_some(trace)
    }

    #[test]
    fn a_trace_is_found_among_other_lines() {
        let lines = [
            "off; i_d 0.00 A, i_q 0.00 of 0.00 A",
            "t_s,i_d_a,i_q_a,turns",
            "-0.0001,0.5,1.25,0",
            "fault 4: dc link above its limit, see the page",
            "0.0000,0.6,1.5,0.25",
            "ok",
        ];
        let figure = trace(&lines).unwrap().figure();
        let labels: Vec<_> = figure.panels.iter().map(|p| (&*p.x_label, &*p.y_label)).collect();
        assert_eq!(labels, [("t (s)", "A"), ("t (s)", "turns")]);
        let currents: Vec<_> = figure.panels[0].series.iter().map(|s| s.points.clone()).collect();
        assert_eq!(currents, [[(-0.0001, 0.5), (0.0, 0.6)], [(-0.0001, 1.25), (0.0, 1.5)]]);
        let svg = crate::report::svg(&figure).unwrap();
        assert!(svg.contains("i_q_a") && svg.contains("t (s)"));
    }

    #[test]
    fn the_last_trace_counts_and_a_head_alone_is_none() {
        assert_eq!(trace(&["record,i_d", "ok"]), None);
        assert_eq!(trace(&["1,2,3"]), None);
        assert_eq!(trace(&["i_q,reference,carrier", "0,1,2", "ok"]), None, "what was learned");
        let last = trace(&["record,i_d", "0,1", "ok", "record,i_q", "0,2", "1,3", "ok"]).unwrap();
        assert_eq!((last.records(), last.figure().panels[0].y_label.as_str()), (2, "i_q"));
    }
}

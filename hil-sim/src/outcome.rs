//! The outcome of an experiment: numbers, tables and figures, and their JSON form.

mod figure;
mod table;

use serde::ser::{Serialize, SerializeMap, Serializer};

pub use figure::{Figure, Panel, Series, Style};
pub use table::{Cell, Table};

/// The outcome of an experiment.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Numbers by name; a name ends in its unit, like `angle_error_rms_deg`.
    pub metrics: Metrics,
    /// The levels of a torque experiment.
    pub steps: Option<Vec<Step>>,
    /// Tables, in the order in which they are to be read.
    pub tables: Vec<Table>,
    /// Printed numbers and ours, one an entry; where there are any they are the `table` of the JSON.
    pub entries: Vec<Entry>,
    /// Figures, likewise.
    pub figures: Vec<Figure>,
    /// Texts to be read as they are, line by line, with their titles.
    pub texts: Vec<(String, String)>,
    /// Remarks for the reader: differences from the source, assumptions, limits.
    pub remarks: Vec<String>,
}

/// Numbers by name, in the order in which they were added.
#[derive(Clone, Debug, Default)]
pub struct Metrics(Vec<(String, f64)>);

impl Metrics {
    /// Adds a number, or replaces the one of this name.
    pub fn set(&mut self, name: impl Into<String>, value: f64) {
        let name = name.into();
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            Some(entry) => entry.1 = value,
            None => self.0.push((name, value)),
        }
    }

    /// The number of this name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.iter().find(|(known, _)| *known == name).map(|(_, value)| value)
    }

    /// All names and numbers.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, value)| (name.as_str(), *value))
    }

    /// Whether there are no numbers.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Serialize for Metrics {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter())
    }
}

/// One level of a torque experiment, averaged over its settled part.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Step {
    /// Reference of the quadrature-axis current, A peak.
    pub iq_ref_a: f64,
    /// Quadrature-axis current, A peak.
    pub iq_a: f64,
    /// Torque of the motor, Nm.
    pub torque_nm: f64,
    /// True minus estimated rotor flux angle, electrical degrees.
    pub angle_error_mean_deg: f64,
}

/// The error of one estimated parameter, as printed in the source (if it is) and as found here.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Entry {
    /// `A` to `D` or `S`.
    pub model: &'static str,
    /// `Sg` or `Ss`.
    pub signal: &'static str,
    /// Electrical rad/s.
    pub speed_rad_s: f64,
    /// Sampling period, µs.
    pub h_us: f64,
    /// `r_s`, `tau_r`, `sigma_l_s`, `l_s`, `omega_m`, or a coefficient like `f_1a`.
    pub parameter: &'static str,
    /// Printed error, %.
    pub printed_pct: Option<f64>,
    /// Our error, %.
    pub ours_pct: f64,
}

impl Entry {
    /// Ours over printed.
    pub fn ratio(&self) -> Option<f64> {
        self.printed_pct.map(|printed| self.ours_pct / printed)
    }

    /// Whether ours and printed differ by no more than this factor.
    pub fn within(&self, factor: f64) -> bool {
        self.ratio().is_some_and(|ratio| ratio <= factor && ratio * factor >= 1.0)
    }
}

/// The one JSON object of an experiment.
#[derive(serde::Serialize)]
struct Json<'a> {
    experiment: &'a str,
    seed: u64,
    metrics: &'a Metrics,
    series: AllSeries<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    steps: &'a Option<Vec<Step>>,
    #[serde(skip_serializing_if = "Rows::is_empty")]
    table: Rows<'a>,
}

/// Content of `table` in JSON.
#[derive(serde::Serialize)]
#[serde(untagged)]
enum Rows<'a> {
    Tables(&'a [Table]),
    Entries(&'a [Entry]),
}

impl Rows<'_> {
    fn is_empty(&self) -> bool {
        matches!(self, Self::Tables([]) | Self::Entries([]))
    }
}

struct AllSeries<'a>(&'a [Figure]);

impl Serialize for AllSeries<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(serde::Serialize)]
        struct Points<'a> {
            x_label: &'a str,
            y_label: &'a str,
            x: Vec<f64>,
            y: Vec<f64>,
        }
        let mut map = serializer.serialize_map(None)?;
        for figure in self.0 {
            for panel in &figure.panels {
                for series in &panel.series {
                    let key = format!("{}/{}/{}", figure.name, panel.y_label, series.name);
                    let (x, y) = series.points.iter().copied().unzip();
                    let (x_label, y_label) = (&panel.x_label, &panel.y_label);
                    map.serialize_entry(&key, &Points { x_label, y_label, x, y })?;
                }
            }
        }
        map.end()
    }
}

impl Outcome {
    /// The one JSON object: `experiment`, `seed`, `metrics`, `series`, and where there are any
    /// `steps` and `table`. A number that is not finite becomes `null`.
    ///
    /// # Errors
    /// As [`serde_json::to_string`].
    pub fn to_json(&self, experiment: &str, seed: u64) -> serde_json::Result<String> {
        serde_json::to_string(&Json {
            experiment,
            seed,
            metrics: &self.metrics,
            series: AllSeries(&self.figures),
            steps: &self.steps,
            table: match self.entries.as_slice() {
                [] => Rows::Tables(&self.tables),
                entries => Rows::Entries(entries),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_one_object_with_the_agreed_names() {
        let mut outcome = Outcome::default();
        outcome.metrics.set("speed_rpm", 12.5);
        outcome.metrics.set("lost", f64::NAN);
        let step = Step { iq_ref_a: 1.0, iq_a: 0.9, torque_nm: 0.3, angle_error_mean_deg: 5.0 };
        outcome.steps = Some(vec![step]);
        let mut table = Table::new("Levels", &["name", "value"]);
        table.row([Cell::from("a"), Cell::fixed(1.23456, 2)]);
        outcome.tables.push(table);
        let panel = Panel::new("time (s)", "current (A)");
        let panel = panel.with(Series::line("actual", vec![(0.0, 1.0), (1.0, 2.0)]));
        outcome.figures.push(Figure::new("step", "A step", "Figure 38").panel(panel));
        let text = outcome.to_json("torque-steps", 7).unwrap();
        let object: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(object["experiment"], "torque-steps");
        assert_eq!(object["seed"], 7);
        assert_eq!(object["metrics"]["speed_rpm"], 12.5);
        assert!(object["metrics"]["lost"].is_null());
        assert_eq!(object["steps"][0]["torque_nm"], 0.3);
        assert_eq!(object["table"][0]["rows"][0][1], 1.23456);
        assert_eq!(object["series"]["step/current (A)/actual"]["y"][1], 2.0);
        assert!(!text.contains('\n'));
    }

    #[test]
    fn what_there_is_none_of_is_left_out() {
        let text = Outcome::default().to_json("filters", 1).unwrap();
        assert_eq!(text, r#"{"experiment":"filters","seed":1,"metrics":{},"series":{}}"#);
    }

    #[test]
    fn numbers_are_rounded_for_reading_only() {
        assert_eq!(Cell::significant(0.000_123_4, 3).text(), "0.000123");
        assert_eq!(Cell::significant(1.234e-7, 3).text(), "1.23e-7");
        assert_eq!(Cell::significant(123_456.0, 3).text(), "123456");
        assert_eq!(Cell::significant(0.0, 3).text(), "0.00");
        assert_eq!(Cell::fixed(-0.0001, 2).text(), "0.00");
        assert_eq!(Cell::fixed(-1.5, 1).text(), "-1.5");
    }
}

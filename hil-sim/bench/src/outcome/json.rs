//! The JSON form of an outcome.

use serde::Serialize;
use serde::ser::Serializer;

use super::{Compared, Figure, Metrics, Origin, Outcome, Step, Table};

/// Version of the form: it grows when a name changes its meaning or goes away.
pub const SCHEMA_VERSION: u32 = 3;

/// The one JSON object of an experiment.
#[derive(Serialize)]
struct Json<'a> {
    schema_version: u32,
    version: &'a str,
    experiment: &'a str,
    seed: u64,
    #[serde(serialize_with = "as_map")]
    settings: Vec<(String, serde_json::Value)>,
    metrics: &'a Metrics,
    #[serde(serialize_with = "as_map")]
    series: Vec<(String, Points<'a>)>,
    #[serde(serialize_with = "as_map", skip_serializing_if = "Vec::is_empty")]
    events: Vec<(String, &'a [(f64, String)])>,
    #[serde(skip_serializing_if = "Option::is_none")]
    steps: &'a Option<Vec<Step>>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    table: &'a [Table],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    compared: &'a [Compared],
    remarks: &'a [String],
    faults: &'a [String],
}

/// Pairs as the entries of an object, in their order.
pub(super) fn as_map<S: Serializer, V: Serialize>(
    pairs: &[(String, V)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().map(|(name, value)| (name, value)))
}

/// A curve.
#[derive(Serialize)]
struct Points<'a> {
    x_label: &'a str,
    y_label: &'a str,
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Origin {
    /// Names and values of the settings as they stand in JSON: what is a number or a switch is one there too.
    pub fn typed_settings(&self) -> impl Iterator<Item = (String, serde_json::Value)> {
        let typed = |text: &String| match serde_json::from_str(text) {
            Ok(value @ (serde_json::Value::Number(_) | serde_json::Value::Bool(_))) => value,
            _ => serde_json::Value::from(text.as_str()),
        };
        self.settings.iter().map(move |(name, value)| (name.clone(), typed(value)))
    }
}

/// The curves of a figure, by `FIGURE/CURVE`.
fn series(figure: &Figure) -> impl Iterator<Item = (String, Points<'_>)> {
    figure.curves().into_iter().map(|curve| {
        let (x, y) = curve.series.points.iter().copied().unzip();
        let (x_label, y_label) = (&curve.panel.x_label, &curve.panel.y_label);
        (format!("{}/{}", figure.name, curve.name), Points { x_label, y_label, x, y })
    })
}

impl Outcome {
    /// The one JSON object: `schema_version`, `version` of the program, `experiment`, `seed`, `settings` (those
    /// that were changed), `metrics`, `series` (`FIGURE/CURVE`), `remarks`, `faults`, and where there are any
    /// `events`, `steps`, `table` and `compared`. A number that is not finite becomes `null`.
    ///
    /// # Errors
    /// As [`serde_json::to_string`].
    pub fn to_json(&self, experiment: &str, origin: &Origin) -> serde_json::Result<String> {
        let with_events = self.figures.iter().filter(|figure| !figure.events.is_empty());
        serde_json::to_string(&Json {
            schema_version: SCHEMA_VERSION,
            version: env!("CARGO_PKG_VERSION"),
            experiment,
            seed: origin.seed,
            settings: origin.typed_settings().collect(),
            metrics: &self.metrics,
            series: self.figures.iter().flat_map(series).collect(),
            events: with_events.map(|figure| (figure.name.clone(), &*figure.events)).collect(),
            steps: &self.steps,
            table: &self.tables,
            compared: &self.compared,
            remarks: &self.remarks,
            faults: &self.faults,
        })
    }
}

/// The object of an experiment, or one with the objects of several in the list `experiments`.
pub fn joined(objects: &[String]) -> String {
    if let [object] = objects {
        return object.clone();
    }
    format!(r#"{{"schema_version":{SCHEMA_VERSION},"experiments":[{}]}}"#, objects.join(","))
}

#[cfg(test)]
mod tests {
    use super::super::{Cell, Panel, Series};
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
        let figure =
            Figure::new("step", "A step", "Figure 38").panel(panel).events([(0.5, "stop".into())]);
        outcome.figures.push(figure);
        outcome.faults.push("fault 4: dc link above its limit".into());
        let changes = ["motor.rs=6", "load.mode=free", "drive.learn=true"].map(String::from);
        let text = outcome.to_json("torque-steps", &Origin::new(7, &changes)).unwrap();
        let object: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(object["schema_version"], SCHEMA_VERSION);
        assert_eq!(object["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(object["experiment"], "torque-steps");
        assert_eq!(object["seed"], 7);
        assert_eq!(object["settings"]["motor.rs"], 6);
        assert_eq!(object["settings"]["load.mode"], "free");
        assert_eq!(object["settings"]["drive.learn"], true);
        assert_eq!(object["metrics"]["speed_rpm"], 12.5);
        assert!(object["metrics"]["lost"].is_null());
        assert_eq!(object["steps"][0]["torque_nm"], 0.3);
        assert_eq!(object["table"][0]["rows"][0][1], 1.23456);
        assert_eq!(object["series"]["step/current_actual_a"]["y"][1], 2.0);
        assert_eq!(object["events"]["step"][0][1], "stop");
        assert_eq!(object["faults"][0], "fault 4: dc link above its limit");
        assert!(!text.contains('\n'));
    }

    #[test]
    fn absent_parts_are_left_out() {
        let text = Outcome::default().to_json("filters", &Origin::new(1, &[])).unwrap();
        let version = env!("CARGO_PKG_VERSION");
        let expected = format!(
            r#"{{"schema_version":3,"version":"{version}","experiment":"filters","seed":1,"settings":{{}},"metrics":{{}},"series":{{}},"remarks":[],"faults":[]}}"#
        );
        assert_eq!(text, expected);
        let both: serde_json::Value = serde_json::from_str(&joined(&[text.clone(), text])).unwrap();
        assert_eq!(both["experiments"][1]["experiment"], "filters");
    }
}

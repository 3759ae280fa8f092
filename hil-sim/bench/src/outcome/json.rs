//! The JSON form of an outcome.

use serde::Serialize;
use serde::ser::Serializer;

use super::{Compared, Figure, Metrics, Origin, Outcome, Step, Table};

/// Version of the JSON form: it increases when a name changes its meaning or is removed.
pub const SCHEMA_VERSION: u32 = 3;

/// The JSON object of an experiment.
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

/// Writes pairs as the entries of an object, in their order.
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
    /// Returns names and values of the settings as JSON types: numbers and switches are numbers and switches there too.
    pub fn typed_settings(&self) -> impl Iterator<Item = (String, serde_json::Value)> {
        let typed = |text: &String| match serde_json::from_str(text) {
            Ok(value @ (serde_json::Value::Number(_) | serde_json::Value::Bool(_))) => value,
            _ => serde_json::Value::from(text.as_str()),
        };
        self.settings.iter().map(move |(name, value)| (name.clone(), typed(value)))
    }
}

/// Returns the curves of a figure by `FIGURE/CURVE`.
fn series(figure: &Figure) -> impl Iterator<Item = (String, Points<'_>)> {
    figure.curves().into_iter().map(|curve| {
        let (x, y) = curve.series.points.iter().copied().unzip();
        let (x_label, y_label) = (&curve.panel.x_label, &curve.panel.y_label);
        (format!("{}/{}", figure.name, curve.name), Points { x_label, y_label, x, y })
    })
}

impl Outcome {
    /// Returns the JSON object: `schema_version`, `version` of the program, `experiment`, `seed`, `settings` (the
    /// changed ones), `metrics`, `series` (`FIGURE/CURVE`), `remarks`, `faults`, and, if there are any, `events`,
    /// `steps`, `table` and `compared`. A number that is not finite becomes `null`.
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

/// Returns the object of an experiment, or one object with those of several experiments in the list `experiments`.
pub fn joined(objects: &[String]) -> String {
    if let [object] = objects {
        return object.clone();
    }
    format!(r#"{{"schema_version":{SCHEMA_VERSION},"experiments":[{}]}}"#, objects.join(","))
}

//! Data that must be equal in runs that belong together.

use serde_json::Value as Json;

use crate::outcome::{Origin, SCHEMA_VERSION};
use crate::prelude::*;

/// Origin of the records of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the JSON form.
    pub schema_version: u32,
    /// Version of the program.
    pub version: String,
    /// Hash of the sources of the program.
    pub sources: String,
    /// The experiment.
    pub experiment: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The changed settings.
    pub settings: BTreeMap<String, Json>,
    /// Number of runs.
    pub runs: usize,
}

impl Header {
    /// Makes the header of an experiment with `runs` runs in all.
    ///
    /// # Errors
    /// [`Error::Internal`] if the settings do not give the configuration again.
    pub fn new(experiment: &str, config: &Config, seed: u64, runs: usize) -> Result<Self, Error> {
        let changes = config.changes();
        if Config::load(None, None, &changes)? != *config {
            let settings = changes.join(", ");
            return Err(Error::Internal(format!("the configuration is more than {settings}")));
        }
        Ok(Self {
            schema_version: SCHEMA_VERSION,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            sources: env!("HIL_SIM_SOURCES").to_owned(),
            experiment: experiment.to_owned(),
            seed,
            settings: Origin::new(seed, &changes).typed_settings().collect(),
            runs,
        })
    }

    /// Returns the first difference between two headers whose runs do not belong together, `NAME is ..., there ...`.
    pub fn difference(&self, there: &Self) -> Option<String> {
        let fields = [
            ("schema_version", self.schema_version.to_string(), there.schema_version.to_string()),
            ("version", self.version.clone(), there.version.clone()),
            ("sources", self.sources.clone(), there.sources.clone()),
            ("experiment", self.experiment.clone(), there.experiment.clone()),
            ("seed", self.seed.to_string(), there.seed.to_string()),
        ];
        let keys = self.settings.keys().chain(there.settings.keys());
        let text = |header: &Self, key: &String| match header.settings.get(key) {
            Some(Json::String(text)) => text.clone(),
            Some(value) => value.to_string(),
            None => "not set".to_owned(),
        };
        let settings = keys.map(|key| (key.as_str(), text(self, key), text(there, key)));
        let runs = ("the number of runs", self.runs.to_string(), there.runs.to_string());
        let mut all = fields.into_iter().chain(settings).chain([runs]);
        all.find(|(_, here, there)| here != there)
            .map(|(name, here, there)| [name, &here, &there].map(cut))
            .map(|[name, here, there]| format!("{name} is {here}, there {there}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(assignments: &[&str], seed: u64) -> Header {
        let config = Config::load(None, None, assignments).unwrap();
        Header::new("monte-carlo", &config, seed, 8).unwrap()
    }

    /// `drive.motor.r_s` is set beside `motor.r_s`, which sets both, and `measurement.*` sets the scales of the drive.
    #[test]
    fn settings_describe_the_whole_configuration() {
        header(
            &[
                "motor.r_s=6.1",
                "drive.motor.r_s=0.1",
                "measurement.range_a=10",
                "scales.current_a.gain=0.003",
                "runs=8",
                "prepare.learn=yes",
                "load.mode=speed",
                "motor.l_ls=1.25e-6",
            ],
            1,
        );
        let motors = crate::config::motors::Motor::all().into_iter();
        for name in motors.map(|motor| motor.name) {
            let config = Config::of_motor(Some(&name)).unwrap();
            Header::new("machines", &config, 1, 8).unwrap();
        }
    }

    #[test]
    fn differences_are_named() {
        let one = header(&["motor.r_s=6"], 1);
        assert_eq!(one.difference(&one), None);
        let other = |change: fn(&mut Header)| {
            let mut other = one.clone();
            change(&mut other);
            one.difference(&other).unwrap()
        };
        assert_eq!(other(|h| h.seed = 2), "seed is 1, there 2");
        assert_eq!(
            other(|h| h.experiment = "machines".into()),
            "experiment is monte-carlo, there machines"
        );
        assert_eq!(other(|h| h.runs = 9), "the number of runs is 8, there 9");
        assert!(other(|h| h.sources = "0".into()).starts_with("sources is "));
        assert!(other(|h| h.version = "0.0.1".into()).starts_with("version is "));
        assert_eq!(
            one.difference(&header(&["motor.r_s=7"], 1)),
            Some("motor.r_s is 6, there 7".into())
        );
        let set = header(&["motor.r_s=6", "spread.motor=0.1"], 1);
        assert_eq!(one.difference(&set), Some("spread.motor is not set, there 0.1".into()));
    }
}

//! An experiment: one function from a [`Context`] to an [`Outcome`].

use crate::config::{Config, Key, plant_settings};
pub use crate::context::Context;
use crate::error::Error;
use crate::outcome::Outcome;
use crate::progress::Progress;
use crate::statistics::{Statistical, Study, whole};

/// An experiment.
pub struct Experiment {
    /// Name on the command line.
    pub name: &'static str,
    /// The part of the source that it reproduces: `Figure 38`.
    pub stands_for: &'static str,
    /// Description in one sentence.
    pub about: &'static str,
    /// The keys that the experiment uses: names, and beginnings of names that end in a full stop.
    pub uses: Vec<&'static str>,
    /// Exceptions from `uses`, written alike: keys that the experiment sets itself, or that have no effect in it.
    pub not: Vec<&'static str>,
    /// Remarks for the reader of every outcome; `{assumptions}` stands for [`assumptions`].
    pub remarks: &'static [String],
    /// Computes the outcome, without these remarks.
    pub run: fn(&Context<'_>) -> Result<Outcome, Error>,
    /// The single runs of an experiment that consists of independent runs.
    pub study: Option<Statistical>,
}

impl Experiment {
    /// Makes an experiment without a description that uses no key, from its name and its function.
    pub fn new(name: &'static str, run: fn(&Context<'_>) -> Result<Outcome, Error>) -> Self {
        let (uses, not) = (Vec::new(), Vec::new());
        Self { name, stands_for: "", about: "", uses, not, remarks: &[], run, study: None }
    }

    /// Makes an experiment of independent runs, which can be shared between machines and continued.
    pub fn study<S: Study>() -> Self {
        Self { study: Some(Statistical::of::<S>()), ..Self::new(S::NAME, whole::<S>) }
    }

    /// Runs the experiment for its own time, without progress bars.
    ///
    /// # Errors
    /// The errors of the experiment.
    pub fn outcome(&self, config: &Config, seed: u64) -> Result<Outcome, Error> {
        self.run(&Context::new(config, seed, Progress::hidden()))
    }

    /// Runs the experiment.
    ///
    /// # Errors
    /// The errors of the experiment.
    pub fn run(&self, context: &Context<'_>) -> Result<Outcome, Error> {
        (self.run)(context).map(|outcome| self.remarked(outcome, context.config))
    }

    /// Adds the remarks of the experiment to the outcome of its function or of its single runs.
    pub fn remarked(&self, mut outcome: Outcome, config: &Config) -> Outcome {
        for remark in self.remarks {
            match remark.as_str() {
                "{assumptions}" => outcome.remarks.extend(assumptions(config)),
                _ => outcome.remarks.push(remark.clone()),
            }
        }
        outcome
    }

    /// Whether a key has an effect on this experiment.
    pub fn uses_key(&self, key: Key) -> bool {
        let name = key.assigned_name();
        let is_in = |given: &&str| {
            if given.ends_with('.') { name.starts_with(given) } else { name == *given }
        };
        self.uses.iter().any(is_in) && !self.not.iter().any(is_in)
    }

    /// Describes the keys that it uses in words.
    pub fn uses_text(&self) -> String {
        let words = |names: &[&str]| {
            let shown = names.iter().map(|name| match name.strip_suffix('.') {
                Some(group) => format!("{group}.*"),
                None => (*name).to_owned(),
            });
            shown.collect::<Vec<_>>().join(", ")
        };
        match (&self.uses[..], &self.not[..]) {
            ([], _) => "no key".to_owned(),
            (uses, []) => words(uses),
            (uses, not) => format!("{}; except {}", words(uses), words(not)),
        }
    }
}

/// Angle error beyond which the lock counts as lost, degrees: half way to the angle at which the saliency, which
/// repeats every 180°, has the wrong sign.
pub const LOST_DEG: f64 = 45.0;

/// Whether a run has lost the lock: its largest angle error, degrees, is beyond [`LOST_DEG`], or the drive has stopped
/// itself.
pub fn is_lost(largest_deg: f64, has_stopped: bool) -> bool {
    has_stopped || largest_deg > LOST_DEG
}

/// Returns the assumptions of the simulated plant, for the remarks of an outcome.
pub fn assumptions(config: &Config) -> Vec<String> {
    let (s, motor) = (plant_settings(config).saliency, config.motor_text());
    vec![format!(
        "Simulated motor: {motor}. Its saliency is assumed: {:.2} % fixed to the flux, at nominal flux, \
         and {:.2} % per ampere of stator current. No source states it, so every angle error here holds \
         for this simulated motor only.",
        s.a_psi * 100.0,
        s.b1 * 100.0
    )]
}

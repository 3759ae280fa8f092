//! The form of a model and its variables. Every value is an `f64`: a number, or the position of a word.

use serde::Serialize;
use serde_json::{Value as Json, json};
use sim_bench::config::{Config, Key, Value, double};

/// Value reference of the first input.
pub const INPUT: u32 = 10;
/// Value reference of the first output.
pub const OUTPUT: u32 = 100;
/// Value reference of the first setting: that of a setting of the drive is this plus its permanent number.
pub const SETTING: u32 = 2000;
/// Words of a switch.
pub const SWITCH: &[&str] = &["no", "yes"];

/// A variable of an FMU.
#[derive(Clone, Copy, Serialize)]
pub struct Variable {
    /// Value reference: the permanent number by which tools know it.
    pub reference: u32,
    /// Use: `input`, `output` or `parameter`.
    pub causality: &'static str,
    /// Name; that of a setting or of a signal is the one at the console.
    pub name: &'static str,
    /// Unit; empty if there is none.
    pub unit: &'static str,
    /// Value at the start.
    pub start: f64,
    /// The words that are its values; none if it is a number.
    pub words: &'static [&'static str],
    /// Range of a number.
    pub range: Option<(f64, f64)>,
    /// Meaning.
    pub about: &'static str,
}

type Text = &'static str;

/// Returns an input or output that is a number and starts at 0.
pub const fn number(name: Text, unit: Text, about: Text) -> Variable {
    let (reference, causality, words, range) = (0, "output", &[], None);
    Variable { reference, causality, name, unit, start: 0.0, words, range, about }
}

/// Returns an input or output that is one of these words and starts at the first.
pub const fn choice(name: Text, words: &'static [Text], about: Text) -> Variable {
    Variable { words, ..number(name, "", about) }
}

/// An output, with the function that computes it.
pub type Computed<M> = (Variable, fn(&M) -> f64);

/// Returns the variables of outputs.
pub fn variables<M>(outputs: &[Computed<M>]) -> Vec<Variable> {
    let outputs = (OUTPUT..).zip(outputs);
    outputs.map(|(reference, (output, _))| Variable { reference, ..*output }).collect()
}

/// A model that runs one control period after the other.
pub trait Model {
    /// Returns the value of an output; `None` if it has no output with this value reference.
    fn output(&self, reference: u32) -> Option<f64>;
    /// Simulates a control period with these inputs. `say` gets what the user should know.
    fn period(&mut self, inputs: &[f64], say: &mut dyn FnMut(&str));
    /// Copies the model with its state.
    fn copy(&self) -> Box<dyn Model>;
}

impl Clone for Box<dyn Model> {
    fn clone(&self) -> Self {
        self.copy()
    }
}

/// A new model, or the setting that is refused.
pub type Made = Result<Box<dyn Model>, String>;

/// An FMU before it runs.
pub struct Kind {
    /// Name: that of the library in the FMU, and with hyphens that of its file.
    pub name: &'static str,
    /// The inputs.
    pub inputs: &'static [Variable],
    /// The outputs.
    pub outputs: fn() -> Vec<Variable>,
    /// The settings with their value references.
    pub keys: fn() -> Vec<(u32, Key)>,
    /// Makes the model at the start.
    pub new: fn(&Config, inputs: &[f64]) -> Made,
}

impl Kind {
    /// Returns the identifier, which ties a description to the library of its version.
    pub fn identifier(&self) -> String {
        format!("{}-{}", self.name, env!("CARGO_PKG_VERSION"))
    }

    /// Returns all variables but the name of the motor.
    pub fn variables(&self) -> Vec<Variable> {
        let inputs = (INPUT..).zip(self.inputs);
        let inputs =
            inputs.map(|(reference, it)| Variable { reference, causality: "input", ..*it });
        let keys = (self.keys)().into_iter();
        let settings = keys.filter_map(|(reference, key)| setting(reference, key));
        inputs.chain((self.outputs)()).chain(settings).collect()
    }

    /// Returns the contents of the description.
    pub fn description(&self) -> Json {
        json!({"name": self.name, "identifier": self.identifier(), "variables": self.variables()})
    }
}

/// Returns the variable of a setting; `None` if it is unset at the start, which no number can say.
fn setting(reference: u32, key: Key) -> Option<Variable> {
    let start = level(key, &Config::default())?;
    let (name, unit, words, range, about) =
        (key.name(), key.unit(), key.words(), key.range(), key.help());
    Some(Variable { reference, causality: "parameter", name, unit, start, words, range, about })
}

/// Returns the number of a key, the one in effect if a rule gives it, or the position of its word. `None` if it is unset.
pub fn level(key: Key, config: &Config) -> Option<f64> {
    match (key, key.get(config)) {
        (_, Value::Word(word)) => {
            key.words().iter().position(|known| *known == word).map(|place| place as f64)
        }
        (Key::Drive(entry), _) => entry.number(&config.drive).map(double),
        _ => key.number(config),
    }
}

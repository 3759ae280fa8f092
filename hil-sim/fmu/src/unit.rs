//! An FMU in use.

use sim_bench::config::{Config, Key};
use sim_bench::rig::RATE_HZ;

use crate::model::{INPUT, Kind, Model, SETTING, level};
use crate::{drive, motor};

/// Both FMUs.
pub static KINDS: [&Kind; 2] = [&drive::KIND, &motor::KIND];
/// Value reference of the name of the motor.
pub const MOTOR: u32 = 0;
/// Part of a control period by which the sum of many steps may be too short.
const SLACK: f64 = 1e-3;

/// An FMU in use, see the head of the module.
#[derive(Clone)]
pub struct Unit {
    /// The description of the FMU: that of the drive or that of the motor.
    pub kind: &'static Kind,
    /// Name of a motor of the simulator, or path of a motor file; empty: the dissertation's.
    pub motor: String,
    /// `KEY=VALUE` of the settings that were set.
    assigned: Vec<String>,
    inputs: Vec<f64>,
    /// The model, once the initialization has begun.
    model: Option<Box<dyn Model>>,
    /// Time of the start, s.
    pub begin: f64,
    periods: u64,
}

impl Unit {
    /// Makes an FMU with the values of its description.
    pub fn new(kind: &'static Kind) -> Self {
        let inputs = kind.inputs.iter().map(|input| input.start).collect();
        let (motor, assigned, model, begin, periods) = (String::new(), Vec::new(), None, 0.0, 0);
        Self { kind, motor, assigned, inputs, model, begin, periods }
    }

    /// Returns the configuration of simulated motor and drive.
    ///
    /// # Errors
    /// The setting that is refused, or the motor that cannot be read.
    pub fn config(&self) -> Result<Config, String> {
        let motor = Some(&*self.motor).filter(|motor| !motor.is_empty());
        Config::load(motor, None, &self.assigned).map_err(|why| why.to_string())
    }

    /// Makes the model with the present settings and inputs.
    ///
    /// # Errors
    /// The setting that is refused.
    pub fn build(&mut self) -> Result<(), String> {
        self.model = Some((self.kind.new)(&self.config()?, &self.inputs)?);
        Ok(())
    }

    fn key(&self, reference: u32) -> Result<Key, String> {
        let found = (self.kind.keys)().into_iter().find(|(known, _)| *known == reference);
        found.map(|(_, key)| key).ok_or_else(|| unknown(reference))
    }

    /// Returns the value of a variable.
    ///
    /// # Errors
    /// There is no such variable, or it has no value yet.
    #[inline]
    pub fn get(&self, reference: u32) -> Result<f64, String> {
        if reference >= SETTING {
            return Ok(level(self.key(reference)?, &self.config()?).unwrap_or(f64::NAN));
        }
        let output = self.model.as_ref().and_then(|model| model.output(reference));
        let input = || self.inputs.get(reference.wrapping_sub(INPUT) as usize).copied();
        output.or_else(input).ok_or_else(|| unknown(reference))
    }

    /// Sets an input or a setting. The start value of the description does not change a setting: tools set every one, and
    /// the motor and the rules of other settings are to have their effect.
    ///
    /// # Errors
    /// The value is refused, or the variable is an output.
    #[inline]
    pub fn set(&mut self, reference: u32, value: f64) -> Result<(), String> {
        if reference >= SETTING {
            return self.assign(self.key(reference)?, value);
        }
        let place = reference.wrapping_sub(INPUT) as usize;
        let input = self.kind.inputs.get(place).ok_or_else(|| unknown(reference))?;
        let words = input.words.len();
        if words > 0 && value as usize >= words {
            return Err(format!("{} = {value}: allowed is 0 to {}", input.name, words - 1));
        }
        self.inputs[place] = value;
        Ok(())
    }

    fn assign(&mut self, key: Key, value: f64) -> Result<(), String> {
        if level(key, &Config::default()) != Some(value) {
            let word = key.words().get(value as usize);
            let text = word.map_or_else(|| value.to_string(), |word| (*word).to_owned());
            // `drive.` sets the drive alone.
            let group = if matches!(key, Key::Drive(_)) { "drive." } else { "" };
            let name = format!("{group}{}", key.name());
            Config::default().set(&name, &text).map_err(|why| why.to_string())?;
            self.assigned.push(format!("{name}={text}"));
        }
        Ok(())
    }

    /// Simulates the control periods that end up to this time, s.
    ///
    /// # Errors
    /// The initialization has not begun.
    pub fn run_to(&mut self, seconds: f64, say: &mut dyn FnMut(&str)) -> Result<(), String> {
        let model = self.model.as_mut().ok_or("a step before the initialization")?;
        let end = ((seconds - self.begin) * RATE_HZ + SLACK) as u64;
        while self.periods < end {
            model.period(&self.inputs, say);
            self.periods += 1;
        }
        Ok(())
    }
}

/// Returns the refusal of a value reference.
pub fn unknown(reference: u32) -> String {
    format!("no variable has the value reference {reference}, or it cannot be used in this way")
}

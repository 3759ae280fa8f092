//! The FMU of the drive: the control of the firmware between sensors and timer.

use drive_core::{
    Accepted, Command, Compare, FrontEndState, Hardware, Line, Mode, Output, Sample, Stop,
};
use drive_settings::{CurrentSensors, SETTINGS, Settings};
use induction_drive::recording::trace::{SIGNALS, Sampled, Signal, shown};
use sim_bench::config::{Config, Key, built};

use crate::model::{
    Computed, Kind, Model, OUTPUT, SETTING, SWITCH, Variable, choice, number, variables,
};

/// Value reference of the first signal: that of a signal is this plus its permanent number.
const SIGNAL: u32 = 1000;
/// Words of the input `mode`, with the commands that a change to them gives.
const MODES: &[&str] = &["off", "torque", "speed", "position", "vf", "learn", "stop", "clear"];
const COMMANDS: [Command; 8] = [
    Command::Stop(Stop::Coast),
    Command::Start(Mode::Torque),
    Command::Start(Mode::Speed),
    Command::Start(Mode::Position),
    Command::Start(Mode::VoltsPerHertz),
    Command::Start(Mode::Learning),
    Command::Stop(Stop::Ramp),
    Command::Clear,
];
/// Temperature of the heat sink at the start, degrees Celsius.
const AMBIENT: f64 = 25.0;

#[rustfmt::skip] // one a line
const INPUTS: &[Variable] = &[
    number("i_a", "A", "Current into phase a"),
    number("i_b", "A", "Current into phase b"),
    number("i_c", "A", "Current into phase c; without effect unless scales.sensors is low-side"),
    Variable { start: 311.0, ..number("dc_link", "V", "Voltage of the dc link") },
    Variable { start: AMBIENT, ..number("heat_sink", "degC", "Temperature of the heat sink") },
    number("encoder", "", "Count of the encoder, four a line, upwards when the rotor turns from phase a towards phase b"),
    choice("overcurrent", SWITCH, "Whether the power stage reports an over-current"),
    choice("mode", MODES, "Command, given when it changes: a mode to start in, off to coast, stop to stop by the ramp, clear to clear a fault"),
    number("reference", "", "Set-point of the mode: q-axis current, A peak; speed, rpm, also of vf; or position, turns"),
];

#[rustfmt::skip] // one a line
const OUTPUTS: &[Computed<Drive>] = &[
    (number("duty_a", "", "Duty of the high side of leg a in the next period, 0 to 1"), |d| d.duty(d.compare.a)),
    (number("duty_b", "", "Duty of the high side of leg b in the next period, 0 to 1"), |d| d.duty(d.compare.b)),
    (number("duty_c", "", "Duty of the high side of leg c in the next period, 0 to 1"), |d| d.duty(d.compare.c)),
    (choice("enabled", SWITCH, "Whether the outputs are on; if not, all six switches are off at once"), |d| d.compare.enabled.into()),
    (number("chopper", "", "Duty of the brake chopper, 0 to 1"), |d| d.output.chopper.into()),
    (choice("relay", SWITCH, "Whether the precharge relay is to be closed"), |d| d.output.relay.into()),
];

/// Description of the drive before it runs.
pub static KIND: Kind = Kind {
    name: "induction_drive",
    inputs: INPUTS,
    outputs: || {
        let mut outputs = variables(OUTPUTS);
        outputs.extend(SIGNALS.iter().map(|signal| Variable {
            reference: SIGNAL + u32::from(signal.id),
            ..number(signal.name, signal.unit(), "Signal as the drive records it")
        }));
        outputs
    },
    keys: || SETTINGS.iter().map(|it| (SETTING + u32::from(it.id), Key::Drive(it))).collect(),
    new: |config, _| Ok(Box::new(Drive::new(config)?)),
};

/// The drive, see the head of the module.
#[derive(Clone)]
struct Drive {
    settings: Settings,
    /// Largest compare value.
    top: f64,
    drive: drive_core::Drive,
    front_end: FrontEndState,
    state: drive_core::State,
    sample: Sample,
    compare: Compare,
    output: Output,
    /// Inputs of the last period.
    last: Vec<f64>,
}

impl Drive {
    fn new(config: &Config) -> Result<Self, String> {
        let drive = drive_core::Drive::new(built(&config.drive).map_err(|why| why.to_string())?);
        let last: Vec<_> = INPUTS.iter().map(|input| input.start).collect();
        let inverter = &config.drive.inverter;
        let heat_sink = config.drive.scales.ntc.code(AMBIENT as f32);
        Ok(Self {
            settings: config.drive,
            top: (inverter.top / inverter.switching_khz.pulses()).into(),
            state: drive.state(),
            drive,
            front_end: FrontEndState::default(),
            sample: Sample { heat_sink, ..Sample::default() },
            compare: Compare::OFF,
            output: Output::default(),
            last,
        })
    }

    fn duty(&self, compare: u16) -> f64 {
        f64::from(compare) / self.top
    }

    fn give(&mut self, name: &str, value: f64, command: &Command, say: &mut dyn FnMut(&str)) {
        match self.drive.command(command) {
            Err(why) => say(&format!("the drive refuses {name} = {value}: {why}")),
            Ok(Accepted::Limited(to)) => say(&format!("{name} = {value} is limited to {to}")),
            Ok(Accepted::AsGiven) => {}
        }
    }
}

/// ADC counts of a value in SI units.
fn counts(line: Line, value: f64) -> u16 {
    ((value - f64::from(line.offset)) / f64::from(line.gain) + 0.5) as u16
}

impl Model for Drive {
    fn output(&self, reference: u32) -> Option<f64> {
        if let Some((_, of)) = OUTPUTS.get(reference.checked_sub(OUTPUT)? as usize) {
            return Some(of(self));
        }
        let is = |signal: &Signal| SIGNAL + u32::from(signal.id) == reference;
        let place = SIGNALS.iter().position(is)?;
        let sampled = Sampled::new(&self.sample, self.state, self.drive.limiting());
        let telemetry = self.drive.telemetry();
        let values = shown(telemetry, &sampled, telemetry.rotor_freq);
        Some(SIGNALS[place].shown(values[place], &self.settings).into())
    }

    fn period(&mut self, inputs: &[f64], say: &mut dyn FnMut(&str)) {
        let &[a, b, c, dc_link, heat_sink, encoder, overcurrent, mode, reference] = inputs else {
            unreachable!("one value for each input")
        };
        let &[.., last_heat_sink, _, _, last_mode, last_reference] = &*self.last else {
            unreachable!("one value for each input")
        };
        self.last.copy_from_slice(inputs);
        let changed = mode != last_mode;
        let command = &COMMANDS[mode as usize];
        if changed {
            self.give("mode", mode, command, say);
        }
        if changed || reference != last_reference {
            let set_point: Option<fn(f32) -> Command> = match command {
                Command::Start(Mode::Torque) => Some(Command::Torque),
                Command::Start(Mode::Speed | Mode::VoltsPerHertz) => Some(Command::Speed),
                Command::Start(Mode::Position) => Some(Command::Position),
                _ => None,
            };
            if let Some(set_point) = set_point {
                self.give("reference", reference, &set_point(reference as f32), say);
            }
        }
        let scales = &self.settings.scales;
        self.sample.current_a = counts(scales.of_code(scales.current_a), a);
        self.sample.current_b = counts(scales.of_code(scales.current_b), b);
        if scales.sensors == CurrentSensors::LowSide {
            self.sample.current_c = counts(scales.current_c, c);
        }
        self.sample.dc_link = counts(scales.dc_link, dc_link);
        // Its characteristic takes as long as all the others.
        if heat_sink != last_heat_sink {
            self.sample.heat_sink = scales.ntc.code(heat_sink as f32);
        }
        self.sample.encoder = encoder as i64 as u32;
        self.sample.hardware.set(Hardware::BREAK, overcurrent != 0.0);
        (self.compare, self.output) =
            self.drive.period(&mut self.front_end, &self.sample, &mut |_| {});
        self.state = self.drive.state();
    }

    fn copy(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }
}

//! The FMU of the motor: inverter, motor, shaft and sensors, between timer and sensors of the drive.

use std::f64::consts::TAU;

use drive_core::io::PERIOD_S;
use drive_core::{Compare, Line, Output, Sample};
use drive_settings::{Scales, value::Words as _};
use motor_plant::{Load, Plant};
use sim_bench::config::{BENCH, Config, Key, LoadMode, check_model, open_phase, plant_settings};

use crate::model::{
    Computed, Kind, Model, OUTPUT, SETTING, SWITCH, Variable, choice, number, variables,
};

/// Groups of the simulator's keys that the motor has as settings.
const GROUPS: &str =
    "motor. saliency. plant flux_level iron. warming. inverter. dc_link. measurement.";

#[rustfmt::skip] // one a line
const INPUTS: &[Variable] = &[
    number("duty_a", "", "Duty of the high side of leg a, 0 to 1"),
    number("duty_b", "", "Duty of the high side of leg b, 0 to 1"),
    number("duty_c", "", "Duty of the high side of leg c, 0 to 1"),
    choice("enabled", SWITCH, "Whether the switches are driven; if not, all six are off"),
    number("chopper", "", "Duty of the brake chopper, 0 to 1"),
    choice("relay", SWITCH, "Whether the precharge relay is closed"),
    choice("shaft", LoadMode::WORDS, "Whether the shaft is locked, free against load, or held at shaft_speed"),
    number("load", "Nm", "Torque against a free shaft"),
    number("shaft_speed", "rpm", "Speed at which a dynamometer holds the shaft"),
    choice("in_turn", SWITCH, "Whether the master steps the drive first and the motor then, with the drive's new outputs; otherwise both step at once"),
    Variable { start: 1.0, ..number("seed", "", "Seed of the noise, read when the initialization ends") },
];

#[rustfmt::skip] // one a line
const OUTPUTS: &[Computed<Motor>] = &[
    (number("sensor_a", "A", "Current of phase a as its sensor and the ADC show it"), |m| m.current(m.scales.current_a, m.sample.current_a)),
    (number("sensor_b", "A", "Current of phase b as its sensor and the ADC show it"), |m| m.current(m.scales.current_b, m.sample.current_b)),
    (number("sensor_dc_link", "V", "Voltage of the dc link as its sensor and the ADC show it"), |m| m.scales.dc_link.at(m.sample.dc_link).into()),
    (number("heat_sink", "degC", "Temperature of the heat sink as its sensor shows it"), |m| m.heat_sink),
    (number("encoder", "", "Count of the encoder, four a line"), |m| m.sample.encoder.into()),
    (number("i_a", "A", "Current into phase a"), |m| m.plant.phase_currents()[0]),
    (number("i_b", "A", "Current into phase b"), |m| m.plant.phase_currents()[1]),
    (number("i_c", "A", "Current into phase c"), |m| m.plant.phase_currents()[2]),
    (number("torque", "Nm", "Electromagnetic torque"), |m| m.plant.torque()),
    (number("speed", "rpm", "Speed of the rotor"), |m| m.plant.mechanical_speed() * 60.0 / TAU),
    (number("turns", "turns", "Angle of the rotor from the start"), |m| m.plant.mechanical_angle() / TAU),
    (number("flux", "Wb", "Magnitude of the rotor flux, peak"), |m| m.plant.rotor_flux().norm()),
    (number("flux_angle", "deg", "Angle of the rotor flux in the stator frame, electrical"), |m| m.plant.rotor_flux_angle().to_degrees()),
    (number("dc_link", "V", "Voltage of the dc link"), |m| m.plant.dc_link()),
    (number("dc_current", "A", "Current from the dc link, mean of the last period"), |m| m.plant.dc_current(PERIOD_S.into())),
];

/// Description of the motor before it runs.
pub static KIND: Kind = Kind {
    name: "induction_motor",
    inputs: INPUTS,
    outputs: || variables(OUTPUTS),
    // They have no permanent numbers.
    keys: || {
        let keys = (SETTING..).zip(BENCH.iter().map(Key::Bench));
        let has = |key: Key| GROUPS.split(' ').any(|group| key.name().starts_with(group));
        keys.filter(|(_, key)| has(*key)).collect()
    },
    new: |config, inputs| Ok(Box::new(Motor::new(config, inputs)?)),
};

/// The motor, see the head of the module.
#[derive(Clone)]
struct Motor {
    plant: Plant,
    /// Scales of a drive that knows the sensors.
    scales: Scales,
    /// Largest compare value.
    top: f64,
    sample: Sample,
    /// Temperature of the heat sink, which is constant.
    heat_sink: f64,
    load: Option<Load>,
}

impl Motor {
    fn new(config: &Config, inputs: &[f64]) -> Result<Self, String> {
        check_model(config).map_err(|why| why.to_string())?;
        let (settings, scales) = (plant_settings(config), config.drive.scales);
        let seed = inputs.last().map_or(0, |seed| *seed as u64);
        let mut plant = Plant::new(&settings, seed).map_err(|why| why.to_string())?;
        plant.set_open_phase(open_phase(config)).map_err(|why| why.to_string())?;
        let top = f64::from(settings.inverter.timer_top / settings.inverter.pulses);
        let sample = plant.sample();
        let heat_sink = scales.ntc.celsius(sample.heat_sink).into();
        Ok(Self { plant, scales, top, sample, heat_sink, load: None })
    }

    fn current(&self, line: Line, counts: u16) -> f64 {
        self.scales.of_code(line).at(counts).into()
    }
}

impl Model for Motor {
    fn output(&self, reference: u32) -> Option<f64> {
        let (_, of) = OUTPUTS.get(reference.checked_sub(OUTPUT)? as usize)?;
        Some(of(self))
    }

    fn period(&mut self, inputs: &[f64], say: &mut dyn FnMut(&str)) {
        let &[a, b, c, enabled, chopper, relay, shaft, torque, rpm, in_turn, _] = inputs else {
            unreachable!("one value for each input")
        };
        let load = match LoadMode::at(shaft as usize) {
            LoadMode::Locked => Load::Locked,
            LoadMode::Free => Load::Free { torque },
            LoadMode::Speed => Load::Speed { speed: rpm * TAU / 60.0 },
        };
        if self.load.replace(load) != Some(load)
            && let Err(why) = self.plant.set_load(load)
        {
            say(&why.to_string());
        }
        let [a, b, c] = [a, b, c].map(|duty| (duty * self.top + 0.5) as u16);
        let compare = Compare { a, b, c, enabled: enabled != 0.0 };
        let relay = relay != 0.0;
        if in_turn != 0.0 {
            self.plant.period(&compare, &Output { chopper: chopper as f32, relay, duties: None });
        } else {
            self.plant.set_chopper(chopper);
            self.plant.set_relay(relay);
            self.plant.advance(&compare, PERIOD_S.into());
        }
        self.sample = self.plant.sample();
    }

    fn copy(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }
}

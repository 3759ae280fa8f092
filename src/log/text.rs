//! The text of the log.

use defmt::Display2Format;
use drive_core::io::PERIOD_S;
use drive_core::{Fault, Hardware};
use drive_settings::{Scales, Settings};

use super::Level;
use crate::board;
use crate::link::Status;

/// The log: its level, and the scales and pole pairs of the settings in force.
pub struct Log {
    /// How much is logged.
    pub level: Level,
    scales: (Scales, u8),
}

impl Log {
    /// The log of a drive with these settings.
    pub fn new(settings: &Settings) -> Self {
        Self { level: Level::Info, scales: (settings.scales, settings.motor.pole_pairs) }
    }

    /// Notes that the drive has taken these settings.
    pub fn configured(&mut self, settings: &Settings) {
        *self = Self { level: self.level, ..Self::new(settings) };
    }

    /// Logs a report of the control interrupt, and what has changed since the one `before`.
    pub fn report(&self, before: Option<&Status>, s: &Status) {
        if before.map(|status| status.state) != Some(s.state) {
            if let Some(fault) = s.state.fault() {
                if self.level >= Level::Error {
                    defmt::error!("fault {}: {}", fault.code(), fault.text());
                }
            } else if self.level >= Level::Info {
                defmt::info!("state: {}", Display2Format(&s.state));
            }
        }
        // An event that lasts is logged once.
        let known = before.map_or(Hardware::empty(), |status| status.hardware);
        if self.level >= Level::Warn {
            for (event, text) in [
                (Hardware::BREAK, "the power stage pulls the break input, or is not there"),
                (Hardware::ANALOG_WATCHDOG, "over-current at an ADC"),
                (Hardware::DEADLINE_MISS, "a control period took too long"),
                (Hardware::CONVERTER_OVERRUN, "a conversion was lost"),
                (Hardware::CHOPPER_OFF, "the chip has switched the brake chopper off"),
                (Hardware::CLOCK, Fault::WrongClock.text()),
                (Hardware::REFERENCE, Fault::WrongReference.text()),
            ] {
                if (s.hardware - known).intersects(event) {
                    defmt::warn!("{}", text);
                }
            }
        }
        let second = |status: &Status| status.periods / board::PWM_HZ;
        if self.level >= Level::Debug && before.is_none_or(|last| second(last) != second(s)) {
            let (scales, pole_pairs) = &self.scales;
            let rpm = s.telemetry.rotor_freq * (60.0 / PERIOD_S) / f32::from(*pole_pairs);
            defmt::debug!(
                "{}: i_d {} A, i_q {} A, speed {} rpm, dc link {} V, heat sink {} degC, {} cycles",
                Display2Format(&s.state),
                s.telemetry.current.d,
                s.telemetry.current.q,
                rpm,
                scales.dc_link.at(s.sample.dc_link),
                scales.ntc.celsius(s.sample.heat_sink),
                s.worst_cycles[0],
            );
        }
    }
}

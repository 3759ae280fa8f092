//! The speed of the shaft as the command arbiter knows it. While a drive without an encoder is off, nothing measures the speed. The last
//! measured speed is kept, marked as assumed, until the shaft must have come to rest.

use drive_core::{AngleSource, State};

use crate::link::Status;
use crate::settings::FirmwareSettings;

/// Speed at and below which a braked shaft counts as at rest, mechanical rpm.
const REST_RPM: f32 = 30.0;

/// The speed of the shaft, see the head of the module. After a reset the shaft may be rotating, so its speed is not known.
#[derive(Default)]
pub struct Shaft {
    /// Electrical speed, turns per control period.
    freq: f32,
    /// Whether the speed is known. Otherwise it is the last measured one, or, after a reset, none.
    known: bool,
    /// Whether the drive brakes, or stops after it has braked.
    braked: bool,
    measured_ms: u32,
    /// Periods and encoder count of the last report.
    counted: (u32, u32),
}

impl Shaft {
    /// Follows the reports of the drive. Called in each pass of the main loop; `now_ms` wraps.
    pub fn watch(&mut self, status: &Status, settings: &FirmwareSettings, now_ms: u32) {
        let rpm = self.rpm(settings).abs();
        let encoder = settings.drive.angle_source == AngleSource::Encoder;
        match status.state {
            State::Magnetising | State::Verifying | State::Position => self.braked = false,
            State::Torque | State::Speed | State::VoltsPerHertz => self.braked = false,
            State::Braking | State::BrakingByFrequency => self.braked = true,
            State::Stopping => {}
            State::Off | State::Fault(_) if encoder => {
                if let Some(freq) = self.counted(status, settings) {
                    (self.freq, self.measured_ms) = (freq, now_ms);
                }
                return self.known = true;
            }
            State::Off if self.braked && rpm <= REST_RPM => {
                return (self.freq, self.known) = (0.0, true);
            }
            State::Off | State::Fault(_) => {
                let passed = now_ms.wrapping_sub(self.measured_ms) as f32 * 1e-3;
                // Evaluated in each pass: a speed that is known once stays known.
                self.known |= passed >= settings.command.coasts_s;
                if self.known {
                    self.freq = 0.0;
                }
                return;
            }
            // The speed is being searched for, or nothing measures it.
            State::Calibrating | State::Precharge | State::CheckingWiring => return,
            State::FlyingStart | State::Exciting | State::Learning => return,
        }
        (self.freq, self.measured_ms) = (status.telemetry.rotor_freq, now_ms);
        // The speed counts as assumed, should the drive go off now.
        self.known = false;
        self.counted = (status.periods, status.sample.encoder);
    }

    /// The speed by the encoder since the previous report, if there is a new one.
    fn counted(&mut self, status: &Status, settings: &FirmwareSettings) -> Option<f32> {
        let (periods, count) =
            core::mem::replace(&mut self.counted, (status.periods, status.sample.encoder));
        let passed = status.periods.wrapping_sub(periods);
        let turns = status.sample.encoder.wrapping_sub(count) as i32 as f32
            / settings.drive.scales.encoder_counts as f32;
        let pole_pairs = f32::from(settings.drive.motor.pole_pairs);
        (passed > 0).then(|| turns * pole_pairs / passed as f32)
    }

    /// Speed, mechanical rpm, signed.
    pub fn rpm(&self, settings: &FirmwareSettings) -> f32 {
        let pole_pairs = f32::from(settings.drive.motor.pole_pairs);
        self.freq * (60.0 / drive_core::io::PERIOD_S) / pole_pairs
    }

    /// Electrical speed, turns per control period.
    pub fn freq(&self) -> f32 {
        self.freq
    }

    /// Whether the drive is off and does not know whether the shaft rotates.
    pub fn is_assumed(&self) -> bool {
        !self.known
    }
}

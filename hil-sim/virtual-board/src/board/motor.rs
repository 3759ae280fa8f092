//! The motor beside the chip: it moves with the time, gets the voltages, and is sampled.

use anyhow::{Result, anyhow};
use drive_core::{Compare, Sample};

use super::Board;
use crate::chip::{TICKS_PER_PERIOD, TICKS_PER_S};
use crate::periph::tim1::BadGates;
use induction_drive::board as firmware_board;

/// A change of the samples.
pub type Disturbance = Box<dyn FnMut(&mut Sample)>;

/// The power stage between the chip and the motor.
#[derive(Clone, Copy, Default)]
pub(super) struct PowerStage {
    /// Time up to which the motor has moved, ticks.
    pub at: u64,
    /// Compare values of this period.
    pub applied: Compare,
    /// Whether the outputs are on.
    pub outputs: bool,
    /// The last sample.
    pub sample: Sample,
}

impl Board {
    /// Lets the motor see the outputs as they are from now on.
    pub(super) fn follow_outputs(&mut self) {
        let chip = self.cpu.chip();
        let (on, now) = (chip.tim1.outputs_on(), chip.now);
        if on != self.stage.outputs {
            if on && !chip.gates_connected() {
                return; // the pins are not the timer's
            }
            self.advance_plant(now);
            self.stage.outputs = on;
            if !on {
                self.went_off = Some(now);
            }
        }
    }

    pub(super) fn advance_plant(&mut self, to: u64) {
        let compare = if self.stage.outputs {
            Compare { enabled: true, ..self.stage.applied }
        } else {
            Compare::OFF
        };
        while self.stage.at < to {
            // The plant divides the time that it is given into steps: a period at most.
            let ticks = (to - self.stage.at).min(TICKS_PER_PERIOD);
            self.plant.advance(&compare, ticks as f64 / TICKS_PER_S as f64);
            self.stage.at += ticks;
        }
    }

    /// The counter is at its top: a period of the motor ends, the converters hold their samples, and the
    /// compare values taken over are in force.
    pub(super) fn crest(&mut self, at: u64) -> Result<()> {
        self.advance_plant(at);
        self.stage.sample = self.plant.sample();
        if let Some(disturb) = &mut self.disturb {
            disturb(&mut self.stage.sample);
        }
        self.show_sample();
        let chip = self.cpu.chip_mut();
        let [a, b, c] = chip.tim1.in_force().map(|value| value as u16);
        self.stage.applied = Compare { a, b, c, enabled: true };
        if self.stage.outputs {
            match chip.tim1.check_gates(self.gates) {
                Err(BadGates::Pulse { .. }) if chip.forgiving => self.short_pulses += 1,
                checked => checked.map_err(|bad| anyhow!("bad gate signals: {bad:?}"))?,
            }
        }
        Ok(())
    }

    /// Shows the sample to converters, comparators and encoder.
    pub(super) fn show_sample(&mut self) {
        let s = self.stage.sample;
        let chip = self.cpu.chip_mut();
        let pins = [
            (0, firmware_board::ADC1_CHANNELS.0, s.current_a),
            (0, firmware_board::ADC1_CHANNELS.1, s.dc_link),
            (1, firmware_board::ADC2_CHANNELS.0, s.current_b),
            (1, firmware_board::ADC2_CHANNELS.1, s.heat_sink),
        ];
        for (converter, channel, code) in pins {
            chip.adc.inputs[converter][usize::from(channel)] = code;
        }
        chip.tim2.set_position(s.encoder);
        chip.compare(s.current_a, s.current_b, s.dc_link);
    }
}

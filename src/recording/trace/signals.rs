//! The signals that can be recorded.

use drive_core::io::PERIOD_S;
use drive_core::{Limiting, Line, Sample, State, Telemetry};
use drive_settings::{CurrentSensors, Settings};
use heapless::Vec;

/// A signal of a trace.
pub struct Signal {
    /// Permanent number, by which the signal has registers on the bus. No other signal ever gets it.
    pub id: u16,
    /// Name, which ends with the unit.
    pub name: &'static str,
}

/// Inputs and results of a control period that the [`Telemetry`] does not have; they are valid also while the drive is off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sampled {
    /// ADC counts of the current sensors a, b and c; c is 0 if there is no sensor.
    pub currents: [u16; 3],
    /// ADC counts of the thermistor.
    pub heat_sink: u16,
    /// 0 off, 1 starting, 2 running, 3 stopping, 100 + N in fault N.
    pub state: u8,
    /// Reason why the torque is smaller than requested: number of the [`Limiting`].
    pub limit: u8,
}

/// Added to the number of a fault in [`Sampled::state`].
pub const FAULT: u8 = 100;

impl Sampled {
    /// The signals of a control period with these samples that left the drive in this state.
    #[inline]
    pub fn new(read: &Sample, state: State, limiting: Limiting) -> Self {
        Self {
            currents: [read.current_a, read.current_b, read.current_c],
            heat_sink: read.heat_sink,
            state: state.fault().map_or(state.stage() as u8, |fault| FAULT + fault.code()),
            limit: limiting as u8,
        }
    }
}

impl Sampled {
    /// Whether the drive is off, with or without a fault.
    pub fn is_off(&self) -> bool {
        self.state == 0 || self.state >= FAULT
    }
}

impl Signal {
    /// Unit at the end of the name; empty if there is none.
    pub fn unit(&self) -> &'static str {
        self.name.rsplit_once('_').map_or("", |(_, unit)| unit)
    }

    /// The line from the recorded value to the unit of the name, with these settings. 0 if the sensor does not exist or its
    /// characteristic is not a line.
    pub fn line(&self, settings: &Settings) -> Line {
        let (scales, motor) = (&settings.scales, &settings.motor);
        let gain = match self.name {
            // Recorded in electrical turns per control period.
            "flux_hz" => 1.0 / PERIOD_S,
            "speed_rpm" => 60.0 / PERIOD_S / f32::from(motor.pole_pairs),
            // Recorded as the product of the two currents.
            "torque_nm" => motor.torque_per_ampere(1.0),
            // Recorded as ADC counts, shown without the offset that a start measures.
            "i_a_a" => return scales.of_code(scales.current_a),
            "i_b_a" => return scales.of_code(scales.current_b),
            "i_c_a" if scales.sensors == CurrentSensors::LowSide => return scales.current_c,
            "i_c_a" | "heat_sink_c" => 0.0,
            _ => 1.0,
        };
        Line { gain, offset: 0.0 }
    }

    /// The recorded value in the unit of the name.
    pub fn shown(&self, value: f32, settings: &Settings) -> f32 {
        if self.name == "heat_sink_c" {
            return settings.scales.ntc.celsius(value as u16);
        }
        let Line { gain, offset } = self.line(settings);
        gain * value + offset
    }
}

/// A value for each of the [`SIGNALS`].
pub type Values = [f32; SIGNALS.len()];

/// The signals, each with its permanent number (a new one takes the next of `tests/numbers.txt`) and its value as it is recorded.
macro_rules! signals {
    (|$t:ident, $s:ident| $($id:literal: $name:literal = $value:expr,)+) => {
        /// Signals that can be recorded. The names end with the unit.
        pub const SIGNALS: &[Signal] = &[$(Signal { id: $id, name: $name }),+];

        /// The values of all signals as they are recorded. All are computed at once, because the choice of one by its index costs more
        /// than its value.
        pub fn values($t: &Telemetry, $s: &Sampled) -> Values {
            [$($value),+]
        }
    };
}

signals! { |t, s|
    0: "phi_deg" = t.phi.to_bits() as f32 * (180.0 / 2_147_483_648.0),
    1: "flux_hz" = t.flux_freq,
    2: "speed_rpm" = t.rotor_freq,
    3: "i_d_ref_a" = t.reference.d,
    4: "i_q_ref_a" = t.reference.q,
    5: "i_d_a" = t.current.d,
    6: "i_q_a" = t.current.q,
    7: "v_d_v" = t.voltage.d,
    8: "v_q_v" = t.voltage.q,
    9: "delta_i_a" = t.delta_i,
    10: "saliency" = t.saliency,
    11: "dc_link_v" = t.dc_link,
    12: "turns" = t.turns,
    13: "i_a_a" = s.currents[0].into(),
    14: "i_b_a" = s.currents[1].into(),
    15: "i_c_a" = s.currents[2].into(),
    16: "torque_nm" = t.current.d * t.current.q,
    17: "heat_sink_c" = s.heat_sink.into(),
    18: "state" = s.state.into(),
    19: "limit" = s.limit.into(),
}

/// Index of the speed, and of the signals of flux, current, voltage and torque.
const SPEED: usize = 2;
const ENERGISED: [usize; 9] = [1, 3, 4, 5, 6, 7, 8, 9, 16];

/// The values as they are shown. A drive that is off has no current and no torque, whatever its last step measured, and the shaft has
/// this speed, electrical turns per control period.
pub fn shown(telemetry: &Telemetry, sampled: &Sampled, shaft: f32) -> Values {
    let mut values = values(telemetry, sampled);
    if sampled.is_off() {
        ENERGISED.iter().for_each(|index| values[*index] = 0.0);
        values[SPEED] = shaft;
    }
    values
}

/// Index of the signal with this name.
pub fn find(name: &str) -> Option<u8> {
    SIGNALS.iter().position(|signal| signal.name == name).map(|index| index as u8)
}

/// Most signals in one record.
pub const MOST: usize = 8;

/// One record: the values of a [`SignalChoice`], in its order.
pub type Record = [f32; MOST];

/// The signals of a trace, in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignalChoice {
    /// Indices into [`SIGNALS`].
    signals: Vec<u8, MOST>,
}

impl SignalChoice {
    /// No signal.
    pub const fn none() -> Self {
        Self { signals: Vec::new() }
    }

    /// The default: angle, currents and their references, voltages, saliency, position.
    pub fn usual() -> Self {
        Self { signals: [0, 5, 6, 4, 7, 8, 9, 12].into_iter().collect() }
    }

    /// Adds a signal by its index; `false` if no more signals fit.
    pub fn add(&mut self, signal: u8) -> bool {
        self.signals.push(signal).is_ok()
    }

    /// The signals.
    pub fn signals(&self) -> impl Iterator<Item = &'static Signal> {
        self.signals.iter().filter_map(|signal| SIGNALS.get(usize::from(*signal)))
    }

    /// Writes the values of the chosen signals, taken from those of all signals.
    pub fn record(&self, record: &mut Record, values: &Values) {
        for (place, signal) in record.iter_mut().zip(&self.signals) {
            if let Some(value) = values.get(usize::from(*signal)) {
                *place = *value;
            }
        }
    }
}

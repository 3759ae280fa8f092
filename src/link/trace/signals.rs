//! The signals that can be recorded.

use drive_core::io::PERIOD_S;
use drive_core::{Line, Telemetry};
use drive_settings::{CurrentSensors, Settings};
use heapless::Vec;

/// A signal of a trace.
pub struct Signal {
    /// Name, which ends with the unit.
    pub name: &'static str,
    /// Its name in earlier firmware.
    old: &'static str,
    unit: Unit,
}

/// Unit that a signal is recorded in.
enum Unit {
    /// That of its name.
    Named,
    /// Electrical turns per control period, shown in Hz.
    Frequency,
    /// Electrical turns per control period, shown in mechanical rpm.
    Speed,
    /// Code of a current sensor, shown in A without the offset that a start measures.
    Sensor(usize),
}

/// Codes of the current sensors a, b and c, also while the drive is off; c is 0 where there is none.
pub type CurrentCodes = [u16; 3];

impl Signal {
    const fn new(name: &'static str, old: &'static str) -> Self {
        Self { name, old, unit: Unit::Named }
    }

    /// The unit that the name ends with; empty if there is none.
    pub fn unit(&self) -> &'static str {
        self.name.rsplit_once('_').map_or("", |(_, unit)| unit)
    }

    /// The line from the recorded value to the unit of the name, with these settings; 0 for a sensor that there is not.
    pub fn line(&self, settings: &Settings) -> Line {
        let scales = &settings.scales;
        let gain = match self.unit {
            Unit::Named => 1.0,
            Unit::Frequency => 1.0 / PERIOD_S,
            Unit::Speed => 60.0 / PERIOD_S / f32::from(settings.motor.pole_pairs),
            Unit::Sensor(0) => return scales.of_code(scales.current_a),
            Unit::Sensor(1) => return scales.of_code(scales.current_b),
            Unit::Sensor(_) if scales.sensors == CurrentSensors::LowSide => {
                return scales.current_c;
            }
            Unit::Sensor(_) => 0.0,
        };
        Line { gain, offset: 0.0 }
    }

    /// The recorded value in the unit of the name.
    pub fn shown(&self, value: f32, settings: &Settings) -> f32 {
        let Line { gain, offset } = self.line(settings);
        gain * value + offset
    }
}

/// Signals that can be recorded. The names end with the unit; a name of earlier firmware is understood, too.
pub const SIGNALS: [Signal; 16] = [
    Signal::new("phi_deg", ""),
    Signal { name: "flux_hz", old: "flux_step", unit: Unit::Frequency },
    Signal { name: "speed_rpm", old: "rotor_step", unit: Unit::Speed },
    Signal::new("i_d_ref_a", "i_d_ref"),
    Signal::new("i_q_ref_a", "i_q_ref"),
    Signal::new("i_d_a", "i_d"),
    Signal::new("i_q_a", "i_q"),
    Signal::new("v_d_v", "v_d"),
    Signal::new("v_q_v", "v_q"),
    Signal::new("delta_i_a", "delta_i"),
    Signal::new("saliency", ""),
    Signal::new("dc_link_v", "dc_link"),
    Signal::new("turns", ""),
    Signal { name: "i_a_a", old: "i_a", unit: Unit::Sensor(0) },
    Signal { name: "i_b_a", old: "i_b", unit: Unit::Sensor(1) },
    Signal { name: "i_c_a", old: "i_c", unit: Unit::Sensor(2) },
];

/// Index of the signal with this name.
pub fn find(name: &str) -> Option<u8> {
    let known = |signal: &Signal| signal.name == name || (signal.old == name && !name.is_empty());
    SIGNALS.iter().position(known).map(|index| index as u8)
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

    /// The default: angle, currents and their reference, voltages, saliency, position.
    pub fn usual() -> Self {
        Self { signals: [0, 5, 6, 4, 7, 8, 9, 12].into_iter().collect() }
    }

    /// Adds a signal by its index; `false` if there is no room for it.
    pub fn add(&mut self, signal: u8) -> bool {
        self.signals.push(signal).is_ok()
    }

    /// The signals.
    pub fn signals(&self) -> impl Iterator<Item = &'static Signal> {
        self.signals.iter().filter_map(|signal| SIGNALS.get(usize::from(*signal)))
    }

    /// Writes the values of the signals.
    pub fn record(&self, record: &mut Record, t: &Telemetry, codes: &CurrentCodes) {
        let values = values(t, codes);
        for (place, signal) in record.iter_mut().zip(&self.signals) {
            *place = values.get(usize::from(*signal)).copied().unwrap_or(0.0);
        }
    }
}

/// The values of all signals as they are recorded. All at once: the choice of one by its index costs more than its value.
pub(super) fn values(t: &Telemetry, codes: &CurrentCodes) -> [f32; SIGNALS.len()] {
    let (phi, [a, b, c]) =
        (t.phi.to_bits() as f32 * (180.0 / 2_147_483_648.0), codes.map(f32::from));
    let (r, i, v) = (t.reference, t.current, t.voltage);
    let (flux, rotor) = (t.flux_freq, t.rotor_freq);
    [
        phi, flux, rotor, r.d, r.q, i.d, i.q, v.d, v.q, t.delta_i, t.saliency, t.dc_link, t.turns,
        a, b, c,
    ]
}

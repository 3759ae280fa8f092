//! The signals that can be recorded.

use drive_core::Telemetry;
use drive_core::io::PERIOD_S;
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
}

impl Signal {
    const fn new(name: &'static str, old: &'static str) -> Self {
        Self { name, old, unit: Unit::Named }
    }

    /// The unit that the name ends with; empty if there is none.
    pub fn unit(&self) -> &'static str {
        self.name.rsplit_once('_').map_or("", |(_, unit)| unit)
    }

    /// Factor from the recorded value to the unit of the name, for a motor with these pole pairs.
    pub fn factor(&self, pole_pairs: u8) -> f32 {
        match self.unit {
            Unit::Named => 1.0,
            Unit::Frequency => 1.0 / PERIOD_S,
            Unit::Speed => 60.0 / PERIOD_S / f32::from(pole_pairs),
        }
    }
}

/// Signals that can be recorded. The names end with the unit; a name of earlier firmware is understood, too.
pub const SIGNALS: [Signal; 13] = [
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

    /// Values of the signals.
    pub fn values(&self, t: &Telemetry) -> Record {
        let mut record = [0.0; MOST];
        for (place, signal) in record.iter_mut().zip(&self.signals) {
            *place = value(*signal, t);
        }
        record
    }
}

/// The value of a signal as it is recorded.
pub(super) fn value(signal: u8, t: &Telemetry) -> f32 {
    match signal {
        0 => t.phi.to_bits() as f32 * (180.0 / 2_147_483_648.0),
        1 => t.flux_freq,
        2 => t.rotor_freq,
        3 => t.reference.d,
        4 => t.reference.q,
        5 => t.current.d,
        6 => t.current.q,
        7 => t.voltage.d,
        8 => t.voltage.q,
        9 => t.delta_i,
        10 => t.saliency,
        11 => t.dc_link,
        _ => t.turns,
    }
}

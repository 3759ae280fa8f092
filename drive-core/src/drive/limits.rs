//! The chain of limits of the torque current, with the reason of the one that acts.

use super::{Drive, End, Phase};
use crate::current::voltage_limit::VoltageLimitState;
use crate::dc_link::{DcLinkLimits, DcLinkState, Limiting};
use crate::drive::coefficients::Coefficients;
use crate::io::Measured;
use crate::protect::thermal::{Thermal, ThermalLoads};

/// Control period of those between two steps of the thermal loads in which the limits by heat are found.
const HEAT_AT: u32 = Thermal::EVERY / 2;

/// Limits of the torque current. What the brake resistor has taken outlives a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    pub dc_link: DcLinkState,
    pub voltage: VoltageLimitState,
    /// Present limits, by dc link, voltage and heat together.
    pub now: DcLinkLimits,
    /// Why the torque current is smaller than asked for.
    pub why: Limiting,
    /// Torque current that heat sink, motor or inverter does not bear, of the largest of all, A, and which of them.
    pub too_hot_for: f32,
    pub too_hot: Limiting,
}

impl Limits {
    pub fn start(&mut self, c: &Coefficients) {
        let voltage = c.voltage_limit.start();
        *self = Self { voltage, now: DcLinkLimits::default(), why: Limiting::No, ..*self };
        self.now.i_q = (-voltage.most.q, voltage.most.q);
    }

    /// Finds the torque current that heat sink, motor and inverter do not bear; `heat_sink` is the share of the current that
    /// the first bears, `i_d` the direct current, A.
    pub fn heat(&mut self, c: &Coefficients, thermal: &ThermalLoads, heat_sink: f32, i_d: f32) {
        let heat_sink = heat_sink.clamp(0.0, 1.0);
        let (heat_sink, loads) = ((heat_sink * heat_sink, Limiting::HeatSink), thermal.share());
        let (share, why) = if loads.0 < heat_sink.0 { loads } else { heat_sink };
        (self.too_hot_for, self.too_hot) = if share < 1.0 {
            let largest = c.protection.i_q;
            let square = share * largest * largest - i_d * i_d;
            (largest - if square > 0.0 { fpu_sqrt::sqrtf(square) } else { 0.0 }, why)
        } else {
            (0.0, Limiting::No)
        };
    }

    /// The torque current within the limits, A.
    pub fn hold(&mut self, i_q: f32) -> f32 {
        let (held, why) = self.now.hold(i_q);
        self.why = why;
        held
    }

    /// Takes the dc link and the speed of the rotor, electrical turns per period, of a carrier period, with the limit by
    /// the voltage, A.
    pub fn step(
        &mut self,
        c: &Coefficients,
        dc_link: f32,
        rotor_freq: f32,
        (by_voltage, why): (f32, Limiting),
    ) {
        let by_heat = c.protection.i_q - self.too_hot_for;
        let most = if by_heat < by_voltage { (by_heat, self.too_hot) } else { (by_voltage, why) };
        self.now = c.dc_link.step(&mut self.dc_link, dc_link, rotor_freq, most);
    }
}

impl Drive {
    /// Whether the dc link is charged: a relay that there is has closed.
    pub(super) fn is_charged(&self) -> bool {
        self.c.relay.is_none() || self.kept.relay.closed
    }

    /// Adds the current of the last periods to the thermal loads, and finds the current that heat sink, motor and inverter
    /// bear; in every state.
    pub(super) fn watch_load(&mut self, measured: &Measured) -> Result<(), End> {
        let k = &mut self.kept;
        match k.elapsed % Thermal::EVERY {
            0 => {}
            HEAT_AT => {
                let i_d = k.references.current.d;
                k.limits.heat(&self.c, &k.thermal, measured.heat_sink, i_d);
                return Ok(());
            }
            _ => return Ok(()),
        }
        let on = self.is_energised();
        let k = &mut self.kept;
        let square = if on { k.seen.current.length_squared() } else { 0.0 };
        let borne = self.c.thermal.step(&mut k.thermal, square);
        // Off it cools, and is not judged.
        if on {
            Ok(borne?)
        } else {
            self.c.dc_link.rest(&mut k.limits.dc_link, Thermal::EVERY);
            Ok(())
        }
    }

    /// Why the torque is smaller than asked for.
    pub fn limiting(&self) -> Limiting {
        match &self.phase {
            Phase::Field(field) if field.has_torque() => self.kept.limits.why,
            Phase::Scalar(_) => self.kept.limits.why,
            Phase::Field(_) | Phase::Off(_) | Phase::Fault(..) => Limiting::No,
            Phase::Prepare(_) | Phase::Excite(_) => Limiting::No,
        }
    }
}

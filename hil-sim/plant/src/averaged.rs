//! One PWM period with the voltages of the inverter averaged over it.
//!
//! The smoothed sign of a phase current has kinks at two currents, ±20 mA by default. Between the kinks the equations
//! are smooth and few integration steps are enough, but a step across a kink would cost accuracy. A step that is about
//! to take a phase current across a kink is therefore cut there.

use crate::complex::{Complex, clarke, phases};
use crate::integrate::MotorModel;
use crate::model::{ElectricalRate as _, ElectricalState as _, MachineModel};
use crate::terminals::{Source, Terminals};

/// Shortest part of a step after it has been cut.
const SHORTEST: f64 = 1.0 / 16.0;

/// Sign of a phase current, smoothed linearly up to a current of either sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SmoothSign {
    /// The current of the kink, A, and its inverse.
    pub kink: f64,
    inverse: f64,
}

impl SmoothSign {
    pub(crate) fn new(kink: f64) -> Self {
        Self { kink, inverse: 1.0 / kink }
    }

    #[inline]
    pub(crate) fn of(&self, i: f64) -> f64 {
        (i * self.inverse).clamp(-1.0, 1.0)
    }
}

/// Averages of one period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Averaged {
    /// Line-to-neutral voltage without errors.
    pub v: Complex,
    /// Voltage that each leg loses with a positive current, V.
    pub lost: [f64; 3],
    /// Voltage that each leg gains with a negative current, V.
    pub gained: [f64; 3],
    /// The part of both that does not come from the dead time, V.
    pub residual: f64,
    /// Inverse of the current that just charges the node of a leg within the dead time, 1/A; 0 without capacitance.
    pub inverse_knee: f64,
    pub sign: SmoothSign,
    /// Resistance of a conducting switch, ohm.
    pub on_resistance: f64,
    /// Further resistance of each phase, ohm.
    pub resistances: [f64; 3],
}

impl Averaged {
    /// Whether the switches have neither capacitance nor resistance, and the phases are alike.
    pub(crate) fn ideal(&self) -> bool {
        self.inverse_knee == 0.0 && self.on_resistance == 0.0 && self.resistances == [0.0; 3]
    }
}

/// Share of the full dead-time error at a current `y`, in units of the current that just charges the node within the
/// dead time. The share is `y/2` if the leg still swings at the end of the dead time, and `1 - 1/(2 y)` if it arrives
/// before the end.
#[inline]
fn swung(y: f64) -> f64 {
    let inverse = 1.0 / y.abs().max(1.0);
    y * inverse * (1.0 - 0.5 * inverse)
}

impl Source for Averaged {
    #[inline(always)]
    fn voltage(&self, i: Complex) -> Complex {
        let currents = phases(i);
        let error = |k: usize| {
            let sign = self.sign.of(currents[k]);
            sign * if sign > 0.0 { self.lost[k] } else { self.gained[k] }
        };
        self.v - clarke([error(0), error(1), error(2)])
    }
}

/// An inverter with node capacitance and switch resistance, connected to phases whose resistances differ.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RealSwitches(pub Averaged);

impl Source for RealSwitches {
    #[inline(always)]
    fn voltage(&self, i: Complex) -> Complex {
        let legs = &self.0;
        let currents = phases(i);
        let signs = currents.map(|i| legs.sign.of(i));
        let shares = match legs.inverse_knee {
            0.0 => signs,
            inverse_knee => currents.map(|i| swung(i * inverse_knee)),
        };
        let error = |k: usize| {
            let size = if signs[k] > 0.0 { legs.lost[k] } else { legs.gained[k] };
            shares[k] * (size - legs.residual)
                + signs[k] * legs.residual
                + currents[k] * legs.resistances[k]
        };
        legs.v - i * legs.on_resistance - clarke([error(0), error(1), error(2)])
    }
}

/// Integrates over `h` seconds, in parts between the kinks. Returns the terminal voltage integrated over them, V s.
#[inline]
pub(crate) fn step<M: MachineModel>(
    terminals: &impl Terminals,
    motor: &mut MotorModel<M>,
    h: f64,
    kink: f64,
) -> Complex {
    let mut rest = h;
    let mut volt_seconds = Complex::ZERO;
    loop {
        let first = motor.rates(terminals);
        let i = motor.state.electrical.current();
        let part = match until_kink(i, first.0.current_rate(), rest, kink) {
            None => rest,
            Some(time) => time.max(SHORTEST * h).min(rest),
        };
        volt_seconds += motor.advance_from(first, terminals, part) * part;
        if part >= rest {
            return volt_seconds;
        }
        rest -= part;
    }
}

/// Time until the first phase current crosses a kink; none if no current does within `h` seconds at this rate.
#[inline]
fn until_kink(i: Complex, rate: Complex, h: f64, kink: f64) -> Option<f64> {
    let (now, later) = (phases(i), phases(i + rate * h));
    // The piece between the kinks on which a current lies.
    let piece = |i: f64| (i > -kink, i > kink);
    if (0..3).all(|k| piece(now[k]) == piece(later[k])) {
        return None;
    }
    let rates = phases(rate);
    let times = (0..3).flat_map(|k| [-kink, kink].map(|kink| (kink - now[k]) / rates[k]));
    Some(times.filter(|t| *t > 0.0).fold(h, f64::min))
}

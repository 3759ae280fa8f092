//! Lock monitor: checks in every carrier period that the tracked angle is that of the flux.
//!
//! The tracker uses only the saliency component across the injection axis (`q`,
//! [`crate::carrier::synchronous`]) and drives it to its reference. The reference is also met when the flux
//! has decayed, or turns under the axis too fast to be followed. A false lock ends in this condition:
//! current in the wrong direction lets the flux decay, and with it the saliency that would pull the axis
//! back.
//!
//! The other component changes the amplitude of the carrier current along the axis, which the demodulation
//! provides as well. With the saliency vector `s` in the estimated flux frame,
//!
//! ```text
//! |C| ~ 1 - Re s     q ~ Im s     s = a f e^(2 j e) + (current-dependent part)
//! loss = (1 - |C|^2 / |C|_ref^2) (-1/k) = 1 - f cos 2e                 k = 2a
//! ```
//!
//! (a of either sign, fixed to the flux; e the angle error, f = 1 at nominal flux). The loss is 0 at the true angle, 1
//! without flux, 2 at an error of 90°, and averages to 1 when the flux turns under the axis. Resistances,
//! dead time and speed hardly influence it, and no perturbation is needed. The voltage equation does not
//! help at low speed: a wrong angle changes it by less than 1 V, while the dead time alone leaves 2 V.
//!
//! The unit is the learned slope k at the torque current, at most 2.5 times that without current: on a motor of iron it is
//! the slope, not the saliency seen at rest, that says how much |C| changes. Both signs of the loss are wrong. Too much flux
//! gives a negative loss with a negative slope. With a positive slope, of a motor whose main flux saturates, a flux that is gone
//! reads some -0.45: the chord inductance across the flux falls back to the unsaturated one, and that outweighs the lost
//! saliency. So the limits depend on the sign of the slope.
//!
//! While the torque current moves, the tables are those of another current, and the loss is not judged: for 12 carrier
//! periods after a move, but at most 40 % of the time, so that a command that never rests does not blind the monitor.
//!
//! An error of 180° gives no loss by symmetry, but the current does not maintain it: the flux decays through
//! zero to the true sign, or the loss is detected on the way.
//!
//! `|C|_ref` is the carrier current measured during magnetisation, when the direction of the flux is known,
//! times a learned even function of i_q.

use crate::carrier::Saliency;
use crate::fault::Fault;
use crate::learned::Learned;
use crate::settings::table::{CarrierTable, Grid, POINTS, SlopeTable, between};

/// Coefficients of the monitor.
///
/// ```
/// use drive_core::carrier::Saliency;
/// use drive_core::fault::Fault;
/// use drive_core::protect::lock_monitor::{LockMonitor, LockMonitorSettings, LockMonitorState};
/// use drive_core::settings::table::{CarrierTable, Grid, SlopeTable};
///
/// let settings = LockMonitorSettings {
///     slope: SlopeTable::of_flux_saliency(Grid::REFERENCE, -0.035),
///     smoothing_s: 0.12,
///     allowed: 0.55,
///     carrier_a: 0.26,
///     moved_a: 0.03,
///     standing_freq: 1e-4,
///     period_s: 1.0 / 600.0,
/// };
/// let monitor = LockMonitor::new(&CarrierTable::default(), &settings);
/// let mut state = LockMonitorState::default();
/// let carrier = |a: f32| Saliency { q: 0.0, carrier_squared: a * a, i_q: 0.0 };
/// for _ in 0..600 {
///     monitor.step(&mut state, &carrier(0.26), 1.0, true).unwrap(); // baseline while magnetising
/// }
/// // Without flux the carrier current falls by the saliency: 3.5 %.
/// let gone = carrier(0.26 * (1.0 - 0.035));
/// assert!(monitor.step(&mut state, &gone, 1.0, false).is_ok());
/// let mut after = (0..90).map(|_| monitor.step(&mut state, &gone, 1.0, false));
/// assert!(after.any(|result| result == Err(Fault::LostLock)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LockMonitor {
    /// Torque currents of the carrier table.
    grid: Grid,
    /// 1 / ratio^2 of the carrier table.
    inverse_square: [f32; POINTS],
    /// Loss per relative change of the squared carrier current, -1/k.
    per_change: [f32; POINTS],
    /// Share of the newest value in the mean loss.
    smoothing: f32,
    /// Share of the newest value in the mean baseline.
    baseline_smoothing: f32,
    /// Allowed loss, and whether the slope is positive, which gives the other limit.
    allowed: f32,
    is_positive: bool,
    /// Change of the torque current in a carrier period that counts as a move, A.
    moved: f32,
    /// Square of the minimum carrier current, A^2.
    least: f32,
    /// Electrical speed below which the shaft counts as standing, turns per control period.
    standing: f32,
}

/// Settings of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LockMonitorSettings {
    /// Slope of the saliency, on the grid of the carrier table.
    pub slope: SlopeTable,
    /// Time constant of the mean loss, s.
    pub smoothing_s: f32,
    /// Allowed mean loss; 1 corresponds to zero flux.
    pub allowed: f32,
    /// Expected carrier current along the injection axis, A peak.
    pub carrier_a: f32,
    /// Change of the torque current in a carrier period that counts as a move, A.
    pub moved_a: f32,
    /// Electrical speed below which the shaft counts as standing, turns per control period.
    pub standing_freq: f32,
    /// Interval of the monitor's steps, s: the carrier period.
    pub period_s: f32,
}

/// State of the monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LockMonitorState {
    /// Mean squared carrier current at i_q = 0, A^2.
    pub baseline: f32,
    /// 1 / `baseline`; 0 until it is first needed.
    per_baseline: f32,
    /// Mean loss.
    pub loss: f32,
    /// Torque current of the last carrier period, A.
    i_q: f32,
    /// Carrier periods for which it has rested.
    rested: u8,
    /// Rest that it may still take; see [`REST`].
    allowance: u8,
    /// Consecutive carrier periods with too little carrier current.
    weak: u8,
}

/// Time constant of the baseline mean, s: noise of 5 mA causes 0.1 % of error in it, 0.03 in the loss.
const BASELINE_S: f32 = 0.1;
/// Minimum carrier current as a share of the expected one. With an open phase the carrier current is
/// reduced by the squared cosine of the angle between the injection axis and the remaining current axis.
const LEAST_CARRIER: f32 = 0.5;
/// Consecutive weak carrier periods until the fault. The averages of the demodulation need four to fill.
const WEAK_PERIODS: u8 = 8;

/// Allowed negative loss, with a negative and with a positive slope.
const ALLOWED_GAIN: [f32; 2] = [0.6, 0.3];
/// Largest unit relative to that without torque current.
const MOST_UNIT: f32 = 2.5;
/// Carrier periods of rest after a move.
const REST: u8 = 12;
/// Allowance for rest: each resting carrier period takes 3, each other one gives 2 up to the largest. So it is 40 % of the
/// time at most, and 24 carrier periods at once.
const ALLOWANCE: (u8, u8, u8) = (3, 2, 72);

fn per_change(slope: &SlopeTable) -> [f32; POINTS] {
    slope.inverses(MOST_UNIT).map(|inverse| -inverse)
}

fn inverse_square(table: &CarrierTable) -> [f32; POINTS] {
    table.points().map(|r| 1.0 / (r * r))
}

impl LockMonitor {
    /// Monitor with the carrier current over i_q of `table`.
    pub fn new(table: &CarrierTable, s: &LockMonitorSettings) -> Self {
        let least = LEAST_CARRIER * s.carrier_a;
        Self {
            grid: table.grid(),
            inverse_square: inverse_square(table),
            per_change: per_change(&s.slope),
            is_positive: s.slope.at_rest() > 0.0,
            moved: s.moved_a,
            smoothing: s.period_s / (s.smoothing_s + s.period_s),
            baseline_smoothing: s.period_s / BASELINE_S,
            allowed: s.allowed,
            least: least * least,
            standing: s.standing_freq,
        }
    }

    /// Takes an accepted result of a learning.
    pub fn take(&mut self, learned: &Learned) {
        if let (Some(carrier), Some(slope)) = (&learned.carrier, &learned.slope) {
            (self.grid, self.inverse_square) = (carrier.grid(), inverse_square(carrier));
            (self.per_change, self.is_positive) = (per_change(slope), slope.at_rest() > 0.0);
        }
    }

    /// Evaluates one carrier period.
    ///
    /// `per_share_squared` is 1 / (share of the carrier amplitude in use)^2. While the axis is `held` by something else than
    /// the injection (magnetisation, or the observer), the flux lies along it, and the baseline is measured.
    ///
    /// Returns the relative deviation of the squared carrier current from the expected one, where it was judged.
    ///
    /// # Errors
    /// [`Fault::CarrierWeak`] after eight consecutive carrier periods with too little carrier current at any
    /// angle; [`Fault::LostLock`] when the mean loss exceeds the allowed one.
    pub fn step(
        &self,
        state: &mut LockMonitorState,
        saliency: &Saliency,
        per_share_squared: f32,
        held: bool,
    ) -> Result<Option<f32>, Fault> {
        let carrier = saliency.carrier_squared * per_share_squared;
        state.weak = if carrier >= self.least { 0 } else { state.weak.saturating_add(1) };
        if state.weak >= WEAK_PERIODS {
            return Err(Fault::CarrierWeak);
        }
        if held {
            let place = self.grid.place(saliency.i_q);
            let carrier = carrier * between(&self.inverse_square, place);
            let share = if state.baseline == 0.0 { 1.0 } else { self.baseline_smoothing };
            state.baseline += share * (carrier - state.baseline);
            *state = LockMonitorState {
                baseline: state.baseline,
                weak: state.weak,
                i_q: saliency.i_q,
                rested: REST,
                allowance: ALLOWANCE.2,
                ..LockMonitorState::default()
            };
            return Ok(None);
        }
        if state.per_baseline == 0.0 {
            state.per_baseline = 1.0 / state.baseline;
        }
        if self.rests(state, saliency.i_q) {
            return Ok(None);
        }
        let place = self.grid.place(saliency.i_q);
        let deviation = carrier * state.per_baseline * between(&self.inverse_square, place) - 1.0;
        let loss = -deviation * between(&self.per_change, place);
        state.loss += self.smoothing * (loss - state.loss);
        let least = -ALLOWED_GAIN[usize::from(self.is_positive)];
        // NaN fails the comparisons.
        let right = state.loss <= self.allowed && state.loss >= least;
        if right { Ok(Some(deviation)) } else { Err(Fault::LostLock) }
    }

    /// Whether the torque current `i_q`, A, has just moved, so that the loss is not judged.
    fn rests(&self, state: &mut LockMonitorState, i_q: f32) -> bool {
        let moved = (i_q - state.i_q).abs() > self.moved;
        state.i_q = i_q;
        state.rested = if moved { 0 } else { state.rested.saturating_add(1) };
        let (takes, gives, most) = ALLOWANCE;
        let rests = state.rested < REST && state.allowance >= takes;
        state.allowance =
            if rests { state.allowance - takes } else { (state.allowance + gives).min(most) };
        rests
    }

    /// Whether the electrical speed `rotor_freq`, turns per control period, counts as standstill.
    pub fn is_standstill(&self, rotor_freq: f32) -> bool {
        rotor_freq.abs() <= self.standing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nominal 0.26 A of carrier, 120 ms, with the slope of a saliency `a` that is fixed to the flux.
    fn monitor_of(a: f32) -> LockMonitor {
        LockMonitor::new(
            &CarrierTable::default(),
            &LockMonitorSettings {
                slope: SlopeTable::of_flux_saliency(Grid::REFERENCE, a),
                smoothing_s: 0.12,
                allowed: 0.55,
                carrier_a: 0.26,
                moved_a: 0.03,
                standing_freq: 1e-4,
                period_s: 1.0 / 600.0,
            },
        )
    }

    fn monitor() -> LockMonitor {
        monitor_of(-0.035)
    }

    fn seen(carrier_a: f32, i_q: f32) -> Saliency {
        Saliency { q: 0.0, carrier_squared: carrier_a * carrier_a, i_q }
    }

    /// A state with the baseline taken at 0.27 A.
    fn ready(monitor: &LockMonitor) -> LockMonitorState {
        let mut state = LockMonitorState::default();
        for _ in 0..600 {
            assert_eq!(monitor.step(&mut state, &seen(0.27, 0.0), 1.0, true), Ok(None));
        }
        state
    }

    /// Steps until the fault: how many, and which.
    fn until(monitor: &LockMonitor, state: &mut LockMonitorState, seen: Saliency) -> (u32, Fault) {
        for n in 1..=6000 {
            if let Err(fault) = monitor.step(state, &seen, 1.0, false) {
                return (n, fault);
            }
        }
        panic!("no fault")
    }

    #[test]
    fn a_lost_flux_is_seen_in_the_time_the_mean_takes() {
        let monitor = monitor();
        for i_q in [0.0_f32, 0.6, -1.0, 3.0, -3.6] {
            let table = [(0.0, 1.0), (0.6, 1.0192), (1.0, 1.04167), (3.0, 1.14488), (3.6, 1.15781)];
            let ratio = table.iter().find(|p| p.0 == i_q.abs()).unwrap().1;
            let mut state = ready(&monitor);
            for _ in 0..600 {
                let right = monitor.step(&mut state, &seen(0.27 * ratio, i_q), 1.0, false);
                assert!(right.unwrap().is_none_or(|deviation| deviation.abs() < 1e-3), "{right:?}");
            }
            assert!(state.loss.abs() < 0.02, "{i_q}: {}", state.loss);
            // Without flux: 120 ms ln(1 / 0.45) = 96 ms.
            let gone = seen(0.27 * ratio * (1.0 - 0.035), i_q);
            let (n, fault) = until(&monitor, &mut state, gone);
            assert_eq!(fault, Fault::LostLock);
            assert!((55..=61).contains(&n), "{i_q}: {n} carrier periods");
        }
    }

    #[test]
    fn too_much_flux_is_wrong_as_well_and_the_limit_depends_on_the_sign() {
        // Loss that lasts, the saliency, and after how many carrier periods of 1/600 s with 120 ms: 72 ln(1 / (1 - limit/loss)).
        for (a, loss, periods) in [
            (-0.035, -1.0, Some(66.0)),
            (-0.035, -0.55, None),
            (0.035, -1.0, Some(25.7)),
            (0.035, -0.45, Some(79.0)),
            (0.035, 1.0, Some(57.5)),
            (0.035, 0.5, None),
        ] {
            let monitor = monitor_of(a);
            let mut state = ready(&monitor);
            let wrong = seen(0.27 * libm::sqrtf(1.0 - 2.0 * -a * loss), 0.0);
            let tripped =
                (1..=6000).find(|_| monitor.step(&mut state, &wrong, 1.0, false).is_err());
            match (tripped, periods) {
                (None, None) => {}
                (Some(n), Some(expected)) => {
                    assert!((f64::from(n) - expected).abs() < 3.0, "{a} {loss}: {n}");
                }
                other => panic!("{a} {loss}: {other:?}"),
            }
        }
    }

    #[test]
    fn it_rests_while_the_current_moves_but_not_for_long() {
        let monitor = monitor();
        // Without flux from a step of 1 A on: 12 carrier periods later than at rest.
        let mut state = ready(&monitor);
        let gone = |i_q| seen(0.27 * (1.0 - 0.035) * if i_q == 0.0 { 1.0 } else { 1.04167 }, i_q);
        let (n, _) = until(&monitor, &mut state, gone(1.0));
        assert!((67..=73).contains(&n), "{n} carrier periods");
        // A command that never rests: judged 60 % of the time at least.
        let mut state = ready(&monitor);
        let n = (0..6000_u16)
            .find(|n| {
                let i_q = f32::from(n % 2);
                monitor.step(&mut state, &gone(i_q), 1.0, false).is_err()
            })
            .unwrap();
        assert!((92..=130).contains(&n), "{n} carrier periods");
    }

    #[test]
    fn a_smaller_carrier_on_purpose_is_no_loss() {
        let monitor = monitor();
        let mut state = ready(&monitor);
        for _ in 0..600 {
            let deviation =
                monitor.step(&mut state, &seen(0.6 * 0.27, 0.0), 1.0 / 0.36, false).unwrap();
            assert!(deviation.is_some_and(|deviation| deviation.abs() < 1e-4), "{deviation:?}");
        }
        assert!(state.loss.abs() < 1e-3, "{}", state.loss);
    }

    #[test]
    fn no_carrier_and_no_number_are_faults() {
        let monitor = monitor();
        let mut state = ready(&monitor);
        let mut result = Ok(None);
        for n in 0..WEAK_PERIODS {
            assert_eq!(result, Ok(None), "{n}");
            result = monitor.step(&mut state, &seen(0.12, 0.0), 1.0, true);
        }
        assert_eq!(result, Err(Fault::CarrierWeak));
        // A number that is not finite, and a baseline that was never taken.
        for (mut state, carrier) in [
            (ready(&monitor), f32::NAN),
            (ready(&monitor), f32::INFINITY),
            (LockMonitorState::default(), 0.27),
        ] {
            let mut steps =
                (0..600).map(|_| monitor.step(&mut state, &seen(carrier, 0.0), 1.0, false));
            assert!(steps.any(|result| result == Err(Fault::LostLock)), "{carrier}");
        }
    }
}

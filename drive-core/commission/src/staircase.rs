//! Step 6, the magnetising-curve test, for a motor whose main flux saturates.
//!
//! The current along phase a rises through seven levels. At every level the stator flux grows by the integral of the voltage less
//! the steady voltage at the end of the level. The steady voltages lie on a straight line over the current, except that the
//! inverter voltage error is smaller at small currents:
//!
//! ```text
//! psi_s += sum T (v - v_end - r_s (i - i_end))        v_end = r_s i_end + e - d/i_end        psi_m = psi_s - L_l i
//! ```
//!
//! At the current of the first level, the inverter voltage error already has its full value, and the flux is on the straight beginning
//! of the curve. The first seven levels show the magnetising current of the rated flux. An eighth level is at that current, and its flux
//! gives the inductance with which the drive works. Each level lasts until its voltage is constant, at most [`LONGEST_S`].
//!
//! Two levels at 0.6 and 0.3 of that current, where the curve is nearly straight, then give the small-signal circuit there, by the
//! fit of step 4. Its rotor resistance is the true one, and its inductances are the slopes of the curve. (Around the magnetising
//! current itself, the slope for a motor with a sharp knee changes by a factor of ten between two levels, and the small-signal time
//! constant falls to 3 ms for a motor of 200 Hz: the resistances found there were 10 to 40 % too small.)
//!
//! ```text
//! r_r = R_R'/k'^2        k' = 1/sqrt(1 + L_s'/L_M')        L_l = L_s'/(1 + k')        l_m = psi_m(i_d)/i_d
//! ```

use super::fit::bent;
use super::{
    Answer, BINS, Collector, Commissioning, Fitted, Meaning, Next, Quantity, Record, Refusal, SIZE,
    Step, TIME,
};
use drive_core::{Motor, PERIOD_S};

/// Rising levels, as shares of the test current.
const STAIRS: [f32; STEPS - 1] = [0.06, 0.13, 0.22, 0.33, 0.46, 0.62, 0.8];
/// Number of all levels, with the level of the magnetising current.
const STEPS: usize = 8;
/// Time of a record in time constants of step 4, which come out too small, and its limits, s. A level lasts for as many records as
/// its voltage needs to become constant.
const DWELL_T: f32 = 14.0;
const DWELL_S: (f32, f32) = (0.6, 2.9);
const LONGEST_S: f32 = 6.0;
/// First bin of the last quarter of a record, which counts as the end of the level, and first bin of the part before it. The
/// voltage is constant when the two means differ by less than this share of the step `R_R di` with which it began, which takes
/// five time constants.
const END: usize = BINS - 3;
const END_SHARE: f32 = 0.228;
const BEFORE_END: usize = END - 3;
const AT_REST: f32 = 0.02;
/// The two levels that give the rotor resistance, as shares of the magnetising current.
const BELOW: [f32; 2] = [0.6, 0.3];
/// Largest distance of a steady voltage from the line: share of the resistive voltage, and of the dc link.
const LINE: (f32, f32) = (0.01, 1e-4);

/// Largest relative deviation of the rotor resistance, and largest rms of the residual of its fit, as a share of the step of the
/// rotor's voltage: twice the values of random motors, whose resistance came out within 5 %.
const UNCERTAIN: f32 = 0.03;
const MISFIT: f32 = 0.07;

/// One level of the current.
#[derive(Clone, Copy, Debug, Default)]
struct Stair {
    /// Current, A, and voltage, V, at the end.
    i: f32,
    v: f32,
    /// Integrals of current, A s, and voltage, V s, over the level, and its time, s.
    charge: f32,
    area: f32,
    seconds: f32,
}

/// State of the step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Staircase {
    stairs: [Stair; STEPS],
    /// Stator resistance, ohm, and inverter voltage error, V, from the line; currents, A, and stator flux, Wb, of the levels.
    r_s: f32,
    e: f32,
    flux: [(f32, f32); STEPS],
    /// Magnetising current of the rated flux, A.
    i_d: f32,
}

impl Stair {
    /// Adds a record. Returns whether the voltage is constant, for a rotor resistance `r_r`, ohm, after a step of the current
    /// from `from`, A.
    fn add(&mut self, sums: &Collector, r_r: f32, from: f32) -> bool {
        let (end, whole) = (sums.mean(0, END), sums.mean(0, 0));
        let seconds = whole.periods * PERIOD_S;
        (self.i, self.v) = (end.current.alpha, end.voltage);
        self.charge += whole.current.alpha * seconds;
        self.area += whole.voltage * seconds;
        self.seconds += seconds;
        // This is the mean from `BEFORE_END` to `END`.
        let late = sums.mean(0, BEFORE_END);
        let apart = (late.voltage - end.voltage) * late.periods / (late.periods - end.periods);
        libm::fabsf(apart) < AT_REST * r_r * libm::fabsf(self.i - from)
    }
}

impl Staircase {
    /// Fits the line through the steady voltages of the rising levels, and computes the flux of all levels. Currents are readings
    /// of sensor a divided by its `gain`.
    fn evaluate(&mut self, gain: f32, dc_link: f32) -> Result<(), Refusal> {
        let [first, rest @ ..] = &self.stairs;
        let ends: [_; STAIRS.len() - 1] = core::array::from_fn(|n| (rest[n].i, rest[n].v));
        let [r_s, e, bend] = bent(&ends)?;
        for s in rest.iter().filter(|s| s.seconds > 0.0) {
            let allowed = LINE.0 * r_s * s.i + LINE.1 * dc_link;
            let distance = s.v - (r_s * s.i + e - bend / s.i);
            Quantity::new("distance from the resistive line", "V", distance)
                .up_to(allowed, Meaning::Inverter)?;
        }
        let growth = |s: &Stair| (s.area - s.v * s.seconds) - r_s * (s.charge - s.i * s.seconds);
        let mut flux = growth(&rest[0]) / (rest[0].i - first.i) * first.i;
        self.flux[0] = (first.i / gain, flux);
        for (place, s) in self.flux.iter_mut().skip(1).zip(rest) {
            flux += growth(s);
            *place = (s.i / gain, flux);
        }
        (self.r_s, self.e) = (r_s * gain, e);
        Ok(())
    }

    /// Adds the flux that is missing because a level ended before its flux was constant: the part e^(-x) of the slow flux, x =
    /// T/tau, and the rest of the voltage at the end, over the whole time. `record` is the time of a record, s; `r_r` and
    /// `leakage` are the parameters of the T circuit.
    fn complete(&mut self, record: f32, r_r: f32, leakage: f32) {
        let ((mut i, mut at_i), mut late) = (self.flux[0], None);
        for n in 1..STEPS {
            let (next, after) = self.flux[n];
            let (step, grown) = (next - i, after - at_i);
            let (mut whole, mut rest) = (grown / step, 0.0);
            let seconds = self.stairs[n].seconds;
            let end = END_SHARE * record / seconds;
            for _ in 0..4 {
                let left = |x: f32| libm::expf(-x * seconds * r_r / whole);
                let ends = (left(1.0 - end) - left(1.0)) / end;
                let slow = (whole - leakage) * (whole - leakage) / whole;
                rest = left(1.0) * slow;
                // The flux missing in the level before comes late; the first level was reached from zero.
                let late = late.unwrap_or(rest * i);
                whole = (grown - late) / step + rest + ends * slow;
            }
            // The first step of the current begins on the straight part of the curve.
            let from = if n == 1 { whole * i } else { self.flux[n - 1].1 };
            self.flux[n - 1].1 = from;
            self.flux[n].1 = from + whole * step;
            (i, at_i, late) = (next, after, Some(rest * step));
        }
    }

    /// Returns the current, A, at which the function `main` of the levels is `flux`, Wb, by a straight line between two levels.
    /// If even the last rising level has less flux, its current is returned.
    fn current_at(&self, flux: f32, main: &dyn Fn((f32, f32)) -> f32) -> f32 {
        let mut below = (0.0, 0.0);
        for &point in self.flux.iter().take(STAIRS.len()) {
            let (i, at_i) = (point.0, main(point));
            if at_i >= flux {
                return below.0 + (i - below.0) * (flux - below.1) / (at_i - below.1);
            }
            below = (i, at_i);
        }
        below.0
    }
}

impl Commissioning {
    pub(super) fn staircase(&mut self, sums: &mut Collector) -> Answer {
        let levels = self.found.levels.ok_or(Refusal::Needs(Step::Levels))?;
        let leakage = self.found.leakage.ok_or(Refusal::Needs(Step::Leakage))?;
        let seconds = (DWELL_T * levels.tau_r).clamp(DWELL_S.0, DWELL_S.1);
        let gain = 1.0 + 0.5 * levels.mismatch;
        let (part, plate, stairs) = (&mut self.state.part, &self.plate, &mut self.state.stairs);
        if *part == 0 {
            self.found.iron = None;
        }
        if let Some(n) = part.checked_sub(1).filter(|n| *n < STEPS) {
            let from = n.checked_sub(1).map_or(0.0, |before| stairs.stairs[before].i);
            let stair = &mut stairs.stairs[n];
            if !stair.add(sums, levels.r_r, from) && stair.seconds < LONGEST_S {
                // The level is repeated.
                *part -= 1;
            } else if n + 1 >= STAIRS.len() {
                stairs.evaluate(gain, plate.dc_link)?;
            }
        }
        if *part == STAIRS.len() {
            // The goal is the flux of the nameplate, or less if that takes too much current.
            let main = |(i, flux): (f32, f32)| flux - leakage.inductance / 1.87 * i;
            let [_, _, least, ..] = STAIRS;
            let wanted = stairs.current_at(plate.flux, &main);
            stairs.i_d = wanted.clamp(least * plate.amperes, plate.largest_i_d);
        }
        let [magnetising, high, low] =
            [1.0, BELOW[0], BELOW[1]].map(|of| of * stairs.i_d / plate.amperes);
        let half = |half| Record::bins(half, seconds);
        // After the rising levels come the magnetising current, the upper level to settle, the lower level, and the upper level
        // again.
        let then =
            [(half(0), magnetising), (Record::Nothing, high), (half(0), low), (half(1), high)];
        let mut parts = STAIRS.map(|share| (half(0), share)).into_iter().chain(then);
        if let Some((record, share)) = parts.nth(*part) {
            // The two levels of the fit last as long as the longest of the rising levels.
            let longest = stairs.stairs.iter().map(|s| s.seconds).fold(seconds, f32::max);
            let seconds = if *part < STEPS { seconds } else { longest };
            let excitation = self.along(share, self.regulator()?);
            return self.begin(sums, (record, seconds, excitation));
        }
        // The first half began with the flux at which the second half ended.
        let steady = sums.mean(1, BINS - 3).current.alpha;
        match self.search(sums, steady)? {
            None => Ok(Next::Wait),
            Some(fit) => self.report_staircase(&fit, gain, seconds),
        }
    }

    fn report_staircase(&mut self, fit: &Fitted, gain: f32, seconds: f32) -> Answer {
        // This is the small-signal inductance along the axis, as in the fit, at the current at which the drive works, since
        // the leakage paths saturate.
        let [[along, _], _] = self.inductances;
        let (plate, stairs) = (&self.plate, &mut self.state.stairs);
        let (r_r, i_d) = (fit.r_r * gain, stairs.i_d);
        let k = 1.0 / fpu_sqrt::sqrtf(1.0 + along / (fit.tau_r * r_r));
        let l = along / (1.0 + k);
        let r_r = r_r / (k * k);
        stairs.complete(seconds, r_r, l);
        let [.., (i, flux)] = stairs.flux;
        let l_m = flux / i - l;
        let (i, flux) = stairs.flux[0];
        let straight = (flux - l * i) / i / l_m;
        let motor = Motor { r_s: stairs.r_s, r_r, l_ls: l, l_lr: l, l_m, ..Motor::default() };
        let deviation = fit.deviations[2] / fit.r_r;
        Quantity::new("deviation of r_r", "", deviation)
            .checked((0.0, UNCERTAIN), [Meaning::Uncertain; 2])?;
        let misfit = fit.misfit / (fit.r_r * (BELOW[0] - BELOW[1]) * i_d);
        Quantity::new("misfit of r_r", "", misfit).checked((0.0, MISFIT), [Meaning::Misfit; 2])?;
        let values = [
            Quantity::new("r_s", "ohm", motor.r_s).checked(plate.r_s, SIZE)?,
            Quantity::new("r_r", "ohm", motor.r_r).within(deviation * motor.r_r),
            Quantity::new("magnetising current", "A", i_d),
            Quantity::new("main flux there", "Wb", l_m * i_d),
            Quantity::new("L_m, chord", "H", l_m),
            Quantity::new("tau_r, chord", "s", motor.tau_r()).checked(plate.tau_r, TIME)?,
            Quantity::new("chord of the straight beginning over it", "", straight)
                .checked((0.95, 5.0), [Meaning::Misfit; 2])?,
        ];
        self.found.iron = Some(motor);
        if let Some(levels) = &mut self.found.levels {
            (levels.r_s, levels.inverter_v) = (motor.r_s, 0.75 * stairs.e);
        }
        self.report(&values)
    }
}

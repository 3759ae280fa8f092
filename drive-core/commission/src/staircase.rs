//! Step 6: the magnetising curve, where the main flux saturates.
//!
//! The current along phase a climbs a staircase. In every step the stator flux grows by the area under the voltage that the
//! end of the step does not explain, and the ends themselves lie on a line, but for what an inverter lacks at small currents:
//!
//! ```text
//! psi_s += sum T (v - v_end - r_s (i - i_end))        v_end = r_s i_end + e - d/i_end        psi_m = psi_s - L_l i
//! ```
//!
//! The first step begins at a current at which the inverter already takes its full voltage; the flux there is on the
//! straight beginning of the curve. Two levels 20 % around the direct current of the drive then give the circuit of small
//! changes there, by the fit of step 4; its rotor resistance is the true one, its inductances are the slopes:
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

/// Levels, as shares of the test current.
const STAIRS: [f32; STEPS] = [0.06, 0.13, 0.22, 0.33, 0.46, 0.62, 0.8];
const STEPS: usize = 7;
/// Time of a level in time constants of step 4, which come out too small, and its limits, s.
const DWELL_T: f32 = 14.0;
const DWELL_S: (f32, f32) = (0.6, 2.9);
/// Bins at the end of a level that count as its end: the last quarter.
const END: usize = BINS - 3;
const END_SHARE: f32 = 0.228;
/// The two levels around the direct current.
const AROUND: [f32; 2] = [1.2, 0.8];
/// Direct current at most, as a share of the test current.
const DIRECT: f32 = 0.55;
/// Largest distance of an end from the line: share of the resistive voltage, and of the dc link.
const LINE: (f32, f32) = (0.01, 1e-4);

/// Largest relative deviation of the rotor resistance.
const UNCERTAIN: f32 = 0.05;

/// A level of the staircase.
#[derive(Clone, Copy, Debug, Default)]
struct Stair {
    /// Current, A, and voltage, V, at the end.
    i: f32,
    v: f32,
    /// Sums of the differences of current, A s, and voltage, V s, from it.
    charge: f32,
    area: f32,
}

/// State of the step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Staircase {
    stairs: [Stair; STEPS],
    /// Stator resistance, ohm, and voltage of the inverter, V, by the line; currents, A, and stator flux, Wb, of the levels.
    r_s: f32,
    e: f32,
    flux: [(f32, f32); STEPS],
    /// Direct current, A.
    i_d: f32,
}

impl Stair {
    fn new(sums: &Collector) -> Self {
        let end = sums.mean(0, END);
        let mut stair = Self { i: end.current.alpha, v: end.voltage, charge: 0.0, area: 0.0 };
        for bin in sums.bins(0) {
            let seconds = bin.periods * PERIOD_S;
            stair.charge += (bin.current.alpha - stair.i) * seconds;
            stair.area += (bin.voltage - stair.v) * seconds;
        }
        stair
    }
}

impl Staircase {
    /// The line through the ends, and the flux of the levels. Currents are those of sensor a over its `gain`.
    fn evaluate(&mut self, gain: f32, dc_link: f32) -> Result<(), Refusal> {
        let [first, rest @ ..] = &self.stairs;
        let ends: [_; STEPS - 1] = core::array::from_fn(|n| (rest[n].i, rest[n].v));
        let [r_s, e, bend] = bent(&ends)?;
        for s in rest {
            let allowed = LINE.0 * r_s * s.i + LINE.1 * dc_link;
            let distance = s.v - (r_s * s.i + e - bend / s.i);
            Quantity::new("distance from the resistive line", "V", distance)
                .up_to(allowed, Meaning::Inverter)?;
        }
        let growth = |s: &Stair| s.area - r_s * s.charge;
        let mut flux = growth(&rest[0]) / (rest[0].i - first.i) * first.i;
        self.flux[0] = (first.i / gain, flux);
        for (place, s) in self.flux.iter_mut().skip(1).zip(rest) {
            flux += growth(s);
            *place = (s.i / gain, flux);
        }
        (self.r_s, self.e) = (r_s * gain, e);
        Ok(())
    }

    /// Adds what the levels lack that were left, after `seconds`, before the flux had come to rest: the part e^(-x) of
    /// the slow flux, x = T/tau, and what is left of the voltage at the end, over the whole time. `r_r` and `leakage` are
    /// those of the T.
    fn complete(&mut self, seconds: f32, r_r: f32, leakage: f32) {
        let ((mut i, mut at_i), mut late) = (self.flux[0], None);
        for n in 1..STEPS {
            let (next, after) = self.flux[n];
            let (step, grown) = (next - i, after - at_i);
            let (mut whole, mut rest) = (grown / step, 0.0);
            for _ in 0..4 {
                let left = |x: f32| libm::expf(-x * seconds * r_r / whole);
                let ends = (left(1.0 - END_SHARE) - left(1.0)) / END_SHARE;
                let slow = (whole - leakage) * (whole - leakage) / whole;
                rest = left(1.0) * slow;
                // What the level before left comes late; the first was reached from zero.
                let late = late.unwrap_or(rest * i);
                whole = (grown - late) / step + rest + ends * slow;
            }
            // The first step begins on the straight part of the curve.
            let from = if n == 1 { whole * i } else { self.flux[n - 1].1 };
            self.flux[n - 1].1 = from;
            self.flux[n].1 = from + whole * step;
            (i, at_i, late) = (next, after, Some(rest * step));
        }
    }

    /// Stator flux at a current, Wb, by a parabola through the three nearest levels.
    fn flux_at(&self, i: f32) -> f32 {
        let next = self.flux.iter().position(|point| point.0 > i).unwrap_or(STEPS - 1);
        let from = next.saturating_sub(2).min(STEPS - 3);
        let mut sum = 0.0;
        let points = || self.flux.iter().skip(from).take(3);
        for (n, (i_n, flux)) in points().enumerate() {
            let others = points().enumerate().filter(|(m, _)| *m != n);
            sum += others.fold(*flux, |product, (_, (i_m, _))| product * (i - i_m) / (i_n - i_m));
        }
        sum
    }
}

impl Commissioning {
    pub(super) fn staircase(&mut self, sums: &mut Collector) -> Answer {
        let levels = self.found.levels.ok_or(Refusal::Needs(Step::Levels))?;
        let leakage = self.found.leakage.ok_or(Refusal::Needs(Step::Leakage))?;
        let seconds = (DWELL_T * levels.tau_r).clamp(DWELL_S.0, DWELL_S.1);
        let gain = 1.0 + 0.5 * levels.mismatch;
        let (part, plate, stairs) = (self.state.part, &self.plate, &mut self.state.stairs);
        if part < STEPS {
            self.found.iron = None;
        }
        if let Some(done) = part.checked_sub(1).and_then(|n| stairs.stairs.get_mut(n)) {
            *done = Stair::new(sums);
        }
        if part == STEPS {
            stairs.evaluate(gain, plate.dc_link)?;
            // The flux of the nameplate, or less where that takes too much current.
            let main = |(i, flux): &(f32, f32)| flux - leakage.inductance / 1.87 * i < plate.flux;
            let below = stairs.flux.iter().rev().find(|point| main(point)).map_or(0.0, |p| p.0);
            let [_, _, least, ..] = STAIRS;
            stairs.i_d = below.clamp(least * plate.amperes, DIRECT * plate.rated);
        }
        let [high, low] = AROUND.map(|of| of * stairs.i_d / plate.amperes);
        let half = |half| Record::bins(half, seconds);
        // Up, settle; down; up.
        let around = [(Record::Nothing, high), (half(0), low), (half(1), high)];
        let mut parts = STAIRS.map(|share| (half(0), share)).into_iter().chain(around);
        if let Some((record, share)) = parts.nth(part) {
            let excitation = self.along(share, self.regulator()?);
            return self.begin(sums, (record, seconds, excitation));
        }
        // The first half began where the second has ended.
        let steady = sums.mean(1, BINS - 3).current.alpha;
        match self.search(sums, steady)? {
            None => Ok(Next::Wait),
            Some(fit) => self.report_staircase(&fit, gain, seconds),
        }
    }

    fn report_staircase(&mut self, fit: &Fitted, gain: f32, seconds: f32) -> Answer {
        // Along the axis, and at nearly this current: that of small changes, as the fit's.
        let [[along, _], _] = self.inductances;
        let (plate, stairs) = (&self.plate, &mut self.state.stairs);
        let (r_r, i_d) = (fit.r_r * gain, stairs.i_d);
        let k = 1.0 / fpu_sqrt::sqrtf(1.0 + along / (fit.tau_r * r_r));
        let l = along / (1.0 + k);
        let r_r = r_r / (k * k);
        stairs.complete(seconds, r_r, l);
        let l_m = stairs.flux_at(i_d) / i_d - l;
        let (i, flux) = stairs.flux[0];
        let straight = (flux - l * i) / i / l_m;
        let motor = Motor { r_s: stairs.r_s, r_r, l_ls: l, l_lr: l, l_m, ..Motor::default() };
        let deviation = fit.deviations[2] / fit.r_r;
        Quantity::new("deviation of r_r", "", deviation)
            .checked((0.0, UNCERTAIN), [Meaning::Uncertain; 2])?;
        let values = [
            Quantity::new("r_s", "ohm", motor.r_s).checked(plate.r_s, SIZE)?,
            Quantity::new("r_r", "ohm", motor.r_r).within(deviation * motor.r_r),
            Quantity::new("direct current", "A", i_d),
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

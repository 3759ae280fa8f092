//! Step 5: the transient inductance from the response to the injected voltage.
//!
//! The response from the commanded voltage to the sampled current, at `z = e^(j omega T)`, is
//!
//! ```text
//! |h| = |(1 - p) / R' / (z - p)| |(1 - b) + b/z|        p = exp(-T R' / L)        b = tau_f/T (1 - e^(-T/tau_f))
//! ```
//!
//! with the analog filter `tau_f` of the sensors, whose input is taken as a straight line between two samples.
//!
//! The mean of the inductances along and across the bias is `sigma L_s`. The inductance across the bias is the one that the
//! fundamental wave sees: `psi = L(|i|) i` gives `dpsi/di = L(|i|)` across `i`. Along the bias the inductance is smaller if
//! leakage paths or the main flux saturate. Two biases give its change with the current.

use core::f32::consts::TAU;

use super::{
    Answer, Collector, Commissioning, Leakage, Levels, Meaning, Quantity, Record, Refusal, SIZE,
    Step,
};
use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{AlphaBeta, PERIOD_S, SQRT_3, TestSignal};
use drive_settings::rules::CARRIER_HZ;
use num_complex::Complex32;

/// Bisections of the inductance.
const BISECTIONS: u32 = 30;

/// Bias and amplitude of the injected current, as shares of the test current. The first pair also gives the gain mismatch.
const BIASES: [(f32, f32); 2] = [(0.5, 0.14), (0.25, 0.07)];
/// Parts of the measurement at each bias.
const PARTS: usize = 7;
/// Largest injected voltage, as a share of the dc link.
const CARRIER_OF_BUS: f32 = 0.4;
/// Longest time after which the flux of a bias counts as established, s: a flux that still changes alters the saliency, not the
/// mean inductance.
const SETTLED_S: f32 = 2.1;
/// Samples of a record, and time of the rise and of the fall of the injected voltage, s.
const RECORDED: f32 = 3000.0;
const RISE_S: f32 = 0.05;
/// Largest gain mismatch, and largest difference of the resistances of phases b and c.
const MISMATCH: f32 = 0.05;
const RESISTANCES: f32 = 0.06;
/// Angular frequency of the injection, rad/s.
const CARRIER_RAD_PER_S: f32 = TAU * CARRIER_HZ;

/// Returns 1 - (gain of b)/(gain of a), from the injection along phase a and across it. In every motor, however salient, a
/// voltage along phase a makes as much current across as a voltage across makes along.
fn gains(along: &[Complex32; 4], across: &[Complex32; 4]) -> Complex32 {
    let [v, _, i, i_across] = along;
    let [v_along, v_across, i_along, _] = across;
    SQRT_3 * (i_across / i - (i_along * v / i - v_along) / v_across)
}

/// Returns the share of the previous sample in the output of the analog filter, whose time constant is given in periods.
fn held(filter: f32) -> f32 {
    if filter > 0.0 { filter * -libm::expm1f(-1.0 / filter) } else { 0.0 }
}

/// Returns the inductance, H, that gives this admittance, A/V, with the resistance R', ohm, and the analog filter, periods.
fn inductance(admittance: f32, resistance: f32, filter: f32, range: (f32, f32)) -> f32 {
    let (sin, cos) = libm::sincosf(TAU / CARRIER_SAMPLES as f32);
    let b = held(filter);
    let seen = libm::hypotf((1.0 - b) + b * cos, b * sin);
    let (mut low, mut high) = (libm::logf(range.0), libm::logf(range.1));
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let decayed = -libm::expm1f(-PERIOD_S * resistance / libm::expf(middle));
        let to_pole = libm::hypotf(cos - (1.0 - decayed), sin);
        let is_low = seen * decayed / (resistance * to_pole) > admittance;
        *(if is_low { &mut low } else { &mut high }) = middle;
    }
    libm::expf(0.5 * (low + high))
}

impl Commissioning {
    pub(super) fn leakage(&mut self, sums: &mut Collector) -> Answer {
        let levels = self.found.levels.ok_or(Refusal::Needs(Step::Levels))?;
        let regulator = self.regulator()?;
        let bias = self.state.part / PARTS;
        let Some(&(share, carrier)) = BIASES.get(bias) else {
            return self.report_leakage(levels);
        };
        let volts = carrier * self.plate.amperes * CARRIER_RAD_PER_S * self.rough()?;
        let volts = volts.min(CARRIER_OF_BUS * self.plate.dc_link);
        let none = AlphaBeta::ZERO;
        let (along, across) = (AlphaBeta::new(volts, 0.0), AlphaBeta::new(0.0, volts));
        // These are the parts at one bias.
        let parts: [_; PARTS] = [
            (Record::Nothing, (3.0 * levels.tau_r).min(SETTLED_S), none),
            (Record::Nothing, RISE_S, along),
            (Record::Carrier, RECORDED * PERIOD_S, along),
            (Record::Nothing, RISE_S, none),
            (Record::Nothing, RISE_S, across),
            (Record::Carrier, RECORDED * PERIOD_S, across),
            (Record::Nothing, RISE_S, none),
        ];
        let part = self.state.part % PARTS;
        // A record has ended, along the bias or across it.
        if let 3 | 6 = part {
            let axis = usize::from(part == 6);
            let seen = sums.phasors();
            let (least, most) = self.plate.leakage;
            let range = (0.1 * least, 10.0 * most);
            let admittance = seen[2 + axis] / seen[axis];
            let admittance = libm::hypotf(admittance.re, admittance.im);
            let r = levels.r_s + levels.r_r;
            self.inductances[bias][axis] = inductance(admittance, r, self.plate.filter, range);
            if axis == 0 {
                self.state.along = seen;
            } else if bias == 0 {
                self.state.gains = gains(&self.state.along, &seen);
            }
        }
        let (record, seconds, carrier) = parts[part];
        let amperes = share * self.plate.amperes;
        let excitation = TestSignal::Current { amperes, regulator, carrier, binary: false };
        self.begin(sums, (record, seconds, excitation))
    }

    fn report_leakage(&mut self, levels: Levels) -> Answer {
        // A lag of sensor b mixes in a share of its previous sample, however the current changes between the two.
        let (sin, cos) = libm::sincosf(TAU / CARRIER_SAMPLES as f32);
        let (z, b) = (Complex32::new(cos, -sin), held(self.plate.filter));
        let lag = (1.0 - z) / (1.0 - b + b * z);
        let share = self.state.gains.im / lag.im;
        let b_over_a = 1.0 - (self.state.gains.re - share * lag.re);
        let mismatch = 1.0 / b_over_a - 1.0;
        let by_gain = |[a, b]: [f32; 2]| [a * (1.0 + 0.5 * mismatch), b * (1.0 - 0.5 * mismatch)];
        self.inductances = self.inductances.map(by_gain);
        // The bias lies along phase a.
        let saliency = |[along, across]: [f32; 2]| (across - along) / (across + along);
        let [high, low] = self.inductances;
        let inductance = 0.25 * (high[0] + high[1] + low[0] + low[1]);
        let [most, least] = BIASES.map(|(share, _)| share * self.plate.amperes);
        let slope = (high[1] - low[1]) / (most - least);
        let fundamental = low[1] - slope * least;
        let values = [
            Quantity::new("sigma L_s", "H", inductance).checked(self.plate.leakage, SIZE)?,
            Quantity::new("saliency at half the current", "", saliency(high)),
            Quantity::new("saliency at a quarter", "", saliency(low)),
            Quantity::new("fundamental wave, no current", "H", fundamental),
            Quantity::new("its change per ampere", "H/A", slope),
            Quantity::new("gain mismatch", "", mismatch).up_to(MISMATCH, Meaning::Mismatch)?,
            Quantity::new("lag of sensor b", "us", share * PERIOD_S * 1e6),
            Quantity::new("r_b over r_c, less 1", "", 2.0 * (levels.difference - mismatch))
                .up_to(RESISTANCES, Meaning::Resistances)?,
        ];
        self.found.levels = Some(levels.with_mismatch(mismatch));
        self.found.leakage = Some(Leakage { inductance, fundamental, slope });
        self.report(&values)
    }
}

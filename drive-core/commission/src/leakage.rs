//! Step 5: the transient inductance from the response to the carrier.
//!
//! The response of the commanded voltage to the sampled current, at `z = e^(j omega T)`:
//!
//! ```text
//! |h| = |(1 - p) / R' / (z - p)| |(1 - b) + b/z|        p = exp(-T R' / L)        b = tau_f/T (1 - e^(-T/tau_f))
//! ```
//!
//! with the analog filter `tau_f` of the sensors, whose input is straight between two samples.
//!
//! The mean of along and across is `sigma L_s`. The inductance across the bias is that of the fundamental wave: from
//! `psi = L(|i|) i` follows `dpsi/di = L(|i|)` across `i`. Along the bias it is smaller where iron saturates, the main flux
//! included. Two biases give its change with the current.

use core::f32::consts::TAU;

use super::{
    Answer, Collector, Commissioning, Leakage, Meaning, Quantity, Record, Refusal, SIZE, Step,
};
use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{AlphaBeta, Excitation, PERIOD_S, SQRT_3};
use drive_settings::rules::CARRIER_HZ;

/// Bisections of the inductance.
const BISECTIONS: u32 = 30;

/// Bias of the carrier, as shares of the test current; carrier current likewise; largest carrier as a share of the dc link.
const BIASES: [f32; 2] = [0.5, 0.25];
const CARRIER: f32 = 0.07;
const CARRIER_OF_BUS: f32 = 0.3;
/// Longest time until the flux of a bias counts as standing, s: it moves the saliency, not the mean inductance.
const SETTLED_S: f32 = 2.1;
/// Samples of a record, and time of the rise of the carrier, and of its fall, s.
const RECORDED: f32 = 1500.0;
const RISE_S: f32 = 0.05;
/// Largest gain mismatch that is left at the carrier.
const LEFT: f32 = 0.01;
/// rad/s.
const CARRIER_RAD_PER_S: f32 = TAU * CARRIER_HZ;

/// A/V along phase a, and across it.
fn admittances(seen: &[[f32; 2]; 4]) -> [f32; 2] {
    let [v_a, v_b, i_a, i_b] = seen.map(|[re, im]| libm::hypotf(re, im));
    [i_a / v_a, i_b / v_b]
}

/// Gain mismatch that the carrier along phase a shows: (gain of a)/(gain of b) - 1.
fn mismatch([_, _, [re_a, im_a], [re_b, im_b]]: &[[f32; 2]; 4]) -> f32 {
    SQRT_3 * (re_a * re_b + im_a * im_b) / (re_a * re_a + im_a * im_a)
}

/// The inductance, H, that gives this admittance, A/V, with the resistance R', ohm, and the analog filter, periods.
fn inductance(admittance: f32, resistance: f32, filter: f32, range: (f32, f32)) -> f32 {
    let (sin, cos) = libm::sincosf(TAU / CARRIER_SAMPLES as f32);
    let b = if filter > 0.0 { filter * -libm::expm1f(-1.0 / filter) } else { 0.0 };
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
        let volts = CARRIER * self.plate.amperes * CARRIER_RAD_PER_S * self.rough()?;
        let volts = volts.min(CARRIER_OF_BUS * self.plate.dc_link);
        let none = AlphaBeta::ZERO;
        let (along, across) = (AlphaBeta::new(volts, 0.0), AlphaBeta::new(0.0, volts));
        // The parts of a bias.
        let parts = [
            (Record::Nothing, (3.0 * levels.tau_r).min(SETTLED_S), none),
            (Record::Nothing, RISE_S, along),
            (Record::Carrier, RECORDED * PERIOD_S, along),
            (Record::Nothing, RISE_S, none),
            (Record::Nothing, RISE_S, across),
            (Record::Carrier, RECORDED * PERIOD_S, across),
            (Record::Nothing, RISE_S, none),
        ];
        let (bias, part) = (self.state.part / parts.len(), self.state.part % parts.len());
        let Some(&share) = BIASES.get(bias) else { return self.report_leakage() };
        // A record has ended: along the bias, or across it.
        if let 3 | 6 = part {
            let axis = usize::from(part == 6);
            let seen = sums.phasors();
            let admittance = admittances(&seen)[axis];
            let half = 0.5 * levels.mismatch;
            let gain = if axis == 0 { 1.0 + half } else { 1.0 - half };
            let (least, most) = self.plate.leakage;
            let range = (0.1 * least, 10.0 * most);
            self.inductances[bias][axis] =
                inductance(admittance / gain, levels.r_s + levels.r_r, self.plate.filter, range);
            if axis == 0 {
                let noise = self.found.noise.ok_or(Refusal::Needs(Step::Sensors))?;
                let of_noise = 6.0 * noise / (volts * admittance * fpu_sqrt::sqrtf(RECORDED / 2.0));
                let allowed = of_noise.max(LEFT);
                Quantity::new("gain mismatch at 600 Hz", "", mismatch(&seen) - levels.mismatch)
                    .up_to(allowed, Meaning::Turning)?;
            }
        }
        let (record, seconds, carrier) = parts[part];
        let amperes = share * self.plate.amperes;
        let excitation = Excitation::Current { amperes, regulator, carrier, binary: false };
        self.begin(sums, (record, seconds, excitation))
    }

    fn report_leakage(&mut self) -> Answer {
        // With the bias along phase a.
        let saliency = |[along, across]: [f32; 2]| (across - along) / (across + along);
        let [high, low] = self.inductances;
        let inductance = 0.25 * (high[0] + high[1] + low[0] + low[1]);
        let [most, least] = BIASES.map(|share| share * self.plate.amperes);
        let slope = (high[1] - low[1]) / (most - least);
        let fundamental = low[1] - slope * least;
        let values = [
            Quantity::new("sigma L_s", "H", inductance).checked(self.plate.leakage, SIZE)?,
            Quantity::new("saliency at half the current", "", saliency(high)),
            Quantity::new("saliency at a quarter", "", saliency(low)),
            Quantity::new("fundamental wave, no current", "H", fundamental),
            Quantity::new("its change per ampere", "H/A", slope),
        ];
        self.found.leakage = Some(Leakage { inductance, fundamental, slope });
        self.report(&values)
    }
}

//! Disturbances of the bench: combined errors of a real inverter, real sensors and a real motor.

use crate::prelude::*;

/// A disturbance: its description, with its full size on the dissertation's bench, to which other benches are in
/// proportion; whether it has a sign; and the function that adds it to the bench, relative to its full size.
pub type Disturbance = (&'static str, Sign, fn(&mut Config, f64));

/// Whether a disturbance has a sign.
#[derive(Clone, Copy, PartialEq)]
pub enum Sign {
    Either,
    Positive,
}

/// Disturbances that are present during the saliency self-commissioning and after it.
pub static ALWAYS: [Disturbance; 7] = [
    ("slots 0.3 %", Sign::Either, |c, x| c.iron.slots += 0.003 * x),
    ("stator-fixed 0.3 %", Sign::Either, |c, x| c.iron.stator_fixed += 0.003 * x),
    ("cross-talk 0.5 %", Sign::Either, |c, x| c.measurement.cross_talk_a += 0.005 * x),
    ("lag 2 µs", Sign::Positive, |c, x| c.measurement.lag_b_us += 2.0 * x),
    ("450 pF", Sign::Positive, |c, x| {
        c.inverter.node_capacitance_f += 450e-12 * c.amperes(1.0) * x
    }),
    ("dead time 0.2 µs", Sign::Either, |c, x| c.inverter.extra_dead_time_s += 0.2e-6 * x),
    ("0.3 ohm", Sign::Positive, |c, x| c.inverter.on_resistance += 0.3 / c.amperes(1.0) * x),
];

/// Disturbances that appear after the saliency self-commissioning.
pub static AFTER: [Disturbance; 8] = [
    ("ripple 2 %", Sign::Positive, |c, x| c.dc_link.ripple += 0.02 * x),
    ("dc lag 300 µs", Sign::Positive, |c, x| c.measurement.dc_lag_us += 300.0 * x),
    ("dc gain 0.5 %", Sign::Either, |c, x| c.measurement.dc_gain_error += 0.005 * x),
    ("cubic 0.5 %", Sign::Either, |c, x| c.measurement.cubic_error += 0.005 * x),
    ("rotor 20 % warmer", Sign::Either, |c, x| c.motor.r_r *= 1.0 + 0.2 * x),
    ("drift 1 mA/s", Sign::Either, |c, x| c.measurement.drift_a += c.amperes(0.001) * x),
    ("Coulomb 0.05 Nm", Sign::Positive, |c, x| c.shaft.static_nm += c.newton_metres(0.05) * x),
    ("once a turn 0.03 Nm", Sign::Positive, |c, x| c.shaft.once_nm += c.newton_metres(0.03) * x),
];

/// A difference between phases or sensors that a drive has not learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Asymmetry {
    /// No difference.
    None,
    /// Gain of current sensor a, higher by this many thousandths.
    GainA(i16),
    /// Gain of current sensor b, higher by this many thousandths.
    GainB(i16),
    /// Cross-talk from channel b to channel a, in thousandths.
    CrossTalk(i16),
    /// Saliency fixed to the stator of a motor with saturation, in thousandths.
    StatorFixed(i16),
}

/// Name of a difference, its size in thousandths, and the value of the bench that it changes.
type Change = (&'static str, i16, fn(&mut Config) -> &mut f64);

impl Asymmetry {
    /// Describes the difference in words.
    pub fn name(self) -> String {
        let text = |(name, by, _)| format!("{name} {:+} %", f64::from(by) / 10.0);
        self.change().map_or("nothing changed".to_owned(), text)
    }

    /// Adds the difference to the bench.
    pub fn add(self, config: &mut Config) {
        if let Some((_, by, value)) = self.change() {
            *value(config) += f64::from(by) / 1e3;
        }
    }

    fn change(self) -> Option<Change> {
        match self {
            Self::None => None,
            Self::GainA(by) => Some(("gain a", by, |c| &mut c.measurement.gain_error_a)),
            Self::GainB(by) => Some(("gain b", by, |c| &mut c.measurement.gain_error_b)),
            Self::CrossTalk(by) => Some(("cross-talk", by, |c| &mut c.measurement.cross_talk_a)),
            Self::StatorFixed(by) => Some(("stator-fixed", by, |c| &mut c.iron.stator_fixed)),
        }
    }
}

/// Sizes of disturbances, each relative to its full size: the sizes of the configuration plus random parts.
pub fn sizes(config: &Config, all: &[Disturbance], seed: u64) -> Vec<f64> {
    let mut random = seeded(seed);
    let (together, most) = (config.disturbed.together, config.disturbed.drawn);
    let size = |(_, sign, _): &Disturbance| {
        let drawn = random.random_range(-1.0..=1.0);
        together + most * if *sign == Sign::Either { drawn } else { f64::abs(drawn) }
    };
    all.iter().map(size).collect()
}

/// Adds disturbances of these sizes to the bench. Slots and stator-fixed saliency act only on a motor with saturation.
pub fn add(config: &mut Config, all: &[Disturbance], sizes: &[f64]) {
    all.iter().zip(sizes).for_each(|((_, _, add), &size)| add(config, size));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(set: &[(&str, f64)]) -> Config {
        let mut config = Config::default();
        set.iter().for_each(|(key, value)| config.set(key, value).unwrap());
        config
    }

    /// The changed keys are those of the list, with its values.
    #[test]
    fn together_is_the_list() {
        let mut c = config(&[("disturbed.together", 1.0)]);
        for all in [&ALWAYS[..], &AFTER[..]] {
            let sizes = sizes(&c, all, 1);
            assert!(sizes.iter().all(|&size| size == 1.0));
            add(&mut c, all, &sizes);
        }
        let mut expected = config(&[
            ("disturbed.together", 1.0),
            ("iron.slots", 0.003),
            ("iron.stator_fixed", 0.003),
            ("measurement.cross_talk_a", 0.005),
            ("measurement.lag_b_us", 2.0),
            ("inverter.node_capacitance_f", 450e-12),
            ("inverter.extra_dead_time_s", 0.2e-6),
            ("inverter.on_resistance", 0.3),
            ("dc_link.ripple", 0.02),
            ("measurement.dc_lag_us", 300.0),
            ("measurement.dc_gain_error", 0.005),
            ("measurement.cubic_error", 0.005),
            ("measurement.drift_a", 0.001),
            ("shaft.static_nm", 0.05),
            ("shaft.once_nm", 0.03),
        ]);
        expected.motor.r_r = 1.1 * 1.2;
        assert_eq!(c.changes(), expected.changes());
    }

    /// Over 2000 seeds: as often positive as negative if the disturbance has a sign, otherwise never negative, up to the size.
    #[test]
    fn drawn_sizes_fill_their_range() {
        let c = config(&[("disturbed.drawn", 0.5)]);
        let drawn: Vec<Vec<f64>> = (0..2000).map(|seed| sizes(&c, &ALWAYS, seed)).collect();
        for (n, disturbance) in ALWAYS.iter().enumerate() {
            let of = || drawn.iter().map(|sizes| sizes[n]);
            let (least, most) = (of().fold(1.0, f64::min), of().fold(-1.0, f64::max));
            let from = if disturbance.1 == Sign::Either { -0.5 } else { 0.0 };
            assert!((least - from).abs() < 0.005 && (most - 0.5).abs() < 0.005, "{n}");
            // Standard deviation of the mean: 0.5/sqrt(3 * 2000).
            let mean = of().sum::<f64>() / 2000.0;
            assert!((mean - 0.5 * (from + 0.5)).abs() < 4.0 * 0.0065, "{n}: {mean}");
        }
        assert_eq!(sizes(&c, &AFTER, 7), sizes(&c, &AFTER, 7));
    }
}

//! The thermistor of the heat sink.

use micromath::F32;

use super::Ntc;
use drive_core::CONVERTER_CODES;
use drive_core::protect::HeatSink;

/// 25 °C, K.
const T_25: f32 = 298.15;
/// 0 °C, K.
const T_0: f32 = 273.15;
/// Coldest and hottest plausible heat sink and motor, °C. Beyond them the sensor is open or shorted.
pub(super) const COLDEST_C: f32 = -40.0;
pub(super) const HOTTEST_C: f32 = 200.0;

impl Ntc {
    /// Returns the temperature at the ADC counts `code`, °C, for telemetry. It is within 0.1 °C of the formula from
    /// -40 to 150 °C. Counts at either end of the range give the temperature of the next count.
    pub fn celsius(&self, code: u16) -> f32 {
        let code = f32::from(code.clamp(1, CONVERTER_CODES - 1));
        let other = f32::from(CONVERTER_CODES) - code;
        let ratio = if self.to_ground { code / other } else { other / code };
        1.0 / (1.0 / T_25 + ln(self.divider_ohm * ratio / self.ohm_25) / self.beta_k) - T_0
    }

    /// Returns the ADC counts at a temperature, °C.
    pub fn code(&self, celsius: f32) -> u16 {
        let inverse = 1.0 / f64::from(celsius + T_0) - 1.0 / f64::from(T_25);
        let ohms = f64::from(self.ohm_25) * libm::exp(f64::from(self.beta_k) * inverse);
        let divider = f64::from(self.divider_ohm);
        let share = if self.to_ground { ohms } else { divider } / (ohms + divider);
        libm::round(share * f64::from(CONVERTER_CODES)) as u16
    }

    /// Returns the smallest and largest ADC counts between the coldest plausible temperature and `limit_c`, °C.
    pub fn window(&self, limit_c: f32) -> (u16, u16) {
        let (cold, hot) = (self.code(COLDEST_C), self.code(limit_c));
        if self.to_ground { (hot, cold) } else { (cold, hot) }
    }

    /// Returns the checks of a heat sink whose derating begins at `derate_c` and ends at `limit_c`, °C.
    pub fn checks(&self, derate_c: f32, limit_c: f32) -> HeatSink {
        let (hot, from) = (f32::from(self.code(limit_c)), f32::from(self.code(derate_c)));
        HeatSink {
            window: self.window(limit_c),
            hot_is_low: self.to_ground,
            shorted: self.code(HOTTEST_C),
            hot,
            // Two settings that are too close have equal counts, and there is no band.
            per_code: if hot == from { f32::MAX } else { 1.0 / (hot - from) },
        }
    }
}

/// Returns the logarithm by micromath, within 1e-4. Below one, micromath takes an approximate inverse and is off by up to 0.08, so
/// the argument is inverted here.
fn ln(x: f32) -> f32 {
    if x < 1.0 { -F32(1.0 / x).ln().0 } else { F32(x).ln().0 }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;
    use drive_core::Fault;

    const LOW: Ntc =
        Ntc { ohm_25: 10_000.0, beta_k: 3950.0, divider_ohm: 10_000.0, to_ground: true };

    /// Compares with the formula in double precision, for every ADC count.
    #[test]
    fn the_temperature_is_within_a_tenth_of_a_degree() {
        for ntc in [Ntc::default(), LOW, Ntc { ohm_25: 47_000.0, beta_k: 4050.0, ..LOW }] {
            let (first, last) = ntc.window(150.0);
            for code in first..=last {
                let share = f64::from(code) / f64::from(CONVERTER_CODES);
                let ratio =
                    if ntc.to_ground { share / (1.0 - share) } else { (1.0 - share) / share };
                let log = (f64::from(ntc.divider_ohm) * ratio / f64::from(ntc.ohm_25)).ln();
                let exact = 1.0 / (1.0 / 298.15 + log / f64::from(ntc.beta_k)) - 273.15;
                let error = (f64::from(ntc.celsius(code)) - exact).abs();
                assert!(error < 0.1, "{ntc:?}, code {code}: {error} of {exact}");
            }
        }
    }

    /// At 25 °C the divider is simple: 4.7/14.7 and 10/20 of 4095.
    #[test]
    fn codes_and_temperatures_belong_together() {
        assert_eq!(Ntc::default().code(25.0), 1309);
        assert_eq!(LOW.code(25.0), 2048);
        for celsius in [-20.0, 0.0, 25.0, 60.0, 85.0, 100.0] {
            for ntc in [Ntc::default(), LOW] {
                let error = ntc.celsius(ntc.code(celsius)) - celsius;
                // Half an ADC count is 0.15 °C at most in this range.
                assert!(error.abs() < 0.3, "{celsius}: {error}");
            }
        }
        assert!(Ntc::default().window(85.0).0 < Ntc::default().window(85.0).1);
        assert!(LOW.window(85.0).0 < LOW.window(85.0).1);
    }

    /// The share falls linearly with the temperature except for the curve of the divider: all of the current below, none at the
    /// limit.
    #[test]
    fn the_current_falls_between_the_two_temperatures() {
        for ntc in [Ntc::default(), LOW] {
            let checks = ntc.checks(70.0, 85.0);
            for tenths in 600..=870 {
                let celsius = tenths as f32 / 10.0;
                let straight = ((85.0 - celsius) / 15.0).clamp(0.0, 1.0);
                let share = checks.share(ntc.code(celsius)).clamp(0.0, 1.0);
                assert!((share - straight).abs() < 0.06, "{ntc:?}, {celsius}: {share}");
            }
            assert!(checks.share(ntc.code(25.0)) >= 1.0);
        }
    }

    #[test]
    fn an_open_and_a_shorted_thermistor_are_told_from_a_hot_one() {
        for (ntc, open, shorted) in [(Ntc::default(), 0, 4095), (LOW, 4095, 0)] {
            let checks = ntc.checks(70.0, 85.0);
            assert_eq!(checks.fault(open), Fault::ThermistorOpen);
            assert_eq!(checks.fault(shorted), Fault::ThermistorShorted);
            for celsius in [90.0, 120.0, 190.0] {
                assert_eq!(checks.fault(ntc.code(celsius)), Fault::OverTemperature, "{celsius}");
            }
        }
    }

    #[test]
    fn a_code_at_the_end_of_the_range_is_finite() {
        for code in [0, CONVERTER_CODES, u16::MAX] {
            assert!(LOW.celsius(code).is_finite() && Ntc::default().celsius(code).is_finite());
        }
    }
}

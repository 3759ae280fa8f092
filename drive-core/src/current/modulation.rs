//! Space-vector modulation (section 2.2, Table 2, Figures 4 and 5).
//!
//! Centring the highest and the lowest phase voltage on half the dc link yields the symmetric sequence
//! O_000, U_x, U_x±60, O_111, U_x±60, U_x, O_000 with equal shares of the two zero vectors, without
//! sectors or tables. A test compares the on-times with Table 2.

use crate::{Abc, AlphaBeta, SQRT_3, math};

/// Pulses shorter than the dead time plus this time are dropped or extended, s.
const SHORTEST_EFFECTIVE_PULSE_S: f32 = 1e-6;

/// Coefficients of the modulator.
///
/// ```
/// use induction_drive_core::{Abc, AlphaBeta, current::Modulator, io::PERIOD_S};
///
/// let modulator = Modulator::new(2.2e-6, PERIOD_S, false);
/// // Zero voltage: all legs at half the dc link.
/// assert_eq!(modulator.step(AlphaBeta::ZERO, Abc::ZERO, 311.0).duties, [0.5; 3]);
/// // 400 V along phase a: limited to the corner of the hexagon, 2/3 of the dc link.
/// let out = modulator.step(AlphaBeta::new(400.0, 0.0), Abc::ZERO, 311.0);
/// assert_eq!(out.duties, [1.0, 0.0, 0.0]);
/// assert!(out.limited && (out.realised.alpha - 207.33).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Modulator {
    /// Shortest pulse, share of the period.
    shortest: f32,
    /// Share of the dc link that is left beside the dead-time compensation.
    usable: f32,
    /// Limit with shunts below the low sides.
    readable: Option<Readable>,
}

/// The limit that keeps two of three legs readable.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Readable {
    /// Largest duty at which a leg can be read.
    duty: f32,
    /// Share of the dc link between the second highest leg and the lowest, without the compensation.
    share: f32,
}

/// Result of the modulation for one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulated {
    /// Duties of phases a, b, c, 0 to 1; see [`Output`](crate::Output).
    pub duties: [f32; 3],
    /// Realised mean voltage at the motor, V peak: the reference, limited to the hexagon, with dropped or
    /// extended pulses accounted for. Rounding to timer counts (11 mV at 311 V) is excluded: anti-windup with
    /// it would stall a controller on increments below half a count.
    pub realised: AlphaBeta,
    /// Whether `realised` differs from the reference.
    pub limited: bool,
}

impl Modulator {
    /// Creates a modulator for a dead time in s of legs that switch with the period `carrier_s`, s.
    ///
    /// `compensated`: whether a dead-time compensation is added; it needs twice its amplitude of the dc
    /// link.
    pub fn new(dead_time_s: f32, carrier_s: f32, compensated: bool) -> Self {
        let ratio = dead_time_s / carrier_s;
        Self {
            shortest: ratio + SHORTEST_EFFECTIVE_PULSE_S / carrier_s,
            usable: if compensated { 1.0 - 2.0 * ratio } else { 1.0 },
            readable: None,
        }
    }

    /// Returns the modulator for shunts below the low sides, which can be read up to the duty `readable`.
    ///
    /// The duty of the second highest leg then stays at or below `readable`, so two of the three currents can always be
    /// read. All legs are moved down together if needed, which changes no voltage between phases. The circle inside the
    /// hexagon, the whole range of linear modulation, needs 93.3 % of the period for the second highest leg, so with
    /// `readable` of at least 93.3 % no range is lost. With less, the corners of the hexagon are cut.
    pub fn readable(mut self, readable: Option<f32>) -> Self {
        let share = |duty| duty - (1.0 - self.usable);
        self.readable = readable.map(|duty| Readable { duty, share: share(duty) });
        self
    }

    /// Returns the radius of the circle inside the hexagon, V peak: the largest vector available in
    /// every direction at a dc link of `v_dc`, V.
    pub fn circle(&self, v_dc: f32) -> f32 {
        self.usable * v_dc * (1.0 / SQRT_3)
    }

    /// Returns the duties for a mean voltage `wanted`, V peak, plus the dead-time `compensation`, V
    /// per phase, at a dc link of `v_dc` > 0, V. The power stage loses the compensation again.
    ///
    /// A voltage outside the hexagon is shortened; its angle is kept.
    #[inline(always)] // runs in every period, with its values in registers
    pub fn step(&self, wanted: AlphaBeta, compensation: Abc, v_dc: f32) -> Modulated {
        let mut motor = wanted.to_abc();
        let (low, high) = extremes(motor);
        let (span, usable) = (high - low, self.usable * v_dc);
        let mut shortened = span > usable;
        if shortened {
            motor = motor * ratio(usable, span);
        }
        if let Some(readable) = self.readable {
            let (span, usable) = (second(motor) - extremes(motor).0, readable.share * v_dc);
            if span > usable {
                motor = motor * ratio(usable, span);
                shortened = true;
            }
        }
        // The lowest and the highest leg are centred on half the dc link.
        let leg = motor + compensation;
        let (low, high) = extremes(leg);
        let per_volt = 1.0 / v_dc;
        let mut centre = 0.5 * (1.0 - (low + high) * per_volt);
        if let Some(readable) = self.readable {
            let highest = readable.duty - second(leg) * per_volt;
            if centre > highest {
                centre = highest;
            }
        }
        let duty = |volts: f32| centre + volts * per_volt;
        let ideal = [leg.a, leg.b, leg.c].map(duty);
        // If the lowest and the highest leg are valid, all three are. NaN fails the comparisons.
        let is_whole = duty(low) >= self.shortest && 1.0 - duty(high) >= self.shortest;
        let duties = if is_whole { ideal } else { ideal.map(|duty| self.drop_or_extend(duty)) };
        // NaN differs from itself and so counts as limited.
        let limited = shortened || (!is_whole && duties != ideal);
        let realised = if limited {
            // A leg that does not switch has no dead time.
            let dead = 0.5 * (1.0 - self.usable) * v_dc;
            let leg = |duty: f32, lost: f32| {
                let switches = duty > 0.0 && duty < 1.0;
                duty * v_dc - if switches { lost } else { lost - math::limited(lost, dead) }
            };
            let ([a, b, c], lost) = (duties, compensation);
            Abc::new(leg(a, lost.a), leg(b, lost.b), leg(c, lost.c)).to_alpha_beta()
        } else {
            wanted
        };
        Modulated { duties, realised, limited }
    }

    /// Rounds a too short pulse of either switch to no pulse or to the shortest one, whichever is nearer.
    fn drop_or_extend(&self, duty: f32) -> f32 {
        let rest = 1.0 - duty;
        if duty < self.shortest {
            if duty < 0.5 * self.shortest { 0.0 } else { self.shortest }
        } else if rest < self.shortest {
            if rest < 0.5 * self.shortest { 1.0 } else { 1.0 - self.shortest }
        } else {
            duty
        }
    }
}

/// Returns `part / whole`. The function is cold, because inline the compiler would divide in every period at any voltage.
#[cold]
fn ratio(part: f32, whole: f32) -> f32 {
    part / whole
}

/// Returns the second highest component.
fn second(v: Abc) -> f32 {
    let (low, high) = extremes(v);
    v.a + v.b + v.c - low - high
}

/// Returns the lowest and the highest component.
fn extremes(v: Abc) -> (f32, f32) {
    let (low, high) = if v.a < v.b { (v.a, v.b) } else { (v.b, v.a) };
    (if v.c < low { v.c } else { low }, if v.c > high { v.c } else { high })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::PERIOD_S;
    use core::f64::consts::PI;
    use proptest::prelude::*;

    const TOP: u16 = 14_167;
    const V_DC: f32 = 311.0;
    /// Half a timer count, as a phase voltage, plus the rounding of f32.
    const COUNT_V: f64 = 311.0 / 14_167.0;

    fn modulator() -> Modulator {
        Modulator::new(2.2e-6, PERIOD_S, false)
    }

    fn polar(length: f64, angle: f64) -> AlphaBeta {
        AlphaBeta::new((length * angle.cos()) as f32, (length * angle.sin()) as f32)
    }

    /// Returns the compare values of the timer.
    fn counts(modulated: &Modulated) -> [u16; 3] {
        modulated.duties.map(|duty| (duty * f32::from(TOP)).round() as u16)
    }

    /// Returns the mean voltage of these compare values, V peak.
    fn mean(compare: [u16; 3]) -> AlphaBeta {
        let [a, b, c] = compare.map(|c| f32::from(c) / f32::from(TOP) * V_DC);
        Abc::new(a, b, c).to_alpha_beta()
    }

    /// Returns the on-times of the two neighbouring vectors from Table 2, in f64 and by sectors.
    fn table_2(length: f64, angle: f64) -> [f64; 3] {
        let sector = (angle / (PI / 3.0)).floor();
        let within = angle - sector * PI / 3.0;
        let m = 3f64.sqrt() * length / f64::from(V_DC);
        let (t1, t2) = (m * (PI / 3.0 - within).sin(), m * within.sin());
        let t0 = 1.0 - t1 - t2;
        // These are U_0, U_60, … of Table 2 as legs abc.
        let vectors = [[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1]];
        let (u1, u2) = (vectors[sector as usize % 6], vectors[(sector as usize + 1) % 6]);
        core::array::from_fn(|leg| 0.5 * t0 + t1 * f64::from(u1[leg]) + t2 * f64::from(u2[leg]))
    }

    #[test]
    fn the_on_times_are_those_of_table_2() {
        for degrees in 0..360 {
            let angle = (f64::from(degrees) + 0.5).to_radians();
            for length in [1.0, 50.0, 120.0, 170.0] {
                let ours = counts(&modulator().step(polar(length, angle), Abc::ZERO, V_DC));
                for (count, duty) in ours.iter().zip(table_2(length, angle)) {
                    let difference = f64::from(*count) - duty * f64::from(TOP);
                    assert!(difference.abs() < 0.6, "{length} V at {degrees}: {difference}");
                }
            }
        }
    }

    #[test]
    fn compensation_does_not_cost_the_wanted_voltage() {
        // Since the part for the compensation is kept free, the compensated legs never saturate. A leg that does not switch
        // has no dead time.
        let m = Modulator::new(2.2e-6, PERIOD_S, true);
        let dt = V_DC * 2.2e-6 / PERIOD_S;
        for degrees in 0..360 {
            let w = polar(400.0, f64::from(degrees).to_radians());
            let out = m.step(w, Abc::new(dt, -dt, dt), V_DC);
            assert!(counts(&out).iter().all(|&c| c <= TOP));
            let duties = counts(&out);
            let lost =
                |leg: usize, volts| if (1..TOP).contains(&duties[leg]) { volts } else { 0.0 };
            let put_out =
                mean(duties) - Abc::new(lost(0, dt), lost(1, -dt), lost(2, dt)).to_alpha_beta();
            let error = put_out - out.realised;
            assert!(error.length_squared() < (2.0 * COUNT_V as f32).powi(2));
        }
    }

    /// Share of the period in which the shunts can be read.
    const READABLE: f32 = 0.94;

    #[test]
    fn with_shunts_two_legs_are_always_readable_and_the_circle_is_kept() {
        for compensated in [false, true] {
            let plain = Modulator::new(2.2e-6, PERIOD_S, compensated);
            let m = plain.readable(Some(READABLE));
            for degrees in 0..720 {
                let angle = f64::from(degrees).to_radians() / 2.0;
                for share in [0.3, 0.9, 0.999, 1.2, 3.0] {
                    let wanted = polar(share * f64::from(plain.circle(V_DC)), angle);
                    let out = m.step(wanted, Abc::ZERO, V_DC);
                    let readable = out.duties.iter().filter(|&&d| d <= READABLE + 1e-6).count();
                    assert!(readable >= 2, "{share} at {angle}: {:?}", out.duties);
                    let error = mean(counts(&out)) - out.realised;
                    assert!(error.length_squared().sqrt() < 2.0 * COUNT_V as f32);
                    if share < 1.0 {
                        // A pulse that is too short is dropped or extended in the same way with shunts.
                        let lost = (out.realised - wanted).length_squared().sqrt();
                        let shortest = m.shortest * V_DC;
                        assert!(lost <= 0.7 * shortest, "{share} at {angle}: {lost} V");
                    }
                }
            }
        }
    }

    #[test]
    fn not_a_number_does_not_panic() {
        let out = modulator().step(AlphaBeta::new(f32::NAN, 1.0), Abc::ZERO, V_DC);
        assert!(counts(&out).iter().all(|&c| c <= TOP));
        let _ = modulator().step(AlphaBeta::ZERO, Abc::ZERO, 0.0);
    }

    proptest! {
        #[test]
        fn realised_is_what_the_counts_put_out(length in 0f64..500.0, angle in 0f64..std::f64::consts::TAU) {
            let wanted = polar(length, angle);
            let out = modulator().step(wanted, Abc::ZERO, V_DC);
            let error = mean(counts(&out)) - out.realised;
            prop_assert!(f64::from(error.length_squared()).sqrt() < COUNT_V, "{error:?}");
        }

        #[test]
        fn inside_the_hexagon_nothing_is_limited(length in 0f64..165.0, angle in 0f64..std::f64::consts::TAU) {
            // 165 V is below 311/sqrt(3) less the shortest pulses.
            let wanted = polar(length, angle);
            prop_assert_eq!(modulator().step(wanted, Abc::ZERO, V_DC).realised, wanted);
        }

        #[test]
        fn limiting_keeps_the_angle(length in 210f64..2000.0, angle in 0f64..std::f64::consts::TAU) {
            // There is no shortest pulse here, since dropping pulses turns the angle by up to 0.5 degrees.
            let m = Modulator { shortest: 0.0, ..modulator() };
            let out = m.step(polar(length, angle), Abc::ZERO, V_DC).realised;
            let turned = f64::from(out.beta).atan2(f64::from(out.alpha)) - angle;
            prop_assert!(((turned + PI).rem_euclid(2.0 * PI) - PI).abs() < 1e-5);
            // The result lies on the hexagon, so the span is the dc link.
            let (low, high) = extremes(out.to_abc());
            prop_assert!((high - low - V_DC).abs() < 1e-3);
        }

        #[test]
        fn no_pulse_is_shorter_than_dead_time_and_a_microsecond(length in 0f64..2000.0, angle in 0f64..std::f64::consts::TAU) {
            let shortest = (3.2e-6 * 6000.0 * f64::from(TOP)).floor() as u16;
            for c in counts(&modulator().step(polar(length, angle), Abc::ZERO, V_DC)) {
                prop_assert!(c == 0 || c == TOP || (shortest..=TOP - shortest).contains(&c), "{c}");
            }
        }
    }

    /// A pulse of either switch is dropped if it is below half the shortest, and lengthened otherwise.
    #[test]
    fn short_pulses_are_dropped_or_lengthened() {
        let modulator = Modulator { shortest: 0.04, ..modulator() };
        for (duty, expected) in [
            (0.0, 0.0),
            (0.0199, 0.0),
            (0.0201, 0.04),
            (0.0399, 0.04),
            (0.0401, 0.0401),
            (0.5, 0.5),
        ] {
            assert_eq!(modulator.drop_or_extend(duty), expected, "{duty}");
            let other = modulator.drop_or_extend(1.0 - duty);
            assert!((other - (1.0 - expected)).abs() < 1e-6, "{duty}");
        }
    }

    #[test]
    fn the_circle_touches_the_hexagon() {
        let modulator = modulator();
        let circle = modulator.circle(V_DC);
        for (angle, ratio) in [(PI / 6.0, 1.0), (0.0, 2.0 / 3.0_f64.sqrt())] {
            let modulated = modulator.step(polar(1.5 * f64::from(circle), angle), Abc::ZERO, V_DC);
            let length = f64::from(modulated.realised.length_squared()).sqrt();
            assert!((length / f64::from(circle) - ratio).abs() < 1e-5, "{angle}: {length}");
            assert!(
                !modulator.step(polar(0.95 * f64::from(circle), angle), Abc::ZERO, V_DC).limited
            );
        }
    }
}

//! The injection axis, which follows the corrections of the [filter](super::angle_filter) or the turn of the observer.

use super::angle_filter::Correction;
use super::hand_over::Turning;
use crate::Angle;

/// The injection axis and the speed of the rotor. Frequencies are in electrical turns per period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis {
    /// Angle of the axis at the present sample, electrical.
    pub angle: Angle,
    /// Frequency of the axis.
    pub freq: f32,
    /// Electrical speed of the rotor.
    pub rotor_freq: f32,
    /// Acceleration of the rotor, electrical turns per period squared.
    pub(crate) acceleration: f32,
    /// Correction per period from the latest saliency. It is held for an injection period, which adds 1.1
    /// ms on average to the 3.2 ms delay of the averages, little for a loop of 4 Hz.
    pub(crate) correction: Correction,
}

/// Share of the newest value in the speed from the observer: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;
/// Share by which the acceleration decays in a period while the observer gives the angle.
const FORGETTING: f32 = 0.01;

impl Axis {
    /// Advances by one period while saliency and voltage track: with the latest correction and the slip or, while the observer
    /// leads, by the turn of the observer. Returns whether the turn is finite. (The drive checks that the speed is finite and
    /// within limits.)
    #[inline(always)] // runs in every period, with its values in registers
    pub fn step(&mut self, slip_freq: f32, turning: &Turning) -> bool {
        let turn = if turning.leads {
            self.acceleration *= 1.0 - FORGETTING;
            self.rotor_freq += ROTOR_SMOOTHING * (turning.turned - turning.slip - self.rotor_freq);
            let freq = self.rotor_freq + slip_freq;
            // The turn belongs to an older current, so the change of the speed since then is compensated.
            let turn = turning.turned + turning.age * (freq - self.freq);
            self.freq = freq;
            turn
        } else {
            let correction = &self.correction;
            self.acceleration += correction.acceleration;
            self.rotor_freq += correction.speed + self.acceleration;
            self.freq = self.rotor_freq + slip_freq;
            self.freq + correction.angle
        };
        self.angle += Angle::within_turn(turn);
        turn.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turn that is NaN leaves speed and frequency finite, so without a report it would be undetected.
    #[test]
    fn a_turn_that_is_no_number_is_told() {
        for leads in [false, true] {
            for (angle, turned) in [(f32::NAN, 0.0), (0.0, f32::NAN), (0.0, 0.0)] {
                let correction = Correction { angle, ..Correction::default() };
                let mut axis = Axis { rotor_freq: 0.01, correction, ..Axis::default() };
                let turning = Turning { leads, turned, ..Turning::default() };
                let finite = axis.step(0.0, &turning);
                let used = if leads { turned } else { angle };
                assert_eq!(finite, used.is_finite());
            }
        }
    }

    /// Corrections change angle, speed and acceleration; the slip is fed forward. A source that does not lead changes nothing.
    #[test]
    fn corrections_and_slip_move_the_axis_until_the_observer_leads() {
        let correction = Correction { angle: 1e-3, speed: 1e-5, acceleration: 1e-6 };
        let mut axis = Axis { rotor_freq: 0.001, correction, ..Axis::default() };
        let seen = Turning { leads: false, turned: 0.4, slip: 0.3, age: 2.0 };
        for n in 1..=3_u8 {
            let before = axis.angle;
            assert!(axis.step(2e-4, &seen));
            let n = f32::from(n);
            // The speed rises by 1e-5 per period, and by 1e-6 + 2e-6 + ... due to the acceleration.
            let speed = 0.001 + 1e-5 * n + 1e-6 * 0.5 * n * (n + 1.0);
            assert!((axis.rotor_freq - speed).abs() < 1e-8);
            assert!(((axis.angle - before).to_turns() - (speed + 2e-4 + 1e-3)).abs() < 1e-6);
        }
        // While the observer leads, the axis rotates with its turn; without an age the change of the speed does not matter.
        let led = Turning { leads: true, turned: 0.02, slip: 2e-4, age: 0.0 };
        let before = axis.angle;
        assert!(axis.step(2e-4, &led));
        assert!(((axis.angle - before).to_turns() - 0.02).abs() < 1e-6);
        for _ in 0..600 {
            axis.step(2e-4, &led);
        }
        assert!((axis.rotor_freq - (0.02 - 2e-4)).abs() < 1e-6);
    }
}

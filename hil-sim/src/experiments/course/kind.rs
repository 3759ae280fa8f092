//! The kinds of runs, each with the commands to the drive over time.

use super::limits::{MOST_A, nominal_limit_a, torque_nm};
use super::{Change, Course, Part, Ramp, Shaft};
use crate::config::BatteryRuns;
use crate::experiments::disturbed::Asymmetry;
use crate::prelude::*;

/// A kind of run. Currents, speeds and torques are for the dissertation's motor; on others they are in proportion,
/// q-axis currents to the [nominal limit](nominal_limit_a).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// Constant q-axis current while a dynamometer holds this speed, rpm.
    Constant(i16),
    /// A random q-axis current every half second, shaft locked.
    Steps,
    /// q-axis current of 3 A, reversed every second, shaft locked.
    Reversals,
    /// q-axis current from -3 A to 3 A, or back, in three seconds, shaft locked.
    Ramp,
    /// Speed regulated at this reference, rpm, and then at its opposite; free shaft.
    Speed(i16),
    /// Speed regulated, a step of 0.4 Nm on a free shaft.
    Load,
    /// Speed regulated, a step of this share of the torque at the [nominal limit](nominal_limit_a), in thousandths;
    /// free shaft.
    LoadStep(u16),
    /// q-axis current near its maximum for six seconds, shaft locked.
    Hold,
    /// Constant q-axis current while a dynamometer holds this speed, rpm; the rotor flux is suddenly rotated.
    Forced(i16),
    /// Dithered torque: a q-axis current that steps about a constant value this many times per second, shaft locked.
    /// With `forced`, the rotor flux is suddenly rotated.
    Restless {
        /// Steps per second.
        hz: u16,
        /// Whether the flux is rotated.
        forced: bool,
    },
    /// Constant q-axis current while a dynamometer drives the shaft through zero stator frequency, into or out of
    /// generating. An asymmetry appears after the saliency self-commissioning.
    Dragged(Asymmetry),
    /// A shaft that is driven as in `Dragged`. The asymmetry arises 0.5 s after the start.
    Arising(Asymmetry),
    /// Constant q-axis currents of either sign, each while a dynamometer drives the shaft through zero stator frequency, there and back.
    Quadrants,
}

/// The twelve kinds, in the order of the runs.
#[rustfmt::skip] // kinds, side by side
pub const KINDS: [Kind; 12] = [
    Kind::Constant(0), Kind::Constant(30), Kind::Constant(150), Kind::Constant(-150), Kind::Constant(300), Kind::Constant(-300),
    Kind::Steps, Kind::Reversals, Kind::Ramp, Kind::Speed(150), Kind::Speed(-150), Kind::Load,
];

/// Returns the kinds that a configuration asks for, and the default number of runs.
pub fn chosen(config: &Config) -> (Vec<Kind>, usize) {
    match config.battery.runs {
        BatteryRuns::Kinds => (KINDS.to_vec(), 8 * KINDS.len()),
        BatteryRuns::Load => {
            (vec![Kind::LoadStep((1e3 * config.battery.load_share).round() as u16)], 32)
        }
        BatteryRuns::Hold => (vec![Kind::Hold], 64),
        BatteryRuns::Forced => ([0, 60, 300].map(Kind::Forced).to_vec(), 90 * 3),
        BatteryRuns::Restless => {
            let of = |forced| [100, 600, 6000].map(|hz| Kind::Restless { hz, forced });
            ([false, true].map(of).concat(), 16 * 6)
        }
        BatteryRuns::Dragged | BatteryRuns::Arising => {
            let arises = config.battery.runs == BatteryRuns::Arising;
            let (a, b) = ([10, -10].map(Asymmetry::GainA), [10, -10].map(Asymmetry::GainB));
            let cross_talk = if arises { [10, -10] } else { [5, -5] };
            let mut all = [a, b, cross_talk.map(Asymmetry::CrossTalk)].concat();
            all.insert(0, Asymmetry::None);
            if config.model.plant != PlantModel::A {
                // Model A has no saliency that is fixed to the stator.
                all.extend([6, -6].map(Asymmetry::StatorFixed));
            }
            let runs = 24 * all.len();
            let kind = if arises { Kind::Arising } else { Kind::Dragged };
            (all.into_iter().map(kind).collect(), runs)
        }
    }
}

/// The smallest constant q-axis current, A.
const LEAST_A: f64 = 0.5;
/// Load, Nm, and the speeds at which it is applied, rpm.
const LOAD_NM: f64 = 0.4;
const LOAD_RPM: [f64; 4] = [0.0, 30.0, 150.0, -150.0];
/// Time after the start that the statistics of the error exclude, s: the angle settles.
const SETTLING_S: f64 = 0.5;
/// Time between two changes of a q-axis current, s.
const LEVEL_S: f64 = 0.5;
/// Smallest and largest rotation of the flux, degrees, and the time before and after it, s.
const TURN_DEG: (f64, f64) = (60.0, 180.0);
const TURN_S: (f64, f64) = (1.0, 4.0);
/// Largest deviation of a dithered current from its constant value, A.
const RESTLESS_A: f64 = 0.2;
/// A driven shaft: smallest q-axis current, relative to the largest; acceleration, rpm/s; speeds at the end and the
/// start of the drive, rpm; acceleration without torque, rpm/s; time under torque before and after, s.
const DRAGGED_SHARE: f64 = 0.75;
const DRAGGED_RPM_PER_S: (f64, f64) = (5.0, 300.0);
const DRAGGED_RPM: (f64, f64) = (150.0, 300.0);
const UNLOADED_RPM_PER_S: f64 = 600.0;
const DRAGGED_S: (f64, f64) = (1.5, 20.0);
/// Time after the start when an asymmetry arises, s.
const ARISES_S: f64 = 0.5;

impl Kind {
    /// Describes the kind in words.
    pub fn name(self) -> String {
        match self {
            Self::Constant(rpm) => format!("constant torque, {rpm} rpm"),
            Self::Steps => "torque steps".to_owned(),
            Self::Reversals => "reversals of 3 A".to_owned(),
            Self::Ramp => "torque ramp".to_owned(),
            Self::Speed(rpm) => format!("speed {rpm} rpm"),
            Self::Load => "load of 0.4 Nm".to_owned(),
            Self::LoadStep(share) => {
                format!("load of {} % of the limit", f64::from(share) / 10.0)
            }
            Self::Hold => "2.25 to 3 A at rest".to_owned(),
            Self::Forced(rpm) => format!("flux turned, {rpm} rpm"),
            Self::Restless { hz, forced } => {
                format!("steps at {hz} Hz{}", if forced { ", flux turned" } else { "" })
            }
            Self::Dragged(asymmetry) => format!("dragged, {}", asymmetry.name()),
            Self::Arising(asymmetry) => format!("dragged, {} after the start", asymmetry.name()),
            Self::Quadrants => "four quadrants".to_owned(),
        }
    }

    /// Returns the course of a run, with random values.
    pub fn course(self, config: &Config, random: &mut impl Rng) -> Course {
        let sign = sign(random);
        let (shaft, parts) = match self {
            Self::Constant(rpm) => {
                let i_q = sign * random.random_range(LEAST_A..=MOST_A);
                (Shaft::at(rpm), vec![Part::constant(i_q, 3.0)])
            }
            Self::Hold => {
                let i_q = sign * random.random_range(0.75..=1.0) * MOST_A;
                (Shaft::Locked, vec![Part::constant(i_q, 6.0)])
            }
            Self::Steps => {
                let mut i_q = || random.random_range(-MOST_A..=MOST_A);
                (Shaft::Locked, (0..6).map(|_| Part::constant(i_q(), LEVEL_S)).collect())
            }
            Self::Reversals => {
                let i_q = sign * MOST_A;
                (Shaft::Locked, [i_q, -i_q, i_q, -i_q].map(|i_q| Part::constant(i_q, 1.0)).into())
            }
            Self::Ramp => {
                let ramp = Ramp(-sign * MOST_A, sign * MOST_A);
                let reversal = Part { reference: Some(ramp), ..Part::constant(0.0, 3.0) };
                (Shaft::Locked, vec![Part::constant(ramp.0, LEVEL_S), reversal])
            }
            Self::Speed(rpm) => {
                let rpm = f64::from(rpm);
                (Shaft::Free, [rpm, -rpm].map(|rpm| Part::constant(rpm, 2.0)).into())
            }
            Self::Load | Self::LoadStep(_) => {
                let rpm = LOAD_RPM[random.random_range(0..LOAD_RPM.len())];
                let load_nm = match self {
                    Self::LoadStep(share) => {
                        sign * f64::from(share) / 1e3 * torque_nm(config, nominal_limit_a(config))
                    }
                    _ => config.newton_metres(sign * LOAD_NM),
                };
                // The load comes and goes while the speed is held.
                let loaded = Part { load_nm, ..Part::constant(rpm, 2.0) };
                (Shaft::Free, vec![Part::constant(rpm, 1.5), loaded, Part::constant(rpm, 1.0)])
            }
            Self::Forced(rpm) => {
                let i_q = sign * random.random_range(0.0..=MOST_A);
                let turned = Part { change: turn(random), ..Part::constant(i_q, TURN_S.1) };
                (Shaft::at(rpm), vec![Part::constant(i_q, TURN_S.0), turned])
            }
            Self::Dragged(_) | Self::Arising(_) => {
                let i_q = sign * random.random_range(DRAGGED_SHARE..=1.0) * MOST_A;
                let (least, most) = DRAGGED_RPM_PER_S;
                let rate = least * (most / least).powf(random.random_range(0.0..=1.0));
                // At this speed the torque brakes.
                let braked = -sign * random.random_range(DRAGGED_RPM.0..=DRAGGED_RPM.1);
                let held = |seconds| Part::constant(i_q, seconds);
                let (mut parts, ends) = if random.random() {
                    (Vec::new(), (0.0, braked))
                } else {
                    (vec![dragged(0.0, (0.0, braked), UNLOADED_RPM_PER_S)], (braked, 0.0))
                };
                if let Self::Arising(asymmetry) = self {
                    let arises = Part::event(Change::Asymmetry(asymmetry));
                    parts.splice(0..0, [Part::constant(0.0, ARISES_S), arises]);
                }
                parts.extend([held(DRAGGED_S.0), dragged(i_q, ends, rate), held(DRAGGED_S.1)]);
                (Shaft::Held(0.0), parts)
            }
            Self::Quadrants => {
                let rate = (DRAGGED_RPM_PER_S.0 * DRAGGED_RPM_PER_S.1).sqrt();
                let rpm = DRAGGED_RPM.0;
                let ways = [(sign, rpm), (sign, -rpm), (-sign, rpm), (-sign, -rpm)];
                let drag = |(sign, rpm): (f64, f64)| {
                    dragged(sign * random.random_range(LEAST_A..=MOST_A), (rpm, -rpm), rate)
                };
                (Shaft::Held(rpm), ways.map(drag).into())
            }
            Self::Restless { hz, forced } => {
                let middle = sign * random.random_range(0.0..=MOST_A - RESTLESS_A);
                let turned = (TURN_S.0 * f64::from(hz)) as usize;
                let parts = ((TURN_S.0 + TURN_S.1) * f64::from(hz)) as usize;
                let turn = if forced { turn(random) } else { Change::Nothing };
                let steps = (0..parts).map(|number| {
                    let i_q = middle + random.random_range(-RESTLESS_A..=RESTLESS_A);
                    let change = if number == turned { turn } else { Change::Nothing };
                    Part { change, ..Part::constant(i_q, 1.0 / f64::from(hz)) }
                });
                (Shaft::Locked, steps.collect())
            }
        };
        Course::from_rest(shaft, &[], SETTLING_S, &parts)
    }
}

/// Makes a part with a constant q-axis current while the dynamometer changes its speed by this many rpm/s.
fn dragged(i_q: f64, rpm: (f64, f64), rate: f64) -> Part {
    let change = Change::Shaft(Ramp(rpm.0, rpm.1));
    Part { change, ..Part::constant(i_q, (rpm.1 - rpm.0).abs() / rate) }
}

/// Returns a random rotation of the flux of either sign.
fn turn(random: &mut impl Rng) -> Change {
    Change::Flux(sign(random) * random.random_range(TURN_DEG.0..=TURN_DEG.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With Table 5 and 2.0 A of magnetising current the vector limit of 3.5 A leaves sqrt(3.5^2 - 2^2) = 2.872 A, and
    /// 62 % of its torque is 0.62 * 3/2 * 2 * 0.1771^2/0.2047 * 2.0 * 2.872 = 1.637 Nm. With 0.7 A the 3 A of the speed
    /// loop are less.
    #[test]
    fn load_steps_are_shares_of_the_torque_at_the_nominal_limit() {
        let mut config = Config::default();
        assert!((nominal_limit_a(&config) - 3.0).abs() < 1e-6);
        config.set("sequence.i_d", 2.0).unwrap();
        assert!((nominal_limit_a(&config) - 2.872).abs() < 1e-3);
        config.battery.runs = BatteryRuns::Load;
        config.battery.load_share = 0.62;
        let (kinds, runs) = chosen(&config);
        assert_eq!((kinds.as_slice(), runs), (&[Kind::LoadStep(620)][..], 32));
        let course = kinds[0].course(&config, &mut seeded(1));
        let loads: Vec<f64> = course.parts[2..].iter().map(|part| part.load_nm.abs()).collect();
        assert_eq!((loads[0], loads[2]), (0.0, 0.0));
        assert!((loads[1] - 1.637).abs() < 2e-3, "{loads:?}");
    }

    /// A stator-fixed saliency changes nothing on model A, so it is none of its kinds.
    #[test]
    fn a_kind_that_changes_nothing_is_left_out() {
        let mut config = Config::default();
        config.battery.runs = BatteryRuns::Dragged;
        let fixed = |config: &Config| {
            let (kinds, runs) = chosen(config);
            let is_fixed = |kind: &&Kind| matches!(kind, Kind::Dragged(Asymmetry::StatorFixed(_)));
            (kinds.iter().filter(is_fixed).count(), kinds.len(), runs)
        };
        assert_eq!(fixed(&config), (0, 7, 168));
        config.set("plant", "r").unwrap();
        assert_eq!(fixed(&config), (2, 9, 216));
    }

    /// A dithered current changes as often as stated, by more than noise, for the whole run, and the flux is rotated
    /// once. Torque of either sign is present while the speed passes zero in either direction.
    #[test]
    fn quadrants_are_all_four() {
        let course = Kind::Quadrants.course(&Config::default(), &mut seeded(1));
        let ways = course.parts[2..].iter().map(|part| {
            let (Change::Shaft(rpm), i_q) = (part.change, part.reference.unwrap()) else {
                panic!()
            };
            assert!(rpm.0 * rpm.1 < 0.0 && i_q.0.abs() >= LEAST_A && i_q.0 == i_q.1);
            (i_q.0 > 0.0, rpm.1 > rpm.0)
        });
        let mut ways: Vec<_> = ways.collect();
        ways.sort_unstable();
        assert_eq!(ways, [(false, false), (false, true), (true, false), (true, true)]);
    }

    #[test]
    fn restless_commands_never_rest() {
        let mut config = Config::default();
        config.battery.runs = BatteryRuns::Restless;
        for kind in chosen(&config).0 {
            let Kind::Restless { hz, forced } = kind else { continue };
            let course = kind.course(&config, &mut seeded(3));
            let parts = &course.parts[2..];
            assert_eq!(parts.len(), 5 * usize::from(hz));
            let seconds: f64 = parts.iter().map(|part| part.seconds).sum();
            assert!((seconds - 5.0).abs() < 1e-6, "{seconds}");
            let i_q = |part: &Part| part.reference.unwrap().0;
            let steps = parts.windows(2).map(|two| (i_q(&two[1]) - i_q(&two[0])).abs());
            // Two uniform values within ±0.2 A differ by 0.133 A in the mean.
            let mean = steps.sum::<f64>() / (parts.len() - 1) as f64;
            assert!((mean - 0.133).abs() < 0.015, "{hz}: {mean}");
            let turns = parts.iter().filter(|part| match part.change {
                Change::Flux(turn) => (60.0..=180.0).contains(&turn.abs()),
                _ => false,
            });
            assert_eq!(turns.count(), usize::from(forced));
        }
    }
}

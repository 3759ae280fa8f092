//! Homing: finds a mechanical stop of the shaft in position mode. It runs in the main loop.
//!
//! The drive presses towards the stop by [`Command::Press`], slowly and with little torque. A shaft that stands still for a
//! second against that torque is at the stop, or it is held by friction, or it still moves slowly after a bounce. Therefore
//! the shaft turns back by a tenth of a turn and approaches again, until it has stopped at the same position twice. This
//! becomes position 0, by [`Command::Home`]. A shaft that does not turn back was not at a stop.
//!
//! The accuracy was measured on the simulated motor against a stop of 100 N m/rad (`tests/homing.rs`), in both directions,
//! with 10 to 60 rpm and 0.4 to 1.5 A. Compared with the position to which that torque deflects the stop, position 0 is
//! within 0.002 turns with the encoder, within 0.01 turns without, and within 0.01 turns if an inertia of 0.06 kg m² swings
//! at the stop. At 100 rpm or more, the impact can turn the flux away from an angle that is tracked without an encoder,
//! hence the limit of the speed.

use core::ops::RangeInclusive;

use crate::motion::LARGEST_POSITION;
use crate::{Command, State};

/// Allowed speeds, mechanical rpm.
const RPM: RangeInclusive<f32> = 5.0..=60.0;
/// Allowed distances, mechanical turns.
const TURNS: RangeInclusive<f32> = 0.1..=LARGEST_POSITION;
/// Control periods for which a shaft at the stop must stand still: 1 s.
const STANDS: u32 = 6000;
/// Distance within which the shaft counts as standing still, turns.
const STILL: f32 = 0.02;
/// Least mean share of the q-axis current against which the shaft stands still. The rest is for the noise of a speed without an
/// encoder.
const PRESSES: f32 = 0.5;
/// Distance by which the shaft turns back from the stop, turns.
const BACK: f32 = 0.1;
/// Largest distance of two positions that count as the same, turns. Without an encoder the position drifts under torque.
const SAME: f32 = 0.02;
/// Largest number of approaches.
const TRIES: u8 = 5;

/// Plan of the search for the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Speed, mechanical rpm, 5 to 60; its sign is the direction.
    pub rpm: f32,
    /// Largest q-axis current, A peak.
    pub i_q: f32,
    /// Largest distance to the stop, mechanical turns, 0.1 to 1000.
    pub turns: f32,
}

/// A value of the plan that is out of range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}: outside {min} to {max} {unit}")]
pub struct OutOfRange {
    name: &'static str,
    value: f32,
    min: f32,
    max: f32,
    unit: &'static str,
}

/// A report of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Control periods, wrapping. A report with the same number is the same.
    pub periods: u32,
    /// State of the drive.
    pub state: State,
    /// Position, mechanical turns.
    pub turns: f32,
    /// Q-axis current reference, A.
    pub i_q: f32,
    /// Least and largest possible q-axis current, A.
    pub room: (f32, f32),
}

/// The next action.
///
/// Exhaustive on purpose, since every action has to be carried out.
#[allow(clippy::large_enum_variant)] // the value is used at once
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Nothing to be done yet.
    Wait,
    /// Give the drive this command.
    Command(Command),
    /// The homing has ended: position 0 is at the stop and the shaft stays there, or the shaft stays at its present position.
    Ended(Result<(), Failure>),
}

/// Reason why there is no position 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The drive no longer regulates the position.
    #[error("ended, the drive is {0}")]
    Left(State),
    /// There is no stop within this distance, turns.
    #[error("no stop within {0} turns")]
    NoStop(f32),
    /// The shaft does not turn back from the position at which it stood still.
    #[error("the shaft does not turn with this current")]
    Held,
    /// The shaft did not stop at the same position twice.
    #[error("the shaft never stopped at the same position twice")]
    Unsteady,
}

/// A shaft that stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stand {
    /// Its position, turns, and its beginning, control periods.
    at: f32,
    since: u32,
    /// Sums over the second half of the time: distance from that position, and share of the q-axis current; and their number.
    way: f32,
    share: f32,
    count: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Towards,
    /// Turning back from this position, turns.
    Back(f32),
    Ending(Result<(), Failure>),
}

/// A homing procedure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    plan: Plan,
    phase: Phase,
    periods: Option<u32>,
    /// Position at the beginning, turns.
    began: Option<f32>,
    stands: Option<Stand>,
    /// Position of the last stop, turns, and number of stops.
    stood: Option<f32>,
    tries: u8,
}

impl Homing {
    /// Creates a homing by this plan, with a q-axis current of at most `largest`, A.
    ///
    /// # Errors
    /// [`OutOfRange`].
    pub fn new(plan: Plan, largest: f32) -> Result<Self, OutOfRange> {
        check("the speed", plan.rpm.abs(), RPM, "rpm")?;
        check("the current", plan.i_q, 0.0..=largest, "A")?;
        check("the distance", plan.turns, TURNS, "turns")?;
        let phase = Phase::Towards;
        Ok(Self { plan, phase, periods: None, began: None, stands: None, stood: None, tries: 0 })
    }

    /// Returns the first command.
    pub fn begin(&self) -> Command {
        self.press(1.0)
    }

    fn press(&self, direction: f32) -> Command {
        Command::Press(direction * self.plan.rpm, self.plan.i_q)
    }

    /// Continues the homing; called with each report of the drive since the first command.
    pub fn poll(&mut self, seen: &Seen) -> Next {
        if let Phase::Ending(outcome) = self.phase {
            return Next::Ended(outcome);
        }
        if self.periods.replace(seen.periods) == Some(seen.periods) {
            return Next::Wait;
        }
        if seen.state != State::Position {
            return Next::Ended(Err(Failure::Left(seen.state)));
        }
        let began = *self.began.get_or_insert(seen.turns);
        match (self.phase, self.standing(seen)) {
            (Phase::Towards, Some(at)) => self.found(at),
            (Phase::Towards, _) if (seen.turns - began).abs() > self.plan.turns => {
                self.give_up(Failure::NoStop(self.plan.turns), seen.turns)
            }
            (Phase::Back(from), _) if (seen.turns - from).abs() >= BACK => {
                self.go_on(Phase::Towards, 1.0)
            }
            (Phase::Back(_), Some(_)) => self.give_up(Failure::Held, seen.turns),
            _ => Next::Wait,
        }
    }

    /// Returns the position at which the shaft has stood still against the torque, turns.
    fn standing(&mut self, seen: &Seen) -> Option<f32> {
        let forward = (self.plan.rpm > 0.0) == (self.phase == Phase::Towards);
        let (i_q, room) = if forward { (seen.i_q, seen.room.1) } else { (-seen.i_q, -seen.room.0) };
        let Seen { turns: at, periods: since, .. } = *seen;
        let begins = Stand { at, since, way: 0.0, share: 0.0, count: 0.0 };
        let stand = match &mut self.stands {
            Some(stand) if (at - stand.at).abs() <= STILL => stand,
            other => other.insert(begins),
        };
        let stood = seen.periods.wrapping_sub(stand.since);
        if stood >= STANDS / 2 {
            stand.way += at - stand.at;
            stand.share += i_q / self.plan.i_q.min(room);
            stand.count += 1.0;
        }
        if stood < STANDS {
            return None;
        }
        let Stand { at, way, share, count, .. } = *stand;
        self.stands = None;
        (share >= PRESSES * count).then_some(at + way / count)
    }

    fn found(&mut self, turns: f32) -> Next {
        let same = self.stood.replace(turns).is_some_and(|last| (turns - last).abs() <= SAME);
        self.tries += 1;
        if same {
            self.phase = Phase::Ending(Ok(()));
            Next::Command(Command::Home(turns))
        } else if self.tries < TRIES {
            self.go_on(Phase::Back(turns), -1.0)
        } else {
            self.give_up(Failure::Unsteady, turns)
        }
    }

    fn go_on(&mut self, phase: Phase, direction: f32) -> Next {
        (self.phase, self.stands) = (phase, None);
        Next::Command(self.press(direction))
    }

    fn give_up(&mut self, why: Failure, turns: f32) -> Next {
        self.phase = Phase::Ending(Err(why));
        Next::Command(Command::Position(turns))
    }
}

fn check(
    name: &'static str,
    value: f32,
    range: RangeInclusive<f32>,
    unit: &'static str,
) -> Result<(), OutOfRange> {
    let (min, max) = (*range.start(), *range.end());
    if range.contains(&value) { Ok(()) } else { Err(OutOfRange { name, value, min, max, unit }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Control periods from one report to the next.
    const EVERY: u32 = 60;

    /// A rigid shaft.
    struct Shaft<'a> {
        /// Distance of the stop, turns, at the n-th approach.
        stop: &'a dyn Fn(usize) -> f32,
        /// Q-axis current against the stop, A, and the possible current, backwards and forward.
        presses: [f32; 2],
        room: [f32; 2],
        held: bool,
    }

    /// The outcome within a minute, and all commands, each with its time, s, and the position of the shaft, turns.
    type Homed = (Option<Result<(), Failure>>, Vec<(Command, f32, f32)>);

    fn home(plan: Plan, shaft: &Shaft) -> Homed {
        let mut homing = Homing::new(plan, 3.0).unwrap();
        let mut given = vec![(homing.begin(), 0.0, 0.0)];
        let (mut turns, mut rpm, towards) = (0.0_f32, plan.rpm, plan.rpm.signum());
        for n in 0..6000 {
            let end = (shaft.stop)(given.len() / 2);
            turns += if shaft.held { 0.0 } else { rpm / 60.0 * EVERY as f32 / 6000.0 };
            turns = towards * end.min(turns * towards);
            let presses =
                if shaft.held || turns * towards == end { shaft.presses } else { [0.0; 2] };
            let seen = Seen {
                // The number wraps during the homing.
                periods: (n * EVERY).wrapping_sub(10_000),
                state: State::Position,
                turns,
                i_q: if rpm < 0.0 { -presses[0] } else { presses[1] },
                room: (-shaft.room[0], shaft.room[1]),
            };
            match homing.poll(&seen) {
                Next::Wait => assert_eq!(homing.poll(&seen), Next::Wait, "the same report"),
                Next::Command(command) => {
                    given.push((command, (n * EVERY) as f32 / 6000.0, turns));
                    rpm = if let Command::Press(rpm, _) = command { rpm } else { 0.0 };
                }
                Next::Ended(outcome) => return (Some(outcome), given),
            }
        }
        (None, given)
    }

    const PLAN: Plan = Plan { rpm: 30.0, i_q: 0.5, turns: 3.0 };
    const SHAFT: Shaft = Shaft { stop: &|_| 1.29, presses: [0.5; 2], room: [3.0; 2], held: false };

    #[test]
    fn the_stop_is_where_the_shaft_stands_twice() {
        for (rpm, presses) in [(30.0, [0.5; 2]), (-30.0, [0.5; 2]), (30.0, [0.0, 0.26])] {
            let (outcome, given) = home(Plan { rpm, ..PLAN }, &Shaft { presses, ..SHAFT });
            let [towards, back, again, (Command::Home(zero), ..)] = given[..] else {
                panic!("{given:?}")
            };
            assert_eq!(outcome, Some(Ok(())));
            assert_eq!(
                [towards.0, back.0, again.0],
                [rpm, -rpm, rpm].map(|rpm| Command::Press(rpm, 0.5))
            );
            // The shaft takes 2.58 s to the stop, stands still for a second, turns back by a tenth of a turn, and approaches again.
            assert!((zero - 1.29 * rpm.signum()).abs() < 1e-5, "{zero}");
            assert!((3.52..3.6).contains(&back.1), "{back:?}");
            assert!((0.099..0.106).contains(&(back.2 - again.2).abs()), "{again:?}");
        }
        // At least half of the current, or of the possible current in this direction, has to press.
        for (rpm, presses, room, found) in [
            (30.0, [0.0, 0.24], [3.0; 2], false),
            (-30.0, [0.24, 0.0], [3.0; 2], false),
            (30.0, [0.0, 0.16], [3.0, 0.3], true),
            (-30.0, [0.16, 0.0], [0.3, 3.0], true),
            (30.0, [0.0, 0.14], [3.0, 0.3], false),
        ] {
            let outcome = home(Plan { rpm, ..PLAN }, &Shaft { presses, room, ..SHAFT }).0;
            assert_eq!(outcome, found.then_some(Ok(())), "{rpm} {presses:?} {room:?}");
        }
    }

    #[test]
    fn the_shaft_stays_where_no_stop_is_found() {
        for (stop, held, why, commands) in [
            (&(|_| 9.0_f32) as &dyn Fn(usize) -> f32, false, Failure::NoStop(3.0), 2),
            (&|_| 1.3, true, Failure::Held, 3),
            (&|n| 1.3 + 0.021 * n as f32, false, Failure::Unsteady, 10),
        ] {
            for rpm in [30.0, -30.0] {
                let (outcome, given) = home(Plan { rpm, ..PLAN }, &Shaft { stop, held, ..SHAFT });
                assert_eq!((outcome, given.len()), (Some(Err(why)), commands));
                let (last, at) = (given.last().unwrap(), given[commands - 1].2);
                assert!(matches!(last.0, Command::Position(turns) if (turns - at).abs() < 0.001));
                assert!(why != Failure::NoStop(3.0) || (3.0..3.01).contains(&at.abs()), "{at}");
            }
        }
        let stop = &|n| 1.3 + 0.019 * n as f32;
        assert_eq!(home(PLAN, &Shaft { stop, ..SHAFT }).0, Some(Ok(())));
        let off = Seen { periods: 1, state: State::Off, turns: 0.0, i_q: 0.0, room: (-3.0, 3.0) };
        let left = Homing::new(PLAN, 3.0).unwrap().poll(&off);
        assert_eq!(left, Next::Ended(Err(Failure::Left(State::Off))));
    }

    #[test]
    fn a_plan_out_of_range_is_refused_by_name() {
        let text =
            |rpm, i_q, turns| Homing::new(Plan { rpm, i_q, turns }, 3.0).map_err(|e| e.to_string());
        for (rpm, i_q, turns) in [(5.0, 0.0, 0.1), (-60.0, 3.0, 1000.0)] {
            assert!(text(rpm, i_q, turns).is_ok());
        }
        for (plan, expected) in [
            ((-4.9, 1.0, 1.0), "the speed = 4.9: outside 5 to 60 rpm"),
            ((61.0, 1.0, 1.0), "the speed = 61: outside 5 to 60 rpm"),
            ((30.0, -0.1, 1.0), "the current = -0.1: outside 0 to 3 A"),
            ((30.0, f32::NAN, 1.0), "the current = NaN: outside 0 to 3 A"),
            ((30.0, 1.0, 0.09), "the distance = 0.09: outside 0.1 to 1000 turns"),
        ] {
            assert_eq!(text(plan.0, plan.1, plan.2).unwrap_err(), expected);
        }
    }
}

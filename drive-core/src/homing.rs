//! Homing: finds a stop of the shaft in position mode; for the main loop.
//!
//! The drive presses towards the stop by [`Command::Press`]: slowly, with little torque. A shaft that stands for a second
//! against that torque is at the stop, or friction holds it, or it turns slowly about where it bounced to. So it turns back
//! by a tenth of a turn and comes again, until it stands at the same place twice: there is position 0, by
//! [`Command::Home`]. A shaft that does not turn back was not at a stop.
//!
//! Measured on the simulated motor against a stop of 100 N m/rad (`tests/homing.rs`), both ways, 10 to 60 rpm, 0.4 to 1.5 A:
//! position 0 lies within 0.002 turns of where the stop yields to that torque with the encoder, within 0.01 turns
//! without, and within 0.01 turns where an inertia of 0.06 kg m² swings at the stop. From 100 rpm on, the impact can turn
//! the flux away from an angle that is tracked without an encoder: hence the limit of the speed.

use core::ops::RangeInclusive;

use crate::motion::LARGEST_POSITION;
use crate::{Command, State};

/// Speeds, mechanical rpm.
const RPM: RangeInclusive<f32> = 5.0..=60.0;
/// Ways, mechanical turns.
const TURNS: RangeInclusive<f32> = 0.1..=LARGEST_POSITION;
/// Control periods for which a shaft at the stop stands: 1 s.
const STANDS: u32 = 6000;
/// Way from where it began to stand within which it does, turns.
const STILL: f32 = 0.02;
/// Share of the torque current against which it stands, on average; the rest is the noise of a speed without an encoder.
const PRESSES: f32 = 0.5;
/// Way back from the stop, turns.
const BACK: f32 = 0.1;
/// Distance of two stands at the same place, turns. Without an encoder the position drifts under torque.
const SAME: f32 = 0.02;
/// Most stands.
const TRIES: u8 = 5;

/// How to look for the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Speed, mechanical rpm, 5 to 60; its sign is the direction.
    pub rpm: f32,
    /// Largest torque current, A peak.
    pub i_q: f32,
    /// Longest way to the stop, mechanical turns, 0.1 to 1000.
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
    /// State.
    pub state: State,
    /// Position, mechanical turns.
    pub turns: f32,
    /// Reference of the torque current, A.
    pub i_q: f32,
    /// Least and largest torque current that is possible, A.
    pub room: (f32, f32),
}

/// The next action.
///
/// Exhaustive on purpose: every action has to be carried out.
#[allow(clippy::large_enum_variant)] // taken at once
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Nothing yet.
    Wait,
    /// Give the drive this command.
    Command(Command),
    /// It has ended: position 0 is at the stop and the shaft stays there, or the shaft stays where it is.
    Ended(Result<(), Failure>),
}

/// Why there is no position 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The drive does not regulate the position any more.
    #[error("ended, the drive is {0}")]
    Left(State),
    /// No stop within this way, turns.
    #[error("no stop within {0} turns")]
    NoStop(f32),
    /// The shaft does not turn back from where it stood.
    #[error("the shaft does not turn with this current")]
    Held,
    /// It does not stand at the same place twice.
    #[error("the shaft never stood at the same place twice")]
    Unsteady,
}

/// A shaft that stands.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stand {
    /// Where, turns, and since when, periods.
    at: f32,
    since: u32,
    /// Sums in the second half of the way from there and of the share of the torque current, and their number.
    way: f32,
    share: f32,
    count: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Towards,
    /// Back from here, turns.
    Back(f32),
    Ending(Result<(), Failure>),
}

/// A homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    plan: Plan,
    phase: Phase,
    periods: Option<u32>,
    /// Where it began, turns.
    began: Option<f32>,
    stands: Option<Stand>,
    /// Where it stood last, turns, and how often it did.
    stood: Option<f32>,
    tries: u8,
}

impl Homing {
    /// A homing by this plan, with at most `largest` of torque current, A.
    ///
    /// # Errors
    /// [`OutOfRange`].
    pub fn new(plan: Plan, largest: f32) -> Result<Self, OutOfRange> {
        check("the speed", plan.rpm.abs(), RPM, "rpm")?;
        check("the current", plan.i_q, 0.0..=largest, "A")?;
        check("the way", plan.turns, TURNS, "turns")?;
        let phase = Phase::Towards;
        Ok(Self { plan, phase, periods: None, began: None, stands: None, stood: None, tries: 0 })
    }

    /// The first command.
    pub fn begin(&self) -> Command {
        self.press(1.0)
    }

    fn press(&self, direction: f32) -> Command {
        Command::Press(direction * self.plan.rpm, self.plan.i_q)
    }

    /// Goes on; called with each report of the drive since the first command.
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

    /// Where the shaft has been standing against the torque, turns.
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
        /// Distance of the stop, turns, the n-th time that it comes there.
        stop: &'a dyn Fn(usize) -> f32,
        /// Torque current against it, A, and what is possible, backwards and forward.
        presses: [f32; 2],
        room: [f32; 2],
        held: bool,
    }

    /// The outcome within a minute, and all commands, each with its time, s, and where the shaft was, turns.
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
                // Wraps on the way.
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
            // It takes 2.58 s to the stop and stands for a second, turns back by a tenth of a turn, and comes again.
            assert!((zero - 1.29 * rpm.signum()).abs() < 1e-5, "{zero}");
            assert!((3.52..3.6).contains(&back.1), "{back:?}");
            assert!((0.099..0.106).contains(&(back.2 - again.2).abs()), "{again:?}");
        }
        // Half of the current has to press, or of that which is possible in this direction.
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
            ((30.0, 1.0, 0.09), "the way = 0.09: outside 0.1 to 1000 turns"),
        ] {
            assert_eq!(text(plan.0, plan.1, plan.2).unwrap_err(), expected);
        }
    }
}

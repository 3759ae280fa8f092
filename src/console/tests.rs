mod announcements;
mod commission;
mod documents;
mod doubles;
mod lists;
mod numbers;
mod passport;
mod sessions;
mod stream;
mod tags;
mod torque;
mod typing;

use super::grammar::HELP;
use super::*;
use crate::boards;
use crate::front::Front;
use crate::recording::trace::Trigger;
use crate::rotor_tracking::Report;
use crate::settings::FirmwareSettings;
use crate::settings::keys;
/// Shared with the tests of command arbiter and store.
pub(crate) use doubles::{FakeBus, FakeDrive, found};
use doubles::{FakePort, FakeTerminals};
use drive_core::io::PERIOD_S;
use drive_core::learned::{Learned, Verdict};
use drive_core::{
    Command, Compare, Drive, Fault, FrontEndState, Hardware, Measured, Mode, Sample, State, Stop,
};
use proptest::prelude::*;
use rotor_id::online::NoEstimate;

/// A whole period of a drive with its front end.
fn step(drive: &mut Drive, front_end: &mut FrontEndState, sample: &Sample) -> Compare {
    drive.period(front_end, sample, &mut |_| {}).0
}

/// A console with a drive behind it. Shared with the tests of the modules.
pub(crate) struct Talk {
    pub front: Front,
    pub drive: FakeDrive,
    port: FakePort,
    pub terminals: FakeTerminals,
    /// The port of the bus, on a board that has one.
    pub bus: Option<FakeBus>,
    pub now_ms: u32,
    /// Duration of a design of the controllers, and the number of designs so far.
    design_ms: u32,
    designs: u8,
}

impl Talk {
    pub fn new() -> Self {
        Self::with(sessions::settings(""))
    }

    fn with(settings: FirmwareSettings) -> Self {
        Self {
            front: Front::new(settings),
            drive: FakeDrive::new(Drive::new(settings.build().unwrap())),
            port: FakePort { room: usize::MAX, ..FakePort::default() },
            terminals: FakeTerminals::default(),
            bus: None,
            now_ms: 0,
            design_ms: 0,
            designs: 0,
        }
    }

    pub fn poll(&mut self) {
        let Self { front, port, terminals, bus, drive, now_ms, design_ms, designs } = self;
        front.pass(port, bus.as_mut(), terminals, drive, *now_ms);
        if front.desk.has_designed(designs) {
            *now_ms += *design_ms;
        }
    }

    /// Lets time pass, with a pass of the main loop each millisecond.
    pub fn wait(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now_ms += 1;
            self.poll();
        }
    }

    /// Sends bytes and returns the replies, until the console has nothing more to say.
    pub fn say(&mut self, bytes: impl AsRef<[u8]>) -> Vec<String> {
        self.port.sent.extend(bytes.as_ref());
        // An event at the end of a pass is told in the next pass.
        let mut silent = 0;
        while !self.port.sent.is_empty() || silent < 2 {
            let said = self.port.received.len();
            self.poll();
            silent = if self.port.received.len() == said { silent + 1 } else { 0 };
        }
        let text = std::mem::take(&mut self.port.received);
        text.split_terminator("\r\n").map(str::to_owned).collect()
    }

    /// Sends a line that has one reply beside unrequested lines.
    pub fn ask(&mut self, line: &str) -> String {
        let mut replies = self.say(format!("{line}\n"));
        replies.retain(|reply| !reply.starts_with(line::UNASKED));
        assert_eq!(replies.len(), 1, "{replies:?}");
        replies.into_iter().next().unwrap()
    }
}

#[test]
fn a_motor_that_is_wired_as_it_should_be_is_checked_once() {
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive.injection.synchronous.allow_unlearned = true;
    // The simulated ADC is calibrated for its own reference.
    settings.drive.scales = drive_settings::Scales::default();
    settings.confirm_board();
    let mut talk = Talk::new();
    talk.front.desk = Desk::new(settings);
    talk.drive.drive = Drive::new(settings.build().unwrap());
    let mut plant = hil_sim::plant::Plant::new(&Default::default(), 1).unwrap();
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    let (mut pending, mut front_end) = (Compare::OFF, FrontEndState::default());
    while talk.drive.drive.state() != State::Magnetising {
        assert!(talk.drive.drive.state() != State::Off, "{}", talk.drive.drive.state());
        let compare = step(&mut talk.drive.drive, &mut front_end, &plant.sample());
        pending.enabled &= compare.enabled;
        plant.advance(&pending, f64::from(PERIOD_S));
        pending = compare;
    }
    assert!(talk.ask("get wiring_checked").starts_with("wiring_checked = yes (one of: no yes)"));
    talk.ask("stop");
    talk.drive.drive = Drive::new(settings.build().unwrap());
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn the_confirmation_of_a_board_is_not_valid_for_another() {
    let confirmed = sessions::settings("");
    assert!(confirmed.board_is_confirmed());
    assert!(!FirmwareSettings { board: boards::ALL[1], ..confirmed }.board_is_confirmed());
}

#[test]
fn the_longest_line_about_the_rotor_time_constant_is_not_cut_off() {
    let mut talk = Talk::new();
    talk.say("set track_rotor yes\napply\n");
    let tracking = talk.drive.tracking.as_ref().unwrap().report();
    for doubt in [NoEstimate::Transient, NoEstimate::PoorExcitation, NoEstimate::OutOfRange] {
        let report = Report { estimate: Err(doubt), ..tracking };
        assert!(report.to_string().len() < 75, "{report}");
    }
}

proptest! {
    #[test]
    fn garbage_changes_nothing_and_gets_replies(bytes in proptest::collection::vec(128_u8.., 0..400)) {
        let mut talk = Talk::new();
        for reply in talk.say(&bytes) {
            prop_assert!(reply.starts_with("error: "));
        }
        prop_assert!(talk.drive.commands.is_empty());
        let replies = talk.say("\nstop\n");
        prop_assert_eq!(replies.last().unwrap(), "ok");
    }

    #[test]
    fn any_bytes_on_a_wire_with_any_room_leave_a_console_that_answers(
        bytes: Vec<u8>, room in 0_usize..200,
    ) {
        let mut talk = Talk::new();
        talk.port.room = room;
        talk.port.sent.extend(&bytes);
        for _ in 0..20 {
            talk.poll();
        }
        talk.port.room = usize::MAX;
        talk.say("\n");
        let replies = talk.say("stop\n");
        prop_assert_eq!(replies.last().unwrap(), "ok");
    }
}

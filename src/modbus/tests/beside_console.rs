//! The bus beside the console.

use drive_core::State;
use proptest::prelude::*;

use super::super::Frame;
use crate::console::tests::{FakeBus, Talk};
use crate::settings::{FirmwareSettings, keys};

/// A console with a bus; the bus commands if `lines` say so.
pub(crate) struct Both {
    pub talk: Talk,
}

impl Both {
    fn new(lines: &str) -> Self {
        let mut talk = Talk::new();
        talk.bus = Some(FakeBus::default());
        talk.say(lines);
        talk.drive.commands.clear();
        Self { talk }
    }

    pub fn by_bus() -> Self {
        Self::new("set bus.commands bus\napply\n")
    }

    fn serve(&mut self) {
        let Talk { front, drive, bus, now_ms, .. } = &mut self.talk;
        front.bus.serve(bus.as_mut().unwrap(), &mut front.desk, drive, *now_ms);
    }

    /// The port of the bus.
    fn port(&mut self) -> &mut FakeBus {
        self.talk.bus.as_mut().unwrap()
    }

    /// Puts a request on the line, without address and checksum.
    fn request(&mut self, pdu: &[u8]) {
        let body = [&[1], pdu].concat();
        let sum = modbus_core::rtu::crc16(&body).to_be_bytes();
        self.port().asked.push_back(Frame::from_slice(&[&body[..], &sum].concat()).unwrap());
    }

    /// The answer to a request: both without address and checksum.
    pub fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        self.request(pdu);
        self.serve();
        let answer = self.port().answers.pop_front().expect("an answer");
        answer[1..answer.len() - 2].to_vec()
    }

    /// Writes a register; returns the exception, or 0.
    pub fn write(&mut self, at: u16, word: u16) -> u8 {
        let pdu = [&[6], &at.to_be_bytes()[..], &word.to_be_bytes()].concat();
        let answer = self.ask(&pdu);
        if answer == pdu { 0 } else { answer[1] }
    }

    pub fn read(&mut self, at: u16) -> u16 {
        let [high, low] = at.to_be_bytes();
        let answer = self.ask(&[3, high, low, 0, 1]);
        assert_eq!(answer[..2], [3, 2]);
        u16::from_be_bytes([answer[2], answer[3]])
    }

    /// Stages a setting, by its name.
    pub fn set(&mut self, name: &str, value: f32) -> u8 {
        let at = (0x4000 + 2 * keys::find(name).unwrap().id()).to_be_bytes();
        let answer = self.ask(&[&[16], &at[..], &[0, 2, 4], &value.to_be_bytes()].concat());
        if answer[0] == 16 { 0 } else { answer[1] }
    }
}

/// The master has given up requests that come while controllers are designed.
#[test]
fn requests_during_a_design_are_not_answered() {
    let mut both = Both::by_bus();
    both.set("motor.r_s", 5.3);
    both.write(0x2000, 18);
    both.request(&[8, 0, 0, 1, 2]);
    let Talk { front, drive, .. } = &mut both.talk;
    front.desk.run_pending(drive, 0);
    both.serve();
    assert!(both.port().asked.is_empty() && both.port().answers.is_empty());
}

/// With a delay of 5 ms a request is carried out and answered 5 ms after it came, and the next one 5 ms after it came.
#[test]
fn an_answer_waits_for_the_delay() {
    let mut both = Both::by_bus();
    both.talk.say("set bus.delay_s 0.005\napply\n");
    for request in [[6, 0x20, 1, 0, 18], [6, 0x20, 0, 0, 18]] {
        both.request(&request);
        for late in 0..6_u32 {
            both.serve();
            let answers: Vec<_> = both.port().answers.drain(..).collect();
            assert_eq!(answers.len(), usize::from(late == 5), "after {late} ms");
            both.talk.now_ms += 1;
        }
        both.talk.now_ms += 100;
        both.serve();
    }
    assert!(!both.talk.drive.commands.is_empty());
}

/// Every hardware setting is refused, even with its present value, in the range or not; the console tells the reason once.
#[test]
fn settings_of_the_hardware_are_not_for_the_bus() {
    let mut both = Both::by_bus();
    let settings = FirmwareSettings::of_the_board();
    let hardware: Vec<_> = keys::all().filter(|key| key.hardware()).collect();
    for name in ["inverter.dead_time_s", "scales.current_a.gain", "limits.dc_over_v"] {
        assert!(hardware.iter().any(|key| key.name() == name), "{name}");
    }
    for key in hardware {
        for value in [key.number(&settings).unwrap_or(0.0), f32::NAN] {
            assert_eq!(both.set(key.name(), value), 4, "{}", key.name());
        }
        let said = both.talk.say("");
        assert_eq!(
            said,
            [format!(
                "* bus: refused: {} belongs to the hardware: set it at the console",
                key.name()
            )]
        );
    }
    // Refused beside other settings, too, and so is half a setting.
    assert_eq!(both.read(0x4fff), 0);
    assert_eq!(both.ask(&[16, 0x40, 1, 0, 2, 4, 0, 0, 0, 0]), [0x90, 3]);
}

proptest! {
    /// After any frames the slave still answers, and only the commander starts the drive.
    #[test]
    fn any_frames_leave_a_bus_that_answers(frames: Vec<(u8, Vec<u8>)>, by_bus: bool) {
        let mut both = if by_bus { Both::by_bus() } else { Both::new("") };
        for (function, rest) in frames {
            both.request(&[&[function % 24], &rest[..rest.len().min(250)]].concat());
            both.serve();
        }
        both.port().answers.clear();
        prop_assert!(by_bus || both.talk.drive.drive.state() == State::Off);
        prop_assert_eq!(both.write(0x2000, 1), 0);
    }
}

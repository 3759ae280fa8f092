//! Any bytes on the wire, at any pace, with any room to answer: the console goes on, every line gets
//! its answer, and an order that reached the drive came from a line that was answered without error.
#![no_main]

use std::collections::VecDeque;
use std::fmt;

use drive_core::settings::SettingsError;
use drive_core::{Coefficients, Drive, Hardware, Sample, State, Taken};
use induction_drive::console::keys::Everything;
use induction_drive::console::{Console, Machine, NotDone, Port, grammar::Level};
use induction_drive::link::{Order, Status};
use induction_drive::tracking::Report;
use induction_drive::{console, saved, trace};
use libfuzzer_sys::fuzz_target;

struct Desk {
    drive: Drive,
    traced: u16,
}

impl Machine for Desk {
    fn order(&mut self, order: Order) -> Result<Taken, NotDone> {
        self.drive.command(order.command()).map_err(NotDone::Refused)
    }
    fn status(&self) -> Option<Status> {
        Some(Status {
            periods: 1,
            state: self.drive.state(),
            sample: Sample::default(),
            telemetry: *self.drive.telemetry(),
            worst_cycles: u32::MAX,
            last_cycles: 0,
            worst_latency: u32::MAX,
            hardware: Hardware::NONE,
        })
    }
    fn is_off(&self) -> bool {
        matches!(self.drive.state(), State::Off | State::Fault(_))
    }
    fn build(&mut self, settings: &Everything) -> Result<Coefficients, SettingsError> {
        settings.build()
    }
    fn configured(&mut self, _: &Everything) {}
    fn tracking(&self) -> Option<Report> {
        None
    }
    fn save(&mut self, _: &Everything) -> Result<(), saved::Failed> {
        Ok(())
    }
    fn begin_trace(&mut self, records: u16, _: u16, _: &trace::Choice) -> bool {
        assert!(records <= console::grammar::LONGEST_TRACE);
        self.traced = records;
        true
    }
    fn tracing(&self) -> bool {
        false
    }
    fn traced(&self, i: u16) -> Option<trace::Record> {
        (i < self.traced).then(|| [0.0; trace::MOST])
    }
    fn set_log_level(&mut self, _: Level) {}
    fn stack(&self) -> (usize, usize) {
        (1, 8192)
    }
    fn version(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "version")
    }
    fn last_run(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "power-on")
    }
}

#[derive(Default)]
struct Wire {
    sent: VecDeque<u8>,
    damaged: bool,
    room: usize,
    replies: String,
}

impl Port for Wire {
    fn read(&mut self) -> Option<u8> {
        self.sent.pop_front()
    }
    fn take_damage(&mut self) -> bool {
        std::mem::take(&mut self.damaged)
    }
    fn write(&mut self, text: &str) -> bool {
        let fits = text.len() <= self.room;
        if fits {
            self.room -= text.len();
            self.replies.push_str(text);
        }
        fits
    }
}

fuzz_target!(|bytes: &[u8]| {
    let settings = Everything::of_the_board();
    let Ok(coefficients) = settings.build() else { panic!("the defaults are refused") };
    let mut desk = Desk { drive: Drive::new(coefficients), traced: 0 };
    let mut console = Console::new(settings);
    let mut wire = Wire::default();
    let mut now_ms = 0_u32;
    // Bytes above 0xf0 are not sent: they are pauses, room, damage, and samples for the drive.
    for &byte in bytes {
        match byte {
            0xfa => wire.damaged = true,
            0xfb => now_ms = now_ms.wrapping_add(20_000),
            0xfc => now_ms = now_ms.wrapping_add(u32::MAX / 2),
            0xfd => wire.room += 300,
            0xfe => {
                desk.drive.step(&Sample { current_a: 2022, current_b: 2015, ..Sample::default() });
            }
            0xff => console.poll(&mut wire, &mut desk, now_ms),
            _ => wire.sent.push_back(byte),
        }
    }
    // Whatever came: from here on it answers, and stops the drive.
    wire.room = usize::MAX;
    wire.sent.extend(b"\nstop\n");
    while !wire.sent.is_empty() {
        console.poll(&mut wire, &mut desk, now_ms);
    }
    console.poll(&mut wire, &mut desk, now_ms);
    assert!(wire.replies.ends_with("ok\r\n"), "{:?}", wire.replies);
    let running = !matches!(desk.drive.state(), State::Off | State::Stopping | State::Fault(_));
    assert!(!running, "{}", desk.drive.state());
});

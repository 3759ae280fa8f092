//! Any bytes on the port, at any pace, with any space to answer: the console goes on, every line gets its answer, and a request that
//! reached the drive came from a line that was answered without error.
#![no_main]

use std::sync::LazyLock;

use drive_core::learned::{Learned, Verdict};
use drive_core::{Measured, State};
use induction_drive::console::grammar::COMMANDS;
use induction_drive::console::line::UNASKED;
use induction_drive::front::Front;
use induction_drive::log::LEVELS;
use induction_drive::recording::trace::SIGNALS;
use induction_drive::settings::keys;
use induction_drive_fuzz::START;
use induction_drive_fuzz::doubles::{FakeBus, FakeDrive, FakePort, FakeTerminals, found};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let (settings, initial) = START.clone();
    let mut drive = FakeDrive::new(initial);
    let (mut front, mut bus) = (Front::new(settings), None::<FakeBus>);
    let (mut port, mut terminals) = (FakePort::default(), FakeTerminals::default());
    let mut now_ms = 0_u32;
    // Bytes above 0xf0 are not sent: they stand for a learned result, pauses, space, damage, and samples for the drive. The byte after
    // 0xf7 stands for a word, which the fuzzer does not find letter by letter.
    static WORDS: LazyLock<Vec<&str>> = LazyLock::new(words);
    let mut bytes = bytes.iter().copied();
    while let Some(byte) = bytes.next() {
        match byte {
            0xf6 => drive.triggered = true,
            0xf7 => {
                let word = bytes.next().and_then(|n| WORDS.get(usize::from(n))).unwrap_or(&"");
                port.sent.extend(word.bytes().chain([b' ']));
            }
            0xf8 => drive.found = Some(doubtful()),
            0xf9 => drive.found = Some(found()),
            0xfa => port.damaged = true,
            0xfb => now_ms = now_ms.wrapping_add(20_000),
            0xfc => now_ms = now_ms.wrapping_add(u32::MAX / 2),
            0xfd => port.room += 300,
            0xfe => {
                drive.drive.step(&Measured { dc_link: 311.0, ..Measured::default() });
            }
            0xff => front.pass(&mut port, bus.as_mut(), &mut terminals, &mut drive, now_ms),
            _ => port.sent.push_back(byte),
        }
    }
    // After any input the console answers, and stops the drive. Unrequested lines come after that.
    port.room = usize::MAX;
    port.sent.extend(b"\nstop\n");
    // A requested design or reset comes first, and takes its time.
    let mut polls = 0;
    while !port.sent.is_empty() || polls < 200 {
        polls = if port.sent.is_empty() { polls + 1 } else { 0 };
        now_ms = now_ms.wrapping_add(1);
        front.pass(&mut port, bus.as_mut(), &mut terminals, &mut drive, now_ms);
    }
    let mut lines = port.received.lines().filter(|line| !line.starts_with(UNASKED));
    assert!(lines.next_back().is_some_and(|line| line.ends_with("ok")), "{:?}", port.received);
    let running = !matches!(drive.drive.state(), State::Off | State::Stopping | State::Fault(_));
    assert!(!running, "{}", drive.drive.state());
});

/// The words of the console: commands, settings, and the words that follow them.
fn words() -> Vec<&'static str> {
    let settings = keys::all().map(|key| key.name());
    let levels = LEVELS.iter().map(|(name, _)| *name);
    let signals = SIGNALS.iter().map(|signal| signal.name);
    let others = "encoder injection learning again yes no synchronous rectified motor auto on above fault now check 00000000";
    let others = others.split(' ');
    let words = COMMANDS.iter().copied();
    let words: Vec<_> = words.chain(settings).chain(levels).chain(others).chain(signals).collect();
    assert!(words.len() <= 256, "{} words", words.len());
    words
}

/// A result that is not plausible.
fn doubtful() -> Learned {
    let mut found = found();
    found.carrier = None;
    found.gain_mismatch.accepted = false;
    found.current_saliency.accepted = false;
    Learned { slope: None, verdict: Verdict::Uneven, ..found }
}

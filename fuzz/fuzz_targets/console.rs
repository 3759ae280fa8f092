//! Any bytes on the port, at any pace, with any room to answer: the console goes on, every line gets
//! its answer, and an order that reached the drive came from a line that was answered without error.
#![no_main]

use std::sync::{LazyLock, OnceLock};

use drive_core::identify::learning::Learned;
use drive_core::{Drive, Sample, State};
use induction_drive::console::Console;
use induction_drive::console::grammar::{HELP, LEVELS};
use induction_drive::link::trace::SIGNALS;
use induction_drive::settings::FirmwareSettings;
use induction_drive::settings::keys;
use libfuzzer_sys::fuzz_target;

#[path = "../../src/console/tests/doubles.rs"]
mod doubles;
use doubles::{FakeDrive, FakePort, found};

fuzz_target!(|bytes: &[u8]| {
    let settings = FirmwareSettings::of_the_board();
    // (The design rules take longer than all else.)
    static DRIVE: OnceLock<Drive> = OnceLock::new();
    let initial = DRIVE.get_or_init(|| Drive::new(settings.build().expect("the defaults")));
    let mut drive = FakeDrive::new(initial.clone());
    let mut console = Console::new(settings);
    let mut port = FakePort::default();
    let mut now_ms = 0_u32;
    // Bytes above 0xf0 are not sent: they are what was learned, pauses, room, damage, and samples for the
    // drive. Those from 0x80 on stand for words, which the fuzzer does not find letter by letter.
    static WORDS: LazyLock<Vec<&str>> = LazyLock::new(words);
    for &byte in bytes {
        if let Some(word) = byte.checked_sub(0x80).and_then(|n| WORDS.get(usize::from(n))) {
            port.sent.extend(word.bytes().chain([b' ']));
            continue;
        }
        match byte {
            0xf8 => drive.found = Some(doubtful()),
            0xf9 => drive.found = Some(found()),
            0xfa => port.damaged = true,
            0xfb => now_ms = now_ms.wrapping_add(20_000),
            0xfc => now_ms = now_ms.wrapping_add(u32::MAX / 2),
            0xfd => port.room += 300,
            0xfe => {
                drive.drive.step(&Sample { current_a: 2022, current_b: 2015, ..Sample::default() });
            }
            0xff => console.poll(&mut port, &mut drive, now_ms),
            _ => port.sent.push_back(byte),
        }
    }
    // Whatever came: from here on it answers, and stops the drive.
    port.room = usize::MAX;
    port.sent.extend(b"\nstop\n");
    while !port.sent.is_empty() {
        console.poll(&mut port, &mut drive, now_ms);
    }
    console.poll(&mut port, &mut drive, now_ms);
    assert!(port.received.ends_with("ok\r\n"), "{:?}", port.received);
    let running = !matches!(drive.drive.state(), State::Off | State::Stopping | State::Fault(_));
    assert!(!running, "{}", drive.drive.state());
});

/// What the console knows: commands, settings, and the words that follow them.
fn words() -> Vec<&'static str> {
    let commands = HELP.iter().filter_map(|line| line.split_whitespace().next());
    let settings = keys::all().map(|key| key.name());
    let levels = LEVELS.iter().map(|(name, _)| *name);
    let others =
        ["encoder", "injection", "learning", "yes", "no", "synchronous", "rectified", "motor"];
    let words: Vec<_> =
        commands.chain(settings).chain(levels).chain(others).chain(SIGNALS).collect();
    // Or they would hide the bytes that are not sent.
    assert!(words.len() <= 0xf0 - 0x80, "{} words", words.len());
    words
}

/// What a learning finds that is not believable.
fn doubtful() -> Learned {
    let mut found = found();
    found.carrier = None;
    found.gain_mismatch.accepted = false;
    found.current_saliency.accepted = false;
    Learned { accepted: false, ..found }
}

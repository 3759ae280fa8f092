//! Any words of a learned result, with the right check sum, at the console: each line is answered, an accepted result is in the backup as
//! it came, and a drive can be built with it.
#![no_main]

use std::fmt::Write as _;

use drive_core::{Command, Measured, Mode};
use induction_drive::console::line::UNASKED;
use induction_drive::front::Front;
use induction_drive::store::learned;
use induction_drive_fuzz::doubles::{FakeBus, FakeDrive, FakePort, FakeTerminals, found};
use induction_drive_fuzz::{START, is_designed, sum};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let (settings, initial) = START.clone();
    // Place, kind of change, and four bytes.
    let mut words = learned::to_words(&found(), settings.drive.scales.both_zero_vectors);
    for change in bytes.chunks_exact(6) {
        let word = &mut words[usize::from(change[0]) % learned::WORDS];
        let value = u32::from_le_bytes(change[2..].try_into().expect("four bytes"));
        let (old, factor) = (f32::from_bits(*word), f32::from(change[2]) / 64.0);
        *word = match change[1] % 8 {
            0 => value,
            1 => *word ^ value,
            2 => 0,
            3 => f32::NAN.to_bits(),
            4 => f32::INFINITY.to_bits(),
            5 => (-old).to_bits(),
            6 => (old * factor).to_bits(),
            _ => f32::MIN_POSITIVE.to_bits(),
        };
    }
    let mut lines = String::new();
    for (n, some) in words.chunks(8).enumerate() {
        write!(lines, "learned {}", 8 * n).expect("room");
        some.iter().for_each(|word| write!(lines, " {word:08x}").expect("room"));
        lines.push('\n');
    }
    let bytes_of_words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    writeln!(lines, "learned check {:08x}", sum(&bytes_of_words)).expect("room");
    if is_designed(bytes) {
        lines.push_str("apply\n");
    }
    let asked = lines.lines().count();
    let (mut front, mut drive) = (Front::new(settings), FakeDrive::new(initial));
    let (mut bus, mut terminals) = (None::<FakeBus>, FakeTerminals::default());
    let mut port = FakePort { room: usize::MAX, ..FakePort::default() };
    port.sent.extend(lines.bytes());
    // An answer may take some passes.
    let (mut now_ms, mut quiet) = (0, 0);
    while quiet < 20 {
        quiet = if port.sent.is_empty() && !front.desk.is_busy() { quiet + 1 } else { 0 };
        now_ms += 1;
        front.pass(&mut port, bus.as_mut(), &mut terminals, &mut drive, now_ms);
    }
    let answers = port.received.lines().filter(|line| !line.starts_with(UNASKED));
    let answers: Vec<_> =
        answers.filter(|line| line.starts_with("ok") || line.starts_with("error: ")).collect();
    assert_eq!(answers.len(), asked, "{}", port.received);
    if let Some(found) = front.desk.settings().in_force().learned {
        let both = settings.drive.scales.both_zero_vectors;
        let again = learned::from_words(&learned::to_words(&found, both));
        assert_eq!(again, Some(found));
        // The drive regulates, or refuses to.
        let _ = drive.drive.command(&Command::Start(Mode::Torque));
        let sample = Measured { dc_link: 311.0, ..Measured::default() };
        for _ in 0..2000 {
            drive.drive.step(&sample);
        }
    }
});

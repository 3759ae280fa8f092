//! The slave against frames of the specification and against random ones, and the manual against the table.

pub(crate) mod beside_console;

use std::fmt::Write as _;

use drive_settings::value::Words as _;
use modbus_core::Exception;

use drive_core::{Fault, Refused};
use drive_settings::SettingsError;

use super::Frame;
use super::bus::is_stop;
use super::cia402::Power;
use super::registers::{COMMAND, CONTROL, FAULTS, FREQUENCY, MODE, RESET, ROWS, STAGED, Shown};
use super::settings::{Baud, Format};
use super::slave::{self, Registers, Words};
use crate::board::CLOCK_HZ;
use crate::desk::handle::CommandError;
use crate::desk::order::Refusal;
use crate::generated;
use crate::settings::Commander;
use crate::settings::keys;
use crate::settings::staging::SetError;
use crate::store::FlashError;

/// Registers 0x2000 to 0x20ff, of which the last cannot be written.
#[derive(Clone, Debug, PartialEq)]
struct Memory(Vec<u16>);

impl Registers for Memory {
    fn read(&mut self, at: u16) -> Result<u16, Exception> {
        let word = self.0.get(usize::from(at).wrapping_sub(0x2000));
        word.copied().ok_or(Exception::IllegalDataAddress)
    }

    fn write(&mut self, at: u16, words: Words<'_>) -> Result<(), Exception> {
        let words: Vec<_> = (0..words.count()).filter_map(|place| words.get(place)).collect();
        let first = usize::from(at).wrapping_sub(0x2000);
        match self.0.get_mut(first..first.saturating_add(words.len())) {
            None => Err(Exception::IllegalDataAddress),
            Some(_) if first + words.len() == 0x100 => Err(Exception::ServerDeviceFailure),
            Some(place) => {
                place.copy_from_slice(&words);
                Ok(())
            }
        }
    }
}

fn memory() -> Memory {
    Memory((0..0x100).map(|n| 3 * n).collect())
}

/// The checksum by the table-free algorithm of the specification (V1.02, appendix B), written independently.
fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xffff_u16;
    for bit in bytes.iter().flat_map(|byte| (0..8).map(move |n| byte >> n & 1)) {
        let carry = crc & 1 ^ u16::from(bit);
        crc = crc >> 1 ^ if carry == 1 { 0xa001 } else { 0 };
    }
    crc.to_le_bytes()
}

/// A frame with its checksum.
fn framed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc(bytes)].concat()
}

/// The answer of slave 17 to a frame, without its checksum, which is checked.
fn ask(frame: &[u8], memory: &mut Memory) -> Option<Vec<u8>> {
    let mut out = Frame::new();
    slave::answer(frame, 17, memory, |frame| out = frame.clone());
    let (bytes, sum) = out.split_at_checked(out.len().checked_sub(2)?)?;
    assert_eq!(sum, crc(bytes));
    Some(bytes.to_vec())
}

/// A busy slave answers a whole request for it alone with exception 6, and a damaged frame, a request to others or to all, and an
/// exception not at all. It acknowledges and reports a stop.
#[test]
fn a_busy_slave_answers_whole_requests_for_it_alone() {
    let busy = |frame: &[u8]| {
        let (answer, stop) = slave::busy(frame, 17, is_stop);
        (answer.map(|answer| answer.to_vec()), stop)
    };
    let answer = |bytes: &[u8]| (Some(framed(bytes)), None);
    let read = framed(&[17, 3, 0x20, 0x01, 0, 2]);
    assert_eq!(busy(&read), answer(&[17, 0x83, 6]));
    assert_eq!(busy(&framed(&[17, 16, 0x20, 1, 0, 1, 2, 0, 9])), answer(&[17, 0x90, 6]));
    for at in 0..read.len() {
        let mut damaged = read.clone();
        damaged[at] ^= 1;
        assert_eq!(busy(&damaged), (None, None), "byte {at}");
        assert_eq!(busy(&read[..at]), (None, None), "{at} bytes");
    }
    for other in [&[18, 3, 0, 0, 0, 1][..], &[0, 6, 0x20, 1, 0, 1], &[17, 0x83, 2], &[17]] {
        assert_eq!(busy(&framed(other)), (None, None), "{other:?}");
    }
    for (at, word, stops) in [
        (0x2000, 1, true),
        (0x2000, 0, true),
        (0x2000, 18, false),
        (0x2002, 4, true),
        (0x2002, 2, false),
        (0x6040, 0, true),
        (0x6040, 6, true),
        (0x6040, 15, false),
        (0x2001, 1, false),
    ] {
        let ([a, b], [c, d]) = (u16::to_be_bytes(at), u16::to_be_bytes(word));
        let stop = stops.then_some((at, word));
        let exception =
            |function: u8| if stops { None } else { Some(framed(&[17, function | 0x80, 6])) };
        let one = [17, 6, a, b, c, d];
        assert_eq!(busy(&framed(&one)), (exception(6).or(Some(framed(&one))), stop), "{at:#x}");
        let several = [17, 16, a, b, 0, 1, 2, c, d];
        let acknowledged = Some(framed(&several[..6]));
        assert_eq!(busy(&framed(&several)), (exception(16).or(acknowledged), stop), "{at:#x}");
        // The answer to function 23 would need the registers.
        let both = framed(&[17, 23, 0x21, 0, 0, 1, a, b, 0, 1, 2, c, d]);
        assert_eq!(busy(&both), (Some(framed(&[17, 0x97, 6])), stop), "{at:#x}");
        assert_eq!(busy(&framed(&[0, 6, a, b, c, d])), (None, stop), "{at:#x}");
        assert_eq!(busy(&framed(&[18, 6, a, b, c, d])), (None, None), "{at:#x}");
    }
}

#[test]
fn frames_of_the_specification() {
    let bytes = |text: &str| -> Vec<u8> {
        text.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect(text)).collect()
    };
    let lines = include_str!("tests/frames.txt").lines();
    for line in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (request, answer) = line.split_once(" => ").expect(line);
        let answered = ask(&framed(&bytes(request)), &mut memory());
        assert_eq!(answered, Some(bytes(answer)), "{line}");
    }
    let mut written = memory();
    ask(&framed(&[17, 16, 0x20, 0x01, 0, 2, 4, 0, 10, 1, 2]), &mut written);
    assert_eq!(written.0[..4], [0, 10, 0x102, 9]);
}

#[test]
fn the_longest_read_fits_and_frames_for_others_have_no_effect() {
    let longest = ask(&framed(&[17, 3, 0x20, 0, 0, 125]), &mut memory()).unwrap();
    assert_eq!((longest.len(), longest[2]), (253, 250));
    let mut written = memory();
    let write = [17, 6, 0x20, 2, 0xab, 0xcd];
    // Ignored: for another slave, damaged, with a response's function, too short.
    let damaged = framed(&write).iter().enumerate().map(|(n, b)| b ^ u8::from(n == 4)).collect();
    for frame in [
        framed(&[&[18], &write[1..]].concat()),
        damaged,
        framed(&[17, 0x86, 1]),
        vec![17, 6],
        vec![],
    ] {
        assert_eq!(ask(&frame, &mut written), None);
        assert_eq!(written, memory());
    }
    // A broadcast is written without an answer, and is not read.
    assert_eq!(ask(&framed(&[&[0], &write[1..]].concat()), &mut written), None);
    assert_eq!(written.0[2], 0xabcd);
    assert!(!slave::answer(&framed(&[0, 3, 0x20, 0, 0, 1]), 17, &mut written, |_| {}));
}

/// Marsaglia's xorshift of 64 bits, its upper half.
struct Random(u64);

impl Random {
    fn next_u32(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 32) as u32
    }
}

/// 100 000 frames: random bytes, valid requests, and valid requests with changed bits. The answers are those of an independent reading of
/// the frame, and an invalid frame changes nothing.
#[test]
fn random_and_mutated_frames() {
    let mut rng = Random(7);
    let (mut memory, mut answered, mut refused) = (memory(), 0, 0);
    for n in 0..100_000 {
        let mut bytes = vec![0; rng.next_u32() as usize % 40];
        bytes.fill_with(|| rng.next_u32() as u8);
        let (at, count) = (rng.next_u32() as u8, rng.next_u32() as u8 % 130);
        let mut frame = match n % 4 {
            0 => bytes,
            1 => framed(&[17, 3 + at % 2, 0x20, at, 0, count]),
            2 => framed(&[17, 6, 0x20, at, count, at]),
            _ => {
                let count = count % 4 + 1;
                let values = vec![at; 2 * usize::from(count)];
                let write = [0x20, at, 0, count, 2 * count];
                let function: &[u8] =
                    if at % 2 == 0 { &[17, 16] } else { &[17, 23, 0x20, count, 0, 3] };
                framed(&[function, &write, &values].concat())
            }
        };
        let mutate = rng.next_u32().is_multiple_of(2) && !frame.is_empty();
        if mutate {
            let place = rng.next_u32() as usize % frame.len();
            frame[place] ^= 1 << (rng.next_u32() % 8);
        }
        let before = memory.clone();
        let answer = ask(&frame, &mut memory);
        let whole = frame.len() >= 4
            && frame.len() <= 256
            && frame[frame.len() - 2..] == crc(&frame[..frame.len() - 2]);
        let ours = whole && frame[0] == 17 && frame[1] < 0x80;
        assert_eq!(answer.is_some(), ours, "{frame:x?}");
        // One flipped bit never passes the checksum.
        assert!(!mutate || n % 4 == 0 || !whole);
        match answer {
            Some(answer) if answer[1] == frame[1] => answered += 1,
            Some(answer) => {
                assert_eq!(answer[1], frame[1] | 0x80);
                assert!((1..=4).contains(&answer[2]));
                assert_eq!(memory, before);
                refused += 1;
            }
            None => assert!(memory == before || (whole && frame[0] == 0)),
        }
    }
    assert!(answered > 10_000 && refused > 1000, "{answered} answered, {refused} refused");
}

/// The rate is within 0.1 %; a receiver of ten bits tolerates 2 %. The silent interval is 3.5 characters, or 1.75 ms above 19 200 bit/s,
/// rounded up to a bit.
#[test]
fn rates_and_silences() {
    for place in 0..Baud::WORDS.len() {
        let baud = Baud::at(place);
        let wanted: f64 = Baud::WORDS[place].parse().unwrap();
        let rate = f64::from(CLOCK_HZ) / f64::from(baud.divider());
        assert!((rate / wanted - 1.0).abs() < 1e-3, "{rate} for {wanted}");
        for (format, bits) in [(Format::None, 10.0), (Format::Even, 11.0), (Format::TwoStops, 11.0)]
        {
            let silence_s = f64::from(baud.silence_bits(format)) / wanted;
            let least = if wanted > 19_200.0 { 1.75e-3 } else { 3.5 * bits / wanted };
            assert!((least..least + 1.0 / wanted).contains(&silence_s), "{silence_s} at {wanted}");
        }
    }
    assert_eq!(Format::WORDS.len(), 3);
}

/// A row of a table of the manual.
fn rows() -> String {
    let mut text = String::new();
    for row in &ROWS {
        let unit = match row.shown {
            Shown::Number(parts, _) => format!("{} {}", 1.0 / f64::from(parts), row.unit),
            _ => row.unit.to_owned(),
        };
        let kind = if matches!(row.shown, Shown::Double(_)) { "32 bits" } else { "16 bits" };
        let is_written = matches!(row.at, COMMAND | FREQUENCY | RESET | STAGED | CONTROL | MODE);
        let access = if is_written { "read, write" } else { "read" };
        writeln!(text, "| `0x{:04X}` | {kind} | {unit} | {access} | {} |", row.at, row.help)
            .unwrap();
    }
    text
}

/// The state machine as in Figure 2 and Table 4 of IEC 61800-7-201, read independently of the product's table: for each state, the state
/// after each command of the control word, a fault, and its reset. `-` is no transition.
#[test]
fn control_words_lead_to_the_states_of_the_standard() {
    use super::cia402::{Event, after};
    let states = Power::ALL.map(|(power, ..)| power);
    // Words of the commands, one of each set of bits that the standard gives: disable voltage, quick stop, shutdown, switch on (disable
    // operation), enable operation.
    let words = [
        [0x00, 0x05, 0x0d],
        [0x02, 0x03, 0x0b],
        [0x06, 0x0e, 0x16],
        [0x07, 0x17, 0x47],
        [0x0f, 0x1f, 0x4f],
    ];
    let expected = [
        "-----", // 0, not ready to switch on
        "--2--", // 1, switch on disabled
        "11-34", // 2, ready to switch on
        "112-4", // 3, switched on
        "1523-", // 4, operation enabled
        "1---4", // 5, quick stop active
        "-----", // 6, fault
    ];
    for (from, row) in states.iter().zip(expected) {
        for (command, place) in words.iter().zip(row.chars()) {
            for word in command {
                let to = after(*from, Event::of(*word));
                let wanted = place.to_digit(10).map_or(*from, |n| states[n as usize]);
                assert_eq!(to, wanted, "{from:?} by {word:#x}");
            }
        }
        let failed = after(*from, Event::Failed);
        assert_eq!(failed, Power::Fault, "{from:?}");
        let cleared = after(*from, Event::Cleared);
        assert_eq!(cleared, if *from == Power::Fault { states[1] } else { *from }, "{from:?}");
    }
    assert_eq!(after(states[0], Event::Ready), states[1]);
}

/// The transitions of the manual.
fn transitions() -> String {
    use super::cia402::Event;
    let cause = |event: &Event| match event {
        Event::DisableVoltage => "disable voltage",
        Event::QuickStop => "quick stop",
        Event::Shutdown => "shutdown",
        Event::SwitchOn => "switch on, disable operation",
        Event::EnableOperation => "enable operation",
        Event::Ready => "the control runs",
        Event::Stopped => "the drive has stopped without a command of the bus",
        Event::Failed => "fault",
        Event::Cleared => "the fault is cleared",
    };
    let name = |power: &Power| Power::ALL[*power as usize].1;
    let mut text = String::new();
    for row in &super::cia402::TRANSITIONS {
        let from: Vec<_> = row.from.iter().map(name).collect();
        let causes: Vec<_> = row.on.iter().map(cause).collect();
        let from = if from.len() > 2 { "all others".to_owned() } else { from.join(", ") };
        writeln!(text, "| {} | {from} | {} | {} |", row.number, causes.join(", "), name(&row.to))
            .unwrap();
    }
    text
}

fn states() -> String {
    let mut text = String::new();
    for (place, (power, name, bits)) in Power::ALL.into_iter().enumerate() {
        assert_eq!((power as usize, power.bits()), (place, bits));
        writeln!(text, "| {name} | `0x{bits:02X}` |").unwrap();
    }
    text
}

#[test]
fn the_manual_lists_the_registers() {
    let table = |name, head: &str, rows: String| {
        let line = "|---".repeat(head.matches('|').count() - 1);
        generated::check("modbus.md", name, &format!("{head}\n{line}|\n{rows}"));
    };
    table("registers", "| address | size | unit | | meaning |", rows());
    table("states", "| state | bits |", states());
    table("transitions", "| number | from | cause | to |", transitions());
    assert_eq!(FAULTS, 0x5100);
}

/// The register of the last refusal: each number, an example of its reason, and the cure.
#[test]
fn the_manual_lists_the_refusals() {
    let key = keys::find("inverter.dead_time_s").unwrap();
    let refused = |why| Refusal::Command(CommandError::Refused(why));
    let range = SettingsError::Word("a", "b", "c");
    let rows = [
        (
            Refusal::Authority(Commander::Console),
            "another interface is in command: console or terminal strip",
            "`set bus.commands bus` at the console",
        ),
        (Refusal::MustBeOff, "the drive is not off", "write a stop first"),
        (
            Refusal::NotConfirmed,
            "the board is not confirmed",
            "do the bench steps that `board` lists at the console, then type `confirm board`",
        ),
        (
            refused(Refused::NotLearned),
            "nothing is learned of this motor with these settings",
            "lock the shaft, and type `learn` at the console",
        ),
        (
            refused(Refused::Fault(Fault::Break)),
            "a fault is latched; `0x2100` has its number",
            "remove the cause, and write 2 to `0x2002`",
        ),
        (
            Refusal::Design(range),
            "a value is not possible, or the settings do not fit each other",
            "`get` and `apply` at the console say which ones",
        ),
        (Refusal::Hardware(key), "a setting of the hardware", "set it at the console"),
        (Refusal::Flash(FlashError::Erase(0)), "the flash was not written", "save again"),
        (
            Refusal::Ended,
            "a stop has to be written first, because the drive has stopped for another reason, or because the state of CiA 402 has no such transition",
            "write 1 to `0x2000`, or 6 to `0x6040`, and then the run",
        ),
        (
            Refusal::Command(CommandError::NoAnswer),
            "the control does not run",
            "see the reason at the console: `version`, `faults`",
        ),
        (
            refused(Refused::NotCharged),
            "the drive is in a state that does not allow it",
            "read the state, `0x2101` or `0x6041`",
        ),
        (
            Refusal::Staged,
            "settings are staged and not in force, or the console has lines of another board or of a backup that is not whole",
            "`apply` or `revert` at the console",
        ),
        (
            Refusal::Held(""),
            "the terminal strip holds the drive",
            "close ENABLE, and STOP where it is used",
        ),
        (
            Refusal::Reference(""),
            "the reference of the terminal strip was lost",
            "close RESET or type `clear`, then start again",
        ),
        (Refusal::Stopped, "a stop arrived while the start was being prepared", "start again"),
        (
            Refusal::TooOften(7),
            "three faults of the power stage within 10 s",
            "find the short circuit, then clear after 10 s",
        ),
        (
            Refusal::Set(SetError::Loosens(key, key)),
            "a protection would become looser",
            "set it at the console",
        ),
    ];
    let mut table = "| value | reason | cure |\n|---|---|---|\n".to_owned();
    for (number, (refusal, reason, cure)) in (1..).zip(rows) {
        assert_eq!(refusal.code(), number, "{refusal}");
        table += &format!("| {number} | {reason} | {cure} |\n");
    }
    generated::check("modbus.md", "refusals", &table);
}

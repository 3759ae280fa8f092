//! Recorded samples and orders of the board: the same compare values as ever.
//!
//! A recorded sample does not answer to another voltage, so a control that differs in its last digit departs from the record, and
//! after a quarter of a second fault 11 ends it: then the runs are recorded again. They were when
//!
//! * the tracking came to divide by the slope of a table instead of a constant: with the injection, from the first torque on, the
//!   angle differs in its last digit; before that, and with the encoder, the hashes of commit 1abee12 held;
//! * the references of the current loop got a direct share, which changes the voltage at every step of theirs;
//! * a start without an encoder looks for a turning shaft with half of the current at once;
//! * duties took the place of timer counts in the modulator: a count differs here and there by one;
//! * tasks of the carrier period moved to other samples, so that no sample has much more to do than another;
//! * a filter took the place of the tracking loop, and a command is taken behind one sample of ten.

use std::fs;

use drive_core::{Command, Compare, Drive, FrontEndState, Sample};
use induction_drive::console::grammar::{self, Request};
use induction_drive::settings::FirmwareSettings;

use crate::player::{BLOCK, Fnv};

/// Hashes of the compare values, one for every [`BLOCK`] interrupts, and the number of interrupts.
fn replay(name: &str) -> (Vec<u64>, usize) {
    let path = format!("{}/tests/recorded/{name}", env!("CARGO_MANIFEST_DIR"));
    let samples = fs::read(format!("{path}.samples")).unwrap();
    let orders = fs::read_to_string(format!("{path}.orders")).unwrap();
    let mut orders = orders.lines().map(|line| line.split_once(' ').unwrap()).peekable();
    let mut settings = FirmwareSettings::of_the_board();
    // The board that was recorded had not learned.
    settings.drive.injection.synchronous.allow_unlearned = true;
    let mut drive = Drive::new(settings.build().unwrap());
    let mut front_end = FrontEndState::default();

    let mut compares = Vec::new();
    for (n, bytes) in samples.chunks_exact(12).enumerate() {
        let code = |at| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let sample = Sample {
            current_a: code(0),
            current_b: code(2),
            dc_link: code(4),
            heat_sink: code(6),
            encoder: u32::from_le_bytes(bytes[8..].try_into().unwrap()),
            ..Sample::default()
        };
        let mut last = None;
        let (compare, _) =
            drive.period(&mut front_end, &sample, &mut |compare| last = Some(compare));
        assert_eq!(last, Some(compare), "{n}");
        compares.push(compare);
        if let Some((_, line)) = orders.next_if(|(number, _)| number.parse() == Ok(n)) {
            order(&mut drive, &mut settings, line);
        }
    }
    assert_eq!(orders.next(), None, "an order that was not reached");
    (compares.chunks(BLOCK).map(hash).collect(), compares.len())
}

/// Gives an order that the board's drive took.
fn order(drive: &mut Drive, settings: &mut FirmwareSettings, line: &str) {
    let request = if line == "check wiring" { None } else { Some(grammar::parse(line).unwrap()) };
    let taken = match request {
        None => drive.command(&Command::CheckWiring),
        Some(Request::Start(mode)) => drive.command(&Command::Start(mode)),
        Some(Request::Stop(stop)) => drive.command(&Command::Stop(stop)),
        Some(Request::Torque(i_q)) => drive.command(&Command::Torque(i_q)),
        Some(Request::Position(turns)) => drive.command(&Command::Position(turns)),
        Some(Request::Set(values)) => {
            values.iter().for_each(|(key, value)| key.set(settings, *value));
            drive.command(&Command::Configure(settings.build().unwrap()))
        }
        Some(other) => panic!("{other:?} is no order to the drive"),
    };
    assert!(taken.is_ok(), "{line}: {taken:?}");
}

/// FNV-1a of the compare values.
fn hash(compares: &[Compare]) -> u64 {
    let mut hash = Fnv::default();
    compares.iter().for_each(|compare| hash.compare(compare));
    hash.0
}

#[test]
fn torque_steps_without_a_sensor() {
    let (hashes, interrupts) = replay("sensorless");
    assert_eq!(interrupts, 66_873);
    assert_eq!(
        hashes,
        [
            0x980b_ced4_f848_e067,
            0x3b2a_6745_d947_2990,
            0x85c4_c690_851b_74da,
            0xb520_c0f4_e5f3_954d,
            0x871c_73ae_a045_1343,
            0x4c32_d4b3_cbc0_4590,
            0x3919_d77f_e9e9_d7f5,
            0x2397_9ce3_6391_503f,
            0x54a6_d925_1765_1fe9,
            0x469b_aa2d_ea3c_ce3a,
            0x0d93_1e03_e073_d098,
            0x8303_2b62_6102_ddb7
        ],
        "{hashes:#018x?}"
    );
}

#[test]
fn position_steps_with_the_encoder() {
    let (hashes, interrupts) = replay("encoder");
    assert_eq!(interrupts, 27_451);
    assert_eq!(
        hashes,
        [
            0xbca7_8fe8_cd36_3465,
            0x89d9_ee8b_458b_8479,
            0xe2b9_98a6_effc_1210,
            0x0968_bb6d_6164_d870,
            0xd0c8_5c63_5b8d_b8e4
        ],
        "{hashes:#018x?}"
    );
}

//! Recorded samples and orders of the board: the same compare values as ever.
//!
//! A recorded sample does not answer to another voltage, so a control that differs in its last digit departs from the record, and
//! after a quarter of a second fault 11 ends it: then the runs are recorded again. They were when
//!
//! * the tracking came to divide by the slope of a table instead of a constant: with the injection, from the first torque on, the
//!   angle differs in its last digit; before that, and with the encoder, the hashes of commit 1abee12 held;
//! * the references of the current loop got a direct share, which changes the voltage at every step of theirs;
//! * a start without an encoder looks for a turning shaft with half of the current at once;
//! * duties took the place of timer counts in the modulator: a count differs here and there by one.

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
        let (compare, _) = drive.period(&mut front_end, &sample);
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
    assert_eq!(interrupts, 66_850);
    assert_eq!(
        hashes,
        [
            0xc06d_e027_8b97_5e1c,
            0x8004_1537_ec1f_028b,
            0xee78_4a96_1e86_b1e4,
            0xc697_c9a4_1a84_75a9,
            0x7337_f8f6_4bdc_5b0b,
            0x9356_2a4b_f590_f376,
            0x3d78_66ce_a845_d0e8,
            0x8334_6d54_3224_4e4e,
            0x3f3b_c8a7_30df_c000,
            0x591e_dccd_0f3d_9da2,
            0x6be2_2a21_d2b5_7e86,
            0xe522_8bf4_3e3d_0681
        ],
        "{hashes:#018x?}"
    );
}

#[test]
fn position_steps_with_the_encoder() {
    let (hashes, interrupts) = replay("encoder");
    assert_eq!(interrupts, 27_335);
    assert_eq!(
        hashes,
        [
            0xbca7_8fe8_cd36_3465,
            0xc30b_3f48_68a4_0656,
            0xc449_cba3_7330_1a51,
            0x0790_6be0_e4f8_d32c,
            0xbbe7_5d91_528e_aaf4
        ],
        "{hashes:#018x?}"
    );
}

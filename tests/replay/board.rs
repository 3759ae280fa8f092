//! Recorded samples and orders of the board: the same compare values as ever.
//!
//! A recorded sample does not answer to another voltage, so a control that differs in its last digit departs from the record, and
//! after a quarter of a second fault 11 ends it: then the runs are recorded again. They were when
//!
//! * the tracking came to divide by the slope of a table instead of a constant: with the injection, from the first torque on, the
//!   angle differs in its last digit; before that, and with the encoder, the hashes of commit 1abee12 held;
//! * the references of the current loop got a direct share, which changes the voltage at every step of theirs;
//! * a start without an encoder looks for a turning shaft with half of the current at once.

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
        let measured = drive.front_end().measure(&mut front_end, &sample);
        let output = drive.step(&measured);
        let compare = drive.front_end().put_out(&mut front_end, &output);
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
    assert_eq!(interrupts, 66_851);
    assert_eq!(
        hashes,
        [
            0x7638_63e4_da2a_5b5f,
            0x06ed_7ed6_d697_ea92,
            0xcada_993a_d0a2_9a3e,
            0x02fe_4035_c759_8491,
            0x5ee8_9677_2d95_ccfd,
            0x54e2_020c_0c9b_2c6e,
            0x56b3_02fe_ae03_9e85,
            0x10e9_dcce_d35f_e8de,
            0xcda0_5eb6_9f06_5708,
            0x96d9_ccc8_e4b5_cec8,
            0xe7a2_79f6_200b_40b0,
            0x235c_183a_3cbd_1430
        ],
        "{hashes:#018x?}"
    );
}

#[test]
fn position_steps_with_the_encoder() {
    let (hashes, interrupts) = replay("encoder");
    assert_eq!(interrupts, 27_257);
    assert_eq!(
        hashes,
        [
            0xbca7_8fe8_cd36_3465,
            0x8b5b_0808_b8b5_754c,
            0xa893_85b6_bd03_b067,
            0xf1ee_1706_51ac_db57,
            0x2fe6_fe2d_99c9_2d99
        ],
        "{hashes:#018x?}"
    );
}

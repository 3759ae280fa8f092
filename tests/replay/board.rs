//! Recorded samples and requests of the board give unchanged compare values.
//!
//! A recorded sample does not respond to another voltage, so a control that differs in its last digit departs from the recording, and
//! after a quarter of a second fault 11 ends the run. Then the runs are recorded again. They were when
//!
//! * the tracking began to divide by the saliency sensitivity of a table instead of a constant: with the injection, from the first torque
//!   on, the angle differs in its last digit; before that, and with the encoder, the hashes of commit 1abee12 remained;
//! * the references of the current loop got a feed-forward share, which changes the voltage at each of their steps;
//! * a start without an encoder searches for a rotating shaft with half of the current at once;
//! * duties replaced timer counts in the modulator: a count differs occasionally by one;
//! * tasks of the injection period moved to other samples, so that no sample has much more to do than another;
//! * a filter replaced the tracking loop, and a command is taken after one sample of ten;
//! * the voltage limit moved to another sample, the resistance returns to the measured one, and an angle error changes the flux;
//! * the compensation of the dead time takes the mean of the signs of a current that crosses zero within a period;
//! * the resistance stays near the measured one, and the slow error decays with the rotor time constant.

use std::fs;

use drive_core::{Command, Compare, Drive, FrontEndState, Sample};
use induction_drive::console::grammar::{self, Request};
use induction_drive::desk::order::Order;
use induction_drive::settings::FirmwareSettings;

use super::player::{BLOCK, Fnv};

/// Hashes of the compare values, one for every [`BLOCK`] interrupts, and the number of interrupts.
fn replay(name: &str) -> (Vec<u64>, usize) {
    let path = format!("{}/tests/recorded/{name}", env!("CARGO_MANIFEST_DIR"));
    let samples = fs::read(format!("{path}.samples")).unwrap();
    let orders = fs::read_to_string(format!("{path}.orders")).unwrap();
    let mut orders = orders.lines().map(|line| line.split_once(' ').unwrap()).peekable();
    let mut settings = FirmwareSettings::of_the_board();
    // The recorded board had not learned.
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

/// Gives a request that the board's drive accepted.
fn order(drive: &mut Drive, settings: &mut FirmwareSettings, line: &str) {
    let request = if line == "check wiring" { None } else { Some(grammar::parse(line).unwrap()) };
    let taken = match request {
        None => drive.command(&Command::CheckWiring),
        Some(Request::Order(Order::Start(mode))) => drive.command(&Command::Start(mode)),
        Some(Request::Order(Order::Stop(stop))) => drive.command(&Command::Stop(stop)),
        Some(Request::Order(Order::Torque(i_q))) => drive.command(&Command::Torque(i_q)),
        Some(Request::Order(Order::Position(turns))) => drive.command(&Command::Position(turns)),
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
    assert_eq!(interrupts, 66_874);
    assert_eq!(
        hashes,
        [
            0x4f46_c34d_2340_65e2,
            0x20c5_e0ff_87bf_2860,
            0xdf92_5fe2_44d7_c960,
            0x7275_b66f_0179_de2a,
            0x7799_55cd_bbc2_6548,
            0x1be9_6b0b_f82e_3705,
            0xe251_32b4_49c5_033d,
            0x716e_837a_b654_4ac1,
            0xd932_6a55_9404_4911,
            0x62c5_fd1d_db4f_b771,
            0xdd22_4e6c_a5a9_b71e,
            0x78c9_f22f_d839_01b3
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
            0x6a73_ee64_474e_c22b,
            0x71be_f114_e87a_8563,
            0xe65b_d80d_cb4c_1a31,
            0xaead_2632_cdbb_233d
        ],
        "{hashes:#018x?}"
    );
}

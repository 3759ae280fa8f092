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

use drive_core::{Drive, Sample};
use induction_drive::settings::FirmwareSettings;

use super::player::{BLOCK, Fnv, play};
use super::recorded;

/// Hashes of the compare values, one for every [`BLOCK`] interrupts, and the number of interrupts.
fn replay(name: &str) -> (Vec<u64>, usize) {
    let path = recorded(name);
    let samples = fs::read(format!("{path}.samples")).unwrap();
    let orders = fs::read_to_string(format!("{path}.orders")).unwrap();
    let sample = |bytes: &[u8]| {
        let code = |at| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        Sample {
            current_a: code(0),
            current_b: code(2),
            dc_link: code(4),
            heat_sink: code(6),
            encoder: u32::from_le_bytes(bytes[8..].try_into().unwrap()),
            ..Sample::default()
        }
    };
    let samples: Vec<Sample> = samples.chunks_exact(12).map(sample).collect();
    let mut settings = FirmwareSettings::of_the_board();
    // The recorded board had not learned.
    settings.drive.injection.synchronous.allow_unlearned = true;
    // This was the default of its image.
    settings.drive.inertia = Some(0.012);
    let drive = Drive::new(settings.build().unwrap());
    let mut hashes: Vec<Fnv> = Vec::new();
    play(drive, &settings, &samples, &orders, 1, |n, compare, _, _| {
        if n.is_multiple_of(BLOCK) {
            hashes.push(Fnv::default());
        }
        hashes.last_mut().unwrap().compare(compare);
    });
    (hashes.iter().map(|hash| hash.0).collect(), samples.len())
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

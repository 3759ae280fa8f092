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
    assert_eq!(interrupts, 67_354);
    assert_eq!(
        hashes,
        [
            0x128c_baa6_9661_3d13,
            0x8f22_f58a_13ca_5094,
            0x2138_a104_9dac_dd36,
            0x5496_8d66_6c83_afee,
            0x830b_b57a_fe3b_5a01,
            0x2bb2_5af6_ee39_cf4a,
            0xd153_b866_e01e_0890,
            0x08fc_80bc_c159_f12a,
            0xdd97_bf64_3c2c_5423,
            0xcc41_28d1_a952_4940,
            0x8239_789c_4f63_8a18,
            0x8e10_5a4a_e064_f188
        ],
        "{hashes:#018x?}"
    );
}

#[test]
fn position_steps_with_the_encoder() {
    let (hashes, interrupts) = replay("encoder");
    assert_eq!(interrupts, 27_559);
    assert_eq!(
        hashes,
        [
            0xbca7_8fe8_cd36_3465,
            0xc4c8_5991_1bfe_262c,
            0xd2e7_e9bb_20ed_5561,
            0x5be8_828c_63bc_dbc3,
            0xab8a_fdce_4c18_bff9
        ],
        "{hashes:#018x?}"
    );
}

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
//! * the resistance stays near the measured one, and the slow error decays with the rotor time constant;
//! * the filter got the length of the flux as a state, with the rotor equation.

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
    assert_eq!(interrupts, 67_364);
    assert_eq!(
        hashes,
        [
            0xe253_9934_caaa_c9af,
            0xe924_949b_c9a2_880a,
            0x49ba_8b19_fd5e_dcd9,
            0x2413_a73c_566d_3ef0,
            0x8fae_d466_7a43_0b55,
            0x8675_8d8f_ee09_6351,
            0xe253_09a7_efbe_f11f,
            0xfca7_a71c_ee03_1eaa,
            0xd6d2_0b50_3d29_38b1,
            0xf595_10c7_0bce_d937,
            0x13b1_69b3_1dae_1db7,
            0x9430_3dc8_009c_db0e
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

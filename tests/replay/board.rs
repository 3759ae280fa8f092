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
//! * the filter got the length of the flux as a state, with the rotor equation;
//! * the asymmetry is followed while the frame rotates.

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
    assert_eq!(interrupts, 67_363);
    assert_eq!(
        hashes,
        [
            0x2092_c04c_f06e_1ba3,
            0xbd72_77b5_2436_713b,
            0xc9e7_006f_f525_421b,
            0xfa13_8b09_d661_6e49,
            0x4125_b5a9_bb8c_ec24,
            0x0ad7_a53b_ad87_e24a,
            0xe54e_e474_8f3e_a05c,
            0x1af3_eb49_e55c_7fd8,
            0xf604_9fcb_eddc_80b5,
            0x164d_3c2d_9d94_4096,
            0x622f_c4fa_9327_0c2e,
            0xa8a9_b0fc_4922_f89a
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

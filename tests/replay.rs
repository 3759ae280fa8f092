//! Recorded samples and orders of the board, replayed through the host drive: the same compare values as ever.
//!
//! A change that is meant to leave the control as it is leaves these hashes as they are. One that changes the
//! control on purpose changes them too; its commit names the cause.

use std::fs;

use drive_core::{Command, Compare, Drive, Sample};
use induction_drive::console::grammar::{self, Request};
use induction_drive::settings::FirmwareSettings;

/// Interrupts to a hash, so that a difference is located.
const BLOCK: usize = 6000;

/// Hashes of the compare values, one for every [`BLOCK`] interrupts, and the number of interrupts. `magnetise_s` is the
/// magnetising time of the image that was recorded; unset: by rule.
fn replay(name: &str, magnetise_s: Option<f32>) -> (Vec<u64>, usize) {
    let path = format!("{}/tests/recorded/{name}", env!("CARGO_MANIFEST_DIR"));
    let samples = fs::read(format!("{path}.samples")).unwrap();
    let orders = fs::read_to_string(format!("{path}.orders")).unwrap();
    let mut orders = orders.lines().map(|line| line.split_once(' ').unwrap()).peekable();
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive.sequence.magnetise_s = magnetise_s;
    // The image that was recorded started without an encoder though it had not learned.
    settings.drive.injection.synchronous.allow_unlearned = true;
    let mut drive = Drive::new(settings.build().unwrap());

    let mut compares = Vec::new();
    for (n, bytes) in samples.chunks_exact(12).enumerate() {
        let code = |at| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let compare = drive.step(&Sample {
            current_a: code(0),
            current_b: code(2),
            dc_link: code(4),
            heat_sink: code(6),
            encoder: u32::from_le_bytes(bytes[8..].try_into().unwrap()),
            ..Sample::default()
        });
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
        Some(Request::Stop) => drive.command(&Command::Stop),
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
    let bytes = compares.iter().flat_map(|compare| {
        let [a, b, c] = [compare.a, compare.b, compare.c].map(u16::to_le_bytes);
        [a[0], a[1], b[0], b[1], c[0], c[1], u8::from(compare.enabled)]
    });
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn torque_steps_without_a_sensor() {
    let (hashes, interrupts) = replay("sensorless", Some(0.8));
    assert_eq!(interrupts, 64_506);
    assert_eq!(
        hashes,
        [
            0xc28d_4cb0_0a4e_ef75,
            0x7c90_5346_e39b_829b,
            0x8e37_8b44_a3e6_676f,
            0x1038_8535_17ee_0b78,
            0x2d1c_291f_f728_6af4,
            0xb875_38c4_6fe6_3795,
            0xead4_131f_da78_2e10,
            0xff14_07e5_19de_f83e,
            0x8b94_b64e_6ad1_48d2,
            0x7644_af28_5c35_a233,
            0x9411_374c_529a_dedf
        ],
        "{hashes:#018x?}"
    );
}

#[test]
fn position_steps_with_the_encoder() {
    let (hashes, interrupts) = replay("encoder", None);
    assert_eq!(interrupts, 26_615);
    assert_eq!(
        hashes,
        [
            0xbca7_8fe8_cd36_3465,
            0xf61f_e2f6_afcb_7b55,
            0xdbc6_9329_e341_af41,
            0xeecc_9000_682d_edac,
            0x787e_59fa_c3ae_2551
        ],
        "{hashes:#018x?}"
    );
}

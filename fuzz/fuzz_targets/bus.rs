//! Any frames on the bus, with wires, lines and samples between them: every answer is whole, and the drive stops if the bus commands it
//! and becomes silent.
#![no_main]

use crc::{CRC_16_MODBUS, Crc};
use drive_core::{Measured, State};
use induction_drive::front::Front;
use induction_drive::modbus::Frame;
use induction_drive::settings::Commander;
use induction_drive::terminals::Contacts;
use induction_drive_fuzz::START;
use induction_drive_fuzz::doubles::{FakeBus, FakeDrive, FakePort, FakeTerminals};
use libfuzzer_sys::fuzz_target;

/// Registers with a meaning of their own.
const REGISTERS: [u16; 12] = [
    0x2000, 0x2001, 0x2002, 0x6040, 0x4fff, 0x0100, 0x2100, 0x3000, 0x5000, 0x5100, 0x603f, 0x4000,
];
const LINES: &str = "stop|start|clear|set bus.commands bus|set bus.commands console|set bus.commands strip|apply|revert|defaults|status";

fn sum(bytes: &[u8]) -> [u8; 2] {
    Crc::<u16>::new(&CRC_16_MODBUS).checksum(bytes).to_le_bytes()
}

/// A request with its checksum.
fn whole(head: &[u8], register: u16, rest: &[u8]) -> Vec<u8> {
    let body = [head, &register.to_be_bytes(), rest].concat();
    [&body[..], &sum(&body)].concat()
}

fuzz_target!(|bytes: &[u8]| {
    let (mut settings, initial) = START.clone();
    settings.command.commander = Commander::Bus;
    let (mut front, mut drive) = (Front::new(settings), FakeDrive::new(initial));
    let (mut bus, mut terminals) = (Some(FakeBus::default()), FakeTerminals::default());
    let mut port = FakePort { room: usize::MAX, ..FakePort::default() };
    let (mut now_ms, mut at) = (0_u32, bytes.iter().copied());
    // At most 400 passes.
    for _ in 0..400 {
        let Some(what) = at.next() else { break };
        let mut next = || at.next().unwrap_or(0);
        let register = |n: u8| REGISTERS[usize::from(n) % REGISTERS.len()];
        let mut request = None;
        match what % 12 {
            0 => now_ms = now_ms.wrapping_add(u32::from(next()) * 8),
            // Any function, to the drive or as a broadcast; then any bytes.
            1 | 2 => {
                let body: Vec<u8> = (0..next().min(251)).map(|_| next()).collect();
                let body = [&[what % 2][..], &body].concat();
                request = Some([&body[..], &sum(&body)].concat());
            }
            3 => request = Some((0..next()).map(|_| next()).collect()),
            4 => request = Some(whole(&[1, 6], register(next()), &[next() & 3, next()])),
            // A number for any setting.
            5 => {
                let setting = 0x4000 + 2 * u16::from(next());
                let value = match next() % 8 {
                    0 => f32::NAN,
                    1 => f32::INFINITY,
                    2 => -0.0,
                    3 => 1e30,
                    4 => f32::from(next()),
                    5 => f32::from(next()) * 0.01,
                    6 => f32::MIN_POSITIVE / 4.0,
                    _ => f32::from_bits(u32::from_be_bytes([next(), next(), next(), next()])),
                };
                let value = [&[0, 2, 4][..], &value.to_bits().to_be_bytes()].concat();
                request = Some(whole(&[1, 16], setting, &value));
            }
            6 => {
                let first = register(next()).wrapping_add(u16::from(next()));
                request = Some(whole(&[1, 3], first, &[0, next()]));
            }
            7 => {
                let sample = Measured { dc_link: 2.0 * f32::from(next()), ..Measured::default() };
                for _ in 0..next() {
                    drive.drive.step(&sample);
                }
            }
            8 => terminals.closed = Contacts(next()),
            9 => {
                let line = LINES.split('|').nth(usize::from(next()) % 10).unwrap_or_default();
                port.sent.extend(line.bytes().chain([b'\n']));
            }
            10 => terminals.codes = [0, 1, 2].map(|n| (n != 1).then(|| u16::from(next()) << 4)),
            _ => {}
        }
        if let (Some(request), Some(bus)) = (request, &mut bus) {
            bus.asked.push_back(Frame::from_slice(&request).expect("a frame"));
        }
        let own = |front: &Front| front.desk.settings().in_force().modules.bus.own();
        let before = own(&front);
        front.pass(&mut port, bus.as_mut(), &mut terminals, &mut drive, now_ms);
        port.received.clear();
        for answer in bus.iter_mut().flat_map(|bus| bus.answers.drain(..)) {
            assert!((5..=256).contains(&answer.len()), "{answer:?}");
            let (body, end) = answer.split_at(answer.len() - 2);
            assert_eq!(end, sum(body));
            assert!([before, own(&front)].contains(&body[0]), "{answer:?}");
        }
    }
    // After any input: no side sends anything from here on.
    while !port.sent.is_empty() || front.desk.is_busy() {
        front.pass(&mut port, bus.as_mut(), &mut terminals, &mut drive, now_ms);
    }
    let patience = front.desk.settings().in_force().command.timeout_s;
    if front.desk.commander() == Commander::Bus && patience < 3.0 {
        for _ in 0..100 {
            now_ms = now_ms.wrapping_add(100);
            front.pass(&mut port, bus.as_mut(), &mut terminals, &mut drive, now_ms);
        }
        let state = drive.drive.state();
        let rests = matches!(state, State::Off | State::Stopping | State::Fault(_));
        assert!(rests, "{state}, time-out {patience} s");
    }
});

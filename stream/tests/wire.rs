//! Frames survive the wire, and the receiver recovers after damage.

use drive_stream::{Damage, Frame, LONGEST, Piece, Splitter, wire_bytes};
use proptest::prelude::*;

fn frames() -> impl Strategy<Value = Frame> {
    let values = prop::collection::vec(any::<u32>().prop_map(f32::from_bits), 1..=8);
    (any::<u16>(), any::<u32>(), values).prop_map(|(sequence, period, values)| Frame {
        sequence,
        period,
        values: values.into_iter().collect(),
    })
}

fn written(frame: &Frame) -> Vec<u8> {
    let mut wire = [0xaa; LONGEST];
    let length = frame.write(&mut wire);
    wire[..length].to_vec()
}

/// Compared by their bytes, because a value may be NaN.
fn same(a: &Frame, b: &Frame) -> bool {
    written(a) == written(b)
}

fn lines() -> impl Strategy<Value = Vec<u8>> {
    "[ -~]{0,60}\r\n".prop_map(String::into_bytes)
}

/// Frames and text, as they are received.
fn split(bytes: &[u8]) -> (Vec<Frame>, Vec<u8>, usize) {
    let (mut splitter, mut frames, mut text, mut damaged) =
        (Splitter::new(), Vec::new(), Vec::new(), 0);
    for byte in bytes {
        match splitter.push(*byte) {
            Piece::Nothing => {}
            Piece::Text(byte) => text.push(byte),
            Piece::Frame(frame) => frames.push(frame),
            Piece::Damaged => damaged += 1,
        }
    }
    (frames, text, damaged)
}

/// Worked by hand: sequence 1, period 0x100, value 1.0; the check value was computed with another program
/// (Python's `binascii.crc_hqx` with the initial value 0xffff).
#[test]
fn a_frame_is_laid_out_as_documented() {
    let frame = Frame { sequence: 1, period: 0x100, values: [1.0].into_iter().collect() };
    let contents = [1, 0, 0, 1, 0, 0, 0, 0, 0x80, 0x3f];
    let check = CHECK.to_le_bytes();
    let expected = [0, 2, contents[0], 1, 2, 1, 1, 1, 1, 5, 0x80, 0x3f, check[0], check[1], 0];
    assert_eq!(written(&frame), expected);
    assert_eq!(expected.len(), wire_bytes(1));
}

const CHECK: u16 = 0xea39;

proptest! {
    #[test]
    fn what_is_read_is_what_was_written(frame in frames()) {
        let wire = written(&frame);
        prop_assert_eq!(wire.len(), wire_bytes(frame.values.len()));
        prop_assert!(wire[1..wire.len() - 1].iter().all(|byte| *byte != 0));
        prop_assert!(same(&Frame::read(&wire[1..wire.len() - 1]).unwrap(), &frame));
    }

    #[test]
    fn frames_and_lines_on_one_wire_are_told_apart(
        pieces in prop::collection::vec((frames(), lines(), any::<bool>()), 1..20),
    ) {
        let (mut wire, mut text, mut sent) = (Vec::new(), Vec::new(), Vec::new());
        for (frame, line, is_line) in pieces {
            if is_line {
                wire.extend(&line);
                text.extend(line);
            } else {
                wire.extend(written(&frame));
                sent.push(frame);
            }
        }
        let (found, lines, damaged) = split(&wire);
        prop_assert_eq!(damaged, 0);
        prop_assert_eq!(lines, text);
        prop_assert_eq!(found.len(), sent.len());
        prop_assert!(found.iter().zip(&sent).all(|(a, b)| same(a, b)));
    }

    /// A lost or damaged byte costs two frames at most: its own, and the next one if the end was lost.
    #[test]
    fn a_damaged_byte_costs_two_frames_at_most(
        sent in prop::collection::vec(frames(), 4..12),
        at in any::<prop::sample::Index>(),
        flip in 1_u8..,
        lost in any::<bool>(),
    ) {
        let mut wire: Vec<u8> = sent.iter().flat_map(written).collect();
        let at = at.index(wire.len());
        if lost {
            wire.remove(at);
        } else {
            wire[at] ^= flip;
        }
        let (found, ..) = split(&wire);
        prop_assert!(found.len() + 2 >= sent.len(), "{} of {}", found.len(), sent.len());
        prop_assert!(found.iter().all(|frame| sent.iter().any(|known| same(known, frame))));
        prop_assert!(same(found.last().unwrap(), sent.last().unwrap()) || at + 2 * LONGEST >= wire.len());
    }

    #[test]
    fn a_receiver_that_joins_late_is_in_step_within_two_frames(
        sent in prop::collection::vec(frames(), 4..12),
        from in any::<prop::sample::Index>(),
    ) {
        let wire: Vec<u8> = sent.iter().flat_map(written).collect();
        let from = from.index(written(&sent[0]).len());
        let (found, ..) = split(&wire[from..]);
        prop_assert!(found.len() + 2 >= sent.len());
        prop_assert!(same(found.last().unwrap(), sent.last().unwrap()));
    }

    #[test]
    fn a_changed_bit_is_noticed(frame in frames(), at in any::<prop::sample::Index>(), bit in 0..8_u32) {
        let wire = written(&frame);
        let mut block = wire[1..wire.len() - 1].to_vec();
        let at = at.index(block.len());
        block[at] ^= 1 << bit;
        prop_assert!(Frame::read(&block).is_err());
    }

    #[test]
    fn any_bytes_are_harmless(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let (_, text, _) = split(&bytes);
        prop_assert!(!text.contains(&0));
        let _ = Frame::read(&bytes);
    }
}

#[test]
fn wrong_lengths_are_named() {
    assert_eq!(Frame::read(&[1; 60]), Err(Damage::Length(60)));
    // A whole block of COBS, but without values.
    assert_eq!(Frame::read(&[2, 7]), Err(Damage::Length(1)));
    assert_eq!(Frame::read(&[]), Err(Damage::Cobs));
}

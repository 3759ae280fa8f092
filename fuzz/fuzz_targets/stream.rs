//! Any bytes on the wire: the receiver goes on, returns text as it came, and finds every frame that follows.
#![no_main]

use drive_stream::{Frame, LONGEST, Piece, Splitter};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let (mut splitter, mut wire) = (Splitter::new(), [0; LONGEST]);
    for byte in bytes {
        match splitter.push(*byte) {
            Piece::Text(text) => assert_eq!(text, *byte),
            // Bytes that are accepted as a frame equal those that this frame is written as.
            Piece::Frame(frame) => {
                let length = frame.write(&mut wire);
                let again = Frame::read(&wire[1..length - 1]).expect("a frame");
                assert_eq!((again.sequence, again.period), (frame.sequence, frame.period));
                let bits = |f: &Frame| f.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&again), bits(&frame));
            }
            Piece::Nothing | Piece::Damaged => {}
        }
    }
    // At most two frames later the receiver is in step.
    let values = [1.0, -2.5].into_iter().collect();
    let frame = Frame { sequence: 7, period: 9, values };
    let length = frame.write(&mut wire);
    let mut found = 0;
    for byte in wire[..length].iter().cycle().take(3 * length) {
        found += usize::from(splitter.push(*byte) == Piece::Frame(frame.clone()));
    }
    assert!(found > 0);
});

//! The functions of the WebAssembly library, for `worker.js`: numbers in, numbers out, text and frames in the memory.

use std::cell::RefCell;

use serde_json::json;

use crate::talk::Talk;

/// The conversation; a line from the page, or texts; and frames for the page.
type Kept = (Option<Talk>, Vec<u8>, Vec<u8>);

thread_local! {
    static KEPT: RefCell<Kept> = const { RefCell::new((None, Vec::new(), Vec::new())) };
}

fn with<R: Default>(act: impl FnOnce(&mut Talk) -> R) -> R {
    KEPT.with_borrow_mut(|(talk, ..)| talk.as_mut().map(act).unwrap_or_default())
}

/// Powers a board up, which learns the motor whose name was written as a line. Returns whether it did; if not, a message says why.
#[unsafe(no_mangle)]
extern "C" fn init(seed: u32) -> bool {
    KEPT.with_borrow_mut(|(talk, text, _)| {
        match Talk::learning(&String::from_utf8_lossy(text), seed.into()) {
            Ok(begun) => *talk = Some(begun),
            Err(why) => *text = json!([{ "gone": why }]).to_string().into_bytes(),
        }
        talk.is_some()
    })
}

/// Returns the place for a line of this number of bytes.
#[unsafe(no_mangle)]
extern "C" fn line(bytes: usize) -> *mut u8 {
    KEPT.with_borrow_mut(|(_, text, _)| {
        *text = vec![0; bytes];
        text.as_mut_ptr()
    })
}

/// Asks the line that was written to this place.
#[unsafe(no_mangle)]
extern "C" fn ask(number: u32) {
    let text = KEPT.with_borrow(|(_, text, _)| String::from_utf8_lossy(text).into_owned());
    with(|talk| talk.ask(number, &text));
}

/// Stops the drive.
#[unsafe(no_mangle)]
extern "C" fn stop() {
    with(Talk::stop);
}

/// Simulates this number of milliseconds; returns whether the simulation should run as fast as possible.
#[unsafe(no_mangle)]
extern "C" fn advance(ms: u32) -> bool {
    with(|talk| {
        talk.advance(ms);
        talk.hurries()
    })
}

/// Takes the messages and frames for the page.
#[unsafe(no_mangle)]
extern "C" fn take() {
    let (text, frames) = with(Talk::take);
    KEPT.with_borrow_mut(|(_, places, kept)| (*places, *kept) = (text.into_bytes(), frames));
}

/// Address of these texts, or frames.
#[unsafe(no_mangle)]
extern "C" fn place(frames: bool) -> *const u8 {
    KEPT.with_borrow(|(_, text, kept)| if frames { kept.as_ptr() } else { text.as_ptr() })
}

/// Number of bytes of these texts, or frames.
#[unsafe(no_mangle)]
extern "C" fn length(frames: bool) -> usize {
    KEPT.with_borrow(|(_, text, kept)| if frames { kept.len() } else { text.len() })
}

/// A number computed from all compare values and currents so far: equal in two runs of the same steps with the same bits.
#[unsafe(no_mangle)]
extern "C" fn fingerprint() -> u64 {
    with(|talk| talk.board.machine.fingerprint)
}

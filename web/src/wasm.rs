//! The functions of the WebAssembly library, for `worker.js`: numbers in, numbers out, text and frames in the memory.

use std::cell::RefCell;

use crate::talk::Talk;

/// The talk; a line from the page, or texts and frames for it.
type Kept = (Option<Talk>, Vec<u8>, Vec<u8>);

thread_local! {
    static KEPT: RefCell<Kept> = const { RefCell::new((None, Vec::new(), Vec::new())) };
}

fn with<R: Default>(act: impl FnOnce(&mut Talk) -> R) -> R {
    KEPT.with_borrow_mut(|(talk, ..)| talk.as_mut().map(act).unwrap_or_default())
}

/// Switches a board on, which learns its motor. Its settings are constants, of which tests make a board.
#[unsafe(no_mangle)]
extern "C" fn init(seed: u32) {
    KEPT.with_borrow_mut(|kept| kept.0 = Talk::learning(seed.into()).ok());
}

/// Place for a line of so many bytes.
#[unsafe(no_mangle)]
extern "C" fn line(bytes: usize) -> *mut u8 {
    KEPT.with_borrow_mut(|(_, text, _)| {
        *text = vec![0; bytes];
        text.as_mut_ptr()
    })
}

/// Asks the line that was written there.
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

/// So many milliseconds pass; whether the drive does what nobody wants to wait for.
#[unsafe(no_mangle)]
extern "C" fn advance(ms: u32) -> bool {
    with(|talk| {
        talk.advance(ms);
        talk.hurries()
    })
}

/// Takes what there is for the page.
#[unsafe(no_mangle)]
extern "C" fn take() {
    let (text, frames) = with(Talk::take);
    KEPT.with_borrow_mut(|(_, places, kept)| (*places, *kept) = (text.into_bytes(), frames));
}

/// Where that is: texts, or frames.
#[unsafe(no_mangle)]
extern "C" fn place(frames: bool) -> *const u8 {
    KEPT.with_borrow(|(_, text, kept)| if frames { kept.as_ptr() } else { text.as_ptr() })
}

/// Its bytes.
#[unsafe(no_mangle)]
extern "C" fn length(frames: bool) -> usize {
    KEPT.with_borrow(|(_, text, kept)| if frames { kept.len() } else { text.len() })
}

/// A number that all compare values and currents so far have made: equal in two runs of the same steps with the same bits.
#[unsafe(no_mangle)]
extern "C" fn fingerprint() -> u64 {
    with(|talk| talk.board.machine.fingerprint)
}

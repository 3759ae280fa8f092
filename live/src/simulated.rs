//! The board without hardware, in this program and in real time: it needs neither an emulator nor pseudo-terminals.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::mpsc::{Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

use drive_web::board::HostBoard;
use drive_web::motors::Motor;
use hil_sim::console::link::Link;

use crate::shared::Shared;

/// Time from one reading of the clock to the next.
const PAUSE: Duration = Duration::from_millis(5);
/// Most time that is simulated at once, after the computer slept for example.
const MOST_MS: u128 = 200;

/// The transmit direction to the board.
struct ToBoard(Sender<Vec<u8>>);

impl Write for ToBoard {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.send(bytes.to_vec()).map_err(|_| io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Powers a board up that has learned its motor, and connects to it. The board ends with the connection.
///
/// # Errors
/// The reason why the board does not start.
pub fn connect(shared: &Arc<Shared>, seed: u64) -> Result<Link, String> {
    let mut board = HostBoard::new(&Motor::named("dissertation")?, seed)?;
    board.learn()?;
    let (reader, mut writer) = io::pipe().map_err(|why| why.to_string())?;
    let (send, lines) = channel::<Vec<u8>>();
    let told = shared.clone();
    std::thread::spawn(move || {
        let mut last = Instant::now();
        loop {
            match lines.try_recv() {
                Ok(bytes) => board.write(&bytes),
                Err(TryRecvError::Disconnected) => return,
                Err(TryRecvError::Empty) => {
                    let passed = last.elapsed().as_millis();
                    last += Duration::from_millis(passed as u64);
                    (0..passed.min(MOST_MS)).for_each(|_| board.millisecond());
                    told.flux(board.machine.flux());
                    if writer.write_all(&board.read()).is_err() {
                        return;
                    }
                    std::thread::sleep(PAUSE);
                }
            }
        }
    });
    let (lines, frames) = (shared.clone(), shared.clone());
    let show = move |line: &str| lines.tell(serde_json::json!({ "line": line }));
    Ok(Link::with_frames(reader, ToBoard(send), show, move |frame| frames.frame(frame)))
}

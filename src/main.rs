//! The firmware of the drive.
//!
//! Order of events:
//!
//! * the start block (`chip/start.rs`): ST's loader if it was requested, the check sum of the image, the control code to CCM.
//! * [`main`], once: clocks, serial port, encoder, power stage with all switches off, ADCs, the drive (`task/bring_up.rs`).
//! * the control interrupt (`task/control.rs`), 6000 times a second, at the highest priority: samples in,
//!   `Drive::step`, compare values out, then one command from the console if there is one.
//! * the interrupts of the serial port (`console/port.rs`) and of the field bus (`modbus/port.rs`): a byte in, a byte out.
//! * the loop at the end of `main`, between interrupts: command arbiter, console and field bus (`front.rs`), the log ten times a second,
//!   the tracking of the rotor time constant (`task/supervisor.rs`), the check of the control's memory and registers (`task/check.rs`),
//!   and the cross-checks of clock and reference voltage (`task/sources.rs`).
//! * `chip/stop.rs`, when the firmware cannot go on: outputs off, the reason kept for the next boot, reset.
//! * the watchdog (`monitor/watchdog.rs`, `chip/watchdog.rs`), when the loop or the control interrupt stalls, and the window watchdog
//!   (`chip/window.rs`), when the control interrupt does not come for three periods.
//!
//! The drive starts off; `start` at the console switches the outputs on.
//!
//! On a host this is a program that explains how to flash.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod task;

/// Entry of the firmware, see the top of this file.
#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use defmt_rtt as _; // the log goes to the debug probe
    use induction_drive::monitor::record::Reason;

    induction_drive::chip::memory::paint_stack();
    defmt::info!("induction-drive {}", task::supervisor::VERSION);
    let mut supervisor = core::mem::MaybeUninit::uninit();
    match task::bring_up::bring_up(&mut supervisor) {
        Ok(board) => run(board),
        Err(_) => induction_drive::chip::stop::end(Reason::Panic, [line!(), 0, 0, 0]),
    }
}

/// The main loop.
#[cfg(target_os = "none")]
#[inline(never)] // its stack replaces that of the start
fn run(board: task::bring_up::Board) -> ! {
    let task::bring_up::Board { front, mut port, mut line, mut contacts, supervisor } = board;
    front.console.greet(supervisor);
    loop {
        let now_ms = supervisor.listen();
        front.pass(&mut port, line.as_mut(), &mut contacts, supervisor, now_ms);
        supervisor.feed_watchdog();
        // Sleeps until an interrupt. The sleep is at the end of the loop: if the control does not run, no interrupt comes before the
        // greeting is sent.
        induction_drive::chip::sleep::until_interrupt();
    }
}

/// Explains how to flash.
#[cfg(not(target_os = "none"))]
fn main() {
    print!("{}", include_str!("README.md"));
}

//! Recording of signals: the control interrupt writes them period by period, and the main loop reads them.
//!
//! The [`ring`] has the newest control periods for all readers of the main loop: report, stream, tracking of the rotor time constant,
//! commissioning. The [`trace`] keeps chosen signals of up to a thousand periods, with a trigger. The [`stream`] makes frames of them
//! for the live page.

pub mod ring;
pub mod stream;
pub mod trace;

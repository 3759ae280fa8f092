//! The loop of the dissertation: four demodulators and the PII controller that turns the injection axis, to compare with.
//!
//! Everything but its [settings](PrintedSettings) needs the feature `printed`. A drive with it has both loops, and the setting
//! `injection.demodulator` selects one: see `ComparedLoop`.
//!
//! # Demodulators
//!
//! They extract the saliency from the sampled current, as the synchronous demodulation does.
//!
//! All rotate the current into the dm-qm frame, whose axes lie 45° to either side of the injection axis,
//! and compare its two channels. With a saliency `s` (complex; its angle is twice the angle from the
//! injection axis to the axis of the lower inductance) the two injection currents are
//! `I/sqrt2 (1 + Re s -+ Im s)`, so each signal below is a multiple of `Im s`: zero on the axes of the
//! saliency, and steepest there.
//!
//! | | output | content |
//! |---|---|---|
//! | [`Literal`] | A | leakage of the fundamental, not the saliency |
//! | [`Rectified`] | A, 0.60 of the amplitude | saliency; leakage through the band-pass as ripple |
//! | [`RmsImpedance`] | ohm | saliency, with the injection along the flux (Ha and Sul) |
//! | [`Envelope`] | A, 0.945 of the amplitude | saliency, with the least delay behind a band-pass |
//! | `SynchronousState` | dimensionless | saliency, independent of amplitude and inductance |
//!
//! Delay of a small change of the saliency, measured on given currents, and noise of the signal as
//! equivalent angle, on the simulated motor at i_q = 1 A with 5 mA rms in each current channel
//! (experiment `demodulators`):
//!
//! | | delay, samples | noise, rms | rotation |
//! |---|---|---|---|
//! | [`Rectified`] | 33.0 | 3.3° | after the band-pass |
//! | [`RmsImpedance`], 20 samples | 42.8 | 3.8° | before it |
//! | [`Envelope`] | 14.5 | 3.6° | before it |
//! | `SynchronousState` | 19.0 | 2.9° | - |
//!
//! The position of the rotation matters. The output of the band-pass is 8.8 samples old; resolved in the
//! present axis it also contains the speed of the axis. At constant speed this is compensated. For the
//! tracker's own corrections it acts as damping, on which the printed controller (z_s = 0.90) relies: with
//! the rotation before the band-pass, the rectified chain loses the angle with that controller.

pub use crate::carrier::DemodulatorKind;
pub use crate::flux::PrintedSettings;

#[cfg(feature = "printed")]
mod chain;
#[cfg(feature = "printed")]
mod demodulate;
#[cfg(feature = "printed")]
mod demodulator;
#[cfg(feature = "printed")]
mod envelope;
#[cfg(feature = "printed")]
mod loops;
#[cfg(feature = "printed")]
mod rms_impedance;
#[cfg(feature = "printed")]
mod tracker;

#[cfg(feature = "printed")]
pub use {
    chain::{Literal, Rectified},
    demodulate::Demodulate,
    demodulator::Demodulator,
    envelope::Envelope,
    loops::{ComparedLoop, PrintedState},
    rms_impedance::RmsImpedance,
    tracker::Tracker,
};

#[cfg(all(test, feature = "printed"))]
mod tests;

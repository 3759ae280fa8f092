//! Field-oriented control of a three-phase induction motor without a position sensor, down to zero
//! speed, by a 600 Hz voltage injected on the q axis.
//!
//! The whole drive is one type, [`Drive`], and the whole control is one function, [`Drive::step`]: currents and voltages go
//! in as [`Measured`], duties come out as an [`Output`]. A [`FrontEnd`] around it converts ADC counts and timer counts. The
//! same code runs in the control interrupt of the firmware and against the simulated motor on a host, and gives the same
//! bits on both: angles are integers, sine and cosine come from one integer table, the step calls no transcendental function
//! (its square roots are those of libm, in software on both), and no multiplication is fused with an addition.
//!
//! Signals flow in one direction only:
//!
//! ```text
//! front end -> frames -> filters -> flux angle -> current loop -> injection -> dead time -> modulation -> front end
//! ```
//!
//! | module | contents |
//! |---|---|
//! | the root | [`Drive`], its [`Coefficients`], states and commands; front end, faults, motor, scales; speed loop, dc link, relay |
//! | [`io`] | input and output of a step and of the front end |
//! | [`filter`] | second-order sections |
//! | [`current`] | PI, modulation, dead time and inverter voltage error |
//! | [`blocks`] | the optional blocks, each a cargo feature |
//! | [`carrier`] | the injected voltage and the synchronous demodulation of its current |
//! | [`flux`] | the angle of the rotor flux, from the encoder or from the saliency |
//! | [`printed`] | the loop of the dissertation, to compare with |
//! | [`protect`] | checks of sensors, wiring, saliency and lock |
//! | [`learned`], [`table`] | the result of a saliency self-commissioning with locked shaft, and its tables |
//! | [`homing`] | finding a stop of the shaft |
//!
//! Modules of blocks are hidden from this documentation, because only the design of their coefficients uses them.
//!
//! The coefficients come from outside: the crate `induction-drive-settings` designs them from settings in SI units.
//! `induction-drive-commission` finds the parameters of the motor, `induction-drive-rotor-id` its rotor time constant while it
//! runs.
//!
//! Each block is a small pair of coefficients, which are public, and state, which only the drive has, with one step function.
//! Equation, table, figure and section numbers refer to R. A. N. Barroso, "Controle de torque sensorless de um motor de
//! indução com injeção de sinal de alta frequência no eixo de quadratura", UFC, 2017.
//!
//! # Conventions
//!
//! * Amplitude-invariant Clarke transformation: currents and voltages are peak phase values.
//! * `phi` is the angle of the rotor flux, `theta = phi + 90°` the injection axis; electrical.
//! * A frequency or speed inside (`*_freq`) is normalised: electrical turns per control period of 1/6000 s.
//! * The machine is the T-equivalent circuit: r_s, r_r, L_m and the two leakages.
//! * Sample `k` acts in period `k + 1`: see [`io`].
#![cfg_attr(not(test), no_std)]

// The blocks, their coefficients and homing are hidden from the documentation, and every release may change them. The sibling crates, the
// firmware and the laboratory of this project use them; a program that runs a drive needs none of them.
#[doc(hidden)]
pub mod blocks;
#[doc(hidden)]
pub mod carrier;
#[doc(hidden)]
pub mod current;
mod dc_link;
mod drive;
mod fault;
#[doc(hidden)]
pub mod filter;
#[doc(hidden)]
pub mod flux;
mod front_end;
#[doc(hidden)]
pub mod homing;
mod identify;
pub mod io;
pub mod learned;
mod line;
mod math;
mod motion;
mod motor;
#[doc(hidden)]
pub mod printed;
#[doc(hidden)]
pub mod protect;
mod supply;
#[doc(hidden)]
pub mod table;

pub use dc_link::Limiting;
pub use drive::{
    Accepted, COAST_S, Coefficients, Command, Drive, Mode, Refused, Stage, State, Stop, Telemetry,
    TestReport, TestSignal, TorqueLimits,
};
#[doc(inline)]
pub use flux::AngleSource;
pub use front_end::FrontEndState;
pub use io::{CONVERTER_CODES, Compare, Hardware, Measured, Output, PERIOD_S, Sample, periods};
pub use math::angle::{Angle, UnitVector};
pub use math::frames::{Abc, AlphaBeta, Dq};
pub use {fault::Fault, line::Line, motor::Motor};

#[doc(hidden)]
pub use dc_link::{ChopperSettings, DcLink, DcLinkSettings};
#[doc(hidden)]
pub use drive::{DcLimit, PowerLimit, Protection, Regulator, SequenceSteps};
#[doc(hidden)]
pub use front_end::{FrontEnd, shunts::Shunts};
#[doc(hidden)]
pub use math::{frames::SQRT_3, limited, within};
#[doc(hidden)]
pub use motion::{Motion, MotionGains, Ramps};
#[doc(hidden)]
pub use {flux::AngleLoop, identify::learning::Learning, motor::FirstOrder, supply::Relay};

/// The settings and the design, compiled into the unit tests, because as a dependency they would bring a second instance of this
/// crate.
#[cfg(test)]
#[path = "../settings/src/settings/mod.rs"]
pub mod settings;
#[cfg(test)]
#[path = "../settings/src/tuning/mod.rs"]
pub mod tuning;
#[cfg(test)]
extern crate self as drive_core;
#[cfg(test)]
#[path = "../../tests/common/generated.rs"]
mod generated;

/// Examples in the documents, compiled as tests.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../README.md")]
    struct Readme;
}

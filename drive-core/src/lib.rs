//! Field-oriented control of a three-phase induction motor without a position sensor, down to zero
//! speed, by a 600 Hz voltage injected on the quadrature axis.
//!
//! The whole drive is one type, [`Drive`], and the whole control one function, [`Drive::step`]:
//! converter codes go in as a [`Sample`], timer values come out as a [`Compare`]. The same code runs
//! in the control interrupt of the firmware and against the simulated motor on a host, and gives the
//! same bits on both: angles are integers, sine and cosine come from one integer table, the step calls no
//! transcendental function (its square roots are those of libm, in software on both), and no
//! multiplication is fused with an addition.
//!
//! Inside, one direction only:
//!
//! ```text
//! sensing -> frames -> filters -> flux angle -> current loop -> injection -> dead time -> modulation
//! ```
//!
//! | room | contents |
//! |---|---|
//! | [`io`], [`fault`] | sample and compare values; the numbered faults |
//! | [`math`], [`filter`] | angles and frames; second-order sections |
//! | [`current`] | sensing, PI, modulation, dead time and drop of the inverter |
//! | [`carrier`] | the injected voltage and the demodulation of its current |
//! | [`flux`] | the angle of the rotor flux, from the encoder or from the saliency |
//! | [`motion`] | speed and position loop |
//! | [`dc_link`] | limits of the torque current by the dc link, chopper |
//! | [`supply`] | precharge relay |
//! | [`protect`] | checks of sensors, wiring, saliency and lock |
//! | [`learned`] | what a learning has found |
//! | [`homing`] | finding a stop of the shaft |
//! | [`commission`] | from the nameplate to the parameters of the motor |
//! | [`identify`] | learning of the tracking reference; rotor time constant while running |
//! | [`settings`], [`tuning`] | settings in SI units; design of the controllers |
//! | `drive` | [`Drive`], its [`Coefficients`], states and commands |
//!
//! Each block is a small pair of coefficients (made from settings in SI units, outside the
//! interrupt) and state, with one step function. Equation, table, figure and section numbers are
//! those of R. A. N. Barroso, "Controle de torque sensorless de um motor de indução com injeção de
//! sinal de alta frequência no eixo de quadratura", UFC, 2017.
//!
//! # Conventions
//!
//! * Amplitude-invariant Clarke transformation: currents and voltages are peak phase values.
//! * `phi` is the angle of the rotor flux, `theta = phi + 90°` the injection axis; electrical.
//! * A frequency or speed inside (`*_freq`) is normalised: electrical turns per control period of 1/6000 s.
//! * The machine is the T-equivalent circuit: r_s, r_r, L_m and the two leakages.
//! * Sample `k` acts in period `k + 1`: see [`io`].
#![cfg_attr(not(test), no_std)]

pub mod carrier;
pub mod commission;
pub mod current;
pub mod dc_link;
mod drive;
pub mod fault;
pub mod filter;
pub mod flux;
pub mod homing;
pub mod identify;
pub mod io;
pub mod learned;
pub mod math;
pub mod motion;
pub mod protect;
pub mod settings;
pub mod supply;
pub mod tuning;

pub use drive::{
    Accepted, Coefficients, Command, Drive, Excitation, Excited, Mode, Refused, Regulator, Room,
    Stage, State, Stop, Telemetry,
};
pub use fault::Fault;
pub use io::{Compare, Hardware, Sample};
pub use math::angle::{Angle, UnitVector};
pub use math::frames::{Abc, AlphaBeta, DmQm, Dq};
pub use settings::Settings;

/// The examples of the documents.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../../docs/porting.md")]
    struct Porting;
}

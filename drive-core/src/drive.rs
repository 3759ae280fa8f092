//! The whole drive: one step per PWM period.

mod allowed;
mod axes;
mod catching;
mod coefficients;
mod command;
mod commands;
mod excitation;
mod excite;
mod fundamental;
mod in_turn;
mod layout;
mod learn;
mod observed;
mod protect;
mod reference;
mod scalar;
mod starting;
mod state;
mod stopping;
#[cfg(test)]
mod tests;
mod trust;

use core::mem::offset_of;
use core::ops::Range;

use crate::carrier::CarrierSample;
use crate::carrier::injection::{Carrier, CarrierPeriod};
use crate::current::inverter_drop::{DropSample, InverterDropState};
use crate::current::pi::{DqPiState, ReferenceState};
use crate::current::sensing::SensingState;
use crate::current::voltage_limit::VoltageLimitState;
use crate::dc_link::{DcLinkLimits, DcLinkState, Limiting};
use crate::fault::Fault;
use crate::filter::dissertation::{LPF, LpfState};
use crate::flux::estimator::EstimatorState;
use crate::flux::hand_over::HandOver;
use crate::flux::indirect::IndirectState;
use crate::flux::observer::{Induced, ObserverState};
use crate::flux::volts_per_hertz::VoltsPerHertzState;
use crate::identify::learning::{Learned, LearningState};
use crate::io::{Compare, Sample};
use crate::math::frames::{AlphaBeta, Dq};
use crate::motion::{MotionState, RotorCount};
use crate::protect::lock_monitor::LockMonitorState;
use crate::protect::noise_watch::NoiseWatchState;
use crate::protect::plausibility::{CarrierWatch, PredictionState};
use crate::protect::saliency_check::SaliencyCheckState;
use crate::protect::thermal::ThermalLoads;
use crate::protect::wiring_check::WiringCheckState;
use crate::settings::AngleSource;
use crate::supply::RelayState;

use axes::Axes;
use catching::CatchingState;
pub use coefficients::Coefficients;
pub use command::{Accepted, Command, Refused, Stop};
pub use excitation::{Excitation, Excited, Regulator};
use excite::ExcitationState;
use in_turn::StepResults;
pub use layout::Layout;
use observed::Observed;
pub use observed::{Room, Telemetry};
use reference::References;
pub use state::{Mode, State};

/// The drive: coefficients, state, and the references it was given.
///
/// ```
/// use drive_core::settings::{AngleSource, Settings};
/// use drive_core::{Command, Drive, Mode, Sample, State};
///
/// // Without an encoder it would have to learn its motor first.
/// let settings = Settings { angle_source: AngleSource::Encoder, ..Settings::default() };
/// let mut drive = Drive::new(settings.build()?);
/// drive.command(&Command::Start(Mode::Torque))?;
/// // Codes of zero current and 311 V.
/// let sample = Sample { current_a: 2022, current_b: 2015, dc_link: 2827, heat_sink: 1309, ..Sample::default() };
/// let compare = drive.step(&sample);
/// assert!(!compare.enabled); // the offsets are calibrated first, with the outputs off
/// assert_eq!(drive.state(), State::Calibrating);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Drive {
    c: Coefficients,
    /// Changes of `c`, counted, wrapping.
    changes: u32,
    control: ControlState,
    state: State,
    mode: Mode,
    /// Control periods spent in this state.
    elapsed: u32,
    /// Whether the next start checks the wiring.
    wiring_unchecked: bool,
    wiring: WiringCheckState,
    /// Starts so far, wrapping.
    starts: u32,
    /// Count of the encoder at position 0, where that was set.
    home: Option<u32>,
    learned: Option<Learned>,
    thermal: ThermalLoads,
    relay: RelayState,
}

/// State of the control, fresh at every start.
// In this order: the fields of every step lie within the 1020 bytes that a floating-point load of the core
// reaches from one base address; otherwise every sixth instruction of a step computes an address.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
struct ControlState {
    references: References,
    sensing: SensingState,
    seen: Observed,
    low_pass: LpfState,
    indirect: IndirectState,
    observer: ObserverState,
    hand_over: HandOver,
    /// What flux and leakage induce, and the observer's share in the angle, by which it is fed forward.
    induced: Induced,
    induced_share: f32,
    carrier: Carrier,
    axes: Axes,
    reference: [ReferenceState; 2],
    current_loop: DqPiState,
    rotor: RotorCount,
    prediction: PredictionState,
    motion: MotionState,
    /// Whether it brakes by the ramp of a quick stop.
    quick_stop: bool,
    voltage_limit: VoltageLimitState,
    dc_link: DcLinkState,
    /// Present limits by the dc link.
    limits: DcLinkLimits,
    limiting: Limiting,
    /// Torque current that heat sink, motor or inverter does not bear, of the largest of all, A, and which of them.
    too_hot_for: f32,
    too_hot: Limiting,
    carrier_watch: CarrierWatch,
    saliency_check: SaliencyCheckState,
    lock: LockMonitorState,
    noise: NoiseWatchState,
    inverter_drop: InverterDropState,
    catching: CatchingState,
    /// Large: it holds the state of the alternative demodulations.
    estimator: EstimatorState,
    learning: LearningState,
    /// Whether a learning has measured all its points.
    all_measured: bool,
    excitation: ExcitationState,
    turning: VoltsPerHertzState,
}

impl Drive {
    /// Where in a drive its coefficients are, bytes: for a check of its memory from outside. They change
    /// only when the count [`Self::CHANGES`] does.
    pub const COEFFICIENTS: Range<usize> =
        offset_of!(Self, c)..offset_of!(Self, c) + size_of::<Coefficients>();
    /// Where in a drive that count is, a `u32`.
    pub const CHANGES: usize = offset_of!(Self, changes);

    /// A drive that is off.
    pub fn new(coefficients: Coefficients) -> Self {
        Self {
            c: coefficients,
            changes: 0,
            state: State::Off,
            mode: Mode::Torque,
            elapsed: 0,
            control: ControlState::default(),
            wiring_unchecked: false,
            wiring: WiringCheckState::default(),
            starts: 0,
            home: None,
            learned: None,
            thermal: ThermalLoads::default(),
            relay: RelayState::default(),
        }
    }

    /// The present state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether [`online`](crate::identify::online) is to be given what the last step saw.
    pub fn tracks_rotor(&self) -> bool {
        self.c.track_rotor && self.state.regulates()
    }

    /// One PWM period: from the sample of instant `k T` to the compare values of the period that
    /// begins at `(k + 1) T`.
    ///
    /// Never panics. Whatever is wrong with the sample or with the state becomes a latched fault,
    /// with the outputs off in the same step.
    #[inline(never)] // in the firmware's crate it would be compiled for size: 350 cycles more in the median
    pub fn step(&mut self, sample: &Sample) -> Compare {
        let regulates = self.state.has_current();
        let result = if regulates { self.regulate(sample) } else { self.prepare(sample) };
        self.elapsed = self.elapsed.wrapping_add(1);
        let result = result.and_then(|compare| self.watch_load().map(|()| compare));
        let compare = result.unwrap_or_else(|off| {
            let off = self.why_not_caught(off);
            let measured = off == State::Off && self.control.all_measured;
            let off = if measured { self.evaluate_learning() } else { off };
            self.enter(off);
            Compare::OFF
        });
        self.c.sensing.applied(&mut self.control.sensing, &compare);
        compare
    }

    /// Regulates the current: the control law, top to bottom.
    ///
    /// # Errors
    /// The state to go to with the outputs off: a fault, or off where it has stopped.
    fn regulate(&mut self, sample: &Sample) -> Result<Compare, State> {
        let (c, s) = (&self.c, &mut self.control);
        let measured = c.sensing.step(&mut s.sensing, sample);
        c.protect(&s.sensing, sample, &measured)?;
        if c.source == AngleSource::Encoder {
            s.seen.rotor_count = sample.encoder;
        }
        let wanted = self.reference()?;
        let trust = self.trust();
        let counts = self.counts();
        let (c, s) = (&self.c, &mut self.control);
        let index = s.carrier.advance();
        let reference = Dq {
            d: c.reference_filter[0].step(&mut s.reference[0], wanted.d),
            q: c.reference_filter[1].step(&mut s.reference[1], wanted.q),
        };
        s.seen.reference = reference;

        // Flux angle at the sample.
        let flux = if counts {
            // While it learns, the shaft is locked, and the flux may lead the frame.
            let count = if self.mode == Mode::Learning { 0 } else { sample.encoder };
            let flux = c.indirect.angle(&mut s.indirect, count).map_err(|_| Fault::Encoder)?;
            flux.less(s.references.lead)
        } else {
            s.estimator.flux()
        };
        (s.seen.phi, s.seen.flux_freq) = (flux.phi, flux.freq);
        let phi = flux.phi.unit_vector();
        let axes = &s.axes;

        // The expected carrier current is subtracted; the filter takes the rest. (Its notch is 6 Hz wide:
        // alone it would let the sidebands of a turning carrier through.)
        let silent = !c.inject || s.hand_over.silent;
        let carrier =
            if silent { CarrierPeriod::default() } else { s.carrier.at(&c.injection, index) };
        let carrier_axis = phi.turned_by(axes.carrier);
        let rest = measured.current - AlphaBeta::along(carrier_axis, carrier.sampled);
        let filtered = LPF.step(&mut s.low_pass, rest);
        let seen = if s.hand_over.silent { measured.current } else { filtered };

        // Current loop.
        let flux_axis = phi.turned_by(axes.seen);
        let current = seen.to_dq(flux_axis);
        let voltage = c.current_loop.step(&mut s.current_loop, reference - current)
            + s.induced.at(reference) * s.induced_share
            + s.references.test_voltage;
        (s.seen.current, s.seen.voltage) = (current, voltage);

        // Injection, Eq. 3.6: the carrier along theta = phi + 90°.
        let applied = phi.turned_by(axes.applied);
        let total = (voltage + axes.injection * carrier.voltage).to_alpha_beta(applied);

        // Dead-time compensation, by the signs of the currents that will flow.
        let expected = (current + axes.injection * carrier.mean_current).to_alpha_beta(applied);
        let signs = c.dead_time.signs(expected.to_abc());
        let compensation = c.dead_time.voltage(signs, measured.dc_link, s.inverter_drop.volts);
        let modulated = c.modulator.step(total, compensation, measured.dc_link);
        (s.seen.measured, s.seen.realised) = (measured.current, modulated.realised);
        s.seen.dc_link = measured.dc_link;
        if modulated.limited {
            s.current_loop.back_calculate((modulated.realised - total).to_dq(applied));
        }

        if trust.drop {
            let sample = DropSample {
                current,
                voltage,
                magnetising: s.indirect.magnetising,
                signs: signs.to_abc().to_alpha_beta().to_dq(applied),
                dc_link: measured.dc_link,
            };
            if let Some(ratio) = c.inverter_drop.step(&mut s.inverter_drop, self.elapsed, &sample) {
                s.observer.resistance = ratio - 1.0;
            }
        }

        // Angles for the next sample.
        if c.demodulate {
            let sample = CarrierSample { current: measured.current, axis: carrier_axis, carrier };
            c.estimator.observe(&mut s.estimator, &sample, flux.freq);
        }
        let flux_current =
            if counts { current.seen_from(s.references.lead_axis) } else { reference };
        let rotor_freq = if counts {
            c.indirect.slip(&mut s.indirect, flux_current.q);
            s.indirect.rotor_freq
        } else {
            // By the reference: the measured current would feed the angle error back.
            c.indirect.slip(&mut s.indirect, reference.q);
            let slip_freq = s.indirect.slip_freq;
            let turning = c.observe_fundamental(s, index, &trust, seen, phi);
            if c.observer.is_some() {
                let carrier =
                    AlphaBeta::along(applied.turned_by(s.axes.injection), carrier.voltage);
                s.observer.put_out(modulated.realised - carrier);
            }
            let (estimator, i_q) = (&mut s.estimator, reference.q);
            if trust.turns && c.estimator.track(estimator, i_q, slip_freq, &turning).is_err() {
                return Err(self.not_finite().unwrap_or(Fault::LostAngle).into());
            }
            s.estimator.rotor_freq
        };

        // No output from a state that is not finite. (The voltage contains current and reference of the step
        // before, the speed contains the demodulated signal.)
        if !(voltage.d + voltage.q + flux.freq + rotor_freq).is_finite() {
            return Err(self.not_finite().unwrap_or(Fault::NonFiniteState).into());
        }

        // Checks and slow tasks, one a sample.
        s.prediction.collect(measured.current, modulated.realised);
        let results = StepResults {
            sample,
            measured: &measured,
            flux_current,
            i_q: reference.q,
            voltage,
            carrier_axis,
            flux_axis,
            flux_freq: flux.freq,
            rotor_freq,
            trust,
        };
        c.in_turn(s, index, &results)?;
        Ok(Compare::on(modulated.compare))
    }

    /// Whether the flux angle is the counted rotor angle plus the slip: with the encoder, or while the drive
    /// learns with the shaft locked.
    fn counts(&self) -> bool {
        self.c.source == AngleSource::Encoder || self.mode == Mode::Learning
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.elapsed = 0;
    }
}

impl ControlState {
    /// Angle of the rotor, flux less slip, counted as by an encoder.
    fn count_by_flux(&mut self) -> u32 {
        self.rotor.follow(self.estimator.flux().phi - self.indirect.slip)
    }
}

//! The whole drive: one step per PWM period.

mod commands;
mod learn;
#[cfg(test)]
mod tests;

use core::f32::consts::TAU;
use core::mem::offset_of;
use core::ops::Range;

use crate::angle::{Angle, UnitVector};
use crate::demodulator::CarrierSample;
use crate::estimator::EstimatorState;
use crate::fault::Fault;
use crate::filters::{LPF, LpfState, lpf_lag_samples};
use crate::frames::{AlphaBeta, Dq};
use crate::indirect::IndirectState;
use crate::injection::{Carrier, CarrierPeriod};
use crate::inverter_drop::InverterDropState;
use crate::io::{Compare, Hardware, Mode, Sample};
use crate::learning::{Learned, LearningState};
use crate::lock_monitor::LockMonitorState;
use crate::motion::{Goal, MotionState, RotorCount};
use crate::noise_watch::NoiseWatchState;
use crate::pi::{DqPiState, ReferenceState};
use crate::plausibility::{CarrierWatch, JUDGED_EVERY, Prediction, PredictionState, is_judged};
use crate::saliency_check::{Phase, SaliencyCheck, SaliencyCheckState};
use crate::sensing::{Measured, SensingState};
use crate::settings::{AngleSource, Coefficients};
use crate::state::State;
use crate::wiring_check::{Next, WiringCheckState};

/// The drive: coefficients, state, and the references it was given.
///
/// ```
/// use drive_core::{Command, Drive, Mode, Sample, State, settings::Settings};
///
/// let mut drive = Drive::new(Settings::default().build()?);
/// drive.command(Command::Start(Mode::Torque))?;
/// // Codes of zero current and 311 V.
/// let sample = Sample { current_a: 2022, current_b: 2015, dc_link: 2827, ..Sample::default() };
/// let compare = drive.step(&sample);
/// assert!(!compare.enabled); // the offsets are calibrated first, with the outputs off
/// assert_eq!(drive.state(), State::Calibrating);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Drive {
    c: Coefficients,
    /// How often `c` was changed, wrapping.
    changes: u32,
    control: ControlState,
    state: State,
    mode: Mode,
    /// Control periods spent in this state.
    elapsed: u32,
    /// Whether the next start checks the wiring.
    wiring_unchecked: bool,
    wiring: WiringCheckState,
    learned: Option<Learned>,
}

/// What was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
struct References {
    current: Dq,
    /// Mechanical turns/s.
    speed: f32,
    /// Mechanical turns.
    turns: f32,
    /// Added to the voltage of the current loop, V.
    test_voltage: Dq,
    /// Injection axis seen from the flux.
    injection_axis: UnitVector,
}

impl Default for References {
    fn default() -> Self {
        Self {
            current: Dq::ZERO,
            speed: 0.0,
            turns: 0.0,
            test_voltage: Dq::ZERO,
            injection_axis: UnitVector { cos: 0.0, sin: 1.0 },
        }
    }
}

/// Everything that moves while the drive regulates; fresh at every start.
// In this order: what every step needs lies together, within the 1020 bytes that a floating-point load
// of the core reaches from one base. Without that every sixth instruction of a step computes an address.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
struct ControlState {
    references: References,
    sensing: SensingState,
    seen: Observed,
    low_pass: LpfState,
    indirect: IndirectState,
    carrier: Carrier,
    axes: Axes,
    reference: [ReferenceState; 2],
    current_loop: DqPiState,
    rotor: RotorCount,
    prediction: PredictionState,
    motion: MotionState,
    carrier_watch: CarrierWatch,
    saliency_check: SaliencyCheckState,
    lock: LockMonitorState,
    noise: NoiseWatchState,
    inverter_drop: InverterDropState,
    /// Those demodulations that are not the usual one are large: at its end.
    estimator: EstimatorState,
    learning: LearningState,
}

/// What turns slowly against the flux, as unit vectors seen from where it is at the sample; new once a
/// carrier period.
#[derive(Clone, Copy, Debug)]
struct Axes {
    /// The injection axis, seen from the flux.
    injection: UnitVector,
    /// The same where the flux was when the carrier current flowed that is sampled now.
    carrier: UnitVector,
    /// The flux when the filtered current flowed.
    seen: UnitVector,
    /// The flux when the voltage will act.
    applied: UnitVector,
}

impl Default for Axes {
    /// With the flux at rest.
    fn default() -> Self {
        let [along, across] = [(1.0, 0.0), (0.0, 1.0)].map(|(cos, sin)| UnitVector { cos, sin });
        Self { injection: across, carrier: across, seen: along, applied: along }
    }
}

/// What of a step stands nowhere else in the state; see [`Telemetry`].
#[derive(Clone, Copy, Debug, Default)]
struct Observed {
    phi: Angle,
    flux_step: f32,
    rotor_step: f32,
    reference: Dq,
    current: Dq,
    voltage: Dq,
    measured: AlphaBeta,
    realised: AlphaBeta,
    dc_link: f32,
    rotor_count: u32,
}

/// What the drive saw and did in the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telemetry {
    /// Estimated rotor-flux angle at the sample.
    pub phi: Angle,
    /// How fast it turns, electrical turns per period.
    pub flux_step: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_step: f32,
    /// Filtered current reference, A.
    pub reference: Dq,
    /// Filtered current in the estimated flux frame, A.
    pub current: Dq,
    /// Wanted voltage without the carrier, V.
    pub voltage: Dq,
    /// Measured current in the stator frame, A: nothing filtered, the carrier's part in it.
    pub measured: AlphaBeta,
    /// Voltage of the period that begins with the next sample, limited, dead-time compensation not
    /// counted, V.
    pub realised: AlphaBeta,
    /// Current difference that any but the synchronous demodulation sees, A.
    pub delta_i: f32,
    /// Saliency that the synchronous demodulation sees.
    pub saliency: f32,
    /// Square of the carrier current along the injection axis, A^2.
    pub carrier_squared: f32,
    /// Share of the carrier that is put out: below 1 where the fundamental leaves too little voltage.
    pub carrier_share: f32,
    /// Share of the flux-fixed saliency that the lock monitor misses; 1 is a flux that is gone.
    pub saliency_loss: f32,
    /// Dc-link voltage, V.
    pub dc_link: f32,
    /// Voltage per phase that the power stage drops beyond its dead time, as measured at the start, V.
    pub inverter_drop: f32,
    /// Position in mechanical turns from the start; without the encoder it drifts, see
    /// [`motion`](crate::motion).
    pub turns: f32,
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
            learned: None,
        }
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// What it saw and did in the last step.
    #[inline]
    pub fn telemetry(&self) -> Telemetry {
        let (t, s) = (&self.control.seen, &self.control);
        Telemetry {
            phi: t.phi,
            flux_step: t.flux_step,
            rotor_step: t.rotor_step,
            reference: t.reference,
            current: t.current,
            voltage: t.voltage,
            measured: t.measured,
            realised: t.realised,
            delta_i: s.estimator.delta_i,
            saliency: s.estimator.saliency().q,
            carrier_squared: s.estimator.saliency().carrier_squared,
            carrier_share: s.carrier.share,
            saliency_loss: s.lock.loss,
            dc_link: t.dc_link,
            inverter_drop: s.inverter_drop.volts,
            turns: self.c.motion.turns(&s.motion, t.rotor_count),
        }
    }

    /// Whether [`online`](crate::online) is to be given what the last step saw.
    #[inline]
    pub fn tracks_rotor(&self) -> bool {
        self.c.track_rotor && self.state.regulates()
    }

    /// One PWM period: from the sample of instant `k T` to the compare values of the period that
    /// begins at `(k + 1) T`.
    ///
    /// Never panics. Whatever is wrong with the sample or with the state becomes a latched fault,
    /// with the outputs off in the same step.
    // Not inlined: it would be compiled for size, as the firmware around it.
    #[inline(never)]
    pub fn step(&mut self, sample: &Sample) -> Compare {
        if matches!(self.state, State::Off | State::Fault(_)) {
            return Compare::OFF;
        }
        let measured = self.c.sensing.step(&self.control.sensing, sample);
        let mut compare = Compare::OFF;
        let result = match self.protect(sample, &measured) {
            Some(fault) => Err(fault),
            None => match self.state {
                State::Calibrating => self.calibrate(sample),
                State::Precharge => self.precharge(sample, &mut compare),
                State::CheckingWiring => self.check_wiring(sample, &measured, &mut compare),
                _ => self.regulate(sample, &measured, &mut compare),
            },
        };
        self.elapsed = self.elapsed.saturating_add(1);
        if let Err(fault) = result {
            self.enter(State::Fault(fault));
            return Compare::OFF;
        }
        compare
    }

    /// What must hold in every period with the outputs on or about to be.
    #[inline]
    fn protect(&self, sample: &Sample, measured: &Measured) -> Option<Fault> {
        let (sensing, state) = (&self.c.sensing, &self.control.sensing);
        let fine = sample.hardware == Hardware::NONE
            && sensing.is_well_inside(state, sample, measured.phases.c);
        if fine {
            None
        } else {
            self.what_is_wrong(sample, measured.phases.a, measured.phases.b, measured.dc_link)
        }
    }

    /// The first thing that is wrong, if anything is, with the currents in A and the dc link in V.
    #[inline(never)]
    fn what_is_wrong(&self, sample: &Sample, a: f32, b: f32, dc_link: f32) -> Option<Fault> {
        if sample.hardware != Hardware::NONE {
            return Some(of_hardware(sample.hardware));
        }
        if let Some(fault) = self.c.sensing.check(sample) {
            return Some(fault);
        }
        let (p, trip_a) = (&self.c.protection, self.c.sensing.trip_a);
        if a.abs() > trip_a {
            Some(Fault::OverCurrentA)
        } else if b.abs() > trip_a {
            Some(Fault::OverCurrentB)
        } else if (a + b).abs() > trip_a {
            Some(Fault::OverCurrentC)
        } else if dc_link > p.dc_over {
            Some(Fault::DcLinkOverVoltage)
        } else if dc_link < p.dc_under {
            Some(Fault::DcLinkUnderVoltage)
        } else {
            None
        }
    }

    fn calibrate(&mut self, sample: &Sample) -> Result<(), Fault> {
        if self.c.sensing.calibrate(&mut self.control.sensing, sample)?.is_some() {
            self.enter(State::Precharge);
        }
        Ok(())
    }

    fn precharge(&mut self, sample: &Sample, compare: &mut Compare) -> Result<(), Fault> {
        if self.elapsed >= self.c.sequence.precharge {
            if self.wiring_unchecked {
                self.wiring = WiringCheckState::default();
                self.enter(State::CheckingWiring);
            } else {
                self.magnetising_from_here(sample);
            }
        }
        *compare = Compare::LOW_SIDES_ON;
        Ok(())
    }

    /// Short voltage pulses, without control.
    fn check_wiring(
        &mut self,
        sample: &Sample,
        measured: &Measured,
        compare: &mut Compare,
    ) -> Result<(), Fault> {
        *compare = match self.c.wiring.step(&mut self.wiring, measured.phases)? {
            Next::Apply(voltage, flowing) => {
                let signs = self.c.dead_time.signs(flowing.to_abc());
                let compensation = self.c.dead_time.voltage(signs, measured.dc_link, 0.0);
                // (Which is there already; `step` would be written out again.)
                let modulated = self.c.modulator.limited(voltage, compensation, measured.dc_link);
                let [a, b, c] = modulated.compare;
                Compare { a, b, c, enabled: true }
            }
            Next::Passed => {
                self.wiring_unchecked = false;
                self.magnetising_from_here(sample);
                Compare::LOW_SIDES_ON
            }
        };
        Ok(())
    }

    fn magnetising_from_here(&mut self, sample: &Sample) {
        self.count_rotor(sample);
        let count = self.control.seen.rotor_count;
        self.c.motion.start(&mut self.control.motion, count);
        self.enter(State::Magnetising);
    }

    /// Regulates the current. This is the control law, top to bottom.
    fn regulate(
        &mut self,
        sample: &Sample,
        measured: &Measured,
        compare: &mut Compare,
    ) -> Result<(), Fault> {
        // What is done once a carrier period goes by this number.
        let index = self.control.carrier.advance();
        if self.c.source == AngleSource::Encoder || index == COUNTED_AT {
            self.count_rotor(sample);
        }
        let wanted = self.reference()?;
        let held = self.state == State::Magnetising;
        let (c, s) = (&self.c, near(&mut self.control));
        let reference = Dq {
            d: c.reference_filter[0].step(&mut s.reference[0], wanted.d),
            q: c.reference_filter[1].step(&mut s.reference[1], wanted.q),
        };
        s.seen.reference = reference;

        // Flux angle at the sample.
        let count = match (self.mode, c.source) {
            // The shaft is locked.
            (Mode::Learning, _) => Some(0),
            (_, AngleSource::Encoder) => Some(sample.encoder),
            (_, AngleSource::Injection) => None,
        };
        let flux = match count {
            Some(count) => c.indirect.angle(&mut s.indirect, count).map_err(|_| Fault::Encoder)?,
            None => s.estimator.flux(),
        };

        (s.seen.phi, s.seen.flux_step) = (flux.phi, flux.step);
        if index == TURNED_AT {
            s.axes = c.axes(flux.step, s.references.injection_axis);
        }
        let axes = &s.axes;
        let carrier =
            if c.inject { s.carrier.at(&c.injection, index) } else { CarrierPeriod::default() };

        // The carrier's current is taken out by what is known of it; the low-pass takes the rest. (Its
        // notch is 6 Hz wide: alone it would let the sidebands of a turning carrier through.)
        if let Some(watch) = &c.noise_watch
            && let Some(fault) = watch.step(&mut s.noise, index, sample)
        {
            return Err(fault);
        }
        let phi = flux.phi.unit_vector();
        let carrier_axis = phi.turned_by(axes.carrier);
        let rest = measured.current - AlphaBeta::along(carrier_axis, carrier.sampled);
        let filtered = LPF.step_alpha_beta(&mut s.low_pass, rest);

        // Current loop.
        let seen = phi.turned_by(axes.seen);
        let current = filtered.to_dq(seen);
        let voltage = c.current_loop.step(&mut s.current_loop, reference - current)
            + s.references.test_voltage;
        (s.seen.current, s.seen.voltage) = (current, voltage);

        // Injection, Eq. 3.6: the carrier along theta = phi + 90°.
        let applied = phi.turned_by(axes.applied);
        let total = (voltage + axes.injection * carrier.voltage).to_alpha_beta(applied);

        // Dead time: the sign of the current that is going to flow decides.
        let expected = (current + axes.injection * carrier.mean_current).to_alpha_beta(applied);
        let signs = c.dead_time.signs(expected.to_abc());
        let compensation = c.dead_time.voltage(signs, measured.dc_link, s.inverter_drop.volts);
        let modulated = c.modulator.step(total, compensation, measured.dc_link);
        (s.seen.measured, s.seen.realised) = (measured.current, modulated.realised);
        s.seen.dc_link = measured.dc_link;
        if modulated.limited {
            s.current_loop.realised((modulated.realised - total).to_dq(applied));
        }

        if self.state == State::Magnetising {
            c.inverter_drop.step(
                &mut s.inverter_drop,
                (self.elapsed, c.sequence.magnetise),
                (current, voltage, s.indirect.magnetising),
                signs.to_abc().to_alpha_beta().to_dq(applied),
                measured.dc_link,
            );
        }

        // Angles for the next sample.
        if c.demodulate {
            let sample = CarrierSample {
                current: measured.current,
                axis: carrier_axis,
                carrier,
                i_q: reference.q,
            };
            c.estimator.observe(&mut s.estimator, &sample, flux.step);
        }
        let rotor_step = match count {
            Some(_) => {
                c.indirect.update(&mut s.indirect, current, index);
                s.indirect.rotor_step
            }
            None => {
                // The slip of what is asked for: that of the measured current would feed the angle
                // error back.
                c.indirect.update(&mut s.indirect, reference, index);
                // The acceleration that is asked for is known: the angle does not lag by it.
                s.estimator.rotor_step += c.step_per_speed * s.motion.acceleration;
                // The flux is held still until it stands.
                if !held
                    && c.estimator
                        .track(&mut s.estimator, reference.q, s.indirect.slip_step)
                        .is_err()
                {
                    return Err(self.not_finite().unwrap_or(Fault::LostAngle));
                }
                s.estimator.rotor_step
            }
        };

        s.seen.rotor_step = rotor_step;

        // What was computed must make sense before it is put out. (The current and the reference of the step
        // before are in the voltage, and what the demodulation sees is in the speed.)
        if !(voltage.d + voltage.q + flux.step + rotor_step).is_finite() {
            return Err(self.not_finite().unwrap_or(Fault::NonFiniteState));
        }
        if index == SPEED_AT && rotor_step.abs() > c.protection.rotor_step {
            return Err(Fault::OverSpeed);
        }
        if c.inject {
            match index {
                // Is it the flux that is tracked? (While it learns nothing is tracked, and what is
                // compared with is not known yet.)
                MONITORED_AT => {
                    let judged = s.carrier.is_settled() && (held || self.mode != Mode::Learning);
                    if let (Some(monitor), true) = (&c.lock_monitor, judged) {
                        let seen = s.estimator.synchronous.seen;
                        monitor.step(&mut s.lock, &seen, s.carrier.per_share_squared, held)?;
                    }
                }
                // Do both sensors see the carrier?
                WATCHED_AT => {
                    let amplitude = s.carrier.share * c.injection.current_amplitude;
                    let current = s.estimator.synchronous.carrier_current();
                    if let Some(fault) = s.carrier_watch.step(current, carrier_axis, amplitude) {
                        return Err(fault);
                    }
                }
                // Does the carrier fit beside the fundamental?
                FITTED_AT => {
                    let largest = c.modulator.circle(measured.dc_link);
                    if s.carrier.fit(&c.injection, voltage, largest).is_err() {
                        return Err(Fault::CarrierNoRoom);
                    }
                }
                _ => {}
            }
        }
        // Does the current follow the voltage?
        Prediction::collect(&mut s.prediction, index, measured.current, modulated.realised);
        if is_judged(index) {
            let rotor = c.prediction.rotor_voltage(s.indirect.magnetising, rotor_step);
            let middle = seen.turned_slightly(-0.5 * JUDGED_EVERY as f32 * flux.step);
            let rotor = rotor.to_alpha_beta(middle);
            if let Some(fault) = c.prediction.judge(&mut s.prediction, measured.current, rotor) {
                return Err(fault);
            }
        }

        // If it has not stopped.
        if self.state != State::Off {
            let [a, b, c] = modulated.compare;
            *compare = Compare { a, b, c, enabled: true };
        }
        Ok(())
    }

    /// Where the rotor is, counted as by an encoder: by the encoder, or by the flux less the slip.
    #[inline]
    fn count_rotor(&mut self, sample: &Sample) {
        let s = &mut self.control;
        s.seen.rotor_count = match self.c.source {
            AngleSource::Encoder => sample.encoder,
            AngleSource::Injection => s.rotor.follow(s.estimator.flux().phi - s.indirect.slip),
        };
    }

    /// The current to regulate in this state, A; moves on to the next state where it is time.
    fn reference(&mut self) -> Result<Dq, Fault> {
        let r = &mut self.control.references;
        let i_q = match self.state {
            State::Magnetising => return self.magnetise(),
            State::Verifying => return self.verify(),
            State::Learning => self.learn()?,
            State::Speed | State::Position => {
                let goal = match self.mode {
                    Mode::Speed => Goal::Speed(r.speed),
                    _ => Goal::Position(r.turns),
                };
                let count = self.control.seen.rotor_count;
                r.current.q = self.c.motion.step(&mut self.control.motion, goal, count);
                r.current.q
            }
            State::Stopping => {
                let ramp = self.c.sequence.stop_ramp;
                r.current.q = if r.current.q > ramp {
                    r.current.q - ramp
                } else if r.current.q < -ramp {
                    r.current.q + ramp
                } else {
                    self.state = State::Off;
                    0.0
                };
                self.control.references.current.q
            }
            _ => r.current.q,
        };
        Ok(Dq { d: self.control.references.current.d, q: i_q })
    }

    /// The current while the flux is built up, and while the saliency is checked, A.
    fn magnetise(&mut self) -> Result<Dq, Fault> {
        let s = &mut self.control;
        let r = &mut s.references;
        let level = self.c.inverter_drop.level(self.elapsed);
        let magnetising = Dq { d: level * r.current.d, q: 0.0 };
        let phase =
            match (self.elapsed.checked_sub(self.c.sequence.magnetise), self.c.saliency_check) {
                (None, _) => return Ok(magnetising),
                (Some(_), None) => Phase::Passed,
                (Some(n), Some(check)) => {
                    check.step(&mut s.saliency_check, n, s.estimator.saliency().q)
                }
            };
        match phase {
            Phase::Look => {
                r.injection_axis = SaliencyCheck::LOOK_AXIS;
                return Ok(Dq::ZERO);
            }
            Phase::Restore => {
                s.lock.share = s.saliency_check.share;
                r.injection_axis = self.c.injection_axis;
            }
            Phase::Passed => {
                let watched = self.c.lock_monitor.is_some() && self.mode != Mode::Learning;
                self.enter(if watched { State::Verifying } else { State::of_mode(self.mode) });
            }
            Phase::Failed => return Err(Fault::NoSaliency),
        }
        Ok(magnetising)
    }

    /// The current while the lock is verified, A: the axis is tracked for a while without torque.
    fn verify(&mut self) -> Result<Dq, Fault> {
        if self.elapsed >= self.c.sequence.verify {
            let step = self.control.estimator.rotor_step;
            if self.c.lock_monitor.is_some_and(|monitor| !monitor.stands(step)) {
                return Err(Fault::LostLock);
            }
            self.enter(State::of_mode(self.mode));
        }
        Ok(Dq { d: self.control.references.current.d, q: 0.0 })
    }

    /// Which of settings, references and state is to blame when a result is not finite.
    fn not_finite(&self) -> Option<Fault> {
        let r = &self.control.references;
        if !self.c.is_finite() {
            Some(Fault::NonFiniteSettings)
        } else if !(r.current.is_finite() && (r.speed + r.turns).is_finite()) {
            Some(Fault::NonFiniteCommand)
        } else if !self.control.estimator.is_finite() {
            Some(Fault::NonFiniteState)
        } else {
            None
        }
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.elapsed = 0;
    }
}

impl Coefficients {
    /// The current is seen from where the flux was when the filtered current flowed; the voltage is put
    /// where the flux will be when it acts. `step` is how far the flux turns in a period, turns.
    #[inline]
    fn axes(&self, step: f32, injection: UnitVector) -> Axes {
        let along = UnitVector { cos: 1.0, sin: 0.0 };
        let lag = self.lag_share * (lpf_lag_samples(step * TAU) + self.current_lag);
        Axes {
            injection,
            carrier: injection.turned_slightly(-step * self.estimator.lag),
            seen: along.turned_slightly(-step * lag),
            applied: along.turned_slightly(step * VOLTAGE_LEAD),
        }
    }
}

/// The same, at an address that the compiler does not know: relative to it all of the state is near, while
/// relative to the drive, or as an absolute address, each load and store computes its own.
#[inline(always)]
fn near(control: &mut ControlState) -> &mut ControlState {
    core::hint::black_box(control)
}

/// Periods from the sample to the middle of the period in which its voltage acts.
const VOLTAGE_LEAD: f32 = 1.5;

/// Samples of the carrier period in which there is done what is done once in it. It is spread: 1 to 5 are
/// those of the [synchronous demodulation](crate::synchronous), 8 that of the magnetising current, and in
/// 0 and 5 the current is [judged](is_judged).
const COUNTED_AT: usize = 3;
const MONITORED_AT: usize = 6;
const WATCHED_AT: usize = 7;
const FITTED_AT: usize = 8;
const TURNED_AT: usize = 9;
const SPEED_AT: usize = 9;

/// The most telling of the events: what switched off first comes first.
fn of_hardware(events: Hardware) -> Fault {
    if events.has(Hardware::BREAK) {
        Fault::Break
    } else if events.has(Hardware::ANALOG_WATCHDOG) {
        Fault::AnalogWatchdog
    } else if events.has(Hardware::CLOCK_FAILURE) {
        Fault::ClockFailure
    } else if events.has(Hardware::DEADLINE_MISS) {
        Fault::DeadlineMiss
    } else {
        Fault::ConverterOverrun
    }
}

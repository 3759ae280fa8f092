//! The whole drive: one step per PWM period.

mod commands;
mod learn;
#[cfg(test)]
mod tests;

use core::f32::consts::TAU;

use crate::angle::{Angle, UnitVector};
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
use crate::pi::{DqPiState, ReferenceState};
use crate::plausibility::{CarrierWatch, PredictionState};
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
    state: State,
    mode: Mode,
    /// Control periods spent in this state.
    elapsed: u32,
    references: References,
    sensing: SensingState,
    control: ControlState,
    /// Whether the next start checks the wiring.
    wiring_unchecked: bool,
    wiring: WiringCheckState,
    telemetry: Telemetry,
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
#[derive(Clone, Copy, Debug, Default)]
struct ControlState {
    low_pass: LpfState,
    indirect: IndirectState,
    estimator: EstimatorState,
    carrier: Carrier,
    reference: [ReferenceState; 2],
    current_loop: DqPiState,
    rotor: RotorCount,
    motion: MotionState,
    carrier_watch: CarrierWatch,
    prediction: PredictionState,
    saliency_check: SaliencyCheckState,
    lock: LockMonitorState,
    inverter_drop: InverterDropState,
    learning: LearningState,
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
    /// A drive that is off.
    pub fn new(coefficients: Coefficients) -> Self {
        Self {
            c: coefficients,
            state: State::Off,
            mode: Mode::Torque,
            elapsed: 0,
            references: References::default(),
            sensing: SensingState::default(),
            control: ControlState::default(),
            wiring_unchecked: false,
            wiring: WiringCheckState::default(),
            telemetry: Telemetry::default(),
            learned: None,
        }
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// What it saw and did in the last step.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
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
        let measured = self.c.sensing.step(&self.sensing, sample);
        let result = match self.protect(sample, &measured) {
            Some(fault) => Err(fault),
            None => match self.state {
                State::Calibrating => self.calibrate(sample),
                State::Precharge => Ok(self.precharge(sample)),
                State::CheckingWiring => self.check_wiring(sample, &measured),
                _ => self.regulate(sample, &measured),
            },
        };
        self.elapsed = self.elapsed.saturating_add(1);
        result.unwrap_or_else(|fault| {
            self.enter(State::Fault(fault));
            Compare::OFF
        })
    }

    /// What must hold in every period with the outputs on or about to be.
    fn protect(&self, sample: &Sample, measured: &Measured) -> Option<Fault> {
        let p = &self.c.protection;
        if sample.hardware != Hardware::NONE {
            return Some(of_hardware(sample.hardware));
        }
        if let Some(fault) = self.c.sensing.check(sample) {
            return Some(fault);
        }
        let i = measured.phases;
        if i.a.abs() > p.trip_a {
            Some(Fault::OverCurrentA)
        } else if i.b.abs() > p.trip_a {
            Some(Fault::OverCurrentB)
        } else if i.c.abs() > p.trip_a {
            Some(Fault::OverCurrentC)
        } else if measured.dc_link > p.dc_over {
            Some(Fault::DcLinkOverVoltage)
        } else if measured.dc_link < p.dc_under {
            Some(Fault::DcLinkUnderVoltage)
        } else {
            None
        }
    }

    fn calibrate(&mut self, sample: &Sample) -> Result<Compare, Fault> {
        if self.c.sensing.calibrate(&mut self.sensing, sample)?.is_some() {
            self.enter(State::Precharge);
        }
        Ok(Compare::OFF)
    }

    fn precharge(&mut self, sample: &Sample) -> Compare {
        if self.elapsed >= self.c.sequence.precharge {
            if self.wiring_unchecked {
                self.wiring = WiringCheckState::default();
                self.enter(State::CheckingWiring);
            } else {
                self.magnetising_from_here(sample);
            }
        }
        Compare::LOW_SIDES_ON
    }

    /// Short voltage pulses, without control.
    fn check_wiring(&mut self, sample: &Sample, measured: &Measured) -> Result<Compare, Fault> {
        match self.c.wiring.step(&mut self.wiring, measured.phases)? {
            Next::Apply(voltage, flowing) => {
                let signs = self.c.dead_time.signs(flowing.to_abc());
                let compensation = self.c.dead_time.voltage(signs, measured.dc_link, 0.0);
                let [a, b, c] =
                    self.c.modulator.step(voltage, compensation, measured.dc_link).compare;
                Ok(Compare { a, b, c, enabled: true })
            }
            Next::Passed => {
                self.wiring_unchecked = false;
                self.magnetising_from_here(sample);
                Ok(Compare::LOW_SIDES_ON)
            }
        }
    }

    fn magnetising_from_here(&mut self, sample: &Sample) {
        let count = self.rotor_count(sample);
        self.c.motion.start(&mut self.control.motion, count);
        self.enter(State::Magnetising);
    }

    /// Regulates the current. This is the control law, top to bottom.
    fn regulate(&mut self, sample: &Sample, measured: &Measured) -> Result<Compare, Fault> {
        let rotor_count = self.rotor_count(sample);
        let wanted = self.reference(rotor_count)?;
        let held = self.state == State::Magnetising;
        let (c, r, s) = (&self.c, &self.references, &mut self.control);
        let reference = Dq {
            d: c.reference_filter[0].step(&mut s.reference[0], wanted.d),
            q: c.reference_filter[1].step(&mut s.reference[1], wanted.q),
        };
        // Flux angle at the sample. The current is seen from where the flux was when the filtered
        // current flowed; the voltage is put where the flux will be when it acts.
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

        // The carrier's current is taken out by what is known of it; the low-pass takes the rest. (Its
        // notch is 6 Hz wide: alone it would let the sidebands of a turning carrier through.)
        let carrier =
            if c.inject { s.carrier.step(&c.injection) } else { CarrierPeriod::default() };
        let phi = flux.phi.unit_vector();
        let theta_axis = phi.turned_by(r.injection_axis);
        let rest = measured.current - AlphaBeta::along(theta_axis, carrier.sampled);
        let filtered = LPF.step_alpha_beta(&mut s.low_pass, rest);

        let lag = c.lag_share * (lpf_lag_samples(flux.step * TAU) + c.current_lag);
        let seen = phi.turned_slightly(-flux.step * lag);
        let applied = phi.turned_slightly(flux.step * VOLTAGE_LEAD);

        // Current loop.
        let current = filtered.to_dq(seen);
        let voltage =
            c.current_loop.step(&mut s.current_loop, reference - current) + r.test_voltage;

        // Injection, Eq. 3.6: the carrier along theta = phi + 90°.
        let axis = applied.turned_by(r.injection_axis);
        let total = voltage.to_alpha_beta(applied) + AlphaBeta::along(axis, carrier.voltage);

        // Dead time: the sign of the current that is going to flow decides.
        let expected =
            current.to_alpha_beta(applied) + AlphaBeta::along(axis, carrier.mean_current);
        let signs = c.dead_time.signs(expected.to_abc());
        let compensation = c.dead_time.voltage(signs, measured.dc_link, s.inverter_drop.volts);
        let modulated = c.modulator.step(total, compensation, measured.dc_link);
        s.current_loop.realised((modulated.realised - total).to_dq(applied));

        if self.state == State::Magnetising {
            c.inverter_drop.step(
                &mut s.inverter_drop,
                (self.elapsed, c.sequence.magnetise),
                (current, voltage, s.indirect.magnetising),
                signs.to_alpha_beta().to_dq(applied),
                measured.dc_link,
            );
        }

        // Angles for the next sample.
        if c.demodulate {
            let e = &mut s.estimator;
            let i_q = reference.q;
            c.estimator.observe(e, measured.current, theta_axis, flux.step, carrier, i_q);
        }
        let rotor_step = match count {
            Some(_) => {
                c.indirect.update(&mut s.indirect, current);
                s.indirect.rotor_step
            }
            None => {
                // The slip of what is asked for: that of the measured current would feed the angle
                // error back.
                c.indirect.update(&mut s.indirect, reference);
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

        self.telemetry = Telemetry {
            phi: flux.phi,
            flux_step: flux.step,
            rotor_step,
            reference,
            current,
            voltage,
            measured: measured.current,
            realised: modulated.realised,
            delta_i: s.estimator.delta_i,
            saliency: s.estimator.saliency.q,
            carrier_squared: s.estimator.saliency.carrier_squared,
            carrier_share: s.carrier.share,
            saliency_loss: s.lock.loss,
            dc_link: measured.dc_link,
            inverter_drop: s.inverter_drop.volts,
            turns: c.motion.turns(&s.motion, rotor_count),
        };

        // What was computed must make sense before it is put out. (The current is in the voltage.)
        let sum = wanted.d
            + wanted.q
            + voltage.d
            + voltage.q
            + s.estimator.delta_i
            + s.estimator.saliency.q
            + flux.step
            + rotor_step;
        if !sum.is_finite() {
            return Err(self.not_finite().unwrap_or(Fault::NonFiniteState));
        }
        if rotor_step.abs() > c.protection.rotor_step {
            return Err(Fault::OverSpeed);
        }
        if c.inject {
            let amplitude = s.carrier.share * c.injection.current_amplitude;
            if let Some(fault) = s.carrier_watch.step(measured, carrier, theta_axis, amplitude) {
                return Err(fault);
            }
            // Once a carrier period each: is it the flux that is tracked, and does the carrier fit?
            if carrier.index == MONITORED {
                // (While it learns nothing is tracked, and what is compared with is not known yet.)
                let judged = s.carrier.is_settled() && (held || self.mode != Mode::Learning);
                if let (Some(monitor), true) = (&c.lock_monitor, judged) {
                    monitor.step(&mut s.lock, &s.estimator.saliency, s.carrier.share, held)?;
                }
            } else if carrier.index == FITTED {
                let largest = c.modulator.circle(measured.dc_link);
                if s.carrier.fit(&c.injection, voltage, largest).is_err() {
                    return Err(Fault::CarrierNoRoom);
                }
            }
        }
        let rotor = c.prediction.rotor_voltage(s.indirect.magnetising, rotor_step);
        if let Some(fault) = c.prediction.step(
            &mut s.prediction,
            measured.current,
            modulated.realised,
            rotor.to_alpha_beta(seen),
        ) {
            return Err(fault);
        }

        if self.state == State::Off {
            return Ok(Compare::OFF); // stopped
        }
        let [a, b, c] = modulated.compare;
        Ok(Compare { a, b, c, enabled: true })
    }

    /// Where the rotor is, counted as by an encoder: by the encoder, or by the flux less the slip.
    #[inline]
    fn rotor_count(&mut self, sample: &Sample) -> u32 {
        let s = &mut self.control;
        match self.c.source {
            AngleSource::Encoder => sample.encoder,
            AngleSource::Injection => s.rotor.follow(s.estimator.flux().phi - s.indirect.slip),
        }
    }

    /// The current to regulate in this state, A; moves on to the next state where it is time.
    fn reference(&mut self, rotor_count: u32) -> Result<Dq, Fault> {
        let r = &mut self.references;
        let i_q = match self.state {
            State::Magnetising => return self.magnetise(),
            State::Verifying => return self.verify(),
            State::Learning => self.learn()?,
            State::Speed | State::Position => {
                let goal = match self.mode {
                    Mode::Speed => Goal::Speed(r.speed),
                    _ => Goal::Position(r.turns),
                };
                r.current.q = self.c.motion.step(&mut self.control.motion, goal, rotor_count);
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
                self.references.current.q
            }
            _ => r.current.q,
        };
        Ok(Dq { d: self.references.current.d, q: i_q })
    }

    /// The current while the flux is built up, and while the saliency is checked, A.
    fn magnetise(&mut self) -> Result<Dq, Fault> {
        let (r, s) = (&mut self.references, &mut self.control);
        let level = self.c.inverter_drop.level(self.elapsed);
        let magnetising = Dq { d: level * r.current.d, q: 0.0 };
        let phase =
            match (self.elapsed.checked_sub(self.c.sequence.magnetise), self.c.saliency_check) {
                (None, _) => return Ok(magnetising),
                (Some(_), None) => Phase::Passed,
                (Some(n), Some(check)) => {
                    check.step(&mut s.saliency_check, n, s.estimator.saliency.q)
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
        Ok(Dq { d: self.references.current.d, q: 0.0 })
    }

    /// Which of settings, references and state is to blame when a result is not finite.
    fn not_finite(&self) -> Option<Fault> {
        let r = &self.references;
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

/// Periods from the sample to the middle of the period in which its voltage acts.
const VOLTAGE_LEAD: f32 = 1.5;

/// Samples of the carrier period in which the lock is watched and the carrier fitted. What is done once
/// a carrier period is spread over it: in the first the saliency is looked at, in the last the
/// carrier is looked for in both channels.
const MONITORED: usize = 4;
const FITTED: usize = 6;

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

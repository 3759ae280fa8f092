//! Current control in the flux frame: the control law from top to bottom, and the phases in which the flux is found, built
//! up and verified.

use super::flying_start::Residual;
use super::slow_tasks::StepResults;
use super::stopping::COAST;
use super::{CarryOver, Common, End, Field, FluxPhase, Frame, Goal};
use crate::carrier::at_start::{AtStart, AtStartState};
use crate::carrier::{CarrierPeriod, CarrierSample};
use crate::current::{DIRECT_SHARE, DIRECT_SHARE_WITHOUT_CARRIER, inverter_drop::DropSample};
use crate::drive::state::State;
use crate::filter::LPF;
use crate::identify::learning::LearningState;
use crate::learned::LARGEST_ASYMMETRY;
use crate::math::limited;
use crate::motion::Target;
use crate::protect::SaliencyCheck;
use crate::protect::saliency_check::SaliencyCheckAction;
use crate::{AlphaBeta, AngleSource, Coefficients, Compare, Dq, Fault, Measured};

impl Field {
    /// Begins without current, for this goal.
    pub fn begin(&mut self, c: &Coefficients, goal: Goal, carried: &CarryOver) {
        self.frame = match (c.source, goal) {
            (_, Goal::Learn) => Frame::LockedShaft,
            (AngleSource::Encoder, _) => Frame::Encoder,
            (AngleSource::Injection, _) => Frame::Tracked,
        };
        self.goal = goal;
        // A flying start measures none of these quantities.
        self.carried = *carried;
        self.inverter_drop.volts = carried.inverter_drop;
        self.observer.resistance = carried.resistance;
        c.turn(&mut self.axes, 0.0, c.injection_axis, false);
        c.estimator.start(&mut self.estimator);
        // A self-commissioning begins without the earlier asymmetry.
        if self.frame != Frame::LockedShaft {
            self.estimator.changed = carried.asymmetry;
        }
        self.observer.start(c.observer.as_ref());
    }

    pub fn state(&self) -> State {
        match (&self.flux, &self.goal) {
            (_, Goal::Brake { .. }) => State::Braking,
            (_, Goal::Hold { .. } | Goal::Release) => State::Stopping,
            (FluxPhase::Search(_) | FluxPhase::Build { .. }, _) => State::FlyingStart,
            (FluxPhase::Asymmetry(_) | FluxPhase::Hold, _) => State::Magnetising,
            (FluxPhase::Verify | FluxPhase::Prove, _) => State::Verifying,
            (FluxPhase::Ready(_) | FluxPhase::Learn(_), goal) => State::of_mode(goal.mode()),
        }
    }

    /// Whether torque, speed or position is regulated as commanded.
    pub fn regulates(&self) -> bool {
        matches!(self.flux, FluxPhase::Ready(_)) && self.goal.regulates()
    }

    /// Whether the drive makes torque, as commanded or to come to rest.
    pub fn has_torque(&self) -> bool {
        self.regulates() || matches!(self.goal, Goal::Brake { .. } | Goal::Hold { .. })
    }

    /// Returns the quantities that this run passes on to the next run.
    pub fn carry_over(&self) -> CarryOver {
        // Until the speed is found, only the residual flux of the run before is known.
        let turning = || Residual::turning(self.estimator.rotor_freq, self.observer.flux);
        let residual = Some(self.carried.residual.unwrap_or_else(turning));
        // Until the flux is verified the shaft may rotate, and its voltage may have falsified the measurements.
        if !matches!(self.flux, FluxPhase::Ready(_) | FluxPhase::Learn(_)) {
            return CarryOver { residual, ..self.carried };
        }
        CarryOver {
            resistance: self.observer.resistance,
            inverter_drop: self.inverter_drop.volts,
            asymmetry: self.estimator.changed,
            residual,
        }
    }

    /// Runs one period. The compare values go to `put_out` before the checks and slow tasks.
    ///
    /// # Errors
    /// The reason why the outputs are switched off: a fault, or the end of a stop.
    pub fn step(
        &mut self,
        c: &Coefficients,
        k: &mut Common,
        measured: &Measured,
        put_out: &mut dyn FnMut(Compare),
    ) -> Result<[f32; 3], End> {
        if self.frame == Frame::Encoder {
            k.rotor_count = measured.encoder;
            k.seen.turns = c.motion.turns(&self.motion, k.rotor_count);
        }
        let measured_current = measured.current();
        let wanted = self.advance(c, k)?;
        let counted = self.frame.is_counted();
        let s = self;
        let index = s.carrier.advance();
        let carrier_is_off = s.hand_over.is_carrier_off();
        let direct = if carrier_is_off { DIRECT_SHARE_WITHOUT_CARRIER } else { DIRECT_SHARE };
        let reference = Dq {
            d: c.current_loop.d.filter(&mut s.reference[0], direct, wanted.d),
            q: c.current_loop.q.filter(&mut s.reference[1], direct, wanted.q),
        };
        k.seen.reference = reference;

        // Flux angle at the sample
        let flux = if counted {
            // During self-commissioning the shaft is locked, and the flux may lead the frame.
            let count = if s.frame == Frame::Encoder { measured.encoder } else { 0 };
            let flux = c.indirect.angle(&mut s.indirect, count).map_err(|_| Fault::Encoder)?;
            flux.less(s.lead)
        } else {
            s.estimator.flux()
        };
        (k.seen.phi, k.seen.flux_freq) = (flux.phi, flux.freq);
        let phi = flux.phi.unit_vector();
        let axes = s.axes;

        // The expected injection current is subtracted; the filter removes the rest. (Its notch is 6 Hz
        // wide. Alone it would pass the sidebands of a rotating injection.)
        let carrier = if carrier_is_off || !c.inject {
            CarrierPeriod::default()
        } else {
            s.carrier.at(&c.injection, index)
        };
        let carrier_axis = phi.turned_by(axes.carrier);
        if c.demodulate {
            let sample = CarrierSample { current: measured_current, axis: carrier_axis, carrier };
            c.estimator.observe(&mut s.estimator, &sample, flux.freq);
            k.seen.delta_i = s.estimator.delta_i;
        }
        let rest = measured_current - AlphaBeta::along(carrier_axis, carrier.sampled);
        let filtered = LPF.step(&mut s.low_pass, rest);
        let seen = if carrier_is_off { measured_current } else { filtered };
        let flux_axis = phi.turned_by(axes.seen);
        let current = seen.to_dq(flux_axis);

        // Angles for the next sample.
        let trust = s.trust(c, k.elapsed);
        let (flux_current, rotor_freq) = if counted {
            let flux_current = current.seen_from(s.lead_axis);
            c.indirect.slip(&mut s.indirect, flux_current.q);
            (flux_current, s.indirect.rotor_freq)
        } else {
            // The slip is computed from the reference, because the measured current would feed the angle error back.
            c.indirect.slip(&mut s.indirect, reference.q);
            let slip_freq = s.indirect.slip_freq;
            let turning = c.observe_fundamental(s, index, rest, phi);
            let (estimator, i_q) = (&mut s.estimator, reference.q);
            if trust.rotates && c.estimator.track(estimator, i_q, slip_freq, &turning).is_err() {
                return Err(s.not_finite(c, k).unwrap_or(Fault::LostAngle).into());
            }
            (reference, s.estimator.rotor_freq)
        };

        // Current loop.
        let voltage = c.current_loop.step(&mut s.current_loop, reference - current)
            + s.induced.at(reference) * s.induced_share
            + k.references.test_voltage;

        // Injection, Eq. 3.6: along theta = phi + 90°.
        let applied = phi.turned_by(axes.applied);
        let carrier_voltage = (axes.injection * carrier.voltage).to_alpha_beta(applied);
        let total = voltage.to_alpha_beta(applied) + carrier_voltage;

        // Dead-time compensation by the signs of the coming currents: with the injection current, or after a step.
        let coming = match carrier_is_off {
            true => current - k.seen.current,
            false => axes.injection * carrier.mean_current,
        };
        let expected = (current + coming).to_alpha_beta(applied);
        let half_change = (axes.injection * carrier.half_change).to_alpha_beta(applied);
        let signs = c.dead_time.signs(expected.to_abc(), half_change.to_abc());
        let compensation = c.dead_time.voltage(signs, measured.dc_link, s.inverter_drop.volts);
        let modulated = c.modulator.step(total, compensation, measured.dc_link);
        (k.seen.current, k.seen.voltage) = (current, voltage);
        (k.seen.measured, k.seen.realised) = (measured_current, modulated.realised);
        (k.seen.dc_link, k.seen.rotor_freq) = (measured.dc_link, rotor_freq);
        if modulated.limited {
            let missing = modulated.realised - total;
            c.current_loop.condition(&mut s.current_loop, missing.to_dq(applied));
        }
        s.prediction.collect(measured_current, modulated.realised);
        if !counted && c.observer.is_some() {
            s.observer.put_out(modulated.realised - carrier_voltage);
        }

        if trust.measures_drop {
            let sample = DropSample {
                current,
                voltage,
                magnetising: s.indirect.magnetising,
                signs: signs.to_abc().to_alpha_beta().to_dq(applied),
                dc_link: measured.dc_link,
            };
            s.measure_drop(c, k.elapsed, &sample);
        }

        // A state that is not finite gives no output. (The voltage contains current and reference of the
        // previous step, and the speed contains the demodulated signal.)
        if !(voltage.d + voltage.q + flux.freq + rotor_freq).is_finite() {
            return Err(s.not_finite(c, k).unwrap_or(Fault::NonFiniteState).into());
        }
        put_out(c.front_end.compare(modulated.duties));

        // Checks and slow tasks, one per sample.
        let results = StepResults {
            measured,
            current: measured_current,
            flux_current,
            reference,
            voltage,
            carrier_axis,
            flux_axis,
            flux_freq: flux.freq,
            rotor_freq,
            trust,
        };
        c.run_slot(s, k, index, &results)?;
        Ok(modulated.duties)
    }

    /// Measures the inverter voltage error, and with it the stator resistance.
    #[cold]
    fn measure_drop(&mut self, c: &Coefficients, elapsed: u32, sample: &DropSample) {
        if let Some(ratio) = c.inverter_drop.step(&mut self.inverter_drop, elapsed, sample) {
            self.observer.resistance.take(ratio - 1.0);
            self.estimator.filter.start(self.observer.resistance.deviation);
        }
    }

    /// Copies the state of the demodulation, the checks and the position to the telemetry.
    pub fn show(&self, c: &Coefficients, k: &mut Common) {
        let (saliency, seen) = (self.estimator.saliency(), &mut k.seen);
        seen.saliency = saliency.q;
        seen.carrier_squared = saliency.carrier_squared;
        seen.carrier_share = self.carrier.share;
        seen.saliency_loss = self.lock.loss;
        seen.inverter_drop = self.inverter_drop.volts;
        seen.turns = c.motion.turns(&self.motion, k.rotor_count);
    }

    /// Returns the current to regulate, A. Enters the next phase of the flux or the next goal when it is due.
    ///
    /// # Errors
    /// The reason why the outputs are switched off.
    fn advance(&mut self, c: &Coefficients, k: &mut Common) -> Result<Dq, End> {
        if !matches!(self.flux, FluxPhase::Ready(_) | FluxPhase::Learn(_)) {
            return self.find_flux(c, k);
        }
        let i_q = match self.goal {
            Goal::Torque => k.references.current.q,
            Goal::Speed { .. } | Goal::Position { .. } | Goal::Brake { .. } | Goal::Hold { .. } => {
                self.follow(c, k)
            }
            Goal::Learn => self.learn(c, k)?,
            Goal::Release => {
                let (i_q, ramp) = (&mut k.references.current.q, c.sequence.stop_ramp);
                if i_q.abs() > ramp && k.elapsed < COAST {
                    *i_q -= limited(*i_q, ramp);
                } else {
                    return Err(End::Stopped);
                }
                *i_q
            }
        };
        let (i_d, most) = (k.references.current.d, k.limits.voltage.most.d);
        let d = if i_d < most { i_d } else { most } + k.limits.now.flux_a;
        Ok(Dq { d, q: k.limits.clamp_torque(i_q) })
    }

    /// Returns the current while the flux is found, built up and verified, A.
    #[cold]
    fn find_flux(&mut self, c: &Coefficients, k: &mut Common) -> Result<Dq, End> {
        Ok(match self.flux {
            FluxPhase::Search(_) => self.search(c, k)?,
            FluxPhase::Asymmetry(_) => self.measure_asymmetry(c, k)?,
            FluxPhase::Build { from } => self.build(c, k, k.elapsed.wrapping_sub(from))?,
            FluxPhase::Hold => self.magnetise(c, k)?,
            FluxPhase::Verify => self.verify(c, k)?,
            FluxPhase::Prove => self.prove(c, k)?,
            FluxPhase::Ready(_) | FluxPhase::Learn(_) => Dq::ZERO,
        })
    }

    /// Returns the q-axis current of the speed or the position loop, A.
    fn follow(&mut self, c: &Coefficients, k: &mut Common) -> f32 {
        let mut range = k.limits.now.i_q;
        let goal = match &mut self.goal {
            Goal::Speed { speed, jog } => {
                // A jog that is not repeated ends.
                if *jog > 0 {
                    *jog -= 1;
                    if *jog == 0 {
                        *speed = 0.0;
                    }
                }
                Target::Speed(*speed)
            }
            Goal::Position { press: Some((speed, most)), .. } => {
                range = (limited(range.0, *most), limited(range.1, *most));
                Target::Speed(*speed)
            }
            Goal::Position { turns, press: None } => Target::Position(turns.unwrap_or(0.0)),
            Goal::Brake { quick } => Target::Rest { quick: *quick },
            Goal::Hold { left } => {
                *left = left.saturating_sub(1);
                Target::Rest { quick: true }
            }
            Goal::Torque | Goal::Learn | Goal::Release => return k.references.current.q,
        };
        let estimated = k.seen.rotor_freq * c.speed_per_freq;
        let i_q = c.motion.step(&mut self.motion, goal, k.rotor_count, estimated, range);
        k.references.current.q = i_q;
        match self.goal {
            Goal::Brake { .. } if c.motion.is_at_rest(&self.motion) => {
                (self.goal, k.elapsed) = (Self::at_rest(k), 0);
            }
            Goal::Hold { left: 0 } => (self.goal, k.elapsed) = (Goal::Release, 0),
            _ => {}
        }
        i_q
    }

    /// Continues in this phase of the flux.
    #[inline(always)] // writes the small phase only, not the memory that it shares
    pub fn enter(&mut self, k: &mut Common, flux: FluxPhase) {
        (self.flux, k.elapsed) = (flux, 0);
    }

    /// Continues with a shaft at rest: measures the asymmetry if that is useful, then builds up the flux.
    #[cold]
    pub fn continue_at_standstill(&mut self, c: &Coefficients, k: &mut Common, encoder: u32) {
        let learns = self.frame == Frame::LockedShaft;
        if c.at_start.is_some_and(|at_start| learns || at_start.learned.is_some()) {
            self.carrier.set(AtStart::CARRIER_SHARE);
            self.enter(k, FluxPhase::Asymmetry(AtStartState::new(learns)));
        } else {
            self.enter_hold(c, k, encoder);
        }
    }

    /// Returns the current while the residual flux decays and the asymmetry is measured, which is zero.
    ///
    /// # Errors
    /// [`Fault::NothingLearned`] if the asymmetry is larger than a self-commissioning accepts.
    #[cold]
    fn measure_asymmetry(&mut self, c: &Coefficients, k: &mut Common) -> Result<Dq, Fault> {
        let (Some(at_start), FluxPhase::Asymmetry(state)) = (&c.at_start, &mut self.flux) else {
            return Ok(Dq::ZERO);
        };
        if let Some(axis) = at_start.step(state, k.elapsed, self.estimator.saliency().q) {
            k.references.injection_axis = axis;
            return Ok(Dq::ZERO);
        }
        k.references.injection_axis = c.injection_axis;
        self.carrier.set(1.0);
        self.at_start = Some(state.found());
        if let (Frame::Tracked, Some(change)) = (self.frame, at_start.change(state)) {
            let known = &mut self.estimator.changed;
            *known = known.plus(&change, 1.0);
            if known.size() > LARGEST_ASYMMETRY {
                return Err(Fault::NothingLearned);
            }
        }
        self.observer.start(c.observer.as_ref());
        self.enter_hold(c, k, 0);
        Ok(Dq::ZERO)
    }

    /// Fixes the frame along phase a and builds up the flux there.
    #[cold]
    pub fn enter_hold(&mut self, c: &Coefficients, k: &mut Common, encoder: u32) {
        (self.lock, self.inverter_drop) = Default::default();
        k.rotor_count = match c.source {
            AngleSource::Encoder => encoder,
            AngleSource::Injection => self.count_by_flux(),
        };
        c.motion.start(&mut self.motion, k.rotor_count);
        if let Some(home) = k.home {
            self.motion.origin = home;
            let here = c.motion.turns(&self.motion, k.rotor_count);
            if let Goal::Position { turns, .. } = &mut self.goal {
                turns.get_or_insert(here);
            }
        }
        self.enter(k, FluxPhase::Hold);
    }

    /// Returns the current while the flux is built up and the saliency is checked, A.
    #[cold]
    fn magnetise(&mut self, c: &Coefficients, k: &mut Common) -> Result<Dq, Fault> {
        let level = c.inverter_drop.level(k.elapsed);
        let magnetising = Dq { d: level * k.references.current.d, q: 0.0 };
        let learns = self.frame == Frame::LockedShaft;
        let phase = match (k.elapsed.checked_sub(c.sequence.magnetise), c.saliency_check) {
            (None, _) => return Ok(magnetising),
            (Some(_), None) => SaliencyCheckAction::Passed,
            (Some(n), Some(check)) => {
                check.step(&mut self.saliency_check, n, self.estimator.saliency().q)
            }
        };
        match phase {
            SaliencyCheckAction::Look => {
                k.references.injection_axis = SaliencyCheck::LOOK_AXIS;
                return Ok(Dq::ZERO);
            }
            SaliencyCheckAction::Restore => k.references.injection_axis = c.injection_axis,
            SaliencyCheckAction::Passed => {
                self.flux = if learns {
                    FluxPhase::Learn(LearningState::default())
                } else if c.lock_monitor.is_some() {
                    FluxPhase::Verify
                } else {
                    Self::behind_the_flux(k)
                };
                k.elapsed = 0;
            }
            // A self-commissioning judges the saliency sensitivity instead.
            SaliencyCheckAction::Failed if learns => {
                k.references.injection_axis = c.injection_axis;
            }
            SaliencyCheckAction::Failed => return Err(Fault::NoSaliency),
        }
        Ok(magnetising)
    }

    /// Returns the current while the lock is verified, A. The axis is tracked for a while without torque.
    #[cold]
    fn verify(&mut self, c: &Coefficients, k: &mut Common) -> Result<Dq, Fault> {
        if k.elapsed >= c.sequence.verify {
            if k.seen.rotor_freq.abs() > c.sequence.pushed_freq {
                return Err(Fault::LostLock);
            }
            let phase = Self::behind_the_flux(k);
            self.enter(k, phase);
        }
        Ok(Dq { d: k.references.current.d, q: 0.0 })
    }

    /// Returns the angle of the rotor, flux less slip, counted as by an encoder.
    #[inline(never)] // inlined at both calls, 8 bytes more of control code
    pub fn count_by_flux(&mut self) -> u32 {
        self.rotor.follow(self.estimator.flux().phi - self.indirect.slip)
    }

    /// Returns the fault of a result that is not finite: settings, references or state, whichever is not finite.
    #[cold]
    fn not_finite(&self, c: &Coefficients, k: &Common) -> Option<Fault> {
        let state = (!self.estimator.is_finite()).then_some(Fault::NonFiniteState);
        k.not_finite(c, self.goal.is_finite()).or(state)
    }
}

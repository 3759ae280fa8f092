//! Current control in the flux frame: the control law from top to bottom, and the phases in which the flux is found, built
//! up and verified.

use super::flying_start::Residual;
use super::slow_tasks::StepResults;
use super::stopping::COAST;
use super::{CarryOver, Common, End, Field, FluxPhase, Frame, Goal};
use crate::carrier::at_start::{AtStart, AtStartState};
use crate::carrier::{Asymmetry, CarrierPeriod, CarrierSample};
use crate::current::{DIRECT_SHARE, DIRECT_SHARE_WITHOUT_CARRIER, inverter_drop::DropSample};
use crate::drive::state::State;
use crate::filter::LPF;
use crate::identify::learning::LearningState;
use crate::math::limited;
use crate::motion::Target;
use crate::protect::SaliencyCheck;
use crate::protect::saliency_check::SaliencyCheckAction;
use crate::{AlphaBeta, AngleLoop, AngleSource, Coefficients, Compare, Dq, Fault, Measured};

impl<S> Field<S> {
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
        let freq = self.estimator.axis.rotor_freq;
        let turning = || Residual::turning(freq, self.observer.flux);
        let residual = Some(self.carried.residual.unwrap_or_else(turning));
        // Until the flux is verified the shaft may rotate, and its voltage may have falsified the measurements.
        if !self.flux.is_known() {
            let searches = matches!(self.flux, FluxPhase::Search(_));
            let rotor_freq = if searches { self.carried.rotor_freq } else { Some(freq) };
            return CarryOver { residual, rotor_freq, ..self.carried };
        }
        CarryOver {
            resistance: self.observer.resistance,
            inverter_drop: self.inverter_drop.volts,
            asymmetry: self.estimator.changed,
            residual,
            rotor_freq: Some(freq),
        }
    }

    /// Continues in this phase of the flux.
    #[inline(always)] // writes the small phase only, not the memory that it shares
    pub fn enter(&mut self, k: &mut Common, flux: FluxPhase) {
        (self.flux, k.elapsed) = (flux, 0);
    }

    /// Returns the angle of the rotor, flux less slip, counted as by an encoder.
    #[inline(never)] // inlined at both calls, 8 bytes more of control code
    pub fn count_by_flux(&mut self) -> u32 {
        self.rotor.follow(self.estimator.flux().phi - self.indirect.slip)
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Begins without current, for this goal.
    #[cold]
    pub(super) fn begin_field(&self, s: &mut Field<L::State>, goal: Goal, carried: &CarryOver) {
        s.frame = match (self.source, goal) {
            (_, Goal::Learn) => Frame::LockedShaft,
            (AngleSource::Encoder, _) => Frame::Encoder,
            (AngleSource::Injection, _) => Frame::Tracked,
        };
        s.goal = goal;
        // A flying start measures none of these quantities.
        s.carried = *carried;
        s.inverter_drop.volts = carried.inverter_drop;
        s.observer.resistance = carried.resistance;
        self.turn(&mut s.axes, 0.0, self.injection_axis, false);
        self.estimator.start(&mut s.estimator);
        // A self-commissioning begins without the earlier asymmetry.
        if s.frame != Frame::LockedShaft {
            s.estimator.changed = carried.asymmetry;
        }
        s.observer.start(self.observer.as_ref());
    }

    /// Runs one period. The compare values go to `put_out` before the checks and slow tasks.
    ///
    /// # Errors
    /// The reason why the outputs are switched off: a fault, or the end of a stop.
    pub(super) fn step_field(
        &self,
        s: &mut Field<L::State>,
        k: &mut Common,
        measured: &Measured,
        put_out: &mut dyn FnMut(Compare),
    ) -> Result<[f32; 3], End> {
        if s.frame == Frame::Encoder {
            k.rotor_count = measured.encoder;
            k.seen.turns = self.motion.turns(&s.motion, k.rotor_count);
        }
        let measured_current = measured.current();
        let wanted = self.advance(s, k)?;
        let counted = s.frame.is_counted();
        let index = s.carrier.advance();
        let carrier_is_off = s.hand_over.is_carrier_off();
        let direct = if carrier_is_off { DIRECT_SHARE_WITHOUT_CARRIER } else { DIRECT_SHARE };
        let reference = Dq {
            d: self.current_loop.d.filter(&mut s.reference[0], direct, wanted.d),
            q: self.current_loop.q.filter(&mut s.reference[1], direct, wanted.q),
        };
        k.seen.reference = reference;

        // Flux angle at the sample
        let flux = if counted {
            // During self-commissioning the shaft is locked, and the flux may lead the frame.
            let count = if s.frame == Frame::Encoder { measured.encoder } else { 0 };
            let flux = self.indirect.angle(&mut s.indirect, count).map_err(|_| Fault::Encoder)?;
            flux.less(s.lead)
        } else {
            s.estimator.flux()
        };
        (k.seen.phi, k.seen.flux_freq) = (flux.phi, flux.freq);
        let phi = flux.phi.unit_vector();
        let axes = s.axes;

        // The expected injection current is subtracted; the filter removes the rest. (Its notch is 6 Hz
        // wide. Alone it would pass the sidebands of a rotating injection.)
        let carrier = if carrier_is_off || !self.inject {
            CarrierPeriod::default()
        } else {
            s.carrier.at(&self.injection, index)
        };
        let carrier_axis = phi.turned_by(axes.carrier);
        if self.demodulate {
            let sample = CarrierSample { current: measured_current, axis: carrier_axis, carrier };
            self.estimator.observe(&mut s.estimator, &sample, flux.freq);
            k.seen.delta_i = self.estimator.delta_i(&s.estimator);
        }
        let rest = measured_current - AlphaBeta::along(carrier_axis, carrier.sampled);
        let filtered = LPF.step(&mut s.low_pass, rest);
        let seen = if carrier_is_off { measured_current } else { filtered };
        let flux_axis = phi.turned_by(axes.seen);
        let current = seen.to_dq(flux_axis);

        // Angles for the next sample.
        let trust = self.trust(s, k.elapsed);
        let (flux_current, rotor_freq) = if counted {
            let flux_current = current.seen_from(s.lead_axis);
            self.indirect.slip(&mut s.indirect, flux_current.q);
            (flux_current, s.indirect.rotor_freq)
        } else {
            // The slip is computed from the reference, because the measured current would feed the angle error back.
            self.indirect.slip(&mut s.indirect, reference.q);
            let slip_freq = s.indirect.slip_freq;
            let turning = self.observe_fundamental(s, index, rest, phi);
            let (estimator, i_q) = (&mut s.estimator, reference.q);
            if trust.rotates && !self.estimator.track(estimator, i_q, slip_freq, &turning) {
                return Err(self.not_finite_in_field(s, k).unwrap_or(Fault::LostAngle).into());
            }
            (reference, s.estimator.axis.rotor_freq)
        };

        // Current loop.
        let voltage = self.current_loop.step(&mut s.current_loop, reference - current)
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
        let signs = self.dead_time.signs(expected.to_abc(), half_change.to_abc());
        let compensation = self.dead_time.voltage(signs, measured.dc_link, s.inverter_drop.volts);
        let modulated = self.modulator.step(total, compensation, measured.dc_link);
        (k.seen.current, k.seen.voltage) = (current, voltage);
        (k.seen.measured, k.seen.realised) = (measured_current, modulated.realised);
        (k.seen.dc_link, k.seen.rotor_freq) = (measured.dc_link, rotor_freq);
        if modulated.limited {
            let missing = modulated.realised - total;
            self.current_loop.condition(&mut s.current_loop, missing.to_dq(applied));
        }
        s.prediction.collect(measured_current, modulated.realised);
        if !counted && self.observer.is_some() {
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
            self.measure_drop(s, k.elapsed, &sample);
        }

        // A state that is not finite gives no output. (The voltage contains current and reference of the
        // previous step, and the speed contains the demodulated signal.)
        if !(voltage.d + voltage.q + flux.freq + rotor_freq).is_finite() {
            return Err(self.not_finite_in_field(s, k).unwrap_or(Fault::NonFiniteState).into());
        }
        put_out(self.front_end.compare(modulated.duties));

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
        self.run_slot(s, k, index, &results)?;
        Ok(modulated.duties)
    }

    /// Measures the inverter voltage error, and with it the stator resistance.
    #[cold]
    fn measure_drop(&self, s: &mut Field<L::State>, elapsed: u32, sample: &DropSample) {
        if let Some(ratio) = self.inverter_drop.step(&mut s.inverter_drop, elapsed, sample) {
            s.observer.resistance.take(ratio - 1.0);
            self.reset_filter(s);
        }
    }

    /// Copies the state of the demodulation, the checks and the position to the telemetry.
    pub(super) fn show(&self, s: &Field<L::State>, k: &mut Common) {
        let (saliency, seen) = (s.estimator.saliency(), &mut k.seen);
        seen.saliency = saliency.q;
        seen.carrier_squared = saliency.carrier_squared;
        seen.carrier_share = s.carrier.share;
        seen.saliency_loss = s.lock.loss;
        seen.inverter_drop = s.inverter_drop.volts;
        seen.turns = self.motion.turns(&s.motion, k.rotor_count);
    }

    /// Returns the current to regulate, A. Enters the next phase of the flux or the next goal when it is due.
    ///
    /// # Errors
    /// The reason why the outputs are switched off.
    fn advance(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<Dq, End> {
        if !s.flux.is_known() {
            return self.find_flux(s, k);
        }
        let i_q = match s.goal {
            Goal::Torque => k.references.current.q,
            Goal::Speed { .. } | Goal::Position { .. } | Goal::Brake { .. } | Goal::Hold { .. } => {
                self.follow(s, k)
            }
            Goal::Learn => self.learn(s, k)?,
            Goal::Release => {
                let (i_q, ramp) = (&mut k.references.current.q, self.sequence.stop_ramp);
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
    fn find_flux(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<Dq, End> {
        Ok(match s.flux {
            FluxPhase::Search(_) => self.search_shaft(s, k)?,
            FluxPhase::Asymmetry(_) => self.measure_asymmetry(s, k)?,
            FluxPhase::Build { from, .. } => self.build_flux(s, k, k.elapsed.wrapping_sub(from))?,
            FluxPhase::Hold => self.magnetise(s, k)?,
            FluxPhase::Verify => self.verify(s, k)?,
            FluxPhase::Prove => self.prove(s, k)?,
            FluxPhase::Ready(_) | FluxPhase::Learn(_) => Dq::ZERO,
        })
    }

    /// Returns the q-axis current of the speed or the position loop, A.
    fn follow(&self, s: &mut Field<L::State>, k: &mut Common) -> f32 {
        let mut range = k.limits.now.i_q;
        let goal = match &mut s.goal {
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
            Goal::Position { turns, press: None, .. } => Target::Position(turns.unwrap_or(0.0)),
            Goal::Brake { quick } => Target::Rest { quick: *quick },
            Goal::Hold { left } => {
                *left = left.saturating_sub(1);
                Target::Rest { quick: true }
            }
            Goal::Torque | Goal::Learn | Goal::Release => return k.references.current.q,
        };
        let estimated = k.seen.rotor_freq * self.speed_per_freq;
        let i_q = self.motion.step(&mut s.motion, goal, k.rotor_count, estimated, range);
        k.references.current.q = i_q;
        match s.goal {
            Goal::Brake { .. } if self.motion.is_at_rest(&s.motion) => {
                (s.goal, k.elapsed) = (k.at_rest(), 0);
            }
            Goal::Hold { left: 0 } => (s.goal, k.elapsed) = (Goal::Release, 0),
            _ => {}
        }
        i_q
    }

    /// Continues with a shaft at rest: measures the asymmetry if that is useful, then builds up the flux.
    #[cold]
    pub(super) fn continue_at_standstill(
        &self,
        s: &mut Field<L::State>,
        k: &mut Common,
        encoder: u32,
    ) {
        let learns = s.frame == Frame::LockedShaft;
        if self.at_start.is_some_and(|at_start| learns || at_start.learned.is_some()) {
            s.carrier.set(AtStart::CARRIER_SHARE);
            s.enter(k, FluxPhase::Asymmetry(AtStartState::new(learns)));
        } else {
            self.enter_hold(s, k, encoder);
        }
    }

    /// Returns the current while the residual flux decays and the asymmetry is measured, which is zero.
    ///
    /// # Errors
    /// [`Fault::NothingLearned`] if the asymmetry is larger than a self-commissioning accepts.
    #[cold]
    fn measure_asymmetry(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<Dq, Fault> {
        let (Some(at_start), FluxPhase::Asymmetry(state)) = (&self.at_start, &mut s.flux) else {
            return Ok(Dq::ZERO);
        };
        if let Some(axis) = at_start.step(state, k.elapsed, s.estimator.saliency().q) {
            k.references.injection_axis = axis;
            return Ok(Dq::ZERO);
        }
        k.references.injection_axis = self.injection_axis;
        s.carrier.set(1.0);
        s.at_start = Some(state.found());
        if let (Frame::Tracked, Some(change)) = (s.frame, at_start.change(state)) {
            let known = &mut s.estimator.changed;
            *known = known.plus(&change, 1.0);
            if known.size() > Asymmetry::LARGEST {
                return Err(Fault::NothingLearned);
            }
        }
        s.observer.start(self.observer.as_ref());
        self.enter_hold(s, k, 0);
        Ok(Dq::ZERO)
    }

    /// Fixes the frame along phase a and builds up the flux there.
    #[cold]
    pub(super) fn enter_hold(&self, s: &mut Field<L::State>, k: &mut Common, encoder: u32) {
        (s.lock, s.inverter_drop) = Default::default();
        k.rotor_count = match self.source {
            AngleSource::Encoder => encoder,
            AngleSource::Injection => s.count_by_flux(),
        };
        self.motion.start(&mut s.motion, k.rotor_count);
        if let Some(home) = k.home {
            s.motion.origin = home;
            let here = self.motion.turns(&s.motion, k.rotor_count);
            if let Goal::Position { turns, .. } = &mut s.goal {
                turns.get_or_insert(here);
            }
        }
        s.enter(k, FluxPhase::Hold);
    }

    /// Returns the current while the flux is built up and the saliency is checked, A.
    #[cold]
    fn magnetise(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<Dq, Fault> {
        let level = self.inverter_drop.level(k.elapsed);
        let magnetising = Dq { d: level * k.references.current.d, q: 0.0 };
        let learns = s.frame == Frame::LockedShaft;
        let phase = match (k.elapsed.checked_sub(self.sequence.magnetise), self.saliency_check) {
            (None, _) => return Ok(magnetising),
            (Some(_), None) => SaliencyCheckAction::Passed,
            (Some(n), Some(check)) => {
                check.step(&mut s.saliency_check, n, s.estimator.saliency().q)
            }
        };
        match phase {
            SaliencyCheckAction::Look => {
                k.references.injection_axis = SaliencyCheck::LOOK_AXIS;
                return Ok(Dq::ZERO);
            }
            SaliencyCheckAction::Restore => k.references.injection_axis = self.injection_axis,
            SaliencyCheckAction::Passed => {
                s.flux = if learns {
                    FluxPhase::Learn(LearningState::default())
                } else if self.lock_monitor.is_some() {
                    FluxPhase::Verify
                } else {
                    k.behind_the_flux()
                };
                k.elapsed = 0;
            }
            // A self-commissioning judges the saliency sensitivity instead.
            SaliencyCheckAction::Failed if learns => {
                k.references.injection_axis = self.injection_axis;
            }
            SaliencyCheckAction::Failed => return Err(Fault::NoSaliency),
        }
        Ok(magnetising)
    }

    /// Returns the current while the lock is verified, A. The axis is tracked for a while without torque.
    #[cold]
    fn verify(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<Dq, Fault> {
        if k.elapsed >= self.sequence.verify {
            if k.seen.rotor_freq.abs() > self.sequence.pushed_freq {
                return Err(Fault::LostLock);
            }
            let phase = k.behind_the_flux();
            s.enter(k, phase);
        }
        Ok(Dq { d: k.references.current.d, q: 0.0 })
    }

    /// Returns the fault of a result that is not finite: settings, references or state, whichever is not finite.
    #[cold]
    fn not_finite_in_field(&self, s: &Field<L::State>, k: &Common) -> Option<Fault> {
        let state = (!self.estimator.is_finite(&s.estimator)).then_some(Fault::NonFiniteState);
        self.not_finite(k, s.goal.is_finite()).or(state)
    }
}

//! The motor at the chip: it is advanced with time, gets the voltages of the bridge, and is sampled.

use anyhow::{Result, bail};
use drive_core::{Compare, Sample};
use hil_sim::plant::Plant;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{Board, Chip, Options, TICKS_PER_PERIOD};
use crate::power_stage::bridge::{Bridge, Leg};
use crate::power_stage::shunts::{Amplifiers, Currents, Shunts};
use crate::power_stage::{CODES, COMPARED};
use stm32g4_unicorn::chip::TICKS_PER_S;

/// A change of the samples.
pub type Disturbance = Box<dyn FnMut(&mut Sample)>;

/// The connection between the chip and the motor.
#[derive(Clone, Debug)]
pub(super) struct Connection {
    /// Time up to which the motor has been advanced, ticks.
    at: u64,
    /// Compare values in force at the motor.
    applied: Compare,
    /// Dead time in force at the motor, ticks, and whether the motor is advanced by half periods; none before the outputs were on.
    dead_time: Option<(u32, bool)>,
    /// Further dead time, us.
    extra_us: f64,
    /// Chopper duty and relay state in force at the motor.
    dc_link: (f64, bool),
    /// Voltage rating of the switches, V.
    rated_v: f64,
    /// The last sample.
    pub sample: Sample,
    shunts: Option<ShuntReader>,
}

/// The shunts with their amplifiers, and the data for reading them at any time of a period.
#[derive(Clone, Debug)]
struct ShuntReader {
    shunts: Shunts,
    /// Delay of the gates by the drivers, ticks.
    delay: i64,
    rng: Xoshiro256PlusPlus,
    amplifiers: Amplifiers,
    /// The present gates.
    bridge: Bridge,
    /// Time of the last top of the counter, ticks, and of the one before.
    top: Top,
    before: Top,
}

/// The state at a top of the counter, from which a later reading follows.
#[derive(Clone, Debug, Default)]
struct Top {
    time: u64,
    amplifiers: Amplifiers,
    bridge: Bridge,
    currents: Currents,
}

impl Connection {
    pub(super) fn new(options: &Options) -> Self {
        let (stage, seed) = (options.power_stage, options.seed);
        let shunts = stage.shunts.map(|shunts| {
            let delay_s = stage.delay_and_drop.map_or(0.0, |(delay, _)| delay);
            let delay = (delay_s * TICKS_PER_S as f64) as i64;
            let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let (amplifiers, bridge, top, before) = Default::default();
            ShuntReader { shunts, delay, rng, amplifiers, bridge, top, before }
        });
        Self {
            at: 0,
            applied: Compare::OFF,
            dead_time: None,
            extra_us: options.plant.inverter.extra_dead_time_us,
            dc_link: (0.0, false),
            rated_v: stage.rated_v(&options.plant),
            sample: Sample::default(),
            shunts,
        }
    }
}

impl ShuntReader {
    /// Follows the shunts for some ticks, in which the currents change linearly from `begin` to `end`.
    fn follow(&mut self, at: u64, ticks: u64, begin: [f64; 3], end: [f64; 3]) {
        let seconds = ticks as f64 / TICKS_PER_S as f64;
        let slope = [0, 1, 2].map(|n| (end[n] - begin[n]) / seconds);
        let currents = Currents { at: begin, slope };
        let phase = at as i64 - self.top.time as i64 - self.delay;
        self.amplifiers.follow(&self.shunts, &self.bridge, &currents, phase, ticks as u32);
    }

    /// Processes a top of the counter, at which the gates may change.
    fn top(&mut self, time: u64, bridge: &Bridge, plant: &Plant) {
        self.bridge = bridge.clone();
        // With all low sides on, or none, the terminals have the same potential.
        let slope = if bridge.compare().enabled { plant.shorted_slopes() } else { [0.0; 3] };
        let currents = Currents { at: plant.phase_currents(), slope };
        let top = Top { time, amplifiers: self.amplifiers, bridge: bridge.clone(), currents };
        self.before = std::mem::replace(&mut self.top, top);
    }

    /// Returns the counts of a leg's current that an ADC samples at a time, ticks.
    fn code(&mut self, leg: usize, time: u64) -> u16 {
        let from = if time >= self.top.time { &self.top } else { &self.before };
        let mut amplifiers = from.amplifiers;
        let after = time.saturating_sub(from.time) as u32;
        let mut currents = from.currents;
        let first = |leg: &Leg| leg.pieces.first().map_or(0, |piece| piece.ticks);
        if from.bridge.legs.iter().any(|leg| first(leg) < after) {
            // After the zero vector the other vectors bring the currents back, so the mean of the period applies.
            currents.slope = [0.0; 3];
        }
        amplifiers.follow(&self.shunts, &from.bridge, &currents, -self.delay, after);
        amplifiers.code(&self.shunts, leg, &mut self.rng)
    }

    /// Returns the counts of the three currents for each ADC, at the instants at which it samples them, for a chip
    /// whose counter is at its top.
    fn codes(&mut self, chip: &Chip) -> [[u16; 3]; 2] {
        let now = self.top.time;
        let samplings = chip.adc.samplings(chip.tim1.trigger_after_top().map(|after| now + after));
        let asked = |converter: usize, leg: usize| {
            let channel = chip.circuit.stage.wiring.currents[leg] as u32;
            samplings[converter].iter().find(|one| one.0 == channel).map(|one| one.1)
        };
        let instants = [0, 1].map(|converter| [0, 1, 2].map(|leg| asked(converter, leg)));
        // Currents that no ADC samples are read at the top.
        instants.map(|legs| [0, 1, 2].map(|leg| self.code(leg, legs[leg].unwrap_or(now))))
    }
}

impl Board {
    /// Returns the present gates.
    pub fn gates(&mut self) -> &Bridge {
        let chip = self.cpu.chip_mut();
        chip.follow_pins();
        &chip.circuit.bridge
    }

    /// Makes the outputs take effect at the motor from now on.
    pub(super) fn follow_outputs(&mut self) {
        let chip = self.cpu.chip_mut();
        // A break switches them off without a write.
        if chip.circuit.bridge.outputs_on != chip.tim1.outputs_on() {
            chip.follow_pins();
        }
        let (now, compare) = (chip.now, chip.circuit.bridge.compare());
        let seen = (self.chopper_duty(), self.is_precharged());
        if seen != self.connection.dc_link {
            self.advance_plant(now);
            self.connection.dc_link = seen;
            self.plant.set_chopper(seen.0);
            self.plant.set_relay(seen.1);
        }
        if compare.enabled != self.connection.applied.enabled {
            self.advance_plant(now);
            self.connection.applied = compare;
            if let Some(reader) = &mut self.connection.shunts {
                reader.bridge = self.cpu.chip().circuit.bridge.clone();
            }
            if !compare.enabled {
                self.went_off = Some(now);
            }
        }
    }

    pub(super) fn advance_plant(&mut self, to: u64) {
        let connection = &mut self.connection;
        let compare = if connection.applied.enabled { connection.applied } else { Compare::OFF };
        while connection.at < to {
            // The plant divides the given time into steps, so it may be a period at most.
            let ticks = (to - connection.at).min(TICKS_PER_PERIOD);
            let begin = self.plant.phase_currents();
            self.plant.advance(&compare, ticks as f64 / self.cpu.chip().ticks_per_s());
            if let Some(reader) = &mut connection.shunts {
                reader.follow(connection.at, ticks, begin, self.plant.phase_currents());
            }
            connection.at += ticks;
        }
    }

    /// Processes a top of the counter: a period of the motor ends, the ADCs hold their samples, and the compare values
    /// that the timer has taken over take effect.
    pub(super) fn crest(&mut self, at: u64) -> Result<()> {
        self.advance_plant(at);
        let chip = self.cpu.chip_mut();
        let (bridge, stage) = (&chip.circuit.bridge, chip.circuit.stage);
        let (outputs_on, dead_time) = (bridge.outputs_on, bridge.dead_time);
        let (pulses, halves) = (bridge.check_pulses(stage), chip.adc.samples_twice());
        self.connection.applied = bridge.compare();
        if let Some(reader) = &mut self.connection.shunts {
            reader.top(at, bridge, &self.plant);
        }
        if outputs_on && self.connection.dead_time != Some((dead_time, halves)) {
            self.connection.dead_time = Some((dead_time, halves));
            // Computed as in the firmware from the register, so that both values are exactly equal.
            let us = f64::from(dead_time as f32 / TICKS_PER_S as f32) * 1e6;
            // The plant spreads the whole dead time over the given time; half of the edges are in half a period.
            let half = 0.5 * (us - self.connection.extra_us);
            self.plant.set_dead_time(if halves { half } else { us })?;
        }
        self.connection.sample = self.plant.sample();
        self.show_sample();
        // The currents of the period that ends, during whose vectors they were switched off.
        let currents = if outputs_on { self.plant.phase_currents() } else { [0.0; 3] };
        let stress_v = stage.switches.stress_v(self.plant.dc_link(), currents);
        let rated_v = self.connection.rated_v;
        if stress_v > rated_v && !self.cpu.chip().forgiving {
            bail!("the switches see {stress_v:.1} V and are rated for {rated_v} V");
        }
        match pulses {
            Err(_) if outputs_on && self.cpu.chip().forgiving => self.short_pulses += 1,
            Err(bad) if outputs_on => bail!("bad gate signals: {bad}"),
            _ => {}
        }
        Ok(())
    }

    /// Processes a counter value of 0, at which the ADCs sample the currents as well.
    pub(super) fn valley(&mut self, at: u64) {
        self.advance_plant(at);
        self.connection.sample = self.plant.sample();
        self.show_sample();
    }

    /// Passes the sample to ADCs, comparators and encoder.
    pub(super) fn show_sample(&mut self) {
        let Connection { sample, shunts, .. } = &mut self.connection;
        let chip = self.cpu.chip_mut();
        let seen = shunts.as_mut().map(|reader| reader.codes(chip));
        if let Some([one, two]) = seen {
            // The first ADC measures current a, the second current b.
            (sample.current_a, sample.current_b, sample.current_c) = (one[0], two[1], one[2]);
        }
        let undisturbed = *sample;
        if let Some(disturb) = &mut self.disturb {
            disturb(sample);
        }
        if chip.reference_error() != 0.0 {
            // Half of the reference is the zero of the currents, and the reference supplies the divider of the thermistor.
            let Sample { current_a, current_b, current_c, dc_link, .. } = &mut *sample;
            let zero = CODES / 2.0;
            for (code, zero) in
                [(current_a, zero), (current_b, zero), (current_c, zero), (dc_link, 0.0)]
            {
                let seen = zero + (f64::from(*code) - zero) / (1.0 + chip.reference_error());
                *code = seen.min(CODES - 1.0) as u16;
            }
        }
        let of = |s: &Sample| [s.current_a, s.current_b, s.current_c];
        let (now, before) = (of(sample), of(&undisturbed));
        let wiring = chip.circuit.stage.wiring;
        for (converter, inputs) in chip.adc.inputs.iter_mut().enumerate() {
            for (leg, channel) in wiring.currents.into_iter().enumerate() {
                // A disturbed sensor is disturbed for both ADCs.
                let own = seen.filter(|_| now[leg] == before[leg]);
                inputs[channel] = own.map_or(now[leg], |codes| codes[converter][leg]);
            }
            inputs[wiring.heat_sink] = sample.heat_sink;
        }
        chip.tim2.position = sample.encoder;
        let [a, b, _] = wiring.currents;
        let signals = [(a, now[0]), (b, now[1]), (wiring.dc_link, sample.dc_link)];
        let [pa0, pc1, pa1] = COMPARED.map(|channel| {
            signals.iter().find(|(at, _)| *at == channel).map_or(0, |(_, counts)| *counts)
        });
        chip.compare(pa0, pc1, pa1);
    }
}

//! The temperature sensor of the motor. Its resistance, from ground to the input, follows from the divider with `motor.sensor_ohm`:
//!
//! ```text
//! pt1000   R = 1000 ohm (1 + 3.9083e-3 T - 5.775e-7 T^2)                  IEC 60751, without its cubic term: 0.01 K at -40 degC
//! kty84    R = 1000 ohm (1 + 6.12e-3 (T-100) + 1.1e-5 (T-100)^2)          KTY84-130, data sheet of NXP: -40 to 200 degC within 0.1 %
//! ntc-10k  R = 10 kohm exp(3435 K (1/T - 1/T_25))                         B parameter, as that of the heat sink
//! ```
//!
//! A sensor whose resistance is outside the range from -40 to 200 degC is open or shorted.

use super::ntc::{COLDEST_C, HOTTEST_C};
use super::{MotorSensor, Ntc, SensorKind};
use drive_core::{CONVERTER_CODES, Fault};

impl MotorSensor {
    /// Returns the temperatures at which the torque begins to fall and at which it is zero, °C, if there is a sensor.
    pub(super) fn limits(&self) -> Option<[u8; 2]> {
        let from = self.sensor_trip_c.saturating_sub(self.sensor_band_k);
        (self.sensor != SensorKind::None).then_some([from, self.sensor_trip_c])
    }

    /// Returns the temperature at the reading `code` of the 12-bit ADC, °C; `None` without a sensor. If the ADC gives no reading,
    /// the sensor cannot be trusted.
    ///
    /// # Errors
    /// [`Fault::MotorSensorOpen`], [`Fault::MotorSensorShorted`] or [`Fault::MotorSensorUnread`].
    pub fn celsius(&self, code: Option<u16>) -> Option<Result<f32, Fault>> {
        let reading = || code.map_or(Err(Fault::MotorSensorUnread), |code| self.at(code));
        (self.sensor != SensorKind::None).then(reading)
    }

    fn at(&self, code: u16) -> Result<f32, Fault> {
        let (open, shorted) = (Err(Fault::MotorSensorOpen), Err(Fault::MotorSensorShorted));
        let (zero_c, slope, bend) = match self.sensor {
            SensorKind::None | SensorKind::Pt1000 => (0.0, 3.9083e-3, -5.775e-7),
            SensorKind::Kty84 => (100.0, 6.12e-3, 1.1e-5),
            SensorKind::Ntc10k => {
                let divider_ohm = self.sensor_ohm;
                let ntc = Ntc { ohm_25: 10_000.0, beta_k: 3435.0, divider_ohm, to_ground: true };
                let celsius = ntc.celsius(code);
                let hot = if celsius > HOTTEST_C { shorted } else { Ok(celsius) };
                return if celsius < COLDEST_C { open } else { hot };
            }
        };
        let (code, all) = (f32::from(code), f32::from(CONVERTER_CODES));
        let more = self.sensor_ohm * code / (all - code) / 1000.0 - 1.0;
        let more_at = |celsius: f32| (celsius - zero_c) * (slope + bend * (celsius - zero_c));
        if more < more_at(COLDEST_C) {
            shorted
        } else if more <= more_at(HOTTEST_C) {
            Ok(zero_c + (libm::sqrtf(slope * slope + 4.0 * bend * more) - slope) / (2.0 * bend))
        } else {
            open
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor, its resistances over temperature, °C and ohm, and the tolerance, K.
    type Table = (SensorKind, &'static [(f32, f32)], f32);
    /// Tables from IEC 60751 for 1000 ohm, the data sheet of KTY84-130, and the formula of the B parameter.
    const TABLES: [Table; 3] = [
        (
            SensorKind::Pt1000,
            &[
                (-40.0, 842.7),
                (0.0, 1000.0),
                (25.0, 1097.3),
                (100.0, 1385.1),
                (150.0, 1573.3),
                (199.0, 1754.8),
            ],
            0.5,
        ),
        (
            SensorKind::Kty84,
            &[
                (-39.0, 363.0),
                (0.0, 498.0),
                (25.0, 603.0),
                (100.0, 1000.0),
                (150.0, 1334.0),
                (199.0, 1714.0),
            ],
            0.7,
        ),
        (
            SensorKind::Ntc10k,
            &[
                (-39.0, 233_200.0),
                (0.0, 28_700.0),
                (25.0, 10_000.0),
                (100.0, 987.0),
                (150.0, 332.6),
            ],
            1.5,
        ),
    ];

    #[test]
    fn the_tables_come_back_over_all_codes() {
        for (sensor, table, tolerance) in TABLES {
            for sensor_ohm in [1000.0, 4700.0] {
                let motor = MotorSensor { sensor, sensor_ohm, ..MotorSensor::DEFAULT };
                for &(celsius, ohm) in table {
                    let code =
                        libm::roundf(f32::from(CONVERTER_CODES) * ohm / (ohm + sensor_ohm)) as u16;
                    let found = motor.celsius(Some(code)).unwrap().unwrap();
                    // One ADC count of the cold thermistor with 1 kohm is 5 K.
                    let coarse = if ohm > 20.0 * sensor_ohm { 7.0 } else { tolerance };
                    assert!((found - celsius).abs() < coarse, "{sensor:?} {celsius}: {found}");
                }
                assert_eq!(motor.celsius(None), Some(Err(Fault::MotorSensorUnread)), "{sensor:?}");
                let ntc = sensor == SensorKind::Ntc10k;
                let (low, high) = (Fault::MotorSensorShorted, Fault::MotorSensorOpen);
                assert_eq!(motor.celsius(Some(0)), Some(Err(low)), "{sensor:?}");
                assert_eq!(motor.celsius(Some(4095)), Some(Err(high)), "{sensor:?}");
                // There is one band of plausible ADC counts, in which the temperature is monotonic.
                let mut before = f32::NAN;
                let mut passed = 0;
                for code in 0..=4095 {
                    match motor.celsius(Some(code)).unwrap() {
                        Ok(celsius) => {
                            let rises = celsius > before;
                            assert!(
                                passed < 2 && (before.is_nan() || rises != ntc),
                                "{sensor:?} {code}"
                            );
                            (before, passed) = (celsius, 1);
                        }
                        Err(fault) if passed == 0 => assert_eq!(fault, low),
                        Err(fault) => {
                            assert_eq!(fault, high);
                            passed = 2;
                        }
                    }
                }
                assert_eq!(passed, 2);
            }
        }
        assert_eq!(MotorSensor::DEFAULT.celsius(Some(2000)), None);
        assert_eq!(MotorSensor::DEFAULT.celsius(None), None);
    }
}

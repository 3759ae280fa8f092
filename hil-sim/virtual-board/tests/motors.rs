//! The lines that a session prints for another motor adapt the image to it and to the sensors of the board.

use drive_settings::find;
use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::plant::Plant;
use induction_drive::board;
use virtual_board::Options;
use virtual_board::power_stage::REFERENCE;

#[test]
fn after_the_printed_lines_the_drive_reads_the_sensors_of_every_motor_right() {
    assert_eq!(Options::set_lines(&REFERENCE, &Config::default()), Vec::<String>::new());
    for motor in Motor::all() {
        let name = motor.name.clone();
        let config = Config::of_motor(Some(&name)).unwrap();
        let mut settings = board::settings();
        for line in Options::set_lines(&REFERENCE, &config) {
            let words: Vec<&str> = line.split(' ').collect();
            let ["set", key, value] = words[..] else { panic!("{line}") };
            let entry = find(key).expect(key);
            entry.set(&mut settings, entry.parse(value).unwrap());
        }
        let plant = Options::plant(&REFERENCE, &config);
        let sample = Plant::new(&plant, 1).unwrap().sample();
        let scales = &settings.scales;
        let dc_link = f64::from(scales.dc_link.at(sample.dc_link));
        assert!((dc_link / config.inverter.dc_link_v - 1.0).abs() < 2e-3, "{name}: {dc_link} V");
        // No current flows: only noise of the sensor, and one count.
        let allowed = 6.0 * plant.measurement.noise_a + f64::from(scales.current_a.gain);
        for (line, code) in
            [(scales.current_a, sample.current_a), (scales.current_b, sample.current_b)]
        {
            assert!(f64::from(line.at(code)).abs() < allowed, "{name}: {} A", line.at(code));
        }
        // The range of the ADCs covers that of the sensors.
        let end = f64::from(scales.current_a.at(board::ADC_FULL_SCALE));
        assert!(end >= config.measurement.range_a, "{name}: {end} A");
        settings.check().unwrap_or_else(|why| panic!("{name}: {why}"));
    }
}

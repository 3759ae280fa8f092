//! The tests of the simulator: one program, with one module for each subject.

mod battery;
mod bench_tests;
mod board_builds;
mod bounds;
mod cli_common;
mod cli_contract;
mod commission;
mod configuration;
mod console;
mod documents;
#[path = "../plant/tests/duties.rs"]
mod duties;
mod first_light;
mod full_range;
#[path = "../../tests/common/generated.rs"]
mod generated;
mod hazards;
mod identification_tables;
mod identify_trace;
mod injection_torque;
mod journal;
mod keys_used;
mod measured_motors;
mod no_debug_text;
mod outcomes;
mod own_motor;
mod promises;
mod quiet_inverter;
mod record;
mod saliency_families;
mod same_json;
mod scenarios;
mod shown_commands;
mod sources;
mod starts_after_a_run;
mod torque_limit;
mod user_files;
mod workflows;
mod wrong_input;
mod yardstick;

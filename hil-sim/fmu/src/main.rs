//! Prints the descriptions of both FMUs as JSON, from which `pack.py` makes their files.

use induction_drive_fmu::unit::KINDS;

fn main() {
    println!("{}", serde_json::json!(KINDS.map(|kind| kind.description())));
}

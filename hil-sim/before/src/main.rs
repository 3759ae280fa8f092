fn main() { let _ = drive_before::Settings::default(); }

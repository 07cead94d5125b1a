//! The `volumepro-device` process.
fn main() {}

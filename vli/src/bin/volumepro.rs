//! The `volumepro` command.
fn main() {}

//! The `volumepro` command, where Cargo lets integration tests find it.
fn main() -> std::process::ExitCode {
    vli::command::run()
}

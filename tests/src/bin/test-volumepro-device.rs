//! The `volumepro-device` process, where Cargo lets integration tests find it.
fn main() -> std::process::ExitCode {
    volumepro_device::run()
}

//! The PCI function: configuration space, capabilities, command register.

mod command;

pub use command::CommandRegister;

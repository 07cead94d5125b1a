//! The card inside this process: the device serves one connection over a private socket.

use std::sync::Arc;
use std::time::Duration;
use vg500_regs::pci::VECTORS;
use volumepro_device::card::{Card as Device, Host};
use volumepro_device::config::Config;
use volumepro_device::dma::DmaTable;
use volumepro_device::interrupt::Interrupts;
use volumepro_device::listener::Listener;
use volumepro_device::pci::CommandRegister;
use volumepro_device::protocol::Server;
use volumepro_device::stop::Stop;
use volumepro_device::trace::Trace;
use volumepro_driver::{Card, Error, PrivateSocket};

/// Starts a card and opens it. It ends with the connection. No call of the driver waits longer than `timeout`.
pub(crate) fn open(timeout: Duration) -> Result<Card, Box<dyn std::error::Error>> {
    let config = Config::default();
    let command = Arc::new(CommandRegister::default());
    let dma = Arc::new(DmaTable::new(Arc::clone(&command)));
    let interrupts = Arc::new(Interrupts::new(config.interrupts, VECTORS, Arc::clone(&command)));
    let host = Host { dma: Arc::clone(&dma), interrupts: Arc::clone(&interrupts), command };
    let device = Device::new(&config, Trace::off(), &host)?;
    let stop = Stop::new()?;
    let socket = PrivateSocket::new()?;
    let listener = Listener::bind(socket.path())?;
    let mut server = Server::new(device, dma, interrupts, stop);
    std::thread::Builder::new().name("card".into()).spawn(move || server.listen(&listener))?;
    Ok(Card::open(Box::new(socket.connect(timeout)?))?)
}

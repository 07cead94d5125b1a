//! The card inside this process, behind the same protocol as any other: its device serves one private socket.

use crate::Board;
use std::time::Duration;
use volumepro_device::listener::Listener;
use volumepro_device::{Config, serve};
use volumepro_driver::{Card, PrivateSocket};

impl Board {
    /// A board with a card of its own inside this process. No call of the driver waits longer than `timeout` for
    /// the card's answer.
    ///
    /// # Errors
    /// The system has no room for it.
    pub fn embedded(config: &Config, timeout: Duration) -> Result<Self, Box<dyn std::error::Error>> {
        let socket = PrivateSocket::new()?;
        let handle = serve(Listener::bind(socket.path())?, config)?;
        let card = Card::open(Box::new(socket.connect(timeout)?))?;
        Ok(Self::new(card).served_by(Box::new(handle)))
    }
}

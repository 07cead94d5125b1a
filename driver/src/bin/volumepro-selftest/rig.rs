//! The card under test.

use std::error::Error;
use std::sync::Arc;

use vg500_regs::table::{completed, plane_state, transfer_state};
use volumepro_driver::{Card, PciCard, PciSelector};

use crate::meter::{Meter, Metered};
use crate::scene::Scene;

/// Why a check fails.
pub type Failure = Box<dyn Error>;

/// The card under test, and what is on it.
pub struct Rig {
    pub card: Card,
    pub scene: Scene,
    pub meter: Arc<Meter>,
}

impl Rig {
    /// Opens a card that is bound to vfio-pci.
    pub fn open(selector: PciSelector) -> Result<Self, Failure> {
        let transport = PciCard::open(selector)?;
        if !transport.is_vfio() {
            let address = transport.address();
            return Err(
                format!("{address} has no driver; bind it to vfio-pci, or use volumepro-smoke").into()
            );
        }
        let meter = Arc::new(Meter::default());
        let card = Card::open(Box::new(Metered::new(transport, Arc::clone(&meter))))?;
        let scene = Scene::new(&card)?;
        Ok(Self { card, scene, meter })
    }

    /// Fails if strict mode has counted a mistake since the last reset.
    pub fn expect_no_mistakes(&self) -> Result<(), Failure> {
        match self.card.mistakes()? {
            0 => Ok(()),
            count => Err(format!("{count} programming mistakes, named in the card's trace").into()),
        }
    }

    /// Fails unless the registers say that nothing has happened since a reset.
    pub fn expect_power_on(&self) -> Result<(), Failure> {
        let place = self.scene.plane.index();
        for offset in
            [completed::REGISTER.offset, transfer_state::REGISTER.offset, plane_state::REGISTER.at(place)]
        {
            match self.card.transport().read_register(offset)? {
                0 => {}
                word => return Err(format!("register {offset:#x} holds {word:#x} after the reset").into()),
            }
        }
        Ok(())
    }
}

/// Fails with a message unless a condition holds.
pub fn ensure(condition: bool, message: impl FnOnce() -> String) -> Result<(), Failure> {
    if condition { Ok(()) } else { Err(message().into()) }
}

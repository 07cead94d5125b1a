//! Configuration space as a client sees it.

use std::os::fd::OwnedFd;
use std::sync::Arc;

use proptest::prelude::*;
use rustix::event::{EventfdFlags, eventfd};
use rustix::io::{Errno, dup, read};

use super::*;
use crate::interrupt::{Action, Interrupts, Kind};

struct Function {
    config: ConfigSpace,
    command: Arc<CommandRegister>,
    interrupts: Arc<Interrupts>,
}

impl Function {
    fn new(mode: InterruptMode) -> Self {
        Self::of(&Layout {
            vendor: 0x1067,
            device: 0x1002,
            revision: 1,
            class: 0x04_80_00,
            bars: vec![
                Bar { index: 0, size: 64 << 10, wide: false },
                Bar { index: 2, size: 128 << 20, wide: true },
                Bar { index: 4, size: 16 << 20, wide: false },
            ],
            mode,
            vectors: 3,
            msix_table: 0x8000,
            msix_pending: 0xc000,
        })
    }

    fn of(layout: &Layout) -> Self {
        let command = Arc::new(CommandRegister::default());
        let interrupts = Arc::new(Interrupts::new(layout.mode, 3, Arc::clone(&command)));
        let config = ConfigSpace::new(layout, Arc::clone(&command), Arc::clone(&interrupts));
        Self { config, command, interrupts }
    }

    fn read(&self, offset: u64, width: usize) -> u32 {
        let mut bytes = [0; 4];
        self.config.read(offset, &mut bytes[..width]).unwrap();
        u32::from_le_bytes(bytes)
    }

    fn write(&mut self, offset: u64, width: usize, value: u32) -> Effect {
        self.config.write(offset, &value.to_le_bytes()[..width]).unwrap()
    }

    /// The capabilities as a guest finds them: identifier and offset.
    fn capabilities(&self) -> Vec<(u8, u64)> {
        let mut found = Vec::new();
        let mut at = self.read(0x34, 1);
        while at != 0 {
            assert!(found.len() < 16, "the list has no end");
            found.push((self.read(u64::from(at), 1) as u8, u64::from(at)));
            at = self.read(u64::from(at) + 1, 1);
        }
        found
    }

    fn capability(&self, id: u8) -> u64 {
        self.capabilities().into_iter().find(|it| it.0 == id).unwrap().1
    }
}

#[test]
fn accesses_outside_are_refused() {
    let mut config = Function::new(InterruptMode::Msix).config;
    for (offset, length) in [(4096, 1), (4095, 2), (0, 4097), (u64::MAX, 1), (u64::MAX, 4096)] {
        assert_eq!(config.read(offset, &mut vec![0; length]), Err(Errno::INVAL));
        assert_eq!(config.write(offset, &vec![0; length]), Err(Errno::INVAL));
    }
    config.read(4096, &mut []).unwrap();
}

#[test]
fn identity_cannot_be_written() {
    let mut card = Function::new(InterruptMode::Msix);
    for offset in
        (0..0x40).filter(|offset| ![4, 5, 0xc, 0xd, 0x3c].contains(offset) && !(0x10..0x28).contains(offset))
    {
        let before = card.read(offset, 1);
        assert_eq!(card.write(offset, 1, !before), Effect::None);
        assert_eq!(card.read(offset, 1), before, "{offset:#x}");
    }
    assert_eq!([0, 8, 0x2c].map(|at| card.read(at, 4)), [0x1002_1067, 0x0480_0001, 0x1002_1067]);
}

#[test]
fn base_address_registers_answer_sizing() {
    let mut card = Function::new(InterruptMode::Msix);
    let expected: [(u32, u32); 6] = [
        (0xffff_0000, 0x1234_0000),
        (0, 0),
        (0xf800_000c, 0x1000_000c),
        (0xffff_ffff, 0x1234_5678),
        (0xff00_0000, 0x1200_0000),
        (0, 0),
    ];
    for (index, (size, address)) in expected.into_iter().enumerate() {
        let at = 0x10 + 4 * index as u64;
        assert_eq!(card.write(at, 4, u32::MAX), Effect::None);
        assert_eq!(card.read(at, 4), size, "register {index}");
        assert_eq!(card.write(at, 4, 0x1234_5678), Effect::None);
        assert_eq!(card.read(at, 4), address, "register {index}");
    }
    card.config.reset();
    assert_eq!(card.read(0x18, 4), 0xc);
}

#[test]
fn the_card_shows_the_bars_of_the_programming_interface() {
    for (voxel_memory, low) in [(128, 0xf800_000c), (256, 0xf000_000c)] {
        let mut card = Function::of(&Layout::vg500(0x10ba, InterruptMode::Msix, voxel_memory << 20));
        (0..6).for_each(|bar| _ = card.write(0x10 + 4 * bar, 4, u32::MAX));
        let bars = [0, 1, 2, 3, 4, 5].map(|bar| card.read(0x10 + 4 * bar, 4));
        assert_eq!(bars, [0xffff_0000, 0xffff_0000, low, 0xffff_ffff, 0xff00_0000, 0xff00_0000]);
        assert_eq!([0, 8].map(|at| card.read(at, 4)), [0x1002_10ba, 0x0480_0001]);
    }
}

#[test]
fn capabilities_follow_the_interrupt_mode() {
    let list = |mode| Function::new(mode).capabilities();
    let ids = |mode| list(mode).into_iter().map(|it| it.0).collect::<Vec<_>>();
    assert_eq!(ids(InterruptMode::Msix), [id::POWER_MANAGEMENT, id::MSIX, id::MSI, id::EXPRESS]);
    assert_eq!(ids(InterruptMode::Msi), [id::POWER_MANAGEMENT, id::MSI, id::EXPRESS]);
    assert_eq!(ids(InterruptMode::Intx), [id::POWER_MANAGEMENT, id::EXPRESS]);
    assert!(list(InterruptMode::Msix).iter().all(|it| it.1 % 4 == 0 && it.1 < 0x100));
    let pin = |mode| Function::new(mode).read(0x3d, 1);
    assert_eq!([InterruptMode::Msix, InterruptMode::Msi, InterruptMode::Intx].map(pin), [0, 0, 1]);
}

#[test]
fn message_capabilities_tell_number_and_place() {
    let mut card = Function::new(InterruptMode::Msix);
    let msix = card.capability(id::MSIX);
    assert_eq!((card.read(msix + 2, 2), card.read(msix + 4, 4), card.read(msix + 8, 4)), (2, 0x8000, 0xc000));
    assert_eq!(card.write(msix + 2, 2, 0xffff), Effect::None);
    assert_eq!(card.read(msix + 2, 2), 0xc002);
    let msi = card.capability(id::MSI);
    assert_eq!(card.read(msi + 2, 2), 0x0084, "64 bits, four messages");
    assert_eq!(card.write(msi + 2, 2, 0xffff), Effect::None);
    assert_eq!(card.read(msi + 2, 2), 0x00f5);
}

#[test]
fn the_command_register_reaches_the_device() {
    let mut card = Function::new(InterruptMode::Intx);
    assert_eq!(card.write(4, 2, 0xffff), Effect::None);
    assert_eq!(card.read(4, 2), 0x0546);
    assert!(card.command.memory_space() && card.command.bus_master() && card.command.interrupt_disable());
    // Any access that touches a byte of it counts.
    assert_eq!(card.write(5, 1, 0), Effect::None);
    assert!(card.command.bus_master() && !card.command.interrupt_disable());
    assert_eq!(card.write(2, 4, 0), Effect::None);
    assert!(!card.command.memory_space() && !card.command.bus_master());
}

#[test]
fn the_interrupt_line_shows_in_status_and_obeys_the_command_register() {
    let mut card = Function::new(InterruptMode::Intx);
    let event: OwnedFd = eventfd(0, EventfdFlags::NONBLOCK).unwrap();
    card.interrupts.apply(Kind::Intx, 0..1, Action::Attach(vec![dup(&event).unwrap()]));
    assert_eq!(card.write(4, 2, 0x400), Effect::None);
    card.interrupts.raise(0);
    assert_eq!(
        [card.read(6, 2), card.read(4, 4) >> 16, card.read(6, 1), card.read(7, 1)],
        [0x18, 0x18, 0x18, 0]
    );
    assert_eq!(read(&event, &mut [0u8; 8]), Err(Errno::AGAIN));
    assert_eq!(card.write(5, 1, 0), Effect::None);
    assert_eq!(read(&event, &mut [0u8; 8]), Ok(8));
    card.interrupts.lower(0);
    assert_eq!(card.read(6, 2), 0x10);
}

#[test]
fn function_level_reset_is_asked_for_once_and_reads_as_zero() {
    let mut card = Function::new(InterruptMode::Msix);
    let control = card.capability(id::EXPRESS) + 8;
    assert_eq!(card.read(control - 4, 4) >> 28 & 1, 1, "the capability is there");
    assert_eq!(card.write(4, 2, 6), Effect::None);
    for (at, width, value) in [(control, 2, 0x8000), (control + 1, 1, 0x80), (control - 2, 4, 0x8000_0000)] {
        assert_eq!(card.write(at, width, value), Effect::Reset);
        assert_eq!(card.read(control, 2) & 0x8000, 0);
        assert_eq!(card.write(control, 2, 0x2810), Effect::None);
    }
    assert_eq!(card.read(4, 2), 6, "the device resets this space, with everything else");
    card.config.reset();
    assert_eq!((card.read(4, 2), card.command.memory_space()), (0, false));
}

#[test]
fn power_states_are_d0_and_d3() {
    let mut card = Function::new(InterruptMode::Msix);
    let control = card.capability(id::POWER_MANAGEMENT) + 4;
    for (written, state) in [(1, 0), (3, 3), (2, 3), (0, 0), (2, 0)] {
        assert_eq!(card.write(control, 2, written), Effect::None);
        assert_eq!(card.read(control, 2), 8 | state);
    }
}

#[test]
fn the_msix_table_stores_what_entries_have() {
    let mut table = MsixTable::new(3);
    let mut bytes = [0xff; 64];
    table.read(0, &mut bytes);
    assert!((0..64).all(|at| bytes[at] == u8::from(at < 48 && at % 16 == 12)));
    table.write(8, &[0xff; 64]);
    table.write(usize::MAX, &[0xff; 4]);
    table.read(4, &mut bytes[..20]);
    assert_eq!(
        bytes[..20],
        [0, 0, 0, 0, 255, 255, 255, 255, 1, 0, 0, 0, 0xfc, 255, 255, 255, 255, 255, 255, 255]
    );
    table.read(usize::MAX, &mut bytes[..4]);
    assert_eq!(bytes[..4], [0; 4]);
}

proptest! {
    #[test]
    fn any_access_writes_exactly_the_writable_bits(
        offset in 0..4200u64,
        data in prop::collection::vec(any::<u8>(), 0..12),
    ) {
        let mut card = Function::new(InterruptMode::Msix);
        let mut writable = |at| {
            let byte = card.read(at, 1);
            _ = card.config.write(at, &[!byte as u8]);
            (card.read(at, 1) ^ byte) as u8
        };
        let bits: Vec<u8> = (0..CONFIG_SIZE as u64).map(&mut writable).collect();
        let mut before = vec![0; CONFIG_SIZE];
        card.config.reset();
        card.config.read(0, &mut before).unwrap();
        let result = card.config.write(offset, &data);
        prop_assert_eq!(result.is_ok(), offset as usize + data.len() <= CONFIG_SIZE);
        let mut after = vec![0; CONFIG_SIZE];
        card.config.read(0, &mut after).unwrap();
        for at in 0..CONFIG_SIZE {
            let new = (at as u64).checked_sub(offset).and_then(|it| data.get(it as usize)).filter(|_| result.is_ok());
            let expected = new.map_or(before[at], |new| before[at] & !bits[at] | new & bits[at]);
            // The power state is one field of two bits, which takes two of its four values only.
            let power = card.capability(id::POWER_MANAGEMENT) as usize + 4;
            prop_assert!(after[at] == expected || at == power, "{at:#x}");
        }
    }
}

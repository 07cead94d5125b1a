//! An independent client: that of the crate `vfio_user`.

use std::os::fd::AsRawFd;

use memmap2::MmapOptions;
use vfio_user::Client;
use volumepro_device::interrupt::InterruptMode;
use volumepro_device::protocol::ResetReason;

use crate::common::{self, MEMORY, REGISTERS, Rig};

#[test]
fn it_sees_the_device_as_it_is() {
    let rig = Rig::new();
    let client = Client::new(&rig.path()).unwrap();
    let sizes: Vec<u64> = (0..9).map(|index| client.region(index).unwrap().size).collect();
    assert_eq!(sizes, [REGISTERS, 0, MEMORY, 0, 16, 0, 0, 4096, 0]);
    assert!(client.region(0).unwrap().file_offset.is_none());
    let areas = &client.region(2).unwrap().sparse_areas;
    assert_eq!((areas.len(), areas[0].offset, areas[0].size), (1, 0, MEMORY));
}

#[test]
fn it_maps_memory_and_accesses_registers() {
    let rig = Rig::new();
    let mut client = Client::new(&rig.path()).unwrap();
    client.region_write(0, 0x10, &[1, 2, 3, 4]).unwrap();
    let mut data = [0; 4];
    client.region_read(0, 0x10, &mut data).unwrap();
    assert_eq!(data, [1, 2, 3, 4]);
    let file = client.region(2).unwrap().file_offset.as_ref().unwrap();
    let mapping = MmapOptions::new().len(MEMORY as usize).map_raw(file.file()).unwrap();
    // SAFETY: the byte lies inside the mapping, which nothing else refers to.
    unsafe { mapping.as_mut_ptr().add(MEMORY as usize - 1).write_volatile(77) };
    client.region_read(2, MEMORY - 4, &mut data).unwrap();
    assert_eq!(data, [0, 0, 0, 77]);
    client.reset().unwrap();
    assert_eq!(rig.resets.lock().unwrap().last(), Some(&ResetReason::Device));
    client.region_read(0, 0x10, &mut data).unwrap();
    assert_eq!(data, [0; 4]);
}

#[test]
fn it_gives_memory_and_interrupts() {
    for (mode, index) in [(InterruptMode::Msix, 2), (InterruptMode::Msi, 1), (InterruptMode::Intx, 0)] {
        let rig = Rig::with(mode);
        let mut client = Client::new(&rig.path()).unwrap();
        client.region_write(7, 4, &[6, 0]).unwrap();
        let memory = common::memory(8192);
        client.dma_map(4096, 0x1000_0000, 4096, memory.as_raw_fd()).unwrap();
        rig.dma.write(0x1000_0000, b"status").unwrap();
        let mut seen = [0; 6];
        rustix::io::pread(&memory, &mut seen, 4096).unwrap();
        assert_eq!(&seen, b"status");
        client.dma_unmap(0x1000_0000, 4096).unwrap();
        assert!(rig.dma.is_empty());
        let info = client.get_irq_info(index).unwrap();
        assert!(info.count >= 1 && info.flags & 1 == 1);
        let event = common::event();
        client.set_irqs(index, 0x24, 0, 1, &[event.as_raw_fd()]).unwrap();
        rig.interrupts.raise(0);
        assert_eq!(common::events(&event), 1);
        client.shutdown().unwrap();
    }
}

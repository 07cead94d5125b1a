//! A client with mapped memories, host memory and interrupts, as a driver has them.

use std::fs::File;
use std::os::fd::{AsRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::time::{Duration, Instant};

use memmap2::{MmapOptions, MmapRaw};
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, ftruncate, memfd_create};
use tempfile::TempDir;
use vfio_user::Client;
use vg500_regs::frame_registers::{FRAME_END, FRAME_START, VIEW_START};
use vg500_regs::memory::Table;
use vg500_regs::pci::{BARS, Bar, REGISTERS, TABLE_MEMORY, VECTORS, VOXEL_MEMORY};
use vg500_regs::table::{self, *};
use vg500_regs::{FrameRegisters, Register, SharedView, VoxelFormat};
use volumepro_device::listener::Listener;
use volumepro_device::{Config, Handle, serve};

/// VFIO's number of MSI-X interrupts.
const MSIX: u32 = 2;
/// Set event descriptors.
const ATTACH: u32 = 1 << 2 | 1 << 5;
/// How long anything may take.
const PATIENCE: Duration = Duration::from_secs(20);
/// Bus address of the host memory.
pub const HOST: u64 = 0x10_0000;
/// Bytes of the host memory.
pub const HOST_SIZE: u64 = 4 << 20;

/// A card in this process.
pub struct Server {
    pub folder: TempDir,
    pub handle: Handle,
}

impl Server {
    pub fn new(config: Config) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let listener = Listener::bind(&folder.path().join("card.sock")).unwrap();
        let config = Config { trace: Some(folder.path().join("trace")), ..config };
        let handle = serve(listener, &config).unwrap();
        Self { folder, handle }
    }

    pub fn socket(&self) -> PathBuf {
        self.folder.path().join("card.sock")
    }

    pub fn trace(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("trace")).unwrap()
    }

    /// Waits until the trace has a line that contains `text`.
    pub fn await_trace(&self, text: &str) {
        await_that(|| self.trace().contains(text));
    }
}

/// Memory of this process that the card can reach, or memory of the card that this process maps.
pub struct Memory(MmapRaw);

impl Memory {
    pub fn view(&self) -> SharedView<'_> {
        let start = NonNull::new(self.0.as_mut_ptr()).unwrap();
        // SAFETY: the mapping lives as long as the view's borrow, and no reference to its bytes exists.
        unsafe { SharedView::new(start, self.0.len()) }
    }

    pub fn bytes(&self, offset: usize, length: usize) -> Vec<u8> {
        let mut bytes = vec![0; length];
        self.view().read(offset, &mut bytes).unwrap();
        bytes
    }
}

/// A connected client: memory and bus mastering enabled, host memory mapped, interrupts attached.
pub struct Peer {
    pub client: Client,
    pub events: Vec<OwnedFd>,
    pub host: Memory,
    memories: Vec<(u32, Memory)>,
}

impl Peer {
    pub fn new(socket: &Path) -> Self {
        let mut client = Client::new(socket).unwrap();
        client.region_write(7, 4, &[6, 0]).unwrap();
        let file = memfd_create("host", MemfdFlags::ALLOW_SEALING).unwrap();
        ftruncate(&file, HOST_SIZE).unwrap();
        fcntl_add_seals(&file, SealFlags::SHRINK).unwrap();
        client.dma_map(0, HOST, HOST_SIZE, file.as_raw_fd()).unwrap();
        let events: Vec<OwnedFd> =
            (0..VECTORS).map(|_| eventfd(0, EventfdFlags::NONBLOCK).unwrap()).collect();
        let descriptors: Vec<_> = events.iter().map(AsRawFd::as_raw_fd).collect();
        client.set_irqs(MSIX, ATTACH, 0, VECTORS.into(), &descriptors).unwrap();
        let mapped = BARS.iter().filter(|bar| bar.mapped);
        let memories = mapped.map(|bar| (bar.index, map_region(&client, bar.index))).collect();
        let host = Memory(MmapOptions::new().map_raw(&File::from(file)).unwrap());
        Self { client, events, host, memories }
    }

    pub fn memory(&self, bar: Bar) -> &Memory {
        &self.memories.iter().find(|(index, _)| *index == bar.index).unwrap().1
    }

    pub fn read_at(&mut self, offset: u32) -> u32 {
        let mut word = [0; 4];
        self.client.region_read(REGISTERS.index, offset.into(), &mut word).unwrap();
        u32::from_le_bytes(word)
    }

    pub fn read(&mut self, register: Register) -> u32 {
        self.read_at(register.offset)
    }

    pub fn write(&mut self, register: Register, word: u32) {
        self.client.region_write(REGISTERS.index, register.offset.into(), &word.to_le_bytes()).unwrap();
    }

    /// Writes consecutive frame registers in one message.
    pub fn burst(&mut self, frame: &FrameRegisters, from: u32) {
        let words: Vec<u8> =
            (from..FRAME_END).step_by(4).flat_map(|offset| frame.read(offset).to_le_bytes()).collect();
        self.client.region_write(REGISTERS.index, from.into(), &words).unwrap();
    }

    /// Starts a frame of which everything is new.
    pub fn start(&mut self, frame: &FrameRegisters) {
        let known = (FRAME_START..VIEW_START).step_by(4).filter_map(|offset| table::find(offset));
        for (register, _) in known.collect::<Vec<_>>() {
            self.write(*register, frame.word(*register));
        }
        self.burst(frame, VIEW_START);
    }

    /// Waits for an interrupt and takes it.
    pub fn await_interrupt(&self, vector: usize) {
        let event = &self.events[vector];
        let time = Timespec { tv_sec: PATIENCE.as_secs() as i64, tv_nsec: 0 };
        let ready = poll(&mut [PollFd::new(event, PollFlags::IN)], Some(&time)).unwrap();
        assert_eq!(ready, 1, "no interrupt");
        rustix::io::read(event, &mut [0u8; 8]).unwrap();
    }

    pub fn plane_state(&mut self, place: u32) -> (u32, u32) {
        let word = self.read_at(plane_state::REGISTER.at(place));
        (plane_state::TAG.get(word), plane_state::RESULT.get(word))
    }

    /// Fills a cube of 12-bit voxels and tables that show them.
    pub fn fill(&self, size: u32) {
        let voxels = self.memory(VOXEL_MEMORY).view();
        let values: Vec<u16> =
            (0..size * size * size).map(|at| (at.wrapping_mul(2_654_435_761) >> 20) as u16).collect();
        voxels.write_u16(0, &values).unwrap();
        let tables = self.memory(TABLE_MEMORY).view();
        for entry in 0..4096usize {
            let word = (entry as u32 * 0x0001_0204) & 0x00ff_ffff;
            tables.write_u32(Table::Color.offset(0) + 4 * entry, word).unwrap();
            tables.write_u16(Table::Opacity.offset(0) + 2 * entry, &[entry as u16 / 8]).unwrap();
        }
    }
}

fn map_region(client: &Client, index: u32) -> Memory {
    let region = client.region(index).unwrap();
    let file = region.file_offset.as_ref().unwrap().file();
    Memory(MmapOptions::new().len(region.size as usize).map_raw(file).unwrap())
}

/// A frame of the cube.
pub fn frame(size: u32, tag: u32, plane: u32) -> FrameRegisters {
    let mut registers = FrameRegisters::default();
    registers.set(volume_format::FORMAT, VoxelFormat::Uint12Lower as u32);
    registers.set(volume_size_xy::X, size);
    registers.set(volume_size_xy::Y, size);
    registers.set(volume_size_z::Z, size);
    registers.set(volume_pitch::ROW, size);
    registers.set(volume_pitch::ROWS, size);
    registers.set(base_plane_size::WIDTH, size);
    registers.set(base_plane_size::HEIGHT, size);
    registers.set(start::PLANE, plane);
    registers.set(start::TAG, tag);
    registers
}

/// Waits for something.
pub fn await_that(mut happened: impl FnMut() -> bool) {
    let began = Instant::now();
    while !happened() {
        assert!(began.elapsed() < PATIENCE, "it has not happened");
        std::thread::sleep(Duration::from_millis(1));
    }
}

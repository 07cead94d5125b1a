//! A small device behind a server on a thread of its own, and a client that sends whatever bytes it likes.

use std::io::{ErrorKind, IoSlice, IoSliceMut, Read, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::cmsg_space;
use rustix::event::{EventfdFlags, eventfd};
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, ftruncate, memfd_create};
use rustix::io::{Errno, read};
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage,
    SendFlags, recvmsg, sendmsg,
};
use tempfile::TempDir;
use volumepro_device::backing::Backing;
use volumepro_device::dma::DmaTable;
use volumepro_device::interrupt::{InterruptMode, Interrupts};
use volumepro_device::listener::Listener;
use volumepro_device::pci::{Bar, CONFIG_SIZE, CommandRegister, ConfigSpace, Effect, Layout};
use volumepro_device::protocol::{Counters, Device, Region, ResetReason, Server, region};
use volumepro_device::stop::Stop;

/// Size of the trapped region.
pub const REGISTERS: u64 = 4096;
/// Size of the mapped region.
pub const MEMORY: u64 = 2 << 20;
/// The trapped region.
pub const BAR0: u32 = 0;
/// The mapped region.
pub const BAR2: u32 = 2;
/// A region that can be read only.
pub const BAR4: u32 = 4;
/// Configuration space.
pub const CONFIG: u32 = 7;
/// Accesses here make the device panic.
pub const PANIC: u64 = 0xff0;
/// Accesses here make the device fail.
pub const FAIL: u64 = 0xff8;

/// Registers that store, memory that is mapped, and configuration space.
pub struct Card {
    regions: Vec<Region>,
    registers: Vec<u8>,
    memory: Arc<Backing>,
    config: ConfigSpace,
    dma: Arc<DmaTable>,
    resets: Arc<Mutex<Vec<ResetReason>>>,
}

impl Card {
    fn special(region: usize, offset: u64) -> Result<(), Errno> {
        match (region, offset) {
            (0, PANIC) => panic!("asked to"),
            (0, FAIL) => Err(Errno::BUSY),
            _ => Ok(()),
        }
    }
}

impl Device for Card {
    fn regions(&self) -> &[Region] {
        &self.regions
    }

    fn read(&mut self, region: usize, offset: u64, data: &mut [u8]) -> Result<(), Errno> {
        Self::special(region, offset)?;
        match region {
            0 => data.copy_from_slice(&self.registers[offset as usize..offset as usize + data.len()]),
            2 => self.memory.view().read(offset as usize, data).unwrap(),
            4 => data.fill(4),
            region::CONFIG => self.config.read(offset, data).unwrap(),
            _ => unreachable!("the server asked for region {region}"),
        }
        Ok(())
    }

    fn write(&mut self, region: usize, offset: u64, data: &[u8]) -> Result<(), Errno> {
        Self::special(region, offset)?;
        match region {
            0 => self.registers[offset as usize..offset as usize + data.len()].copy_from_slice(data),
            2 => self.memory.view().write(offset as usize, data).unwrap(),
            region::CONFIG => {
                if self.config.write(offset, data).unwrap() == Effect::Reset {
                    self.reset(ResetReason::FunctionLevel);
                }
            }
            _ => unreachable!("the server asked for region {region}"),
        }
        Ok(())
    }

    fn reset(&mut self, reason: ResetReason) {
        let _quiet = self.dma.suspend();
        self.registers.fill(0);
        self.memory.clear().unwrap();
        self.config.reset();
        self.resets.lock().unwrap().push(reason);
    }
}

/// A server of a [`Card`], and what it shares with the card's other threads.
pub struct Rig {
    pub dma: Arc<DmaTable>,
    pub interrupts: Arc<Interrupts>,
    pub counters: Arc<Counters>,
    pub resets: Arc<Mutex<Vec<ResetReason>>>,
    pub stop: Stop,
    folder: TempDir,
    server: Option<JoinHandle<std::io::Result<()>>>,
}

impl Rig {
    pub fn new() -> Self {
        Self::with(InterruptMode::Msix)
    }

    pub fn with(mode: InterruptMode) -> Self {
        let command = Arc::new(CommandRegister::default());
        let dma = Arc::new(DmaTable::new(Arc::clone(&command)));
        let interrupts = Arc::new(Interrupts::new(mode, 3, Arc::clone(&command)));
        let resets = Arc::new(Mutex::new(Vec::new()));
        let (stop, folder) = (Stop::new().unwrap(), tempfile::tempdir().unwrap());
        let card = card(mode, command, &dma, &interrupts, &resets);
        let mut server = Server::new(card, Arc::clone(&dma), Arc::clone(&interrupts), stop.clone());
        let counters = server.counters();
        let listener = Listener::bind(&folder.path().join("card.sock")).unwrap();
        let server = Some(std::thread::spawn(move || server.listen(&listener)));
        Self { dma, interrupts, counters, resets, stop, folder, server }
    }

    pub fn path(&self) -> std::path::PathBuf {
        self.folder.path().join("card.sock")
    }

    /// A client that has said nothing yet.
    pub fn connect(&self) -> Client {
        let stream = UnixStream::connect(self.path()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        Client { stream, id: 0 }
    }

    /// A client that has negotiated.
    pub fn client(&self) -> Client {
        let mut client = self.connect();
        client.version();
        client
    }

    /// Stops the server, and tells whether it ended well.
    pub fn end(&mut self) -> std::io::Result<()> {
        self.stop.request();
        self.server.take().map_or(Ok(()), |server| server.join().unwrap())
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        let ended = self.end();
        assert!(std::thread::panicking() || ended.is_ok());
    }
}

fn card(
    mode: InterruptMode,
    command: Arc<CommandRegister>,
    dma: &Arc<DmaTable>,
    interrupts: &Arc<Interrupts>,
    resets: &Arc<Mutex<Vec<ResetReason>>>,
) -> Card {
    let layout = Layout {
        vendor: 0x1067,
        device: 0x1002,
        revision: 1,
        class: 0x04_80_00,
        bars: vec![
            Bar { index: 0, size: REGISTERS, wide: false },
            Bar { index: 2, size: MEMORY, wide: true },
        ],
        mode,
        vectors: 3,
        msix_table: 0x800,
        msix_pending: 0xc00,
    };
    let memory = Arc::new(Backing::new("test card memory", MEMORY).unwrap());
    let mut regions = vec![Region::default(); region::COUNT];
    regions[0] = Region::trapped(REGISTERS);
    regions[2] = Region::mapped(Arc::clone(&memory));
    regions[4] = Region { write: false, ..Region::trapped(16) };
    regions[region::CONFIG] = Region::trapped(CONFIG_SIZE as u64);
    let config = ConfigSpace::new(&layout, command, Arc::clone(interrupts));
    let registers = vec![0; REGISTERS as usize];
    Card { regions, registers, memory, config, dma: Arc::clone(dma), resets: Arc::clone(resets) }
}

/// A message as it came back.
#[derive(Debug)]
pub struct Message {
    pub id: u16,
    pub command: u16,
    pub flags: u32,
    pub error: u32,
    pub payload: Vec<u8>,
    pub descriptors: Vec<OwnedFd>,
}

pub const VERSION: u16 = 1;
pub const DMA_MAP: u16 = 2;
pub const DMA_UNMAP: u16 = 3;
pub const GET_INFO: u16 = 4;
pub const GET_REGION_INFO: u16 = 5;
pub const GET_IRQ_INFO: u16 = 7;
pub const SET_IRQS: u16 = 8;
pub const REGION_READ: u16 = 9;
pub const REGION_WRITE: u16 = 10;
pub const DMA_READ: u16 = 11;
pub const DMA_WRITE: u16 = 12;
pub const RESET: u16 = 13;
pub const WRITE_MULTI: u16 = 15;

pub const REPLY: u32 = 1;
pub const NO_REPLY: u32 = 1 << 4;
pub const ERROR_REPLY: u32 = 0x21;

/// Joins little-endian words of 32 bits.
pub fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Joins little-endian words of 64 bits.
pub fn longs(longs: &[u64]) -> Vec<u8> {
    longs.iter().flat_map(|long| long.to_le_bytes()).collect()
}

/// The payload of `REGION_READ`, and the beginning of that of `REGION_WRITE`.
pub fn access(region: u32, offset: u64, count: u32) -> Vec<u8> {
    [longs(&[offset]), words(&[region, count])].concat()
}

/// The payload of `DMA_MAP`.
pub fn dma_map(flags: u32, offset: u64, address: u64, size: u64) -> Vec<u8> {
    [words(&[32, flags]), longs(&[offset, address, size])].concat()
}

/// The payload of `DMA_UNMAP`.
pub fn dma_unmap(flags: u32, address: u64, size: u64) -> Vec<u8> {
    [words(&[24, flags]), longs(&[address, size])].concat()
}

/// The payload of `SET_IRQS` without data.
pub fn set_irqs(flags: u32, index: u32, start: u32, count: u32) -> Vec<u8> {
    words(&[20, flags, index, start, count])
}

/// A message with a header that tells the truth.
pub fn message(id: u16, command: u16, flags: u32, payload: &[u8]) -> Vec<u8> {
    raw(id, command, 16 + payload.len() as u32, flags, payload)
}

/// A message with a header that may lie about its size.
pub fn raw(id: u16, command: u16, size: u32, flags: u32, payload: &[u8]) -> Vec<u8> {
    let header = words(&[u32::from(command) << 16 | u32::from(id), size, flags, 0]);
    [header, payload.to_vec()].concat()
}

/// A sealed memfd.
pub fn memory(size: u64) -> OwnedFd {
    let file = memfd_create("guest memory", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING).unwrap();
    ftruncate(&file, size).unwrap();
    fcntl_add_seals(&file, SealFlags::SHRINK).unwrap();
    file
}

/// An event descriptor that does not block.
pub fn event() -> OwnedFd {
    eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC).unwrap()
}

/// Events since the last call.
pub fn events(event: &OwnedFd) -> u64 {
    let mut count = [0; 8];
    read(event, &mut count).map_or(0, |_| u64::from_ne_bytes(count))
}

/// A client without scruples.
pub struct Client {
    pub stream: UnixStream,
    id: u16,
}

impl Client {
    /// Sends bytes, descriptors with the first of them.
    pub fn send(&mut self, bytes: &[u8], descriptors: &[BorrowedFd<'_>]) {
        self.try_send(bytes, descriptors).unwrap();
    }

    /// Sends bytes to a server that may have closed.
    pub fn try_send(&mut self, bytes: &[u8], descriptors: &[BorrowedFd<'_>]) -> Result<(), std::io::Error> {
        let mut space = [MaybeUninit::uninit(); cmsg_space!(ScmRights(64))];
        let mut control = SendAncillaryBuffer::new(&mut space);
        if !descriptors.is_empty() {
            assert!(control.push(SendAncillaryMessage::ScmRights(descriptors)));
        }
        let sent = sendmsg(&self.stream, &[IoSlice::new(bytes)], &mut control, SendFlags::NOSIGNAL)?;
        self.stream.write_all(&bytes[sent..])
    }

    /// Sends a command and returns its id.
    pub fn command(
        &mut self,
        command: u16,
        flags: u32,
        payload: &[u8],
        descriptors: &[BorrowedFd<'_>],
    ) -> u16 {
        self.id = self.id.wrapping_add(0x1111);
        self.send(&message(self.id, command, flags, payload), descriptors);
        self.id
    }

    /// Receives one message whole.
    pub fn receive(&mut self) -> Message {
        self.try_receive().expect("the server closed the connection")
    }

    /// Receives one message, or none if the server has closed the connection.
    pub fn try_receive(&mut self) -> Option<Message> {
        let mut header = [0; 16];
        let mut space = [MaybeUninit::uninit(); cmsg_space!(ScmRights(16))];
        let mut control = RecvAncillaryBuffer::new(&mut space);
        let flags = RecvFlags::CMSG_CLOEXEC;
        let received = match recvmsg(&self.stream, &mut [IoSliceMut::new(&mut header)], &mut control, flags) {
            Ok(received) => received.bytes,
            Err(Errno::CONNRESET) => 0,
            Err(errno) => panic!("no reply: {errno}"),
        };
        if received == 0 {
            return None;
        }
        let mut descriptors = Vec::new();
        for message in control.drain() {
            if let RecvAncillaryMessage::ScmRights(rights) = message {
                descriptors.extend(rights);
            }
        }
        self.stream.read_exact(&mut header[received..]).unwrap();
        let word =
            |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        let mut payload = vec![0; word(4) as usize - 16];
        self.stream.read_exact(&mut payload).unwrap();
        Some(Message {
            id: word(0) as u16,
            command: (word(0) >> 16) as u16,
            flags: word(8),
            error: word(12),
            payload,
            descriptors,
        })
    }

    /// Sends a command with descriptors, and returns its reply.
    pub fn ask_with(&mut self, command: u16, payload: &[u8], descriptors: &[BorrowedFd<'_>]) -> Message {
        let id = self.command(command, 0, payload, descriptors);
        let reply = self.receive();
        assert_eq!((reply.id, reply.command), (id, command));
        reply
    }

    /// Sends a command, and returns its reply.
    pub fn ask(&mut self, command: u16, payload: &[u8]) -> Message {
        self.ask_with(command, payload, &[])
    }

    /// The payload of a reply that must not be an error.
    pub fn succeed(&mut self, command: u16, payload: &[u8]) -> Vec<u8> {
        self.succeed_with(command, payload, &[])
    }

    pub fn succeed_with(&mut self, command: u16, payload: &[u8], descriptors: &[BorrowedFd<'_>]) -> Vec<u8> {
        let reply = self.ask_with(command, payload, descriptors);
        assert_eq!((reply.flags, reply.error), (REPLY, 0), "command {command}");
        reply.payload
    }

    /// The error of a reply that must be one, after which the connection must still work.
    pub fn fail(&mut self, command: u16, payload: &[u8]) -> Errno {
        self.fail_with(command, payload, &[])
    }

    pub fn fail_with(&mut self, command: u16, payload: &[u8], descriptors: &[BorrowedFd<'_>]) -> Errno {
        let reply = self.ask_with(command, payload, descriptors);
        assert_eq!((reply.flags, reply.payload.len()), (ERROR_REPLY, 0), "command {command}");
        assert_ne!(reply.error, 0);
        self.works();
        Errno::from_raw_os_error(reply.error as i32)
    }

    pub fn version(&mut self) -> Vec<u8> {
        let data = b"{\"capabilities\":{\"max_msg_fds\":16,\"write_multiple\":true}}\0";
        self.succeed(VERSION, &[&[0; 4], &data[..]].concat())
    }

    /// Shows that requests are still answered in step.
    pub fn works(&mut self) {
        assert_eq!(self.succeed(GET_INFO, &words(&[16, 0, 0, 0])), words(&[16, 3, 9, 5]));
    }

    /// Shows that the server has closed the connection.
    pub fn is_closed(&mut self) -> bool {
        match self.stream.read(&mut [0]) {
            Ok(read) => read == 0,
            Err(error) => error.kind() == ErrorKind::ConnectionReset,
        }
    }

    pub fn read(&mut self, region: u32, offset: u64, count: u32) -> Vec<u8> {
        let reply = self.succeed(REGION_READ, &access(region, offset, count));
        assert_eq!(reply[..16], access(region, offset, count));
        reply[16..].to_vec()
    }

    pub fn write(&mut self, region: u32, offset: u64, data: &[u8]) {
        let place = access(region, offset, data.len() as u32);
        assert_eq!(self.succeed(REGION_WRITE, &[&place[..], data].concat()), place);
    }

    /// Sets Memory Space Enable and Bus Master Enable.
    pub fn enable(&mut self) {
        self.write(CONFIG, 4, &[6, 0]);
    }

    /// Maps a page of memory.
    pub fn map(&mut self, address: u64, size: u64, file: &OwnedFd) {
        self.succeed_with(DMA_MAP, &dma_map(3, 0, address, size), &[file.as_fd()]);
    }
}

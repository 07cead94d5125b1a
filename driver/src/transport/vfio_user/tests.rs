//! The transport against the protocol crate's own server, with the card in memory behind it, and against peers
//! that do not keep to the protocol.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, IntoRawFd, OwnedFd};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Instant;

use vfio_user::{DmaMapFlags, DmaUnmapFlags, IrqInfo, Server, ServerBackend, ServerRegion, SparseArea};
use vg500_regs::table::start_x;
use vg500_regs::{FrameRegisters, PixelFormat, PlaneFormat, VoxelFormat};

use super::*;
use crate::fake::{FakeCard, Setup};
use crate::{Card, Completion, Rectangle};

const SOON: Duration = Duration::from_secs(20);

/// What the server does wrong.
#[derive(Default)]
struct Faults {
    /// No answer to anything from now on.
    silent: AtomicBool,
    refuses_maps: bool,
    ignores_triggers: bool,
    no_interrupts: bool,
    keeps_command_at_reset: bool,
    /// The file behind this region is shorter than the region.
    short_file: Option<u32>,
}

struct Peer {
    card: Arc<FakeCard>,
    faults: Arc<Faults>,
}

impl Peer {
    fn answer(&self) -> Result<(), io::Error> {
        while self.faults.silent.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }
}

fn io(error: Error) -> io::Error {
    io::Error::other(error)
}

impl ServerBackend for Peer {
    fn region_read(&mut self, region: u32, offset: u64, data: &mut [u8]) -> Result<(), io::Error> {
        self.answer()?;
        let mut words = vec![0; data.len() / 4];
        match region {
            CONFIG => words[0] = self.card.read_config(offset as u16).map_err(io)?,
            _ => self.card.read_registers(offset as u32, &mut words).map_err(io)?,
        }
        data.as_chunks_mut().0.iter_mut().zip(words).for_each(|(bytes, word)| *bytes = word.to_le_bytes());
        Ok(())
    }

    fn region_write(&mut self, region: u32, offset: u64, data: &[u8]) -> Result<(), io::Error> {
        self.answer()?;
        if region == CONFIG {
            let word = u16::from_le_bytes([data[0], data[1]]);
            return self.card.write_config(offset as u16, word).map_err(io);
        }
        let words: Vec<u32> = words(data).collect();
        self.card.write_registers(offset as u32, &words).map_err(io)
    }

    fn dma_map(
        &mut self,
        _: DmaMapFlags,
        offset: u64,
        address: u64,
        size: u64,
        file: Option<File>,
    ) -> Result<(), io::Error> {
        self.answer()?;
        if self.faults.refuses_maps {
            return Err(io::ErrorKind::PermissionDenied.into());
        }
        self.card.map(address, Mapping::new(&file.unwrap(), offset, size)?);
        Ok(())
    }

    fn dma_unmap(&mut self, _: DmaUnmapFlags, address: u64, _: u64) -> Result<(), io::Error> {
        self.card.unmap(address);
        Ok(())
    }

    fn reset(&mut self) -> Result<(), io::Error> {
        self.answer()?;
        self.card.reset().map_err(io)?;
        if self.faults.keeps_command_at_reset {
            self.card.write_config(4, 6).map_err(io)?;
        }
        Ok(())
    }

    fn set_irqs(
        &mut self,
        index: u32,
        flags: u32,
        start: u32,
        count: u32,
        files: Vec<File>,
    ) -> Result<(), io::Error> {
        assert_eq!((index, count), (MSIX, 1));
        match files.into_iter().next() {
            Some(file) => self.card.attach(OwnedFd::from(file)),
            None if self.faults.ignores_triggers => {}
            None => {
                assert_eq!(flags, DATA_NONE | ACTION_TRIGGER);
                self.card.signal(start);
            }
        }
        Ok(())
    }
}

fn server_region(file: Option<&File>, index: u32, size: u64) -> ServerRegion {
    let mut region =
        ServerRegion { region_info: Default::default(), sparse_areas: Vec::new(), mmap_fd: None };
    region.region_info.argsz = 32;
    region.region_info.index = index;
    region.region_info.size = size;
    region.region_info.flags = 3;
    if let Some(file) = file {
        let mut sparse = SparseArea { area: Default::default() };
        sparse.area.size = size;
        region.sparse_areas.push(sparse);
        region.region_info.flags |= 4;
        region.mmap_fd = Some(file.as_raw_fd());
    }
    region
}

/// A server with the fake card behind it, and a connection to it.
fn serve(setup: Setup, faults: Faults, timeout: Duration) -> (VfioUser, Arc<FakeCard>, Arc<Faults>) {
    let socket = PrivateSocket::new().unwrap();
    let sizes = setup.bar_sizes;
    let card = FakeCard::new(setup);
    let bars = (0..).zip(sizes).map(|(index, size)| server_region(card.file(index), index, size));
    let others = [(6, 0), (CONFIG, 256), (8, 0)].map(|(index, size)| server_region(None, index, size));
    let mut regions: Vec<_> = bars.chain(others).collect();
    if let Some(index) = faults.short_file {
        let file = tempfile::tempfile().unwrap();
        file.set_len(4096).unwrap();
        regions[index as usize].mmap_fd = Some(file.into_raw_fd());
    }
    let vectors = if faults.no_interrupts { 0 } else { 3 };
    let irqs =
        (0..5).map(|index| IrqInfo { index, flags: 1, count: if index == MSIX { vectors } else { 0 } });
    let server = Server::new(socket.path(), true, irqs.collect(), regions).unwrap();
    let faults = Arc::new(faults);
    let mut peer = Peer { card: Arc::clone(&card), faults: Arc::clone(&faults) };
    thread::spawn(move || server.run(&mut peer).ok());
    (socket.connect(timeout).unwrap(), card, faults)
}

/// A peer that does `answer` with the connection.
fn peer(answer: impl FnOnce(UnixStream) + Send + 'static) -> PrivateSocket {
    let socket = PrivateSocket::new().unwrap();
    let listener = UnixListener::bind(socket.path()).unwrap();
    thread::spawn(move || answer(listener.accept().unwrap().0));
    socket
}

#[test]
fn a_server_that_says_nothing_is_given_up_in_time() {
    let socket = peer(|stream| {
        thread::park_timeout(SOON);
        drop(stream);
    });
    let start = Instant::now();
    let error = socket.connect(Duration::from_millis(100)).unwrap_err();
    assert!(error.to_string().ends_with("card.sock: no answer within 100ms"), "{error}");
    assert!(start.elapsed() < SOON / 2);
}

#[test]
fn servers_that_hang_up_or_talk_nonsense_are_no_cards() {
    let hangs_up = peer(drop);
    assert!(matches!(hangs_up.connect(SOON), Err(Error::Connect { .. })));
    // A reply that claims to be shorter than its header makes the protocol client panic, on its own thread.
    let nonsense = peer(|mut stream| {
        stream.read_exact(&mut [0; 16]).unwrap();
        stream.write_all(&[0; 20]).unwrap();
        thread::park_timeout(SOON);
    });
    assert!(matches!(nonsense.connect(SOON), Err(Error::Connect { .. })));
}

#[test]
fn a_card_that_goes_silent_is_dead_at_once_and_for_good() {
    let (transport, fake, faults) = serve(Setup::default(), Faults::default(), Duration::from_millis(200));
    let card = Card::open(Box::new(transport)).unwrap();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    faults.silent.store(true, Ordering::Relaxed);
    let start = Instant::now();
    let error = card.submit(&plane, &FrameRegisters::default()).unwrap_err();
    assert_eq!(error.to_string(), "the card is dead: writing registers: no answer within 200ms");
    assert!(start.elapsed() >= Duration::from_millis(200) && start.elapsed() < SOON);
    let start = Instant::now();
    (0..100).for_each(|_| assert!(matches!(card.mistakes(), Err(Error::CardDead { .. }))));
    assert!(start.elapsed() < SOON / 2, "no call waits for a silent card twice");
    faults.silent.store(false, Ordering::Relaxed);
    while fake.frames().is_empty() {
        thread::sleep(Duration::from_millis(1));
    }
    // The reply is on its way, too late.
    let start = Instant::now();
    for _ in 0..100 {
        assert!(matches!(card.mistakes(), Err(Error::CardDead { .. })));
        assert!(matches!(card.reset(), Err(Error::CardDead { .. })));
    }
    drop(card);
    assert!(start.elapsed() < SOON / 2, "no call waits for a dead card");
}

#[test]
fn memory_without_a_descriptor_or_with_too_short_a_file_is_refused() {
    let unmapped = Setup { unmapped: Some(5), ..Setup::default() };
    let short = Faults { short_file: Some(5), ..Faults::default() };
    for (setup, faults) in [(unmapped, Faults::default()), (Setup::default(), short)] {
        let (transport, ..) = serve(setup, faults, SOON);
        let error = Card::open(Box::new(transport)).unwrap_err();
        assert_eq!(error.to_string(), "BAR 5 (section memory) is not mapped into this process");
    }
}

#[test]
fn refusals_that_the_protocol_client_hides_are_noticed() {
    for (faults, completion) in [
        (Faults { refuses_maps: true, ..Faults::default() }, Completion::InterruptAndRegisters),
        (Faults { ignores_triggers: true, ..Faults::default() }, Completion::PollCopy),
        (Faults { no_interrupts: true, ..Faults::default() }, Completion::PollCopy),
    ] {
        let (transport, ..) = serve(Setup::default(), faults, SOON);
        let card = Card::open(Box::new(transport)).unwrap();
        assert_eq!(card.completion(), completion);
        let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
        let ticket = card.submit(&plane, &FrameRegisters::default()).unwrap();
        card.wait(ticket, SOON).unwrap();
    }
    let faults = Faults { keeps_command_at_reset: true, ..Faults::default() };
    let (transport, ..) = serve(Setup::default(), faults, SOON);
    assert!(matches!(Card::open(Box::new(transport)), Err(Error::Command { after: "reset", .. })));
}

#[test]
fn a_card_behind_a_socket_does_everything() {
    let (transport, fake, _) = serve(Setup::default(), Faults::default(), SOON);
    let card = Card::open(Box::new(transport)).unwrap();
    assert_eq!(card.completion(), Completion::Interrupt);
    let volume = card.allocate_volume([40, 30, 20], VoxelFormat::Uint8).unwrap();
    let voxels: Vec<u8> = (0..40 * 30 * 20).map(|index| index as u8).collect();
    card.upload(&volume, &volume.whole(), &voxels).unwrap();
    let mut back = vec![0; voxels.len()];
    card.download(&volume, &volume.whole(), &mut back).unwrap();
    assert_eq!(back, voxels);

    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let mut wanted = FrameRegisters::default();
    volume.bind(&volume.whole(), &mut wanted).unwrap();
    for number in 0..10 {
        wanted.set(start_x::POSITION, number);
        fake.take_writes();
        let reads = fake.reads();
        let ticket = card.submit(&plane, &wanted).unwrap();
        card.wait(ticket, SOON).unwrap();
        assert!(number == 0 || fake.take_writes().len() == 1);
        assert_eq!(fake.reads(), reads);
        assert_eq!(fake.frames().last().unwrap().get(start_x::POSITION), number);
    }

    let target = card.host_memory(5000).unwrap();
    assert_eq!(target.view().size(), 8192);
    fake.view(4).write(0, &[1, 2, 3, 4]).unwrap();
    card.transfer(&plane, Rectangle::of_size(1, 1), PixelFormat::Rgba8, &*target, 0, 4).unwrap();
    assert_eq!(target.view().read_u32(0).unwrap(), 0x0403_0201);
    assert_eq!(fake.mapped().len(), 2);
    drop(target);
    assert_eq!(fake.mapped().len(), 1, "only the copy of the status is left");
    drop(card);
    assert_eq!(fake.mapped().len(), 0);
    fake.check_driver();
}

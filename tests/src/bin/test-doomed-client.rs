//! A client that dies in the midst of rendering: `test-doomed-client SOCKET N` aborts its process instead of its
//! N-th message, and exits with 0 if it has rendered before.

use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use vg500_regs::SharedView;
use vli::geometry::{Accumulation, Supersampling};
use vli::{Board, Context, LookupTable, Volume, Voxels};
use volumepro_driver::{Card, Error, HostMemory, Transport, VfioUser};

/// A transport that lives for so many messages.
struct Doomed {
    transport: VfioUser,
    left: AtomicU64,
}

impl Doomed {
    fn count(&self) {
        if self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            std::process::abort();
        }
    }
}

impl Transport for Doomed {
    fn read_config(&self, offset: u16) -> Result<u32, Error> {
        self.count();
        self.transport.read_config(offset)
    }
    fn write_config(&self, offset: u16, word: u16) -> Result<(), Error> {
        self.count();
        self.transport.write_config(offset, word)
    }
    fn bar_size(&self, index: u32) -> u64 {
        self.transport.bar_size(index)
    }
    fn memory(&self, index: u32) -> Option<SharedView<'_>> {
        self.transport.memory(index)
    }
    fn read_registers(&self, offset: u32, words: &mut [u32]) -> Result<(), Error> {
        self.count();
        self.transport.read_registers(offset, words)
    }
    fn write_registers(&self, offset: u32, words: &[u32]) -> Result<(), Error> {
        self.count();
        self.transport.write_registers(offset, words)
    }
    fn bursts(&self) -> bool {
        self.transport.bursts()
    }
    fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        self.count();
        self.transport.host_memory(bytes)
    }
    fn interrupts(&self) -> Result<Vec<OwnedFd>, Error> {
        self.count();
        self.transport.interrupts()
    }
    fn reset(&self) -> Result<(), Error> {
        self.count();
        self.transport.reset()
    }
}

fn render(socket: &Path, messages: u64) -> Result<(), Box<dyn std::error::Error>> {
    let transport = VfioUser::connect(socket, Duration::from_secs(20))?;
    let doomed = Doomed { transport, left: AtomicU64::new(messages) };
    let mut board = Board::new(Card::open(Box::new(doomed))?);
    let volume = Volume::new([40; 3], Voxels::Uint8(vec![99; 64_000].into()))?;
    let mut context = Context::new(LookupTable::ramp(256).ok_or("no table")?);
    context.supersampling = Supersampling::new([5, 5, 8], Accumulation::Blend)?;
    board.render(&context, &volume)?;
    Ok(())
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (Some(socket), Some(messages)) =
        (arguments.next(), arguments.next().and_then(|word| word.parse().ok()))
    else {
        eprintln!("usage: test-doomed-client SOCKET N");
        return ExitCode::from(2);
    };
    match render(Path::new(&socket), messages) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("test-doomed-client: {error}");
            ExitCode::FAILURE
        }
    }
}

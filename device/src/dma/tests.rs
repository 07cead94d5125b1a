//! The table against real files, and against clients that take their memory away.

use std::fs::{read_dir, read_link, read_to_string};
use std::sync::Barrier;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{scope, sleep};

use proptest::prelude::*;
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, ftruncate, memfd_create};
use rustix::io::{dup, pread, pwrite};

use super::*;

const READ: Access = Access { read: true, write: false };
const WRITE: Access = Access { read: false, write: true };
const BOTH: Access = Access { read: true, write: true };

fn table() -> Arc<DmaTable> {
    let command = Arc::new(CommandRegister::default());
    command.set(CommandRegister::BUS_MASTER);
    Arc::new(DmaTable::new(command))
}

fn unsealed(name: &str, pages: u64) -> OwnedFd {
    let file = memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING).unwrap();
    ftruncate(&file, pages * PAGE).unwrap();
    file
}

fn sealed(name: &str, pages: u64) -> OwnedFd {
    let file = unsealed(name, pages);
    fcntl_add_seals(&file, SealFlags::SHRINK).unwrap();
    file
}

fn file(descriptor: &OwnedFd, offset: u64) -> Memory {
    Memory::File { descriptor: dup(descriptor).unwrap(), offset }
}

fn bytes(file: &OwnedFd, offset: u64, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    assert_eq!(pread(file, &mut bytes, offset).unwrap(), length);
    bytes
}

/// A client that answers messages with the low byte of the address, or never.
#[derive(Debug, Default)]
struct Messenger {
    silent: bool,
    aborted: Mutex<bool>,
    wake: std::sync::Condvar,
    waiting: AtomicBool,
    written: Mutex<Vec<(u64, Vec<u8>)>>,
}

impl Messenger {
    fn answer(&self) -> Result<(), Errno> {
        self.waiting.store(true, Ordering::SeqCst);
        if self.silent {
            drop(self.wake.wait_while(self.aborted.lock().unwrap(), |aborted| !*aborted).unwrap());
            return Err(Errno::CANCELED);
        }
        Ok(())
    }
}

impl ClientMemory for Messenger {
    fn read(&self, iova: u64, data: &mut [u8]) -> Result<(), Errno> {
        self.answer()?;
        data.iter_mut().zip(iova..).for_each(|(byte, iova)| *byte = iova as u8);
        Ok(())
    }

    fn write(&self, iova: u64, data: &[u8]) -> Result<(), Errno> {
        self.answer()?;
        self.written.lock().unwrap().push((iova, data.to_vec()));
        Ok(())
    }

    fn abort(&self) {
        *self.aborted.lock().unwrap() = true;
        self.wake.notify_all();
    }
}

#[test]
fn bad_ranges_are_refused() {
    let dma = table();
    let memory = sealed("bad", 4);
    for (base, size, offset) in [
        (u64::MAX, u64::MAX, 0),
        (0, u64::MAX, 0),
        (0, 0, 0),
        (1, PAGE, 0),
        (0, PAGE - 1, 0),
        (0, PAGE, 1),
        (u64::MAX - PAGE + 1, 2 * PAGE, 0),
        (0, 5 * PAGE, 0),
        (0, PAGE, 4 * PAGE),
        (0, PAGE, 1 << 40),
        (0, PAGE, u64::MAX - PAGE + 1),
        (0, MAX_REGION_SIZE + PAGE, 0),
    ] {
        assert_eq!(
            dma.map(base, size, BOTH, file(&memory, offset)),
            Err(Errno::INVAL),
            "{base:#x} {size:#x} {offset:#x}"
        );
    }
    assert_eq!(dma.map(0, PAGE, Access { read: false, write: false }, file(&memory, 0)), Err(Errno::INVAL));
    for (base, size) in [(0, 0), (2, u64::MAX), (u64::MAX, 2)] {
        assert_eq!(dma.unmap(base, size), Err(Errno::INVAL));
    }
    assert!(dma.is_empty());
    dma.map(u64::MAX - PAGE + 1, PAGE, BOTH, file(&memory, 0)).unwrap();
    assert_eq!(dma.write(u64::MAX, &[1, 2]), Err(DmaError::Wraps { iova: u64::MAX, length: 2 }));
    dma.write(u64::MAX, &[1]).unwrap();
}

#[test]
fn descriptors_that_are_not_files_are_refused() {
    let dma = table();
    let (reader, _writer) = std::io::pipe().unwrap();
    let (socket, _peer) = std::os::unix::net::UnixStream::pair().unwrap();
    let directory = std::fs::File::open("/proc/self").unwrap();
    let device = std::fs::File::open("/dev/zero").unwrap();
    for descriptor in [reader.into(), OwnedFd::from(socket), directory.into(), device.into()] {
        assert_eq!(dma.map(0, PAGE, READ, Memory::File { descriptor, offset: 0 }), Err(Errno::INVAL));
    }
    let path = tempfile::NamedTempFile::new().unwrap();
    path.as_file().set_len(PAGE).unwrap();
    let read_only = || OwnedFd::from(std::fs::File::open(path.path()).unwrap());
    assert_eq!(
        dma.map(0, PAGE, BOTH, Memory::File { descriptor: read_only(), offset: 0 }),
        Err(Errno::ACCESS)
    );
    assert_eq!(dma.map(0, PAGE, READ, Memory::File { descriptor: read_only(), offset: 0 }), Ok(()));
}

#[test]
fn overlaps_are_refused() {
    let dma = table();
    let memory = sealed("overlap", 4);
    dma.map(4 * PAGE, 2 * PAGE, BOTH, file(&memory, 0)).unwrap();
    for (first, pages) in [(4, 2), (4, 1), (5, 1), (3, 2), (5, 2), (3, 4)] {
        assert_eq!(dma.map(first * PAGE, pages * PAGE, BOTH, file(&memory, 0)), Err(Errno::EXIST));
    }
    dma.map(3 * PAGE, PAGE, BOTH, file(&memory, 0)).unwrap();
    dma.map(6 * PAGE, PAGE, BOTH, file(&memory, 0)).unwrap();
    assert_eq!(dma.len(), 3);
}

#[test]
fn regions_and_files_are_limited() {
    let dma = table();
    let files: Vec<_> = (0..=MAX_FILES).map(|_| sealed("limit", 1)).collect();
    for (index, memory) in files.iter().enumerate() {
        let full = if index < MAX_FILES { Ok(()) } else { Err(Errno::NOSPC) };
        assert_eq!(dma.map(index as u64 * PAGE, PAGE, BOTH, file(memory, 0)), full);
    }
    // Once a file is unmapped, another one may come.
    dma.unmap(0, PAGE).unwrap();
    dma.map(0, PAGE, BOTH, file(&files[MAX_FILES], 0)).unwrap();
    for index in MAX_FILES..MAX_REGIONS {
        dma.map(index as u64 * PAGE, PAGE, BOTH, file(&files[1], 0)).unwrap();
    }
    assert_eq!(dma.map(1 << 50, PAGE, BOTH, file(&files[1], 0)), Err(Errno::NOSPC));
    dma.clear();
    assert!(dma.is_empty());
}

#[test]
fn one_file_takes_one_mapping_and_no_descriptor() {
    const NAME: &str = "one-mapping-per-file";
    let mappings = || read_to_string("/proc/self/maps").unwrap().matches(NAME).count();
    let descriptors = || {
        let links = read_dir("/proc/self/fd").unwrap().filter_map(|entry| read_link(entry.ok()?.path()).ok());
        links.filter(|link| link.to_string_lossy().contains(NAME)).count()
    };
    let dma = table();
    let memory = sealed(NAME, 64);
    for page in 0..64 {
        dma.map(page * PAGE, PAGE, BOTH, file(&memory, (63 - page) * PAGE)).unwrap();
    }
    assert_eq!((mappings(), descriptors()), (1, 1), "the descriptor is the client's own");
    dma.unmap(0, 64 * PAGE).unwrap();
    assert_eq!((mappings(), descriptors()), (0, 1));
}

#[test]
fn a_file_that_grew_is_mapped_again() {
    let dma = table();
    let memory = sealed("grows", 1);
    dma.map(0, PAGE, BOTH, file(&memory, 0)).unwrap();
    ftruncate(&memory, 3 * PAGE).unwrap();
    dma.map(PAGE, 2 * PAGE, BOTH, file(&memory, PAGE)).unwrap();
    dma.write(PAGE - 1, &[1, 2]).unwrap();
    assert_eq!(bytes(&memory, PAGE - 1, 2), [1, 2]);
}

#[test]
fn a_file_that_keeps_growing_does_not_fill_the_address_space() {
    const NAME: &str = "keeps-growing";
    let mappings = || read_to_string("/proc/self/maps").unwrap().matches(NAME).count();
    let dma = table();
    let memory = sealed(NAME, 1);
    for page in 0..2 * MAX_FILES as u64 {
        ftruncate(&memory, (page + 1) * PAGE).unwrap();
        let full = if page < MAX_FILES as u64 { Ok(()) } else { Err(Errno::NOSPC) };
        assert_eq!(dma.map(page * PAGE, PAGE, BOTH, file(&memory, page * PAGE)), full, "{page}");
    }
    assert_eq!(mappings(), MAX_FILES);
    dma.clear();
    assert_eq!(mappings(), 0);
}

#[test]
fn huge_files_are_reached_and_not_mapped() {
    const NAME: &str = "huge-file";
    let dma = table();
    let memory = sealed(NAME, (MAX_REGION_SIZE << 5) / PAGE);
    dma.map(0, MAX_REGION_SIZE, BOTH, file(&memory, MAX_REGION_SIZE)).unwrap();
    assert!(!read_to_string("/proc/self/maps").unwrap().contains(NAME));
    dma.write(MAX_REGION_SIZE - 4, &[1, 2, 3, 4]).unwrap();
    assert_eq!(bytes(&memory, 2 * MAX_REGION_SIZE - 4, 4), [1, 2, 3, 4]);
}

#[test]
fn a_client_that_shortens_its_file_gets_errors_not_our_death() {
    let dma = table();
    let memory = unsealed("shortened", 2);
    dma.map(0, 2 * PAGE, BOTH, file(&memory, 0)).unwrap();
    dma.write(PAGE, &[1; 8]).unwrap();
    assert_eq!(bytes(&memory, PAGE, 8), [1; 8]);
    ftruncate(&memory, PAGE).unwrap();
    let mut data = [0; 8];
    assert_eq!(dma.read(PAGE, &mut data), Err(DmaError::Failed { iova: PAGE, errno: Errno::FAULT }));
    dma.read(0, &mut data).unwrap();
}

#[test]
fn accesses_need_memory_permission_and_bus_master_enable() {
    let command = Arc::new(CommandRegister::default());
    let dma = Arc::new(DmaTable::new(Arc::clone(&command)));
    let memory = sealed("permission", 2);
    dma.map(0, PAGE, READ, file(&memory, 0)).unwrap();
    dma.map(PAGE, PAGE, WRITE, file(&memory, PAGE)).unwrap();
    let mut data = [0; 4];
    assert_eq!(dma.read(0, &mut data), Err(DmaError::BusMasterDisabled));
    assert_eq!(dma.lease(0, 4, Direction::Read).err(), Some(DmaError::BusMasterDisabled));
    command.set(CommandRegister::BUS_MASTER);
    dma.read(0, &mut data).unwrap();
    dma.write(PAGE, &data).unwrap();
    let denied = |iova, direction| Err(DmaError::NotAllowed { iova, direction });
    assert_eq!(dma.read(PAGE - 2, &mut data), denied(PAGE, Direction::Read));
    assert_eq!(dma.write(PAGE - 2, &data), denied(PAGE - 2, Direction::Write));
    assert_eq!(dma.write(2 * PAGE - 2, &data), Err(DmaError::NotMapped { iova: 2 * PAGE }));
    assert_eq!(dma.lease(0, PAGE + 1, Direction::Read).err(), denied(PAGE, Direction::Read).err());
    assert_eq!(dma.lease(0, u64::MAX, Direction::Read).err(), denied(PAGE, Direction::Read).err());
    let lease = dma.lease(8, 8, Direction::Read).unwrap();
    lease.read(4, &mut data).unwrap();
    assert_eq!(lease.read(5, &mut data), Err(DmaError::NotMapped { iova: 16 }));
    assert_eq!(lease.read(u64::MAX, &mut data), Err(DmaError::NotMapped { iova: 16 }));
    assert_eq!(lease.write(0, &data), denied(8, Direction::Write));
    command.set(0);
    assert_eq!(lease.read(0, &mut data), Err(DmaError::BusMasterDisabled));
}

#[test]
fn unmapping_takes_ranges_that_match_no_map() {
    let dma = table();
    let memory = sealed("ranges", 4);
    for page in [0, 1, 2, (1 << 52) - 1] {
        dma.map(page * PAGE, PAGE, BOTH, file(&memory, 0)).unwrap();
    }
    dma.map(8 * PAGE, 2 * PAGE, BOTH, file(&memory, 0)).unwrap();
    dma.unmap(3 * PAGE, 2 * PAGE).unwrap();
    dma.unmap(9 * PAGE, PAGE).unwrap();
    assert_eq!(dma.len(), 5, "nothing lay inside");
    dma.unmap(PAGE, 4 * PAGE).unwrap();
    assert_eq!(dma.len(), 3);
    dma.unmap(0xfef0_0000, 0xffff_ffff_0110_0000).unwrap();
    assert_eq!(dma.len(), 2, "the range ends with the address space");
    dma.unmap(0, 0x8000_0000).unwrap();
    assert!(dma.is_empty());
}

#[test]
fn unmapping_waits_for_a_lease_and_asks_it_to_end() {
    let dma = table();
    let memory = sealed("lease", 2);
    dma.map(0, 2 * PAGE, BOTH, file(&memory, 0)).unwrap();
    let asked = Arc::new(AtomicUsize::new(0));
    let hook = Arc::clone(&asked);
    dma.on_unmap(move || _ = hook.fetch_add(1, Ordering::SeqCst));
    let lease = dma.lease(PAGE - 8, 16, Direction::Write).unwrap();
    let (began, ready) = (Instant::now(), Barrier::new(2));
    scope(|scope| {
        scope.spawn(|| {
            ready.wait();
            while asked.load(Ordering::SeqCst) == 0 {
                std::hint::spin_loop();
            }
            sleep(Duration::from_millis(100));
            lease.write(0, &[7; 16]).unwrap();
            drop(lease);
        });
        ready.wait();
        dma.unmap(0, 2 * PAGE).unwrap();
        assert_eq!(bytes(&memory, PAGE - 8, 16), [7; 16], "the transfer came to its end before");
    });
    assert!((Duration::from_millis(100)..PATIENCE).contains(&began.elapsed()));
    assert_eq!(asked.load(Ordering::SeqCst), 1);
    assert!(dma.lease(0, 1, Direction::Read).is_err());
}

#[test]
fn a_lease_that_does_not_end_loses_its_memory() {
    let dma = table();
    let memory = sealed("stubborn", 1);
    dma.map(0, PAGE, BOTH, file(&memory, 0)).unwrap();
    let lease = dma.lease(0, PAGE, Direction::Write).unwrap();
    let stop = AtomicBool::new(false);
    scope(|scope| {
        scope.spawn(|| {
            // Writes without a pause.
            while !stop.load(Ordering::SeqCst) {
                _ = lease.write(0, &[1; PAGE as usize]);
            }
        });
        let began = Instant::now();
        dma.unmap(0, PAGE).unwrap();
        assert!((PATIENCE..2 * PATIENCE).contains(&began.elapsed()));
        pwrite(&memory, &[0; PAGE as usize], 0).unwrap();
        sleep(Duration::from_millis(20));
        assert!(bytes(&memory, 0, PAGE as usize).iter().all(|&byte| byte == 0), "written after the unmap");
        stop.store(true, Ordering::SeqCst);
    });
    assert_eq!(lease.write(0, &[1]), Err(DmaError::Revoked { iova: 0 }));
}

#[test]
fn memory_without_descriptor_is_reached_by_messages() {
    let dma = table();
    let client = Arc::new(Messenger::default());
    let memory = sealed("mixed", 1);
    dma.map(0, PAGE, BOTH, Memory::Messages(client.clone())).unwrap();
    dma.map(PAGE, PAGE, BOTH, file(&memory, 0)).unwrap();
    let mut data = [0; 6];
    dma.read(PAGE - 3, &mut data).unwrap();
    assert_eq!(data, [0xfd, 0xfe, 0xff, 0, 0, 0]);
    dma.write(PAGE - 1, &[5, 6]).unwrap();
    assert_eq!(*client.written.lock().unwrap(), [(PAGE - 1, vec![5])]);
    assert_eq!(bytes(&memory, 0, 1), [6]);
}

#[test]
fn unmapping_ends_an_access_that_waits_for_a_message() {
    let dma = table();
    let client = Arc::new(Messenger { silent: true, ..Messenger::default() });
    dma.map(0, PAGE, BOTH, Memory::Messages(client.clone())).unwrap();
    scope(|scope| {
        let access = scope.spawn(|| dma.read(0, &mut [0; 4]));
        while !client.waiting.load(Ordering::SeqCst) {
            std::hint::spin_loop();
        }
        let began = Instant::now();
        dma.clear();
        assert!(began.elapsed() < PATIENCE / 2);
        let failed = DmaError::Failed { iova: 0, errno: Errno::CANCELED };
        assert_eq!(access.join().unwrap(), Err(failed));
    });
}

#[test]
fn a_suspension_ends_accesses_and_keeps_the_memory() {
    let dma = table();
    let client = Arc::new(Messenger { silent: true, ..Messenger::default() });
    let memory = sealed("suspended", 1);
    dma.map(0, PAGE, BOTH, Memory::Messages(client.clone())).unwrap();
    dma.map(PAGE, PAGE, BOTH, file(&memory, 0)).unwrap();
    let lease = dma.lease(PAGE, 1, Direction::Write).unwrap();
    scope(|scope| {
        let access = scope.spawn(|| dma.read(0, &mut [0; 4]));
        while !client.waiting.load(Ordering::SeqCst) {
            std::hint::spin_loop();
        }
        let outer = dma.suspend();
        drop(dma.suspend());
        assert_eq!(dma.write(PAGE, &[1]), Err(DmaError::Suspended));
        assert_eq!(lease.write(0, &[1]), Err(DmaError::Suspended));
        drop(outer);
        assert!(access.join().unwrap().is_err());
    });
    lease.write(0, &[1]).unwrap();
    assert_eq!(bytes(&memory, 0, 1), [1]);
}

#[test]
fn mapping_while_another_thread_transfers_never_tears_a_page() {
    let dma = table();
    let files = [sealed("one", 1), sealed("two", 1)];
    for (value, memory) in files.iter().enumerate() {
        pwrite(memory, &[value as u8 + 1; PAGE as usize], 0).unwrap();
    }
    let stop = AtomicBool::new(false);
    scope(|scope| {
        scope.spawn(|| {
            let mut page = [0; PAGE as usize];
            while !stop.load(Ordering::SeqCst) {
                if dma.read(0, &mut page).is_ok() {
                    assert!(page.iter().all(|&byte| byte == page[0]) && page[0] != 0);
                }
            }
        });
        for turn in 0..2000 {
            dma.map(0, PAGE, BOTH, file(&files[turn % 2], 0)).unwrap();
            dma.unmap(0, PAGE).unwrap();
        }
        stop.store(true, Ordering::SeqCst);
    });
}

/// What a sequence of operations can do, in pages.
#[derive(Clone, Debug)]
enum Operation {
    Map { first: u64, pages: u64, offset: u64 },
    Unmap { first: u64, pages: u64 },
    Write { iova: u64, length: usize, value: u8 },
}

fn operation() -> impl Strategy<Value = Operation> {
    prop_oneof![
        (0..16u64, 1..5u64, 0..16u64).prop_map(|(first, pages, offset)| Operation::Map {
            first,
            pages,
            offset
        }),
        (0..16u64, 1..8u64).prop_map(|(first, pages)| Operation::Unmap { first, pages }),
        (0..16 * PAGE, 0..10_000usize, any::<u8>()).prop_map(|(iova, length, value)| Operation::Write {
            iova,
            length,
            value
        }),
    ]
}

proptest! {
    #[test]
    fn the_table_agrees_with_a_page_by_page_model(operations in prop::collection::vec(operation(), 1..60)) {
        let dma = table();
        let memory = sealed("model", 16);
        let mut expected = vec![0u8; 16 * PAGE as usize];
        // For each page of IOVA: which region it belongs to, and its page in the file.
        let mut pages: Vec<Option<(usize, u64)>> = vec![None; 32];
        for (name, operation) in operations.into_iter().enumerate() {
            match operation {
                Operation::Map { first, pages: count, offset } => {
                    let range = first as usize..(first + count) as usize;
                    let result = dma.map(first * PAGE, count * PAGE, BOTH, file(&memory, offset * PAGE));
                    let outcome = if pages[range.clone()].iter().any(Option::is_some) {
                        Err(Errno::EXIST)
                    } else if offset + count > 16 {
                        Err(Errno::INVAL)
                    } else {
                        pages[range].iter_mut().zip(offset..).for_each(|(page, at)| *page = Some((name, at)));
                        Ok(())
                    };
                    prop_assert_eq!(result, outcome);
                }
                Operation::Unmap { first, pages: count } => {
                    dma.unmap(first * PAGE, count * PAGE).unwrap();
                    let range = first as usize..(first + count) as usize;
                    for page in range.clone() {
                        if let Some((name, _)) = pages[page] {
                            let whole = (0..32).filter(|&at| pages[at].is_some_and(|it| it.0 == name));
                            if whole.clone().all(|at| range.contains(&at)) {
                                whole.collect::<Vec<_>>().into_iter().for_each(|at| pages[at] = None);
                            }
                        }
                    }
                }
                Operation::Write { iova, length, value } => {
                    let result = dma.write(iova, &vec![value; length]);
                    let mut outcome = Ok(());
                    for byte in iova..iova + length as u64 {
                        let Some((_, page)) = pages[(byte / PAGE) as usize] else {
                            outcome = Err(DmaError::NotMapped { iova: byte });
                            break;
                        };
                        expected[(page * PAGE + byte % PAGE) as usize] = value;
                    }
                    prop_assert_eq!(result, outcome);
                }
            }
        }
        prop_assert!(bytes(&memory, 0, expected.len()) == expected);
    }
}

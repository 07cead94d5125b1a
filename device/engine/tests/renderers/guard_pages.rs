//! The optimised renderer reads no byte before or behind voxel memory, whose last row it reads in whole vectors.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::optimised::random_tables;
use crate::scene::{LIT, Scene, UNLIT, VOXEL};
use rustix::mm::{MapFlags, MprotectFlags, ProtFlags, mmap_anonymous, mprotect, munmap};
use std::ptr::NonNull;
use vg500_engine::{Cancel, Level, Memories, Renderer};
use vg500_regs::{BlendMode, Permutation, SharedView, VoxelFormat};

const PAGE: usize = 4096;

/// Bytes between two pages that nobody may touch; the last byte lies right before the second one.
struct Guarded {
    map: NonNull<u8>,
    pages: usize,
    size: usize,
}

impl Guarded {
    /// A copy of some bytes. They begin at a page, too, if they are a multiple of pages.
    fn new(bytes: &[u8]) -> Self {
        let pages = bytes.len().div_ceil(PAGE) + 2;
        // SAFETY: a new mapping, which nothing else knows; the part between the outer pages is made accessible.
        let map = unsafe {
            let map =
                mmap_anonymous(core::ptr::null_mut(), pages * PAGE, ProtFlags::empty(), MapFlags::PRIVATE);
            let map = map.unwrap().cast::<u8>();
            let access = MprotectFlags::READ | MprotectFlags::WRITE;
            mprotect(map.add(PAGE).cast(), (pages - 2) * PAGE, access).unwrap();
            NonNull::new(map).unwrap()
        };
        let guarded = Self { map, pages, size: bytes.len() };
        guarded.view().write(0, bytes).unwrap();
        guarded
    }

    fn view(&self) -> SharedView<'_> {
        // SAFETY: these bytes are mapped as long as this lives, and there is no reference to them.
        unsafe { SharedView::new(self.map.add((self.pages - 1) * PAGE - self.size), self.size) }
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        // SAFETY: the mapping that `new` made; views of it have ended.
        unsafe { munmap(self.map.as_ptr().cast(), self.pages * PAGE).unwrap() };
    }
}

/// Renders a volume that ends with voxel memory, and compares it with the reference.
fn compare_at_the_end(size: [usize; 3], format: VoxelFormat, words: &[u32], chance: &mut Chance) {
    let mut card = Card::with_tables();
    random_tables(chance, &mut card);
    let mut grid = Grid::noise(size, chance);
    grid.format = format;
    if format == VoxelFormat::Uint8 {
        grid.voxels.iter_mut().for_each(|voxel| *voxel >>= 4);
    }
    // Views begin at multiples of eight bytes.
    let probe = Card::with_tables().load(&grid);
    let last = ((size[2] - 1) * probe.slice_rows + size[1] - 1) * probe.row_pitch + size[0];
    let length = last * format.bytes();
    card.voxels = vec![0xa5; length.next_multiple_of(8) - length];
    let store = card.load(&grid);
    card.voxels.truncate(store.base + length);
    let guarded = Guarded::new(&card.voxels);
    for &word in words {
        for (illumination, blend) in
            [(UNLIT, BlendMode::Alpha), (LIT, BlendMode::Alpha), (UNLIT, BlendMode::Maximum)]
        {
            let permutation = Permutation::from_word(word).unwrap();
            let step = [VOXEL / 3, VOXEL / 5];
            let scene = Scene { permutation, illumination, blend, step, ..Scene::new(store) }.with_all_rays();
            let task = card.task(&scene).unwrap();
            let expected = card.run(&task, &Cancel::default()).unwrap().checksum;
            for level in Level::all() {
                let memories = Memories { voxel: guarded.view(), ..card.memories() };
                let renderer = Renderer::Optimised { level, threads: 1 };
                let found = renderer.render(&task, memories, &Cancel::default()).unwrap().checksum;
                assert_eq!(found, expected, "{}: {size:?} {format:?} {word:#x} {blend:?}", level.name());
            }
        }
    }
}

#[test]
fn volumes_that_end_with_voxel_memory() {
    const FORMATS: [VoxelFormat; 3] =
        [VoxelFormat::Uint8, VoxelFormat::Uint12Lower, VoxelFormat::Uint12Upper];
    const PERMUTATIONS: [u32; 6] = [0x210, 0x654, 0x120, 0x564, 0x012, 0x456];
    let mut chance = Chance::new(31);
    // Every remainder of a vector along each axis.
    for length in (1..=65).chain([127, 128, 129, 255, 256]) {
        let format = FORMATS[length % 3];
        let words = &PERMUTATIONS[2 * (length / 3 % 3)..][..2];
        for size in [[length, 2, 3], [3, length, 2], [2, 3, length]] {
            compare_at_the_end(size, format, words, &mut chance);
        }
    }
    for format in FORMATS {
        compare_at_the_end([33, 17, 19], format, &PERMUTATIONS, &mut chance);
    }
}

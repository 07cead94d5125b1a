//! The register window: every width, every alignment, every word.

use vg500_regs::pci::{BARS, MSIX_PENDING_OFFSET, MSIX_TABLE_OFFSET, REGISTERS as WINDOW};
use vg500_regs::table::{self, *};
use vg500_regs::{Access, Register};

use super::rig::Rig;
use crate::config::Config;
use crate::protocol::{Device, region};
use vg500_engine::Renderer;

/// Registers whose words other accesses change.
fn is_quiet(register: &Register) -> bool {
    let counters = [trapped_reads::REGISTER.offset, trapped_writes::REGISTER.offset];
    register.access == Access::ReadOnly && !counters.contains(&register.offset)
}

/// What a word reads as.
fn expected(rig: &mut Rig, offset: u32) -> u32 {
    match table::find(offset) {
        None => 0,
        Some((register, _)) if register.access == Access::WriteOnly => u32::MAX,
        Some(_) => rig.read_at(offset),
    }
}

#[test]
fn reads_of_every_width_and_alignment_give_the_bytes_of_the_words() {
    let mut rig = Rig::new();
    let ends = (0..0x1900).chain(MSIX_TABLE_OFFSET - 8..MSIX_TABLE_OFFSET + 56);
    for offset in ends.chain(MSIX_PENDING_OFFSET - 4..MSIX_PENDING_OFFSET + 12).chain(0xfff0..0x1_0000) {
        for width in [1, 2, 3, 4, 5, 8].into_iter().filter(|width| offset + width <= 0x1_0000) {
            let words = offset / 4..=(offset + width - 1) / 4;
            let quiet = words.clone().all(|word| {
                word * 4 >= MSIX_TABLE_OFFSET
                    || table::find(word * 4)
                        .is_none_or(|(it, _)| it.access == Access::WriteOnly || is_quiet(it))
            });
            if !quiet {
                continue;
            }
            let word = |word: u32| match word * 4 {
                at @ ..MSIX_TABLE_OFFSET => expected(&mut rig, at),
                at => rig.read_at(at),
            };
            let bytes: Vec<u8> = words.map(word).flat_map(u32::to_le_bytes).collect();
            let skip = (offset % 4) as usize;
            let found = rig.read_bytes(offset, width as usize);
            assert_eq!(found, bytes[skip..skip + width as usize], "{width} bytes at {offset:#x}");
        }
    }
}

#[test]
fn writes_of_parts_of_words_change_nothing() {
    let mut rig = Rig::new();
    let before = rig.card.board.look(|state| state.registers().clone());
    for offset in 0..0x1900u32 {
        for width in 1..=7 {
            let whole = (offset..offset + width).any(|at| at % 4 == 0 && at + 4 <= offset + width);
            if !whole {
                rig.write_bytes(offset, &vec![0xff; width as usize]);
            }
        }
    }
    rig.card.board.look(|state| {
        assert!((0..0x1900).step_by(4).all(|at| state.registers().word(at) == before.word(at)));
    });
}

#[test]
fn every_word_obeys_its_access() {
    let mut rig = Rig::new();
    for offset in (0..MSIX_TABLE_OFFSET).step_by(4) {
        let before = rig.card.board.look(|state| state.registers().word(offset));
        rig.write_bytes(offset, &0x0001_0203u32.to_le_bytes());
        let after = rig.card.board.look(|state| state.registers().word(offset));
        match table::find(offset) {
            None => assert_eq!((rig.read_at(offset), after), (0, 0)),
            Some((register, _)) if register.access == Access::WriteOnly => {
                assert_eq!(rig.read_at(offset), u32::MAX, "{}", register.name);
                assert_eq!(after, 0x0001_0203 & register.mask(), "{}", register.name);
            }
            Some((register, _)) if is_quiet(register) => assert_eq!(after, before, "{}", register.name),
            Some(_) => assert_eq!(after, 0),
        }
    }
}

#[test]
fn one_message_writes_consecutive_words_from_the_lowest_on() {
    let mut rig = Rig::new();
    let mut burst = Vec::new();
    [0x11u32, 0x22, 0x33].iter().for_each(|word| burst.extend(word.to_le_bytes()));
    // Two bytes before and three behind belong to words that are not written whole.
    rig.write_bytes(volume_base::REGISTER.offset - 2, &[&[9, 9], &burst[..], &[9, 9, 9]].concat());
    rig.card.board.look(|state| {
        assert_eq!(state.registers().word(volume_base::REGISTER.offset), 0x11);
        assert_eq!(state.registers().word(volume_format::REGISTER.offset), 0x22 & 3);
        assert_eq!(state.registers().word(volume_size_z::REGISTER.offset), 0);
    });
    let reads = rig.read(trapped_writes::REGISTER);
    rig.write_bytes(0, &[0; 0x8000]);
    assert_eq!(rig.read(trapped_writes::REGISTER), reads + 1, "messages are counted, not words");
}

#[test]
fn without_memory_space_nothing_answers() {
    let mut rig = Rig::new();
    rig.card.write(region::CONFIG, 4, &[4, 0]).unwrap();
    for bar in BARS {
        let mut data = [0; 6];
        rig.card.read(bar.index as usize, 1, &mut data).unwrap();
        assert_eq!(data, [0xff; 6]);
        rig.card.write(bar.index as usize, 0, &[1; 8]).unwrap();
    }
    rig.enable();
    for bar in &BARS[1..] {
        let mut data = [9; 8];
        rig.card.read(bar.index as usize, 0, &mut data).unwrap();
        assert_eq!(data, [0; 8], "{}", bar.name);
    }
}

#[test]
fn regions_that_do_not_exist_are_refused() {
    let mut rig = Rig::new();
    for region in [3, 6, 8, 9, usize::MAX] {
        assert!(rig.card.read(region, 0, &mut [0]).is_err());
        assert!(rig.card.write(region, 0, &[0]).is_err());
    }
    assert!(rig.card.read(1, WINDOW.size, &mut [0]).is_err());
    assert!(rig.card.read(0, u64::MAX, &mut [0]).is_err());
}

#[test]
fn mapped_memories_can_be_reached_by_message_and_are_counted() {
    let mut rig = Rig::new();
    for bar in &BARS[1..] {
        let end = rig.card.regions()[bar.index as usize].size;
        rig.card.write(bar.index as usize, end - 5, &[1, 2, 3, 4, 5]).unwrap();
        let mut data = [0; 3];
        rig.card.read(bar.index as usize, end - 4, &mut data).unwrap();
        assert_eq!(data, [2, 3, 4]);
        assert_eq!(rig.read_at(trapped_writes::REGISTER.at(bar.index)), 1);
        assert_eq!(rig.read_at(trapped_reads::REGISTER.at(bar.index)), 1);
    }
    let mut byte = [0];
    let table = rig.card.memories.table.view();
    table.read(table.size() - 1, &mut byte).unwrap();
    assert_eq!(byte, [5]);
}

#[test]
fn the_msix_table_is_memory_and_the_pending_bits_are_not() {
    let mut rig = Rig::new();
    assert_eq!(rig.read_at(MSIX_TABLE_OFFSET + 12), 1, "vectors are masked after reset");
    rig.write_bytes(MSIX_TABLE_OFFSET + 4, &[1, 2, 3, 4, 5]);
    assert_eq!(rig.read_bytes(MSIX_TABLE_OFFSET + 3, 7), [0, 1, 2, 3, 4, 5, 0]);
    rig.write_bytes(MSIX_PENDING_OFFSET, &[0xff; 16]);
    assert_eq!(rig.read_bytes(MSIX_PENDING_OFFSET, 16), [0; 16]);
    // Straddling both areas and the registers before them.
    rig.write_bytes(MSIX_TABLE_OFFSET - 4, &[7; 8]);
    assert_eq!(rig.read_bytes(MSIX_TABLE_OFFSET - 4, 8), [0, 0, 0, 0, 4, 7, 7, 7]);
}

#[test]
fn what_the_card_is_stands_in_its_registers() {
    let config = Config { voxel_memory: 256 << 20, renderer: Renderer::Reference, ..Config::default() };
    let mut rig = Rig::with(config, Renderer::Reference.start());
    let words = [renderer::REGISTER, architecture::REGISTER, simd_level::REGISTER, threads::REGISTER]
        .map(|register| rig.read(register));
    assert_eq!(words, [1, 1, 0, 1]);
    assert_eq!(rig.read(voxel_memory_size::REGISTER), 256 << 20);
    assert_eq!(rig.read(interface_version::REGISTER), 0x0001_0000);
    assert_eq!(rig.card.regions()[2].size, 256 << 20);
}

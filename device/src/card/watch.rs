//! Strict mode's watch over memory that a frame uses.
//!
//! A device does not see what clients write through their mappings. Checksums of what a frame uses, from when
//! the engine takes it and when it is done, tell afterwards.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use vg500_engine::FrameDescription;
use vg500_engine::frame::Volume;
use vg500_regs::SharedView;
use vg500_regs::memory::Table;
use vg500_regs::shared::OutOfRange;

use super::memories::Memories;
use super::mistake::Mistake;
use crate::backing::Backing;

/// Volumes whose checksum is kept, to see whether promises about them are kept.
const VOLUMES: usize = 16;

/// Checksums of the tables and the volume of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Checksums {
    tables: [u32; Table::ALL.len()],
    volume: u32,
}

impl Checksums {
    /// Checksums of what a frame uses, at this moment.
    ///
    /// # Errors
    ///
    /// If the frame uses more than there is, which its validation excludes.
    pub(super) fn of(frame: &FrameDescription, memories: &Memories) -> Result<Self, OutOfRange> {
        let mut tables = [0; Table::ALL.len()];
        for ((checksum, table), copy) in tables.iter_mut().zip(Table::ALL).zip(frame.copies) {
            *checksum = checksum_of(&memories.table.view(), table.offset(copy), table.bytes())?;
        }
        Ok(Self { tables, volume: volume(&frame.volume, &memories.voxel.view())? })
    }

    /// The mistakes that the differences to a later moment tell of.
    pub(super) fn differences(&self, later: &Self, frame: &FrameDescription) -> Vec<Mistake> {
        let tag = frame.tag;
        let pairs = self.tables.iter().zip(&later.tables).zip(Table::ALL.into_iter().zip(frame.copies));
        let mut mistakes: Vec<_> = pairs
            .filter(|((before, after), _)| before != after)
            .map(|(_, (table, copy))| Mistake::TableWritten { tag, table, copy })
            .collect();
        if self.volume != later.volume {
            mistakes.push(Mistake::VolumeWritten(tag));
        }
        mistakes
    }
}

/// The volumes of the last frames, as they were at the end of each.
#[derive(Debug, Default)]
pub(super) struct Promises(VecDeque<(Weak<Backing>, Volume, u32)>);

impl Promises {
    /// Whether a frame that begins now keeps the promise of its start command, if it makes one.
    pub(super) fn kept(&self, frame: &FrameDescription, memories: &Memories, now: &Checksums) -> bool {
        let memory = Arc::downgrade(&memories.voxel);
        let last = self.0.iter().find(|(of, volume, _)| of.ptr_eq(&memory) && *volume == frame.volume);
        !frame.voxels_unchanged || last.is_none_or(|(_, _, checksum)| *checksum == now.volume)
    }

    /// A frame has ended.
    pub(super) fn remember(&mut self, frame: &FrameDescription, memories: &Memories, now: &Checksums) {
        let memory = Arc::downgrade(&memories.voxel);
        self.0.retain(|(of, volume, _)| of.ptr_eq(&memory) && *volume != frame.volume);
        self.0.truncate(VOLUMES - 1);
        self.0.push_front((memory, frame.volume, now.volume));
    }
}

/// The voxels that the frame can meet, without what lies between rows.
fn volume(volume: &Volume, memory: &SharedView<'_>) -> Result<u32, OutOfRange> {
    let [width, height, depth] = volume.size.map(|size| size as usize);
    let [pitch, rows] = [volume.row_pitch, volume.slice_rows].map(|pitch| pitch as usize);
    let bytes = volume.format.bytes();
    let mut checksum = crc32fast::Hasher::new();
    let mut row_bytes = vec![0; width * bytes];
    for row in (0..depth).flat_map(|z| (0..height).map(move |y| z * rows + y)) {
        memory.read(volume.base + row * pitch * bytes, &mut row_bytes)?;
        checksum.update(&row_bytes);
    }
    Ok(checksum.finalize())
}

fn checksum_of(memory: &SharedView<'_>, offset: usize, length: usize) -> Result<u32, OutOfRange> {
    let mut bytes = vec![0; length];
    memory.read(offset, &mut bytes)?;
    Ok(crc32fast::hash(&bytes))
}

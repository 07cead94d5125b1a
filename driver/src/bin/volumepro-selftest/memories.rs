//! The mapped memories: what this process writes it reads again, and the card sees it; what the card writes this
//! process sees.

use std::ops::Range;

use vg500_regs::memory::{plane_bytes, plane_offset};
use vg500_regs::pci::{BARS, Bar, PIXEL_MEMORY};
use vg500_regs::{PixelFormat, PlaneFormat};
use volumepro_driver::{Rectangle, TrappedAccesses};

use crate::rig::{Failure, Rig, ensure};
use crate::scene::{self, compare};

/// Bytes that are written and compared at once.
const PART: usize = 1 << 20;

/// Every byte of every mapped memory holds what was written there, also while the others are written.
pub fn patterns(rig: &Rig) -> Result<String, Failure> {
    let memories = BARS.into_iter().filter(|bar| bar.mapped);
    let mut bytes = 0;
    for bar in memories.clone() {
        let memory = rig.memory(bar)?;
        for part in parts(memory.size()) {
            memory.write(part.start, &pattern(bar, part))?;
        }
        bytes += memory.size();
    }
    for bar in memories {
        let memory = rig.memory(bar)?;
        for part in parts(memory.size()) {
            let mut found = vec![0; part.len()];
            memory.read(part.start, &mut found)?;
            compare(&found, &pattern(bar, part.clone()))
                .map_err(|error| format!("{} from byte {:#x} on: {error}", bar.name, part.start))?;
        }
    }
    rig.expect_no_mistakes()?;
    // The driver does not know that its tables are gone.
    rig.card.reset()?;
    rig.scene.load(&rig.card)?;
    Ok(format!("{} MiB written and read again", bytes >> 20))
}

fn parts(size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..size).step_by(PART).map(move |start| start..size.min(start + PART))
}

/// Bytes that differ from memory to memory and do not repeat with any power of two.
pub fn pattern(bar: Bar, range: Range<usize>) -> Vec<u8> {
    let seed = bar.index.wrapping_mul(0x9e37_79b9);
    range.map(|at| ((at as u32).wrapping_add(seed).wrapping_mul(0x85eb_ca6b) >> 19) as u8).collect()
}

/// The card reads voxels and tables from the mapping, and this process its pixels.
pub fn frame(rig: &Rig) -> Result<String, Failure> {
    let ticket = rig.scene.check(&rig.card)?;
    let report = rig.card.report(ticket)?;
    let own = crc32fast::hash(&scene::picture());
    ensure(report.checksum == own, || {
        format!("the card's checksum of its pixels is {:#x} instead of {own:#x}", report.checksum)
    })?;
    Ok(format!(
        "voxels and tables seen by the card, its pixels by this process, checksum {own:#010x} on both sides"
    ))
}

/// The card reads pixels that this process wrote through the mapping.
pub fn device_view(rig: &Rig) -> Result<String, Failure> {
    let plane = rig.card.allocate_plane(PlaneFormat::Rgba8)?;
    let start = plane_offset(plane.format(), plane.index(), 0, 0);
    let written = pattern(PIXEL_MEMORY, 0..plane_bytes(plane.format()));
    rig.memory(PIXEL_MEMORY)?.write(start, &written)?;
    let target = rig.card.host_memory(written.len())?;
    let whole = Rectangle::of_size(512, 512);
    rig.card.transfer(&plane, whole, PixelFormat::Rgba8, &*target, 0, 512 * 4)?;
    let mut arrived = vec![0; written.len()];
    target.view().read(0, &mut arrived)?;
    compare(&arrived, &written)?;
    Ok(format!("{} KiB written to pixel memory came back by bus mastering", written.len() >> 10))
}

/// Accesses to the mapped memories that the card saw as messages.
pub fn untrapped(before: &TrappedAccesses, now: &TrappedAccesses) -> Result<String, Failure> {
    for bar in BARS.into_iter().filter(|bar| bar.mapped) {
        let at = bar.index as usize;
        let reads = now.reads[at].wrapping_sub(before.reads[at]);
        let writes = now.writes[at].wrapping_sub(before.writes[at]);
        ensure((reads, writes) == (0, 0), || {
            format!("{reads} reads and {writes} writes of the {} were trapped", bar.name)
        })?;
    }
    let registers = now.reads[0].wrapping_sub(before.reads[0]);
    ensure(registers > 0, || "the card does not count trapped reads of its registers".into())?;
    Ok(format!("no trapped access to table, voxel, pixel and section memory; {registers} reads of registers"))
}

impl Rig {
    /// One of the mapped memories.
    pub fn memory(&self, bar: Bar) -> Result<vg500_regs::SharedView<'_>, Failure> {
        let memory = self.card.transport().memory(bar.index);
        memory.ok_or_else(|| format!("BAR {} ({}) is not mapped", bar.index, bar.name).into())
    }
}

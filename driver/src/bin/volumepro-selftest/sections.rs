//! Section memory, which the card alone writes and reads: what a frame in sections leaves there, and that it is
//! there that the card looks for it.

use vg500_regs::limit::SECTION_WIDTH;
use vg500_regs::memory::volume_bytes;
use vg500_regs::pci::SECTION_MEMORY;
use vg500_regs::section::{
    ALPHA, BEFORE, BLUE, GREEN, RECORD, RED, SAMPLE, VOXEL_VALUE, record_offset, record_words,
};
use vg500_regs::table::{base_plane_size, material, output, step_x, supersampling};
use vg500_regs::{BlendMode, Field, FrameRegisters, VoxelFormat};

use crate::memories::pattern;
use crate::rig::{Failure, Rig, ensure};
use crate::scene::{self, SIZE, SOON, compare, picture, rectangle, voxel};

/// Voxels along each axis of the frame that is spoiled, and sample slices per voxel slice: some tens of
/// milliseconds.
const SIDE: u32 = 64;
const SLICES: u32 = 4;
/// Frames that may end before this process has come to spoil them.
const ATTEMPTS: u32 = 20;

/// A frame in sections has the pixels of one without, and leaves in section memory, seen through the mapping, exactly
/// the records that the programming manual describes.
pub fn records(rig: &Rig) -> Result<String, Failure> {
    let memory = rig.memory(SECTION_MEMORY)?;
    let mut expected = pattern(SECTION_MEMORY, 0..memory.size());
    memory.write(0, &expected)?;
    let mut registers = rig.scene.registers.clone();
    registers.set(output::SECTIONS, 1);
    let ticket = rig.card.submit(&rig.scene.plane, &registers)?;
    rig.card.wait(ticket, SOON)?;
    compare(&rig.card.read_pixels(&rig.scene.plane, rectangle())?, &picture())?;
    let mut found = vec![0; expected.len()];
    memory.read(0, &mut found)?;
    let [_, ny, nz] = SIZE;
    for [y, z] in (0..nz).flat_map(|z| (0..ny).map(move |y| [y, z])) {
        let record = &mut expected[record_offset(z as usize, y as usize, ny as usize)..][..RECORD];
        let (words, _) = record.as_chunks_mut();
        words.iter_mut().zip(left_behind(y, z)).for_each(|(bytes, word)| *bytes = word.to_le_bytes());
    }
    compare(&found, &expected)?;
    Ok(format!("{} records as expected, nothing else written, pixels as without sections", ny * nz))
}

/// What the first section of the frame of [`crate::scene`] hands over of a beam on a slice: its last voxel, its last
/// samples, which are voxels, and the ray that it has finished last.
fn left_behind(y: u32, z: u32) -> [u32; record_words(BlendMode::Alpha)] {
    let value = |behind| u32::from(voxel([SECTION_WIDTH - behind, y, z])) << 4;
    let (color, alpha) = (0..=z).fold(([0; 3], 0), |ray, z| blend(ray, voxel([SECTION_WIDTH - 3, y, z])));
    let fields: [(Field, u32); _] = [
        (VOXEL_VALUE, value(1) << 3),
        (SAMPLE, value(2)),
        (BEFORE, value(3)),
        (RED, color[0]),
        (GREEN, color[1]),
        (BLUE, color[2]),
        (ALPHA, alpha),
    ];
    let mut words = [0; _];
    fields.into_iter().for_each(|(field, value)| words[field.register as usize / 4] |= field.put(value));
    words
}

/// Alpha blending by the programming manual: a ray's color and opacity of 12 bits behind one more voxel.
fn blend((color, alpha): ([u32; 3], u32), value: u8) -> ([u32; 3], u32) {
    let part = |a: u32, b: u32| (a * b + 2048) >> 12;
    let opacity = if value == 0 { 0 } else { 0xfff };
    let wide = scene::color(value).map(|byte| u32::from(byte) << 4 | u32::from(byte) >> 4);
    let add = |sum: u32, color: u32| sum + part(part(color, opacity), 0xfff - alpha);
    let [red, green, blue] = color;
    let color = [add(red, wide[0]), add(green, wide[1]), add(blue, wide[2])];
    (color, alpha + part(opacity, 0xfff - alpha))
}

/// A frame in sections whose records this process writes over meanwhile is spoiled, and only that frame.
pub fn spoiled(rig: &Rig) -> Result<String, Failure> {
    let volume = rig.card.allocate_volume([SIDE; 3], VoxelFormat::Uint8)?;
    let voxels: Vec<u8> = (0..volume_bytes([SIDE; 3], VoxelFormat::Uint8) as u32)
        .map(|at| (at.wrapping_mul(0x9e37_79b9) >> 24) as u8)
        .collect();
    rig.card.upload(&volume, &volume.whole(), &voxels)?;
    let mut registers = FrameRegisters::default();
    volume.bind(&volume.whole(), &mut registers)?;
    registers.set(material::EMISSIVE, 255);
    registers.set(supersampling::Z, SLICES);
    // Rays cross a quarter of the volume, and with it the boundary between its sections.
    registers.set(step_x::STEP, (1 << 20) / SLICES);
    registers.set(base_plane_size::WIDTH, SIDE);
    registers.set(base_plane_size::HEIGHT, SIDE);
    registers.set(output::SECTIONS, 1);

    let memory = rig.memory(SECTION_MEMORY)?;
    let slices = ((SIDE - 1) * SLICES + 1) as usize;
    let nothing = vec![0; record_offset(slices, 0, SIDE as usize)];
    let checksum = |spoil: bool| -> Result<u32, Failure> {
        let ticket = rig.card.submit(&rig.scene.plane, &registers)?;
        while spoil && !rig.card.has_ended(ticket)? {
            memory.write(0, &nothing)?;
        }
        rig.card.wait(ticket, SOON)?;
        Ok(rig.card.report(ticket)?.checksum)
    };
    let own = checksum(false)?;
    let mut attempts = 1;
    while checksum(true)? == own {
        ensure(attempts < ATTEMPTS, || "the card does not read its records from section memory".into())?;
        attempts += 1;
    }
    ensure(checksum(false)? == own, || "the next frame is spoiled as well".into())?;
    Ok("the card renders with what this process writes over its records, and well when left alone".into())
}

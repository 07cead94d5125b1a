//! A frame whose picture follows from the programming manual by hand: every ray runs along z through voxel
//! centres, and the first opaque voxel on it gives its color.

use std::time::Duration;

use vg500_regs::limit::LOOKUP_ENTRIES;
use vg500_regs::table::{base_plane_size, material, supersampling};
use vg500_regs::{FrameRegisters, PlaneFormat, VoxelFormat};
use volumepro_driver::{BasePlane, BoardVolume, Card, Error, Rectangle, TableContent, Ticket};

/// Voxels along x, y, z: rows shorter than their padding, several sizes.
pub const SIZE: [u32; 3] = [40, 24, 6];
/// How long the frame may take.
pub const SOON: Duration = Duration::from_secs(20);

/// The frame on a card.
pub struct Scene {
    pub volume: BoardVolume,
    pub plane: BasePlane,
    pub registers: FrameRegisters,
}

impl Scene {
    /// Makes room for the frame and loads volume and tables.
    pub fn new(card: &Card) -> Result<Self, Error> {
        let volume = card.allocate_volume(SIZE, VoxelFormat::Uint8)?;
        let [nx, ny, _] = SIZE;
        let mut registers = FrameRegisters::default();
        volume.bind(&volume.whole(), &mut registers)?;
        registers.set(material::EMISSIVE, 255);
        registers.set(supersampling::Z, 1);
        registers.set(base_plane_size::WIDTH, nx);
        registers.set(base_plane_size::HEIGHT, ny);
        let scene = Self { volume, plane: card.allocate_plane(PlaneFormat::Rgba8)?, registers };
        scene.load(card)?;
        Ok(scene)
    }

    /// Loads volume and tables, also after a reset or after others have written the card's memories.
    pub fn load(&self, card: &Card) -> Result<(), Error> {
        let [nx, ny, nz] = SIZE;
        let voxels: Vec<u8> =
            (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| voxel([x, y, z])))).collect();
        card.upload(&self.volume, &self.volume.whole(), &voxels)?;
        load_tables(card)
    }

    /// Renders the frame.
    pub fn render(&self, card: &Card) -> Result<Ticket, Error> {
        let ticket = card.submit(&self.plane, &self.registers)?;
        card.wait(ticket, SOON)?;
        Ok(ticket)
    }

    /// Renders the frame and compares its pixels, read through the mapping, with what they must be.
    pub fn check(&self, card: &Card) -> Result<Ticket, Box<dyn std::error::Error>> {
        let ticket = self.render(card)?;
        compare(&card.read_pixels(&self.plane, rectangle())?, &picture())?;
        Ok(ticket)
    }
}

/// What the frame renders.
pub fn rectangle() -> Rectangle {
    Rectangle::of_size(SIZE[0], SIZE[1])
}

/// The pixels as they must be: rows of bytes R, G, B, A.
pub fn picture() -> Vec<u8> {
    let [nx, ny, _] = SIZE;
    (0..ny).flat_map(|y| (0..nx).flat_map(move |x| pixel(x, y))).collect()
}

/// Names the first pixel that differs.
pub fn compare(found: &[u8], expected: &[u8]) -> Result<(), String> {
    if found.len() != expected.len() {
        return Err(format!("{} bytes instead of {}", found.len(), expected.len()));
    }
    match found.iter().zip(expected).position(|(found, expected)| found != expected) {
        None => Ok(()),
        Some(byte) => Err(format!("byte {byte} is {} instead of {}", found[byte], expected[byte])),
    }
}

/// The color table and a step from clear to opaque at value 1 << 4.
fn load_tables(card: &Card) -> Result<(), Error> {
    let mut colors = [[0; 3]; LOOKUP_ENTRIES];
    let mut opacities = [0; LOOKUP_ENTRIES];
    for (value, (color, opacity)) in (0..=u8::MAX).zip(colors.chunks_mut(16).zip(opacities.chunks_mut(16))) {
        color.fill(self::color(value));
        opacity.fill(if value == 0 { 0 } else { 0xfff });
    }
    card.load_table(&TableContent::color(&colors))?;
    card.load_table(&TableContent::opacity(&opacities)?)
}

/// Depth of the opaque voxel of a column; some columns have none.
fn depth(x: u32, y: u32) -> u32 {
    (x + 3 * y) % (SIZE[2] + 1)
}

pub fn voxel([x, y, z]: [u32; 3]) -> u8 {
    match z {
        z if z < depth(x, y) => 0,
        z => (1 + (5 * x + 11 * y + 17 * z) % 255) as u8,
    }
}

pub fn color(value: u8) -> [u8; 3] {
    [value, !value, value.rotate_left(3)]
}

fn pixel(x: u32, y: u32) -> [u8; 4] {
    match depth(x, y) {
        z if z < SIZE[2] => {
            let [red, green, blue] = color(voxel([x, y, z]));
            [red, green, blue, 255]
        }
        _ => [0; 4],
    }
}

//! The memories of a card.

use crate::grid::Grid;
use crate::scene::Scene;
use std::ops::Range;
use vg500_engine::memory::pixel;
use vg500_engine::stage::composite::Ray;
use vg500_engine::{Cancel, Memories, Renderer, Report, Task};
use vg500_regs::limit::REFLECTANCE_ENTRIES;
use vg500_regs::memory::{Table, padded, plane_offset};
use vg500_regs::pci::{PIXEL_MEMORY, SECTION_MEMORY, TABLE_MEMORY};
use vg500_regs::{Fault, Permutation, SharedView, VoxelFormat};

/// Voxel memory (as much as is loaded), table memory, pixel memory and section memory.
pub struct Card {
    pub voxels: Vec<u8>,
    pub tables: Vec<u8>,
    pub pixels: Vec<u8>,
    /// Empty unless frames in sections are wanted.
    pub sections: Vec<u8>,
}

/// Where a volume lies in voxel memory.
#[derive(Clone, Copy, Debug)]
pub struct Store {
    pub base: usize,
    pub format: VoxelFormat,
    pub size: [usize; 3],
    pub row_pitch: usize,
    pub slice_rows: usize,
}

impl Store {
    /// A box of the store, where it lies.
    pub fn window(&self, window: [Range<usize>; 3]) -> Self {
        let [x, y, z] = window.clone().map(|range| range.start);
        let first = (z * self.slice_rows + y) * self.row_pitch + x;
        Self { base: self.base + first * self.format.bytes(), size: window.map(|range| range.len()), ..*self }
    }
}

impl Card {
    /// A card without a volume; every other byte is rubbish.
    pub fn new() -> Self {
        Self {
            voxels: Vec::new(),
            tables: vec![0x5a; TABLE_MEMORY.size as usize],
            pixels: vec![0x5a; PIXEL_MEMORY.size as usize],
            sections: Vec::new(),
        }
    }

    /// A card with this transfer function in its tables: see [`Self::set_transfer`].
    pub fn with_transfer(transfer: impl Fn(u16) -> ([u8; 3], u16)) -> Self {
        let mut card = Self::new();
        card.set_transfer(transfer);
        card
    }

    /// A card whose tables have something in every entry: colours that tell values apart, opacities that leave
    /// several samples of a ray visible, lights from all sides.
    pub fn with_tables() -> Self {
        let mut card =
            Self::with_transfer(|value| ([(value >> 4) as u8, (value >> 1) as u8, value as u8], value >> 2));
        card.set_gradient_magnitude(|entry| 40 + entry / 2);
        card.set_maps(&Permutation::IDENTITY);
        card
    }

    /// The card with section memory full of rubbish.
    pub fn with_sections(mut self) -> Self {
        self.sections = vec![0x5a; SECTION_MEMORY.size as usize];
        self
    }

    /// Loads a volume behind those loaded before, padded as on a card; padding is rubbish.
    pub fn load(&mut self, grid: &Grid) -> Store {
        let [row_pitch, slice_rows, slices] = grid.size.map(|size| padded(size as u32) as usize);
        let bytes = grid.format.bytes();
        let base = self.voxels.len();
        self.voxels.resize(base + row_pitch * slice_rows * slices * bytes, 0xa5);
        for (row, voxels) in grid.voxels.chunks(grid.size[0]).enumerate() {
            let [y, z] = [row % grid.size[1], row / grid.size[1]];
            let start = base + (z * slice_rows + y) * row_pitch * bytes;
            let row = voxels.iter().flat_map(|voxel| voxel.to_le_bytes().into_iter().take(bytes));
            self.voxels[start..].iter_mut().zip(row).for_each(|(place, byte)| *place = byte);
        }
        Store { base, format: grid.format, size: grid.size, row_pitch, slice_rows }
    }

    /// Fills copy 0 of the colour and opacity tables from a value's colour and 12-bit opacity.
    pub fn set_transfer(&mut self, transfer: impl Fn(u16) -> ([u8; 3], u16)) {
        let (color, opacity) = (Table::Color.offset(0), Table::Opacity.offset(0));
        for entry in 0..4096 {
            let ([r, g, b], alpha) = transfer(entry as u16);
            self.tables[color + 4 * entry..][..4].copy_from_slice(&[r, g, b, 0]);
            self.tables[opacity + 2 * entry..][..2].copy_from_slice(&alpha.to_le_bytes());
        }
    }

    /// Fills both reflectance maps with a pattern that is the same for all permutations in permuted axes.
    pub fn set_maps(&mut self, permutation: &Permutation) {
        for (map, factors) in [(Table::Diffuse, [3, -5, 9]), (Table::Specular, [-8, 2, 7])] {
            self.set_map(map, |direction| {
                let terms = permutation.axes().into_iter().zip(factors).map(|(place, factor)| {
                    let sign = if place.flipped { -1 } else { 1 };
                    sign * factor * direction[place.axis]
                });
                (127 + terms.sum::<i32>()) as u8
            });
        }
    }

    /// Fills copy 0 of the diffuse or specular map from the direction of each vertex, in units of 1/7.
    pub fn set_map(&mut self, map: Table, intensity: impl Fn([i32; 3]) -> u8) {
        for entry in 0..REFLECTANCE_ENTRIES {
            let [face, v, u] = [entry / 64, entry / 8 % 8, entry % 8];
            let across = [2 * u as i32 - 7, 2 * v as i32 - 7];
            let major = if face % 2 == 0 { 7 } else { -7 };
            let direction = match face / 2 {
                0 => [major, across[0], across[1]],
                1 => [across[0], major, across[1]],
                _ => [across[0], across[1], major],
            };
            self.set_map_entry(map, entry, intensity(direction));
        }
    }

    /// Replaces an entry of copy 0 of the diffuse or specular map.
    pub fn set_map_entry(&mut self, map: Table, entry: usize, intensity: u8) {
        self.tables[map.offset(0) + 4 * entry..][..4].copy_from_slice(&[intensity, 0, 0, 0]);
    }

    /// Fills copy 0 of the gradient-magnitude table.
    pub fn set_gradient_magnitude(&mut self, factor: impl Fn(u8) -> u8) {
        let offset = Table::GradientMagnitude.offset(0);
        (0..=255).for_each(|entry| self.tables[offset + usize::from(entry)] = factor(entry));
    }

    /// The frame that a scene asks for.
    pub fn task(&mut self, scene: &Scene) -> Result<Task, Fault> {
        let tables = SharedView::of(&mut self.tables);
        Renderer::Reference.take(&scene.registers(), &tables, self.voxels.len())
    }

    /// Renders a scene.
    pub fn render(&mut self, scene: &Scene) -> Result<Report, Fault> {
        let task = self.task(scene)?;
        self.run(&task, &Cancel::default())
    }

    /// Renders a frame that has been taken.
    pub fn run(&mut self, task: &Task, cancel: &Cancel) -> Result<Report, Fault> {
        Renderer::Reference.render(task, self.memories(), cancel)
    }

    /// Views of the memories.
    pub fn memories(&mut self) -> Memories<'_> {
        Memories {
            voxel: SharedView::of(&mut self.voxels),
            pixel: SharedView::of(&mut self.pixels),
            section: SharedView::of(&mut self.sections),
        }
    }

    /// Stored pixels of the rectangle that a scene renders, row by row.
    pub fn plane(&self, scene: &Scene) -> Vec<u8> {
        let [width, height] = scene.rays;
        let row = |row| {
            let offset = plane_offset(scene.format, scene.plane, 0, row);
            &self.pixels[offset..offset + width as usize * scene.format.bytes()]
        };
        (0..height).flat_map(row).copied().collect()
    }

    /// Renders a scene and returns its stored pixels.
    pub fn rendered(&mut self, scene: &Scene) -> Vec<u8> {
        self.render(scene).unwrap();
        self.plane(scene)
    }

    /// Renders a scene in its blend mode's wide format and returns its rays.
    pub fn rays(&mut self, scene: &Scene) -> Vec<Ray> {
        let scene = Scene { format: scene.wide_format(), ..scene.clone() };
        let rays = self.rendered(&scene);
        rays.chunks(scene.format.bytes()).map(|bytes| pixel::load(bytes, scene.format)).collect()
    }

    /// Renders a scene in its blend mode's wide format and returns its pixels, R, G, B, A of 12 bits.
    pub fn pixels(&mut self, scene: &Scene) -> Vec<[u16; 4]> {
        self.rays(scene).iter().map(|ray| ray.pixel(scene.blend)).collect()
    }
}

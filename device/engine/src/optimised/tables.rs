//! The tables of a frame in the forms that the kernels look up.

use crate::fixed::{FULL, narrow};
use crate::stage::composite::Ray;
use crate::tables::Tables;
use vg500_regs::limit::{LOOKUP_ENTRIES, REFLECTANCE_ENTRIES};
use vg500_regs::reflectance::{FACE, VERTICES, face_axes};

/// Colour and opacity of every sample value: R, G, B and opacity of 12 bits, each in 16 bits of an entry. The entry
/// behind the last is transparent; samples that cannot be seen are given its value.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct Classification([u64; LOOKUP_ENTRIES + 1]);

impl Classification {
    /// The value of a sample that cannot be seen.
    pub const TRANSPARENT: u16 = LOOKUP_ENTRIES as u16;

    /// The table of a frame; `color` makes each colour what it is before opacity and light.
    pub fn new(tables: &Tables, color: impl Fn([u16; 3], u16) -> [u16; 3]) -> Box<Self> {
        let mut entries = Box::new(Self([0; LOOKUP_ENTRIES + 1]));
        let values = tables.color.iter().zip(&tables.opacity);
        for (entry, (&own, &alpha)) in entries.0.iter_mut().zip(values) {
            let [r, g, b] = color(own, alpha).map(u64::from);
            *entry = r | g << 16 | b << 32 | u64::from(alpha) << 48;
        }
        entries
    }

    /// The entries, to be looked up.
    #[inline(always)]
    #[must_use]
    pub const fn entries(&self) -> *const u64 {
        self.0.as_ptr()
    }

    /// The greatest opacity.
    #[must_use]
    pub fn most_opaque(&self) -> u16 {
        self.0.iter().fold(0, |most, entry| most.max((entry >> 48) as u16))
    }

    /// The ray that a sample of `value` (12 bits) makes alone in MIP and MinIP.
    #[must_use]
    pub fn ray(&self, value: u16) -> Ray {
        let entry = self.0[usize::from(value & FULL)];
        let channel = |shift| (entry >> shift) as u32 & 0xffff;
        Ray { color: [0, 16, 32].map(channel), alpha: channel(48), extreme: value, valid: true, samples: 0 }
    }
}

/// What a ray of MIP or MinIP is stored as: R, G, B, A of 8 bits for each value that can be its extreme.
#[derive(Debug)]
pub struct PixelsOfExtremes(Box<[[u8; 4]; LOOKUP_ENTRIES]>);

impl PixelsOfExtremes {
    /// For a table.
    #[must_use]
    pub fn new(table: &Classification) -> Self {
        let mut pixels = Box::new([[0; 4]; LOOKUP_ENTRIES]);
        for (pixel, entry) in pixels.iter_mut().zip(&table.0) {
            *pixel = [0, 16, 32, 48].map(|shift| narrow((entry >> shift) as u16));
        }
        Self(pixels)
    }

    /// The pixel of a ray; of one without any sample it is transparent.
    #[inline(always)]
    #[must_use]
    pub fn pixel(&self, extreme: u16) -> [u8; 4] {
        self.0.get(usize::from(extreme)).copied().unwrap_or([0; 4])
    }
}

/// Which ranges of sample values hold any that is not transparent.
#[derive(Debug)]
pub struct Opaque(Box<[u16; LOOKUP_ENTRIES + 1]>);

impl Opaque {
    /// For a table.
    #[must_use]
    pub fn new(table: &Classification) -> Self {
        // How many opaque values lie below each value.
        let mut below = Box::new([0; LOOKUP_ENTRIES + 1]);
        let mut count = 0;
        for (place, entry) in below.iter_mut().zip(&table.0) {
            *place = count;
            count += u16::from(entry >> 48 != 0);
        }
        Self(below)
    }

    /// Whether any value of `least..=greatest` is.
    #[inline(always)]
    #[must_use]
    pub fn any(&self, [least, greatest]: [u16; 2]) -> bool {
        self.0[usize::from(greatest & FULL) + 1] != self.0[usize::from(least & FULL)]
    }

    /// Whether all values are.
    #[must_use]
    pub fn all(&self) -> bool {
        usize::from(self.0[LOOKUP_ENTRIES]) == LOOKUP_ENTRIES
    }
}

/// A reflectance map: six faces of 8 x 8 vertices.
#[derive(Clone, Debug)]
pub struct ReflectanceMap(pub [u8; REFLECTANCE_ENTRIES]);

impl ReflectanceMap {
    /// A map as it is seen along axes of which some are mirrored.
    #[must_use]
    pub fn mirrored(map: &[u8], mirrored: [bool; 3]) -> Self {
        let mut result = [0; REFLECTANCE_ENTRIES];
        for (entry, place) in result.iter_mut().enumerate() {
            let [face, v, u] = [entry / FACE, entry / VERTICES % VERTICES, entry % VERTICES];
            let axis = face / 2;
            let [u_axis, v_axis] = face_axes(axis);
            let face = face ^ usize::from(mirrored[axis]);
            let turn = |at, axis: usize| if mirrored[axis] { VERTICES - 1 - at } else { at };
            *place = map[face * FACE + turn(v, v_axis) * VERTICES + turn(u, u_axis)];
        }
        Self(result)
    }

    /// The entry at a vertex of a face; past the last vertex the last.
    #[must_use]
    pub fn at(&self, face: usize, v: usize, u: usize) -> u8 {
        let last = VERTICES - 1;
        self.0[face * FACE + v.min(last) * VERTICES + u.min(last)]
    }
}

//! The passes of x and y supersampling become one base plane (paper, section 4.1): interleaved, or averaged.

use crate::geometry::Pass;
use vg500_regs::PlaneFormat;
use vg500_regs::format::{ACCUMULATOR_BITS, SUM_BITS};

/// Collects the pixels of passes.
pub struct Collector {
    width: usize,
    format: PlaneFormat,
    passes: u32,
    /// Interleaved RGBA8 pixels.
    pixels: Vec<u8>,
    /// Sums of 12-bit R, G, B, A over passes; empty unless passes are averaged.
    sums: Vec<[u32; 4]>,
}

impl Collector {
    /// For a base plane of `size` and passes rendered in `format`: RGBA8 is interleaved, the wide formats are
    /// averaged.
    pub fn new(size: [u32; 2], format: PlaneFormat, passes: usize) -> Self {
        let [width, height] = size.map(|side| side as usize);
        let (bytes, sums) = match format {
            PlaneFormat::Rgba8 => (width * height * 4, 0),
            PlaneFormat::Accumulator64 | PlaneFormat::Sum128 => (0, width * height),
        };
        Self { width, format, passes: passes as u32, pixels: vec![0; bytes], sums: vec![[0; 4]; sums] }
    }

    /// Adds the pixels of a pass, row by row without padding.
    pub fn add(&mut self, pass: &Pass, pixels: Vec<u8>) {
        if self.passes == 1 && self.format == PlaneFormat::Rgba8 && pixels.len() == self.pixels.len() {
            self.pixels = pixels;
            return;
        }
        let [columns, _] = pass.size.map(|side| side as usize);
        for (row, rays) in pixels.chunks_exact(columns * self.format.bytes()).enumerate() {
            let row = (pass.offset[1] as usize + row * pass.stride[1] as usize) * self.width;
            for (column, ray) in rays.chunks_exact(self.format.bytes()).enumerate() {
                let place = row + pass.offset[0] as usize + column * pass.stride[0] as usize;
                self.add_ray(place, ray);
            }
        }
    }

    fn add_ray(&mut self, place: usize, ray: &[u8]) {
        if self.format == PlaneFormat::Rgba8 {
            self.pixels[4 * place..4 * place + 4].copy_from_slice(ray);
            return;
        }
        for (sum, channel) in self.sums[place].iter_mut().zip(channels(ray)) {
            *sum += channel;
        }
    }

    /// Rows of bytes R, G, B, A.
    pub fn finish(self) -> Vec<u8> {
        if self.sums.is_empty() {
            return self.pixels;
        }
        // round(255 sum / (4095 passes))
        let most = 4095 * self.passes;
        let narrow = |sum: u32| ((510 * u64::from(sum) + u64::from(most)) / (2 * u64::from(most))) as u8;
        self.sums.into_iter().flat_map(|channels| channels.map(narrow)).collect()
    }
}

/// 12-bit R, G, B, A of a ray in one of the wide formats; rays without samples are zero.
fn channels(ray: &[u8]) -> [u32; 4] {
    let mut word = [0; 16];
    for (place, byte) in word.iter_mut().zip(ray) {
        *place = *byte;
    }
    let word = u128::from_le_bytes(word);
    if ray.len() == PlaneFormat::Accumulator64.bytes() {
        return [0, 1, 2, 3].map(|channel| (word >> (ACCUMULATOR_BITS * channel)) as u32 & 0xfff);
    }
    let samples = (word >> (4 * SUM_BITS)) as u32;
    let sums = [0, 1, 2, 3].map(|channel| (word >> (SUM_BITS * channel)) as u32 & ((1 << SUM_BITS) - 1));
    sums.map(|sum| (2 * sum + samples).checked_div(2 * samples).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interleaved_passes_stand_side_by_side() {
        let mut collector = Collector::new([3, 1], PlaneFormat::Rgba8, 2);
        let pass =
            |offset, columns| Pass { start: [0; 2], size: [columns, 1], offset: [offset, 0], stride: [2, 1] };
        collector.add(&pass(0, 2), vec![1, 1, 1, 1, 3, 3, 3, 3]);
        collector.add(&pass(1, 1), vec![2, 2, 2, 2]);
        assert_eq!(collector.finish(), [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]);
    }

    #[test]
    fn averaged_passes_count_missing_rays_as_zero() {
        let mut collector = Collector::new([1, 1], PlaneFormat::Accumulator64, 4);
        let pass = Pass { start: [0; 2], size: [1, 1], offset: [0; 2], stride: [1; 2] };
        let ray = 4095_u64 | 2048 << 36 | 0xfff << 48 | 1 << 60;
        collector.add(&pass, ray.to_le_bytes().to_vec());
        collector.add(&pass, ray.to_le_bytes().to_vec());
        collector.add(&pass, vec![0; 8]);
        collector.add(&pass, vec![0; 8]);
        // 255 / 2 = 127.5 goes up; 2048 / 2 * 255 / 4095 = 63.8
        assert_eq!(collector.finish(), [128, 0, 0, 64]);
    }

    #[test]
    fn sums_are_divided_by_their_samples_first() {
        let word = 3_u128 | 4095 << 27 | 2 << 108;
        assert_eq!(channels(&word.to_le_bytes()), [2, 2048, 0, 0]);
        assert_eq!(channels(&[0; 16]), [0; 4]);
    }
}

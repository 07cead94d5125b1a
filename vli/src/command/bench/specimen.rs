//! The volume that is drawn.

use crate::{Volume, VolumeError, Voxels};

/// A volume like a scan of a head: air, soft tissue, a skull and a rod of bone, and noise everywhere.
#[derive(Debug)]
pub struct Specimen {
    /// Voxels along each axis.
    pub size: u32,
    /// Bits of a voxel: 8 or 12.
    pub bits: u32,
    /// The volume.
    pub volume: Volume,
}

impl Specimen {
    /// With so many voxels along each axis. Voxels of 8 bits are the upper ones of 12.
    pub fn new(size: u32, bits: u32) -> Result<Self, VolumeError> {
        let half = f64::from(size - 1) / 2.0;
        // -127.5..=127.5 whatever the size is.
        let place = |at: u32| if size > 1 { (f64::from(at) - half) / half * 127.5 } else { 0.0 };
        let mut noise = 0x0123_4567_u32;
        let voxels = (0..size.pow(3)).map(|index| {
            noise ^= noise << 13;
            noise ^= noise >> 17;
            noise ^= noise << 5;
            let [x, y, z] = [index % size, index / size % size, index / size / size].map(place);
            (density(x, y, z) + f64::from(noise >> 8 & 63) - 8.0).clamp(0.0, 4095.0) as u16
        });
        let voxels = match bits {
            8 => Voxels::Uint8(voxels.map(|voxel| (voxel >> 4) as u8).collect()),
            _ => Voxels::Uint12Lower(voxels.collect()),
        };
        Ok(Self { size, bits, volume: Volume::new([size; 3], voxels)? })
    }

    /// Bytes of the voxels.
    pub const fn bytes(&self) -> usize {
        (self.size as usize).pow(3) * if self.bits == 8 { 1 } else { 2 }
    }
}

fn density(x: f64, y: f64, z: f64) -> f64 {
    let radius = |[a, b, c]: [f64; 3]| ((x / a).powi(2) + (y / b).powi(2) + (z / c).powi(2)).sqrt();
    let [skin, skull] = [radius([100.0, 112.0, 116.0]), radius([80.0, 92.0, 96.0])];
    let rod = (x - 20.0).hypot(y + 10.0);
    if rod < 14.0 {
        let bone = ((14.0 - rod) / 3.0).min(1.0);
        3000.0 * bone + 1000.0 * (1.0 - bone)
    } else if skin < 0.97 && skull > 0.95 {
        2600.0 + 300.0 * (x * 0.1).sin()
    } else if skin < 1.0 {
        1000.0 * ((1.0 - skin) * 25.0).min(1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_of_8_bits_are_the_upper_ones_of_12() {
        let [eight, twelve] = [8, 12].map(|bits| Specimen::new(9, bits).unwrap());
        assert_eq!((eight.bytes(), twelve.bytes()), (729, 1458));
        let (Voxels::Uint8(eight), Voxels::Uint12Lower(twelve)) =
            (eight.volume.voxels(), twelve.volume.voxels())
        else {
            panic!("wrong formats");
        };
        assert!(eight.iter().zip(twelve.iter()).all(|(&eight, &twelve)| u16::from(eight) == twelve >> 4));
        assert!(twelve.iter().any(|&voxel| voxel > 2000) && twelve[0] < 64);
    }

    #[test]
    fn a_single_voxel_is_a_volume() {
        assert!(Specimen::new(1, 12).is_ok());
    }
}

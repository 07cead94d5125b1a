//! Illumination (paper, section 3.5): RGB = (ke + Id Gd kd) SampleRGB + Is Gs ks SpecularColor.
//!
//! Factors are U0.15. Only the final colour is clamped: the sum of the first bracket may reach 2 and is kept as
//! U1.14.

use super::reflect::{reflect, stretch};
use super::reflectance::{cube_vector, look_up};
use crate::fixed::{BODY, FULL, UNITY, round_shift, scale, unity, widen};
use crate::frame::Illumination;
use crate::tables::Tables;

/// The intensities that the two reflectance maps give, U0.15.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Light {
    /// Id.
    pub diffuse: u16,
    /// Is.
    pub specular: u16,
}

/// Looks up the light on a sample with `gradient` (object axes). Without a gradient there is none.
#[must_use]
pub fn light(illumination: &Illumination, tables: &Tables, gradient: [i32; 3]) -> Light {
    if gradient == [0; 3] {
        return Light::default();
    }
    let vector = cube_vector(gradient);
    let specular = if illumination.specular == 0 {
        0
    } else {
        look_up(&tables.specular, stretch(reflect(vector, illumination.eye)))
    };
    Light { diffuse: look_up(&tables.diffuse, vector), specular }
}

/// The colour of a sample of classified `color` in `light`; `modulation` is the entry of the gradient-magnitude
/// table.
#[must_use]
pub fn illuminate(illumination: &Illumination, color: [u16; 3], light: Light, modulation: u8) -> [u16; 3] {
    let [_, modulate_diffuse, modulate_specular] = illumination.modulate;
    let coefficient = |intensity, modulate, factor| {
        let modulated = if modulate { factor_product(intensity, unity(modulation)) } else { intensity };
        factor_product(modulated, unity(factor))
    };
    let diffuse = coefficient(light.diffuse, modulate_diffuse, illumination.diffuse);
    let specular = coefficient(light.specular, modulate_specular, illumination.specular);
    let own = (u32::from(unity(illumination.emissive)) + u32::from(diffuse) + 1) >> 1;
    let highlight = illumination.specular_color.map(|channel| scale(widen(channel), specular));
    [0, 1, 2].map(|channel| {
        let body = round_shift(i64::from(color[channel]) * i64::from(own), BODY.fraction) as u16;
        (body + highlight[channel]).min(FULL)
    })
}

/// Product of two U0.15 factors.
const fn factor_product(a: u16, b: u16) -> u16 {
    round_shift(a as i64 * b as i64, UNITY.fraction) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::limit::REFLECTANCE_ENTRIES;

    const DARK: Illumination = Illumination {
        emissive: 0,
        diffuse: 0,
        specular: 0,
        specular_color: [255; 3],
        eye: [0, 0, 32767],
        modulate: [false; 3],
    };
    const FULL_LIGHT: Light = Light { diffuse: 32767, specular: 32767 };

    #[test]
    fn full_emission_is_the_color_itself() {
        let emitting = Illumination { emissive: 255, ..DARK };
        for color in 0..=FULL {
            assert_eq!(illuminate(&emitting, [color, 0, 4095], FULL_LIGHT, 0), [color, 0, 4095]);
        }
        let half = Illumination { emissive: 128, ..DARK };
        // unity(128) = 16448, halved 8224; 4095 * 8224 / 16384 = 2055.5 - 0.02
        assert_eq!(illuminate(&half, [0, 1, 4095], FULL_LIGHT, 0), [0, 1, 2055]);
    }

    #[test]
    fn light_and_emission_add_before_the_color_is_clamped() {
        let both = Illumination { emissive: 255, diffuse: 255, ..DARK };
        assert_eq!(illuminate(&both, [1000, 2048, 3000], FULL_LIGHT, 0), [2000, 4095, 4095]);
        let highlight = Illumination { specular: 255, specular_color: [255, 128, 0], ..DARK };
        assert_eq!(illuminate(&highlight, [1000; 3], FULL_LIGHT, 0), [4095, widen(128), 0]);
    }

    #[test]
    fn modulation_dims_what_it_is_asked_to() {
        let lit = Illumination { diffuse: 255, specular: 255, specular_color: [0, 255, 255], ..DARK };
        let diffuse = Illumination { modulate: [false, true, false], ..lit };
        assert_eq!(illuminate(&diffuse, [2000, 0, 0], FULL_LIGHT, 0), [0, 4095, 4095]);
        let specular = Illumination { modulate: [true, false, true], ..lit };
        assert_eq!(illuminate(&specular, [2000, 0, 0], FULL_LIGHT, 0), [2000, 0, 0]);
    }

    #[test]
    fn without_gradient_there_is_no_light() {
        let mut tables = Tables::empty();
        tables.diffuse = vec![255; REFLECTANCE_ENTRIES];
        tables.specular = vec![255; REFLECTANCE_ENTRIES];
        let lit = Illumination { diffuse: 255, specular: 255, ..DARK };
        assert_eq!(light(&lit, &tables, [0; 3]), Light::default());
        assert_eq!(light(&lit, &tables, [0, -1, 0]), FULL_LIGHT);
    }

    #[test]
    fn every_gradient_and_eye_stays_inside_of_the_maps() {
        let mut tables = Tables::empty();
        tables.diffuse = vec![255; REFLECTANCE_ENTRIES];
        tables.specular = vec![255; REFLECTANCE_ENTRIES];
        let lit = Illumination { diffuse: 255, specular: 255, ..DARK };
        let values = || (-127..=127).step_by(6).chain([0, 127]);
        for eye in [[32767, 0, 0], [0, -32768, 0], [-18918, 18918, 18918], [23170, 0, -23170]] {
            for gradient in
                values().flat_map(|x| values().flat_map(move |y| values().map(move |z| [x, y, z])))
            {
                if gradient != [0; 3] {
                    assert_eq!(light(&Illumination { eye, ..lit }, &tables, gradient), FULL_LIGHT);
                }
            }
        }
    }
}

//! Illumination (paper, section 3.5).

use crate::fixed::{scale, unity};
use crate::frame::Illumination;

/// The light that a sample emits: ke times its colour.
#[must_use]
pub fn emit(illumination: &Illumination, color: [u16; 3]) -> [u16; 3] {
    let emissive = unity(illumination.emissive);
    color.map(|channel| scale(channel, emissive))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_emission_is_the_color_itself() {
        let mut illumination = Illumination {
            emissive: 255,
            diffuse: 0,
            specular: 0,
            specular_color: [0; 3],
            eye: [0; 3],
            modulate: [false; 3],
        };
        assert_eq!(emit(&illumination, [0, 1234, 4095]), [0, 1234, 4095]);
        illumination.emissive = 128;
        // unity(128) = 16448; 4095 * 16448 / 32768 = 2055.5 - 1/64
        assert_eq!(emit(&illumination, [0, 1, 4095]), [0, 1, 2055]);
        illumination.emissive = 0;
        assert_eq!(emit(&illumination, [0, 1234, 4095]), [0; 3]);
    }
}

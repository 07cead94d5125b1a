//! Noise that is the same on every machine.

/// Mixes the bits of a number; each result belongs to one number only. Constants from the search of low-bias 32-bit
/// mixers by Wellons, "Prospecting for Hash Functions", 2018.
const fn mix(number: u32) -> u32 {
    let mut bits = number;
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x846c_a68b);
    bits ^ (bits >> 16)
}

/// Noise of a sample: nearly Gaussian with mean 0 and standard deviation 1, at most 3.46 away; the sum of four
/// uniform bytes.
pub fn gaussian(sample: usize) -> f64 {
    /// Variance of a uniform byte is (256^2 - 1) / 12.
    const FOUR_VARIANCES: f64 = 4.0 * 65_535.0 / 12.0;
    let sum: i32 = mix(sample as u32).to_le_bytes().into_iter().map(i32::from).sum();
    f64::from(sum - 510) / libm::sqrt(FOUR_VARIANCES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_centred_and_of_unit_deviation() {
        let noise: Vec<f64> = (0..100_000).map(gaussian).collect();
        let mean = noise.iter().sum::<f64>() / 1e5;
        let variance = noise.iter().map(|noise| noise * noise).sum::<f64>() / 1e5;
        // Five standard errors: 1/sqrt(n) of the mean; of the variance less than sqrt(2/n).
        assert!(mean.abs() < 5.0 / 1e5_f64.sqrt(), "{mean}");
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / 1e5_f64).sqrt(), "{variance}");
    }

    #[test]
    fn neighbours_are_independent() {
        for step in [1, 256, 65_536] {
            let products = (0..100_000).map(|sample| gaussian(sample) * gaussian(sample + step));
            let correlation = products.sum::<f64>() / 1e5;
            assert!(correlation.abs() < 5.0 / 1e5_f64.sqrt(), "{step}: {correlation}");
        }
    }
}

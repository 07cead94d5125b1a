//! Gradient magnitude (paper, section 3.3): the rounded square root of the sum of squares, then a table.

/// Magnitude of a gradient with components in -127..=127: round(sqrt(x^2 + y^2 + z^2)), 0..=220.
///
/// A Newton-Raphson iteration from above, and an integer correction that makes the rounding exact.
#[must_use]
pub fn magnitude(gradient: [i32; 3]) -> u8 {
    let squares: i32 = gradient.iter().map(|component| component * component).sum();
    if squares == 0 {
        return 0;
    }
    let mut root = 256;
    loop {
        let next = (root + squares / root) / 2;
        if next >= root {
            break;
        }
        root = next;
    }
    // `root` is the floor; the square root is nearer to root + 1 exactly when squares > root^2 + root.
    (root + i32::from(squares > root * root + root)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sum_of_squares_is_rounded_exactly() {
        let mut reached = 0;
        for x in 0..=127i32 {
            for y in 0..=x {
                for z in 0..=y {
                    let exact = f64::from(x * x + y * y + z * z).sqrt().round();
                    let result = magnitude([x, -y, z]);
                    assert_eq!(f64::from(result), exact, "{x} {y} {z}");
                    reached = reached.max(result);
                }
            }
        }
        assert_eq!(reached, 220);
    }
}

//! The real card's voxel memory: miniblocks of 2 x 2 x 2 voxels, skewed over four memory modules and four banks
//! in each (paper, section 5.2). Hosts see linear memory; this model serves the timing model.

/// Memory module of the miniblock that holds voxel (u, v, w).
#[must_use]
pub const fn module([u, v, w]: [u32; 3]) -> u32 {
    (u / 2 + v / 2 + w / 2) % 4
}

/// Bank, within its module, of the miniblock that holds voxel (u, v, w).
#[must_use]
pub const fn bank([u, v, w]: [u32; 3]) -> u32 {
    (u / 8 + v / 8 + w / 8) % 4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_adjacent_miniblocks_in_any_direction_are_in_four_modules() {
        for axis in 0..3 {
            for start in 0..512u32 {
                let first = [start % 8 * 2, start / 8 % 8 * 2, start / 64 * 2];
                let modules: u32 = (0..4)
                    .map(|step| {
                        let mut voxel = first;
                        voxel[axis] += 2 * step;
                        1 << module(voxel)
                    })
                    .sum();
                assert_eq!(modules, 0b1111);
            }
        }
    }

    #[test]
    fn cubes_of_four_miniblocks_per_side_share_a_bank_and_neighbours_do_not() {
        for axis in 0..3 {
            let mut next = [0; 3];
            next[axis] = 8;
            assert_eq!(bank([7; 3]), bank([0; 3]));
            assert_eq!(bank(next), 1);
        }
    }
}

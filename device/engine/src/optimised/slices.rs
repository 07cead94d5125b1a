//! The sample slices of a frame as the kernels walk them.
//!
//! The kernels read rows of voxels from low to high addresses. Where the frame runs the other way along permuted
//! x, it is mirrored: flips are exact in every stage, so the mirrored frame has the same rays in reverse order.

use crate::fixed::{ONE_VOXEL, POSITION_BITS};
use crate::frame::FrameDescription;
use crate::plan::{Plan, SliceAxis};
use core::ops::Range;

/// One axis of a sample slice. Ray `i` has its sample between voxels `i + first` and `i + first + 1`.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Voxel below the sample of ray 0; it may lie outside of the volume.
    pub first: i32,
    /// Weight of the voxel above, 8 fraction bits.
    pub weight: i16,
    /// Rays that have a sample on the slice.
    pub rays: Range<u32>,
}

impl Axis {
    fn new(axis: &SliceAxis) -> Self {
        // Positions are of the size of a base plane and a volume.
        Self {
            first: axis.voxel(0) as i32,
            weight: (axis.offset & (ONE_VOXEL - 1)) as i16,
            rays: axis.rays.clone(),
        }
    }

    /// The axis as it is from the other end of the volume and of the base plane.
    fn mirrored(axis: &SliceAxis, voxels: u32, rays: u32) -> SliceAxis {
        SliceAxis {
            offset: ONE_VOXEL * (i64::from(voxels) - i64::from(rays)) - axis.offset,
            rays: rays - axis.rays.end..rays - axis.rays.start,
        }
    }

    /// Voxels below the samples of some rays.
    #[must_use]
    pub fn voxels(&self, rays: &Range<u32>) -> Range<i32> {
        rays.start.cast_signed() + self.first..rays.end.cast_signed() + self.first
    }

    /// Position of the sample above voxel `voxel`, in 1/256 voxel.
    #[must_use]
    pub fn position(&self, voxel: i32) -> i64 {
        (i64::from(voxel) << POSITION_BITS) + i64::from(self.weight)
    }
}

/// A slice of samples.
#[derive(Clone, Debug)]
pub struct Slice {
    /// Voxel slice below.
    pub below: i32,
    /// Weight of the voxel slice above.
    pub weight: i16,
    /// Along permuted x, mirrored if the frame is.
    pub x: Axis,
    /// Along permuted y.
    pub y: Axis,
}

/// The sample slices of a frame, front to back.
#[must_use]
pub fn slices(frame: &FrameDescription, plan: &Plan) -> Vec<Slice> {
    let mirrored = frame.permutation.axes()[0].flipped;
    let [voxels, ..] = frame.permuted_size();
    let [rays, _] = frame.rays.size;
    let slices = plan.slices.iter().map(|slice| Slice {
        below: slice.voxel_slice() as i32,
        weight: slice.weight_z() as i16,
        x: if mirrored { Axis::new(&Axis::mirrored(&slice.x, voxels, rays)) } else { Axis::new(&slice.x) },
        y: Axis::new(&slice.y),
    });
    slices.collect()
}

//! Random volumes and views for property tests.

use glam::{DMat3, DMat4, DQuat, DVec3, EulerRot};
use proptest::prelude::*;

use super::{Accumulation, Supersampling, VolumeBox};

/// Rotations, with every axis-aligned and diagonal one among them.
fn rotation() -> impl Strategy<Value = DMat3> {
    let angle = || prop_oneof![(-4..=4).prop_map(|eighth| f64::from(eighth) * 45.0), -180.0..180.0_f64];
    (angle(), angle(), angle()).prop_map(|(x, y, z)| {
        let [x, y, z] = [x, y, z].map(f64::to_radians);
        DMat3::from_quat(DQuat::from_euler(EulerRot::XYZ, x, y, z))
    })
}

/// Model matrices: anisotropic up to 1:8, sheared up to 45 degrees, left- and right-handed, anywhere.
fn model() -> impl Strategy<Value = DMat4> {
    let spacing = || prop_oneof![Just(1.0), 0.5..4.0_f64].prop_flat_map(|s| prop_oneof![Just(s), Just(-s)]);
    let shear = || prop_oneof![2 => Just(0.0), 1 => -1.0..1.0_f64];
    let translation = prop::array::uniform3(-300.0..300.0_f64);
    (rotation(), [spacing(), spacing(), spacing()], [shear(), shear(), shear()], translation).prop_map(
        |(rotation, spacing, shear, translation)| {
            let sheared = DMat3::from_cols(
                DVec3::X,
                DVec3::new(shear[0], 1.0, 0.0),
                DVec3::new(shear[1], shear[2], 1.0),
            );
            let linear = rotation * sheared * DMat3::from_diagonal(DVec3::from_array(spacing));
            DMat4::from_translation(DVec3::from_array(translation)) * DMat4::from_mat3(linear)
        },
    )
}

/// Volumes of up to `largest` voxels per axis.
pub(super) fn volume(largest: u32) -> impl Strategy<Value = VolumeBox> {
    let voxels = move || prop_oneof![1 => Just(1), 1 => Just(2), 1 => Just(largest), 5 => 1..=largest];
    (model(), [voxels(), voxels(), voxels()]).prop_map(|(model, size)| VolumeBox::new(&model, size).unwrap())
}

/// View matrices: rotations, moved, and scaled by 1 or up to 3.
pub(super) fn view() -> impl Strategy<Value = DMat4> {
    let scale = prop_oneof![Just(1.0), 0.3..3.0_f64];
    (rotation(), scale, prop::array::uniform3(-100.0..100.0_f64)).prop_map(
        |(rotation, scale, translation)| {
            DMat4::from_translation(DVec3::from_array(translation)) * DMat4::from_mat3(rotation * scale)
        },
    )
}

/// Supersampling of every kind.
pub(super) fn supersampling() -> impl Strategy<Value = Supersampling> {
    let factor = || prop_oneof![2 => Just(1), 3 => 1..=8_u32];
    let accumulation = prop_oneof![Just(Accumulation::Grow), Just(Accumulation::Blend)];
    ([factor(), factor(), factor()], accumulation)
        .prop_map(|(factors, accumulation)| Supersampling::new(factors, accumulation).unwrap())
}

//! Properties of the whole factorisation.

use glam::{DMat4, DVec2, DVec3, DVec4};
use proptest::prelude::*;

use super::scenes::{supersampling, view, volume};
use super::*;

const ONE: i64 = 1 << 22;

fn unit_box(size: [u32; 3]) -> VolumeBox {
    VolumeBox::new(&DMat4::IDENTITY, size).unwrap()
}

/// The view matrix of a camera that looks along `direction`.
fn looking_along(direction: DVec3) -> DMat4 {
    look_at(DVec3::ZERO, direction, direction.any_orthogonal_vector()).unwrap()
}

fn factorise(volume: &VolumeBox, view: &DMat4) -> ShearWarp {
    ShearWarp::new(volume, view, Supersampling::NONE).unwrap()
}

/// Permuted x, y and z as (object axis, flipped).
fn axes(view: &ShearWarp) -> [(usize, bool); 3] {
    view.permutation().axes().map(|place| (place.axis, place.flipped))
}

/// The card's position with 8 fraction bits of ray `i` in sample slice `slice`.
fn p8(ray: u32, start: i32, step: u32, slice: u32) -> i64 {
    let position = i64::from(ray) * ONE + i64::from(start) + i64::from(slice) * i64::from(step);
    (position + (1 << 13)) >> 14
}

fn exists(p8: i64, voxels: u32) -> bool {
    (0..=256 * i64::from(voxels - 1)).contains(&p8)
}

#[test]
fn volumes_beyond_one_pass_are_refused() {
    let error = |size| ShearWarp::new(&unit_box(size), &DMat4::IDENTITY, Supersampling::NONE).unwrap_err();
    assert_eq!(error([256, 257, 256]), GeometryError::TooLarge { axis: 'y', size: 257 });
    assert_eq!(error([1, 1, u32::MAX]), GeometryError::TooLarge { axis: 'z', size: u32::MAX });
    assert!(error([300, 1, 1]).to_string().contains("300 voxels along x"));
}

#[test]
fn unusable_view_matrices_are_refused() {
    let flat = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::X + DVec4::Y, DVec4::W);
    let perspective = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::Z - DVec4::W, DVec4::W);
    for view in [flat, perspective, DMat4::NAN, DMat4::ZERO] {
        assert!(ShearWarp::new(&unit_box([4; 3]), &view, Supersampling::NONE).is_err(), "{view}");
    }

    // Each of these is invertible; their product flattens the volume.
    let lean = DMat4::from_cols(DVec4::X, DVec4::new(1.0, 1e-8, 0.0, 0.0), DVec4::Z, DVec4::W);
    let volume = VolumeBox::new(&lean, [4; 3]).unwrap();
    let error = ShearWarp::new(&volume, &lean, Supersampling::NONE).unwrap_err();
    assert_eq!(error, GeometryError::Singular("view matrix times model matrix"));
}

#[test]
fn all_48_orders_and_signs() {
    let volume = unit_box([5, 6, 7]);
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let base_orders = [[2, 1, 0], [0, 2, 1], [0, 1, 2]];
    for order in orders {
        for signs in 0..8 {
            let mut direction = [0.0; 3];
            for (axis, magnitude) in order.into_iter().zip([0.25, 0.5, 1.0]) {
                direction[axis] = if signs >> axis & 1 == 0 { magnitude } else { -magnitude };
            }
            let view = factorise(&volume, &looking_along(DVec3::from_array(direction)));
            let base = base_orders[order[2]];
            assert_eq!(axes(&view), base.map(|axis| (axis, signs >> axis & 1 == 1)), "{direction:?}");
            assert_eq!(view.permuted_size(), base.map(|axis| [5, 6, 7][axis]));
            let shear = [base[0], base[1]].map(|axis| if axis == order[0] { 0.25 } else { 0.5 });
            assert_eq!(view.shear(), shear, "{direction:?}");
        }
    }
}

#[test]
fn the_last_axis_wins_a_tie() {
    let volume = unit_box([5; 3]);
    for signs in 0..8 {
        let sign = |axis: usize| if signs >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let principal = |x: f64, y: f64, z: f64| {
            let direction = DVec3::new(x * sign(0), y * sign(1), z * sign(2));
            let view = factorise(&volume, &looking_along(direction));
            assert!(view.shear().iter().all(|shear| (0.0..=1.0).contains(shear)));
            view.permutation().axes()[2].axis
        };
        assert_eq!(principal(1.0, 1.0, 1.0), 2);
        assert_eq!(principal(1.0, 1.0, 0.5), 1);
        assert_eq!(principal(1.0, 0.5, 1.0), 2);
        assert_eq!(principal(0.5, 1.0, 1.0), 2);
        assert_eq!(principal(1.0, 1.0 - 1e-12, 0.0), 1);
        assert_eq!(principal(1.0, 1.0 - 1e-5, 0.0), 0);
    }
}

#[test]
fn head_on_views_have_a_sample_per_voxel_and_no_flip_across() {
    let volume = unit_box([256, 255, 254]);
    for (azimuth, elevation, base) in
        [(0.0, 0.0, [256, 255]), (90.0, 0.0, [254, 255]), (0.0, 90.0, [256, 254]), (180.0, 0.0, [256, 255])]
    {
        let size = ImageSize::new(64, 64).unwrap();
        let viewpoint = Viewpoint::Angles { azimuth, elevation };
        let camera = Camera::new(viewpoint, None, None, &volume, size).unwrap();
        let view = factorise(&volume, camera.camera_from_world());
        assert_eq!(view.samples(), 256 * 255 * 254);
        assert_eq!(view.base_plane().size(), base);
        assert_eq!(view.step(), [0, 0]);
        assert!(axes(&view)[..2].iter().all(|(_, flipped)| !flipped));
        assert_eq!(view.sample_distance(), 1.0);
    }
}

#[test]
fn rounding_errors_neither_flip_nor_shear() {
    let volume = unit_box([256; 3]);
    let view = factorise(&volume, &looking_along(DVec3::new(-1e-9, 1e-9, -1.0)));
    assert_eq!(axes(&view), [(0, false), (1, false), (2, true)]);
    assert_eq!((view.step(), view.samples()), ([0, 0], 1 << 24));
}

#[test]
fn the_widest_base_plane_is_511() {
    let volume = unit_box([256; 3]);
    for slices in 1..=8 {
        let supersampling = Supersampling::new([1, 1, slices], Accumulation::Grow).unwrap();
        let view = ShearWarp::new(&volume, &looking_along(DVec3::ONE), supersampling).unwrap();
        assert_eq!(view.base_plane().size(), [511, 511], "{slices}");
        assert_eq!(view.passes(&view.base_plane())[0].start, [-255 << 22; 2]);
    }
}

#[test]
fn sample_distance_is_measured_in_the_world() {
    // Spacing 1, 2 and 4 mm; slices of constant z lean by 3 mm along x per slice.
    let mut model = DMat4::from_scale(DVec3::new(1.0, 2.0, 4.0));
    model.z_axis.x = 3.0;
    let volume = VolumeBox::new(&model, [10; 3]).unwrap();
    // Along the voxel z axis, whatever scale the view matrix has: 5 mm per slice.
    let view = DMat4::from_scale(DVec3::splat(7.0)) * looking_along(DVec3::new(3.0, 0.0, 4.0));
    let distance = |slices| {
        let supersampling = Supersampling::new([2, 3, slices], Accumulation::Grow).unwrap();
        ShearWarp::new(&volume, &view, supersampling).unwrap().sample_distance()
    };
    assert!((distance(1) - 5.0).abs() < 1e-6);
    assert!((distance(5) - 1.0).abs() < 1e-6);
}

/// Counts, ray by ray and slice by slice, what [`ShearWarp`] computes in closed form. The rays asked about
/// reach beyond the plane on every side.
fn check_against_enumeration(view: &ShearWarp) -> Result<(), TestCaseError> {
    let [columns, rows, slices] = view.permuted_size();
    let [x, y, z] = view.supersampling().factors();
    let mut samples = 0;
    let mut lowest = [i64::MAX; 2];
    let mut highest = [i64::MIN; 2];
    let sub_starts = |factor: u32| {
        (0..factor).map(move |part| (part, (f64::from(part << 22) / f64::from(factor)).round() as i32))
    };
    for (part_y, start_y) in sub_starts(y) {
        for (part_x, start_x) in sub_starts(x) {
            for slice in 0..=z * (slices - 1) {
                let visible = |start: i32, voxels: u32, axis: usize| {
                    let reach = 2 * voxels + slices + 4;
                    let start = start - (i64::from(slices + 2) * ONE) as i32;
                    (0..reach)
                        .filter(move |ray| exists(p8(*ray, start, view.step()[axis], slice), voxels))
                        .map(move |ray| i64::from(ray) - i64::from(slices + 2))
                };
                for row in visible(start_y, rows, 1) {
                    for column in visible(start_x, columns, 0) {
                        samples += 1;
                        let ray = match view.supersampling().accumulation() {
                            Accumulation::Grow => [
                                column * i64::from(x) + i64::from(part_x),
                                row * i64::from(y) + i64::from(part_y),
                            ],
                            Accumulation::Blend => [column, row],
                        };
                        lowest = [0, 1].map(|axis| lowest[axis].min(ray[axis]));
                        highest = [0, 1].map(|axis| highest[axis].max(ray[axis]));
                    }
                }
            }
        }
    }
    prop_assert_eq!(view.samples(), samples);
    let plane = view.base_plane();
    prop_assert_eq!(plane.size().map(i64::from), [0, 1].map(|axis| highest[axis] - lowest[axis] + 1));

    // Pixel (0, 0) of the plane belongs to exactly the lowest ray.
    let passes = view.passes(&plane);
    let first = passes.iter().filter(|pass| pass.offset[0] == 0).map(|pass| pass.start[0]).min().unwrap();
    let expected = match view.supersampling().accumulation() {
        Accumulation::Grow => (lowest[0] as f64 * ONE as f64 / f64::from(x)).round() as i32,
        Accumulation::Blend => (lowest[0] * ONE) as i32,
    };
    prop_assert_eq!(first, expected);
    Ok(())
}

proptest! {
    #[test]
    fn extents_and_counts_are_those_of_the_cards_rule(
        volume in volume(6), view in view(), supersampling in supersampling(),
    ) {
        check_against_enumeration(&ShearWarp::new(&volume, &view, supersampling).unwrap())?;
    }

    #[test]
    fn shear_is_between_0_and_1(volume in volume(256), view in view(), supersampling in supersampling()) {
        let view = ShearWarp::new(&volume, &view, supersampling).unwrap();
        let slices = supersampling.factors()[2];
        for axis in 0..2 {
            prop_assert!(view.step()[axis] <= (ONE as u32 + slices / 2) / slices);
            prop_assert!(view.base_plane_with_margin().size()[axis] <= 512 * supersampling.factors()[axis]);
        }
    }

    /// The rays of a permuted volume go away from the camera, along what it sees in one point.
    #[test]
    fn rays_are_points_to_the_camera(volume in volume(256), view in view()) {
        let camera_from_world = view;
        let view = factorise(&volume, &camera_from_world);
        let [x, y] = view.shear();
        let advance = view.camera_from_permuted().transform_vector3(DVec3::new(x, y, 1.0));
        prop_assert!(advance.z < 0.0);
        let columns = [view.camera_from_permuted().x_axis, view.camera_from_permuted().y_axis];
        let half_step = 0.5 / ONE as f64;
        let bound = half_step * columns.iter().map(|axis| axis.truncate().truncate().length()).sum::<f64>();
        prop_assert!(advance.truncate().length() <= bound + 1e-12, "{} > {bound}", advance.truncate().length());


        // The origin of permuted coordinates is the vertex nearest to the image plane: along every axis that
        // the rays advance on, the box goes away from it. (In sheared volumes that holds in voxel space only.)
        let permuted = view.camera_from_permuted();
        let model = volume.world_from_voxel();
        let [x, y, z] = [model.x_axis, model.y_axis, model.z_axis].map(DVec4::normalize);
        if [x.dot(y), y.dot(z), z.dot(x)].iter().all(|dot| dot.abs() < 1e-12) {
            prop_assert!(permuted.z_axis.z < 0.0);
            prop_assert!(view.step()[0] == 0 || permuted.x_axis.z < 0.0);
            prop_assert!(view.step()[1] == 0 || permuted.y_axis.z < 0.0);
        }
    }

    /// The passes of a plane show each of its rays once (interleaved) or in every pass (blended), with rays
    /// where the warp believes them.
    #[test]
    fn passes_cover_the_plane(
        volume in volume(40), view in view(), supersampling in supersampling(), margin in any::<bool>(),
    ) {
        let view = ShearWarp::new(&volume, &view, supersampling).unwrap();
        let plane = if margin { view.base_plane_with_margin() } else { view.base_plane() };
        let [columns, rows] = plane.size();
        let ray_from_pixel = plane.pixel_from_ray().inverse();
        let mut seen = vec![0; (columns * rows) as usize];
        let mut sums = vec![DVec2::ZERO; seen.len()];
        for pass in view.passes(&plane) {
            prop_assert!(pass.size.iter().all(|size| (1..=512).contains(size)));
            for row in 0..pass.size[1] {
                for column in 0..pass.size[0] {
                    let pixel = [pass.offset[0] + column * pass.stride[0], pass.offset[1] + row * pass.stride[1]];
                    prop_assert!(pixel[0] < columns && pixel[1] < rows);
                    let place = (pixel[1] * columns + pixel[0]) as usize;
                    seen[place] += 1;
                    let ray = DVec2::new(f64::from(column), f64::from(row))
                        + DVec2::from_array(pass.start.map(|start| f64::from(start) / ONE as f64));
                    sums[place] += ray;
                }
            }
        }
        let [x, y, _] = supersampling.factors();
        let expected = if supersampling.accumulation() == Accumulation::Grow { 1 } else { x * y };
        for (place, (count, sum)) in seen.into_iter().zip(sums).enumerate() {
            prop_assert_eq!(count, expected);
            let pixel = DVec2::new((place as u32 % columns).into(), (place as u32 / columns).into());
            let ray = ray_from_pixel.transform_point2(pixel);
            // A sub-start is rounded by at most half a step of the register.
            prop_assert!((ray - sum / f64::from(expected)).abs().max_element() <= 0.5 / ONE as f64 + 1e-12);
        }
    }

    /// A voxel is seen where the view matrix says: by permutation, shear and warp as by the matrices alone.
    ///
    /// The two differ by the rounding of the steps, at most 2^-23 voxels per sample slice, over the slices
    /// between the voxel and the middle one, along both axes of the base plane. A sample of the card is
    /// beside its ray by another half of 1/256 voxel along each axis.
    #[test]
    fn voxels_are_seen_where_the_matrices_say(
        volume in volume(256), view in view(), supersampling in supersampling(),
        at in prop::array::uniform3(0.0..=1.0_f64), zoom in 0.2..2.0_f64, ray in any::<prop::sample::Index>(),
    ) {
        let size = ImageSize::new(640, 480).unwrap();
        let viewpoint = Viewpoint::Points { position: volume.centre() + DVec3::Z, focal: volume.centre() };
        let scale = zoom * volume.parallel_scale(size);
        let camera = Camera::new(viewpoint, None, Some(scale), &volume, size).unwrap();
        let camera_from_world = view;
        let view = ShearWarp::new(&volume, &camera_from_world, supersampling).unwrap();
        let plane = view.base_plane();
        let image_from_base_plane = view.image_from_base_plane(&plane, &camera, size);
        let image_from_camera = size.image_from_camera(camera.parallel_scale());
        let image = |point: DVec3, camera_from_space: &DMat4| {
            image_from_camera.transform_point2(camera_from_space.transform_point3(point).truncate())
        };

        let voxel = (DVec3::from_array(at) * volume.last()).round();
        let direct = image(voxel, &(camera_from_world * *volume.world_from_voxel()));
        let permuted = DVec3::from_array([0, 1, 2].map(|axis| {
            let place = view.permutation().axes()[axis];
            let along = voxel[place.axis];
            if place.flipped { volume.last()[place.axis] - along } else { along }
        }));
        let [shear_x, shear_y] = view.shear();
        let on_ray = DVec2::new(permuted.x - shear_x * permuted.z, permuted.y - shear_y * permuted.z);
        let pixel = plane.pixel_from_ray().transform_point2(on_ray);
        let warped = image_from_base_plane.transform_point2(pixel);

        let per_voxel = |axis: DVec3| (image(axis, view.camera_from_permuted()) - image(DVec3::ZERO, view.camera_from_permuted())).length();
        let slices = f64::from(supersampling.factors()[2]);
        let depth = f64::from(view.permuted_size()[2] - 1);
        let across = per_voxel(DVec3::X) + per_voxel(DVec3::Y);
        let bound = (permuted.z - depth / 2.0).abs() * slices * 0.5 / ONE as f64 * across;
        prop_assert!((direct - warped).length() <= bound + 1e-9, "{} > {bound}", (direct - warped).length());
        if slices == 1.0 && zoom >= 1.0 {
            prop_assert!((direct - warped).length() <= 1e-3);
        }

        // A sample where the card takes it, against the pixel it falls into.
        let pass = view.passes(&plane)[ray.index(view.passes(&plane).len())];
        let slice = ray.index((slices * depth) as usize + 1) as u32;
        let column = ray.index(pass.size[0] as usize) as u32;
        let row = ray.index(pass.size[1] as usize) as u32;
        let weight = |p8: i64| p8 as f64 / 256.0;
        let sample = DVec3::new(
            weight(p8(column, pass.start[0], view.step()[0], slice)),
            weight(p8(row, pass.start[1], view.step()[1], slice)),
            (256.0 * f64::from(slice) / slices).round() / 256.0,
        );
        let direct = image(sample, view.camera_from_permuted());
        let pixel = [pass.offset[0] + column * pass.stride[0], pass.offset[1] + row * pass.stride[1]];
        let seen = image_from_base_plane.transform_point2(DVec2::from_array(pixel.map(f64::from)));
        // Blended sub-rays are beside the centre of their pixel.
        let beside = match supersampling.accumulation() {
            Accumulation::Grow => 0.0,
            Accumulation::Blend => 0.5 * across,
        };
        let rounding = (across + per_voxel(DVec3::Z)) / 512.0;
        let drift = depth * slices * 0.5 / ONE as f64 * across + across / ONE as f64;
        let error = (direct - seen).length();
        prop_assert!(error <= rounding + drift + beside + 1e-9, "{error} > {}", rounding + drift + beside);
    }
}

#[test]
fn flat_volumes_seen_edge_on_have_a_warp() {
    let volume = unit_box([64, 64, 1]);
    let size = ImageSize::new(64, 64).unwrap();
    let camera =
        Camera::new(Viewpoint::Angles { azimuth: 90.0, elevation: 0.0 }, None, None, &volume, size).unwrap();
    let view = factorise(&volume, camera.camera_from_world());
    let plane = view.base_plane();
    assert_eq!(plane.size(), [1, 64]);
    let inverse = view.image_from_base_plane(&plane, &camera, size).inverse();
    assert!(inverse.is_finite() && inverse.matrix2.determinant() != 0.0);
}

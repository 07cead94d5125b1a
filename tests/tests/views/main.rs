//! Final pictures that must show the same: from both sides of a change of the principal axis, and of the same object in
//! voxels of any shape. [`discretisation`] derives how far each of them may be from the picture of a continuous volume;
//! two of them differ by no more than the sum.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod discretisation;

use discretisation::{Field, Pixels};
use glam::{DMat4, DVec3, DVec4};
use std::sync::Arc;
use std::time::Duration;
use vg500_regs::BlendMode;
use vli::geometry::{Camera, ImageSize, Viewpoint};
use vli::phantom::Phantom;
use vli::values::ValueMapping;
use vli::warp::{Background, BasePlanePixels, warp};
use vli::{BasePlane, Board, Context, LookupTable, Volume, Voxels};

const SIDE: u32 = 96;
/// A bound beyond a quarter of full range says nothing.
const QUARTER: f64 = 255.0 / 4.0;
/// Opacity of the greatest value per smallest voxel spacing.
const OPACITY: f64 = 0.01;

fn board() -> Board {
    Board::embedded(&volumepro_device::Config::default(), Duration::from_secs(20)).unwrap()
}

/// A volume with what bounds need to know of it.
struct Object {
    volume: Volume,
    field: Field,
}

impl Object {
    fn new(size: [u32; 3], values: Vec<u16>, model: &DMat4, interpolation: f64) -> Self {
        let numbers = values.iter().map(|value| f64::from(*value)).collect();
        let field = Field::new(size.map(|side| side as usize), numbers, OPACITY / 4095.0, interpolation);
        let mut volume = Volume::new(size, Voxels::Uint12Lower(Arc::from(values))).unwrap();
        volume.set_model_matrix(model).unwrap();
        Self { volume, field }
    }

    /// A phantom of values up to 4095 that fades away towards the faces.
    fn phantom(phantom: &Phantom, side: u32) -> Self {
        let scalar = phantom.volume([side as usize; 3]).unwrap();
        let voxels = ValueMapping::new(&scalar, None).unwrap().voxels(&scalar);
        let format = voxels.format();
        let values: Vec<u16> = match &voxels {
            Voxels::Uint8(voxels) => voxels.iter().map(|voxel| format.value((*voxel).into())).collect(),
            Voxels::Uint12Lower(voxels) | Voxels::Uint12Upper(voxels) => {
                voxels.iter().map(|voxel| format.value(*voxel)).collect()
            }
        };
        let fade = |place: u32| {
            let margin = f64::from(place.min(side - 1 - place)) / 8.0;
            if margin < 1.0 { (1.0 - (std::f64::consts::PI * margin).cos()) / 2.0 } else { 1.0 }
        };
        let greatest = f64::from(values.iter().copied().max().unwrap());
        let faded = values.iter().zip(0_u32..).map(|(value, place)| {
            let [x, y, z] = [place % side, place / side % side, place / side / side].map(fade);
            (f64::from(*value) / greatest * 4095.0 * x * y * z).round() as u16
        });
        Self::new([side; 3], faded.collect(), &DMat4::IDENTITY, 0.0)
    }
}

/// A context that shows the maximum as grey, or a white fog.
fn context(blend: BlendMode) -> Context {
    let table = match blend {
        BlendMode::Maximum => {
            LookupTable::new((0..4096).map(|value| [(value >> 4) as u8; 3]).collect(), vec![1.0; 4096])
        }
        _ => {
            let opacity = (0..4096).map(|value| OPACITY * f64::from(value) / 4095.0);
            LookupTable::new(vec![[255; 3]; 4096], opacity.collect())
        }
    };
    Context { blend, ..Context::new(table.unwrap()) }
}

/// Base plane and picture.
fn picture(board: &mut Board, object: &Object, camera: &Camera, blend: BlendMode) -> (BasePlane, Vec<u8>) {
    let context = Context { camera: *camera.camera_from_world(), ..context(blend) };
    let plane = board.render(&context, &object.volume).unwrap();
    let size = ImageSize::new(SIDE, SIDE).unwrap();
    let pixels = BasePlanePixels::new(&plane.pixels, plane.size, plane.size[0] as usize * 4).unwrap();
    let map = plane.view.image_from_base_plane(&plane.plane, camera, size);
    let picture = warp(&pixels, &map, size, Background::Color([0; 3]));
    (plane, picture.chunks(3).map(|pixel| pixel[0]).collect())
}

/// What came of comparing two pictures.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    compared: u32,
    unbounded: u32,
    /// Pixels that differ by more than the bound.
    wrong: u32,
    difference: f64,
    part: f64,
}

/// Compares two objects, seen by a camera each; `shift` is by how many voxels their rays may differ.
fn compare(
    board: &mut Board,
    objects: [&Object; 2],
    cameras: [&Camera; 2],
    blend: BlendMode,
    shift: f64,
) -> Outcome {
    let size = ImageSize::new(SIDE, SIDE).unwrap();
    let seen = [0, 1].map(|it| picture(board, objects[it], cameras[it], blend));
    let pixels = [0, 1].map(|it| {
        let spacing = objects[it].volume.place().smallest_spacing();
        Pixels::new(&objects[it].field, &seen[it].0, cameras[it], size, spacing, shift)
    });
    let mut outcome = Outcome::default();
    for (column, row) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (column, row))) {
        let [first, second] = seen.each_ref().map(|(_, picture)| picture[(row * SIDE + column) as usize]);
        if first.max(second) == 0 {
            continue;
        }
        let [Some(a), Some(b)] = pixels.each_ref().map(|pixels| pixels.bounds(column, row)) else { continue };
        let bound = match blend {
            BlendMode::Maximum => a.maximum + b.maximum,
            _ => a.opacity + b.opacity,
        };
        if bound > QUARTER {
            outcome.unbounded += 1;
            continue;
        }
        let difference = f64::from(first.abs_diff(second));
        outcome.compared += 1;
        outcome.wrong += u32::from(difference > bound);
        outcome.difference = outcome.difference.max(difference);
        outcome.part = outcome.part.max(difference / bound);
    }
    outcome
}

fn camera(object: &Object, azimuth: f64, elevation: f64) -> Camera {
    let size = ImageSize::new(SIDE, SIDE).unwrap();
    Camera::new(Viewpoint::Angles { azimuth, elevation }, None, None, object.volume.place(), size).unwrap()
}

/// Degrees on either side of a change of the principal axis.
const BESIDE: f64 = 0.001;

#[test]
fn crossing_45_degrees_changes_no_picture() {
    let mut board = board();
    // Azimuth and elevation of a change, and which of them crosses it.
    let crossings =
        [([45.0, 0.0], 0), ([45.0, 20.0], 0), ([-45.0, -30.0], 0), ([0.0, 45.0], 1), ([135.0, 10.0], 0)];
    for phantom in Phantom::ALL {
        let object = Object::phantom(&phantom, 56);
        for blend in [BlendMode::Alpha, BlendMode::Maximum] {
            let mut total = Outcome::default();
            for (angles, crossing) in crossings {
                let views = [-BESIDE, BESIDE].map(|beside| {
                    let mut angles = angles;
                    angles[crossing] += beside;
                    camera(&object, angles[0], angles[1])
                });
                let axes = views.each_ref().map(|camera| {
                    let context = Context { camera: *camera.camera_from_world(), ..context(blend) };
                    context.shear_warp(&object.volume).unwrap().permutation().axes()[2].axis
                });
                assert!(axes[0] != axes[1], "the principal axis changes at {angles:?}");
                let shift = object.volume.place().diagonal() / 2.0 * (2.0 * BESIDE).to_radians();
                let outcome = compare(&mut board, [&object; 2], views.each_ref(), blend, shift);
                assert_eq!(outcome.wrong, 0, "{phantom}, {blend:?}, {angles:?}: {outcome:?}");
                total.compared += outcome.compared;
                total.unbounded += outcome.unbounded;
                total.difference = total.difference.max(outcome.difference);
                total.part = total.part.max(outcome.part);
            }
            println!(
                "{phantom}, {blend:?}: {} pixels differ by at most {} of 255, {:.2} of a bound; {} without a bound",
                total.compared, total.difference, total.part, total.unbounded
            );
            assert!(blend == BlendMode::Maximum || total.compared > 3000, "{phantom}, {blend:?}: {total:?}");
        }
    }
}

/// Width of a ball of fog in millimetres: f = 3500 e^-(r / WIDTH)^2 / 2, whose second derivatives are at most
/// 3500 / WIDTH^2.
const WIDTH: f64 = 11.0;
const HEIGHT: f64 = 3500.0;

/// A ball of fog, off the middle, in voxels with these world vectors along their axes. Trilinear interpolation is off
/// by l^2 / 8 of a second derivative along each axis of length l, and voxels by 1/2.
fn ball(axes: [DVec3; 3]) -> Object {
    let reach = 4.2 * WIDTH;
    let size = [0, 1, 2].map(|axis| {
        // How far the ball reaches along an axis says the reciprocal one.
        let reciprocal = axes[(axis + 1) % 3].cross(axes[(axis + 2) % 3]);
        2 * (reach * reciprocal.length() / reciprocal.dot(axes[axis]).abs()).ceil() as u32 + 3
    });
    let linear = DMat4::from_cols(axes[0].extend(0.0), axes[1].extend(0.0), axes[2].extend(0.0), DVec4::W);
    let middle = linear.transform_vector3(DVec3::from_array(size.map(|side| (f64::from(side) - 1.0) / 2.0)));
    let model = DMat4::from_translation(-middle) * linear;
    let centre = DVec3::new(2.3, -1.7, 0.9);
    let mut values = Vec::new();
    for z in 0..size[2] {
        for y in 0..size[1] {
            values.extend((0..size[0]).map(|x| {
                let place = model.transform_point3(DVec3::new(x.into(), y.into(), z.into()));
                (HEIGHT * (-place.distance_squared(centre) / (2.0 * WIDTH * WIDTH)).exp()).round() as u16
            }));
        }
    }
    let squares: f64 = axes.iter().map(|axis| axis.length_squared()).sum();
    Object::new(size, values, &model, squares / 8.0 * HEIGHT / (WIDTH * WIDTH) + 0.5)
}

/// The picture's amount of fog, where its middle is, and how wide it is, in pixels.
fn measured(picture: &[u8]) -> [f64; 4] {
    let mut sums = [0.0; 5];
    for (place, level) in picture.iter().enumerate() {
        let [x, y, level] =
            [place % SIDE as usize, place / SIDE as usize, usize::from(*level)].map(|it| it as f64);
        for (sum, term) in sums.iter_mut().zip([level, level * x, level * y, level * x * x, level * y * y]) {
            *sum += term;
        }
    }
    let [amount, x, y, xx, yy] = sums;
    let [x, y] = [x / amount, y / amount];
    [amount, x, y, ((xx + yy) / amount - x * x - y * y).sqrt()]
}

#[test]
fn the_same_object_in_other_voxels_looks_and_measures_the_same() {
    let mut board = board();
    let [x, y] = [DVec3::X, DVec3::Y];
    let isotropic = ball([x, y, DVec3::Z]);
    let tangent = 30.0_f64.to_radians().tan();
    let others = [
        ("1:2", ball([x, y, 2.0 * DVec3::Z])),
        ("1:10", ball([x, y, 10.0 * DVec3::Z])),
        ("sheared by 30 degrees", ball([x, y, DVec3::new(0.0, tangent, 1.0)])),
    ];
    let size = ImageSize::new(SIDE, SIDE).unwrap();
    for [azimuth, elevation] in [[0.0, 0.0], [30.0, 20.0], [90.0, 0.0], [200.0, -50.0]] {
        let view = |object: &Object| {
            let viewpoint = Viewpoint::Angles { azimuth, elevation };
            Camera::new(viewpoint, None, Some(45.0), object.volume.place(), size).unwrap()
        };
        for (name, other) in &others {
            let cameras = [view(&isotropic), view(other)];
            for blend in [BlendMode::Alpha, BlendMode::Maximum] {
                let outcome = compare(&mut board, [&isotropic, other], cameras.each_ref(), blend, 0.0);
                let [expected, found] = [(&isotropic, &cameras[0]), (other, &cameras[1])]
                    .map(|(object, camera)| measured(&picture(&mut board, object, camera, blend).1));
                let relative = [0, 3].map(|it| found[it] / expected[it] - 1.0);
                let moved = (found[1] - expected[1]).hypot(found[2] - expected[2]);
                println!(
                    "{name}, {blend:?}, {azimuth} {elevation}: off by at most {} of 255, {:.2} of a bound ({} pixels, \
                     {} without bound); amount {:+.2} %, width {:+.2} %, moved by {moved:.3} pixels",
                    outcome.difference,
                    outcome.part,
                    outcome.compared,
                    outcome.unbounded,
                    100.0 * relative[0],
                    100.0 * relative[1]
                );
                assert_eq!(outcome.wrong, 0, "{name}, {blend:?}, {azimuth} {elevation}: {outcome:?}");
                assert!(outcome.compared > 2 * outcome.unbounded, "{name}, {blend:?}: {outcome:?}");
            }
        }
    }
}

/// The bounds notice a picture that is wrong: the same ball, seen from nearer.
#[test]
fn another_view_is_another_picture() {
    let mut board = board();
    let ball = ball([DVec3::X, DVec3::Y, DVec3::Z]);
    let size = ImageSize::new(SIDE, SIDE).unwrap();
    let view = |scale| {
        let viewpoint = Viewpoint::Angles { azimuth: 30.0, elevation: 20.0 };
        Camera::new(viewpoint, None, Some(scale), ball.volume.place(), size).unwrap()
    };
    for blend in [BlendMode::Alpha, BlendMode::Maximum] {
        let outcome = compare(&mut board, [&ball; 2], [&view(45.0), &view(25.0)], blend, 0.0);
        println!("{blend:?}: {outcome:?}");
        assert!(outcome.wrong > 100, "{blend:?}: {outcome:?}");
    }
}

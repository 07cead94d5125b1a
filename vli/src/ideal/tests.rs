use super::*;
use crate::geometry::{GeometryError, Supersampling, look_at};
use crate::illumination::{self, diffuse_map, eye_vector, gradient_magnitude_table, specular_map};
use crate::{Board, LookupTable, Modulation as Wanted, Reflection};
use glam::{DMat3, DMat4, DVec2, DVec3};
use std::sync::Arc;
use vg500_regs::BlendMode;
use vg500_regs::memory::Table;
use vg500_regs::reflectance::direction;

const MODES: [BlendMode; 4] = [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Minimum, BlendMode::Sum];

/// A volume of what `value` gives, 12 bits.
fn volume(size: [u32; 3], value: impl Fn([i32; 3]) -> i32) -> Volume {
    let mut voxels = Vec::new();
    for z in 0..size[2] {
        for y in 0..size[1] {
            voxels.extend((0..size[0]).map(|x| value([x, y, z].map(u32::cast_signed)) as u16));
        }
    }
    Volume::new(size, Voxels::Uint12Lower(Arc::from(voxels))).unwrap()
}

/// Values that look random.
fn scattered([x, y, z]: [i32; 3]) -> i32 {
    (x * 1741 + y * 2903 + z * 3539 + x * y * 77 + z * z * 501) & 4095
}

/// A context whose table is a constant colour, and the same as a function.
fn constant(color: [u8; 3], opacity: u16) -> (Context, impl Fn(f64) -> [f64; 4] + Sync) {
    let opacity = f64::from(opacity) / 4095.0;
    let context = Context::new(LookupTable::new(vec![color; 256], vec![opacity; 256]).unwrap());
    let [r, g, b] = color.map(|channel| f64::from(channel) / 255.0);
    (context, move |_| [r, g, b, opacity])
}

/// A camera that looks along a direction in world space.
fn along(x: f64, y: f64, z: f64) -> DMat4 {
    let up = if x == 0.0 && z == 0.0 { DVec3::Z } else { DVec3::Y };
    look_at(DVec3::ZERO, DVec3::new(x, y, z), up).unwrap()
}

fn board() -> Board {
    Board::embedded(&volumepro_device::Config::default(), Duration::from_secs(20)).unwrap()
}

/// Greatest difference between the card's base plane and the ideal one, in steps of 8 bits.
fn difference(board: &mut Board, context: &Context, volume: &Volume, transfer: Transfer<'_>) -> u8 {
    let card = board.render(context, volume).unwrap();
    let ideal = render(context, volume, transfer).unwrap();
    assert_eq!((card.size, card.plane, &card.view), (ideal.size, ideal.plane, &ideal.view));
    assert_eq!((card.report.samples, card.report.passes), (ideal.report.samples, ideal.report.passes));
    assert!(card.pixels.iter().any(|byte| *byte > 0));
    card.pixels.iter().zip(&ideal.pixels).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

#[test]
fn what_the_card_cannot_render_is_refused() {
    let (context, transfer) = constant([1; 3], 1);
    let large = volume([1, 257, 1], |_| 0);
    let error = pixels(&context, &large, &transfer).unwrap_err();
    assert!(matches!(error, RenderError::Geometry(GeometryError::TooLarge { axis: 'y', size: 257 })));
}

#[test]
fn opacity_is_corrected_for_the_distance_of_samples() {
    let (mut context, transfer) = constant([255, 0, 51], 400);
    context.supersampling = Supersampling::new([1, 1, 3], Accumulation::Grow).unwrap();
    context.camera = along(0.3, -0.2, -1.0);
    let mut volume = volume([9, 9, 6], |_| 1000);
    volume.set_model_matrix(&DMat4::from_scale(DVec3::new(0.5, 0.5, 1.0))).unwrap();
    let clear: f64 = 1.0 - 400.0 / 4095.0;
    let most = |context: &Context| {
        let plane = pixels(context, &volume, &transfer).unwrap();
        let opacity = plane.pixels.iter().map(|pixel| pixel[3]).fold(0.0, f64::max);
        let blue = plane.pixels.iter().map(|pixel| pixel[2]).fold(0.0, f64::max);
        assert!((blue - opacity / 5.0).abs() < 1e-12);
        (opacity, plane.view.sample_distance())
    };
    // Sixteen samples; the smallest spacing is 0.5.
    let (opacity, distance) = most(&context);
    assert!((opacity - (1.0 - clear.powf(16.0 * distance / 0.5))).abs() < 1e-12);
    context.correct_opacity = false;
    assert!((most(&context).0 - (1.0 - clear.powi(16))).abs() < 1e-12);
    (context.correct_opacity, context.blend) = (true, BlendMode::Maximum);
    let plane = pixels(&context, &volume, &transfer).unwrap();
    assert!(plane.pixels.iter().all(|pixel| pixel[3] == 0.0 || pixel[3] == 400.0 / 4095.0));
}

#[test]
fn an_averaged_plane_is_the_mean_of_an_interleaved_one() {
    let context = Context::new(LookupTable::ramp(256).unwrap());
    let volume = volume([6, 5, 7], scattered);
    let transfer = |value: f64| [value / 4095.0, 0.3, 1.0 - value / 4095.0, value / 8190.0];
    for blend in MODES {
        let plane = |accumulation| {
            let supersampling = Supersampling::new([2, 3, 2], accumulation).unwrap();
            let context = Context { camera: along(0.5, 0.2, -1.0), supersampling, blend, ..context.clone() };
            pixels(&context, &volume, &transfer).unwrap()
        };
        let [grown, mean] = [Accumulation::Grow, Accumulation::Blend].map(plane);
        let mut expected = vec![[0.0; 4]; mean.pixels.len()];
        for (place, pixel) in grown.pixels.iter().enumerate() {
            let place = place as u32;
            let number = DVec2::new(f64::from(place % grown.size[0]), f64::from(place / grown.size[0]));
            let ray = (grown.plane.pixel_from_ray().inverse().transform_point2(number) + 1e-9).floor();
            // A pixel of the mean stands in the middle of its rays.
            let target =
                mean.plane.pixel_from_ray().transform_point2(ray + DVec2::new(0.25, 1.0 / 3.0)).round();
            let target = target.y as usize * mean.size[0] as usize + target.x as usize;
            expected[target] =
                core::array::from_fn(|channel| expected[target][channel] + pixel[channel] / 6.0);
        }
        let error =
            expected.iter().zip(&mean.pixels).flat_map(|(a, b)| (0..4).map(move |it| (a[it] - b[it]).abs()));
        assert!(error.fold(0.0, f64::max) < 1e-12, "{blend:?}");
    }
}

#[test]
fn pixels_are_rounded_once() {
    let context = Context { blend: BlendMode::Sum, ..Context::new(LookupTable::ramp(256).unwrap()) };
    let volume = volume([8, 8, 5], scattered);
    let transfer = |value: f64| [value / 4095.0, 1.0, 0.0, 0.7];
    let exact = pixels(&context, &volume, &transfer).unwrap();
    let bytes = render(&context, &volume, &transfer).unwrap();
    assert_eq!((exact.size, bytes.pixels.len()), ([8, 8], 8 * 8 * 4));
    for (level, byte) in exact.pixels.iter().flatten().zip(bytes.pixels) {
        assert!((level * 255.0 - f64::from(byte)).abs() <= 0.5 + 1e-9);
    }
}

// The ideal knows what the card is told: where positions are exact, both show the same but for few roundings.

/// Directions whose shear is exact in 8 bits, one for each side of the volume and two aslant.
const VIEWS: [[f64; 3]; 8] = [
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.5, -0.25, -1.0],
    [-1.0, 0.75, 0.5],
];

/// A grey value is off by 1/2 step as it stands in the table, by 0.7 / 16 because samples are rounded, and by 1/2 as a
/// pixel of either renderer: less than 2. In sums it is multiplied by an opacity, and 2 / 16 are for rounding both.
#[test]
fn passes_lie_where_the_card_has_them() {
    let mut board = board();
    let volume = volume([9, 8, 10], scattered);
    let context = Context::new(LookupTable::ramp(4096).unwrap());
    let transfer = |value: f64| [value / 4095.0; 4];
    for (view, accumulation) in VIEWS
        .into_iter()
        .flat_map(|view| [Accumulation::Grow, Accumulation::Blend].map(|accumulation| (view, accumulation)))
    {
        let [x, y, z] = view;
        let modes =
            [([2, 4, 1], BlendMode::Maximum), ([1, 2, 4], BlendMode::Minimum), ([4, 2, 2], BlendMode::Sum)];
        for (factors, blend) in modes {
            let supersampling = Supersampling::new(factors, accumulation).unwrap();
            let context = Context { camera: along(x, y, z), supersampling, blend, ..context.clone() };
            let difference = difference(&mut board, &context, &volume, &transfer);
            assert!(difference <= 1, "{difference}: {view:?} {accumulation:?} {blend:?}");
        }
    }
}

/// Each of at most ten slices, and the cursor in it, adds less than 3 of 4095 (three roundings, and two divisions by
/// 4096 for 4095), 60 together, which are less than 4 of 255; pixels of either renderer are off by 1/2.
#[test]
fn samples_are_hidden_where_the_card_hides_them() {
    let mut board = board();
    let mut volume = volume([9, 8, 10], scattered);
    volume.set_active_subvolume([1, 0, 2], [7, 8, 7]);
    let (mut context, transfer) = constant([200, 90, 255], 1400);
    context.correct_opacity = false;
    context.crop = crate::Crop { slabs: [[2.3, 5.1], [1.9, 6.6], [3.1, 7.4]], flags: crate::Crop::FENCE };
    for (kind, exclude_overlap, disable_crop) in [
        (CursorType::CrossHair, false, true),
        (CursorType::CrossHair, true, false),
        (CursorType::Planes, false, false),
    ] {
        context.cursor = crate::Cursor {
            kind,
            exclude_overlap,
            disable_crop,
            enabled: [true; 3],
            width: 3,
            length: 7,
            position: [4.2, 3.7, 5.3],
            color: [[255, 0, 0, 255], [0, 200, 10, 100], [30, 0, 255, 180]],
        };
        for ([x, y, z], blend) in VIEWS.into_iter().flat_map(|view| MODES.map(|blend| (view, blend))) {
            let context = Context { camera: along(x, y, z), blend, ..context.clone() };
            let difference = difference(&mut board, &context, &volume, &transfer);
            assert!(difference <= 4, "{difference}: {x} {y} {z} {blend:?}");
        }
    }
}

/// One slice of opacity 1 shows the factor of the cut plane. The card's has 8 bits: 1/512. Components of its normal are
/// off by 2^-15, so over 33 + 29 voxels the distance is off by 0.002 of a falloff of 3, and 2^-14 for its own bits.
/// Two products of opacity and three of colour are rounded to 12 bits, and divided by 4096 for 4095 twice. Together
/// that is 0.002 + 0.0007 + 0.0009 < 1 / 255; pixels of either renderer are off by 1/2 of that.
#[test]
fn cut_planes_of_the_world_lie_where_the_card_has_them() {
    let mut board = board();
    let mut volume = volume([33, 29, 1], scattered);
    let model = DMat4::from_translation(DVec3::new(-3.0, 5.0, 2.0))
        * DMat4::from_mat3(DMat3::from_cols(DVec3::new(0.6, 0.8, 0.0), DVec3::new(-1.2, 0.9, 0.0), DVec3::Z));
    volume.set_model_matrix(&model).unwrap();
    let (mut context, transfer) = constant([255, 128, 0], 4095);
    let middle = model.transform_point3(DVec3::new(16.0, 14.0, 0.0));
    for (normal, outside) in [(DVec3::new(0.3, 1.0, 0.2), false), (DVec3::new(-1.0, 0.2, 0.0), true)] {
        let plane = [normal.x, normal.y, normal.z, 0.31 - normal.dot(middle)];
        context.cut_plane = crate::CutPlane::new(plane, 4.7, 3.0, outside);
        assert!(context.cut_plane.is_some());
        let difference = difference(&mut board, &context, &volume, &transfer);
        assert!(difference <= 1, "{difference}: {normal} {outside}");
    }
}

// Light: the plane of a constant gradient.

/// Values that rise by this for each voxel along x, y and z.
const SLOPE: [i32; 3] = [170, 90, -220];

fn lit_plane() -> (Volume, Context) {
    let mut volume =
        volume([8, 9, 8], |at| 2000 + (0..3).map(|axis| SLOPE[axis] * (at[axis] - 4)).sum::<i32>());
    // At the faces gradients are those of replicated voxels.
    volume.set_active_subvolume([1; 3], [6, 7, 6]);
    let (mut context, _) = constant([102, 204, 0], 4095);
    context.blend = BlendMode::Maximum;
    let light = |x, y, z, intensity| illumination::Light::new(DVec3::new(x, y, z), intensity).unwrap();
    context.lights = vec![light(0.5, 0.4, -0.7, 0.6), light(0.2, 0.7, -0.9, 0.3)];
    context.reflection =
        Reflection { diffuse: 0.6, specular: 0.4, emissive: 0.2, exponent: 2.0, color: [0.0, 0.6, 1.0] };
    (volume, context)
}

/// Phong's formula and the gradient table for the world normal of the plane.
#[test]
fn light_and_modulation_are_those_of_the_world() {
    let (mut volume, mut context) = lit_plane();
    let model =
        DMat3::from_cols(DVec3::new(0.9, 0.1, 0.0), DVec3::new(-0.2, 1.0, 0.1), DVec3::new(0.3, 0.5, 2.0));
    volume.set_model_matrix(&DMat4::from_mat3(model)).unwrap();
    context.modulation = Wanted { opacity: true, diffuse: true, specular: false };
    context.gradient_table = [0.9, 0.1, 0.5, 0.6, 0.2, 0.0, 0.0, 0.0];
    let slope = DVec3::from_array(SLOPE.map(f64::from));
    let normal = -(model.inverse().transpose() * slope).normalize();
    // Greatest is 220; the table has seven steps.
    let place = slope.length() * 2.0 * 127.0 / 4095.0 * anisotropy(model) / 220.0 * 7.0;
    assert!(place < 1.0);
    let modulation = 0.9 - 0.8 * place;
    let mut highlights = 0;
    for [x, y, z] in [[0.1, 0.2, -1.0], [-1.0, -0.6, 0.3], [0.2, -1.0, 0.5]] {
        context.camera = along(x, y, z);
        let eye = -DVec3::new(x, y, z).normalize();
        let mirrored = 2.0 * normal.dot(eye) * normal - eye;
        let towards = |light: &illumination::Light| -light.direction();
        let sum = |part: &dyn Fn(DVec3) -> f64| {
            context.lights.iter().map(|light| light.intensity() * part(towards(light))).sum::<f64>().min(1.0)
        };
        let body = 0.2 + 0.6 * modulation * sum(&|light| normal.dot(light).max(0.0));
        let white = 0.4 * sum(&|light| mirrored.dot(light).max(0.0).powi(2));
        assert!(body > 0.3, "{body}");
        highlights += usize::from(white > 0.1);
        let expected = [0.4 * body, 0.8 * body + 0.6 * white, white, 0.9];
        let plane = pixels(&context, &volume, &|_| [0.4, 0.8, 0.0, 0.9]).unwrap();
        let seen: Vec<_> = plane.pixels.iter().filter(|pixel| pixel[3] > 0.0).collect();
        assert!(seen.len() >= 25);
        for pixel in seen {
            assert!((0..4).all(|it| (pixel[it] - expected[it]).abs() < 1e-9), "{pixel:?} {expected:?}");
        }
    }
    assert!(highlights > 0);
}

/// The card's gradient is off by at most 0.56 in each component: half of it, and rounded samples. It is 18 long, so
/// its direction is off by 0.054, and by sqrt(2) / 112 on the cube: 0.067, the reflection by twice as much and as
/// much again on the cube: 0.15. Diffuse light changes by as much times the intensities, 0.9; the map adds
/// 2 (1 + 0.65) (2/7)^2 / 8 = 0.034, as no light grazes the plane. Specular light of exponent 2 changes by at most 1
/// a radian; the map adds 2 (2 + 0.65) (2/7)^2 / 8 = 0.054. With kd = 0.6 and ks = 0.4 that is
/// 0.6 (0.06 + 0.034) + 0.4 (0.135 + 0.054) < 0.133, and 0.005 for entries, coefficients and roundings: 35.2 steps of
/// 255, and 1/2 for the pixel. Blue is the highlight alone.
#[test]
fn the_card_is_lit_as_the_ideal_is() {
    let mut board = board();
    let (mut volume, mut context) = lit_plane();
    let lights = context.lights.clone();
    let transfer = |_| [0.4, 0.8, 0.0, 1.0];
    for turn in [0.0, 0.7, 2.5] {
        let mut highlight = 0.0;
        volume.set_model_matrix(&DMat4::from_rotation_y(turn)).unwrap();
        let turned = DMat3::from_rotation_y(turn);
        let turn_light = |light: &illumination::Light| {
            illumination::Light::new(turned * light.direction(), light.intensity()).unwrap()
        };
        context.lights = lights.iter().map(turn_light).collect();
        // Positions are exact in 8 bits, so that both renderers see the same samples.
        for view in [[0.125, 0.25, -1.0], [0.5, 1.0, -0.75], [0.25, -1.0, 0.5]] {
            let [x, y, z] = (turned * DVec3::from_array(view)).to_array();
            context.camera = along(x, y, z);
            let difference = difference(&mut board, &context, &volume, &transfer);
            println!("off by {difference} of 35");
            assert!(difference <= 35, "{difference}: {turn} {x} {y} {z}");
            let ideal = pixels(&context, &volume, &transfer).unwrap();
            highlight = ideal.pixels.iter().map(|pixel| pixel[2]).fold(highlight, f64::max);
        }
        assert!(highlight * 255.0 > 35.0, "it would be missed: {highlight}");
    }
}

/// A gradient of (24, -8, 56) is the direction (3, -1, 7) of a vertex of the maps, and slopes of 129 (3, -1, 7) give it
/// at a voxel without an error. So in voxels of any shape the surface has the diffuse light of its normal in the world,
/// but for half a step of the map's entry, times 0.6 and a colour of 0.8, half a step of the pixel and less than 1/10
/// for all that has 12 bits: together less than 0.84.
#[test]
fn at_the_vertices_of_maps_voxels_of_any_shape_have_the_light_of_the_world() {
    let mut board = board();
    let (_, mut context) = lit_plane();
    context.reflection.specular = 0.0;
    let [x, y] = [DVec3::X, DVec3::Y];
    let tangent = 30.0_f64.to_radians().tan();
    let turned = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.4);
    let shapes = [
        DMat3::IDENTITY,
        DMat3::from_cols(x, y, 2.0 * DVec3::Z),
        DMat3::from_cols(x, y, 10.0 * DVec3::Z),
        DMat3::from_cols(x, y, DVec3::new(0.0, tangent, 1.0)),
        DMat3::from_cols(-0.7 * x, DVec3::new(0.4, 1.1, -0.2), 3.0 * DVec3::Z),
    ];
    let (mut lit, mut off) = (0, 0.0_f64);
    for (model, turn) in shapes.into_iter().flat_map(|shape| (0..6).map(move |turn| (turned * shape, turn))) {
        let sign = if turn < 3 { 1 } else { -1 };
        let direction = [0, 1, 2].map(|axis| sign * [3, -1, 7][(axis + turn) % 3]);
        let mut volume = volume([3; 3], |at| {
            2000 + (0..3).map(|axis| 129 * direction[axis] * (at[axis] - 1)).sum::<i32>()
        });
        volume.set_active_subvolume([1; 3], [1; 3]);
        volume.set_model_matrix(&DMat4::from_mat3(model)).unwrap();
        let normal = -(model.inverse().transpose() * DVec3::from_array(direction.map(f64::from))).normalize();
        let light =
            |light: &illumination::Light| light.intensity() * (-normal.dot(light.direction())).max(0.0);
        let diffuse: f64 = context.lights.iter().map(light).sum::<f64>().min(1.0);
        lit += usize::from(diffuse > 0.1);
        let expected = [0.4, 0.8, 0.0].map(|color| color * (0.2 + 0.6 * diffuse) * 255.0);
        // Along the axes of voxels samples are voxels.
        for axis in [model.x_axis, model.y_axis, model.z_axis, -model.z_axis] {
            context.camera = along(axis.x, axis.y, axis.z);
            let plane = board.render(&context, &volume).unwrap();
            let mut seen = plane.pixels.chunks(4).filter(|pixel| pixel[3] > 0);
            let pixel = seen.next().unwrap();
            assert!(seen.next().is_none());
            for (found, expected) in pixel.iter().zip(expected) {
                let error = (f64::from(*found) - expected).abs();
                off = off.max(error);
                assert!(error < 0.84, "{pixel:?} {expected:?}: {model} {direction:?}");
            }
        }
    }
    println!("off by {off:.2} of 0.84");
    assert!(lit > 10, "{lit}");
}

/// The words that go into a table of the card.
fn table(context: &Context, volume: &Volume, table: Table) -> volumepro_driver::TableContent {
    let view = context.shear_warp(volume).unwrap();
    let tables = context.tables(volume, &view).unwrap();
    tables.into_iter().find(|content| content.table() == table).unwrap()
}

/// The paper, section 3.5: in isotropic volumes the maps need not be loaded again when the eye moves.
#[test]
fn moving_only_the_camera_changes_no_map_word_of_an_isotropic_volume() {
    let (mut volume, mut context) = lit_plane();
    let anisotropic = DMat4::from_scale(DVec3::new(1.0, 1.0, 1.5));
    let models = [
        DMat4::IDENTITY,
        DMat4::from_rotation_y(0.7) * DMat4::from_rotation_x(-1.1) * DMat4::from_scale(DVec3::splat(0.37)),
        DMat4::from_scale(DVec3::new(-2.0, 2.0, 2.0)),
    ];
    let cameras = (0..200).map(|place| {
        let place = f64::from(place);
        let [x, y, z] = [(1.7 * place).sin(), (2.9 * place + 1.0).sin(), (0.6 * place + 2.0).cos()];
        along(x, y, z + 0.001)
    });
    let cameras: Vec<_> = cameras.collect();
    for model in models {
        volume.set_model_matrix(&model).unwrap();
        let maps = |context: &Context, volume: &Volume| {
            [Table::Diffuse, Table::Specular].map(|map| table(context, volume, map))
        };
        context.camera = along(0.0, 0.0, -1.0);
        let expected = maps(&context, &volume);
        for camera in &cameras {
            context.camera = *camera;
            assert!(maps(&context, &volume) == expected, "{model:?}, {camera:?}");
        }
        // They would notice other lights.
        let lights = std::mem::take(&mut context.lights);
        context.lights = vec![illumination::Light::new(DVec3::new(0.5, 0.4, -0.6), 0.6).unwrap()];
        let [diffuse, specular] = maps(&context, &volume);
        assert!(diffuse != expected[0] && specular != expected[1]);
        context.lights = lights;
    }
    // The eye is part of the correction of anisotropic volumes, in the specular map alone.
    volume.set_model_matrix(&anisotropic).unwrap();
    let both = [&cameras[1], &cameras[2]].map(|camera| {
        context.camera = *camera;
        [Table::Diffuse, Table::Specular].map(|map| table(&context, &volume, map))
    });
    assert!(both[0][0] == both[1][0] && both[0][1] != both[1][1]);
}

/// The entries of the library's maps are what the ideal computes for their directions.
#[test]
fn maps_are_those_of_the_ideal() {
    let (mut volume, mut context) = lit_plane();
    let sheared =
        DMat3::from_cols(DVec3::new(0.9, 0.1, 0.0), DVec3::new(-0.2, 1.0, 0.1), DVec3::new(0.3, 0.5, 3.0));
    for (model, exponent) in [(DMat3::from_rotation_x(0.4) * 0.7, 20.0), (sheared, 9.0), (-sheared, 1.0)] {
        volume.set_model_matrix(&DMat4::from_mat3(model)).unwrap();
        (context.camera, context.reflection.exponent) = (along(0.3, -0.4, -1.0), exponent);
        let lighting = lighting(&context, &volume);
        let diffuse_map = diffuse_map(model, &context.lights);
        let specular_map = specular_map(model, &context.lights, exponent, context.eye());
        let eye = DVec3::from_array(eye_vector(model, context.eye()).map(f64::from)).normalize();
        for (entry, (found_diffuse, found_specular)) in diffuse_map.into_iter().zip(specular_map).enumerate()
        {
            let vector = DVec3::from_array(direction(entry).map(f64::from));
            let [diffuse, _] = lighting.intensities(vector.to_array());
            // A reflection comes from the gradient half-way to the eye.
            let [_, specular] = lighting.intensities((vector.normalize() + eye).to_array());
            // The eye register's 2^-15 moves a highlight by a fraction of a step.
            for (found, expected) in [(found_diffuse, diffuse), (found_specular, specular)] {
                assert!((f64::from(found) - expected * 255.0).abs() <= 0.6, "{entry}: {found} {expected}");
            }
        }
    }
}

#[test]
fn the_gradient_table_is_that_of_the_ideal() {
    let (mut volume, mut context) = lit_plane();
    let scale = DVec3::new(1.0, 0.8, 2.5);
    volume.set_model_matrix(&DMat4::from_scale(scale)).unwrap();
    context.modulation.opacity = true;
    context.gradient_table = [0.0, 0.3, 1.0, 0.2, 0.7, 0.6, 0.1, 0.9];
    let ideal = modulation(&context, &volume).unwrap();
    let table = gradient_magnitude_table(&context.gradient_table, DMat3::from_diagonal(scale));
    for (magnitude, entry) in table.into_iter().enumerate() {
        let [factor] = ideal.function.at(magnitude as f64);
        assert!((factor * 255.0 - f64::from(entry)).abs() <= 0.5 + 1e-9, "{magnitude}: {factor} {entry}");
    }
}

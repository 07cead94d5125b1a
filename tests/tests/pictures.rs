//! Pictures of the whole path, from a volume to a PNG file, against an independent judge.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use glam::{DMat4, DVec3};
use std::path::Path;
use vli::file::{self, ScalarVolume};
use vli::geometry::{Camera, ImageSize, Viewpoint, VolumeBox};
use volumepro_tests::data;
use volumepro_tests::independent_mip::{Scene, maximum_intensity, root_mean_square_error};
use volumepro_tests::programs::volumepro;

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
const SIZE: u32 = 256;

/// Azimuth and elevation: head-on, oblique, near 45 degrees, from behind, from below.
const VIEWS: [[f64; 2]; 5] = [[0.0, 0.0], [30.0, 20.0], [44.0, -44.0], [200.0, 10.0], [70.0, -80.0]];

fn picture(volume: &Path, arguments: &[&str]) -> Vec<f64> {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.png");
    let mut all = vec!["render", volume.to_str().unwrap(), "-o", output.to_str().unwrap()];
    let size = format!("{SIZE}x{SIZE}");
    all.extend(["--size", &size]);
    all.extend(arguments);
    let result = volumepro(VOLUMEPRO, &all).unwrap();
    assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
    let picture = image::open(&output).unwrap().to_rgb8();
    assert!(picture.pixels().all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2]), "grey");
    picture.pixels().map(|pixel| f64::from(pixel[0])).collect()
}

fn judge(volume: &ScalarVolume, [azimuth, elevation]: [f64; 2]) -> Vec<f64> {
    let size = volume.dimensions();
    let model = volume.geometry().world_from_voxel();
    let place = VolumeBox::new(&model, size.map(|side| side as u32)).unwrap();
    let image = ImageSize::new(SIZE, SIZE).unwrap();
    let camera = Camera::new(Viewpoint::Angles { azimuth, elevation }, None, None, &place, image).unwrap();
    let count = size.iter().product();
    let values: Vec<f64> = (0..count).map(|index| volume.samples().value(index).unwrap()).collect();
    let [low, high] =
        values.iter().fold([f64::MAX, f64::MIN], |[low, high], &value| [low.min(value), high.max(value)]);
    let scene = Scene {
        voxels: |i, j, k| values[(k * size[1] + j) * size[0] + i],
        size,
        world_from_voxel: model.to_cols_array_2d(),
        camera_from_world: camera.camera_from_world().to_cols_array_2d(),
        half_height: camera.parallel_scale(),
        range: [low, high],
    };
    maximum_intensity(&scene, [SIZE as usize; 2])
}

/// Every view agrees with the judge within 1 of 255, and no view with the judge of another.
fn compare(path: &Path) {
    let volume = file::open(path, &mut |_, _| {}).unwrap();
    for view in VIEWS {
        let [azimuth, elevation] = view.map(|angle| angle.to_string());
        let found = picture(path, &["--blend", "mip", "--azimuth", &azimuth, "--elevation", &elevation]);
        let error = root_mean_square_error(&found, &judge(&volume, view));
        println!("{} {view:?}: RMSE {error:.3} of 255", path.file_name().unwrap().display());
        assert!(error <= 1.0, "{} {view:?}: RMSE {error}", path.display());
        let wrong = root_mean_square_error(&found, &judge(&volume, [view[0] + 90.0, view[1] + 20.0]));
        assert!(wrong > 10.0, "{} {view:?}: a wrong camera has RMSE {wrong}", path.display());
    }
}

/// A phantom with an axis of each sign and spacing, left-handed, written and read back.
fn awkward_phantom(folder: &Path) -> std::path::PathBuf {
    let size = [50, 41, 33];
    let mut samples = Vec::new();
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let [x, y, z] = [(i, 0), (j, 1), (k, 2)].map(|(at, axis)| at as f64 / size[axis] as f64);
                let blob = |centre: [f64; 3], width: f64| {
                    let distance = DVec3::new(x, y, z).distance_squared(DVec3::from_array(centre));
                    (-distance / width).exp()
                };
                let value = 900.0 * blob([0.2, 0.3, 0.7], 0.02) + 1500.0 * blob([0.7, 0.6, 0.3], 0.03);
                samples.push((value - 1000.0) as i16);
            }
        }
    }
    let directions = glam::DMat3::from_cols(
        DVec3::new(-0.8, 0.1, 0.0),
        DVec3::new(0.0, -0.7, 0.3),
        DVec3::new(0.2, 0.5, 1.9),
    );
    let geometry = file::Geometry { origin: DVec3::new(100.0, -20.0, 7.0), directions };
    let volume = ScalarVolume::new(size, samples.into(), geometry).unwrap();
    let path = folder.join("awkward.nrrd");
    file::nrrd::write(&path, &volume, file::nrrd::Compression::Gzip).unwrap();
    assert!(DMat4::from_mat3(directions).determinant() > 0.0);
    path
}

#[test]
fn projections_of_a_sheared_phantom_agree() {
    let folder = tempfile::tempdir().unwrap();
    compare(&awkward_phantom(folder.path()));
}

#[test]
fn projections_of_phantoms_agree() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["marschner-lobb", "engine-block", "ellipsoids"] {
        let path = folder.path().join(format!("{name}.nrrd"));
        let arguments = ["phantom", name, "--size", "64", "-o", path.to_str().unwrap()];
        assert!(volumepro(VOLUMEPRO, &arguments).unwrap().status.success());
        compare(&path);
    }
}

#[test]
fn projections_of_real_scans_agree() {
    for name in ["ct_head.nrrd", "engine.nrrd", "iron_protein.nrrd", "mr_brain_small.nrrd"] {
        if let Some(path) = data::volume("projections_of_real_scans_agree", name) {
            compare(&path);
        }
    }
}

#[test]
fn a_volume_beyond_256_voxels_is_refused_by_its_size() {
    let Some(path) = data::volume("a_volume_beyond_256_voxels_is_refused_by_its_size", "ct_thorax.nrrd")
    else {
        return;
    };
    let result = volumepro(VOLUMEPRO, &["render", path.to_str().unwrap(), "-o", "never.png"]).unwrap();
    let message = String::from_utf8_lossy(&result.stderr).into_owned();
    assert_eq!(result.status.code(), Some(2), "{message}");
    assert!(message.contains("448"), "{message}");
}

/// The ideal renderer's picture is the judge's but for its rounding: half a step of 8 bits before the warp and half
/// after it, at most 1 anywhere; and the card's is near it.
#[test]
fn ideal_projections_agree() {
    let folder = tempfile::tempdir().unwrap();
    let path = awkward_phantom(folder.path());
    let volume = file::open(&path, &mut |_, _| {}).unwrap();
    let view = [30.0, 20.0];
    let arguments = ["--blend", "mip", "--azimuth", "30", "--elevation", "20", "--renderer", "ideal"];
    let ideal = picture(&path, &arguments);
    let judged = judge(&volume, view);
    let worst = ideal.iter().zip(&judged).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("largest difference {worst:.3} of 255");
    assert!(worst <= 1.01, "{worst}");
    assert!(root_mean_square_error(&picture(&path, &arguments[..6]), &ideal) <= 1.0);
}

/// After a change that is meant to change pictures: make it anew with the README's command, and look at it.
#[test]
fn the_picture_of_the_readme_is_what_the_program_makes() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.png");
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let readme = std::fs::read_to_string(workspace.join("README.md")).unwrap();
    let command = readme.split('`').find(|code| code.starts_with("volumepro render")).unwrap();
    let arguments: Vec<&str> = command
        .split_whitespace()
        .skip(1)
        .map(|word| if word == "out.png" { output.to_str().unwrap() } else { word })
        .collect();
    assert!(volumepro(VOLUMEPRO, &arguments).unwrap().status.success());
    let [shipped, made] = [workspace.join("vli/pictures/engine-block.png"), output]
        .map(|path| image::open(path).unwrap().into_rgb8());
    assert!(shipped == made, "vli/pictures/engine-block.png is not what `{command}` makes");
}

/// Sections are a way to work, not a picture.
#[test]
fn pictures_in_sections_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str, more: &[&str]| {
        let path = folder.path().join(name);
        let common =
            ["--phantom", "engine-block", "--phantom-size", "70", "--azimuth", "30", "--elevation", "-25"];
        let mut all =
            vec!["render", "-o", path.to_str().unwrap(), "--stats", "json", "--supersample", "1,1,2"];
        all.extend(common);
        all.extend(more);
        let result = volumepro(VOLUMEPRO, &all).unwrap();
        assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
        let statistics: serde_json::Value = serde_json::from_slice(&result.stdout).unwrap();
        (std::fs::read(path).unwrap(), statistics["modelled_cycles"].as_u64().unwrap())
    };
    // 96 x 96 x 96 voxels, twice. The sections of MIP, three of them, wait at one boundary for section memory.
    let cycles = 96 * 96 * 96 * 2 / 4;
    for (blend, waiting) in [("alpha", 0), ("mip", 96 * 96 * 2 * 2)] {
        let (picture, whole) = render("whole.png", &["--blend", blend]);
        let (found, in_sections) = render("sections.png", &["--blend", blend, "--sections"]);
        assert!(picture == found, "{blend}");
        assert_eq!((whole, in_sections), (cycles, cycles + waiting), "{blend}");
    }
}

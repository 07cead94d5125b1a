//! What phantoms hold.

use super::*;
use crate::file::{Scalar, with_samples};

fn volume(name: &str, size: [usize; 3]) -> ScalarVolume {
    name.parse::<Phantom>().unwrap().volume(size).unwrap()
}

/// FNV-1a of all samples, as 64-bit integers.
fn hash(volume: &ScalarVolume) -> u64 {
    with_samples!(volume.samples(), values => values.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &value| {
        (hash ^ Scalar::to_f64(value) as u64).wrapping_mul(0x100_0000_01b3)
    }))
}

#[test]
fn impossible_sizes_and_unknown_names_are_refused() {
    for size in [[0, 1, 1], [1, 1025, 1], [usize::MAX; 3]] {
        for phantom in Phantom::ALL {
            assert_eq!(phantom.volume(size).unwrap_err(), SizeError(size[0], size[1], size[2]));
        }
    }
    let error = "cube".parse::<Phantom>().unwrap_err();
    assert!(error.contains("'cube'") && error.contains("engine-block, ellipsoids"), "{error}");
}

#[test]
fn every_phantom_has_a_name_of_its_own_and_any_size() {
    for phantom in Phantom::ALL {
        assert_eq!(phantom.name().parse::<Phantom>().unwrap().description(), phantom.description());
        assert!(!phantom.source().is_empty());
        for size in [[1, 1, 1], [2, 3, 4], [33, 1, 7]] {
            assert_eq!(phantom.volume(size).unwrap().dimensions(), size);
        }
        let spacing = phantom.volume([9, 5, 3]).unwrap().geometry().spacing();
        assert_eq!(spacing, [1.0, 2.0, 4.0]);
    }
}

#[test]
fn phantoms_are_the_same_on_every_machine() {
    let hashes = Phantom::ALL.map(|phantom| (phantom.name(), hash(&phantom.volume([40, 32, 24]).unwrap())));
    let recorded = [
        ("engine-block", 6_281_686_002_733_638_093),
        ("ellipsoids", 1_834_167_317_257_880_127),
        ("marschner-lobb", 5_662_628_185_080_111_645),
        ("sphere-flake", 6_174_364_326_919_909_827),
        ("solid", 3_545_248_067_278_273_317),
        ("sphere", 9_248_439_350_199_031_589),
        ("opaque-sphere", 13_655_330_430_263_332_389),
    ];
    assert_eq!(hashes, recorded);
}

#[test]
fn spheres_have_radius_32_in_64_voxels() {
    let distance = |[i, j, k]: [usize; 3]| {
        [i, j, k].map(|index| (index as f64 - 31.5).powi(2)).iter().sum::<f64>().sqrt()
    };
    for (name, value) in [("sphere", 4.0), ("opaque-sphere", 255.0)] {
        let volume = volume(name, [64; 3]);
        for index in 0..64 * 64 * 64 {
            let place = volume.place(index);
            let wanted = if distance(place) <= 32.0 { value } else { 0.0 };
            assert_eq!(volume.value(place), Some(wanted), "{name} {place:?}");
        }
    }
    assert_eq!(*volume("solid", [64; 3]).samples(), Samples::Uint8(vec![1; 64 * 64 * 64]));
}

#[test]
fn ellipsoids_have_the_densities_of_the_table() {
    let volume = volume("ellipsoids", [201; 3]);
    // A sample every 0.01, the centre at 100.
    let density = |x: f64, y: f64, z: f64| {
        let index = [x, y, z].map(|place| (100.0 + 100.0 * place).round() as usize);
        volume.value(index).unwrap() / 4095.0
    };
    for (place, wanted) in [
        ([0.0, 0.0, 0.0], 0.2),
        ([0.99, 0.0, 0.0], 0.0),
        ([0.0, 0.9, 0.0], 1.0),
        ([0.22, 0.0, 0.0], 0.0),
        ([-0.22, 0.0, 0.0], 0.0),
        ([0.0, 0.35, -0.15], 0.3),
        ([0.0, 0.1, 0.25], 0.3),
        // The left ventricle leans outwards at the top.
        ([-0.33, 0.33, 0.0], 0.0),
        ([-0.33, -0.33, 0.0], 0.2),
    ] {
        let found = density(place[0], place[1], place[2]);
        assert!((found - wanted).abs() < 0.5 / 4095.0 + 1e-9, "{place:?}: {found}");
    }
}

#[test]
fn ellipsoids_are_symmetrical_along_the_body_where_the_table_is() {
    let volume = volume("ellipsoids", [41; 3]);
    for [i, j] in [[20, 2], [5, 20], [8, 12]] {
        // Slices far from the lesions, which lie above and below the middle.
        for k in [3, 4, 5] {
            assert_eq!(volume.value([i, j, k]), volume.value([i, j, 40 - k]), "{i} {j} {k}");
        }
    }
}

#[test]
fn sphere_flakes_have_spheres_of_all_generations() {
    let volume = volume("sphere-flake", [289; 3]);
    let at =
        |place: [f64; 3]| volume.value(place.map(|place| (144.0 + 144.0 * place).round() as usize)).unwrap();
    // First sphere: radius 1/2 around the centre; halfway out the density is a half.
    assert_eq!(at([0.0; 3]), 4095.0);
    assert!((at([0.0, -0.25, 0.0]) - 2047.5).abs() <= 0.5);
    assert_eq!(at([0.0, -0.51, 0.0]), 0.0);
    // Its first child grows along x: radius 1/6 around 2/3.
    assert_eq!(at([2.0 / 3.0, 0.0, 0.0]), 4095.0);
    // And the child's children, radius 1/18, lie 2/9 away from its centre.
    assert_eq!(at([2.0 / 3.0, 0.0, 2.0 / 9.0]), 4095.0);
    assert_eq!(at([0.95, 0.95, 0.95]), 0.0);
}

#[test]
fn engine_blocks_hold_their_materials() {
    let volume = volume("engine-block", [201; 3]);
    let mean = |[x, y, z]: [f64; 3]| {
        // Noise has a standard deviation of 3: five standard errors of the mean of 27 samples are 2.9.
        let index = [x, y, z].map(|place| (100.0 + 100.0 * place).round() as usize);
        let places = (0..27).map(|near| [near % 3, near / 3 % 3, near / 9].map(|step: usize| step));
        places
            .map(|step| volume.value([0, 1, 2].map(|axis| index[axis] + step[axis] - 1)).unwrap())
            .sum::<f64>()
            / 27.0
    };
    for (place, wanted) in [
        // The casting between the cylinders, a liner, the crankshaft, a piston.
        ([0.0, 0.45, 0.2], 120.0),
        ([0.38 + 0.27, 0.3, 0.0], 165.0),
        ([0.92, -0.5, 0.0], 215.0),
        ([-0.38, 0.36, 0.1], 215.0),
    ] {
        assert!((mean(place) - wanted).abs() < 2.9, "{place:?}: {}", mean(place));
    }
    // Above the piston there is air, whose noise is cut off at 0: half a Gaussian has the mean 3 / sqrt(2 pi), and
    // a deviation of 1.75.
    let air = mean([0.38, 0.55, 0.0]);
    assert!((air - 3.0 / (2.0 * std::f64::consts::PI).sqrt()).abs() < 1.7, "{air}");
}

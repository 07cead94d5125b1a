//! Presets on volumes of all kinds.

use super::*;
use crate::file::{Geometry, Samples, ScalarVolume};
use crate::phantom::Phantom;
use proptest::prelude::*;

fn describe(samples: impl Into<Samples>, range: Option<[f64; 2]>) -> (ValueMapping, Histogram) {
    let samples = samples.into();
    let volume = ScalarVolume::new([samples.len(), 1, 1], samples, Geometry::from_spacing([1.0; 3])).unwrap();
    let mapping = ValueMapping::new(&volume, range).unwrap();
    let histogram = Histogram::new(&mapping.voxels(&volume));
    (mapping, histogram)
}

/// Values with how often each occurs.
fn repeated(values: &[(i16, usize)]) -> Vec<i16> {
    values.iter().flat_map(|&(value, count)| std::iter::repeat_n(value, count)).collect()
}

fn automatic(samples: impl Into<Samples>) -> Preset {
    let (mapping, histogram) = describe(samples, None);
    Preset::automatic(&mapping, &histogram)
}

/// Values (-1000 = air) of a body on a table.
fn body(offset: i16) -> Vec<i16> {
    let body =
        [(-1000, 500), (-900, 100), (-300, 20), (-100, 150), (40, 200), (200, 30), (400, 20), (1200, 10)];
    repeated(&body.map(|(value, count)| (value + offset, count)))
}

#[test]
fn unknown_presets_are_refused_and_the_known_ones_listed() {
    for text in ["", "bone", "CT-BONE"] {
        let error = text.parse::<Preset>().unwrap_err();
        assert!(error.contains(&format!("'{text}'")) && error.contains("ct-bone, ct-soft-tissue"), "{error}");
    }
    for preset in Preset::ALL {
        assert_eq!(preset.to_string().parse(), Ok(preset));
        assert!(!preset.description().is_empty());
    }
}

#[test]
fn ct_scans_are_recognised_with_and_without_offset() {
    for offset in [0, 1000, 1024] {
        assert_eq!(automatic(body(offset)), Preset::CtSoftTissue, "{offset}");
    }
    // The range of a scan, but no tissue.
    assert_ne!(automatic((-1000..1500).collect::<Vec<i16>>()), Preset::CtSoftTissue);
    // Tissue, but not the range of a scan.
    assert_ne!(automatic(body(3000)), Preset::CtSoftTissue);
}

#[test]
fn bones_are_opaque_at_their_density_whatever_the_offset() {
    for offset in [0.0, 1024.0] {
        let (mapping, histogram) = describe(body(offset as i16), None);
        let function = Preset::CtBone.function(&mapping, &histogram);
        let opacity = |units: f64| function.at(units + offset)[3];
        assert_eq!([opacity(-1000.0), opacity(50.0), opacity(150.0)], [0.0; 3]);
        assert!((opacity(1000.0) - 0.28).abs() < 1e-12);
    }
    // Other data counts as a scan from air to dense bone: 0 is -1000 units, 300 is 2000.
    let (mapping, histogram) = describe(vec![0_u16, 300], None);
    let opacity = |value| Preset::CtBone.function(&mapping, &histogram).at(value)[3];
    assert_eq!(opacity(114.0), 0.0);
    assert!((opacity(200.0) - 0.28).abs() < 1e-12);
}

#[test]
fn the_kind_of_a_histogram_decides() {
    // Falling all the way.
    let smooth: Vec<(i16, usize)> =
        (0..256).map(|value| (value, 1 + 40_000 / (1 + value as usize))).collect();
    assert_eq!(automatic(repeated(&smooth)), Preset::Smooth);
    let hump = |middle: i16, width: i16, count: usize| {
        (middle - width..middle + width).map(move |value| (value, count)).collect::<Vec<_>>()
    };
    let background = hump(5, 5, 5000);
    let mri = [background.clone(), hump(90, 30, 200), hump(200, 55, 1)].concat();
    assert_eq!(automatic(repeated(&mri)), Preset::MrHead);
    let part = [background, hump(130, 8, 500), hump(220, 20, 30)].concat();
    assert_eq!(automatic(repeated(&part)), Preset::Industrial);
}

#[test]
fn materials_are_found_and_told_apart() {
    let part = [(0, 8000), (10, 500), (118, 300), (120, 1000), (122, 300), (214, 40), (216, 40)];
    let (mapping, histogram) = describe(repeated(&part), None);
    let classes = Classes::new(&mapping, &histogram);
    // Bins are 216/256 wide, and stand for their middles.
    for (mean, wanted) in classes.mean.into_iter().zip([10.0 * 500.0 / 8500.0, 120.0, 215.0]) {
        assert!((mean - wanted).abs() <= 216.0 / 256.0, "{mean} {wanted}");
    }
    let [edge, step] = classes.threshold;
    assert!((10.0..118.0).contains(&edge) && (122.0..214.0).contains(&step), "{classes:?}");
    assert_eq!(classes.dense, 80.0 / 1680.0);
    let function = Preset::Industrial.function(&mapping, &histogram);
    let [red, _, blue, opacity] = function.at(120.0);
    assert!(blue > red && opacity < 0.05);
    let [red, _, blue, opacity] = function.at(215.0);
    assert!(red > blue && opacity > 0.3);
    assert_eq!(function.at(10.0)[3], 0.0);
}

#[test]
fn classes_at_the_upper_end_have_no_peak() {
    let (mapping, histogram) = describe(vec![4050_u16, 4070, 4090], Some([0.0, 4095.0]));
    let classes = Classes::new(&mapping, &histogram);
    assert!(!classes.has_peak);
    assert_eq!(classes.threshold, [4095.0 * 254.0 / 256.0, 4095.0 * 255.0 / 256.0]);
    let (mapping, histogram) = describe(vec![5_u8; 9], None);
    let classes = Classes::new(&mapping, &histogram);
    assert!(!classes.has_peak);
    assert_eq!(classes.mean, [5.0; 3]);
}

#[test]
fn ranges_move_presets() {
    let (mapping, histogram) = describe((0..=255).collect::<Vec<u8>>(), Some([100.0, 200.0]));
    let function = Preset::Grey.function(&mapping, &histogram);
    assert_eq!((function.at(100.0)[0], function.at(200.0)[0]), (0.0, 1.0));
    assert_eq!(function.at(99.0)[3], 0.0);
}

#[test]
fn opacities_of_the_texture_hardware_paper_are_exact() {
    let phantom: Phantom = "sphere".parse().unwrap();
    let volume = phantom.volume([64; 3]).unwrap();
    let mapping = ValueMapping::new(&volume, None).unwrap();
    let histogram = Histogram::new(&mapping.voxels(&volume));
    let (_, opacity) = phantom.preset().function(&mapping, &histogram).entries(&mapping);
    assert_eq!([0, 16, 64, 4080].map(|entry| opacity[entry]), [0.0, 1.0 / 255.0, 4.0 / 255.0, 1.0]);
}

proptest! {
    #[test]
    fn presets_make_tables_of_any_volume(
        bits in prop::collection::vec(any::<u64>(), 1..40),
        integer in any::<bool>(),
        range in prop::option::of((any::<f64>(), any::<f64>())),
    ) {
        let finite = |bits: &u64| Some(f64::from_bits(*bits)).filter(|value| value.is_finite()).unwrap_or(0.0);
        let samples: Samples = if integer {
            bits.iter().map(|&bits| bits as i64).collect::<Vec<_>>().into()
        } else {
            bits.iter().map(finite).collect::<Vec<_>>().into()
        };
        let range = range.filter(|(low, high)| low <= high && low.is_finite() && high.is_finite());
        let (mapping, histogram) = describe(samples, range.map(|(low, high)| [low, high]));
        for preset in Preset::ALL {
            let (color, opacity) = preset.function(&mapping, &histogram).entries(&mapping);
            prop_assert!(crate::LookupTable::new(color, opacity).is_some(), "{preset}");
        }
        let _ = Preset::automatic(&mapping, &histogram);
    }
}

//! `--stats json` and `--explain`: what scripts and people read.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use serde_json::Value;
use volumepro_tests::programs::volumepro;

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");

fn render(arguments: &[&str]) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.png");
    let mut all =
        vec!["render", "--phantom", "ellipsoids", "--phantom-size", "24", "-o", output.to_str().unwrap()];
    all.extend(arguments);
    let result = volumepro(VOLUMEPRO, &all).unwrap();
    let message = String::from_utf8(result.stderr).unwrap();
    assert!(result.status.success(), "{message}");
    (String::from_utf8(result.stdout).unwrap(), message)
}

fn statistics(arguments: &[&str]) -> Value {
    let all: Vec<&str> = ["--stats", "json"].iter().chain(arguments).copied().collect();
    let (output, _) = render(&all);
    assert_eq!(output.lines().count(), 1, "{output}");
    serde_json::from_str(&output).unwrap()
}

#[test]
fn head_on_there_is_one_sample_for_each_voxel() {
    let statistics = statistics(&["--shading", "off"]);
    assert_eq!(statistics["dimensions"], serde_json::json!([24, 24, 24]));
    assert_eq!(statistics["base_plane"], serde_json::json!([24, 24]));
    assert_eq!(statistics["samples"], 24 * 24 * 24);
    // 32^3 padded voxels on four pipelines.
    assert_eq!(statistics["modelled_cycles"], 32 * 32 * 32 / 4);
    assert_eq!(statistics["architecture"], "vg500");
    for name in ["samples_processed", "render_ms", "frame_ms", "warp_ms", "upload_ms", "threads"] {
        assert!(statistics[name].is_number(), "{name}");
    }
    assert!(statistics["simd"].is_string());
    let left_out: Vec<&str> =
        statistics["left_out"].as_array().unwrap().iter().map(|it| it.as_str().unwrap()).collect();
    for stage in ["gradient", "illumination", "crop", "cut", "cursor"] {
        assert!(left_out.contains(&stage), "{left_out:?}");
    }
}

#[test]
fn supersampling_counts_every_sub_sample() {
    let statistics = statistics(&["--supersample", "2,3,4"]);
    // Rays at i + 1/2 in x and at thirds in y end with the last voxel; slices lie at quarters.
    assert_eq!(statistics["base_plane"], serde_json::json!([24 + 23, 24 + 23 + 23]));
    assert_eq!(statistics["samples"], (24 + 23) * (24 + 23 + 23) * (4 * 23 + 1));
    assert_eq!(statistics["modelled_cycles"], 2 * 3 * 4 * 32 * 32 * 32 / 4);
}

#[test]
fn renderers_say_what_they_are_and_have_the_same_samples() {
    let ideal = statistics(&["--renderer", "ideal"]);
    for renderer in ["reference", "optimised", "ideal"] {
        let statistics = statistics(&["--renderer", renderer]);
        assert_eq!(statistics["renderer"], renderer);
        assert_eq!(statistics["samples"], ideal["samples"], "{renderer}");
        assert_eq!(statistics["base_plane"], ideal["base_plane"], "{renderer}");
    }
}

#[test]
fn frames_are_listed_and_their_median_is_given() {
    let statistics = statistics(&["--frames", "5"]);
    for name in ["render_ms", "frame_ms", "warp_ms"] {
        let all = statistics[format!("{name}_all")].as_array().unwrap();
        let mut times: Vec<f64> = all.iter().map(|it| it.as_f64().unwrap()).collect();
        assert_eq!(times.len(), 5, "{name}");
        times.sort_by(f64::total_cmp);
        assert!(times[0] > 0.0, "{name}");
        assert_eq!(statistics[name].as_f64().unwrap(), times[2], "{name}");
    }
}

#[test]
fn explanations_are_for_people_and_not_on_standard_output() {
    let (output, message) = render(&["--explain", "--crop", "0,9,0,9,0,9"]);
    assert!(output.is_empty());
    assert!(message.contains("left out: Gradient magnitude"), "{message}");
    assert!(message.contains("needed: Cropping"), "{message}");
    assert!(!message.contains("left out: Cropping"), "{message}");
}

#[test]
fn what_is_kept_is_not_left_out_and_the_rest_is_measured() {
    let (_, message) = render(&["--explain=time", "--keep", "empty_blocks"]);
    assert!(message.contains("base plane unchanged"), "{message}");
    assert!(
        message.lines().any(|line| line.contains("Gradient magnitude") && line.contains("saved")),
        "{message}"
    );
    let all = statistics(&["--keep", "all"]);
    assert_eq!(all["samples_processed"], all["samples"]);
    let left_out = statistics(&["--keep", "illumination"])["left_out"].to_string();
    assert!(!left_out.contains("illumination") && left_out.contains("modulation"), "{left_out}");
}

#[test]
fn a_full_standard_output_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let script = format!(
        "{VOLUMEPRO} render --phantom sphere --phantom-size 8 -o out.png --stats json >/dev/full; echo $? >code"
    );
    let result =
        std::process::Command::new("sh").arg("-c").arg(script).current_dir(folder.path()).output().unwrap();
    let message = String::from_utf8(result.stderr).unwrap();
    let code = std::fs::read_to_string(folder.path().join("code")).unwrap();
    assert_eq!(code, "1\n", "{message}");
    assert!(message.lines().last().unwrap().starts_with("volumepro: standard output: "), "{message}");
}

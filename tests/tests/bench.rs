//! `volumepro bench`: what scripts read. How fast anything is, no test says.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use serde_json::Value;
use volumepro_tests::programs::volumepro;

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");

fn bench(arguments: &str) -> (String, String) {
    let all: Vec<&str> = ["bench"].into_iter().chain(arguments.split(' ')).collect();
    let result = volumepro(VOLUMEPRO, &all).unwrap();
    let message = String::from_utf8(result.stderr).unwrap();
    assert!(result.status.success(), "{arguments}: {message}");
    (String::from_utf8(result.stdout).unwrap(), message)
}

fn rows(output: &str) -> Vec<Value> {
    output.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn number(row: &Value, field: &str) -> f64 {
    row[field].as_f64().unwrap_or_else(|| panic!("{field}: {row}"))
}

#[test]
fn each_line_is_an_object_with_all_fields() {
    let (output, message) =
        bench("--size 16 --frames 21 --scene none,mip --simd portable --threads 1,2 --bits 8 --json");
    // The machine's limits are not among the objects.
    assert!(message.contains("table look-ups") && message.contains("read bandwidth"), "{message}");
    let rows = rows(&output);
    let kinds: Vec<_> = rows.iter().map(|row| [&row["scene"], &row["threads"], &row["skipping"]]).collect();
    let expected = [1, 2].map(|threads| {
        ["none", "mip"].map(|scene| [false, true].map(|on| [scene.into(), threads.into(), Value::from(on)]))
    });
    assert_eq!(
        kinds,
        expected.as_flattened().as_flattened().iter().map(|kind| kind.each_ref()).collect::<Vec<_>>()
    );
    for row in &rows {
        assert_eq!((&row["axis"], &row["size"], &row["bits"]), (&"+z".into(), &16.into(), &8.into()));
        assert_eq!(row["simd"], "portable");
        for field in ["ms", "msamples_per_s", "cycles_per_sample", "fraction_of_limit", "frame_ms"] {
            assert!(number(row, field) > 0.0, "{field}: {row}");
        }
        assert!(number(row, "median_msamples_per_s") <= number(row, "msamples_per_s"), "{row}");
        let rate = number(row, "samples") / number(row, "ms") / 1e3;
        assert!((rate / number(row, "msamples_per_s") - 1.0).abs() < 1e-9, "{row}");
        let fraction = number(row, "msamples_per_s") / number(row, "limit_msamples_per_s");
        assert!((fraction / number(row, "fraction_of_limit") - 1.0).abs() < 1e-9, "{row}");
        let overhead = number(row, "frame_ms") - number(row, "median_ms");
        assert!((overhead - number(row, "overhead_ms")).abs() < 1e-9, "{row}");
        if row["scene"] == "mip" {
            assert_eq!(row["limit"], "read bandwidth");
        }
        // 16 slices of 16 x 16 voxels; rays between voxels have a column or a row less on most.
        assert!((3000.0..=4096.0).contains(&number(row, "samples")), "{row}");
        if row["skipping"] == false {
            assert_eq!(row["samples_processed"], row["samples"], "{row}");
        }
    }
}

#[test]
fn every_scene_is_drawn_from_every_side() {
    let axes = ["+x", "-x", "+y", "-y", "+z", "-z", "corner"];
    let (output, _) = bench(&format!("--size 8 --axis {} --skipping off --json", axes.join(",")));
    let rows = rows(&output);
    let scenes: Vec<_> = rows.iter().take(11).map(|row| row["scene"].as_str().unwrap()).collect();
    assert_eq!(
        scenes.join(" "),
        "none diffuse full full-unmodulated mip minip sum supersampled cropped opaque thin"
    );
    let seen: Vec<_> = rows.iter().step_by(11).map(|row| row["axis"].as_str().unwrap()).collect();
    assert_eq!((rows.len(), seen), (77, axes.to_vec()));
    // Two sample slices for each voxel slice but the last.
    let samples = |scene: &str| {
        number(rows.iter().find(|row| row["scene"] == scene && row["axis"] == "+z").unwrap(), "samples")
    };
    assert!((1.5..2.0).contains(&(samples("supersampled") / samples("full"))));
}

#[test]
fn opaque_bones_and_air_are_skipped() {
    let (output, _) = bench("--size 64 --scene opaque,thin,none --skipping on --json");
    let part = |row: &Value| number(row, "samples_processed") / number(row, "samples");
    let [opaque, thin, none] = [0, 1, 2].map(|place| part(&rows(&output)[place]));
    assert!(opaque < thin && thin < 0.9 && none == 1.0, "{opaque} {thin} {none}");
}

#[test]
fn people_read_tables() {
    let (output, _) = bench("--size 16 --scene sum --skipping off --axis corner");
    for word in ["limits of this machine", "GHz", "M/s", "16^3 voxels of 12 bits", "noise:"] {
        assert!(output.contains(word), "'{word}' is missing: {output}");
    }
    assert!(output.lines().any(|line| line.starts_with("sum              corner off ")), "{output}");
}

#[test]
fn stages_are_differences_of_frames() {
    let (output, _) = bench("--size 16 --stages --json");
    let rows = rows(&output);
    for stage in ["classification", "gradient and its magnitude", "specular light", "modulation"] {
        let row = rows.iter().find(|row| row["stage"] == stage).unwrap_or_else(|| panic!("no {stage}"));
        assert!(row["difference"].as_str().unwrap().contains(" - "), "{row}");
        assert!(row["ns_per_sample"].is_number() && row["cycles_per_sample"].is_number(), "{row}");
    }
}

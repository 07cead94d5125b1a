//! `--explain`: what a frame needed and what was left out.

use crate::FrameReport;
use vg500_regs::table::report_omitted;

/// The explanation, a line each.
pub fn explain(report: &FrameReport) -> Vec<String> {
    let mut lines = vec![format!(
        "{} samples on {} pass{}, {} processed ({:.1} %)",
        report.samples,
        report.passes,
        if report.passes == 1 { "" } else { "es" },
        report.samples_processed,
        100.0 * report.samples_processed as f64 / report.samples.max(1) as f64,
    )];
    for field in report_omitted::REGISTER.fields {
        if field.get(report.omitted) != 0 {
            lines.push(format!("left out: {}", field.meaning.trim_end_matches('.')));
        }
    }
    lines.push(format!("the real chip would have taken {} clocks", report.cycles));
    lines
}

/// Names of what was left out, in lower case.
pub fn left_out(report: &FrameReport) -> Vec<String> {
    let fields = report_omitted::REGISTER.fields.iter();
    fields.filter(|field| field.get(report.omitted) != 0).map(|field| field.name.to_lowercase()).collect()
}

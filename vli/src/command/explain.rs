//! `--explain`: what a frame needed, and what was left out.

use super::card::Target;
use super::error::Error;
use super::input::Loaded;
use super::messages::say;
use super::progress::Progress;
use super::statistics::{milliseconds, times};
use crate::{BasePlane, Context, FrameReport};
use vg500_regs::Field;
use vg500_regs::table::report_omitted as omitted;

/// Pairs of frames whose times are compared.
const PAIRS: u64 = 7;

/// The explanation, a line each.
pub fn explain(report: &FrameReport) -> Vec<String> {
    let mut lines = vec![format!(
        "{} samples on {} pass{}, {} processed ({})",
        report.samples,
        report.passes,
        if report.passes == 1 { "" } else { "es" },
        report.samples_processed,
        share(report.samples_processed, report.samples),
    )];
    let left_out = report.left_out;
    if left_out.blocks > 0 {
        lines.push(format!(
            "{} of {} blocks of up to 32 samples left out ({}); {} rays finished before their end",
            left_out.blocks_left_out,
            left_out.blocks,
            share(left_out.blocks_left_out, left_out.blocks),
            left_out.rays_finished,
        ));
    }
    for &field in omitted::REGISTER.fields {
        let amount = samples(report, field);
        let name = meaning(field);
        match (field.get(report.omitted) != 0, amount) {
            (true, Some(count)) => {
                lines.push(format!("left out: {name}: {} of the samples", share(count, report.samples)));
            }
            (true, None) => lines.push(format!("left out: {name}")),
            (false, Some(_)) => lines.push(format!("found none: {name}")),
            (false, None) => lines.push(format!("needed: {name}")),
        }
    }
    lines.push(format!("the real chip would have taken {} clocks", report.cycles));
    lines
}

/// How many samples an omission spared, if it spares samples.
fn samples(report: &FrameReport, omission: Field) -> Option<u64> {
    [
        (omitted::EMPTY_BLOCKS, report.empty),
        (omitted::BEATEN_BLOCKS, report.empty),
        (omitted::FINISHED_RAYS, report.finished),
        (omitted::HIDDEN_BLOCKS, report.left_out.hidden),
        (omitted::TRANSPARENT_BLOCKS, report.left_out.transparent),
    ]
    .into_iter()
    .find_map(|(field, count)| (field.mask() == omission.mask()).then_some(count))
}

fn meaning(omission: Field) -> &'static str {
    let first = omission.meaning.split(['.', ':']).next();
    first.unwrap_or(omission.meaning)
}

fn share(part: u64, whole: u64) -> String {
    format!("{:.1} %", 100.0 * part as f64 / whole.max(1) as f64)
}

/// Names of what was left out, in lower case.
pub fn left_out(report: &FrameReport) -> Vec<String> {
    let fields = omitted::REGISTER.fields.iter();
    fields.filter(|field| field.get(report.omitted) != 0).map(|field| field.name.to_lowercase()).collect()
}

/// Says what each omission saved: frames with it and without it take turns. That no pixel depends on it is checked
/// on the way.
pub fn measure(
    target: &mut Target,
    context: &Context,
    loaded: &Loaded,
    drawn: &BasePlane,
) -> Result<(), Error> {
    let mut progress = Progress::new("measuring what was saved");
    let omissions: Vec<_> =
        omitted::REGISTER.fields.iter().filter(|field| field.get(drawn.report.omitted) != 0).collect();
    let mut lines = Vec::new();
    for (place, omission) in omissions.iter().enumerate() {
        let [mut with, mut without] = [Vec::new(), Vec::new()];
        for pair in 0..PAIRS {
            progress.update(place as u64 * PAIRS + pair, omissions.len() as u64 * PAIRS);
            for (keep, reports) in [(0, &mut with), (omission.mask(), &mut without)] {
                target.keep(keep);
                let again = target.render(context, loaded)?;
                if again.pixels != drawn.pixels {
                    let what = omission.name;
                    return Err(Error::failure(format!("KEEP.{what}: pixels depend on it: a defect")));
                }
                reports.push(again.report);
            }
        }
        lines.push(saving(**omission, &with, &without));
    }
    target.keep(0);
    drop(progress);
    lines.iter().for_each(say);
    Ok(())
}

/// What an omission saved.
fn saving(omission: Field, with: &[FrameReport], without: &[FrameReport]) -> String {
    if without.iter().any(|report| omission.get(report.omitted) != 0) {
        return format!("{}: nothing to switch on", meaning(omission));
    }
    let [with, without] = [with, without].map(|reports| times(reports, |report| report.engine_time).0);
    format!(
        "{}: saved {:.2} ms of {without:.2} ms ({:.0} %); base plane unchanged",
        meaning(omission),
        without - with,
        100.0 * (without - with) / without.max(f64::MIN_POSITIVE),
    )
}

/// A line about how long the engine took.
pub fn pace(report: &FrameReport) -> String {
    let time = milliseconds(report.engine_time);
    format!(
        "{time:.2} ms in the engine: {:.0} million samples per second",
        report.samples as f64 / 1e3 / time
    )
}

//! `volumepro render`.

use super::arguments::{Explained, Render};
use super::card::{Description, Target};
use super::error::Error;
use super::input::Loaded;
use super::messages::say;
use super::progress::{Busy, Progress};
use super::statistics::{Statistics, milliseconds, times};
use super::{explain, look, refusals, view};
use crate::file::output;
use crate::geometry::{Camera, ImageSize};
use crate::warp::{Background, BasePlanePixels, warp};
use crate::{BasePlane, Context, FrameReport};
use image::ColorType;
use std::fmt::Display;
use std::io::Cursor;
use std::mem::ManuallyDrop;
use std::path::Path;
use std::time::Instant;

/// Renders a volume to a picture.
pub fn run(arguments: &Render) -> Result<(), Error> {
    refusals::render(arguments)?;
    check_output(&arguments.output)?;
    let loaded = Loaded::from_arguments(arguments)?;
    let (camera, size) = view::camera(&arguments.view, arguments.size, loaded.volume.place())?;
    let transfer = look::transfer(&arguments.look, &loaded)?;
    let mut context = look::context(&arguments.look, &loaded, &camera, &transfer)?;
    context.sections = arguments.card.sections;
    // What the card cannot render is said before a card is opened.
    context.shear_warp(&loaded.volume)?;
    // In a guest it can take more than a minute to close a dead card, because the kernel waits for its reset. The
    // error is not to wait for that: the end of the process closes the card, too.
    let mut target = ManuallyDrop::new(Target::open(&arguments.card, transfer.function.clone())?);
    say(loaded.mapping);
    match transfer.preset {
        Some(preset) => say(format_args!("preset {preset}")),
        None => remark_range(arguments, &loaded),
    }
    let (base_plane, statistics) = render(arguments, &loaded, &context, &mut target)?;
    drop(ManuallyDrop::into_inner(target));
    save(&base_plane, &camera, size, arguments)?;
    arguments.stats.map_or(Ok(()), |format| statistics.print(format))
}

/// A range that changes nothing is not refused, because that depends on the data.
fn remark_range(arguments: &Render, loaded: &Loaded) {
    if arguments.input.range.is_some() && arguments.look.transfer.is_some() && !loaded.mapping.is_scaled() {
        say("--range has no effect: values are kept, and --transfer is in their units");
    }
}

/// A file that cannot be written is refused before anything is computed.
pub fn check_output(path: &Path) -> Result<(), Error> {
    output::check(path).map_err(|error| Error::input(format!("{}: {error}", path.display())))
}

/// Renders all frames, explains the last one if asked for, and returns its base plane and the statistics of all.
fn render(
    arguments: &Render,
    loaded: &Loaded,
    context: &Context,
    target: &mut Target,
) -> Result<(BasePlane, Statistics), Error> {
    let started = Instant::now();
    target.load(loaded)?;
    target.detail(arguments.explain.is_some());
    target.keep(arguments.card.keep.mask());
    let upload = started.elapsed();
    let mut reports: Vec<FrameReport> = Vec::new();
    let mut last = {
        let _busy = Busy::new("rendering");
        target.render(context, loaded)?
    };
    reports.push(last.report);
    let mut progress = Progress::new("rendering");
    for frame in 1..arguments.frames {
        progress.update(frame.into(), arguments.frames.into());
        last = target.render(context, loaded)?;
        reports.push(last.report);
    }
    drop(progress);
    if arguments.explain.is_some() {
        explain::explain(&last.report).iter().for_each(say);
        say(explain::pace(&last.report));
    }
    if arguments.explain == Some(Some(Explained::Time)) {
        explain::measure(target, context, loaded, &last)?;
    }
    let Description { renderer, architecture, simd, threads } = target.describe();
    let (render_ms, render_ms_all) = times(&reports, |report| report.engine_time);
    let (frame_ms, frame_ms_all) = times(&reports, |report| report.frame_time);
    let statistics = Statistics {
        dimensions: loaded.volume.size(),
        base_plane: last.view.base_plane().size(),
        samples: last.report.samples,
        samples_processed: last.report.samples_processed,
        render_ms,
        frame_ms,
        upload_ms: milliseconds(upload),
        render_ms_all,
        frame_ms_all,
        left_out: explain::left_out(&last.report),
        renderer,
        architecture,
        simd,
        threads,
        modelled_cycles: last.report.cycles,
    };
    Ok((last, statistics))
}

/// Warps a base plane to the picture and writes it.
fn save(base_plane: &BasePlane, camera: &Camera, size: ImageSize, arguments: &Render) -> Result<(), Error> {
    let [width, _] = base_plane.size.map(|side| side as usize);
    let pixels =
        BasePlanePixels::new(&base_plane.pixels, base_plane.size, width * 4).map_err(Error::failure)?;
    let map = base_plane.view.image_from_base_plane(&base_plane.plane, camera, size);
    let (background, color) = match arguments.look.background.0 {
        Some(color) => (Background::Color(color), ColorType::Rgb8),
        None => (Background::Transparent, ColorType::Rgba8),
    };
    let picture = warp(&pixels, &map, size, background);
    write_png(&arguments.output, &picture, size, color)
}

fn write_png(path: &Path, picture: &[u8], size: ImageSize, color: ColorType) -> Result<(), Error> {
    let failure = |error: &dyn Display| Error::failure(format!("{}: {error}", path.display()));
    let mut png = Cursor::new(Vec::new());
    let [width, height] = [size.width(), size.height()];
    image::write_buffer_with_format(&mut png, picture, width, height, color, image::ImageFormat::Png)
        .map_err(|error| failure(&error))?;
    output::write_whole(path, |file| file.write_all(png.get_ref())).map_err(|error| failure(&error))
}

//! `volumepro render`.

use super::arguments::{Explained, Look, Render};
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
use std::time::{Duration, Instant};

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
    let window = Window { camera: &camera, size, background: background(&arguments.look) };
    let (picture, statistics) = render(arguments, &loaded, &context, &window, &mut target)?;
    drop(ManuallyDrop::into_inner(target));
    write_png(&arguments.output, &picture, &window)?;
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

/// What the picture shows of a base plane.
struct Window<'a> {
    camera: &'a Camera,
    size: ImageSize,
    background: Background,
}

fn background(look: &Look) -> Background {
    look.background.0.map_or(Background::Transparent, Background::Color)
}

/// A frame: what it was, and how long its warp took.
struct Frame {
    report: FrameReport,
    warp_time: Duration,
}

/// Renders all frames, explains the last one if asked for, and returns its picture and the statistics of all.
fn render(
    arguments: &Render,
    loaded: &Loaded,
    context: &Context,
    window: &Window<'_>,
    target: &mut Target,
) -> Result<(Vec<u8>, Statistics), Error> {
    let started = Instant::now();
    target.load(loaded)?;
    target.detail(arguments.explain.is_some());
    target.keep(arguments.card.keep.mask());
    let upload = started.elapsed();
    let mut frames: Vec<Frame> = Vec::new();
    let (mut last, mut picture) = {
        let _busy = Busy::new("rendering");
        frame(context, loaded, window, target, &mut frames)?
    };
    let mut progress = Progress::new("rendering");
    for place in 1..arguments.frames {
        progress.update(place.into(), arguments.frames.into());
        (last, picture) = frame(context, loaded, window, target, &mut frames)?;
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
    let (render_ms, render_ms_all) = times(&frames, |frame| frame.report.engine_time);
    let (frame_ms, frame_ms_all) = times(&frames, |frame| frame.report.frame_time);
    let (warp_ms, warp_ms_all) = times(&frames, |frame| frame.warp_time);
    let statistics = Statistics {
        dimensions: loaded.volume.size(),
        base_plane: last.view.base_plane().size(),
        samples: last.report.samples,
        samples_processed: last.report.samples_processed,
        render_ms,
        frame_ms,
        warp_ms,
        upload_ms: milliseconds(upload),
        render_ms_all,
        frame_ms_all,
        warp_ms_all,
        left_out: explain::left_out(&last.report),
        renderer,
        architecture,
        simd,
        threads,
        modelled_cycles: last.report.cycles,
    };
    Ok((picture, statistics))
}

/// Renders a frame and warps its base plane to a picture.
fn frame(
    context: &Context,
    loaded: &Loaded,
    window: &Window<'_>,
    target: &mut Target,
    frames: &mut Vec<Frame>,
) -> Result<(BasePlane, Vec<u8>), Error> {
    let base_plane = target.render(context, loaded)?;
    let started = Instant::now();
    let picture = window.show(&base_plane)?;
    frames.push(Frame { report: base_plane.report, warp_time: started.elapsed() });
    Ok((base_plane, picture))
}

impl Window<'_> {
    /// Warps a base plane to the picture.
    fn show(&self, base_plane: &BasePlane) -> Result<Vec<u8>, Error> {
        let [width, _] = base_plane.size.map(|side| side as usize);
        let pixels =
            BasePlanePixels::new(&base_plane.pixels, base_plane.size, width * 4).map_err(Error::failure)?;
        let map = base_plane.view.image_from_base_plane(&base_plane.plane, self.camera, self.size);
        Ok(warp(&pixels, &map, self.size, self.background))
    }

    const fn color(&self) -> ColorType {
        match self.background {
            Background::Color(_) => ColorType::Rgb8,
            Background::Transparent => ColorType::Rgba8,
        }
    }
}

fn write_png(path: &Path, picture: &[u8], window: &Window<'_>) -> Result<(), Error> {
    let failure = |error: &dyn Display| Error::failure(format!("{}: {error}", path.display()));
    let mut png = Cursor::new(Vec::new());
    let [width, height] = [window.size.width(), window.size.height()];
    image::write_buffer_with_format(
        &mut png,
        picture,
        width,
        height,
        window.color(),
        image::ImageFormat::Png,
    )
    .map_err(|error| failure(&error))?;
    output::write_whole(path, |file| file.write_all(png.get_ref())).map_err(|error| failure(&error))
}

//! The plan of what is left out of a frame: what no pixel depends on, unless the frame says to keep it.

use super::features::Features;
use super::finished::{can_finish, finishing_opacity};
use super::slices::Slice;
use super::tables::{Classification, Opaque};
use crate::fixed::widen;
use crate::frame::FrameDescription;
use crate::render::LeftOut;
use vg500_regs::table::report_omitted as omitted;
use vg500_regs::{BlendMode, Field};

/// Whether a frame allows an omission.
#[must_use]
pub const fn allowed(frame: &FrameDescription, omission: Field) -> bool {
    frame.keep & omission.mask() == 0
}

/// What is left out of a frame as its samples stream through.
#[derive(Debug)]
pub struct Omissions {
    /// Interpolation along permuted x, y and z where the weight of the voxel behind is zero.
    pub interpolation: [bool; 3],
    /// Blocks of samples between whose voxels no value is opaque.
    pub empty: Option<Opaque>,
    /// Blocks of samples that cannot hold a new extreme.
    pub beaten: bool,
    /// Samples on rays of at least this opacity.
    pub finished: Option<u16>,
    /// Blocks of samples that are hidden.
    pub hidden: bool,
    /// Shading where all samples of a vector are transparent.
    pub transparent: bool,
}

impl Omissions {
    /// For a frame: what cannot happen in it is not looked for.
    #[must_use]
    pub fn new(frame: &FrameDescription, slices: &[Slice], table: &Classification) -> Self {
        let allowed = |omission| allowed(frame, omission);
        let blend = frame.output.blend;
        let alpha = blend == BlendMode::Alpha;
        let partly_opaque = alpha.then(|| Opaque::new(table)).filter(|opaque| !opaque.all());
        let most = most_opaque(frame, table);
        let goes_on = frame.output.accumulators.is_some();
        let finishes =
            alpha && allowed(omitted::FINISHED_RAYS) && (goes_on || can_finish(most, slices.len()));
        Self {
            interpolation: [omitted::INTERPOLATION_X, omitted::INTERPOLATION_Y, omitted::INTERPOLATION_Z]
                .map(allowed),
            beaten: matches!(blend, BlendMode::Maximum | BlendMode::Minimum)
                && allowed(omitted::BEATEN_BLOCKS),
            finished: finishes.then(|| finishing_opacity(most)),
            hidden: allowed(omitted::HIDDEN_BLOCKS),
            transparent: allowed(omitted::TRANSPARENT_BLOCKS) && partly_opaque.is_some(),
            empty: partly_opaque.filter(|_| allowed(omitted::EMPTY_BLOCKS)),
        }
    }
}

/// The greatest opacity that a sample or the cursor can have.
fn most_opaque(frame: &FrameDescription, table: &Classification) -> u16 {
    let cursor = frame.visibility.cursor.iter().flat_map(|cursor| cursor.color);
    cursor.fold(table.most_opaque(), |most, [.., opacity]| most.max(widen(opacity)))
}

/// The omissions of a frame that its plan knows of, as bits of the register `REPORT_OMITTED`.
#[must_use]
pub fn of_plan(frame: &FrameDescription, features: Features, specialised: bool, slices: &[Slice]) -> u32 {
    let still = |weight: fn(&Slice) -> i16| slices.iter().all(|slice| weight(slice) == 0);
    let interpolation = [
        (omitted::INTERPOLATION_X, still(|slice| slice.x.weight)),
        (omitted::INTERPOLATION_Y, still(|slice| slice.y.weight)),
        (omitted::INTERPOLATION_Z, still(|slice| slice.weight)),
    ];
    let stages = [
        (omitted::GRADIENT, !features.gradient()),
        (omitted::ILLUMINATION, !features.light()),
        (omitted::SPECULAR, !features.specular),
        (omitted::MODULATION, !features.magnitude),
        (omitted::PREMULTIPLICATION, features.premultiplied),
        (omitted::CLASSIFICATION, features.extremes_only()),
        (omitted::DECISIONS, specialised),
        (omitted::COLORS, features.grey),
    ];
    let interpolation =
        interpolation.into_iter().map(|(field, still)| (field, still && allowed(frame, field)));
    let visibility = [omitted::SUBVOLUME, omitted::CROP, omitted::CUT, omitted::CURSOR];
    let visibility = visibility.map(|field| (field, field.get(frame.needs().omitted()) != 0));
    let all = stages.into_iter().chain(interpolation).chain(visibility);
    all.filter(|(_, omitted)| *omitted).fold(0, |bits, (field, _)| bits | field.mask())
}

/// The omissions that a frame's data led to, likewise.
#[must_use]
pub fn by_the_data(omissions: &Omissions, left_out: &LeftOut) -> u32 {
    let unless_beaten = if omissions.beaten { omitted::BEATEN_BLOCKS } else { omitted::EMPTY_BLOCKS };
    let counts = [
        (unless_beaten, left_out.empty),
        (omitted::FINISHED_RAYS, left_out.finished),
        (omitted::HIDDEN_BLOCKS, left_out.hidden),
        (omitted::TRANSPARENT_BLOCKS, left_out.transparent),
    ];
    counts.iter().filter(|(_, count)| *count > 0).fold(0, |bits, (field, _)| bits | field.mask())
}

//! Axes of a header: which three make the volume, and where its samples lie.

use super::super::{FileFault, Geometry};
use super::fields::Fields;
use glam::{DMat3, DVec3};

/// Most axes that a file may have (the format's own limit).
const MAXIMUM_AXES: usize = 16;

/// Kinds of axes along which a volume extends.
const DOMAIN_KINDS: [&str; 5] = ["domain", "space", "time", "none", "???"];

const DIRECTIONS: &str = "space directions";
const ORIGIN: &str = "space origin";
const SPACINGS: &str = "spacings";

/// The axes of a volume in a file of perhaps more axes.
#[derive(Debug, PartialEq)]
pub struct Axes {
    /// Samples along each axis of the file.
    pub sizes: Vec<usize>,
    /// Samples along x, y and z.
    pub dimensions: [usize; 3],
    /// Where they lie.
    pub geometry: Geometry,
}

impl Axes {
    /// Reads and checks all fields about axes.
    pub fn new(fields: &Fields) -> Result<Self, FileFault> {
        let sizes = sizes(fields)?;
        let directions = directions(fields, sizes.len())?;
        let volume = volume_axes(fields, &sizes, directions.as_deref())?;
        let (columns, field) = match directions {
            Some(directions) => (volume.map(|axis| directions[axis].unwrap_or(DVec3::NAN)), DIRECTIONS),
            None => (spaced_directions(fields, sizes.len(), volume)?, SPACINGS),
        };
        let geometry = Geometry {
            origin: origin(fields)?,
            directions: DMat3::from_cols(columns[0], columns[1], columns[2]),
        };
        geometry.check(field, ORIGIN)?;
        Ok(Self { dimensions: volume.map(|axis| sizes[axis]), sizes, geometry })
    }
}

fn sizes(fields: &Fields) -> Result<Vec<usize>, FileFault> {
    let dimension = fields.require("dimension")?;
    let wrong = || FileFault::field("dimension", format!("'{dimension}' is not 1 to {MAXIMUM_AXES}"));
    let axes = dimension.parse().ok().filter(|axes| (1..=MAXIMUM_AXES).contains(axes)).ok_or_else(wrong)?;
    let words = words("sizes", fields.require("sizes")?, axes)?;
    let size = |word: &str| match word.parse() {
        Ok(size) if size > 0 => Ok(size),
        _ => Err(FileFault::field("sizes", format!("'{word}' is not a number of samples"))),
    };
    words.into_iter().map(size).collect()
}

/// The words of a field that has one for each axis.
fn words<'a>(field: &'static str, text: &'a str, axes: usize) -> Result<Vec<&'a str>, FileFault> {
    let words: Vec<&str> = text.split_whitespace().collect();
    if words.len() == axes {
        Ok(words)
    } else {
        Err(FileFault::field(field, format!("{} entries for {axes} axes", words.len())))
    }
}

/// Space directions; `None` for an axis that is not one of space.
fn directions(fields: &Fields, axes: usize) -> Result<Option<Vec<Option<DVec3>>>, FileFault> {
    let Some(text) = fields.get(DIRECTIONS) else { return Ok(None) };
    let vectors = vectors(text).map_err(|what| FileFault::field(DIRECTIONS, what))?;
    if vectors.len() != axes {
        return Err(FileFault::field(DIRECTIONS, format!("{} entries for {axes} axes", vectors.len())));
    }
    Ok(Some(vectors))
}

/// Vectors, written `(x,y,z)` or `none`.
fn vectors(text: &str) -> Result<Vec<Option<DVec3>>, String> {
    let mut vectors = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            vectors.push(None);
            rest = after.trim_start();
            continue;
        }
        let inner = rest.strip_prefix('(').and_then(|rest| rest.split_once(')'));
        let (inner, after) = inner.ok_or_else(|| format!("'{rest}' is neither (x,y,z) nor 'none'"))?;
        let numbers: Option<Vec<f64>> = inner.split(',').map(|number| number.trim().parse().ok()).collect();
        let vector = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        vectors.push(Some(vector.ok_or_else(|| format!("'({inner})' is not three numbers"))?.into()));
        rest = after.trim_start();
    }
    Ok(vectors)
}

/// The three axes of the volume. Others must have a single sample.
fn volume_axes(
    fields: &Fields,
    sizes: &[usize],
    directions: Option<&[Option<DVec3>]>,
) -> Result<[usize; 3], FileFault> {
    let kinds = match fields.get("kinds") {
        Some(text) => words("kinds", text, sizes.len())?,
        None => vec!["domain"; sizes.len()],
    };
    let mut axes = Vec::new();
    for (axis, (&size, kind)) in sizes.iter().zip(kinds).enumerate() {
        let in_space = directions.is_none_or(|directions| directions[axis].is_some());
        let in_domain = DOMAIN_KINDS.iter().any(|domain| domain.eq_ignore_ascii_case(kind));
        match (in_space && in_domain, size) {
            (true, _) => axes.push(axis),
            (false, 1) => {}
            (false, _) => {
                let (field, what) = if in_domain { (DIRECTIONS, "none") } else { ("kinds", kind) };
                let what = format!(
                    "axis {} is '{what}' and has {size} values per voxel; only scalars can be rendered",
                    axis + 1
                );
                return Err(FileFault::field(field, what));
            }
        }
    }
    while axes.len() > 3 && sizes[axes[0]] == 1 {
        axes.remove(0);
    }
    while axes.len() > 3 && axes.last().is_some_and(|&axis| sizes[axis] == 1) {
        axes.pop();
    }
    axes.try_into().map_err(|axes: Vec<usize>| {
        FileFault::field("dimension", format!("{} axes of space, a volume has 3", axes.len()))
    })
}

/// Directions along the axes of space, as long as the spacings; 1 mm where these are not given.
fn spaced_directions(fields: &Fields, axes: usize, volume: [usize; 3]) -> Result<[DVec3; 3], FileFault> {
    let words = match fields.get(SPACINGS) {
        Some(text) => words(SPACINGS, text, axes)?,
        None => vec!["1"; axes],
    };
    let mut directions = DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from_array);
    for (direction, axis) in directions.iter_mut().zip(volume) {
        let spacing = words[axis].parse().ok().filter(|spacing: &f64| spacing.is_finite() && *spacing != 0.0);
        let wrong =
            || FileFault::field(SPACINGS, format!("'{}' is not a spacing in millimetres", words[axis]));
        *direction *= spacing.ok_or_else(wrong)?;
    }
    Ok(directions)
}

fn origin(fields: &Fields) -> Result<DVec3, FileFault> {
    let Some(text) = fields.get(ORIGIN) else { return Ok(DVec3::ZERO) };
    match vectors(text).map_err(|what| FileFault::field(ORIGIN, what))?[..] {
        [Some(origin)] => Ok(origin),
        _ => Err(FileFault::field(ORIGIN, format!("'{text}' is not one vector"))),
    }
}

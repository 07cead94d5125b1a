//! Composes pictures to a labelled sheet.

use crate::font;
use image::{Rgb, RgbImage, imageops};

const BACKGROUND: Rgb<u8> = Rgb([24, 24, 28]);
const HEADING: Rgb<u8> = Rgb([250, 250, 250]);
const CAPTION: Rgb<u8> = Rgb([190, 190, 200]);
/// Pixels between pictures.
const GAP: u32 = 8;
/// Pixels of a dot of headings.
const LARGE: u32 = 2;
/// Lines of a caption.
const LINES: u32 = 2;

/// A picture and what stands below it.
pub struct Tile {
    /// The picture.
    pub picture: RgbImage,
    /// What it shows; longer captions are broken into lines.
    pub caption: String,
}

/// Pictures side by side under a heading.
pub struct Row {
    /// What they have in common.
    pub heading: String,
    /// From left to right.
    pub tiles: Vec<Tile>,
}

/// The sheet of rows below each other. All tiles have room for the largest picture.
#[must_use]
pub fn compose(rows: &[Row]) -> RgbImage {
    let pictures = || rows.iter().flat_map(|row| &row.tiles).map(|tile| &tile.picture);
    let width = pictures().map(RgbImage::width).max().unwrap_or(0);
    let height = pictures().map(RgbImage::height).max().unwrap_or(0);
    let columns = rows.iter().map(|row| row.tiles.len() as u32).max().unwrap_or(0);
    let line = font::HEIGHT + 2;
    let heading = font::HEIGHT * LARGE + GAP;
    let tile = height + GAP + LINES * line;
    let row_height = heading + tile + GAP;
    let mut sheet =
        RgbImage::from_pixel(GAP + columns * (width + GAP), GAP + rows.len() as u32 * row_height, BACKGROUND);
    for (row, top) in rows.iter().zip((GAP..).step_by(row_height as usize)) {
        write(&mut sheet, &row.heading, [GAP, top], LARGE, HEADING);
        for (tile, left) in row.tiles.iter().zip((GAP..).step_by((width + GAP) as usize)) {
            let top = top + heading;
            imageops::replace(&mut sheet, &tile.picture, left.into(), top.into());
            let lines = broken(&tile.caption, width / font::WIDTH);
            for (text, place) in lines.iter().zip(0..LINES) {
                write(&mut sheet, text, [left, top + height + GAP / 2 + place * line], 1, CAPTION);
            }
        }
    }
    sheet
}

/// A text in lines of at most `width` characters, broken between words where possible.
fn broken(text: &str, width: u32) -> Vec<String> {
    let width = width.max(1) as usize;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.chars().take(width).collect()),
        }
    }
    lines
}

/// Writes a line of text; what does not fit is cut off.
fn write(sheet: &mut RgbImage, text: &str, [left, top]: [u32; 2], dot: u32, color: Rgb<u8>) {
    let width = font::WIDTH * dot * text.chars().count() as u32;
    for (x, y) in (0..font::HEIGHT * dot).flat_map(|y| (0..width).map(move |x| (x, y))) {
        if font::has_dot(text, x / dot, y / dot)
            && let Some(pixel) = sheet.get_pixel_mut_checked(left + x, top + y)
        {
            *pixel = color;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(color: [u8; 3], size: [u32; 2], caption: &str) -> Tile {
        Tile { picture: RgbImage::from_pixel(size[0], size[1], Rgb(color)), caption: caption.into() }
    }

    #[test]
    fn pictures_stand_in_rows_and_columns_with_their_labels() {
        let rows = [
            Row {
                heading: "Figure 1".into(),
                tiles: vec![tile([200, 0, 0], [60, 40], "left"), tile([0, 200, 0], [60, 40], "right")],
            },
            Row { heading: "Figure 2".into(), tiles: vec![tile([0, 0, 200], [50, 40], "alone")] },
        ];
        let sheet = compose(&rows);
        let count = |color: Rgb<u8>| sheet.pixels().filter(|pixel| **pixel == color).count();
        assert_eq!(count(Rgb([200, 0, 0])), 60 * 40);
        assert_eq!(count(Rgb([0, 200, 0])), 60 * 40);
        assert_eq!(count(Rgb([0, 0, 200])), 50 * 40);
        assert_eq!(sheet.width(), 3 * GAP + 120);
        assert!(count(HEADING) > 100 && count(CAPTION) > 50);
        let first = |color: Rgb<u8>| sheet.enumerate_pixels().find(|(.., pixel)| **pixel == color).unwrap();
        let [(red, top, _), (green, beside, _), (blue, below, _)] =
            [[200, 0, 0], [0, 200, 0], [0, 0, 200]].map(|color| first(Rgb(color)));
        assert!(red == blue && green > red && top == beside && below > top);
        assert_eq!(compose(&[]).width(), GAP);
    }

    #[test]
    fn captions_are_broken_between_words() {
        assert_eq!(broken("one two three", 7), ["one two", "three"]);
        assert_eq!(broken("incomprehensible", 6), ["incomp"]);
        assert_eq!(broken("", 6), Vec::<String>::new());
    }
}

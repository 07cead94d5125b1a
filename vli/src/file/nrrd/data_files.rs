//! The data files of a detached header.

use super::super::FileFault;
use super::fields::Fields;

const FIELD: &str = "data file";

/// Widest number in a file name.
const MAXIMUM_WIDTH: usize = 64;

/// Names of data files, relative to the header's folder, in the order of their samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DataFiles {
    /// One file with all samples.
    One(String),
    /// Files by name.
    List(Vec<String>),
    /// Files by number.
    Numbered {
        /// The name before the number.
        before: String,
        /// Digits at least.
        width: usize,
        /// Whether zeros fill the width, else blanks.
        zeros: bool,
        /// The name behind the number.
        after: String,
        /// Number of the first file.
        first: i64,
        /// Step to the next.
        step: i64,
        /// How many files.
        count: u64,
    },
}

impl DataFiles {
    /// The files that a header names, if it does, and how many samples of a volume with `sizes` each holds.
    pub fn new(fields: &Fields, sizes: &[usize]) -> Result<Option<(Self, usize)>, FileFault> {
        let Some(text) = fields.get(FIELD) else { return Ok(None) };
        let (files, dimension) = parse(text, &fields.list).map_err(|what| FileFault::field(FIELD, what))?;
        let all = sizes.iter().product();
        let samples = match files {
            Self::One(_) => Some(all),
            _ => samples_per_file(files.count(), dimension.unwrap_or(sizes.len() - 1), sizes),
        };
        let wrong = || FileFault::field(FIELD, format!("{} files do not make up all samples", files.count()));
        Ok(Some((files.clone(), samples.ok_or_else(wrong)?)))
    }

    /// How many files.
    pub fn count(&self) -> u64 {
        match self {
            Self::One(_) => 1,
            Self::List(names) => names.len() as u64,
            Self::Numbered { count, .. } => *count,
        }
    }

    /// The names. They are made one by one, because a header may claim any number of files.
    pub fn names(&self) -> Box<dyn Iterator<Item = String> + '_> {
        match self {
            Self::One(name) => Box::new(std::iter::once(name.clone())),
            Self::List(names) => Box::new(names.iter().cloned()),
            Self::Numbered { before, width, zeros, after, first, step, count } => {
                Box::new((0..*count).map(move |file| {
                    let number = i128::from(*first) + i128::from(file) * i128::from(*step);
                    if *zeros {
                        format!("{before}{number:0width$}{after}")
                    } else {
                        format!("{before}{number:width$}{after}")
                    }
                }))
            }
        }
    }
}

/// The files, and the dimension of what each holds where that is given.
fn parse(text: &str, list: &[String]) -> Result<(DataFiles, Option<usize>), String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let dimension = |word: Option<&&str>| match word {
        None => Ok(None),
        Some(word) => word.parse().map(Some).map_err(|_| format!("'{word}' is not a dimension")),
    };
    if words.first() == Some(&"LIST") {
        if words.len() > 2 || list.is_empty() {
            return Err("LIST wants a dimension or nothing, and names on the lines behind it".into());
        }
        return Ok((DataFiles::List(list.to_vec()), dimension(words.get(1))?));
    }
    let numbers: Option<Vec<i64>> = words.iter().skip(1).map(|word| word.parse().ok()).collect();
    match numbers.as_deref() {
        Some([first, last, step, ..]) if words[0].contains('%') && words.len() <= 5 => {
            Ok((numbered(words[0], *first, *last, *step)?, dimension(words.get(4))?))
        }
        _ if text.is_empty() => Err("is empty".into()),
        _ => Ok((DataFiles::One(text.to_owned()), None)),
    }
}

fn numbered(pattern: &str, first: i64, last: i64, step: i64) -> Result<DataFiles, String> {
    let wrong = || format!("'{pattern}' is not a name with one number as %d or %03d");
    let (before, rest) = pattern.split_once('%').ok_or_else(wrong)?;
    let (digits, after) = rest.split_once(['d', 'i', 'u']).ok_or_else(wrong)?;
    let width = if digits.is_empty() { Some(0) } else { digits.parse().ok() };
    let width = width.filter(|&width| width <= MAXIMUM_WIDTH).ok_or_else(wrong)?;
    if digits.starts_with('+') || after.contains('%') {
        return Err(wrong());
    }
    let steps = (i128::from(last) - i128::from(first)).checked_div(i128::from(step));
    let count = steps.and_then(|steps| u64::try_from(steps + 1).ok()).filter(|&count| count > 0);
    let count = count.ok_or_else(|| format!("{first} to {last} in steps of {step} are no files"))?;
    let zeros = digits.starts_with('0');
    Ok(DataFiles::Numbered { before: before.into(), width, zeros, after: after.into(), first, step, count })
}

/// How many samples each of `files` holds, if it is clear: slabs of `dimension` axes, or with as many axes as the
/// volume equal parts along the last.
fn samples_per_file(files: u64, dimension: usize, sizes: &[usize]) -> Option<usize> {
    let files = usize::try_from(files).ok().filter(|&files| files > 0)?;
    let last = *sizes.last()?;
    if dimension == sizes.len() {
        return last.is_multiple_of(files).then(|| sizes.iter().product::<usize>() / files);
    }
    let (file, rest) = sizes.split_at_checked(dimension)?;
    (dimension > 0 && rest.iter().product::<usize>() == files).then(|| file.iter().product())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        parse(text, &[]).unwrap().0.names().collect()
    }

    #[test]
    fn patterns_that_make_no_names_are_refused() {
        for text in [
            "",
            "LIST",
            "LIST 2 3",
            "a%d 1 2 0",
            "a%d 2 1 1",
            "a%d 1 2 -1",
            "a%x 1 2 1",
            "a%s%d 1 2 1",
            "a%d%d 1 2 1",
            "a%999d 1 2 1",
            "a%+3d 1 2 1",
            "a% 1 2 1",
            "a%d 1 2 1 -2",
        ] {
            assert!(parse(text, &[]).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_are_formatted_as_by_printf() {
        assert_eq!(names("a%d.raw 9 11 1"), ["a9.raw", "a10.raw", "a11.raw"]);
        assert_eq!(names("a%03d.raw 9 5 -2 2"), ["a009.raw", "a007.raw", "a005.raw"]);
        assert_eq!(names("%2i 1 1 5"), [" 1"]);
        assert_eq!(names("a%d 1 2"), ["a%d 1 2"]);
        assert_eq!(names("my data.raw"), ["my data.raw"]);
        let (all, _) = parse("a%d -9223372036854775808 9223372036854775807 2", &[]).unwrap();
        assert_eq!(all.count(), 1 << 63);
        assert_eq!(all.names().next().unwrap(), "a-9223372036854775808");
        assert!(parse("a%d -9223372036854775808 9223372036854775807 1", &[]).is_err());
    }

    #[test]
    fn files_make_up_the_volume() {
        let sizes = [4, 5, 6];
        assert_eq!(samples_per_file(6, 2, &sizes), Some(20));
        assert_eq!(samples_per_file(30, 1, &sizes), Some(4));
        assert_eq!(samples_per_file(3, 3, &sizes), Some(40));
        for (files, dimension) in [(5, 2), (1, 2), (4, 3), (0, 3), (120, 0), (1, 4), (u64::MAX, 2)] {
            assert_eq!(samples_per_file(files, dimension, &sizes), None, "{files} {dimension}");
        }
    }
}

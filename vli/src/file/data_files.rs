//! The data files of a detached header, as NRRD and MetaImage describe them.

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

/// Files whose names are a pattern with one number in it, as by `printf`.
pub fn numbered(pattern: &str, first: i64, last: i64, step: i64) -> Result<DataFiles, String> {
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
pub fn samples_per_file(files: u64, dimension: usize, sizes: &[usize]) -> Option<usize> {
    let files = usize::try_from(files).ok().filter(|&files| files > 0)?;
    let last = *sizes.last()?;
    if dimension == sizes.len() {
        return last.is_multiple_of(files).then(|| sizes.iter().product::<usize>() / files);
    }
    let (file, rest) = sizes.split_at_checked(dimension)?;
    (dimension > 0 && rest.iter().product::<usize>() == files).then(|| file.iter().product())
}

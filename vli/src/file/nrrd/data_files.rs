//! The field `data file`.

use super::super::FileFault;
use super::super::data_files::{DataFiles, numbered, samples_per_file};
use super::fields::Fields;

const FIELD: &str = "data file";

/// The files that a header names, if it does, and how many samples of a volume with `sizes` each holds.
pub fn of(fields: &Fields, sizes: &[usize]) -> Result<Option<(DataFiles, usize)>, FileFault> {
    let Some(text) = fields.get(FIELD) else { return Ok(None) };
    let (files, dimension) = parse(text, &fields.list).map_err(|what| FileFault::field(FIELD, what))?;
    let samples = match files {
        DataFiles::One(_) => Some(sizes.iter().product()),
        _ => samples_per_file(files.count(), dimension.unwrap_or(sizes.len() - 1), sizes),
    };
    let wrong = || FileFault::field(FIELD, format!("{} files do not make up all samples", files.count()));
    let samples = samples.ok_or_else(wrong)?;
    Ok(Some((files, samples)))
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

//! Transfer functions from CSV files with header `value,red,green,blue,opacity`.

use super::{ControlPoint, TransferFunction};
use crate::file::{FileFault, open_regular};
use crate::text::shorten;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// What the first line says.
const HEADER: &str = "value,red,green,blue,opacity";

/// Largest file in bytes: a hundred times one with a row for each of 4096 values.
const MAXIMUM_BYTES: u64 = 1 << 24;

/// Why a file is no transfer function.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct CsvError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub fault: CsvFault,
}

/// What can be wrong with a file.
#[derive(Debug, thiserror::Error)]
pub enum CsvFault {
    /// It cannot be opened.
    #[error(transparent)]
    File(#[from] FileFault),
    /// The operating system refuses to read it, or it is no text.
    #[error("{0}")]
    System(#[from] io::Error),
    /// Larger than any transfer function needs.
    #[error("is larger than {MAXIMUM_BYTES} bytes")]
    TooLarge,
    /// A line is wrong.
    #[error("line {line}: {what}")]
    Line {
        /// Line of the file, counted from 1.
        line: usize,
        /// What is wrong with it.
        what: String,
    },
}

impl TransferFunction {
    /// Reads a CSV file with header `value,red,green,blue,opacity`. Values are in the data's units and do not
    /// decrease, the other columns are 0..=1; the opacity is that of a distance of one smallest voxel spacing. Empty
    /// lines and those that begin with `#` are ignored.
    ///
    /// # Errors
    /// The file cannot be read or is no transfer function; names the line.
    pub fn read_csv(path: &Path) -> Result<Self, CsvError> {
        let read = || {
            let mut text = String::new();
            let (file, _) = open_regular(path).map_err(|error| error.fault)?;
            file.take(MAXIMUM_BYTES + 1).read_to_string(&mut text)?;
            if text.len() as u64 > MAXIMUM_BYTES { Err(CsvFault::TooLarge) } else { parse(&text) }
        };
        read().map_err(|fault| CsvError { path: path.to_owned(), fault })
    }
}

/// Reads the text of a file.
fn parse(text: &str) -> Result<TransferFunction, CsvFault> {
    let wrong = |line, what| CsvFault::Line { line, what };
    let text = text.trim_start_matches('\u{feff}');
    let mut rows = (1..).zip(text.lines()).filter(|(_, row)| {
        let row = row.trim();
        !row.is_empty() && !row.starts_with('#')
    });
    let (line, header) = rows.next().unwrap_or((1, ""));
    let columns: Vec<String> = header.split(',').map(|name| name.trim().to_ascii_lowercase()).collect();
    if columns.join(",") != HEADER {
        return Err(wrong(line, format!("the header is not {HEADER}")));
    }
    let mut lines = Vec::new();
    let mut points = Vec::new();
    for (line, row) in rows {
        points.push(point(row).map_err(|what| wrong(line, what))?);
        lines.push(line);
    }
    TransferFunction::new(points)
        .map_err(|(index, what)| wrong(lines.get(index).map_or(line, |&line| line), what))
}

fn point(row: &str) -> Result<ControlPoint, String> {
    let number = |text: &str| {
        let text = text.trim();
        text.parse::<f64>().map_err(|_| format!("'{}' is not a number", shorten(text, 40)))
    };
    let numbers: Vec<f64> = row.split(',').map(number).collect::<Result<_, _>>()?;
    match numbers[..] {
        [value, red, green, blue, opacity] => Ok(ControlPoint { value, color: [red, green, blue], opacity }),
        _ => Err(format!("{} numbers instead of 5", numbers.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(rows: &str) -> String {
        parse(&format!("{HEADER}\n{rows}")).unwrap_err().to_string()
    }

    #[test]
    fn wrong_lines_are_named() {
        for (rows, message) in [
            ("", "line 1: there are no points"),
            ("\n# nothing\n", "line 1: there are no points"),
            ("0,0,0,0", "line 2: 4 numbers instead of 5"),
            ("0,0,0,0,0,", "line 2: '' is not a number"),
            ("0,0,0,0,0,0", "line 2: 6 numbers instead of 5"),
            ("0,0,0,red,0", "line 2: 'red' is not a number"),
            ("0;0;0;0;0", "line 2: '0;0;0;0;0' is not a number"),
            ("nan,0,0,0,0", "line 2: value NaN is not finite"),
            ("0,0,0,0,0\ninf,0,0,0,0", "line 3: value inf is not finite"),
            ("0,0,0,0,0\n\n# back\n-1,0,0,0,0", "line 5: value -1 is less than 0 before it"),
            ("0,1.5,0,0,0", "line 2: red 1.5 is not in 0..1"),
            ("0,0,-0.1,0,0", "line 2: green -0.1 is not in 0..1"),
            ("0,0,0,nan,0", "line 2: blue NaN is not in 0..1"),
            ("0,0,0,0,255", "line 2: opacity 255 is not in 0..1"),
        ] {
            assert_eq!(refused(rows), message, "{rows}");
        }
        for header in ["", "0,0,0,0,0", "value,opacity,red,green,blue", "value;red;green;blue;opacity"] {
            let error = parse(&format!("{header}\n0,0,0,0,0\n")).unwrap_err().to_string();
            assert!(error.ends_with("the header is not value,red,green,blue,opacity"), "{header}: {error}");
        }
    }

    #[test]
    fn files_that_cannot_be_read_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("transfer.csv");
        assert!(
            TransferFunction::read_csv(&path).unwrap_err().to_string().contains("transfer.csv: No such file")
        );
        let error = TransferFunction::read_csv(folder.path()).unwrap_err().to_string();
        assert!(error.ends_with("is a folder, not a file"), "{error}");
        let error = TransferFunction::read_csv(Path::new("/dev/null")).unwrap_err().to_string();
        assert_eq!(error, "/dev/null: is not a regular file");
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(TransferFunction::read_csv(&path).unwrap_err().to_string().contains("UTF-8"));
        std::fs::write(&path, vec![b' '; (1 << 24) + 1]).unwrap();
        assert!(TransferFunction::read_csv(&path).unwrap_err().to_string().contains("larger than"));
        std::fs::write(&path, format!("{HEADER}\n1,2,0,0,0\n")).unwrap();
        assert!(
            TransferFunction::read_csv(&path)
                .unwrap_err()
                .to_string()
                .ends_with("transfer.csv: line 2: red 2 is not in 0..1")
        );
    }

    #[test]
    fn functions_are_read() {
        let text =
            "\u{feff}Value, Red,green,blue,opacity\r\n# bone\r\n-1e3, 0, 0.5, 1, 0\r\n\r\n200,1,0.5,0,1\r\n";
        let function = parse(text).unwrap();
        assert_eq!(function.points().len(), 2);
        assert_eq!(function.at(-400.0), [0.5, 0.5, 0.5, 0.5]);
    }
}

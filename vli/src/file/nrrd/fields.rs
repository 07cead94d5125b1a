//! The lines of a header.

use super::super::FileFault;
use std::collections::BTreeMap;
use std::io::{BufRead, Read};

/// Longest header in bytes. Real ones have a few thousand; lists of data files, key/value pairs and labels of
/// thousands of entries fit too.
const MAXIMUM_HEADER: u64 = 1 << 22;

/// The fields of the format, each with its other spelling.
const FIELDS: [(&str, &str); 30] = [
    ("axis maxs", "axismaxs"),
    ("axis mins", "axismins"),
    ("block size", "blocksize"),
    ("byte skip", "byteskip"),
    ("centers", "centerings"),
    ("content", "content"),
    ("data file", "datafile"),
    ("dimension", "dimension"),
    ("encoding", "encoding"),
    ("endian", "endian"),
    ("kinds", "kinds"),
    ("labels", "labels"),
    ("line skip", "lineskip"),
    ("max", "max"),
    ("measurement frame", "measurementframe"),
    ("min", "min"),
    ("number", "number"),
    ("old max", "oldmax"),
    ("old min", "oldmin"),
    ("sample units", "sampleunits"),
    ("sizes", "sizes"),
    ("space", "space"),
    ("space dimension", "spacedimension"),
    ("space directions", "spacedirections"),
    ("space origin", "spaceorigin"),
    ("space units", "spaceunits"),
    ("spacings", "spacings"),
    ("thicknesses", "thicknesses"),
    ("type", "type"),
    ("units", "units"),
];

/// The fields of a header, unread values still as text.
#[derive(Debug, Default)]
pub struct Fields {
    values: BTreeMap<&'static str, String>,
    /// The lines behind `data file: LIST`.
    pub list: Vec<String>,
    /// Bytes of the header, the empty line at its end included.
    pub length: u64,
    /// Whether an empty line ended it, behind which samples may follow.
    pub ended: bool,
    /// What was ignored.
    pub remarks: Vec<String>,
}

impl Fields {
    /// Reads lines up to the first empty one, or to the end of the file.
    pub fn read(reader: &mut dyn BufRead) -> Result<Self, FileFault> {
        let mut reader = reader.take(MAXIMUM_HEADER);
        let mut fields = Self::default();
        let mut line = Vec::new();
        for number in 1.. {
            line.clear();
            let length = reader.read_until(b'\n', &mut line)?;
            fields.length += length as u64;
            if reader.limit() == 0 {
                let what = format!("the header is longer than {MAXIMUM_HEADER} bytes");
                return Err(FileFault::Line { line: number, what });
            }
            let text = String::from_utf8_lossy(&line);
            let text = text.trim_end_matches(['\n', '\r']);
            if number == 1 {
                check_magic(text)?;
            } else if length == 0 || text.is_empty() {
                fields.ended = length > 0;
                break;
            } else {
                fields.take(text).map_err(|what| FileFault::Line { line: number, what })?;
            }
        }
        Ok(fields)
    }

    fn take(&mut self, text: &str) -> Result<(), String> {
        if self.lists_files() {
            self.list.push(text.to_owned());
            return Ok(());
        }
        if text.starts_with('#') {
            return Ok(());
        }
        let wrong = || format!("'{}' is neither a field, a key/value pair nor a comment", shorten(text));
        let (name, value) = text.split_once(':').ok_or_else(wrong)?;
        if value.starts_with('=') {
            return Ok(());
        }
        let lower = name.trim().to_ascii_lowercase();
        let Some((known, _)) = FIELDS.into_iter().find(|names| names.0 == lower || names.1 == lower) else {
            self.remarks.push(format!("field '{}' is unknown and ignored", shorten(name)));
            return Ok(());
        };
        match self.values.insert(known, value.trim().to_owned()) {
            Some(_) => Err(format!("field '{known}' is given twice")),
            None => Ok(()),
        }
    }

    fn lists_files(&self) -> bool {
        self.get("data file").is_some_and(|value| value.split_whitespace().next() == Some("LIST"))
    }

    /// Text of a field, if it is given.
    pub fn get(&self, name: &'static str) -> Option<&str> {
        self.values.get(name).map(String::as_str)
    }

    /// Text of a field that must be given.
    pub fn require(&self, name: &'static str) -> Result<&str, FileFault> {
        self.get(name).ok_or_else(|| FileFault::field(name, "is missing"))
    }
}

fn check_magic(text: &str) -> Result<(), FileFault> {
    match text.trim_end() {
        "NRRD00.01" | "NRRD0001" | "NRRD0002" | "NRRD0003" | "NRRD0004" | "NRRD0005" => Ok(()),
        other => {
            let what = format!("'{}' is not NRRD0001 to NRRD0005", shorten(other));
            Err(FileFault::Line { line: 1, what })
        }
    }
}

/// The beginning of a text, fit for a message.
fn shorten(text: &str) -> String {
    text.chars().filter(|character| !character.is_control()).take(40).collect()
}

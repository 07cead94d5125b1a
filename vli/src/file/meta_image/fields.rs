//! The lines of a header.

use super::super::FileFault;
use crate::text::shorten;
use glam::DMat3;
use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::str::FromStr;

/// Longest header in bytes, with room for a list of thousands of files.
const MAXIMUM_HEADER: u64 = 1 << 22;

/// The fields of a header, values still as text.
#[derive(Debug, Default)]
pub struct Fields {
    values: BTreeMap<String, String>,
    /// The lines behind the last field where that is a list.
    pub list: Vec<String>,
    /// Bytes of the header; samples may follow.
    pub length: u64,
}

/// The fault of a field that is not there.
pub fn missing(name: &'static str) -> FileFault {
    FileFault::field(name, "is missing")
}

impl Fields {
    /// Reads lines up to the field called `last`, and those behind it if it says that they are a list.
    pub fn read(reader: &mut dyn BufRead, last: &'static str) -> Result<Self, FileFault> {
        let mut reader = reader.take(MAXIMUM_HEADER);
        let mut fields = Self::default();
        let mut line = Vec::new();
        for number in 1.. {
            line.clear();
            let length = reader.read_until(b'\n', &mut line)?;
            fields.length += length as u64;
            let wrong = |what: String| FileFault::Line { line: number, what };
            if reader.limit() == 0 {
                return Err(wrong(format!("the header is longer than {MAXIMUM_HEADER} bytes")));
            }
            let listed = fields.get(last).is_some();
            if length == 0 {
                return if listed { Ok(fields) } else { Err(missing(last)) };
            }
            let text = String::from_utf8_lossy(&line);
            let text = text.trim();
            match text.split_once('=') {
                _ if text.is_empty() => {}
                _ if listed => fields.list.push(text.to_owned()),
                None => return Err(wrong(format!("'{}' is no field", shorten(text, 40)))),
                Some((name, value)) => fields.take(name.trim(), value.trim()).map_err(wrong)?,
            }
            let is_list = |value: &str| value.split_whitespace().next() == Some("LIST");
            if fields.get(last).is_some_and(|value| !is_list(value)) {
                break;
            }
        }
        Ok(fields)
    }

    fn take(&mut self, name: &str, value: &str) -> Result<(), String> {
        match self.values.insert(name.to_owned(), value.to_owned()) {
            Some(_) => Err(format!("field '{}' is given twice", shorten(name, 40))),
            None => Ok(()),
        }
    }

    /// Text of a field, if it is given.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.values.get(name).map(String::as_str)
    }

    /// Text of a field that must be given.
    pub fn require(&self, name: &'static str) -> Result<&str, FileFault> {
        self.get(name).ok_or_else(|| missing(name))
    }

    /// The first of these fields that is given.
    pub fn first(&self, names: &[&'static str]) -> Option<(&'static str, &str)> {
        names.iter().find_map(|name| Some((*name, self.get(name)?)))
    }

    /// The numbers of a field, if it is given, which must be so many.
    pub fn numbers<T: FromStr>(&self, name: &'static str, count: usize) -> Result<Option<Vec<T>>, FileFault> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let number = |word: &str| {
            let wrong = || FileFault::field(name, format!("'{}' is not such a number", shorten(word, 40)));
            word.parse().map_err(|_| wrong())
        };
        let numbers: Vec<T> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
        if numbers.len() != count {
            return Err(FileFault::field(name, format!("{} numbers instead of {count}", numbers.len())));
        }
        Ok(Some(numbers))
    }

    /// The axes that the header speaks of: three, or four of which the last one is left out.
    fn axes(&self) -> usize {
        if self.get("NDims") == Some("4") { 4 } else { 3 }
    }

    /// A number for each axis of space.
    pub fn numbers_of_space(&self, name: &'static str) -> Result<Option<Vec<f64>>, FileFault> {
        let numbers = self.numbers(name, self.axes())?;
        Ok(numbers.map(|numbers| numbers.into_iter().take(3).collect()))
    }

    /// The directions of the axes of space, which the file lists one after the other.
    pub fn matrix(&self, name: &'static str) -> Result<DMat3, FileFault> {
        let axes = self.axes();
        let numbers: Vec<f64> = self.numbers(name, axes * axes)?.ok_or_else(|| missing(name))?;
        let space: Vec<f64> =
            numbers.chunks(axes).take(3).flat_map(|axis| axis.iter().take(3).copied()).collect();
        Ok(DMat3::from_cols_slice(&space))
    }
}

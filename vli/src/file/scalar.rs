//! Scalar types of samples, and vectors of samples of any of them.

use super::layout::Meaning;
use std::collections::TryReserveError;
use std::fmt;
use std::io::{self, Write};
use std::str::FromStr;

/// Order of the bytes of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

impl FromStr for ByteOrder {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "little" => Ok(Self::Little),
            "big" => Ok(Self::Big),
            other => Err(format!("'{other}' is neither 'little' nor 'big'")),
        }
    }
}

/// What every sample can do, whatever its type.
pub(crate) trait Scalar: Copy + PartialOrd {
    /// The value; 64-bit integers beyond 2^53 are rounded to nearest.
    fn to_f64(self) -> f64;
    /// The value that a number is rounded to, towards zero for integers.
    fn from_f64(number: f64) -> Self;
    /// Whether it is neither NaN nor infinite.
    fn is_finite(self) -> bool;
    /// The low bits of an integer, which keep its sign if it has one.
    fn low_bits(self, bits: u32) -> Self;
}

/// Evaluates an expression with the vector of samples bound to a name, whatever its type.
macro_rules! with_samples {
    ($samples:expr, $values:ident => $body:expr) => {
        match $samples {
            $crate::file::Samples::Int8($values) => $body,
            $crate::file::Samples::Uint8($values) => $body,
            $crate::file::Samples::Int16($values) => $body,
            $crate::file::Samples::Uint16($values) => $body,
            $crate::file::Samples::Int32($values) => $body,
            $crate::file::Samples::Uint32($values) => $body,
            $crate::file::Samples::Int64($values) => $body,
            $crate::file::Samples::Uint64($values) => $body,
            $crate::file::Samples::Float32($values) => $body,
            $crate::file::Samples::Float64($values) => $body,
        }
    };
}
pub(crate) use with_samples;

macro_rules! scalar_types {
    ($($variant:ident $type:ty, $finite:expr, $low:expr, $name:literal $(, $alias:literal)*;)*) => {
        /// Type of a sample.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the names are the meaning")]
        pub enum ScalarType { $($variant,)* }

        impl ScalarType {
            /// All types.
            pub const ALL: [Self; 10] = [$(Self::$variant,)*];

            /// The name that is written to files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// Bytes per sample.
            #[must_use]
            pub const fn bytes(self) -> usize {
                match self { $(Self::$variant => size_of::<$type>(),)* }
            }

            /// The least and the greatest finite number of so many low bits.
            pub(super) fn ends(self, bits: u32) -> [f64; 2] {
                match self {
                    $(Self::$variant => {
                        // All bits are ones, or all but the sign.
                        let spare = (8 * size_of::<$type>() as u32).saturating_sub(bits);
                        [<$type>::MIN, <$type>::MAX].map(|end| Scalar::to_f64(end) * 0.5_f64.powi(spare as i32)).map(f64::floor)
                    })*
                }
            }
        }

        impl FromStr for ScalarType {
            type Err = String;

            /// Reads the names and aliases of the NRRD format.
            fn from_str(text: &str) -> Result<Self, String> {
                match text {
                    $($name $(| $alias)* => Ok(Self::$variant),)*
                    other => Err(format!(
                        "'{other}' is not a scalar type; known are {}",
                        Self::ALL.map(Self::name).join(", "),
                    )),
                }
            }
        }

        /// Samples of one type.
        #[derive(Clone, Debug, PartialEq)]
        #[allow(missing_docs, reason = "the names are the meaning")]
        pub enum Samples { $($variant(Vec<$type>),)* }

        impl Samples {
            /// No samples yet, with memory for `count`.
            ///
            /// # Errors
            /// There is not so much memory.
            pub fn with_capacity(scalar: ScalarType, count: usize) -> Result<Self, TryReserveError> {
                match scalar {
                    $(ScalarType::$variant => {
                        let mut values = Vec::new();
                        values.try_reserve_exact(count)?;
                        Ok(Self::$variant(values))
                    })*
                }
            }

            /// Type of the samples.
            #[must_use]
            pub const fn scalar_type(&self) -> ScalarType {
                match self { $(Self::$variant(_) => ScalarType::$variant,)* }
            }

            /// Appends the samples in `bytes`; an incomplete one at the end is dropped.
            pub(super) fn append(&mut self, bytes: &[u8], order: ByteOrder) {
                match self {
                    $(Self::$variant(values) => {
                        let samples = bytes.as_chunks().0.iter();
                        match order {
                            ByteOrder::Little => values.extend(samples.map(|&sample| <$type>::from_le_bytes(sample))),
                            ByteOrder::Big => values.extend(samples.map(|&sample| <$type>::from_be_bytes(sample))),
                        }
                    })*
                }
            }

            /// Appends what stored numbers mean, where that is what samples can be.
            pub(super) fn append_meanings(&mut self, numbers: &Self, meaning: &Meaning) {
                with_samples!(numbers, numbers => {
                    let mut meanings =
                        numbers.iter().map(|number| meaning.of(Scalar::to_f64(number.low_bits(meaning.bits))));
                    self.append_values(&mut meanings);
                });
            }

            fn append_values(&mut self, meanings: &mut dyn Iterator<Item = f64>) {
                match self {
                    $(Self::$variant(values) => values.extend(meanings.map(<$type as Scalar>::from_f64)),)*
                }
            }

            /// Appends a sample written as text; `false` if it is not a number of the type.
            #[must_use]
            pub(super) fn append_text(&mut self, text: &str) -> bool {
                match self {
                    $(Self::$variant(values) => text.parse().map(|value| values.push(value)).is_ok(),)*
                }
            }

            /// Writes all samples, least significant byte first.
            pub(super) fn write_to(&self, writer: &mut dyn Write) -> io::Result<()> {
                /// Samples that are converted at a time.
                const BLOCK: usize = 1 << 16;
                match self {
                    $(Self::$variant(values) => values.chunks(BLOCK).try_for_each(|block| {
                        let bytes: Vec<u8> = block.iter().flat_map(|value| value.to_le_bytes()).collect();
                        writer.write_all(&bytes)
                    }),)*
                }
            }
        }

        $(
            impl From<Vec<$type>> for Samples {
                fn from(values: Vec<$type>) -> Self {
                    Self::$variant(values)
                }
            }

            impl Scalar for $type {
                fn to_f64(self) -> f64 {
                    self as f64
                }

                fn from_f64(number: f64) -> Self {
                    number as Self
                }

                fn is_finite(self) -> bool {
                    let finite: fn($type) -> bool = $finite;
                    finite(self)
                }

                fn low_bits(self, bits: u32) -> Self {
                    let low: fn($type, u32) -> $type = $low;
                    low(self, (8 * size_of::<$type>() as u32).saturating_sub(bits))
                }
            }
        )*
    };
}

scalar_types! {
    Int8 i8, |_| true, |value, spare| value << spare >> spare, "int8", "signed char", "int8_t";
    Uint8 u8, |_| true, |value, spare| value << spare >> spare, "uint8", "uchar", "unsigned char", "uint8_t";
    Int16 i16, |_| true, |value, spare| value << spare >> spare, "int16", "short", "short int", "signed short", "signed short int", "int16_t";
    Uint16 u16, |_| true, |value, spare| value << spare >> spare, "uint16", "ushort", "unsigned short", "unsigned short int", "uint16_t";
    Int32 i32, |_| true, |value, spare| value << spare >> spare, "int32", "int", "signed int", "int32_t";
    Uint32 u32, |_| true, |value, spare| value << spare >> spare, "uint32", "uint", "unsigned int", "uint32_t";
    Int64 i64, |_| true, |value, spare| value << spare >> spare, "int64", "longlong", "long long", "long long int", "signed long long",
        "signed long long int", "int64_t";
    Uint64 u64, |_| true, |value, spare| value << spare >> spare, "uint64", "ulonglong", "unsigned long long", "unsigned long long int", "uint64_t";
    Float32 f32, f32::is_finite, |value, _| value, "float";
    Float64 f64, f64::is_finite, |value, _| value, "double";
}

impl fmt::Display for ScalarType {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl ScalarType {
    /// Whether a number is not infinite when it is of this type.
    #[must_use]
    pub const fn reaches(self, number: f64) -> bool {
        match self {
            Self::Float32 => (number as f32).is_finite(),
            _ => number.is_finite(),
        }
    }
}

impl Samples {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        with_samples!(self, values => values.len())
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value of the sample at `index`, if there is one.
    #[must_use]
    pub fn value(&self, index: usize) -> Option<f64> {
        with_samples!(self, values => values.get(index).map(|&value| Scalar::to_f64(value)))
    }

    /// Index of the first sample that is NaN or infinite.
    #[must_use]
    pub fn first_not_finite(&self) -> Option<usize> {
        with_samples!(self, values => values.iter().position(|&value| !Scalar::is_finite(value)))
    }

    /// Replaces every sample that is NaN or infinite.
    pub fn replace_not_finite(&mut self, number: f64) {
        with_samples!(self, values => {
            for value in values.iter_mut().filter(|value| !Scalar::is_finite(**value)) {
                *value = Scalar::from_f64(number);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_types_are_refused_and_the_known_ones_listed() {
        for text in ["", "char", "block", "uint12", "FLOAT", "half"] {
            let error = ScalarType::from_str(text).unwrap_err();
            assert!(error.contains(text) && error.contains("uint16"), "{error}");
        }
        assert!(ByteOrder::from_str("middle").is_err());
    }

    #[test]
    fn names_come_back() {
        for scalar in ScalarType::ALL {
            assert_eq!(scalar.name().parse(), Ok(scalar));
        }
        assert_eq!("unsigned long long int".parse(), Ok(ScalarType::Uint64));
        assert_eq!("signed char".parse(), Ok(ScalarType::Int8));
    }

    #[test]
    fn bytes_are_read_in_both_orders() {
        let mut samples = Samples::Int16(vec![]);
        samples.append(&[0xff, 0xfe, 0x01], ByteOrder::Big);
        samples.append(&[0xff, 0xfe], ByteOrder::Little);
        assert_eq!(samples, Samples::Int16(vec![-2, -257]));
        let mut bytes = Vec::new();
        samples.write_to(&mut bytes).unwrap();
        assert_eq!(bytes, [0xfe, 0xff, 0xff, 0xfe]);
    }

    #[test]
    fn text_must_fit_the_type() {
        let mut samples = Samples::Uint8(vec![]);
        for text in ["", "256", "-1", "1.0", "1e1", "x"] {
            assert!(!samples.append_text(text), "{text}");
        }
        assert!(samples.append_text("255"));
        assert_eq!(samples, Samples::Uint8(vec![255]));
    }

    #[test]
    fn samples_that_are_not_finite_are_found_and_replaced() {
        let mut samples = Samples::Float32(vec![0.0, f32::INFINITY, f32::NAN]);
        assert_eq!(samples.first_not_finite(), Some(1));
        samples.replace_not_finite(-1.5);
        assert_eq!(samples, Samples::Float32(vec![0.0, -1.5, -1.5]));
        assert_eq!(samples.first_not_finite(), None);
        assert_eq!((samples.value(2), samples.value(3)), (Some(-1.5), None));
    }
}

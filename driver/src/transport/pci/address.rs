//! Names of PCI functions.

use core::fmt;
use core::str::FromStr;

use crate::Error;

/// The place of a PCI function, as Linux writes it: domain, bus, device, function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PciAddress {
    domain: u32,
    bus: u8,
    device: u8,
    function: u8,
}

/// Which card to open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PciSelector {
    /// The first by address.
    First,
    /// The one at an address.
    At(PciAddress),
}

impl FromStr for PciAddress {
    type Err = Error;

    /// Takes `0000:00:05.0`, or `00:05.0` in domain 0.
    fn from_str(text: &str) -> Result<Self, Error> {
        parse(text).ok_or_else(|| Error::PciAddress { text: text.into() })
    }
}

fn parse(text: &str) -> Option<PciAddress> {
    let (rest, function) = text.rsplit_once('.')?;
    let (rest, device) = rest.rsplit_once(':')?;
    let (domain, bus) = rest.rsplit_once(':').unwrap_or(("0000", rest));
    let number = |text: &str, digits: core::ops::RangeInclusive<usize>, most: u32| {
        let plain = digits.contains(&text.len()) && text.bytes().all(|it| it.is_ascii_hexdigit());
        u32::from_str_radix(text, 16).ok().filter(|value| plain && *value <= most)
    };
    Some(PciAddress {
        domain: number(domain, 4..=8, u32::MAX)?,
        bus: number(bus, 2..=2, 0xff)? as u8,
        device: number(device, 2..=2, 31)? as u8,
        function: number(function, 1..=1, 7)? as u8,
    })
}

impl fmt::Display for PciAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:02x}:{:02x}.{}", self.domain, self.bus, self.device, self.function)
    }
}

impl FromStr for PciSelector {
    type Err = Error;

    /// Takes an address, or `auto` or nothing for the first card.
    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "" | "auto" => Ok(Self::First),
            address => address.parse().map(Self::At),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_address_is_refused_and_quoted() {
        for text in [
            "5",
            "00:05",
            "00:05.8",
            "00:20.0",
            "0:05.0",
            "00:5.0",
            "00:05.00",
            "000:00:05.0",
            "+000:00:05.0",
            "0000:+0:05.0",
            "123456789:00:05.0",
            "0000:00:05.0 ",
            "first",
            "0000:0000:00:05.0",
            "é0:05.0",
        ] {
            let error = text.parse::<PciSelector>().unwrap_err().to_string();
            assert_eq!(error, format!("PCI address '{text}' is none of 0000:00:05.0, 00:05.0, auto"));
        }
    }

    #[test]
    fn addresses_are_written_as_linux_does() {
        for (text, written) in [
            ("00:05.0", "0000:00:05.0"),
            ("0000:0A:1f.7", "0000:0a:1f.7"),
            ("10000:e1:00.3", "10000:e1:00.3"),
        ] {
            let address: PciAddress = text.parse().unwrap();
            assert_eq!(address.to_string(), written);
            assert_eq!(text.parse::<PciSelector>().unwrap(), PciSelector::At(address));
        }
        assert_eq!("".parse::<PciSelector>().unwrap(), PciSelector::First);
        assert_eq!("auto".parse::<PciSelector>().unwrap(), PciSelector::First);
    }
}

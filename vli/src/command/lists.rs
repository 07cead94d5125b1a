//! Arguments that are numbers, lists of them, or names with something behind them.

use std::path::PathBuf;
use std::str::FromStr;
use vg500_regs::table::report_omitted;
use volumepro_driver::PciSelector;

/// Exactly `N` numbers, separated by commas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
        let count = numbers.len();
        numbers.try_into().map(Self).map_err(|_| format!("{N} numbers are wanted, {count} given"))
    }
}

/// A finite number.
pub fn number(text: &str) -> Result<f64, String> {
    let number = f64::from_str(text.trim()).map_err(|_| format!("'{text}' is not a number"))?;
    if number.is_finite() { Ok(number) } else { Err(format!("'{text}' is not finite")) }
}

fn numbers<const N: usize>(parts: &[&str]) -> Result<[f64; N], String> {
    Numbers::from_str(&parts.join(",")).map(|Numbers(numbers)| numbers)
}

/// Omissions of the engine by the names of the fields of `REPORT_OMITTED` in lower case, or `all`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Omissions(u32);

impl Omissions {
    /// As bits of the register `KEEP`.
    pub const fn mask(self) -> u32 {
        self.0
    }
}

impl FromStr for Omissions {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let fields = report_omitted::REGISTER.fields;
        if text == "all" {
            return Ok(Self(report_omitted::REGISTER.mask()));
        }
        let names = text.split(',').map(str::trim).filter(|name| !name.is_empty());
        let mask = |name: &str| {
            let field = fields.iter().find(|field| field.name.to_lowercase() == name);
            field.map(|field| field.mask()).ok_or_else(|| {
                let known: Vec<_> = fields.iter().map(|field| field.name.to_lowercase()).collect();
                format!("'{name}' is not all, {}", known.join(", "))
            })
        };
        names.map(mask).try_fold(0, |bits, mask| Ok(bits | mask?)).map(Self)
    }
}

/// Width and height, written `WxH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is not WIDTHxHEIGHT");
        let (width, height) = text.split_once('x').ok_or_else(wrong)?;
        let side = |text: &str| u32::from_str(text).map_err(|_| wrong());
        Ok(Self { width: side(width)?, height: side(height)? })
    }
}

/// Direction of travel and intensity of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightList {
    /// Direction, camera space.
    pub direction: [f64; 3],
    /// Intensity.
    pub intensity: f64,
}

impl FromStr for LightList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(',').collect();
        let ([x, y, z], intensity) = match parts.len() {
            3 => (numbers(&parts)?, 1.0),
            4 => (numbers(&parts[..3])?, number(parts[3])?),
            count => return Err(format!("3 or 4 numbers are wanted, {count} given")),
        };
        if [x, y, z] == [0.0; 3] {
            return Err("a light has a direction".into());
        }
        if !(0.0..=1.0).contains(&intensity) {
            return Err(format!("intensity {intensity} is not in 0..1"));
        }
        Ok(Self { direction: [x, y, z], intensity })
    }
}

/// Cropping slabs and flags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CropList {
    /// Lower and upper bound along x, y, z.
    pub slabs: [[f64; 2]; 3],
    /// The bits of `VLICrop::Flags`.
    pub flags: u32,
}

impl FromStr for CropList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(',').collect();
        let flags = match parts.len() {
            6 => crate::Crop::SUB_VOLUME,
            7 => crop_flags(parts[6].trim())?,
            count => return Err(format!("6 or 7 numbers are wanted, {count} given")),
        };
        let [x0, x1, y0, y1, z0, z1] = numbers(&parts[..6])?;
        Ok(Self { slabs: [[x0, x1], [y0, y1], [z0, z1]], flags })
    }
}

fn crop_flags(text: &str) -> Result<u32, String> {
    let flags = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => u32::from_str(text),
    };
    let valid = flags.ok().filter(|flags| flags & !crate::Crop::ALL_FLAGS == 0);
    valid.ok_or_else(|| format!("'{text}' is not a number of 14 bits"))
}

/// The cut plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlaneList {
    /// A, B, C, D, thickness, falloff.
    pub numbers: [f64; 6],
    /// Whether the outside can be seen.
    pub outside: bool,
}

impl FromStr for CutPlaneList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(',').collect();
        let outside = match parts.get(6).map(|word| word.trim()) {
            None => false,
            Some("outside") => true,
            Some(other) => return Err(format!("'{other}' is not 'outside'")),
        };
        if parts.len() > 7 {
            return Err(format!("6 numbers are wanted, {} given", parts.len()));
        }
        Ok(Self { numbers: numbers(&parts[..parts.len().min(6)])?, outside })
    }
}

/// What lies behind the volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackgroundList(pub Option<[u8; 3]>);

impl FromStr for BackgroundList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "transparent" {
            return Ok(Self(None));
        }
        let channels: Option<Vec<u8>> = text.split(',').map(|channel| channel.trim().parse().ok()).collect();
        let color = channels.and_then(|channels| channels.try_into().ok());
        color.map(|color| Self(Some(color))).ok_or_else(|| "three numbers 0..255, or 'transparent'".into())
    }
}

/// Which card renders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// The one of this process.
    Embedded,
    /// The one behind a socket.
    Socket(PathBuf),
    /// One on the PCI bus.
    Pci(PciSelector),
}

impl FromStr for Device {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "embedded" => Ok(Self::Embedded),
            Some(("socket", "")) => Err("the path of the socket is missing".into()),
            Some(("socket", path)) => Ok(Self::Socket(path.into())),
            Some(("pci", address)) => address.parse().map(Self::Pci).map_err(|error| error.to_string()),
            _ => Err("none of embedded, socket:PATH, pci:ADDRESS".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_lists_say_what_is_wrong() {
        assert_eq!(Numbers::<3>::from_str("1,2").unwrap_err(), "3 numbers are wanted, 2 given");
        assert_eq!(Numbers::<2>::from_str("1,x").unwrap_err(), "'x' is not a number");
        assert!(Numbers::<1>::from_str("nan").is_err() && Numbers::<1>::from_str("inf").is_err());
        for text in ["512", "512x", "x", "-1x5", "1x2x3", "1e3x5"] {
            assert!(Size::from_str(text).is_err(), "{text}");
        }
        for text in ["0,0,0", "1,2", "1,2,3,4,5", "0,0,1,1.5", "0,0,1,nan"] {
            assert!(LightList::from_str(text).is_err(), "{text}");
        }
        for text in ["0,1,0,1,0", "0,1,0,1,0,1,2,3", "0,1,0,1,0,1,0x4000", "0,1,0,1,0,1,7.5"] {
            assert!(CropList::from_str(text).is_err(), "{text}");
        }
        for text in ["1,0,0,0,1", "1,0,0,0,1,0,inside", "1,0,0,0,1,0,outside,1"] {
            assert!(CutPlaneList::from_str(text).is_err(), "{text}");
        }
        for text in ["1,2", "1,2,256", "black", "1,2,3,4"] {
            assert!(BackgroundList::from_str(text).is_err(), "{text}");
        }
        for text in ["", "embedded:", "socket", "socket:", "pci:x", "usb:1", "Embedded"] {
            assert!(Device::from_str(text).is_err(), "{text}");
        }
    }

    #[test]
    fn right_lists_are_read() {
        assert_eq!(Numbers::from_str("-1, 2.5,3e2"), Ok(Numbers([-1.0, 2.5, 300.0])));
        assert_eq!(Size::from_str("640x480"), Ok(Size { width: 640, height: 480 }));
        assert_eq!(LightList::from_str("0,0,-1,0.5").unwrap().intensity, 0.5);
        assert_eq!(CropList::from_str("-1,1,2,3,4,5").unwrap().flags, 7);
        assert_eq!(CropList::from_str("-1,1,2,3,4,5,0x3421").unwrap().flags, 0x3421);
        assert_eq!(CropList::from_str("-1,1,2,3,4,5,0X15").unwrap().flags, 0x15);
        assert_eq!(Device::from_str("socket:a:b"), Ok(Device::Socket("a:b".into())));
        assert!(CutPlaneList::from_str("1,0,0,-5,2,0,outside").unwrap().outside);
        assert_eq!(BackgroundList::from_str("1,2,255"), Ok(BackgroundList(Some([1, 2, 255]))));
        assert_eq!(BackgroundList::from_str("transparent"), Ok(BackgroundList(None)));
    }
}

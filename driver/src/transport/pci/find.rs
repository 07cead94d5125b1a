//! Cards among the PCI functions that Linux knows.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use vg500_regs::pci::{ALTERNATE_VENDOR_ID, DEVICE_ID, VENDOR_ID};

use super::function::NO_ANSWER;
use super::{PciAddress, PciSelector};
use crate::Error;

/// What sysfs tells of a card.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub(super) address: PciAddress,
    /// The function's folder.
    pub(super) folder: PathBuf,
    /// The driver that it is bound to.
    pub(super) driver: Option<String>,
    /// Its IOMMU group.
    pub(super) group: Option<String>,
}

/// The card that is asked for; `root` is the root of the file system.
pub(super) fn find(root: &Path, selector: PciSelector) -> Result<Found, Error> {
    let devices = root.join("sys/bus/pci/devices");
    let address = match selector {
        PciSelector::At(address) => address,
        PciSelector::First => first(&devices)?,
    };
    let folder = devices.join(address.to_string());
    if !folder.exists() {
        return Err(Error::NoPciDevice { address, folder: devices });
    }
    match identity(&folder)? {
        (vendor, device) if is_card(vendor, device) => {}
        (vendor, device) => return Err(Error::Identity { vendor, device }),
    }
    check_presence(&folder)?;
    let linked = |name| {
        let target = fs::read_link(folder.join(name)).ok()?;
        Some(target.file_name()?.to_string_lossy().into_owned())
    };
    Ok(Found { address, driver: linked("driver"), group: linked("iommu_group"), folder })
}

/// The card with the lowest address.
fn first(devices: &Path) -> Result<PciAddress, Error> {
    let entries = fs::read_dir(devices).map_err(|cause| Error::file("listing", devices, cause))?;
    let addresses = entries.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<PciAddress>().ok());
    addresses
        .filter(|address| {
            let identity = identity(&devices.join(address.to_string()));
            identity.is_ok_and(|(vendor, device)| is_card(vendor, device))
        })
        .min()
        .ok_or_else(|| Error::NoCard { folder: devices.to_owned() })
}

fn is_card(vendor: u16, device: u16) -> bool {
    [VENDOR_ID, ALTERNATE_VENDOR_ID].contains(&vendor) && device == DEVICE_ID
}

/// Refuses a card that does not answer: what the system does to open it would take minutes. The files of the IDs
/// say what was there when the machine started.
fn check_presence(folder: &Path) -> Result<(), Error> {
    let path = folder.join("config");
    let mut word = [0; 4];
    let read = File::open(&path).and_then(|file| file.read_exact_at(&mut word, 0));
    read.map_err(|cause| Error::file("reading", &path, cause))?;
    match word {
        [0xff, 0xff, 0xff, 0xff] => Err(Error::CardDead { reason: NO_ANSWER.into() }),
        _ => Ok(()),
    }
}

/// Vendor and device ID.
fn identity(folder: &Path) -> Result<(u16, u16), Error> {
    Ok((id(&folder.join("vendor"))?, id(&folder.join("device"))?))
}

/// The number in a file like `0x1067`.
fn id(path: &Path) -> Result<u16, Error> {
    let text = fs::read_to_string(path).map_err(|cause| Error::file("reading", path, cause))?;
    let digits = text.trim().trim_start_matches("0x");
    u16::from_str_radix(digits, 16)
        .map_err(|_| Error::file("reading", path, io::Error::new(io::ErrorKind::InvalidData, "no PCI ID")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::pci::fake_tree::FakeTree;

    fn refused(tree: &FakeTree, selector: &str) -> String {
        find(tree.root(), selector.parse().unwrap()).unwrap_err().to_string()
    }

    #[test]
    fn what_is_missing_is_named() {
        let tree = FakeTree::new();
        assert!(refused(&tree, "auto").starts_with("no VolumePro 500 (1067:1002 or 10ba:1002) among"));
        let message = refused(&tree, "00:05.0");
        assert!(message.starts_with("no PCI device at 0000:00:05.0 in ") && message.ends_with("devices"));
        tree.add("0000:00:02.0", 0x8086, 0x1002);
        assert!(refused(&tree, "").starts_with("no VolumePro 500"));
        assert_eq!(
            refused(&tree, "00:02.0"),
            "PCI device 8086:1002 is no VolumePro 500 (1067:1002 or 10ba:1002)"
        );
        fs::remove_dir_all(tree.root().join("sys")).unwrap();
        assert!(refused(&tree, "auto").contains("No such file"));
    }

    #[test]
    fn a_card_that_does_not_answer_is_dead() {
        let tree = FakeTree::new();
        tree.add("0000:00:01.0", 0x1067, 0x1002);
        tree.overwrite("0000:00:01.0", "config", &[0xff; 64]);
        assert_eq!(refused(&tree, "auto"), "the card is dead: its configuration space reads as all ones");
        fs::remove_file(tree.folder("0000:00:01.0").join("config")).unwrap();
        assert!(refused(&tree, "auto").contains("0000:00:01.0/config: No such file"));
    }

    #[test]
    fn damaged_folders_do_not_hide_the_card() {
        let tree = FakeTree::new();
        tree.add("0000:00:01.0", 0x1067, 0x1002);
        fs::write(tree.folder("0000:00:01.0").join("vendor"), "no number").unwrap();
        fs::create_dir(tree.folder("0000:00:02.0")).unwrap();
        fs::create_dir(tree.folder("nonsense")).unwrap();
        tree.add("0000:00:03.0", 0x10ba, 0x1002);
        let found = find(tree.root(), PciSelector::First).unwrap();
        assert_eq!(found.address.to_string(), "0000:00:03.0");
        assert!(refused(&tree, "00:01.0").ends_with("vendor: no PCI ID"));
    }

    #[test]
    fn the_first_card_is_the_one_with_the_lowest_address() {
        let tree = FakeTree::new();
        for address in ["10000:00:01.0", "0000:0a:00.0", "0000:09:1f.0"] {
            tree.add(address, 0x1067, 0x1002);
        }
        let found = find(tree.root(), PciSelector::First).unwrap();
        assert_eq!(found.address.to_string(), "0000:09:1f.0");
        assert_eq!((found.driver, found.group), (None, None));
        tree.link("0000:0a:00.0", "driver", "drivers/vfio-pci");
        tree.link("0000:0a:00.0", "iommu_group", "kernel/iommu_groups/7");
        let found = find(tree.root(), "0a:00.0".parse().unwrap()).unwrap();
        assert_eq!(found.driver.as_deref(), Some("vfio-pci"));
        assert_eq!(found.group.as_deref(), Some("7"));
    }
}

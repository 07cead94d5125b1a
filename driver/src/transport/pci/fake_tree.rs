//! PCI functions as Linux shows them in files, in a temporary folder.

use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use vg500_regs::pci::BARS;
use vg500_regs::table;

pub(super) struct FakeTree(TempDir);

impl FakeTree {
    pub(super) fn new() -> Self {
        let tree = Self(tempfile::tempdir().unwrap());
        fs::create_dir_all(tree.0.path().join("sys/bus/pci/devices")).unwrap();
        fs::create_dir_all(tree.0.path().join("dev/vfio")).unwrap();
        tree
    }

    pub(super) fn root(&self) -> &Path {
        self.0.path()
    }

    pub(super) fn folder(&self, address: &str) -> PathBuf {
        self.root().join("sys/bus/pci/devices").join(address)
    }

    /// A function with the memories of the card, its registers as after a reset.
    pub(super) fn add(&self, address: &str, vendor: u16, device: u16) {
        let folder = self.folder(address);
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("vendor"), format!("{vendor:#06x}\n")).unwrap();
        fs::write(folder.join("device"), format!("{device:#06x}\n")).unwrap();
        fs::write(folder.join("enable"), "0\n").unwrap();
        let mut config = vec![0; 256];
        config[..2].copy_from_slice(&vendor.to_le_bytes());
        config[2..4].copy_from_slice(&device.to_le_bytes());
        fs::write(folder.join("config"), config).unwrap();
        for bar in BARS {
            let file = File::create(folder.join(format!("resource{}", bar.index))).unwrap();
            file.set_len(bar.size).unwrap();
        }
        let mut words = vec![0; 0x2000];
        for register in table::REGISTERS {
            let offset = register.offset as usize;
            words[offset..offset + 4].copy_from_slice(&register.reset.to_le_bytes());
        }
        let memory = table::voxel_memory_size::REGISTER.offset as usize;
        words[memory..memory + 4].copy_from_slice(&(128u32 << 20).to_le_bytes());
        self.overwrite(address, "resource0", &words);
    }

    /// Writes the beginning of a file and leaves the rest.
    pub(super) fn overwrite(&self, address: &str, name: &str, bytes: &[u8]) {
        use std::os::unix::fs::FileExt;
        let path = self.folder(address).join(name);
        File::options().write(true).open(path).unwrap().write_all_at(bytes, 0).unwrap();
    }

    pub(super) fn bytes(&self, address: &str, name: &str) -> Vec<u8> {
        fs::read(self.folder(address).join(name)).unwrap()
    }

    /// Makes `name` in a function's folder point to something in sysfs.
    pub(super) fn link(&self, address: &str, name: &str, target: &str) {
        symlink(Path::new("../../../../").join(target), self.folder(address).join(name)).unwrap();
    }
}

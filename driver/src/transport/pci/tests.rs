use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::time::{Duration, Instant};

use vg500_regs::pci::{BARS, PIXEL_MEMORY, VOXEL_MEMORY};
use vg500_regs::table::{self, interface_version, status, threads};

use super::fake_tree::FakeTree;
use super::*;
use crate::card::command;
use crate::{Card, Completion};

const ADDRESS: &str = "0000:00:05.0";

fn tree() -> FakeTree {
    let tree = FakeTree::new();
    tree.add(ADDRESS, 0x1067, 0x1002);
    tree
}

fn open(tree: &FakeTree) -> Result<PciCard, Error> {
    PciCard::open_below(tree.root(), PciSelector::First)
}

fn refused(tree: &FakeTree) -> String {
    open(tree).unwrap_err().to_string()
}

#[test]
fn a_card_of_another_driver_is_left_alone() {
    let tree = tree();
    tree.link(ADDRESS, "driver", "drivers/uio_pci_generic");
    let expected =
        "the card at 0000:00:05.0 is bound to driver uio_pci_generic: unbind it, or bind it to vfio-pci";
    assert_eq!(refused(&tree), expected);
    assert_eq!(tree.bytes(ADDRESS, "enable"), b"0\n");
}

#[test]
fn vfio_without_iommu_or_files_says_what_is_missing() {
    let tree = tree();
    tree.link(ADDRESS, "driver", "drivers/vfio-pci");
    assert!(refused(&tree).starts_with("no IOMMU for the card at 0000:00:05.0: "));
    tree.link(ADDRESS, "iommu_group", "kernel/iommu_groups/3");
    let message = refused(&tree);
    assert!(message.starts_with("opening ") && message.contains("dev/vfio/vfio: No such file"), "{message}");
    // A file that is no VFIO container.
    fs::write(tree.root().join("dev/vfio/vfio"), "").unwrap();
    assert!(refused(&tree).starts_with("VFIO_GET_API_VERSION: "));
}

#[test]
fn missing_permission_names_the_file() {
    if rustix::process::geteuid().is_root() {
        println!("skipped: root may open every file");
        return;
    }
    let tree = tree();
    let config = tree.folder(ADDRESS).join("config");
    fs::set_permissions(&config, fs::Permissions::from_mode(0o400)).unwrap();
    let message = refused(&tree);
    assert!(message.contains("config: Permission denied"), "{message}");
}

#[test]
fn files_that_are_missing_or_folders_are_named() {
    for name in ["config", "enable", "resource4"] {
        let tree = tree();
        fs::remove_file(tree.folder(ADDRESS).join(name)).unwrap();
        fs::create_dir(tree.folder(ADDRESS).join(name)).unwrap();
        let message = refused(&tree);
        assert!(message.contains(&format!("{ADDRESS}/{name}: ")), "{message}");
    }
}

#[test]
fn a_card_is_opened_once() {
    let tree = tree();
    let card = open(&tree).unwrap();
    assert_eq!(refused(&tree), "the card at 0000:00:05.0 is in use by another process");
    drop(card);
    open(&tree).unwrap();
}

#[test]
fn a_memory_that_is_missing_is_named_by_the_card() {
    let tree = tree();
    fs::remove_file(tree.folder(ADDRESS).join("resource5")).unwrap();
    let error = Card::open(Box::new(open(&tree).unwrap())).unwrap_err();
    assert_eq!(error.to_string(), "BAR 5 (section memory) has 0x0 bytes, not 0x1000000");
}

#[test]
fn registers_and_memories_are_the_files() {
    let tree = tree();
    let card = open(&tree).unwrap();
    assert_eq!(card.description(), "sysfs 0000:00:05.0");
    assert!(!card.bursts() && !card.is_vfio() && card.interrupts().unwrap().is_empty());
    assert_eq!(card.address().to_string(), ADDRESS);
    for bar in BARS {
        assert_eq!(card.bar_size(bar.index), bar.size);
    }
    assert_eq!((card.bar_size(3), card.bar_size(9), card.memory(3).is_none()), (0, 0, true));
    card.write_registers(0x200, &[1, 0x0102_0304]).unwrap();
    assert_eq!(tree.bytes(ADDRESS, "resource0")[0x200..0x208], [1, 0, 0, 0, 4, 3, 2, 1]);
    card.memory(PIXEL_MEMORY.index).unwrap().write(7, b"pixel").unwrap();
    assert_eq!(tree.bytes(ADDRESS, "resource4")[7..12], *b"pixel");
    card.write_config(4, 6).unwrap();
    assert_eq!((card.read_config(4).unwrap(), card.read_config(0).unwrap()), (6, 0x1002_1067));
    assert_eq!(tree.bytes(ADDRESS, "enable"), b"1");
}

#[test]
fn the_write_combining_view_of_a_memory_is_preferred() {
    let tree = tree();
    let folder = tree.folder(ADDRESS);
    fs::rename(folder.join("resource2"), folder.join("other")).unwrap();
    symlink("other", folder.join("resource2_wc")).unwrap();
    let card = open(&tree).unwrap();
    assert_eq!(card.bar_size(VOXEL_MEMORY.index), VOXEL_MEMORY.size);
}

#[test]
fn all_ones_mean_a_dead_card_unless_the_version_can_be_read() {
    let tree = tree();
    let card = open(&tree).unwrap();
    let ones = [0xff; 4];
    let write = |offset: u32, bytes: &[u8]| {
        card.memory(0).unwrap().write(offset as usize, bytes).unwrap();
    };
    write(status::REGISTER.offset, &ones);
    assert_eq!(card.read_register(status::REGISTER.offset).unwrap(), u32::MAX);
    write(interface_version::REGISTER.offset, &ones);
    let error = card.read_register(status::REGISTER.offset).unwrap_err();
    assert_eq!(error.to_string(), "the card is dead: its registers read as all ones");
    write(interface_version::REGISTER.offset, &[0; 4]);
    assert!(matches!(card.read_register(threads::REGISTER.offset), Err(Error::CardDead { .. })));
    assert!(matches!(card.write_registers(0x200, &[0]), Err(Error::CardDead { .. })));
    assert!(matches!(card.read_config(0), Err(Error::CardDead { .. })));
    assert!(matches!(card.write_config(4, 0), Err(Error::CardDead { .. })));
}

#[test]
fn a_card_that_left_the_bus_is_dead_at_once() {
    let tree = tree();
    let card = open(&tree).unwrap();
    tree.overwrite(ADDRESS, "config", &[0xff; 256]);
    let start = Instant::now();
    assert!(matches!(Card::open(Box::new(card)), Err(Error::CardDead { .. })));
    assert!(start.elapsed() < Duration::from_secs(1));
}

/// The files of a card that does nothing are enough to open it.
#[test]
fn opening_enables_the_card_and_closing_takes_bus_mastering() {
    let tree = tree();
    let card = Card::open(Box::new(open(&tree).unwrap())).unwrap();
    assert!(matches!(card.completion(), Completion::PollCopy | Completion::PollRegisters));
    assert_eq!(card.description(), "sysfs 0000:00:05.0");
    assert_eq!(tree.bytes(ADDRESS, "config")[4], command::ENABLED as u8);
    let reset = table::reset::REGISTER.offset as usize;
    assert_eq!(tree.bytes(ADDRESS, "resource0")[reset..reset + 4], table::RESET_KEY.to_le_bytes());
    drop(card);
    assert_eq!(tree.bytes(ADDRESS, "config")[4], (command::ENABLED & !command::BUS_MASTER) as u8);
}

#[test]
fn the_reset_of_the_system_is_used_if_it_has_one() {
    let tree = tree();
    fs::write(tree.folder(ADDRESS).join("reset"), "").unwrap();
    let card = open(&tree).unwrap();
    card.reset().unwrap();
    assert_eq!(tree.bytes(ADDRESS, "reset"), b"1");
    assert_eq!(tree.bytes(ADDRESS, "config")[4], 0, "the register was not needed");
}

#[test]
fn behind_an_iommu_sysfs_has_no_host_memory() {
    let tree = tree();
    let group = tree.root().join("group");
    fs::create_dir(&group).unwrap();
    symlink(&group, tree.folder(ADDRESS).join("iommu_group")).unwrap();
    for kind in [Some("DMA-FQ\n"), None] {
        kind.map_or_else(|| fs::remove_file(group.join("type")), |it| fs::write(group.join("type"), it))
            .unwrap();
        let error = open(&tree).unwrap().host_memory(1).err().unwrap().to_string();
        assert!(error.contains("IOMMU"), "{error}");
    }
}

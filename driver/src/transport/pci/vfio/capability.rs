//! Chains of capabilities behind the kernel's answers, and what the driver looks for in them.

use std::ops::Range;

use vfio_bindings::bindings::vfio::{
    VFIO_IOMMU_INFO_CAPS, VFIO_IOMMU_TYPE1_INFO_CAP_IOVA_RANGE, vfio_info_cap_header, vfio_iommu_type1_info,
    vfio_iommu_type1_info_cap_iova_range, vfio_iova_range,
};

use super::memory::ALIGNMENT;

/// Where host memory appears on the bus if the IOMMU lets it: above 4 GiB, so that both halves of addresses
/// count.
const BUS_ADDRESSES: Range<u64> = 1 << 32..1 << 38;

/// Where the capability `id` begins in an answer whose chain begins at `first`.
pub(super) fn find(answer: &[u8], first: u32, id: u16) -> Option<usize> {
    let mut at = first as usize;
    // Every capability takes its header, so a longer chain runs in circles.
    for _ in 0..answer.len() / size_of::<vfio_info_cap_header>() {
        let found = u16_at(answer, at)?;
        let next = u32_at(answer, at + 4)?;
        match next {
            _ if at == 0 => return None,
            _ if found == id => return Some(at),
            next => at = next as usize,
        }
    }
    None
}

/// Bus addresses for host memory, by the answer to `VFIO_IOMMU_GET_INFO`; the largest piece that the IOMMU has
/// among those wanted, else among all.
pub(super) fn bus_addresses(info: &[u8]) -> Range<u64> {
    let ranges = iova_ranges(info).unwrap_or_else(|| vec![BUS_ADDRESSES]);
    let largest = |within: Range<u64>| {
        let pieces = ranges.iter().map(|range| {
            let start = range.start.max(within.start).next_multiple_of(ALIGNMENT);
            start..range.end.min(within.end) / ALIGNMENT * ALIGNMENT
        });
        pieces.filter(|piece| !piece.is_empty()).max_by_key(|piece| piece.end - piece.start)
    };
    // Address zero looks like none.
    largest(BUS_ADDRESSES).or_else(|| largest(ALIGNMENT..1 << 63)).unwrap_or(0..0)
}

/// What the IOMMU translates, unless the kernel does not tell.
fn iova_ranges(info: &[u8]) -> Option<Vec<Range<u64>>> {
    let flags = u32_at(info, std::mem::offset_of!(vfio_iommu_type1_info, flags))?;
    if flags & VFIO_IOMMU_INFO_CAPS == 0 {
        return None;
    }
    let first = u32_at(info, std::mem::offset_of!(vfio_iommu_type1_info, cap_offset))?;
    let at = find(info, first, VFIO_IOMMU_TYPE1_INFO_CAP_IOVA_RANGE as u16)?;
    let count = u32_at(info, at + std::mem::offset_of!(vfio_iommu_type1_info_cap_iova_range, nr_iovas))?;
    let ranges = info.get(at + size_of::<vfio_iommu_type1_info_cap_iova_range>()..)?;
    let range = |bytes: &[u8]| Some(u64_at(bytes, 0)?..u64_at(bytes, 8)?.saturating_add(1));
    ranges.chunks_exact(size_of::<vfio_iova_range>()).take(count as usize).map(range).collect()
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// The word at byte `at` of an answer.
pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// An answer to `VFIO_IOMMU_GET_INFO` with these inclusive ranges behind another capability.
    fn info(ranges: &[(u64, u64)]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let words = [0, VFIO_IOMMU_INFO_CAPS, 0x1000, 0, 24, 0, 3 | 1 << 16, 32, 1 | 1 << 16, 0];
        words.into_iter().for_each(|word: u32| bytes.extend(word.to_ne_bytes()));
        bytes.extend((ranges.len() as u32).to_ne_bytes());
        bytes.extend(0u32.to_ne_bytes());
        for (start, last) in ranges {
            bytes.extend([start.to_ne_bytes(), last.to_ne_bytes()].concat());
        }
        bytes
    }

    #[test]
    fn chains_that_run_in_circles_or_out_of_the_answer_end() {
        let mut bytes = info(&[]);
        assert_eq!(find(&bytes, 24, 1), Some(32));
        assert_eq!(find(&bytes, 24, 9), None);
        assert_eq!(find(&bytes, 0, 1), None);
        assert_eq!(find(&bytes, u32::MAX, 1), None);
        bytes[28] = 24;
        assert_eq!(find(&bytes, 24, 1), None);
    }

    #[test]
    fn bus_addresses_are_those_of_the_iommu() {
        assert_eq!(bus_addresses(&[]), BUS_ADDRESSES);
        assert_eq!(bus_addresses(&[0; 24]), BUS_ADDRESSES, "an old kernel does not tell");
        // Intel's, with the window of interrupt messages left out, 39 and 48 bits wide.
        for bits in [39, 48] {
            let answer = info(&[(0, 0xfedf_ffff), (0xfef0_0000, (1 << bits) - 1)]);
            assert_eq!(bus_addresses(&answer), BUS_ADDRESSES);
        }
        let narrow = info(&[(0, 0xfedf_ffff), (0xfef0_0000, 0xffff_ffff)]);
        assert_eq!(bus_addresses(&narrow), ALIGNMENT..0xfee0_0000);
        assert_eq!(bus_addresses(&info(&[])), 0..0);
        assert_eq!(bus_addresses(&info(&[(5 << 32, u64::MAX)])), 5 << 32..1 << 38);
    }

    proptest! {
        #[test]
        fn any_answer_gives_usable_addresses(
            mut bytes in prop::collection::vec(any::<u8>(), 0..128),
            ranges in prop::collection::vec((any::<u64>(), any::<u64>()), 0..4),
        ) {
            for answer in [info(&ranges), { bytes.splice(..0, info(&ranges)); bytes.clone() }] {
                let range = bus_addresses(&answer);
                prop_assert!(range.start <= range.end);
                prop_assert!([range.start, range.end].iter().all(|end| end.is_multiple_of(ALIGNMENT)));
            }
            bus_addresses(&bytes[bytes.len() / 2..]);
        }
    }
}

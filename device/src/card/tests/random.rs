//! Whatever is written, the card answers, ends what it began, and starts again after a reset.

use proptest::prelude::*;
use vg500_regs::Register;
use vg500_regs::table::*;

use super::rig::{Rig, frame};

/// An access.
#[derive(Clone, Debug)]
enum Act {
    /// A register that exists gets any word.
    Word(Register, u32),
    /// Any bytes anywhere.
    Bytes(u32, Vec<u8>),
    /// A frame that is right but for one word.
    Frame(u32, Register, u32),
    Read(u32, usize),
}

/// Small numbers, single bits, ends of ranges, and anything.
fn word() -> impl Strategy<Value = u32> {
    let ends = prop::sample::select(vec![0, 1, 0xffff, 0x7fff_ffff, 0x8000_0000, u32::MAX, RESET_KEY]);
    prop_oneof![0..16u32, (0..32u32).prop_map(|bit| 1 << bit), ends, any::<u32>()]
}

fn register() -> impl Strategy<Value = Register> {
    // The rays of a frame decide how long it takes; the small ones it has are enough.
    prop::sample::select(REGISTERS.to_vec())
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        4 => (register(), word()).prop_map(|(register, word)| Act::Word(register, word)),
        1 => (0..0x1_0000u32 - 64, prop::collection::vec(any::<u8>(), 0..64))
            .prop_map(|(offset, bytes)| Act::Bytes(offset, bytes)),
        4 => (any::<u16>(), register(), word())
            .prop_map(|(tag, register, word)| Act::Frame(tag.into(), register, word)),
        1 => (0..0x1_0000u32 - 64, 0..64usize).prop_map(|(offset, length)| Act::Read(offset, length)),
    ]
}

fn carry_out(rig: &mut Rig, act: &Act) {
    match act {
        Act::Word(register, word) => rig.write(*register, *word),
        Act::Bytes(offset, bytes) => rig.write_bytes(*offset, bytes),
        Act::Read(offset, length) => drop(rig.read_bytes(*offset, *length)),
        Act::Frame(tag, register, word) => {
            let mut frame = frame(*tag, tag % 16);
            frame.write(register.offset, *word);
            rig.start(&frame);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_accesses_end_in_a_defined_state(acts in prop::collection::vec(act(), 1..24), strict: bool) {
        let mut rig = if strict { Rig::strict() } else { Rig::new() };
        rig.fill();
        acts.iter().for_each(|act| carry_out(&mut rig, act));
        rig.write(cancel::REGISTER, cancel::REGISTER.mask());
        rig.await_idle();
        for place in 0..16 {
            let (_, outcome) = rig.plane_state(place);
            prop_assert!([result::NONE, result::DONE, result::FAILED].contains(&outcome));
            prop_assert_eq!(rig.plane_fault(place).is_some(), outcome == result::FAILED);
        }
        rig.write(reset::REGISTER, RESET_KEY);
        prop_assert_eq!(rig.read(status::REGISTER), 0);
        rig.start(&frame(1, 0));
        rig.await_idle();
        prop_assert_eq!(rig.plane_state(0), (1, result::DONE));
    }
}

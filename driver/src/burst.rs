//! Which messages bring the card's frame registers up to date.

use vg500_regs::FrameRegisters;
use vg500_regs::table::{self, start};

use crate::Error;

/// Consecutive registers, written by one message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Burst {
    /// Byte offset of the first.
    pub(crate) offset: u32,
    pub(crate) words: Vec<u32>,
}

impl Burst {
    fn end(&self) -> u32 {
        self.offset + 4 * self.words.len() as u32
    }
}

/// What to write so that a card whose frame registers hold `shadow` holds `wanted`; the start command comes
/// last, also if it is the same word as before.
///
/// With `joined` as few messages as possible: registers that did not change are written again if that joins
/// two changes. Otherwise as few registers as possible.
///
/// # Errors
///
/// If a word that changes has reserved bits, or is no register.
pub(crate) fn bursts(
    shadow: &FrameRegisters,
    wanted: &FrameRegisters,
    joined: bool,
) -> Result<Vec<Burst>, Error> {
    let mut bursts: Vec<Burst> = Vec::new();
    let repeated = (wanted.word(start::REGISTER) == shadow.word(start::REGISTER))
        .then(|| (start::REGISTER.offset, wanted.word(start::REGISTER)));
    for (offset, word) in wanted.changes(shadow).chain(repeated) {
        check(offset, word)?;
        match bursts.last_mut() {
            Some(last) if last.end() == offset || joined && registers_fill(last.end()..offset) => {
                last.words.extend((last.end()..offset).step_by(4).map(|offset| wanted.read(offset)));
                last.words.push(word);
            }
            _ => bursts.push(Burst { offset, words: vec![word] }),
        }
    }
    Ok(bursts)
}

fn check(offset: u32, word: u32) -> Result<(), Error> {
    let (register, _) = table::find(offset).ok_or(Error::NoRegister { offset })?;
    match word & !register.mask() {
        0 => Ok(()),
        bits => Err(Error::ReservedBits { register: register.name, bits }),
    }
}

fn registers_fill(mut gap: std::ops::Range<u32>) -> bool {
    gap.all(|offset| offset % 4 != 0 || table::find(offset).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::frame_registers::{FRAME_END, FRAME_START, VIEW_START};
    use vg500_regs::table::*;

    fn shadow() -> FrameRegisters {
        FrameRegisters::default()
    }

    #[test]
    fn reserved_bits_and_missing_registers_are_refused_by_name() {
        let mut wanted = shadow();
        wanted.write(volume_size_xy::REGISTER.offset, 1 << 9);
        let error = bursts(&shadow(), &wanted, true).unwrap_err();
        assert_eq!(error.to_string(), "reserved bits 0x200 of VOLUME_SIZE_XY are set");
        let mut wanted = shadow();
        wanted.write(0x214, 1);
        assert!(matches!(bursts(&shadow(), &wanted, true), Err(Error::NoRegister { offset: 0x214 })));
    }

    #[test]
    fn the_start_command_is_written_even_if_nothing_changed() {
        let expected = Burst { offset: start::REGISTER.offset, words: vec![0] };
        assert_eq!(bursts(&shadow(), &shadow(), true).unwrap(), [expected]);
    }

    #[test]
    fn a_new_view_is_one_message() {
        let mut wanted = shadow();
        for register in REGISTERS.iter().filter(|it| (VIEW_START..FRAME_END).contains(&it.offset)) {
            wanted.write(register.offset, !shadow().word(*register) & register.mask());
        }
        let bursts = bursts(&shadow(), &wanted, true).unwrap();
        assert_eq!(bursts.len(), 1);
        assert!(bursts[0].offset == VIEW_START && bursts[0].words.len() <= 20);
        assert_eq!(bursts[0].end(), FRAME_END);
    }

    /// Every pair of changed registers, so every gap.
    #[test]
    fn messages_leave_the_wanted_registers_and_touch_nothing_else() {
        let frame = || REGISTERS.iter().filter(|it| FrameRegisters::holds(it.offset) && it.mask() != 0);
        for (first, second) in frame().flat_map(|first| frame().map(move |second| (first, second))) {
            let mut wanted = shadow();
            wanted.write(first.offset, !first.reset & first.mask());
            wanted.write(second.offset, !second.reset & second.mask());
            wanted.set(start::TAG, 7);
            for joined in [false, true] {
                let mut card = shadow();
                let bursts = bursts(&shadow(), &wanted, joined).unwrap();
                for burst in &bursts {
                    for (offset, word) in (burst.offset..).step_by(4).zip(&burst.words) {
                        assert!(table::find(offset).is_some() && (FRAME_START..FRAME_END).contains(&offset));
                        card.write(offset, *word);
                    }
                }
                assert_eq!(card, wanted);
                assert_eq!(bursts.last().unwrap().end(), FRAME_END, "the start command is last");
                let words: usize = bursts.iter().map(|burst| burst.words.len()).sum();
                assert!(joined || words == wanted.changes(&shadow()).count());
                assert!(!joined || bursts.len() <= 3);
            }
        }
    }
}

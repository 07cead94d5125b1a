//! Messages as bytes: the header, commands, and little-endian fields one after the other.

use rustix::io::Errno;

/// Bytes of a header.
pub(super) const HEADER_SIZE: usize = 16;

/// Commands that the server knows, and the two that it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub(super) enum Command {
    Version = 1,
    DmaMap = 2,
    DmaUnmap = 3,
    GetInfo = 4,
    GetRegionInfo = 5,
    GetIrqInfo = 7,
    SetIrqs = 8,
    RegionRead = 9,
    RegionWrite = 10,
    DmaRead = 11,
    DmaWrite = 12,
    Reset = 13,
    RegionWriteMulti = 15,
}

impl Command {
    /// The request of a code. Region descriptors, dirty pages and migration are not supported.
    pub(super) fn request(code: u16) -> Option<Self> {
        const REQUESTS: [Command; 11] = [
            Command::Version,
            Command::DmaMap,
            Command::DmaUnmap,
            Command::GetInfo,
            Command::GetRegionInfo,
            Command::GetIrqInfo,
            Command::SetIrqs,
            Command::RegionRead,
            Command::RegionWrite,
            Command::Reset,
            Command::RegionWriteMulti,
        ];
        REQUESTS.into_iter().find(|command| *command as u16 == code)
    }
}

/// What the type bits of a message say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MessageType {
    Command,
    Reply,
    Unknown,
}

/// The header of every message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) id: u16,
    pub(super) command: u16,
    /// Bytes of the whole message.
    pub(super) size: u32,
    pub(super) flags: u32,
    pub(super) error: u32,
}

impl Header {
    const TYPE: u32 = 0xf;
    pub(super) const REPLY: u32 = 1;
    pub(super) const NO_REPLY: u32 = 1 << 4;
    pub(super) const ERROR: u32 = 1 << 5;

    pub(super) fn decode(bytes: [u8; HEADER_SIZE]) -> Self {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = bytes;
        Self {
            id: u16::from_le_bytes([a, b]),
            command: u16::from_le_bytes([c, d]),
            size: u32::from_le_bytes([e, f, g, h]),
            flags: u32::from_le_bytes([i, j, k, l]),
            error: u32::from_le_bytes([m, n, o, p]),
        }
    }

    pub(super) fn encode(&self) -> [u8; HEADER_SIZE] {
        let [a, b] = self.id.to_le_bytes();
        let [c, d] = self.command.to_le_bytes();
        let [e, f, g, h] = self.size.to_le_bytes();
        let [i, j, k, l] = self.flags.to_le_bytes();
        let [m, n, o, p] = self.error.to_le_bytes();
        [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p]
    }

    pub(super) fn message_type(&self) -> MessageType {
        match self.flags & Self::TYPE {
            0 => MessageType::Command,
            Self::REPLY => MessageType::Reply,
            _ => MessageType::Unknown,
        }
    }

    /// Whether the sender wants an answer.
    pub(super) fn wants_reply(&self) -> bool {
        self.message_type() != MessageType::Reply && self.flags & Self::NO_REPLY == 0
    }

    /// Bytes that follow the header; none if the size cannot be that of a message.
    pub(super) fn payload_size(&self) -> Option<usize> {
        usize::try_from(self.size).ok()?.checked_sub(HEADER_SIZE)
    }

    /// The header of the reply to this command, with a payload of `length` bytes or an error.
    pub(super) fn reply(&self, result: Result<usize, Errno>) -> Self {
        let (flags, length, error) = match result {
            Ok(length) => (Self::REPLY, length, 0),
            // Never 0, which clients read as success.
            Err(errno) => (Self::REPLY | Self::ERROR, 0, errno.raw_os_error().unsigned_abs()),
        };
        Self { id: self.id, command: self.command, size: message_size(length), flags, error }
    }
}

/// Size of a message with a payload of `length` bytes. Payloads are far below 4 GiB.
pub(super) fn message_size(length: usize) -> u32 {
    u32::try_from(HEADER_SIZE.saturating_add(length)).unwrap_or(u32::MAX)
}

/// Takes fields from the front of a payload. Too few bytes are `EINVAL`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn u16(&mut self) -> Result<u16, Errno> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Errno> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, Errno> {
        self.array().map(u64::from_le_bytes)
    }

    /// A 32-bit count or index.
    pub(super) fn index(&mut self) -> Result<usize, Errno> {
        usize::try_from(self.u32()?).map_err(|_| Errno::INVAL)
    }

    pub(super) fn bytes(&mut self, length: usize) -> Result<&'a [u8], Errno> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or(Errno::INVAL)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Errno> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(Errno::INVAL)?;
        self.0 = rest;
        Ok(*taken)
    }
}

/// Appends fields to a message.
pub(super) trait Append {
    fn u16(&mut self, value: u16);
    fn u32(&mut self, value: u32);
    fn u64(&mut self, value: u64);
}

impl Append for Vec<u8> {
    fn u16(&mut self, value: u16) {
        self.extend(value.to_le_bytes());
    }

    fn u32(&mut self, value: u32) {
        self.extend(value.to_le_bytes());
    }

    fn u64(&mut self, value: u64) {
        self.extend(value.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_come_back() {
        let header =
            Header { id: 0x0102, command: 0x0304, size: 0x0506_0708, flags: 0x0a0b_0c0d, error: 0x0e0f_1011 };
        assert_eq!(Header::decode(header.encode()), header);
        assert_eq!(header.encode()[..4], [2, 1, 4, 3]);
    }

    #[test]
    fn sizes_below_a_header_are_none() {
        let header = |size| Header { size, ..Header::default() };
        assert_eq!(header(15).payload_size(), None);
        assert_eq!(header(16).payload_size(), Some(0));
        assert_eq!(header(u32::MAX).payload_size(), Some(u32::MAX as usize - 16));
    }

    #[test]
    fn replies_repeat_what_they_answer() {
        let header = Header { id: 7, command: 9, size: 99, flags: Header::NO_REPLY, error: 5 };
        let reply = Header { size: 20, flags: 1, error: 0, ..header };
        assert_eq!(header.reply(Ok(4)), reply);
        assert_eq!(header.reply(Err(Errno::BUSY)), Header { size: 16, flags: 0x21, error: 16, ..header });
    }

    #[test]
    fn fields_end_with_the_payload() {
        let mut fields = Fields(&[1, 0, 2, 0, 0, 0, 9]);
        assert_eq!(
            (fields.u16(), fields.u32(), fields.u64(), fields.u16()),
            (Ok(1), Ok(2), Err(Errno::INVAL), Err(Errno::INVAL))
        );
        assert_eq!((fields.bytes(2), fields.bytes(1)), (Err(Errno::INVAL), Ok(&[9u8][..])));
    }
}

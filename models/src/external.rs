//! Finds tensors that keep their data outside the model file, by walking the protocol buffer without ONNX Runtime.
//!
//! Field numbers are those of onnx.proto (IR version 10); the wire format is protocol buffers'. Only messages that can
//! hold a tensor are entered, everything else is skipped by its length, so nothing is allocated but one name.

/// Graphs nest through attributes (`If`, `Loop`); real ones a few levels, a forged one without end.
const MAX_DEPTH: usize = 64;

#[derive(Clone, Copy)]
enum Message {
    Model,
    Training,
    Graph,
    Node,
    Attribute,
    Function,
    Sparse,
    Tensor,
}

impl Message {
    /// The message that a field of this one holds, when that can lead to a tensor.
    fn child(self, field: u64) -> Option<Self> {
        match (self, field) {
            (Self::Model, 7) | (Self::Training, 1 | 2) | (Self::Attribute, 6 | 11) => Some(Self::Graph),
            (Self::Model, 20) => Some(Self::Training),
            (Self::Model, 25) => Some(Self::Function),
            (Self::Graph, 1) | (Self::Function, 7) => Some(Self::Node),
            (Self::Node, 5) | (Self::Function, 11) => Some(Self::Attribute),
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Some(Self::Sparse),
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::Sparse, 1 | 2) => Some(Self::Tensor),
            _ => None,
        }
    }
}

/// What the walk can meet.
pub(crate) enum Finding {
    /// A tensor with data elsewhere, by name.
    External(String),
    /// Bytes that are no such message, from this offset.
    Malformed(usize),
}

/// Walks a whole model file.
pub(crate) fn check(model: &[u8]) -> Result<(), Finding> {
    if model.is_empty() {
        return Err(Finding::Malformed(0));
    }
    walk(Message::Model, model, 0, MAX_DEPTH)
}

fn walk(message: Message, bytes: &[u8], base: usize, depth: usize) -> Result<(), Finding> {
    let mut at = 0;
    let (mut name, mut external) = (None, false);
    while at < bytes.len() {
        let malformed = Finding::Malformed(base + at);
        let Some((field, value, next)) = field(bytes, at) else { return Err(malformed) };
        match (message, field, value) {
            (Message::Tensor, 8, Value::Bytes(start)) => name = bytes.get(start..next),
            (Message::Tensor, 13, _) => external = true,
            (Message::Tensor, 14, Value::Number(location)) => external |= location != 0,
            (_, _, Value::Bytes(start)) => {
                if let Some(child) = message.child(field) {
                    let Some(depth) = depth.checked_sub(1) else { return Err(malformed) };
                    walk(child, &bytes[start..next], base + start, depth)?;
                }
            }
            // A known message that comes as a number is another kind of file.
            (_, _, Value::Number(_)) if message.child(field).is_some() => return Err(malformed),
            _ => {}
        }
        at = next;
    }
    if external {
        return Err(Finding::External(String::from_utf8_lossy(name.unwrap_or_default()).into_owned()));
    }
    Ok(())
}

enum Value {
    Number(u64),
    /// Starts here and ends where the next field begins.
    Bytes(usize),
}

/// The field at `at`: its number, its value and where the next one begins; `None` when it is cut off or of a wire type
/// that ONNX does not use.
fn field(bytes: &[u8], at: usize) -> Option<(u64, Value, usize)> {
    let (key, at) = varint(bytes, at)?;
    let (value, next) = match key & 7 {
        0 => varint(bytes, at).map(|(number, next)| (Value::Number(number), next))?,
        1 => (Value::Number(0), at.checked_add(8)?),
        2 => {
            let (length, start) = varint(bytes, at)?;
            (Value::Bytes(start), start.checked_add(usize::try_from(length).ok()?)?)
        }
        5 => (Value::Number(0), at.checked_add(4)?),
        _ => return None,
    };
    (key >> 3 != 0 && next <= bytes.len()).then_some((key >> 3, value, next))
}

/// A base-128 number of at most ten bytes, and where it ends.
fn varint(bytes: &[u8], at: usize) -> Option<(u64, usize)> {
    let mut value = 0;
    for (i, byte) in bytes.get(at..)?.iter().take(10).enumerate() {
        value |= u64::from(byte & 0x7f) << (7 * i);
        if byte & 0x80 == 0 {
            return Some((value, at + i + 1));
        }
    }
    None
}

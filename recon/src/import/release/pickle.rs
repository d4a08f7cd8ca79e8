//! Pickles as torch writes them, protocol 2, read as data: nothing in them is ever executed.
//!
//! An own reader, because the crates there are know neither persistent ids nor calls they were not told of, and a
//! tensor in a pickle is a call with a persistent id. Values live in one arena and name each other by index, so shared
//! and nested values are neither copied nor walked: memory is a constant times the input, whatever it says.

use std::collections::BTreeMap;

/// Index of a value in its [`Pickle`].
pub(super) type Id = usize;

/// One value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// `None`, booleans, numbers and lists: read over, since no tensor depends on them.
    Other,
    /// An integer that fits i64.
    Int(i64),
    /// Text.
    Text(String),
    /// A tuple.
    Tuple(Vec<Id>),
    /// A class or function by name, `module name`.
    Global(String),
    /// What the file would have called, with its arguments' tuple.
    Call { function: Id, arguments: Id },
    /// A reference to something outside the pickle: torch's storages.
    Persistent(Id),
}

/// A pickle's values.
#[derive(Debug)]
pub(super) struct Pickle {
    values: Vec<Value>,
    /// Entries of all dictionaries by dictionary, in the order of the file.
    entries: BTreeMap<Id, Vec<(Id, Id)>>,
    root: Id,
}

/// Why bytes are no pickle that this reader knows.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("pickle at byte {offset}: expected {expected}, found {found}")]
pub struct PickleError {
    /// Where.
    pub offset: usize,
    /// What should stand there.
    pub expected: &'static str,
    /// What does.
    pub found: String,
}

impl Pickle {
    /// Reads a pickle up to its STOP.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, PickleError> {
        let mut machine = Machine {
            bytes,
            at: 0,
            offset: 0,
            stack: Vec::new(),
            marks: Vec::new(),
            memo: BTreeMap::new(),
            pickle: Self { values: Vec::new(), entries: BTreeMap::new(), root: 0 },
        };
        while machine.step()? {}
        Ok(machine.pickle)
    }

    /// A value.
    pub(super) fn get(&self, id: Id) -> &Value {
        &self.values[id]
    }

    /// Entries of the dictionary that the pickle is, plain or ordered.
    pub(super) fn entries(&self) -> &[(Id, Id)] {
        self.entries.get(&self.root).map_or(&[], Vec::as_slice)
    }

    /// A call's function name and arguments.
    pub(super) fn call(&self, id: Id) -> Option<(&str, &[Id])> {
        let Value::Call { function, arguments } = self.get(id) else { return None };
        match (self.get(*function), self.get(*arguments)) {
            (Value::Global(name), Value::Tuple(arguments)) => Some((name, arguments)),
            _ => None,
        }
    }
}

/// The stack machine that a pickle is a program for.
struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Where the current opcode stands.
    offset: usize,
    stack: Vec<Id>,
    marks: Vec<usize>,
    memo: BTreeMap<u32, Id>,
    pickle: Pickle,
}

impl<'a> Machine<'a> {
    /// Runs one opcode; false after STOP.
    fn step(&mut self) -> Result<bool, PickleError> {
        self.offset = self.at;
        let opcode = self.take(1)?[0];
        match opcode {
            // PROTO and its version: later protocols only add opcodes, which are refused when met.
            0x80 => drop(self.take(1)?),
            b'.' => {
                self.pickle.root = self.pop()?;
                return Ok(false);
            }
            b'(' => self.marks.push(self.stack.len()),
            // None, True, False, a float.
            b'N' | 0x88 | 0x89 => self.push(Value::Other),
            b'G' => {
                self.take(8)?;
                self.push(Value::Other);
            }
            b'J' => {
                let number = self.u32()?.cast_signed().into();
                self.push(Value::Int(number));
            }
            b'K' => {
                let number = self.take(1)?[0];
                self.push(Value::Int(number.into()));
            }
            b'M' => {
                let number = self.take(2)?;
                self.push(Value::Int(u16::from_le_bytes([number[0], number[1]]).into()));
            }
            0x8a => self.long()?,
            b'X' => {
                let length = self.u32()? as usize;
                let text = self.text(length)?;
                self.push(Value::Text(text));
            }
            b')' => self.push(Value::Tuple(Vec::new())),
            0x85..=0x87 => {
                let from = self.below(usize::from(opcode - 0x84))?;
                self.tuple(from);
            }
            b't' => {
                let from = self.mark()?;
                self.tuple(from);
            }
            b']' => self.push(Value::Other),
            b'}' => {
                self.push(Value::Other);
                self.pickle.entries.insert(self.pickle.values.len() - 1, Vec::new());
            }
            b'a' => drop(self.pop()?),
            b'e' => {
                let from = self.mark()?;
                self.stack.truncate(from);
            }
            b's' => {
                let from = self.below(2)?;
                self.insert(from)?;
            }
            b'u' => {
                let from = self.mark()?;
                self.insert(from)?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Value::Global(format!("{module} {name}")));
            }
            b'R' => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                self.push(Value::Call { function, arguments });
            }
            // BUILD gives an object its state; objects are not made here, so the state goes.
            b'b' => drop(self.pop()?),
            b'Q' => {
                let id = self.pop()?;
                self.push(Value::Persistent(id));
            }
            b'q' => {
                let key = self.take(1)?[0];
                self.remember(key.into())?;
            }
            b'r' => {
                let key = self.u32()?;
                self.remember(key)?;
            }
            b'h' => {
                let key = self.take(1)?[0];
                self.recall(key.into())?;
            }
            b'j' => {
                let key = self.u32()?;
                self.recall(key)?;
            }
            other => return Err(self.error("an opcode of protocol 2", format!("0x{other:02x}"))),
        }
        Ok(true)
    }

    fn error(&self, expected: &'static str, found: impl Into<String>) -> PickleError {
        PickleError { offset: self.offset, expected, found: found.into() }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], PickleError> {
        let left = self.bytes.len() - self.at;
        if count > left {
            return Err(self.error("more bytes", format!("{count} wanted and {left} left")));
        }
        self.at += count;
        Ok(&self.bytes[self.at - count..self.at])
    }

    fn u32(&mut self) -> Result<u32, PickleError> {
        let b = self.take(4)?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    fn text(&mut self, length: usize) -> Result<String, PickleError> {
        match String::from_utf8(self.take(length)?.to_vec()) {
            Ok(text) => Ok(text),
            Err(error) => Err(self.error("UTF-8", error.to_string())),
        }
    }

    fn line(&mut self) -> Result<String, PickleError> {
        let Some(length) = self.bytes[self.at..].iter().position(|b| *b == b'\n') else {
            return Err(self.error("a line", "no end of one"));
        };
        let line = self.text(length)?;
        self.at += 1;
        Ok(line)
    }

    /// LONG1: an integer of up to 255 bytes, of which 8 are enough for any size or index.
    fn long(&mut self) -> Result<(), PickleError> {
        let length = usize::from(self.take(1)?[0]);
        let digits = self.take(length)?;
        if length > 8 {
            return Err(self.error("an integer of at most 8 bytes", format!("one of {length}")));
        }
        let sign = digits.last().is_some_and(|last| last & 0x80 != 0);
        let mut number = [if sign { 0xff } else { 0 }; 8];
        number[..length].copy_from_slice(digits);
        self.push(Value::Int(i64::from_le_bytes(number)));
        Ok(())
    }

    fn push(&mut self, value: Value) {
        self.stack.push(self.pickle.values.len());
        self.pickle.values.push(value);
    }

    /// The height of the stack `count` values below its top; a mark may not be passed.
    fn below(&self, count: usize) -> Result<usize, PickleError> {
        let floor = self.marks.last().copied().unwrap_or(0);
        match self.stack.len().checked_sub(count) {
            Some(from) if from >= floor => Ok(from),
            _ => Err(self.error("values on the stack", format!("{} of {count}", self.stack.len() - floor))),
        }
    }

    fn pop(&mut self) -> Result<Id, PickleError> {
        let from = self.below(1)?;
        let id = self.stack[from];
        self.stack.truncate(from);
        Ok(id)
    }

    fn mark(&mut self) -> Result<usize, PickleError> {
        self.marks.pop().ok_or_else(|| self.error("a mark", "none"))
    }

    fn tuple(&mut self, from: usize) {
        let parts = self.stack.split_off(from);
        self.push(Value::Tuple(parts));
    }

    /// Moves pairs above `from` into the dictionary below: a plain one or the call that makes an ordered one.
    fn insert(&mut self, from: usize) -> Result<(), PickleError> {
        let pairs = self.stack.split_off(from);
        let Some(&dictionary) = self.stack.last() else { return Err(self.error("a dictionary", "nothing")) };
        let known = self.pickle.entries.contains_key(&dictionary);
        if !known && !matches!(self.pickle.get(dictionary), Value::Call { .. }) {
            return Err(self.error("a dictionary", format!("{:?}", self.pickle.get(dictionary))));
        }
        let (pairs, rest) = pairs.as_chunks::<2>();
        if !rest.is_empty() {
            return Err(self.error("pairs of key and value", "a key alone"));
        }
        self.pickle.entries.entry(dictionary).or_default().extend(pairs.iter().map(|[key, value]| (*key, *value)));
        Ok(())
    }

    fn remember(&mut self, key: u32) -> Result<(), PickleError> {
        let from = self.below(1)?;
        self.memo.insert(key, self.stack[from]);
        Ok(())
    }

    fn recall(&mut self, key: u32) -> Result<(), PickleError> {
        match self.memo.get(&key) {
            Some(id) => {
                self.stack.push(*id);
                Ok(())
            }
            None => Err(self.error("a remembered value", format!("nothing under {key}"))),
        }
    }
}

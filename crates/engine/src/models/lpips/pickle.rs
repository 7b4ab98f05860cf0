//! Reads a pickle of the kind that the checkpoint is, and no other; nothing is run, and nothing is copied.
//!
//! The crate serde-pickle reads such files too, but copies what is referred to as often as that happens, and does not
//! tell what an object was made by. Here are the opcodes that the checkpoint has. What has parts cannot be referred to
//! again, so there are neither cycles nor files that grow while they are read.
use super::opcode;
use super::reader::Reader;
use super::value::{self, Atom, Value};
use std::collections::BTreeMap;

/// Most opcodes; the checkpoint has 499. It bounds memory too: an opcode leaves at most one value.
const MAX_OPCODES: usize = 1024;
/// Tuples and dictionaries within one another; the checkpoint has three.
const MAX_DEPTH: usize = 4;

/// The value of a pickle, which borrows texts and numbers from its bytes.
///
/// # Errors
/// In words, with the byte where reading ended.
pub fn load(bytes: &[u8]) -> Result<Value<'_>, String> {
    let mut machine = Machine {
        reader: Reader::new(bytes),
        stack: Vec::new(),
        memo: BTreeMap::new(),
    };
    for count in 0..MAX_OPCODES {
        let start = machine.reader.at();
        match machine.step(count == 0) {
            Ok(None) => (),
            Ok(Some(value)) => return Ok(value),
            Err(reason) => return Err(format!("byte {start}: {reason}")),
        }
    }
    Err(format!(
        "byte {}: there are more than {MAX_OPCODES} opcodes",
        machine.reader.at()
    ))
}

enum Item<'a> {
    Mark,
    Value(Value<'a>),
}

struct Machine<'a> {
    reader: Reader<'a>,
    stack: Vec<Item<'a>>,
    /// What was remembered; `None` for what has parts.
    memo: BTreeMap<u8, Option<Atom<'a>>>,
}

impl<'a> Machine<'a> {
    /// Does what the next opcode says; gives the result after the last.
    fn step(&mut self, first: bool) -> Result<Option<Value<'a>>, String> {
        let code = self.reader.byte()?;
        if first != (code == opcode::PROTO) {
            return Err("a pickle has its protocol first, and once".into());
        }
        let value = match code {
            opcode::PROTO => {
                return match self.reader.byte()? {
                    3 => Ok(None),
                    other => Err(format!("the pickle has protocol {other}, expected 3")),
                };
            }
            opcode::STOP => return self.result().map(Some),
            opcode::MARK => {
                self.stack.push(Item::Mark);
                return Ok(None);
            }
            opcode::BINPUT => {
                self.remember()?;
                return Ok(None);
            }
            opcode::BINGET => self.recall()?,
            opcode::NONE => Value::Atom(Atom::None),
            opcode::NEWTRUE => Value::Atom(Atom::Bool(true)),
            opcode::NEWFALSE => Value::Atom(Atom::Bool(false)),
            opcode::BININT1 => Value::Atom(Atom::Int(self.reader.byte()?.into())),
            opcode::BININT2 => Value::Atom(Atom::Int(u16::from_le_bytes(self.reader.word()?).into())),
            opcode::BININT => Value::Atom(Atom::Int(i32::from_le_bytes(self.reader.word()?))),
            opcode::BINUNICODE => Value::Atom(Atom::Text(self.reader.text()?)),
            opcode::SHORT_BINBYTES => {
                let length = self.reader.byte()?;
                Value::Atom(Atom::Bytes(self.reader.take(length.into())?))
            }
            opcode::BINBYTES => {
                let length = self.reader.length()?;
                Value::Atom(Atom::Bytes(self.reader.take(length)?))
            }
            opcode::GLOBAL => {
                let (module, name) = (self.reader.line()?, self.reader.line()?);
                Value::Atom(value::global(module, name)?)
            }
            opcode::EMPTY_DICT => Value::Dict(BTreeMap::new()),
            opcode::TUPLE => Value::Tuple(self.pop_to_mark()?),
            opcode::TUPLE1 => Value::Tuple(vec![self.pop()?]),
            opcode::TUPLE3 => {
                let (c, b, a) = (self.pop()?, self.pop()?, self.pop()?);
                Value::Tuple(vec![a, b, c])
            }
            opcode::SETITEM => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.put(vec![key, value])?
            }
            opcode::SETITEMS => {
                let items = self.pop_to_mark()?;
                self.put(items)?
            }
            opcode::REDUCE => {
                let arguments = self.pop_tuple()?;
                value::call(&self.pop()?, &arguments)?
            }
            opcode::BUILD => {
                let state = self.pop_tuple()?;
                value::build(&self.pop()?, &state)?
            }
            other => {
                return Err(match opcode::name(other) {
                    Some(name) => format!("the opcode {name} is not one that weights need"),
                    None => format!("{other:#04x} is no opcode"),
                });
            }
        };
        if value.depth() > MAX_DEPTH {
            return Err(format!("tuples or dictionaries are nested deeper than {MAX_DEPTH}"));
        }
        self.stack.push(Item::Value(value));
        Ok(None)
    }

    fn pop(&mut self) -> Result<Value<'a>, String> {
        match self.stack.pop() {
            Some(Item::Value(value)) => Ok(value),
            Some(Item::Mark) => Err("a value is wanted where a mark is".into()),
            None => Err("a value is wanted and there is none".into()),
        }
    }

    fn pop_tuple(&mut self) -> Result<Vec<Value<'a>>, String> {
        match self.pop()? {
            Value::Tuple(items) => Ok(items),
            other => Err(format!("a tuple is wanted, not {}", other.kind())),
        }
    }

    /// All values above the last mark, which goes too.
    fn pop_to_mark(&mut self) -> Result<Vec<Value<'a>>, String> {
        let mark = self.stack.iter().rposition(|item| matches!(item, Item::Mark));
        let above = self.stack.split_off(mark.ok_or("a mark is wanted and there is none")?);
        let values = above.into_iter().filter_map(|item| match item {
            Item::Value(value) => Some(value),
            Item::Mark => None,
        });
        Ok(values.collect())
    }

    /// The dictionary on the stack with these keys and values, in turn.
    fn put(&mut self, items: Vec<Value<'a>>) -> Result<Value<'a>, String> {
        let mut dict = match self.pop()? {
            Value::Dict(dict) => dict,
            other => return Err(format!("a dictionary is wanted, not {}", other.kind())),
        };
        let mut items = items.into_iter();
        while let Some(key) = items.next() {
            let Value::Atom(Atom::Text(key)) = key else {
                return Err(format!("a key is {}, not a text", key.kind()));
            };
            let value = items.next().ok_or_else(|| format!("the key {key:?} has no value"))?;
            if dict.insert(key, value).is_some() {
                return Err(format!("the key {key:?} is there twice"));
            }
        }
        Ok(Value::Dict(dict))
    }

    fn remember(&mut self) -> Result<(), String> {
        let index = self.reader.byte()?;
        let atom = match self.stack.last() {
            Some(Item::Value(Value::Atom(atom))) => Some(*atom),
            Some(Item::Value(_)) => None,
            _ => return Err("there is no value to remember".into()),
        };
        self.memo.insert(index, atom);
        Ok(())
    }

    fn recall(&mut self) -> Result<Value<'a>, String> {
        let index = self.reader.byte()?;
        match self.memo.get(&index) {
            Some(Some(atom)) => Ok(Value::Atom(*atom)),
            Some(None) => Err(format!("value {index} is used twice and has parts")),
            None => Err(format!("value {index} was not remembered")),
        }
    }

    fn result(&mut self) -> Result<Value<'a>, String> {
        let value = self.pop()?;
        match (self.stack.len(), self.reader.left().len()) {
            (0, 0) => Ok(value),
            (0, tail) => Err(format!("{tail} bytes follow the end")),
            (left, _) => Err(format!("{left} values are left over at the end")),
        }
    }
}

//! What a checkpoint holds: dictionaries of arrays, and what those are put together from.
//!
//! Of the things that a pickle can call there are three, all of numpy; they are understood here, not called.
use std::collections::BTreeMap;

/// A value without parts, which may be used more than once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Atom<'a> {
    None,
    Bool(bool),
    Int(i32),
    Text(&'a str),
    Bytes(&'a [u8]),
    /// The function `numpy.core.multiarray._reconstruct`.
    Reconstruct,
    /// The class `numpy.ndarray`.
    ArrayClass,
    /// The class `numpy.dtype`.
    TypeClass,
    /// The type of little-endian numbers of single precision.
    Float32,
}

#[derive(Debug, PartialEq)]
pub enum Value<'a> {
    Atom(Atom<'a>),
    Tuple(Vec<Value<'a>>),
    Dict(BTreeMap<&'a str, Value<'a>>),
    /// An array whose state is still to come.
    Blank,
    Array(Array<'a>),
}

/// Numbers of single precision, little-endian, in row-major order: as many as the shape says.
#[derive(Debug, PartialEq)]
pub struct Array<'a> {
    pub shape: Vec<usize>,
    pub data: &'a [u8],
}

impl<'a> Value<'a> {
    /// How deep tuples and dictionaries are nested.
    pub fn depth(&self) -> usize {
        let inner = match self {
            Self::Tuple(items) => items.iter().map(Self::depth).max(),
            Self::Dict(items) => items.values().map(Self::depth).max(),
            _ => return 0,
        };
        1 + inner.unwrap_or(0)
    }

    /// What something is called in error messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Atom(Atom::None) => "None",
            Self::Atom(Atom::Bool(_)) => "a truth value",
            Self::Atom(Atom::Int(_)) => "a number",
            Self::Atom(Atom::Text(_)) => "a text",
            Self::Atom(Atom::Bytes(_)) => "bytes",
            Self::Atom(Atom::Reconstruct) => "a function",
            Self::Atom(Atom::ArrayClass | Atom::TypeClass) => "a class",
            Self::Atom(Atom::Float32) => "a type of numbers",
            Self::Tuple(_) => "a tuple",
            Self::Dict(_) => "a dictionary",
            Self::Blank => "an array without numbers",
            Self::Array(_) => "an array",
        }
    }
}

/// What a module's name stands for.
pub fn global(module: &str, name: &str) -> Result<Atom<'static>, String> {
    match (module, name) {
        ("numpy.core.multiarray", "_reconstruct") => Ok(Atom::Reconstruct),
        ("numpy", "ndarray") => Ok(Atom::ArrayClass),
        ("numpy", "dtype") => Ok(Atom::TypeClass),
        _ => Err(format!("wants {module}.{name}, and weights have no need of it")),
    }
}

/// What a call gives.
pub fn call<'a>(function: &Value<'a>, arguments: &[Value<'a>]) -> Result<Value<'a>, String> {
    use Atom::{ArrayClass, Bool, Bytes, Int, Reconstruct, Text, TypeClass};
    use Value::{Atom as A, Tuple};
    match (function, arguments) {
        (A(Reconstruct), [A(ArrayClass), Tuple(shape), A(Bytes(b"b"))]) if **shape == [A(Int(0))] => Ok(Value::Blank),
        (A(TypeClass), [A(Text("f4")), A(Bool(false)), A(Bool(true))]) => Ok(A(Atom::Float32)),
        (A(TypeClass), [A(Text(other)), ..]) => Err(format!("has numbers of type {other:?}, expected \"f4\"")),
        (A(Reconstruct | TypeClass), _) => Err("has arguments that arrays are not made with".into()),
        (other, _) => Err(format!("calls {}", other.kind())),
    }
}

/// An object once its state is there.
pub fn build<'a>(object: &Value<'a>, state: &[Value<'a>]) -> Result<Value<'a>, String> {
    use Atom::{Bool, Bytes, Float32, Int, Text};
    use Value::{Atom as A, Tuple};
    match (object, state) {
        (A(Float32), [A(Int(3)), A(Text(order)), rest @ ..]) => {
            let plain = [Atom::None, Atom::None, Atom::None, Int(-1), Int(-1), Int(0)].map(A);
            match (*order, *rest == plain) {
                ("<", true) => Ok(A(Float32)),
                ("<", false) => Err("has numbers with fields, which are not read".into()),
                _ => Err(format!("has numbers in byte order {order:?}, expected \"<\"")),
            }
        }
        (Value::Blank, [A(Int(1)), Tuple(shape), A(Float32), A(Bool(false)), A(Bytes(data))]) => array(shape, data),
        (Value::Blank, [_, _, _, A(Bool(true)), _]) => Err("has an array in column-major order".into()),
        (A(Float32) | Value::Blank, _) => Err("has a state that arrays are not in".into()),
        (other, _) => Err(format!("gives a state to {}", other.kind())),
    }
}

fn array<'a>(axes: &[Value<'a>], data: &'a [u8]) -> Result<Value<'a>, String> {
    let axis = |value: &Value<'a>| match value {
        Value::Atom(Atom::Int(n)) => usize::try_from(*n).ok(),
        _ => None,
    };
    let shape: Option<Vec<usize>> = axes.iter().map(axis).collect();
    let shape = shape.ok_or("has an array whose shape is not of numbers from 0")?;
    let bytes = shape.iter().try_fold(4usize, |all, axis| all.checked_mul(*axis));
    match bytes == Some(data.len()) {
        true => Ok(Value::Array(Array { shape, data })),
        false => Err(format!(
            "has an array of shape {shape:?} with {} bytes of numbers",
            data.len()
        )),
    }
}

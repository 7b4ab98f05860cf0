//! The JSON of camera files, read without keeping more of it than the fields that cameras have.
//!
//! A text is gone over three times: to find mistakes of syntax, to find its outline, and for the entries one by one.
use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// Most characters of the parser's messages, which quote the file.
const MAX_MESSAGE: usize = 200;

/// What a text is.
pub(super) enum Outline {
    /// An array of so many entries.
    Array(usize),
    /// An object.
    Object(Box<Fields>),
    /// Anything else.
    Other,
}

/// The fields of an entry, and of the object around the entries of a `transforms.json`. What else there is is passed
/// over.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Fields {
    /// That of a glTF.
    pub asset: Option<IgnoredAny>,
    pub frames: Option<Length>,
    pub position: Option<List<Scalar, 3>>,
    pub rotation: Option<List<List<Scalar, 3>, 3>>,
    pub transform_matrix: Option<List<List<Scalar, 4>, 4>>,
    pub width: Option<Scalar>,
    pub height: Option<Scalar>,
    pub fx: Option<Scalar>,
    pub fy: Option<Scalar>,
    pub cx: Option<Scalar>,
    pub cy: Option<Scalar>,
    pub w: Option<Scalar>,
    pub h: Option<Scalar>,
    pub fl_x: Option<Scalar>,
    pub fl_y: Option<Scalar>,
    pub camera_angle_x: Option<Scalar>,
    pub camera_angle_y: Option<Scalar>,
}

/// The outline of a text; `Err` is a mistake of syntax.
pub(super) fn outline(text: &[u8]) -> Result<Outline, String> {
    serde_json::from_slice::<IgnoredAny>(text).map_err(|e| format!("not JSON: {}", short(&e)))?;
    match text.trim_ascii_start().first() {
        Some(b'[') => {
            let length: Length = serde_json::from_slice(text).map_err(|e| short(&e))?;
            Ok(Outline::Array(length.0.unwrap_or(0)))
        }
        Some(b'{') => serde_json::from_slice(text).map(Outline::Object).map_err(|e| short(&e)),
        _ => Ok(Outline::Other),
    }
}

/// Hands the entries of an array, or of the array `frames` of an object, to `each` in their order, until it has a reason
/// not to go on; that gets the entry's number.
pub(super) fn for_each(text: &[u8], each: impl FnMut(Fields) -> Result<(), String>) -> Result<(), String> {
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let entries = Entries(each);
    let done = match text.trim_ascii_start().first() {
        Some(b'[') => entries.deserialize(&mut deserializer),
        _ => Frames(entries).deserialize(&mut deserializer),
    };
    done.map_err(|e| short(&e))
}

fn short(error: &serde_json::Error) -> String {
    let text = error.to_string();
    match text.char_indices().nth(MAX_MESSAGE) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

/// Reads an array by handing out its entries.
struct Entries<F>(F);

impl<'de, F: FnMut(Fields) -> Result<(), String>> DeserializeSeed<'de> for Entries<F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, F: FnMut(Fields) -> Result<(), String>> Visitor<'de> for Entries<F> {
    type Value = ();

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("an array of cameras")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut entries: A) -> Result<(), A::Error> {
        for i in 0usize.. {
            let at = |reason: &dyn fmt::Display| de::Error::custom(format_args!("camera {i}: {reason}"));
            match entries.next_element().map_err(|e| at(&e))? {
                Some(fields) => (self.0)(fields).map_err(|e| at(&e))?,
                None => break,
            }
        }
        Ok(())
    }
}

/// Reads the array `frames` of an object.
struct Frames<F>(Entries<F>);

impl<'de, F: FnMut(Fields) -> Result<(), String>> DeserializeSeed<'de> for Frames<F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de, F: FnMut(Fields) -> Result<(), String>> Visitor<'de> for Frames<F> {
    type Value = ();

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("an object with frames")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<(), A::Error> {
        // The outline has found no second one of this name.
        let mut entries = Some(self.0);
        while let Some(name) = fields.next_key::<Name>()? {
            match entries.take_if(|_| name == Name::Frames) {
                Some(entries) => fields.next_value_seed(entries)?,
                None => fields.next_value::<IgnoredAny>().map(|_| ())?,
            }
        }
        Ok(())
    }
}

/// The name of a field.
#[derive(Deserialize, PartialEq)]
#[serde(field_identifier, rename_all = "snake_case")]
enum Name {
    Frames,
    #[serde(other)]
    Other,
}

/// How many elements an array has; `None` for what is none.
pub(super) struct Length(pub Option<usize>);

/// A number, or what is in its place, in words.
pub(super) enum Scalar {
    Number(f64),
    Other(String),
}

/// An array of so many values; `None` for anything else.
pub(super) struct List<T, const N: usize>(pub Option<[T; N]>);

impl<const N: usize> List<Scalar, N> {
    /// The numbers, if all of them are.
    pub fn numbers(&self) -> Option<[f64; N]> {
        let mut found = [0.0; N];
        for (slot, value) in found.iter_mut().zip(self.0.as_ref()?) {
            match value {
                Scalar::Number(number) => *slot = *number,
                Scalar::Other(_) => return None,
            }
        }
        Some(found)
    }
}

/// Makes a value of whatever is there, and never fails but for the syntax.
trait Lenient<'de>: Sized {
    fn number(_: f64) -> Self {
        Self::other("a number".into())
    }
    fn list<A: SeqAccess<'de>>(elements: A) -> Result<Self, A::Error>;
    fn other(what: String) -> Self;
}

struct Whatever<T>(PhantomData<T>);

impl<'de, T: Lenient<'de>> Visitor<'de> for Whatever<T> {
    type Value = T;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("anything")
    }
    fn visit_f64<E>(self, value: f64) -> Result<T, E> {
        Ok(T::number(value))
    }
    fn visit_u64<E>(self, value: u64) -> Result<T, E> {
        Ok(T::number(value as f64))
    }
    fn visit_i64<E>(self, value: i64) -> Result<T, E> {
        Ok(T::number(value as f64))
    }
    fn visit_bool<E>(self, value: bool) -> Result<T, E> {
        Ok(T::other(value.to_string()))
    }
    fn visit_unit<E>(self) -> Result<T, E> {
        Ok(T::other("null".into()))
    }
    fn visit_str<E>(self, text: &str) -> Result<T, E> {
        let start: String = text.chars().take(MAX_MESSAGE).collect();
        Ok(T::other(format!("{start:?}")))
    }
    fn visit_seq<A: SeqAccess<'de>>(self, elements: A) -> Result<T, A::Error> {
        T::list(elements)
    }
    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<T, A::Error> {
        while fields.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(T::other("an object".into()))
    }
}

/// Passes over the rest of an array; how many elements there were.
fn count<'de, A: SeqAccess<'de>>(mut elements: A) -> Result<usize, A::Error> {
    let mut length = 0;
    while elements.next_element::<IgnoredAny>()?.is_some() {
        length += 1;
    }
    Ok(length)
}

impl<'de> Lenient<'de> for Length {
    fn list<A: SeqAccess<'de>>(elements: A) -> Result<Self, A::Error> {
        Ok(Self(Some(count(elements)?)))
    }
    fn other(_: String) -> Self {
        Self(None)
    }
}

impl<'de> Lenient<'de> for Scalar {
    fn number(value: f64) -> Self {
        Self::Number(value)
    }
    fn list<A: SeqAccess<'de>>(elements: A) -> Result<Self, A::Error> {
        count(elements).map(|_| Self::Other("a list".into()))
    }
    fn other(what: String) -> Self {
        Self::Other(what)
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Lenient<'de> for List<T, N> {
    fn list<A: SeqAccess<'de>>(mut elements: A) -> Result<Self, A::Error> {
        let mut found = Vec::with_capacity(N);
        while found.len() < N {
            match elements.next_element()? {
                Some(element) => found.push(element),
                None => break,
            }
        }
        let more = count(elements)?;
        Ok(Self(found.try_into().ok().filter(|_| more == 0)))
    }
    fn other(_: String) -> Self {
        Self(None)
    }
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Whatever(PhantomData))
    }
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Whatever(PhantomData))
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for List<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Whatever(PhantomData))
    }
}

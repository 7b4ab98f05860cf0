//! Pages of lists: sizes, and tokens bound to the query that they go on with.
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::service::opaque_token;

const DEFAULT_SIZE: u32 = 50;
const MAX_SIZE: u32 = 1000;

/// Where a page begins: behind the entry made at this time (microseconds) with this id.
pub type Position = (i64, Uuid);

/// Entries of a page, for the `page_size` asked for.
pub fn size(asked: i32) -> Result<u32> {
    match u32::try_from(asked) {
        Ok(0) => Ok(DEFAULT_SIZE),
        Ok(size) => Ok(size.min(MAX_SIZE)),
        Err(_) => Err(Error::invalid(
            "page_size",
            format!("{asked} is negative, must be 0 to {MAX_SIZE}"),
        )),
    }
}

/// The token of the page behind `position`, for this query.
pub fn token(query: &[&[u8]], (time, id): Position) -> String {
    let mut payload = [0; 24];
    payload[..8].copy_from_slice(&time.to_be_bytes());
    payload[8..].copy_from_slice(id.as_bytes());
    opaque_token::seal(query, &payload)
}

/// Where the page begins that `token` stands for; `None` for the first.
pub fn position(query: &[&[u8]], token: &str) -> Result<Option<Position>> {
    if token.is_empty() {
        return Ok(None);
    }
    let payload: [u8; 24] = opaque_token::open(query, token).ok_or_else(|| {
        Error::invalid(
            "page_token",
            "is not the next_page_token of a page of this query; ask with the same filter",
        )
    })?;
    let (time, id) = payload.split_at(8);
    // Both lengths are those of the arrays they came from.
    let time = i64::from_be_bytes(std::array::from_fn(|i| time[i]));
    Ok(Some((time, Uuid::from_bytes(std::array::from_fn(|i| id[i])))))
}

/// A page of `size` entries out of one more than that, if there are so many, and the token of the next page.
pub fn cut<T>(query: &[&[u8]], mut rows: Vec<T>, size: u32, at: impl Fn(&T) -> Position) -> (Vec<T>, String) {
    let more = rows.len() > size as usize;
    rows.truncate(size as usize);
    let last = rows.last().filter(|_| more);
    let next = last.map(|row| token(query, at(row))).unwrap_or_default();
    (rows, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_a_default_and_a_limit() {
        assert_eq!(size(0).unwrap(), 50);
        assert_eq!(size(7).unwrap(), 7);
        assert_eq!(size(i32::MAX).unwrap(), 1000);
        assert!(
            size(-1)
                .unwrap_err()
                .to_string()
                .starts_with("page_size: -1 is negative")
        );
    }

    #[test]
    fn a_page_that_is_not_the_last_has_a_token() {
        let rows: Vec<Position> = (0..3).map(|time| (time, Uuid::nil())).collect();
        let (page, next) = cut(&[b"q"], rows.clone(), 2, |row| *row);
        assert_eq!((page.len(), position(&[b"q"], &next).unwrap()), (2, Some(rows[1])));
        assert_eq!(cut(&[b"q"], rows.clone(), 3, |row| *row), (rows, String::new()));
        assert_eq!(
            cut(&[b"q"], Vec::new(), 1, |row: &Position| *row),
            (vec![], String::new())
        );
    }

    #[test]
    fn positions_are_read_back_for_the_same_query() {
        let at = (-5, Uuid::now_v7());
        let text = token(&[b"jobs", &[1]], at);
        assert_eq!(position(&[b"jobs", &[1]], &text).unwrap(), Some(at));
        assert_eq!(position(&[b"jobs", &[1]], "").unwrap(), None);
        for (query, token) in [(&[2][..], text.as_str()), (&[1], &text[1..]), (&[1], "50")] {
            let error = position(&[b"jobs", query], token).unwrap_err();
            assert!(
                matches!(&error, Error::Invalid(v) if v[0].field == "page_token"),
                "{error:?}"
            );
        }
    }
}

//! Lists of the server, read page by page.
use crate::error::Result;

/// Entries of a page, at most.
const PAGE_SIZE: usize = 1000;

/// All entries of a list. `page` asks for one page, given its size and token: its entries, and the token of the next page.
///
/// # Errors
/// Those of `page`.
pub async fn all<T>(page: impl AsyncFnMut(i32, String) -> Result<(Vec<T>, String)>) -> Result<Vec<T>> {
    up_to(usize::MAX, page).await.map(|(entries, _)| entries)
}

/// As [`all`], but at most `limit` entries, and whether there are more.
///
/// # Errors
/// Those of `page`.
pub async fn up_to<T>(
    limit: usize,
    mut page: impl AsyncFnMut(i32, String) -> Result<(Vec<T>, String)>,
) -> Result<(Vec<T>, bool)> {
    // Every page of a list is asked for in the same way.
    let size = i32::try_from(limit.min(PAGE_SIZE)).unwrap_or(i32::MAX);
    let (mut entries, mut more, mut token) = (Vec::new(), false, String::new());
    while entries.len() < limit {
        let (next, next_token) = page(size, token).await?;
        entries.extend(next);
        more = entries.len() > limit || !next_token.is_empty();
        token = next_token;
        if token.is_empty() {
            break;
        }
    }
    entries.truncate(limit);
    Ok((entries, more))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads `0..count` in pages; the entries, whether there are more, and how many pages were asked for.
    async fn read(count: usize, limit: usize) -> (Vec<usize>, bool, usize) {
        let mut asked = 0;
        let read = up_to(limit, async |size, token: String| {
            asked += 1;
            let start = token.parse().unwrap_or(0);
            let end = count.min(start + size as usize);
            let next = if end < count { end.to_string() } else { String::new() };
            Ok(((start..end).collect(), next))
        });
        let (entries, more) = read.await.unwrap();
        (entries, more, asked)
    }

    #[tokio::test]
    async fn pages_are_read_as_far_as_they_are_wanted() {
        assert_eq!(read(2500, usize::MAX).await, ((0..2500).collect(), false, 3));
        assert_eq!(read(2500, 1500).await, ((0..1500).collect(), true, 2));
        assert_eq!(read(2500, 2500).await, ((0..2500).collect(), false, 3));
        assert_eq!(read(3, 2).await, (vec![0, 1], true, 1));
        assert_eq!(read(0, 5).await, (vec![], false, 1));
        assert_eq!(read(3, 0).await, (vec![], false, 0));
    }
}

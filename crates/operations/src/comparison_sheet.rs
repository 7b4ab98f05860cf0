//! The comparison picture of a marked scene: original, marked, and their difference.
use guardsplat_engine::Result;
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::contact_sheet;

/// What it is called.
pub const NAME: &str = "comparison.png";

/// Original, marked and ten times their difference, a row a pair; of large pictures as many rows as a file may have
/// pixels for.
pub fn of(pairs: &[(Picture, Picture)]) -> Result<Picture> {
    let mut rows = pairs.len();
    loop {
        match contact_sheet(&pairs[..rows]) {
            Err(_) if rows > 1 => rows -= 1,
            sheet => return sheet,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_do_not_fit_are_left_out() {
        let pair = |side: u32| {
            let picture = Picture {
                width: side,
                height: side,
                pixels: vec![0.5; 3 * (side * side) as usize],
            };
            (picture.clone(), picture)
        };
        assert_eq!(of(&[pair(8), pair(8), pair(8)]).unwrap().height, 3 * 8 + 2 * 4);
        // Too many pixels would need a gigabyte here; another size is refused alike.
        assert_eq!(of(&[pair(8), pair(8), pair(9)]).unwrap().height, 2 * 8 + 4);
        assert!(of(&[]).is_err());
    }
}

//! Checks commitments one after the other: that none is missing, none was put in between, and none dated back.
use crate::{Error, FIRST, Hash, PublicKey, Result, Signed};

/// Where a chain ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Place of the last commitment; 0 for a chain without any.
    pub sequence: u64,
    /// Hash of the last commitment; [`FIRST`] for a chain without any.
    pub hash: Hash,
    /// When the last commitment was made, microseconds since 1970, UTC.
    pub time: i64,
}

impl Link {
    /// The end of a chain in which nothing is yet.
    pub const START: Self = Self {
        sequence: 0,
        hash: FIRST,
        time: i64::MIN,
    };

    /// The end of a chain with this commitment as its last.
    pub fn at(signed: &Signed) -> Self {
        Self {
            sequence: signed.commitment.sequence,
            hash: signed.hash(),
            time: signed.commitment.time,
        }
    }
}

/// A chain as far as it was checked.
#[derive(Clone, Debug)]
pub struct Chain {
    key: PublicKey,
    head: Link,
}

impl Chain {
    /// Begins before the first commitment.
    pub fn new(key: PublicKey) -> Self {
        Self { key, head: Link::START }
    }

    /// Begins behind a commitment that is trusted, such as a head that was published.
    pub fn after(key: PublicKey, head: Link) -> Self {
        Self { key, head }
    }

    /// The last commitment that was checked.
    pub fn head(&self) -> Link {
        self.head
    }

    /// Checks that this is the next commitment of the chain, and signed. One that is refused leaves the chain as it is.
    ///
    /// # Errors
    /// `OutOfOrder`, `NotLinked`, `BackDated`, `BadSignature`.
    pub fn push(&mut self, signed: &Signed) -> Result<()> {
        let next = &signed.commitment;
        let wanted = self.head.sequence.saturating_add(1);
        if next.sequence != wanted {
            return Err(Error::OutOfOrder {
                wanted,
                found: next.sequence,
            });
        }
        if next.previous != self.head.hash {
            return Err(Error::NotLinked {
                sequence: next.sequence,
                found: hex::encode(next.previous),
                wanted: hex::encode(self.head.hash),
            });
        }
        if next.time < self.head.time {
            return Err(Error::BackDated {
                sequence: next.sequence,
                earlier: self.head.time.abs_diff(next.time),
            });
        }
        signed.verify(&self.key)?;
        self.head = Link::at(signed);
        Ok(())
    }
}

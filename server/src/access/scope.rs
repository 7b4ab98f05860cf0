//! What a token is good for.
use std::fmt;

/// One thing that a token may be good for. Numbers are kept in the database, and those of `guardsplat.v1.Token.Scope`
/// are the powers of two in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Scope {
    /// Makes keys, registers owners and assets, marks scenes.
    Embed = 1,
    /// Reads suspects, and decides claims.
    Verify = 2,
    /// Manages the project's tokens and the states of its keys.
    Admin = 4,
    /// Carries out jobs, of whatever project.
    Worker = 8,
}

impl Scope {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Embed, Self::Verify, Self::Admin, Self::Worker];

    /// Its name, as it is written everywhere.
    pub fn word(self) -> &'static str {
        match self {
            Self::Embed => "embed",
            Self::Verify => "verify",
            Self::Admin => "admin",
            Self::Worker => "worker",
        }
    }
}

/// Several scopes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scopes(u8);

impl Scopes {
    /// Every scope there is.
    pub fn all() -> Self {
        Scope::ALL.into_iter().collect()
    }

    /// From the number that the database keeps; none if it has a scope that this version doesn't know, or no scope.
    pub fn from_bits(bits: i64) -> Option<Self> {
        let bits = u8::try_from(bits).ok()?;
        (bits != 0 && bits & !Self::all().0 == 0).then_some(Self(bits))
    }

    /// As the database keeps them.
    pub fn bits(self) -> i64 {
        self.0.into()
    }

    /// Whether nothing is allowed at all.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether this one is among them.
    pub fn has(self, scope: Scope) -> bool {
        self.0 & scope as u8 != 0
    }

    /// Those among them, in their usual order.
    pub fn iter(self) -> impl Iterator<Item = Scope> {
        Scope::ALL.into_iter().filter(move |&scope| self.has(scope))
    }
}

impl FromIterator<Scope> for Scopes {
    fn from_iter<I: IntoIterator<Item = Scope>>(scopes: I) -> Self {
        Self(scopes.into_iter().fold(0, |bits, scope| bits | scope as u8))
    }
}

impl fmt::Display for Scopes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<_> = self.iter().map(Scope::word).collect();
        f.write_str(&words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_back_and_unknown_ones_refused() {
        for bits in 1..16 {
            assert_eq!(Scopes::from_bits(bits).map(Scopes::bits), Some(bits));
        }
        for bits in [0, 16, 17, -1, 256, i64::MAX] {
            assert_eq!(Scopes::from_bits(bits), None, "{bits}");
        }
        let two: Scopes = [Scope::Worker, Scope::Embed].into_iter().collect();
        assert_eq!(two.to_string(), "embed, worker");
        assert!(two.has(Scope::Embed) && !two.has(Scope::Admin));
    }
}

//! Which spherical harmonics coefficients are trainable.
use super::settings::Settings;
use crate::error::Error;

/// Which coefficients change. Geometry and opacity never do: the renderer has no gradient to them, and does not need one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrainableCoefficients {
    /// All coefficients of the spherical harmonics.
    #[default]
    Sh,
    /// Only the constant ones.
    Dc,
    /// Only the others.
    Rest,
}

impl std::str::FromStr for TrainableCoefficients {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            // All that this program can change.
            "all" | "sh" => Ok(Self::Sh),
            "dc" => Ok(Self::Dc),
            "rest" => Ok(Self::Rest),
            other => Err(Error::BadOption {
                field: "learn",
                reason: format!("{other:?} cannot be learned, must be all, sh, dc or rest"),
            }),
        }
    }
}

impl Settings {
    /// These settings with only some coefficients learned: the optimiser's rates of the others are 0.
    pub fn learning(mut self, what: TrainableCoefficients) -> Self {
        let (dc, rest) = match what {
            TrainableCoefficients::Sh => return self,
            TrainableCoefficients::Dc => (1.0, 0.0),
            TrainableCoefficients::Rest => (0.0, 1.0),
        };
        self.optimizer = self.optimizer.scaled(dc, rest);
        self
    }
}

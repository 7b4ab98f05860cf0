//! What the values of a byte stand for: a list of numbers, or steps between two.

/// A table of up to 256 numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Codebook {
    /// NaN where there is none.
    values: [f32; 256],
    /// The numbers that new colours may have, each once, ascending, with its index.
    sorted: Vec<(f32, u8)>,
}

impl Codebook {
    /// The `codebook` of version 2; `Err` says what is wrong with it.
    ///
    /// Old tools wrote null for the first number. As PlayCanvas' engine does, it is taken for one a little below the
    /// second; new colours do not get it, as other readers differ.
    pub fn listed(entries: &[Option<f64>]) -> Result<Codebook, String> {
        if entries.len() > 256 {
            return Err(format!("{} numbers, limit 256", entries.len()));
        }
        let mut values = [f32::NAN; 256];
        for (i, entry) in entries.iter().enumerate() {
            // Adding 0 makes the negative one positive.
            values[i] = entry.map_or(f32::NAN, |entry| entry as f32 + 0.0);
            if values[i].is_infinite() {
                return Err(format!("number {i} is too large for single precision"));
            }
        }
        let mut codebook = Codebook::new(values);
        if codebook.sorted.is_empty() {
            return Err("no numbers".into());
        }
        let first = values[1] + (values[1] - values[255]) / 255.0;
        if values[0].is_nan() && first.is_finite() {
            codebook.values[0] = first;
        }
        Ok(codebook)
    }

    /// The 256 steps from `min` to `max` of version 1; `Err` says what is wrong with them.
    pub fn linear(min: f64, max: f64) -> Result<Codebook, String> {
        Codebook::from_fn(|byte| (min + (max - min) * (f64::from(byte) / 255.0)) as f32 + 0.0)
            .filter(|codebook| codebook.values.iter().all(|value| value.is_finite()))
            .ok_or_else(|| format!("{min:e} to {max:e} are too large for single precision"))
    }

    /// The logits of opacities of `byte / 255` of version 2.
    pub fn logits() -> Codebook {
        let logit = |byte| (f64::from(byte) / (255.0 - f64::from(byte))).ln() as f32;
        Codebook::from_fn(logit).expect("no NaN")
    }

    fn from_fn(value: impl Fn(u8) -> f32) -> Option<Codebook> {
        let mut values = [f32::NAN; 256];
        for byte in 0..=255 {
            values[usize::from(byte)] = value(byte);
        }
        values.iter().all(|v| !v.is_nan()).then(|| Codebook::new(values))
    }

    fn new(values: [f32; 256]) -> Codebook {
        let mut sorted: Vec<(f32, u8)> = values.into_iter().zip(0..=255).collect();
        sorted.retain(|(value, _)| value.is_finite());
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        sorted.dedup_by_key(|(value, _)| *value);
        Codebook { values, sorted }
    }

    /// What `byte` stands for; NaN where the table has no such number.
    pub fn value(&self, byte: u8) -> f32 {
        self.values[usize::from(byte)]
    }

    /// The byte that stands for the number nearest to `value`: `byte` if that is already it, whatever else is.
    pub fn nearest(&self, byte: u8, value: f32) -> u8 {
        if self.value(byte) == value {
            return byte;
        }
        let above = self.sorted.partition_point(|(number, _)| *number < value);
        let distance = |i: usize| (f64::from(self.sorted[i].0) - f64::from(value)).abs();
        let i = match above {
            0 => 0,
            last if last == self.sorted.len() => last - 1,
            i if distance(i - 1) <= distance(i) => i - 1,
            i => i,
        };
        self.sorted[i].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(numbers: &[f64]) -> Codebook {
        Codebook::listed(&numbers.iter().copied().map(Some).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn the_nearest_number_in_any_order() {
        let table = listed(&[0.5, -1.0, 0.5, 2.0]);
        for (value, byte) in [
            (-9.0, 1),
            (-0.26, 1),
            (-0.24, 0),
            (1.2, 0),
            (1.3, 3),
            (f32::MAX, 3),
            (-1e30, 1),
        ] {
            assert_eq!(table.nearest(1, value), byte, "{value}");
        }
        // Of two equal ones the one that is there stays.
        assert_eq!(
            (table.nearest(2, 0.5), table.nearest(0, 0.5), table.nearest(1, 0.5)),
            (2, 0, 0)
        );
    }

    #[test]
    fn zero_has_one_sign() {
        let table = listed(&[-0.0, 0.0, 1.0]);
        assert_eq!(table.value(0).to_bits(), 0);
        assert_eq!(table.nearest(2, -1e-9), 0);
    }

    #[test]
    fn a_first_number_that_is_null_is_for_reading_only() {
        let mut entries: Vec<_> = (0..256).map(|i| Some(f64::from(i))).collect();
        entries[0] = None;
        let table = Codebook::listed(&entries).unwrap();
        // 1 + (1 - 255) / 255, by the engine's formula.
        assert!((table.value(0) - 0.003_921_6).abs() < 1e-6);
        assert_eq!(
            (table.nearest(0, table.value(0)), table.nearest(9, table.value(0))),
            (0, 1)
        );
        entries[7] = None;
        assert!(Codebook::listed(&entries).unwrap().value(7).is_nan());
        assert!(Codebook::listed(&entries[..9]).unwrap().value(0).is_nan(), "no last");
    }

    #[test]
    fn tables_that_are_none() {
        let reason = |entries: &[Option<f64>]| Codebook::listed(entries).unwrap_err();
        assert_eq!(reason(&[]), "no numbers");
        assert_eq!(reason(&[None; 256]), "no numbers");
        assert_eq!(reason(&[Some(1.0); 257]), "257 numbers, limit 256");
        assert_eq!(
            reason(&[Some(1.0), Some(1e39)]),
            "number 1 is too large for single precision"
        );
        assert!(Codebook::linear(0.0, 1e39).is_err());
        assert!(Codebook::linear(-f64::MAX, f64::MAX).is_err());
    }

    #[test]
    fn steps_and_logits() {
        let steps = Codebook::linear(-1.0, 4.1).unwrap();
        assert_eq!((steps.value(0), steps.value(255)), (-1.0, 4.1));
        assert!((steps.value(50) - 0.0).abs() < 1e-6); // -1 + 5.1 * 50 / 255
        assert_eq!(steps.nearest(0, 0.005), 50);
        let logits = Codebook::logits();
        assert_eq!((logits.value(0), logits.value(255)), (f32::NEG_INFINITY, f32::INFINITY));
        assert!((logits.value(51) - -1.386_294_4).abs() < 1e-6); // ln(0.2 / 0.8)
    }
}

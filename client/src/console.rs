//! Progress for people, on standard error: a bar on a terminal, a line now and then elsewhere.
use std::cell::RefCell;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::output::say;

/// Time between two lines where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);
/// Between two pictures of a spinner.
const TICK: Duration = Duration::from_millis(120);

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Steps, views or pictures.
    Steps,
    /// Bytes.
    Bytes,
    /// Nothing: it is under way.
    Waiting,
}

impl Unit {
    fn template(self) -> &'static str {
        match self {
            Self::Steps => "{prefix:10} [{bar:30}] {pos}/{len} {elapsed_precise} {msg}",
            Self::Bytes => "{prefix:10} [{bar:30}] {bytes}/{total_bytes} {bytes_per_sec} {msg}",
            Self::Waiting => "{prefix:10} {spinner} {elapsed_precise} {msg}",
        }
    }
}

/// Standard error, with one thing at a time that is being done.
pub struct Console {
    terminal: bool,
    current: RefCell<Option<Current>>,
}

struct Current {
    title: String,
    unit: Unit,
    bar: Option<ProgressBar>,
    last_line: Option<Instant>,
    last_figures: String,
    complete: bool,
    total: u64,
}

impl Console {
    /// Standard error, with nothing being done.
    pub fn new() -> Self {
        Self {
            terminal: std::io::stderr().is_terminal(),
            current: RefCell::new(None),
        }
    }

    /// `done` of `total`, with figures to go with it; another title begins something new.
    pub fn show(&self, title: &str, unit: Unit, done: u64, total: u64, figures: &str) {
        let mut slot = self.current.borrow_mut();
        if slot.as_ref().is_some_and(|c| c.title != title || c.unit != unit)
            && let Some(current) = slot.take()
        {
            current.clear();
        }
        let current = slot.get_or_insert_with(|| Current::new(title, unit, self.terminal));
        match &current.bar {
            Some(bar) => {
                bar.set_length(total);
                bar.set_position(done);
                bar.set_message(figures.to_owned());
            }
            None => {
                if let Some(line) = current.line(Instant::now(), done, total, figures) {
                    say(&line);
                }
            }
        }
    }

    /// A line of its own.
    pub fn say(&self, line: &str) {
        match self.current.borrow().as_ref().and_then(|c| c.bar.as_ref()) {
            Some(bar) => bar.println(line),
            None => say(line),
        }
    }

    /// Nothing is being done any more.
    pub fn clear(&self) {
        if let Some(current) = self.current.borrow_mut().take() {
            current.clear();
        }
    }
}

impl Current {
    fn new(title: &str, unit: Unit, terminal: bool) -> Self {
        let bar = terminal.then(|| {
            let bar = ProgressBar::new(0).with_prefix(title.to_owned());
            // The templates are constants that indicatif accepts; were they not, its default bar does as well.
            if let Ok(style) = ProgressStyle::with_template(unit.template()) {
                bar.set_style(style.progress_chars("=> "));
            }
            if unit == Unit::Waiting {
                bar.enable_steady_tick(TICK);
            }
            bar
        });
        Self {
            title: title.to_owned(),
            unit,
            bar,
            last_line: None,
            last_figures: String::new(),
            complete: false,
            total: 0,
        }
    }

    fn clear(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }

    /// The line to print, if it is time for one: at the beginning, now and then, and once at the end.
    fn line(&mut self, now: Instant, done: u64, total: u64, figures: &str) -> Option<String> {
        let complete = self.unit != Unit::Waiting && total > 0 && done >= total;
        // The next of the same kind: another file, another attempt.
        let begins = self.complete && (!complete || total != self.total);
        let due = begins
            || match self.last_line {
                None => true,
                Some(_) if self.unit == Unit::Waiting => figures != self.last_figures,
                Some(_) if self.complete => false,
                Some(last) => complete || now.duration_since(last) >= BETWEEN_LINES,
            };
        if !due {
            return None;
        }
        self.last_line = Some(now);
        self.last_figures = figures.to_owned();
        (self.complete, self.total) = (complete, total);
        let count = match self.unit {
            Unit::Steps => format!(" {done}/{total}"),
            Unit::Bytes => format!(" {done}/{total} bytes"),
            Unit::Waiting => String::new(),
        };
        let gap = if figures.is_empty() { "" } else { " " };
        Some(format!("{}{count}{gap}{figures}", self.title))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_at_the_beginning_now_and_then_and_at_the_end() {
        let mut current = Current::new("marking", Unit::Steps, false);
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        assert_eq!(
            current.line(at(0), 1, 10, "bits 50.0 %").unwrap(),
            "marking 1/10 bits 50.0 %"
        );
        assert_eq!(current.line(at(5), 2, 10, ""), None);
        assert_eq!(current.line(at(11), 3, 10, "").unwrap(), "marking 3/10");
        assert_eq!(current.line(at(12), 10, 10, "").unwrap(), "marking 10/10");
        assert_eq!(current.line(at(40), 10, 10, ""), None);
        // A second file begins and ends.
        assert_eq!(current.line(at(41), 1, 7, "").unwrap(), "marking 1/7");
        assert_eq!(current.line(at(42), 7, 7, "").unwrap(), "marking 7/7");
        assert_eq!(current.line(at(42), 8, 8, "").unwrap(), "marking 8/8");
    }

    #[test]
    fn waiting_is_told_when_something_changes() {
        let mut current = Current::new("queued", Unit::Waiting, false);
        let now = Instant::now();
        assert_eq!(
            current.line(now, 0, 0, "2 jobs before it").unwrap(),
            "queued 2 jobs before it"
        );
        assert_eq!(
            current.line(now + Duration::from_secs(60), 0, 0, "2 jobs before it"),
            None
        );
        assert_eq!(current.line(now, 0, 0, "next").unwrap(), "queued next");
    }
}

//! Progress for people, on standard error: a bar on a terminal, a line now and then elsewhere.
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Time between two lines where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// One thing that is being done.
pub struct Display {
    title: &'static str,
    bar: Option<ProgressBar>,
    last: Instant,
}

impl Display {
    /// Shows `title`, and nothing yet.
    pub fn new(title: &'static str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(0).with_message("");
            let template = "{prefix:10} [{bar:30}] {pos}/{len} {elapsed_precise} {msg}";
            // The template is a constant that indicatif accepts; were it not, its default bar does as well.
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_prefix(title);
            bar
        });
        Self {
            title,
            bar,
            last: Instant::now(),
        }
    }

    /// `done` of `total`, with figures to go with it.
    pub fn set(&mut self, done: usize, total: usize, figures: impl FnOnce() -> String) {
        if let Some(bar) = &self.bar {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
            bar.set_message(figures());
        } else if self.last.elapsed() >= BETWEEN_LINES || done == total {
            self.last = Instant::now();
            let figures = figures();
            let gap = if figures.is_empty() { "" } else { " " };
            eprintln!("{} {done}/{total}{gap}{figures}", self.title);
        }
    }

    /// A line of its own.
    pub fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(line),
            None => eprintln!("{line}"),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        self.finish();
    }
}

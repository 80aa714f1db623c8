//! Progress of a command that works for long, on standard error: a bar on a terminal, a line now and then elsewhere.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::notice;

/// Share of the work after which the rate is known well enough for a time left.
const ESTIMATE_FROM: f64 = 0.05;
/// Time between two lines where there is no terminal: a log shows that the program lives, and stays short.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Share of a command's work that is done, and the time left at the rate so far. The bar is removed when it is dropped.
pub struct Progress {
    /// The work, with which each line begins.
    name: String,
    /// Name of what is counted, as `jumps`; none where the parts of the work have none: a share is shown then.
    parts: Option<&'static str>,
    done: AtomicU64,
    all: u64,
    begun: Instant,
    /// Time of the last line; none with a bar.
    last_line: Option<Mutex<Instant>>,
    bar: ProgressBar,
}

impl Progress {
    /// Begins a work of `all` parts.
    pub fn new(name: impl Into<String>, all: u64, parts: Option<&'static str>) -> Progress {
        let (name, begun) = (name.into(), Instant::now());
        let (bar, last_line) = match std::io::stderr().is_terminal() {
            true => (ProgressBar::new(all), None),
            false => (ProgressBar::hidden(), Some(Mutex::new(begun))),
        };
        let style = ProgressStyle::with_template("{prefix} {bar:30} {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_prefix(name.clone());
        Progress { name, parts, done: AtomicU64::new(0), all: all.max(1), begun, last_line, bar }
    }

    /// Counts parts that are done. `more` is shown behind their number, as a count of falls.
    pub fn add(&self, parts: u64, more: &str) {
        let done = (self.done.fetch_add(parts, Ordering::Relaxed) + parts).min(self.all);
        let count = match self.parts {
            Some(parts) => format!("{done} of {} {parts}", self.all),
            None => format!("{} %", 100 * done / self.all),
        };
        let left = seconds_left(done, self.all, self.begun.elapsed().as_secs_f64());
        let left = left.map(|left_s| format!("about {} left", minutes(left_s)));
        let shown = [Some(count), Some(more.to_owned()).filter(|more| !more.is_empty()), left];
        let shown = shown.into_iter().flatten().collect::<Vec<_>>().join(", ");
        if let Some(last) = &self.last_line {
            let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
            if last.elapsed() >= LINE_EVERY {
                *last = Instant::now();
                notice!("{}: {shown}", self.name);
            }
        }
        self.bar.set_position(done);
        self.bar.set_message(shown);
    }

    /// Removes the bar and returns the time since the beginning, in words.
    pub fn finish(self) -> String {
        minutes(self.begun.elapsed().as_secs_f64())
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Returns the time left at the rate so far, s; none before enough of the work is done.
pub fn seconds_left(done: u64, all: u64, passed_s: f64) -> Option<f64> {
    let share = done as f64 / all as f64;
    (share >= ESTIMATE_FROM).then(|| passed_s * (1.0 - share).max(0.0) / share)
}

/// Returns a time in words: seconds below 90 s, minutes above.
pub fn minutes(seconds: f64) -> String {
    if seconds < 90.0 { format!("{:.0} s", seconds.ceil()) } else { format!("{:.1} min", seconds / 60.0) }
}

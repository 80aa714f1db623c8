//! The log's lines and the state of its view.

use std::collections::VecDeque;

use quadfrog::recording::record::LogLevel;

/// Lines that the log keeps.
const CAPACITY: usize = 10_000;

/// A line of the log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogLine {
    /// Time since the engine started, ns.
    pub time_ns: u64,
    pub level: LogLevel,
    /// Part of the program.
    pub source: String,
    pub text: String,
    /// Whether a trial was proposed or judged, or a fault latched.
    pub marker: bool,
}

/// The newest lines, oldest first.
#[derive(Debug, Clone, Default)]
pub struct SessionLog {
    lines: VecDeque<LogLine>,
}

impl SessionLog {
    /// Adds a line in the order of time, behind those of its own time; the oldest one goes when the log is full. Lines of several threads
    /// arrive milliseconds apart.
    pub fn push(&mut self, line: LogLine) {
        if self.lines.len() == CAPACITY {
            self.lines.pop_front();
        }
        let later = self.lines.iter().rev().take_while(|other| other.time_ns > line.time_ns).count();
        self.lines.insert(self.lines.len() - later, line);
    }
}

/// State of the log view.
#[derive(Debug, Clone, Default)]
pub struct LogView {
    /// The selected line, counted back from the newest; 0 follows.
    pub back: usize,
    /// The lowest level shown.
    pub level: Option<LogLevel>,
    /// Text that a shown line contains.
    pub search: String,
}

impl LogView {
    /// Returns the line that a key opens; none in an empty log.
    pub fn selected<'a>(&'a self, log: &'a SessionLog) -> Option<&'a LogLine> {
        self.lines(log).rev().nth(self.back).or_else(|| self.lines(log).next())
    }

    /// Returns the lines that pass the filter, oldest first.
    pub fn lines<'a>(&'a self, log: &'a SessionLog) -> impl DoubleEndedIterator<Item = &'a LogLine> + 'a {
        log.lines.iter().filter(self.filter())
    }

    /// Returns whether a line passes the filter.
    pub fn shows(&self, line: &LogLine) -> bool {
        self.filter()(&line)
    }

    fn filter(&self) -> impl Fn(&&LogLine) -> bool + '_ {
        let search = self.search.to_lowercase();
        move |line| {
            self.level.is_none_or(|level| line.level >= level)
                && (search.is_empty() || line.text.to_lowercase().contains(&search) || line.source.contains(&search))
        }
    }
}

//! Standard output and standard error: the border that every text of a command crosses. Names of files, notes and journals of
//! other programs may hold escape sequences, which would steer the terminal, and characters that turn the direction of what
//! follows: none of them passes.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use quadfrog::printable::is_unprintable;
use ratatui::text::Line;

use crate::wrap::{wrap, wrap_sentence};

/// The first error of standard output; a reader that has closed the pipe is none.
static FAILED: Mutex<Option<io::Error>> = Mutex::new(None);

/// Whether the reader has closed the pipe.
static READER_ENDED: AtomicBool = AtomicBool::new(false);

/// Returns the text with every character that is not printed, but line feed and tab, as `\u001b`, which JSON strings allow, too.
pub fn printable(text: &str) -> Cow<'_, str> {
    let harmless = |c: char| !is_unprintable(c) || c == '\n' || c == '\t';
    if text.chars().all(harmless) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if harmless(c) {
            escaped.push(c);
        } else {
            let _ = write!(escaped, "\\u{:04x}", u32::from(c));
        }
    }
    Cow::Owned(escaped)
}

/// Prints a line on standard output, as [`text`].
pub fn line(line: &str) {
    text(&format!("{line}\n"));
}

/// Prints text on standard output. An error is kept for [`failure`].
pub fn text(text: &str) {
    write(printable(text).as_bytes());
}

/// Prints data, for example a table of trials, unchanged for another program; on a terminal as [`text`].
pub fn data(data: &str) {
    if io::stdout().is_terminal() { text(data) } else { write(data.as_bytes()) }
}

/// Standard output for data that is written in pieces, as [`data`]; errors are returned.
pub struct Data;

impl Write for Data {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut output = io::stdout().lock();
        if output.is_terminal() {
            output.write_all(printable(&String::from_utf8_lossy(bytes)).as_bytes())?;
        } else {
            output.write_all(bytes)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stdout().flush()
    }
}

fn write(bytes: &[u8]) {
    let mut output = io::stdout().lock();
    match output.write_all(bytes).and_then(|()| output.flush()) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => READER_ENDED.store(true, Ordering::Release),
        Err(error) => {
            FAILED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }
}

/// Prints text on standard error.
pub fn message(text: &str) {
    let _ = write!(io::stderr().lock(), "{}", printable(text));
}

/// Prints a line on standard error with the name of the program; on a terminal in lines that end with a word.
pub fn notice(text: &str) {
    let text = format!("quadfrog: {text}");
    match columns(io::stderr().is_terminal()) {
        Some(columns) => message(&format!("{}\n", wrap_sentence(&printable(&text), columns))),
        None => message(&format!("{text}\n")),
    }
}

/// Prints words and a path or a command on standard output: in a line of its own where a terminal has no room for both, so that it
/// begins at the left and can be copied.
pub fn unbroken(words: &str, whole: &str) {
    let both = format!("{words} {whole}");
    match columns(io::stdout().is_terminal()) {
        Some(columns) if both.chars().count() > columns => line(&format!("{}\n    {whole}", words.trim_end())),
        _ => line(&both),
    }
}

/// Prints text on standard output as [`text`]; on a terminal lines that are longer continue at a word, behind `indent` spaces.
pub fn wrapped_text(text: &str, indent: usize) {
    let Some(columns) = columns(io::stdout().is_terminal()) else { return self::text(text) };
    let shown = printable(text);
    let lines = shown.lines().flat_map(|line| wrap(&Line::from(line), columns, indent));
    self::text(&lines.map(|line| format!("{line}\n")).collect::<String>());
}

/// The columns of the terminal; none without one.
fn columns(is_terminal: bool) -> Option<usize> {
    let (columns, _) = crossterm::terminal::size().ok().filter(|_| is_terminal)?;
    Some(usize::from(columns)).filter(|columns| *columns > 0)
}

/// Whether the reader of standard output has closed the pipe, as `head` does when it has read enough. Known after the first write
/// that it missed.
pub fn reader_has_ended() -> bool {
    READER_ENDED.load(Ordering::Acquire)
}

/// Returns the first error of standard output, for example a full disk.
pub fn failure() -> Option<io::Error> {
    FAILED.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Prints a formatted line on standard output, as [`line()`].
#[macro_export]
macro_rules! put_line {
    () => { $crate::output::line("") };
    ($($text:tt)*) => { $crate::output::line(&format!($($text)*)) };
}

/// Prints formatted text on standard output.
#[macro_export]
macro_rules! put {
    ($($text:tt)*) => { $crate::output::text(&format!($($text)*)) };
}

/// Prints a formatted line on standard error with the name of the program, as [`notice`].
#[macro_export]
macro_rules! notice {
    ($($text:tt)*) => { $crate::output::notice(&format!($($text)*)) };
}

//! Restoration of the terminal, once, by whichever thread ends the console.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crossterm::cursor::Show;
use crossterm::event::{DisableBracketedPaste, DisableMouseCapture};
use crossterm::queue;
use crossterm::style::ResetColor;
use crossterm::terminal::{EndSynchronizedUpdate, LeaveAlternateScreen, disable_raw_mode};

use crate::foreground::in_foreground;

/// Time limit of the restoration of a terminal that does not read.
pub const LEAVE_TIMEOUT: Duration = Duration::from_millis(500);

/// Set while the console has the terminal. The thread that clears it restores the terminal.
pub static ENTERED: AtomicBool = AtomicBool::new(false);
/// Held while a whole frame, or the restoration, is written.
pub static OUTPUT: Mutex<()> = Mutex::new(());
/// Bytes that remove the picture that the terminal shows; none without one.
pub static REMOVE_PICTURE: Mutex<Vec<u8>> = Mutex::new(Vec::new());

/// Duplicates standard output, without the lock of the library that a blocked write would hold.
pub fn own_file() -> io::Result<File> {
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

/// Restores screen, cursor and cooked mode, if the terminal was configured. Times out on a terminal that does not read. In the
/// background it does nothing: the terminal is the shell's, and the system would stop this process.
pub fn restore() {
    if !ENTERED.swap(false, Ordering::AcqRel) || !in_foreground() {
        return;
    }
    let (done, finished): (Sender<()>, Receiver<()>) = channel();
    // In a thread, because the write may block for ever.
    let writing = std::thread::Builder::new().name("leave".into()).spawn(move || {
        if let Ok(mut terminal) = own_file() {
            let mut bytes = Vec::new();
            // Writing to memory cannot fail.
            let _ = queue!(bytes, EndSynchronizedUpdate);
            bytes.append(&mut REMOVE_PICTURE.lock().unwrap_or_else(PoisonError::into_inner));
            let _ = queue!(bytes, ResetColor, DisableMouseCapture, DisableBracketedPaste, LeaveAlternateScreen, Show);
            let _output = OUTPUT.lock().unwrap_or_else(PoisonError::into_inner);
            let _ = terminal.write_all(&bytes);
        }
        let _ = done.send(());
    });
    if writing.is_ok() {
        // After a time-out the bytes are written when the terminal reads again.
        let _ = finished.recv_timeout(LEAVE_TIMEOUT);
    }
    let _ = disable_raw_mode();
}

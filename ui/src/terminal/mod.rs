//! The terminal: check, setup, restoration, and output that never blocks the event loop.
//!
//! A thread writes the frames. A terminal that does not read (a stalled SSH connection, a paused pty) then costs frames,
//! but delays neither keys nor STOP nor the operator heartbeat.

mod panics;
mod restore;
mod writer;

use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::channel;
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crossterm::cursor::Hide;
use crossterm::event::{DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture};
use crossterm::queue;
use crossterm::terminal::{Clear, ClearType, EnterAlternateScreen, disable_raw_mode, enable_raw_mode, size};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::Termios;
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::{Frame, Terminal, TerminalOptions, Viewport};

use crate::foreground;
use crate::graphics::EncodedPicture;
use crate::layout::{COMPACT_COLUMNS, COMPACT_ROWS};
pub(crate) use panics::{panicked, stop_on_panic, wait_for_report};
use restore::{ENTERED, LEAVE_TIMEOUT, REMOVE_PICTURE, own_file, restore};
use writer::{FrameWriter, WriteOnlyBackend, WriterState, write_frames};

/// Time-out of each wait for a hang-up.
const HANG_UP_PERIOD_MS: u16 = 200;

/// Question for the colour of the background (XTerm Control Sequences, OSC 11). The answer arrives among the keys.
const ASK_BACKGROUND: &[u8] = b"\x1b]11;?\x1b\\";
/// Question for the primary device attributes (XTerm Control Sequences, DA1). The answer arrives among the keys.
const ASK_ATTRIBUTES: &[u8] = b"\x1b[c";

/// The parts of the terminal's protocol that the console uses.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TerminalProtocol {
    /// Bracketed paste.
    pub pastes: bool,
    /// The question for the background.
    pub asks_background: bool,
    /// The question for the primary device attributes.
    pub asks_attributes: bool,
    /// Synchronized updates. Not over a slow link, where a frame is better seen as it arrives.
    pub synchronized: bool,
}

/// The reason for which the console cannot open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say the rest")]
pub enum TerminalError {
    #[error(
        "the console needs a terminal, but {0} is not one; over SSH use `ssh -t`, for a study without a screen use `quadfrog optimize`"
    )]
    NoTerminal(&'static str),
    #[error("the size of the terminal is unknown; set it with `stty rows {COMPACT_ROWS} columns {COMPACT_COLUMNS}`")]
    NoSize,
    #[error(
        "the terminal has {columns}x{rows} characters, the console needs at least {COMPACT_COLUMNS}x{COMPACT_ROWS}; enlarge it"
    )]
    TooSmall { columns: u16, rows: u16 },
}

/// Checks whether the console can open on this terminal.
///
/// # Errors
/// When there is no terminal, or it is too small. A terminal that shrinks later shows a reduced screen.
pub fn check() -> Result<(), TerminalError> {
    if !io::stdin().is_terminal() {
        return Err(TerminalError::NoTerminal("standard input"));
    }
    if !io::stdout().is_terminal() {
        return Err(TerminalError::NoTerminal("standard output"));
    }
    match size() {
        Ok((0, _) | (_, 0)) | Err(_) => Err(TerminalError::NoSize),
        Ok((columns, rows)) if columns < COMPACT_COLUMNS || rows < COMPACT_ROWS => {
            Err(TerminalError::TooSmall { columns, rows })
        }
        Ok(_) => Ok(()),
    }
}

/// The terminal in use by the console; restored on drop.
pub(crate) struct TerminalScreen {
    terminal: Option<Terminal<WriteOnlyBackend>>,
    state: Arc<WriterState>,
    writer: Option<JoinHandle<()>>,
    /// The picture that the terminal shows.
    picture: Option<Rc<EncodedPicture>>,
    mouse: bool,
    protocol: TerminalProtocol,
    /// The mode of the configured terminal; none where it cannot be read.
    mode: Option<Termios>,
    hung_up: bool,
}

impl TerminalScreen {
    /// Enters raw mode and the alternate screen, and hides the cursor. Bracketed paste is on with `pastes` only: text that
    /// begins with its first mark and never ends would hide the keys behind it. From now on a panic in any thread restores the
    /// terminal before it is reported.
    pub fn enter(protocol: TerminalProtocol) -> io::Result<TerminalScreen> {
        let terminal = own_file()?;
        let state = Arc::new(WriterState::default());
        // Holds at most one frame: the caller checks `ready` before it draws.
        let (frames, received) = channel();
        let for_writer = state.clone();
        let writer = std::thread::Builder::new()
            .name("frame-writer".into())
            .spawn(move || write_frames(&received, &for_writer, terminal))?;
        panics::install_hook();
        let writer_end =
            FrameWriter { frame: Vec::new(), synchronized: protocol.synchronized, frames, state: state.clone() };
        let backend = WriteOnlyBackend(CrosstermBackend::new(writer_end));
        let terminal = Terminal::with_options(backend, TerminalOptions { viewport: Viewport::Fullscreen })?;
        let mut screen = TerminalScreen {
            terminal: Some(terminal),
            state,
            writer: Some(writer),
            picture: None,
            mouse: false,
            protocol,
            mode: None,
            hung_up: false,
        };
        screen.configure()?;
        Ok(screen)
    }

    /// Configures the terminal, also after a suspension; not after a panic, which restores it for good.
    pub fn configure(&mut self) -> io::Result<()> {
        // The library enables the raw mode only where it is not enabled, and does not see that a shell has changed it.
        disable_raw_mode()?;
        enable_raw_mode()?;
        self.mode = foreground::mode();
        ENTERED.store(true, Ordering::Release);
        // After the terminal is marked as configured: of this thread and the one that panics, one at least sees the other.
        if panicked().is_some() {
            restore();
            return Ok(());
        }
        if let Some(terminal) = &mut self.terminal {
            let writer = &mut terminal.backend_mut().0;
            queue!(writer, EnterAlternateScreen, Hide, Clear(ClearType::All))?;
            match self.protocol.pastes {
                true => queue!(writer, EnableBracketedPaste)?,
                // An earlier program may have left it on.
                false => queue!(writer, DisableBracketedPaste)?,
            }
            if self.protocol.asks_background {
                writer.write_all(ASK_BACKGROUND)?;
            }
            if self.protocol.asks_attributes {
                writer.write_all(ASK_ATTRIBUTES)?;
            }
            // The restoration removed it.
            self.picture = None;
            terminal.clear()?;
        }
        Ok(())
    }

    /// Whether another program has changed the terminal's mode: keys then arrive late or not at all. The restoration after a panic
    /// is no change.
    pub fn mode_was_changed(&self) -> bool {
        // In this order: a panic is known before the mode is restored.
        self.mode != foreground::mode() && panicked().is_none()
    }

    /// Restores the terminal for a suspension.
    pub fn release(&mut self) {
        self.wait_until_written();
        restore();
    }

    /// Whether the last frame was written, so that the next one does not queue.
    pub fn ready(&self) -> bool {
        self.state.waiting.load(Ordering::Acquire) == 0
    }

    /// Whether writing to the terminal failed.
    pub fn broken(&self) -> bool {
        self.state.broken.load(Ordering::Acquire)
    }

    /// Draws a frame, and the picture that `render` returns over its cells. A picture that the terminal shows already is not
    /// sent again; another one is removed before the cells are drawn.
    pub fn draw(&mut self, render: impl FnOnce(&mut Frame) -> Option<Rc<EncodedPicture>>) -> io::Result<()> {
        let Some(terminal) = &mut self.terminal else { return Ok(()) };
        let columns_and_rows = |terminal: &mut Terminal<_>| terminal.get_frame().area();
        let before = columns_and_rows(terminal);
        // Clears a screen whose size changed.
        terminal.autoresize()?;
        let resized = columns_and_rows(terminal) != before;
        let picture = render(&mut terminal.get_frame());
        let shown = self.picture.as_ref().filter(|_| !resized);
        let same = shown.zip(picture.as_ref()).is_some_and(|(shown, picture)| Rc::ptr_eq(shown, picture));
        let writer = &mut terminal.backend_mut().0;
        if !same && let Some(shown) = self.picture.take() {
            writer.write_all(&shown.remove)?;
        }
        terminal.flush()?;
        let writer = &mut terminal.backend_mut().0;
        if let Some(picture) = picture.filter(|_| !same) {
            writer.write_all(&picture.show)?;
            self.picture = Some(picture);
        }
        let remove = self.picture.as_ref().map_or_else(Vec::new, |picture| picture.remove.clone());
        *REMOVE_PICTURE.lock().unwrap_or_else(PoisonError::into_inner) = remove;
        terminal.swap_buffers();
        Backend::flush(terminal.backend_mut())
    }

    /// Clears the screen, so that the next frame draws all cells.
    pub fn clear(&mut self) -> io::Result<()> {
        let Some(terminal) = &mut self.terminal else { return Ok(()) };
        if let Some(picture) = self.picture.take() {
            terminal.backend_mut().0.write_all(&picture.remove)?;
        }
        terminal.clear()
    }

    /// Starts or ends the capture of mouse events.
    pub fn mouse(&mut self, on: bool) -> io::Result<()> {
        let Some(terminal) = &mut self.terminal else { return Ok(()) };
        let writer = &mut terminal.backend_mut().0;
        if on {
            queue!(writer, EnableMouseCapture)?;
        } else if self.mouse {
            queue!(writer, DisableMouseCapture)?;
        }
        self.mouse = on;
        Write::flush(writer)
    }

    /// Sends bytes outside a frame: a bell, the clipboard.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(terminal) = &mut self.terminal else { return Ok(()) };
        let writer = &mut terminal.backend_mut().0;
        writer.write_all(bytes)?;
        Write::flush(writer)
    }

    /// Stops all output, including the restoration, to a terminal that hung up.
    pub fn hang_up(&mut self) {
        self.hung_up = true;
        ENTERED.store(false, Ordering::Release);
        self.state.broken.store(true, Ordering::Release);
    }

    /// Waits until the last frame was written, at most [`LEAVE_TIMEOUT`].
    pub fn wait_until_written(&self) {
        let begun = std::time::Instant::now();
        while !self.ready() && !self.hung_up && begun.elapsed() < LEAVE_TIMEOUT {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for TerminalScreen {
    fn drop(&mut self) {
        if !self.hung_up {
            self.wait_until_written();
            restore();
        }
        // Ends the writing thread, unless it is blocked by a terminal that does not read.
        let done = self.ready();
        if let Some(terminal) = self.terminal.take() {
            // Suppresses its own restoration of the cursor, already written by `restore`.
            self.state.broken.store(true, Ordering::Release);
            drop(terminal);
        }
        if done && let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

/// Watches for a hang-up of the terminal in a thread and calls `notify` once. The event loop cannot detect it: without
/// SIGHUP, reading events from a terminal that hung up never returns.
pub(crate) fn watch_for_hang_up(notify: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let terminal = io::stdin().as_fd().try_clone_to_owned()?;
    let watch = move || {
        loop {
            // No requested events: poll(2) then reports only a hang-up or an error.
            let mut descriptors = [PollFd::new(terminal.as_fd(), PollFlags::empty())];
            let found = poll(&mut descriptors, PollTimeout::from(HANG_UP_PERIOD_MS)).unwrap_or(0);
            let gone = PollFlags::POLLHUP | PollFlags::POLLERR | PollFlags::POLLNVAL;
            if found > 0 && descriptors[0].revents().is_some_and(|events| events.intersects(gone)) {
                return notify();
            }
        }
    };
    std::thread::Builder::new().name("hang-up".into()).spawn(watch).map(|_| ())
}

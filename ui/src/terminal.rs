//! The terminal: check, setup, restoration, and output that never blocks the event loop.
//!
//! A thread writes the frames. A terminal that does not read (a stalled SSH connection, a paused pty) then costs frames,
//! but delays neither keys nor STOP nor the operator heartbeat.

use crate::output;
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crossterm::cursor::{Hide, Show};
use crossterm::event::{DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture};
use crossterm::queue;
use crossterm::style::ResetColor;
use crossterm::terminal::{
    Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode,
    enable_raw_mode, size,
};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use quadfrog::realtime::channel::StopLatch;
use ratatui::backend::{self, Backend, CrosstermBackend, WindowSize};
use ratatui::buffer::Cell;
use ratatui::layout::{Position, Size};
use ratatui::{Terminal, TerminalOptions, Viewport};

use crate::cell_encoder::encode;
use crate::layout::{COMPACT_COLUMNS, COMPACT_ROWS};

/// Time limit of the restoration of a terminal that does not read.
const LEAVE_TIMEOUT: Duration = Duration::from_millis(500);
/// Time-out of each wait for a hang-up.
const HANG_UP_PERIOD_MS: u16 = 200;

/// Begin and end of a synchronized update (DEC private mode 2026). A terminal without it ignores both.
const BEGIN_SYNCHRONIZED: &[u8] = b"\x1b[?2026h";
const END_SYNCHRONIZED: &[u8] = b"\x1b[?2026l";
/// Question for the colour of the background (XTerm Control Sequences, OSC 11). The answer arrives among the keys.
const ASK_BACKGROUND: &[u8] = b"\x1b]11;?\x1b\\";

/// The parts of the terminal's protocol that the console uses.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TerminalProtocol {
    /// Bracketed paste.
    pub pastes: bool,
    /// The question for the background.
    pub asks_background: bool,
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

/// State shared by the writing thread and its owner.
#[derive(Default)]
struct WriterState {
    /// Number of frames not written yet.
    waiting: AtomicUsize,
    /// Writing to the terminal failed.
    broken: AtomicBool,
}

/// Collects the bytes of a frame and sends the complete frame to the writing thread.
struct FrameWriter {
    frame: Vec<u8>,
    /// Whether each frame is a synchronized update: the terminal then shows no half of one.
    synchronized: bool,
    frames: Sender<Vec<u8>>,
    state: Arc<WriterState>,
}

impl Write for FrameWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.synchronized && self.frame.is_empty() && !bytes.is_empty() {
            self.frame.extend_from_slice(BEGIN_SYNCHRONIZED);
        }
        self.frame.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    /// Ends the frame.
    fn flush(&mut self) -> io::Result<()> {
        if !self.frame.is_empty() {
            if self.synchronized {
                self.frame.extend_from_slice(END_SYNCHRONIZED);
            }
            self.state.waiting.fetch_add(1, Ordering::AcqRel);
            let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
            self.frames.send(std::mem::take(&mut self.frame)).map_err(gone)?;
        }
        Ok(())
    }
}

/// Writes frames until their sender is dropped.
fn write_frames(frames: &Receiver<Vec<u8>>, state: &WriterState, mut terminal: File) {
    while let Ok(frame) = frames.recv() {
        let _output = OUTPUT.lock().unwrap_or_else(PoisonError::into_inner);
        // A frame drawn while another thread panicked would hide the cursor of a restored terminal.
        let drop_frame = !ENTERED.load(Ordering::Acquire) || state.broken.load(Ordering::Acquire);
        if !drop_frame && terminal.write_all(&frame).is_err() {
            state.broken.store(true, Ordering::Release);
        }
        state.waiting.fetch_sub(1, Ordering::AcqRel);
    }
}

/// A backend that never queries the terminal. ratatui asks for the cursor position whenever it clears; the answer would
/// arrive in the thread that reads keys, and late over a slow link.
struct WriteOnlyBackend(CrosstermBackend<FrameWriter>);

impl Backend for WriteOnlyBackend {
    type Error = io::Error;

    fn draw<'a, I>(&mut self, content: I) -> io::Result<()>
    where
        I: Iterator<Item = (u16, u16, &'a Cell)>,
    {
        let cells: Vec<_> = content.collect();
        self.0.write_all(&encode(&cells))
    }

    /// Does nothing: ratatui hides the cursor after every frame, and it is hidden since the terminal was configured.
    fn hide_cursor(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn show_cursor(&mut self) -> io::Result<()> {
        self.0.show_cursor()
    }

    /// Returns the origin: the cursor is hidden and every write moves it.
    fn get_cursor_position(&mut self) -> io::Result<Position> {
        Ok(Position::ORIGIN)
    }

    fn set_cursor_position<P: Into<Position>>(&mut self, position: P) -> io::Result<()> {
        self.0.set_cursor_position(position)
    }

    fn clear(&mut self) -> io::Result<()> {
        self.0.clear()
    }

    fn clear_region(&mut self, region: backend::ClearType) -> io::Result<()> {
        self.0.clear_region(region)
    }

    fn size(&self) -> io::Result<Size> {
        self.0.size()
    }

    fn window_size(&mut self) -> io::Result<WindowSize> {
        self.0.window_size()
    }

    fn flush(&mut self) -> io::Result<()> {
        Backend::flush(&mut self.0)
    }
}

/// Set while the console has the terminal. The thread that clears it restores the terminal.
static ENTERED: AtomicBool = AtomicBool::new(false);
/// Held while a whole frame, or the restoration, is written.
static OUTPUT: Mutex<()> = Mutex::new(());
/// STOP latch that a panic in any thread sets, before anything else.
static STOP: Mutex<Option<StopLatch>> = Mutex::new(None);
/// Name of the first thread that panicked; the loop then ends instead of leaving a dead screen.
static PANICKED: Mutex<Option<String>> = Mutex::new(None);

/// Name of the engine's control thread.
const CONTROL: &str = "control";

/// Makes a panic in any thread set this latch first; none if there is no robot to stop.
pub(crate) fn stop_on_panic(stop: Option<StopLatch>) {
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = stop;
}

/// The terminal in use by the console; restored on drop.
pub(crate) struct TerminalScreen {
    terminal: Option<Terminal<WriteOnlyBackend>>,
    state: Arc<WriterState>,
    writer: Option<JoinHandle<()>>,
    mouse: bool,
    protocol: TerminalProtocol,
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
        install_panic_hook();
        let writer_end =
            FrameWriter { frame: Vec::new(), synchronized: protocol.synchronized, frames, state: state.clone() };
        let backend = WriteOnlyBackend(CrosstermBackend::new(writer_end));
        let terminal = Terminal::with_options(backend, TerminalOptions { viewport: Viewport::Fullscreen })?;
        let mut screen = TerminalScreen {
            terminal: Some(terminal),
            state,
            writer: Some(writer),
            mouse: false,
            protocol,
            hung_up: false,
        };
        screen.configure()?;
        Ok(screen)
    }

    /// Configures the terminal, also after a suspension.
    pub fn configure(&mut self) -> io::Result<()> {
        enable_raw_mode()?;
        ENTERED.store(true, Ordering::Release);
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
            terminal.clear()?;
        }
        Ok(())
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

    /// Draws a frame.
    pub fn draw(&mut self, render: impl FnOnce(&mut ratatui::Frame)) -> io::Result<()> {
        match &mut self.terminal {
            Some(terminal) => terminal.draw(render).map(|_| ()),
            None => Ok(()),
        }
    }

    /// Clears the screen, so that the next frame draws all cells.
    pub fn clear(&mut self) -> io::Result<()> {
        self.terminal.as_mut().map_or(Ok(()), Terminal::clear)
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

    fn wait_until_written(&self) {
        let begun = std::time::Instant::now();
        while !self.ready() && begun.elapsed() < LEAVE_TIMEOUT {
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

/// Duplicates standard output, without the lock of the library that a blocked write would hold.
fn own_file() -> io::Result<File> {
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

/// Restores screen, cursor and cooked mode, if the terminal was configured. Times out on a terminal that does not read.
fn restore() {
    if !ENTERED.swap(false, Ordering::AcqRel) {
        return;
    }
    let (done, finished): (Sender<()>, Receiver<()>) = channel();
    // In a thread, because the write may block for ever.
    let writing = std::thread::Builder::new().name("leave".into()).spawn(move || {
        if let Ok(mut terminal) = own_file() {
            let mut bytes = Vec::new();
            // Writing to memory cannot fail.
            let _ = queue!(
                bytes,
                EndSynchronizedUpdate,
                ResetColor,
                DisableMouseCapture,
                DisableBracketedPaste,
                LeaveAlternateScreen,
                Show
            );
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

fn install_panic_hook() {
    static INSTALLED: AtomicBool = AtomicBool::new(false);
    if INSTALLED.swap(true, Ordering::AcqRel) {
        return;
    }
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        // First: the report and the unwinding take time, during which the robot would move without control.
        if let Some(stop) = &*STOP.lock().unwrap_or_else(PoisonError::into_inner) {
            stop.set();
        }
        let thread = std::thread::current();
        let name = thread.name().unwrap_or("unnamed").to_owned();
        if name == CONTROL {
            // The control thread goes on to damp the robot and must not wait for the terminal: another thread reports.
            let report = info.to_string();
            let print = move || {
                restore();
                output::message(&format!("{report}\n"));
                PANICKED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(name);
            };
            let _ = std::thread::Builder::new().name("report".into()).spawn(print);
            return;
        }
        restore();
        PANICKED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(name);
        report(info);
    }));
}

/// Returns the name of the first thread that panicked, if any.
pub(crate) fn panicked() -> Option<String> {
    PANICKED.lock().unwrap_or_else(PoisonError::into_inner).clone()
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

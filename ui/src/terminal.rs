//! The terminal: whether it can be used, entering and leaving it, and writing to it without ever waiting for it.
//!
//! Frames are written by a thread of their own. A terminal that does not read (a stalled SSH connection, a paused pty)
//! then costs frames, not the event loop: keys, STOP and the sign of life go on.

use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crossterm::cursor::{Hide, Show};
use crossterm::event::{DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture};
use crossterm::queue;
use crossterm::style::ResetColor;
use crossterm::terminal::{
    Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode, size,
};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use quadfrog::realtime::channel::StopLatch;
use ratatui::backend::{self, Backend, CrosstermBackend, WindowSize};
use ratatui::buffer::Cell;
use ratatui::layout::{Position, Size};
use ratatui::{Terminal, TerminalOptions, Viewport};

use crate::layout::{MIN_COLUMNS, MIN_ROWS};

/// How long leaving waits for a terminal that does not read.
const LEAVE_TIMEOUT: Duration = Duration::from_millis(500);
/// How often the watcher looks for a hang-up when the system does not wake it.
const HANG_UP_PERIOD_MS: u16 = 200;

/// Why the console cannot open here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TerminalError {
    /// Input or output is no terminal.
    #[error(
        "the console needs a terminal, but {0} is none; over SSH use `ssh -t`, for a study without a screen use `quadfrog optimize`"
    )]
    NoTerminal(
        /// Which of the two.
        &'static str,
    ),
    /// The terminal's size cannot be found out.
    #[error("the terminal does not say how large it is; set it with `stty rows {MIN_ROWS} columns {MIN_COLUMNS}`")]
    NoSize,
    /// Too small.
    #[error(
        "the terminal has {columns}x{rows} characters, the console needs at least {MIN_COLUMNS}x{MIN_ROWS}; enlarge it"
    )]
    TooSmall {
        /// Its columns.
        columns: u16,
        /// Its rows.
        rows: u16,
    },
}

/// Whether the console can open on this terminal.
///
/// # Errors
/// When there is no terminal, or it is too small. Shrinking later is not an error: a small screen is drawn then.
pub fn check() -> Result<(), TerminalError> {
    for (name, is_terminal) in
        [("standard input", io::stdin().is_terminal()), ("standard output", io::stdout().is_terminal())]
    {
        if !is_terminal {
            return Err(TerminalError::NoTerminal(name));
        }
    }
    match size() {
        Ok((0, _) | (_, 0)) | Err(_) => Err(TerminalError::NoSize),
        Ok((columns, rows)) if columns < MIN_COLUMNS || rows < MIN_ROWS => {
            Err(TerminalError::TooSmall { columns, rows })
        }
        Ok(_) => Ok(()),
    }
}

/// What the frame writer and its owner share.
#[derive(Default)]
struct Shared {
    /// Pieces of frames on their way to the terminal.
    waiting: AtomicUsize,
    /// The terminal cannot be written to any more.
    broken: AtomicBool,
    /// Bytes written.
    bytes: AtomicU64,
}

/// Takes the bytes of a frame and hands them to the writing thread when the frame is complete.
pub struct FrameWriter {
    frame: Vec<u8>,
    frames: Sender<Vec<u8>>,
    shared: Arc<Shared>,
}

impl Write for FrameWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.frame.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    /// Ends the frame.
    fn flush(&mut self) -> io::Result<()> {
        if !self.frame.is_empty() {
            self.shared.waiting.fetch_add(1, Ordering::AcqRel);
            let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
            self.frames.send(std::mem::take(&mut self.frame)).map_err(gone)?;
        }
        Ok(())
    }
}

/// Writes frames to the terminal until their sender is gone or the terminal fails.
fn write_frames(frames: &Receiver<Vec<u8>>, shared: &Shared, mut terminal: File) {
    while let Ok(frame) = frames.recv() {
        let _pen = PEN.lock().unwrap_or_else(PoisonError::into_inner);
        // A frame that was drawn while another thread panicked would hide the cursor of a terminal that was given back.
        if ENTERED.load(Ordering::Acquire) && !shared.broken.load(Ordering::Acquire) {
            match terminal.write_all(&frame) {
                Ok(()) => {
                    shared.bytes.fetch_add(frame.len() as u64, Ordering::Relaxed);
                }
                Err(_) => shared.broken.store(true, Ordering::Release),
            }
        }
        shared.waiting.fetch_sub(1, Ordering::AcqRel);
    }
}

/// The terminal as something that is written to and never asked. ratatui asks for the cursor's position whenever it
/// clears; the answer would have to come through the thread that reads keys, and over a slow link after a long wait.
struct OneWay(CrosstermBackend<FrameWriter>);

impl Backend for OneWay {
    type Error = io::Error;

    fn draw<'a, I>(&mut self, content: I) -> io::Result<()>
    where
        I: Iterator<Item = (u16, u16, &'a Cell)>,
    {
        self.0.draw(content)
    }

    fn hide_cursor(&mut self) -> io::Result<()> {
        self.0.hide_cursor()
    }

    fn show_cursor(&mut self) -> io::Result<()> {
        self.0.show_cursor()
    }

    /// The cursor is hidden and moved by every write: where it stands means nothing.
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

/// Set while the terminal is ours; whoever clears it gives the terminal back, once.
static ENTERED: AtomicBool = AtomicBool::new(false);
/// Who holds it writes to the terminal: a frame as a whole, or what gives the terminal back.
static PEN: Mutex<()> = Mutex::new(());
/// Set by the first panic: the robot is stopped before anything else is done.
static STOP: Mutex<Option<StopLatch>> = Mutex::new(None);

/// The engine's thread that speaks to the robot.
const CONTROL: &str = "control";

/// From now on a panic in any thread sets this latch first; none where there is nothing to stop.
pub fn stop_on_panic(stop: Option<StopLatch>) {
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = stop;
}

/// What panicked, for the loop to see; a thread's panic must not leave a dead screen.
static PANICKED: Mutex<Option<String>> = Mutex::new(None);

/// The terminal while the console has it. Dropping it gives it back.
pub struct Screen {
    terminal: Option<Terminal<OneWay>>,
    shared: Arc<Shared>,
    writer: Option<JoinHandle<()>>,
    mouse: bool,
    hung_up: bool,
}

impl Screen {
    /// Enters: raw mode, the alternate screen, no cursor. From here on panics of any thread give the terminal back
    /// before they are reported.
    ///
    /// # Errors
    /// When the terminal refuses.
    pub fn enter() -> io::Result<Screen> {
        let terminal = own_file()?;
        let shared = Arc::new(Shared::default());
        // `ready` is asked before a frame is drawn, so no more than one frame is ever in the channel.
        let (frames, received) = channel();
        let for_writer = shared.clone();
        let writer = std::thread::Builder::new()
            .name("screen".into())
            .spawn(move || write_frames(&received, &for_writer, terminal))?;
        install_panic_hook();
        let writer_end = FrameWriter { frame: Vec::new(), frames, shared: shared.clone() };
        let backend = OneWay(CrosstermBackend::new(writer_end));
        let terminal = Terminal::with_options(backend, TerminalOptions { viewport: Viewport::Fullscreen })?;
        let mut screen =
            Screen { terminal: Some(terminal), shared, writer: Some(writer), mouse: false, hung_up: false };
        screen.take()?;
        Ok(screen)
    }

    /// Takes the terminal (again, after a suspension).
    ///
    /// # Errors
    /// When the terminal refuses.
    pub fn take(&mut self) -> io::Result<()> {
        enable_raw_mode()?;
        ENTERED.store(true, Ordering::Release);
        if let Some(terminal) = &mut self.terminal {
            let writer = &mut terminal.backend_mut().0;
            queue!(writer, EnterAlternateScreen, EnableBracketedPaste, Hide, Clear(ClearType::All))?;
            terminal.clear()?;
        }
        Ok(())
    }

    /// Gives the terminal back for a while.
    pub fn release(&mut self) {
        self.wait_until_written();
        give_back();
    }

    /// Whether the last frame is written, so that another can be drawn without waiting.
    pub fn ready(&self) -> bool {
        self.shared.waiting.load(Ordering::Acquire) == 0
    }

    /// Whether writing to the terminal failed.
    pub fn broken(&self) -> bool {
        self.shared.broken.load(Ordering::Acquire)
    }

    /// Bytes written so far.
    pub fn bytes_written(&self) -> u64 {
        self.shared.bytes.load(Ordering::Relaxed)
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// When the terminal's size cannot be found out or the writing thread is gone.
    pub fn draw(&mut self, render: impl FnOnce(&mut ratatui::Frame)) -> io::Result<()> {
        match &mut self.terminal {
            Some(terminal) => terminal.draw(render).map(|_| ()),
            None => Ok(()),
        }
    }

    /// Forgets what is on the screen, so that the next frame draws all of it.
    ///
    /// # Errors
    /// When the writing thread is gone.
    pub fn clear(&mut self) -> io::Result<()> {
        self.terminal.as_mut().map_or(Ok(()), Terminal::clear)
    }

    /// Asks the terminal for the mouse's clicks, or leaves them to it.
    ///
    /// # Errors
    /// When the writing thread is gone.
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

    /// Sends bytes that are not part of a frame: a bell, the clipboard.
    ///
    /// # Errors
    /// When the writing thread is gone.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(terminal) = &mut self.terminal else { return Ok(()) };
        let writer = &mut terminal.backend_mut().0;
        writer.write_all(bytes)?;
        Write::flush(writer)
    }

    /// The terminal is gone: nothing more is written to it, not even what would restore it.
    pub fn hang_up(&mut self) {
        self.hung_up = true;
        ENTERED.store(false, Ordering::Release);
        self.shared.broken.store(true, Ordering::Release);
    }

    fn wait_until_written(&self) {
        let begun = std::time::Instant::now();
        while !self.ready() && begun.elapsed() < LEAVE_TIMEOUT {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if !self.hung_up {
            self.wait_until_written();
            give_back();
        }
        // Ends the writing thread, unless a terminal that does not read holds it: then it ends with the program.
        let done = self.ready();
        if let Some(terminal) = self.terminal.take() {
            // Its own goodbye (showing the cursor) was said by `give_back`.
            self.shared.broken.store(true, Ordering::Release);
            drop(terminal);
        }
        if done && let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

/// The terminal as a file of its own: no lock that a thread stuck in writing could hold.
fn own_file() -> io::Result<File> {
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

/// Gives the terminal back if it was taken: the screen as before, the cursor, cooked mode. Gives up on a terminal that
/// does not read.
fn give_back() {
    if !ENTERED.swap(false, Ordering::AcqRel) {
        return;
    }
    let (done, finished): (Sender<()>, Receiver<()>) = channel();
    // Writing may wait for ever; leaving must not.
    let writing = std::thread::Builder::new().name("leave".into()).spawn(move || {
        if let Ok(mut terminal) = own_file() {
            let mut bytes = Vec::new();
            // Writing to memory does not fail.
            let _ = queue!(bytes, ResetColor, DisableMouseCapture, DisableBracketedPaste, LeaveAlternateScreen, Show);
            let _pen = PEN.lock().unwrap_or_else(PoisonError::into_inner);
            let _ = terminal.write_all(&bytes);
        }
        let _ = done.send(());
    });
    if writing.is_ok() {
        // After a time-out the bytes may still come out later, when somebody reads again.
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
        // Before anything that takes time: what unwinds next sits a robot down that nobody controls.
        if let Some(stop) = &*STOP.lock().unwrap_or_else(PoisonError::into_inner) {
            stop.set();
        }
        let thread = std::thread::current();
        let name = thread.name().unwrap_or("unnamed").to_owned();
        if name == CONTROL {
            // It must damp the robot now and cannot wait for a terminal; the report without its colours is for another.
            let report = info.to_string();
            let tell = move || {
                give_back();
                eprintln!("{report}");
                PANICKED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(name);
            };
            let _ = std::thread::Builder::new().name("report".into()).spawn(tell);
            return;
        }
        give_back();
        PANICKED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(name);
        report(info);
    }));
}

/// The name of the thread that panicked, if any did since the console was entered.
pub fn panicked() -> Option<String> {
    PANICKED.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Watches for the terminal's hang-up in a thread of its own and calls `notify` once. The event loop cannot be trusted
/// with it: without SIGHUP, reading events from a terminal that has hung up never returns.
///
/// # Errors
/// When the thread cannot be started.
pub fn watch_for_hang_up(notify: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let terminal = io::stdin().as_fd().try_clone_to_owned()?;
    let watch = move || {
        loop {
            // No events asked for: only a hang-up or an error is reported.
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

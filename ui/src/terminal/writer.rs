//! Output of frames in a thread of its own.

use std::fs::File;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, PoisonError};

use ratatui::backend::{self, Backend, CrosstermBackend, WindowSize};
use ratatui::buffer::Cell;
use ratatui::layout::{Position, Size};

use super::restore::{ENTERED, OUTPUT};
use crate::cell_encoder::encode;

/// Begin and end of a synchronized update (DEC private mode 2026). A terminal without it ignores both.
const BEGIN_SYNCHRONIZED: &[u8] = b"\x1b[?2026h";
const END_SYNCHRONIZED: &[u8] = b"\x1b[?2026l";

/// State shared by the writing thread and its owner.
#[derive(Default)]
pub struct WriterState {
    /// Number of frames not written yet.
    pub waiting: AtomicUsize,
    /// Writing to the terminal failed.
    pub broken: AtomicBool,
}

/// Collects the bytes of a frame and sends the complete frame to the writing thread.
pub struct FrameWriter {
    pub frame: Vec<u8>,
    /// Whether each frame is a synchronized update: the terminal then shows no half of one.
    pub synchronized: bool,
    pub frames: Sender<Vec<u8>>,
    pub state: Arc<WriterState>,
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
pub fn write_frames(frames: &Receiver<Vec<u8>>, state: &WriterState, mut terminal: File) {
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
pub struct WriteOnlyBackend(pub CrosstermBackend<FrameWriter>);

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

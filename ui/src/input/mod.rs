//! The thread that reads the terminal. It sets the STOP latch by itself, before the event loop sees the key.

mod decoder;

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crossterm::event::KeyCode;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::unistd::read;
use quadfrog::realtime::channel::StopLatch;
use tokio::sync::mpsc::UnboundedSender;

pub use decoder::{Decoder, TerminalEvent};

use crate::foreground::in_foreground;
use crate::keymap::Key;

/// Period in which a console in the background looks whether it has its terminal again.
const BACKGROUND_PERIOD: Duration = Duration::from_millis(50);
/// Wait for the rest of a sequence after a lone ESC. A terminal sends a sequence at once; a person is slower.
const ESCAPE_WAIT: Duration = Duration::from_millis(20);
/// Wait for the rest of any other sequence.
const SEQUENCE_WAIT: Duration = Duration::from_millis(500);
/// Wait for the rest of a paste.
const PASTE_WAIT: Duration = Duration::from_secs(1);

/// Whether the space bar types, as the event loop reports it to the thread that reads the terminal.
///
/// The report counts for the keys up to one number: once the thread has read a further key that may close the text field,
/// `Space` is STOP until the next report.
#[derive(Debug, Clone, Default)]
pub struct SpaceBarIsText(Arc<AtomicU64>);

impl SpaceBarIsText {
    /// Reports whether a text field takes spaces once `keys` keys have been processed.
    pub fn report(&self, keys: u64, types: bool) {
        self.0.store(keys << 1 | u64::from(types), Ordering::Release);
    }

    fn holds(&self, keys: u64) -> bool {
        self.0.load(Ordering::Acquire) == keys << 1 | 1
    }
}

/// An event with the number of keys so far that may open or close a text field.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(missing_docs, reason = "the type says the rest")]
pub struct NumberedEvent {
    pub event: TerminalEvent,
    pub keys: u64,
}

/// Decoder and STOP keys of a terminal.
#[derive(Debug)]
pub struct KeyReader {
    decoder: Decoder,
    /// None without a robot.
    stop: Option<StopLatch>,
    space_bar_is_text: SpaceBarIsText,
    keys: u64,
    decoded: Vec<TerminalEvent>,
}

impl KeyReader {
    /// A reader whose STOP keys set `stop`, `Space` unless `space_bar_is_text` says otherwise. `pastes` as in [`Decoder::new`].
    pub fn new(pastes: bool, stop: Option<StopLatch>, space_bar_is_text: SpaceBarIsText) -> KeyReader {
        KeyReader { decoder: Decoder::new(pastes), stop, space_bar_is_text, keys: 0, decoded: Vec::new() }
    }

    /// Takes bytes of the terminal; calls `forward` with each input, after its STOP.
    pub fn take(&mut self, bytes: &[u8], mut forward: impl FnMut(NumberedEvent)) {
        for byte in bytes {
            self.decoder.take(*byte, &mut self.decoded);
            self.forward(&mut forward);
        }
    }

    /// Records that no byte came for [`KeyReader::wait`].
    pub fn idle(&mut self, mut forward: impl FnMut(NumberedEvent)) {
        self.decoder.idle(&mut self.decoded);
        self.forward(&mut forward);
    }

    /// Longest wait for the next byte; none while no input is unfinished.
    pub fn wait(&self) -> Option<Duration> {
        match &self.decoder {
            decoder if decoder.escaped() => Some(ESCAPE_WAIT),
            decoder if decoder.pasting() => Some(PASTE_WAIT),
            decoder if decoder.pending() => Some(SEQUENCE_WAIT),
            _ => None,
        }
    }

    fn forward(&mut self, forward: &mut impl FnMut(NumberedEvent)) {
        for input in self.decoded.drain(..) {
            if let TerminalEvent::Key(key) = input {
                let types = key.is(KeyCode::Char(' ')) && self.space_bar_is_text.holds(self.keys);
                if let Some(stop) = &self.stop
                    && key.stops()
                    && !types
                {
                    stop.set();
                }
                if !edits(key) {
                    self.keys += 1;
                }
            }
            forward(NumberedEvent { event: input, keys: self.keys });
        }
    }
}

/// Whether the key leaves a text field open. Every other key may close it.
fn edits(key: Key) -> bool {
    let moves = [KeyCode::Backspace, KeyCode::Delete, KeyCode::Left, KeyCode::Right, KeyCode::Home, KeyCode::End];
    key.typed().is_some() || moves.contains(&key.code())
}

/// Event of the terminal; none when it hung up.
pub type ReadEvent = Option<NumberedEvent>;

/// Reads the terminal in a thread, which sets the STOP latch by itself, even if the event loop hangs.
///
/// # Errors
/// The system grants no descriptor or no thread.
pub fn read_in_thread(inputs: UnboundedSender<ReadEvent>, reader: KeyReader) -> io::Result<()> {
    let terminal = io::stdin().as_fd().try_clone_to_owned()?;
    let read = move || {
        // Either way the terminal cannot be read any more.
        let _ = read_terminal(&terminal, reader, |input| inputs.send(Some(input)).is_ok());
        let _ = inputs.send(None);
    };
    std::thread::Builder::new().name("keys".into()).spawn(read).map(|_| ())
}

/// Reads `terminal` until it hangs up or `forward` returns false.
///
/// # Errors
/// When the terminal cannot be read any more.
pub fn read_terminal(
    terminal: &OwnedFd,
    mut reader: KeyReader,
    mut forward: impl FnMut(NumberedEvent) -> bool,
) -> io::Result<()> {
    let mut bytes = [0; 1024];
    let mut open = true;
    while open {
        let wait = match reader.wait() {
            Some(wait) => PollTimeout::try_from(wait).unwrap_or(PollTimeout::MAX),
            None => PollTimeout::NONE,
        };
        let mut descriptors = [PollFd::new(terminal.as_fd(), PollFlags::POLLIN)];
        let mut send = |input| open &= forward(input);
        match poll(&mut descriptors, wait) {
            Ok(0) => reader.idle(&mut send),
            Ok(_) if !in_foreground() => std::thread::sleep(BACKGROUND_PERIOD),
            Ok(_) => match read(terminal, &mut bytes) {
                Ok(0) => return Ok(()),
                Ok(length) => reader.take(&bytes[..length], &mut send),
                Err(Errno::EINTR | Errno::EAGAIN) => {}
                Err(error) => return Err(error.into()),
            },
            Err(Errno::EINTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

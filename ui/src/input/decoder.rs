//! Bytes of the terminal as keys, pasted text and mouse input.
//!
//! A STOP key is reported with its last byte in every state: after an Esc, inside an unfinished sequence and inside a
//! begun paste. `Space` (0x20), `Ctrl-C` (0x03) and `Ctrl-Space` (0x00) are one byte, which occurs in no sequence that
//! this program requests from a terminal; the sequence of `F12` is searched for in the raw bytes. In a begun paste `Space`
//! is text, the others stop.
//! Sequences: ECMA-48, 5.4; XTerm Control Sequences ("PC-Style Function Keys", "Mouse Tracking").

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::keymap::Key;
use crate::message::Mouse;
use crate::theme::Background;

/// One input of the terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum TerminalEvent {
    Key(Key),
    Paste(String),
    Mouse(Mouse),
    /// The answer to the question for the background, OSC 11.
    Background(Background),
    /// The answer to the question for the primary device attributes: whether the terminal shows sixel.
    Sixel(bool),
}

/// Longest control sequence, bytes; a longer one is dropped.
const LONGEST_SEQUENCE: usize = 64;
/// Final bytes of a paste.
const PASTE_END: &[u8] = b"\x1b[201~";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Between inputs.
    Ground,
    /// Inside a character of several bytes.
    Character,
    /// After ESC.
    Escape,
    /// After ESC O.
    Function,
    /// After ESC [.
    Control,
    /// After ESC [ [, the function keys of the Linux console.
    LinuxFunction,
    /// Inside a mouse report of the old form, with the number of bytes left.
    OldMouse(u8),
    Paste,
    /// After ESC ]: the answer to a question about a colour.
    Report,
    /// After ESC in such an answer.
    ReportEnd,
}

/// Decoder of the terminal's bytes.
#[derive(Debug)]
pub struct Decoder {
    state: State,
    /// Bytes of the unfinished character, sequence or paste.
    bytes: Vec<u8>,
    /// ESC preceded the unfinished character.
    alt: bool,
    /// Raw bytes since the last ESC, whatever was made of them; empty without one.
    since_escape: Vec<u8>,
    /// Whether bracketed paste is on.
    pastes: bool,
}

impl Decoder {
    /// A decoder between inputs. Without `pastes` the marks of a bracketed paste are ignored and its text is keys.
    pub fn new(pastes: bool) -> Decoder {
        Decoder { state: State::Ground, bytes: Vec::new(), alt: false, since_escape: Vec::new(), pastes }
    }

    /// Whether a further byte may belong to the present input.
    pub fn pending(&self) -> bool {
        self.state != State::Ground
    }

    /// Whether the last byte was a lone ESC.
    pub fn escaped(&self) -> bool {
        self.state == State::Escape
    }

    /// Whether a paste has begun and not ended.
    pub fn pasting(&self) -> bool {
        self.state == State::Paste
    }

    /// Takes one byte; appends the inputs that it completes.
    pub fn take(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        if let Some(key) = self.stop_in_sequence(byte).or_else(|| self.stop_in_byte(byte)) {
            self.reset();
            inputs.push(TerminalEvent::Key(key));
            return;
        }
        self.dispatch(byte, inputs);
    }

    /// Takes a byte that is no STOP key.
    fn dispatch(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        match self.state {
            State::Report if byte == 0x1b && !self.bytes.is_empty() => self.state = State::ReportEnd,
            State::Paste => self.paste(byte, inputs),
            // A new sequence ends an unfinished one; two in a row are the key Esc and a sequence.
            _ if byte == 0x1b => {
                if self.state == State::Escape {
                    inputs.push(TerminalEvent::Key(named(KeyCode::Esc)));
                }
                self.enter(State::Escape);
            }
            State::Ground => self.ground(byte, inputs),
            State::Character => self.character(byte, inputs),
            State::Escape => match byte {
                b'[' => self.enter(State::Control),
                b'O' => self.enter(State::Function),
                b']' => self.enter(State::Report),
                _ => {
                    self.reset();
                    self.alt = true;
                    self.ground(byte, inputs);
                }
            },
            State::Function => {
                self.reset();
                inputs.extend(letter(byte).map(|code| TerminalEvent::Key(named(code))));
            }
            State::LinuxFunction => {
                self.reset();
                if let b'A'..=b'E' = byte {
                    inputs.push(TerminalEvent::Key(named(KeyCode::F(byte - b'A' + 1))));
                }
            }
            State::OldMouse(left) if left > 1 => self.state = State::OldMouse(left - 1),
            State::OldMouse(_) => self.reset(),
            State::Control => self.control(byte, inputs),
            State::Report => self.report(byte, inputs),
            State::ReportEnd if byte == b'\\' => self.finish_report(inputs),
            State::ReportEnd => {
                self.enter(State::Escape);
                self.dispatch(byte, inputs);
            }
        }
    }

    /// Records that no byte has followed for a while: a lone ESC is the key Esc.
    pub fn idle(&mut self, inputs: &mut Vec<TerminalEvent>) {
        match self.state {
            State::Escape => inputs.push(TerminalEvent::Key(named(KeyCode::Esc))),
            State::Control if self.bytes.is_empty() => inputs.push(TerminalEvent::Key(alt('['))),
            State::Function => inputs.push(TerminalEvent::Key(alt('O'))),
            State::Report if self.bytes.is_empty() => inputs.push(TerminalEvent::Key(alt(']'))),
            State::ReportEnd => inputs.push(TerminalEvent::Key(named(KeyCode::Esc))),
            State::Paste => inputs.push(TerminalEvent::Paste(String::from_utf8_lossy(&self.bytes).into_owned())),
            _ => {}
        }
        self.enter(State::Ground);
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.bytes.clear();
        self.alt = false;
    }

    fn reset(&mut self) {
        self.enter(State::Ground);
    }

    /// Returns the STOP key whose sequence this byte ends. The raw bytes are compared, so that neither a pause inside the
    /// sequence nor the decoder's state can hide it.
    fn stop_in_sequence(&mut self, byte: u8) -> Option<Key> {
        if byte == 0x1b {
            self.since_escape.clear();
        } else if self.since_escape.is_empty() || self.since_escape.len() > LONGEST_SEQUENCE {
            self.since_escape.clear();
            return None;
        }
        self.since_escape.push(byte);
        let [0x1b, b'[', parameters @ .., end] = &self.since_escape[..] else { return None };
        match sequence(parameters, *end)? {
            TerminalEvent::Key(key) if key.stops() => {
                self.since_escape.clear();
                Some(key)
            }
            _ => None,
        }
    }

    /// Returns the STOP key that this byte is. Inside a sequence it is no text.
    fn stop_in_byte(&self, byte: u8) -> Option<Key> {
        let modifiers = match self.state {
            State::Ground | State::Character => KeyModifiers::NONE,
            _ => KeyModifiers::ALT,
        };
        match byte {
            0x03 => Some(key(KeyCode::Char('c'), KeyModifiers::CONTROL | modifiers)),
            0x00 => Some(key(KeyCode::Char(' '), KeyModifiers::CONTROL | modifiers)),
            b' ' if self.state != State::Paste => Some(key(KeyCode::Char(' '), modifiers)),
            _ => None,
        }
    }

    fn ground(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        let modifiers = if self.alt { KeyModifiers::ALT } else { KeyModifiers::NONE };
        let code = match byte {
            b'\r' => KeyCode::Enter,
            b'\t' => KeyCode::Tab,
            0x7f => KeyCode::Backspace,
            0x01..=0x1a => {
                let letter = char::from(byte - 1 + b'a');
                self.reset();
                inputs.push(TerminalEvent::Key(key(KeyCode::Char(letter), KeyModifiers::CONTROL | modifiers)));
                return;
            }
            0x1b..=0x1f => {
                let digit = char::from(byte - 0x1b + b'3');
                self.reset();
                inputs.push(TerminalEvent::Key(key(KeyCode::Char(digit), KeyModifiers::CONTROL | modifiers)));
                return;
            }
            0xc2..=0xf4 => {
                self.state = State::Character;
                self.bytes.push(byte);
                return;
            }
            // Not the first byte of a character.
            0x80.. => return self.reset(),
            _ => KeyCode::Char(char::from(byte)),
        };
        self.reset();
        inputs.push(TerminalEvent::Key(key(code, modifiers)));
    }

    fn character(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        if !(0x80..0xc0).contains(&byte) {
            // The character is incomplete: it is dropped, the byte is not.
            self.reset();
            return self.ground(byte, inputs);
        }
        self.bytes.push(byte);
        let length = match self.bytes[0] {
            0xc2..=0xdf => 2,
            0xe0..=0xef => 3,
            _ => 4,
        };
        if self.bytes.len() < length {
            return;
        }
        let modifiers = if self.alt { KeyModifiers::ALT } else { KeyModifiers::NONE };
        let typed = std::str::from_utf8(&self.bytes).ok().and_then(|text| text.chars().next());
        self.reset();
        inputs.extend(typed.map(|c| TerminalEvent::Key(key(KeyCode::Char(c), modifiers))));
    }

    fn control(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        match byte {
            b'[' if self.bytes.is_empty() => self.enter(State::LinuxFunction),
            b'M' if self.bytes.is_empty() => self.enter(State::OldMouse(3)),
            0x40..=0x7e => {
                let parameters = std::mem::take(&mut self.bytes);
                self.reset();
                if self.pastes && (&parameters[..], byte) == (b"200", b'~') {
                    self.enter(State::Paste);
                } else {
                    inputs.extend(sequence(&parameters, byte));
                }
            }
            0x21..=0x3f if self.bytes.len() < LONGEST_SEQUENCE => self.bytes.push(byte),
            _ => {
                self.reset();
                self.ground(byte, inputs);
            }
        }
    }

    /// Collects an answer to OSC. It begins with a number; another byte is a key after Alt-].
    fn report(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        match byte {
            _ if self.bytes.is_empty() && !byte.is_ascii_digit() => {
                inputs.push(TerminalEvent::Key(alt(']')));
                self.reset();
                self.dispatch(byte, inputs);
            }
            0x07 => self.finish_report(inputs),
            0x21..=0x7e if self.bytes.len() < LONGEST_SEQUENCE => self.bytes.push(byte),
            _ => {
                self.reset();
                self.ground(byte, inputs);
            }
        }
    }

    fn finish_report(&mut self, inputs: &mut Vec<TerminalEvent>) {
        inputs.extend(background(&self.bytes).map(TerminalEvent::Background));
        self.reset();
    }

    fn paste(&mut self, byte: u8, inputs: &mut Vec<TerminalEvent>) {
        self.bytes.push(byte);
        if let Some(text) = self.bytes.strip_suffix(PASTE_END) {
            inputs.push(TerminalEvent::Paste(String::from_utf8_lossy(text).into_owned()));
            self.reset();
        }
    }
}

fn key(code: KeyCode, modifiers: KeyModifiers) -> Key {
    Key::from_event(KeyEvent::new(code, modifiers))
}

fn named(code: KeyCode) -> Key {
    key(code, KeyModifiers::NONE)
}

fn alt(c: char) -> Key {
    key(KeyCode::Char(c), KeyModifiers::ALT)
}

/// The key of a final letter.
fn letter(end: u8) -> Option<KeyCode> {
    Some(match end {
        b'A' => KeyCode::Up,
        b'B' => KeyCode::Down,
        b'C' => KeyCode::Right,
        b'D' => KeyCode::Left,
        b'H' => KeyCode::Home,
        b'F' => KeyCode::End,
        b'Z' => KeyCode::BackTab,
        b'P'..=b'S' => KeyCode::F(end - b'P' + 1),
        _ => return None,
    })
}

/// The key of a number before `~`.
fn numbered(number: u32) -> Option<KeyCode> {
    Some(match number {
        1 | 7 => KeyCode::Home,
        2 => KeyCode::Insert,
        3 => KeyCode::Delete,
        4 | 8 => KeyCode::End,
        5 => KeyCode::PageUp,
        6 => KeyCode::PageDown,
        11..=15 => KeyCode::F(number as u8 - 10),
        17..=21 => KeyCode::F(number as u8 - 11),
        23..=26 => KeyCode::F(number as u8 - 12),
        _ => return None,
    })
}

/// The key of a code point.
fn code_point(number: u32) -> Option<KeyCode> {
    Some(match number {
        9 => KeyCode::Tab,
        13 => KeyCode::Enter,
        27 => KeyCode::Esc,
        127 => KeyCode::Backspace,
        _ => KeyCode::Char(char::from_u32(number).filter(|c| !c.is_control())?),
    })
}

/// Modifiers as a terminal encodes them: 1 and a bit each.
fn modifiers(number: u32) -> KeyModifiers {
    let bits = number.saturating_sub(1);
    let bit = |bit, modifier| if bits & bit == 0 { KeyModifiers::NONE } else { modifier };
    bit(1, KeyModifiers::SHIFT) | bit(2, KeyModifiers::ALT) | bit(4, KeyModifiers::CONTROL)
}

/// The input of a control sequence, by its parameters and final byte; none if it is not known, or the release of a key.
fn sequence(parameters: &[u8], end: u8) -> Option<TerminalEvent> {
    let text = std::str::from_utf8(parameters).ok()?;
    if let Some(report) = text.strip_prefix('<') {
        return mouse(report, end).map(TerminalEvent::Mouse);
    }
    if let Some(attributes) = text.strip_prefix('?').filter(|_| end == b'c') {
        return Some(TerminalEvent::Sixel(reports_sixel(attributes)));
    }
    // Sub-parameters follow a colon: of the modifiers the kind of the event.
    let mut fields = text.split(';').map(|field| field.split(':').map(|part| part.parse::<u32>().ok()));
    let mut field = || fields.next().map(|mut parts| (parts.next().flatten(), parts.next().flatten()));
    let (first, second, third) = (field(), field(), field());
    let value = |field: Option<(Option<u32>, Option<u32>)>| field.and_then(|(value, _)| value);
    const RELEASE: u32 = 3;
    if second.is_some_and(|(_, kind)| kind == Some(RELEASE)) {
        return None;
    }
    let (number, held) = (value(first), modifiers(value(second).unwrap_or(1)));
    let (code, held) = match end {
        // xterm's modifyOtherKeys.
        b'~' if number == Some(27) => (code_point(value(third)?)?, held),
        b'~' => (numbered(number?)?, held),
        // rxvt's Shift, Ctrl, and both.
        b'$' => (numbered(number?)?, KeyModifiers::SHIFT),
        b'^' => (numbered(number?)?, KeyModifiers::CONTROL),
        b'@' => (numbered(number?)?, KeyModifiers::SHIFT | KeyModifiers::CONTROL),
        b'u' => (code_point(number?)?, held),
        // Alone it is a function key, with two numbers the position of the cursor.
        b'R' if number.is_some_and(|number| number > 1) => return None,
        _ => (letter(end)?, held),
    };
    Some(TerminalEvent::Key(key(code, held)))
}

/// The background of an answer `11;rgb:R/G/B` or `11;rgba:R/G/B/A`, with 1 to 4 hexadecimal digits for each part (XParseColor).
fn background(report: &[u8]) -> Option<Background> {
    let text = std::str::from_utf8(report).ok()?.strip_prefix("11;")?;
    let parts = text.strip_prefix("rgb:").or_else(|| text.strip_prefix("rgba:"))?;
    let mut rgb = [0.0; 3];
    let mut digits = parts.split('/');
    for part in &mut rgb {
        let digits = digits.next().filter(|digits| (1..=4).contains(&digits.len()))?;
        let full_scale = f64::from(16_u32.pow(digits.len() as u32) - 1);
        *part = f64::from(u32::from_str_radix(digits, 16).ok()?) / full_scale;
    }
    Some(Background::of_rgb(rgb))
}

/// Whether primary device attributes (XTerm Control Sequences, DA1) name sixel: `62;4;22`, after the class of the terminal.
fn reports_sixel(attributes: &str) -> bool {
    attributes.split(';').skip(1).any(|attribute| attribute == "4")
}

/// A mouse report of the form `button;column;row`. Moves, releases and other buttons are ignored.
fn mouse(report: &str, end: u8) -> Option<Mouse> {
    let mut numbers = report.split(';').map(|number| number.parse::<u16>().ok());
    let (button, column, row) = (numbers.next()??, numbers.next()??, numbers.next()??);
    // Bits 4, 8 and 16 are Shift, Alt and Ctrl.
    match (button & !0b1_1100, end) {
        (0, b'M') => Some(Mouse::Click { column: column.checked_sub(1)?, row: row.checked_sub(1)? }),
        (64, b'M') => Some(Mouse::WheelUp),
        (65, b'M') => Some(Mouse::WheelDown),
        _ => None,
    }
}

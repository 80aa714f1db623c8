//! Keys and their actions: the active keymap, made of the actions' default keys and the operator's own choices.

use std::fmt;
use std::str::FromStr;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::action::{ACTIONS, Action};

/// A key: a character as typed (`A` is shift and a), or a named key, with Ctrl or Alt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key {
    code: KeyCode,
    modifiers: KeyModifiers,
}

/// The named keys; the first name of a code is the one shown.
const NAMES: [(&str, KeyCode); 19] = [
    ("Space", KeyCode::Char(' ')),
    ("Enter", KeyCode::Enter),
    ("Esc", KeyCode::Esc),
    ("Tab", KeyCode::Tab),
    ("Shift-Tab", KeyCode::BackTab),
    ("Backspace", KeyCode::Backspace),
    ("Del", KeyCode::Delete),
    ("Ins", KeyCode::Insert),
    ("Up", KeyCode::Up),
    ("Down", KeyCode::Down),
    ("Left", KeyCode::Left),
    ("Right", KeyCode::Right),
    ("Home", KeyCode::Home),
    ("End", KeyCode::End),
    ("PgUp", KeyCode::PageUp),
    ("PgDn", KeyCode::PageDown),
    ("PageUp", KeyCode::PageUp),
    ("PageDown", KeyCode::PageDown),
    ("Delete", KeyCode::Delete),
];

impl Key {
    /// The key of a terminal's event. Shift is dropped where the character already implies it, and for named keys where
    /// terminals disagree about reporting it.
    pub fn from_event(event: KeyEvent) -> Key {
        let shifted = event.modifiers.contains(KeyModifiers::SHIFT);
        let modifiers = event.modifiers & (KeyModifiers::CONTROL | KeyModifiers::ALT);
        let code = match event.code {
            KeyCode::Char(c) if modifiers.contains(KeyModifiers::CONTROL) => KeyCode::Char(c.to_ascii_lowercase()),
            KeyCode::Char(c) if shifted => KeyCode::Char(c.to_ascii_uppercase()),
            KeyCode::Tab if shifted => KeyCode::BackTab,
            code => code,
        };
        Key { code, modifiers }
    }

    /// The character that the key types into a text field; none for named keys and chords.
    pub fn typed(self) -> Option<char> {
        match self.code {
            KeyCode::Char(c) if self.modifiers.is_empty() => Some(c),
            _ => None,
        }
    }

    /// Whether the key stops the robot: Space, F12 and Ctrl-C, with any further modifier.
    pub fn stops(self) -> bool {
        match self.code {
            KeyCode::Char(' ') | KeyCode::F(12) => true,
            KeyCode::Char('c') => self.modifiers.contains(KeyModifiers::CONTROL),
            _ => false,
        }
    }

    /// The terminal's name of the key, without modifiers.
    pub fn code(self) -> KeyCode {
        self.code
    }

    /// Whether this is the named key or character without Ctrl or Alt.
    pub fn is(self, code: KeyCode) -> bool {
        self.modifiers.is_empty() && self.code == code
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.modifiers.contains(KeyModifiers::CONTROL) {
            write!(f, "Ctrl-")?;
        }
        if self.modifiers.contains(KeyModifiers::ALT) {
            write!(f, "Alt-")?;
        }
        if let Some((name, _)) = NAMES.iter().find(|(_, code)| *code == self.code) {
            return write!(f, "{name}");
        }
        match self.code {
            KeyCode::Char(c) if self.modifiers.contains(KeyModifiers::CONTROL) => {
                write!(f, "{}", c.to_ascii_uppercase())
            }
            KeyCode::Char(c) => write!(f, "{c}"),
            KeyCode::F(n) => write!(f, "F{n}"),
            other => write!(f, "{other:?}"),
        }
    }
}

/// An unknown name of a key.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no key; write a character (`g`, `A`), a name (`Enter`, `F5`, `PgUp`) or a chord (`Ctrl-R`)")]
pub struct UnknownKey(pub String);

impl FromStr for Key {
    type Err = UnknownKey;

    fn from_str(text: &str) -> Result<Key, UnknownKey> {
        let unknown = || UnknownKey(text.to_owned());
        let named =
            |name: &str| NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, code)| *code);
        let mut rest = text;
        let mut modifiers = KeyModifiers::NONE;
        let code = loop {
            // A name may contain a dash itself (`Shift-Tab`), so names go before prefixes.
            if let Some(code) = named(rest) {
                break code;
            }
            let mut chars = rest.chars();
            match (chars.next(), chars.as_str()) {
                (Some(c), "") => break KeyCode::Char(c),
                (Some('f' | 'F'), number) if number.parse::<u8>().is_ok_and(|n| (1..=12).contains(&n)) => {
                    break KeyCode::F(number.parse().map_err(|_| unknown())?);
                }
                _ => {}
            }
            let (prefix, key) = rest.split_once('-').ok_or_else(unknown)?;
            modifiers |= match prefix.to_ascii_lowercase().as_str() {
                "ctrl" => KeyModifiers::CONTROL,
                "alt" => KeyModifiers::ALT,
                _ => return Err(unknown()),
            };
            rest = key;
        };
        Ok(Key::from_event(KeyEvent::new(code, modifiers)))
    }
}

/// A refused key of `console.toml`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("[keys] {action} = {key}: {reason}")]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct KeymapError {
    pub action: String,
    pub key: String,
    pub reason: String,
}

/// The active keys of every action. One key never means two actions.
#[derive(Debug, Clone, PartialEq)]
pub struct Keymap {
    bindings: Vec<(Key, Action)>,
}

impl Keymap {
    /// The default keys, with those of `choices` (action name, key names) instead where given.
    ///
    /// # Errors
    /// When an action or a key is unknown, a fixed key is to be changed, or two actions share a key.
    pub fn new<'a>(choices: impl IntoIterator<Item = (&'a str, &'a [String])>) -> Result<Keymap, KeymapError> {
        let refused = |action: &str, key: &str, reason: String| KeymapError {
            action: action.to_owned(),
            key: key.to_owned(),
            reason,
        };
        let mut chosen: Vec<(Action, Vec<Key>)> = Vec::new();
        for (name, keys) in choices {
            let Some(info) = ACTIONS.iter().find(|info| info.name == name) else {
                return Err(refused(name, &keys.join(" "), "there is no such action".to_owned()));
            };
            if info.fixed && !keys.iter().map(String::as_str).eq(info.keys.iter().copied()) {
                let reason = format!("its keys are {} on every console", info.keys.join(" and "));
                return Err(refused(name, &keys.join(" "), reason));
            }
            if keys.is_empty() {
                return Err(refused(name, "[]", "an action needs at least one key".to_owned()));
            }
            let parse = |key: &String| key.parse().map_err(|error: UnknownKey| refused(name, key, error.to_string()));
            chosen.push((info.action, keys.iter().map(parse).collect::<Result<_, _>>()?));
        }
        let mut bindings: Vec<(Key, Action)> = Vec::new();
        for info in &ACTIONS {
            let keys = match chosen.iter().find(|(action, _)| *action == info.action) {
                Some((_, keys)) => keys.clone(),
                None => info.keys.iter().map(|key| key.parse().expect("a default key has a valid name")).collect(),
            };
            for key in keys {
                if key.stops() && !info.fixed {
                    let reason = "the key is STOP with any modifier; give the action another key".to_owned();
                    return Err(refused(info.name, &key.to_string(), reason));
                }
                if let Some((_, other)) = bindings.iter().find(|(bound, _)| *bound == key) {
                    let (one, other) = (other.info().name, info.name);
                    let reason = format!("the key is bound to `{one}` and to `{other}`; give one of them another key");
                    return Err(refused(info.name, &key.to_string(), reason));
                }
                bindings.push((key, info.action));
            }
        }
        Ok(Keymap { bindings })
    }

    /// The action of the key. A STOP key keeps its action with any modifier.
    pub fn action(&self, key: Key) -> Option<Action> {
        if key.stops() {
            return Some(if matches!(key.code(), KeyCode::Char('c')) { Action::Interrupt } else { Action::Stop });
        }
        self.bindings.iter().find(|(bound, _)| *bound == key).map(|(_, action)| *action)
    }

    /// The keys of an action, the first one first.
    pub fn keys(&self, action: Action) -> impl Iterator<Item = Key> + '_ {
        self.bindings.iter().filter(move |(_, bound)| *bound == action).map(|(key, _)| *key)
    }

    /// The first key of an action, by name.
    pub fn key(&self, action: Action) -> String {
        self.keys(action).next().map(|key| key.to_string()).unwrap_or_default()
    }

    /// The keys that close a dialog that only shows something, in words.
    pub fn closing_keys(&self) -> String {
        format!("Esc Enter {}", self.key(Action::Quit))
    }

    /// All keys of an action, for example `Space F12`.
    pub fn all_keys(&self, action: Action) -> String {
        self.keys(action).map(|key| key.to_string()).collect::<Vec<_>>().join(" ")
    }
}

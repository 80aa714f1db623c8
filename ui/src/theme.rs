//! Meaning of colours and characters. A style never carries a meaning alone: text or a symbol says the same.

#![expect(missing_docs, reason = "the names of colours and characters say the rest")]

use ratatui::style::{Color, Modifier, Style};
use serde::Deserialize;

/// Colours by the settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum ColourChoice {
    /// As the environment says in `NO_COLOR`, `COLORTERM` and `TERM`.
    #[serde(rename = "auto")]
    Auto,
    #[serde(rename = "true")]
    True,
    #[serde(rename = "256")]
    Indexed,
    #[serde(rename = "16")]
    Named,
    #[serde(rename = "none")]
    None,
}

/// Brightness of the background by the settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ThemeChoice {
    /// As the terminal reports its background.
    Auto,
    Dark,
    Light,
}

/// Brightness of the terminal's background.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Background {
    #[default]
    Dark,
    Light,
}

impl Background {
    /// The background of a colour, each part 0 to 1: light where black text has more contrast than white text
    /// (WCAG 2.2, relative luminance and contrast ratio).
    pub fn of_rgb(rgb: [f64; 3]) -> Background {
        let linear = rgb.map(|part| if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) });
        let luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        // (L + 0.05) / 0.05 exceeds 1.05 / (L + 0.05).
        if (luminance + 0.05).powi(2) > 0.05 * 1.05 { Background::Light } else { Background::Dark }
    }

    /// The background that `COLORFGBG` names (rxvt, Konsole): the last of its colours.
    fn of_variable(value: &str) -> Option<Background> {
        match value.rsplit(';').next()?.parse::<u8>().ok()? {
            7 | 9..=15 => Some(Background::Light),
            0..=6 | 8 => Some(Background::Dark),
            _ => None,
        }
    }
}

/// Characters of charts and lines by the settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GlyphChoice {
    /// As the locale and `TERM` allow.
    Auto,
    /// Braille: 2 x 4 dots in a character.
    Braille,
    Dots,
    Ascii,
}

/// Colours of the terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colours {
    True,
    Indexed,
    Named,
    /// None: bold, dim and reverse remain.
    None,
}

/// Characters that the terminal can draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Glyphs {
    Braille,
    Dots,
    Ascii,
}

/// Meaning of a text or symbol on the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Ordinary text and values.
    Text,
    /// Labels, units and lines.
    Quiet,
    Heading,
    Key,
    /// In order.
    Good,
    /// Needs attention.
    Warning,
    /// Stopped, fallen, failed.
    Bad,
    /// STOP and the modes DAMPED and FAULT.
    Alarm,
    /// The selected row or tab.
    Selected,
    /// The robot is hardware.
    Hardware,
    /// First series of a chart; roll, front feet.
    SeriesA,
    /// Second series; pitch, rear feet.
    SeriesB,
    /// A trial laid under another.
    Ghost,
    /// While the force profile acts.
    ShadeImpulse,
    /// While no foot is on the ground.
    ShadeFlight,
    /// After touchdown.
    ShadeLanding,
}

/// Colours and characters of this terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Theme {
    pub colours: Colours,
    pub glyphs: Glyphs,
    pub background: Background,
}

/// One colour of 24 bits, of the 256 and of the 16.
#[derive(Clone, Copy)]
struct Shade {
    rgb: (u8, u8, u8),
    index: u8,
    named: Color,
}

/// The colours for one background. Text has a contrast of 4.5:1 at least, also on usual backgrounds beside black and white
/// and on the shaded phases (WCAG 2.2, criterion 1.4.3). The 16 colours are the terminal's own.
struct Palette {
    /// The terminal's own colour of text, about, in pictures of pixels.
    text: (u8, u8, u8),
    cyan: Shade,
    green: Shade,
    amber: Shade,
    red: Shade,
    violet: Shade,
    grey: Shade,
    /// Text on amber and red.
    on_alarm: Shade,
    impulse: Shade,
    flight: Shade,
    landing: Shade,
}

const fn shade(rgb: (u8, u8, u8), index: u8, named: Color) -> Shade {
    Shade { rgb, index, named }
}

const DARK: Palette = Palette {
    text: (230, 230, 230),
    cyan: shade((86, 182, 194), 73, Color::Cyan),
    green: shade((120, 190, 110), 107, Color::Green),
    amber: shade((229, 180, 80), 179, Color::Yellow),
    red: shade((240, 120, 115), 210, Color::Red),
    violet: shade((200, 155, 228), 141, Color::Magenta),
    grey: shade((160, 165, 172), 248, Color::Reset),
    on_alarm: shade((20, 20, 20), 16, Color::Black),
    impulse: shade((58, 48, 20), 52, Color::Reset),
    flight: shade((20, 44, 58), 17, Color::Reset),
    landing: shade((42, 34, 52), 235, Color::Reset),
};
const LIGHT: Palette = Palette {
    text: (25, 25, 25),
    cyan: shade((0, 95, 115), 24, Color::Cyan),
    green: shade((25, 100, 35), 22, Color::Green),
    amber: shade((130, 75, 0), 94, Color::Yellow),
    red: shade((170, 25, 30), 124, Color::Red),
    violet: shade((120, 50, 150), 91, Color::Magenta),
    grey: shade((85, 90, 98), 240, Color::Reset),
    on_alarm: shade((255, 255, 255), 231, Color::Black),
    impulse: shade((250, 235, 200), 230, Color::Reset),
    flight: shade((213, 235, 248), 195, Color::Reset),
    landing: shade((235, 225, 245), 255, Color::Reset),
};

impl Theme {
    /// Chooses the theme from the settings and the environment; `variable` returns an environment variable.
    pub fn detect(colours: ColourChoice, glyphs: GlyphChoice, variable: impl Fn(&str) -> Option<String>) -> Theme {
        let filled = |name: &str| variable(name).filter(|value| !value.is_empty());
        let term = filled("TERM").unwrap_or_default();
        let colours = match colours {
            ColourChoice::True => Colours::True,
            ColourChoice::Indexed => Colours::Indexed,
            ColourChoice::Named => Colours::Named,
            ColourChoice::None => Colours::None,
            // https://no-color.org: present and not empty, whatever its value.
            ColourChoice::Auto if filled("NO_COLOR").is_some() || term == "dumb" || term.ends_with("-m") => {
                Colours::None
            }
            ColourChoice::Auto => match filled("COLORTERM").as_deref() {
                Some("truecolor" | "24bit") => Colours::True,
                _ if term.contains("256color") => Colours::Indexed,
                _ => Colours::Named,
            },
        };
        // POSIX: the first of these that is set decides.
        let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(filled).unwrap_or_default().to_lowercase();
        let glyphs = match glyphs {
            GlyphChoice::Braille => Glyphs::Braille,
            GlyphChoice::Dots => Glyphs::Dots,
            GlyphChoice::Ascii => Glyphs::Ascii,
            GlyphChoice::Auto if !(locale.contains("utf-8") || locale.contains("utf8")) => Glyphs::Ascii,
            // The console of the kernel has line characters but no braille.
            GlyphChoice::Auto if term == "linux" => Glyphs::Dots,
            GlyphChoice::Auto => Glyphs::Braille,
        };
        let background = filled("COLORFGBG").and_then(|value| Background::of_variable(&value)).unwrap_or_default();
        Theme { colours, glyphs, background }
    }

    /// A theme for a dark background.
    pub fn new(colours: Colours, glyphs: Glyphs) -> Theme {
        Theme { colours, glyphs, background: Background::Dark }
    }

    /// Whether the colours depend on the background: the 16 colours are the terminal's own.
    pub fn follows_background(&self) -> bool {
        matches!(self.colours, Colours::True | Colours::Indexed)
    }

    fn palette(&self) -> &'static Palette {
        match self.background {
            Background::Dark => &DARK,
            Background::Light => &LIGHT,
        }
    }

    pub fn style(&self, role: Role) -> Style {
        let plain = Style::new();
        let palette = self.palette();
        match role {
            Role::Text => plain,
            Role::Quiet | Role::Ghost if self.colours == Colours::Named => plain.add_modifier(Modifier::DIM),
            Role::Quiet | Role::Ghost => self.fg(palette.grey),
            Role::Heading => self.fg(palette.cyan).add_modifier(Modifier::BOLD),
            Role::Key => plain.add_modifier(Modifier::BOLD),
            Role::Good => self.fg(palette.green),
            Role::Warning => self.fg(palette.amber).add_modifier(Modifier::BOLD),
            Role::Bad => self.fg(palette.red).add_modifier(Modifier::BOLD),
            Role::Alarm => self.reverse(palette.red),
            Role::Selected => plain.add_modifier(Modifier::REVERSED),
            Role::Hardware => self.reverse(palette.amber),
            Role::SeriesA => self.fg(palette.cyan),
            Role::SeriesB => self.fg(palette.violet),
            Role::ShadeImpulse => self.bg(palette.impulse),
            Role::ShadeFlight => self.bg(palette.flight),
            Role::ShadeLanding => self.bg(palette.landing),
        }
    }

    /// Red, green and blue of what has a role in a picture of pixels.
    pub fn rgb(&self, role: Role) -> (u8, u8, u8) {
        let palette = self.palette();
        match role {
            Role::Text | Role::Key | Role::Selected => palette.text,
            Role::Quiet | Role::Ghost => palette.grey.rgb,
            Role::Heading | Role::SeriesA => palette.cyan.rgb,
            Role::Good => palette.green.rgb,
            Role::Warning | Role::Hardware => palette.amber.rgb,
            Role::Bad | Role::Alarm => palette.red.rgb,
            Role::SeriesB => palette.violet.rgb,
            Role::ShadeImpulse => palette.impulse.rgb,
            Role::ShadeFlight => palette.flight.rgb,
            Role::ShadeLanding => palette.landing.rgb,
        }
    }

    /// `unicode` as far as the terminal can draw it, else `ascii`.
    fn pick(&self, ascii: &'static str, unicode: &'static str) -> &'static str {
        if self.glyphs == Glyphs::Ascii { ascii } else { unicode }
    }

    /// The horizontal line of headings.
    pub fn line(&self) -> &'static str {
        self.pick("-", "─")
    }

    pub fn bar(&self) -> &'static str {
        self.pick("|", "│")
    }

    /// A piece of a limit's line.
    pub fn limit(&self) -> &'static str {
        self.pick("-", "╌")
    }

    /// Separator of two items on one line.
    pub fn dot(&self) -> &'static str {
        self.pick("-", "·")
    }

    pub fn arrow(&self) -> &'static str {
        self.pick("->", "→")
    }

    pub fn plus_minus(&self) -> &'static str {
        self.pick("+-", "±")
    }

    pub fn contact_indicator(&self, on: bool) -> &'static str {
        if on { self.pick("#", "●") } else { self.pick(".", "○") }
    }

    /// The filled and the empty part of a bar.
    pub fn fill(&self) -> (&'static str, &'static str) {
        (self.pick("#", "█"), self.pick(".", "░"))
    }

    fn colour(&self, shade: Shade) -> Option<Color> {
        match self.colours {
            Colours::True => Some(Color::from(shade.rgb)),
            Colours::Indexed => Some(Color::Indexed(shade.index)),
            Colours::Named => Some(shade.named),
            Colours::None => None,
        }
    }

    fn fg(&self, shade: Shade) -> Style {
        self.colour(shade).map_or_else(Style::new, |colour| Style::new().fg(colour))
    }

    fn bg(&self, shade: Shade) -> Style {
        self.colour(shade).map_or_else(Style::new, |colour| Style::new().bg(colour))
    }

    /// Text on the colour; reversed where there are no colours.
    fn reverse(&self, shade: Shade) -> Style {
        match self.colours {
            Colours::None => Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD),
            _ => self.bg(shade).patch(self.fg(self.palette().on_alarm)).add_modifier(Modifier::BOLD),
        }
    }
}

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
}

/// One colour in the three palettes.
struct Shade {
    rgb: (u8, u8, u8),
    index: u8,
    named: Color,
}

const fn shade(rgb: (u8, u8, u8), index: u8, named: Color) -> Shade {
    Shade { rgb, index, named }
}

const CYAN: Shade = shade((86, 182, 194), 73, Color::Cyan);
const GREEN: Shade = shade((120, 190, 110), 107, Color::Green);
const AMBER: Shade = shade((229, 180, 80), 179, Color::Yellow);
const RED: Shade = shade((224, 92, 92), 167, Color::Red);
const VIOLET: Shade = shade((190, 140, 220), 140, Color::Magenta);
const GREY: Shade = shade((140, 145, 152), 245, Color::Reset);
const BLACK: Shade = shade((20, 20, 20), 16, Color::Black);
const NIGHT_IMPULSE: Shade = shade((58, 48, 20), 58, Color::Reset);
const NIGHT_FLIGHT: Shade = shade((20, 44, 58), 23, Color::Reset);
const NIGHT_LANDING: Shade = shade((42, 34, 52), 53, Color::Reset);

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
        Theme { colours, glyphs }
    }

    pub fn style(&self, role: Role) -> Style {
        let plain = Style::new();
        match role {
            Role::Text => plain,
            Role::Quiet | Role::Ghost if self.colours == Colours::Named => plain.add_modifier(Modifier::DIM),
            Role::Quiet | Role::Ghost => self.fg(GREY),
            Role::Heading => self.fg(CYAN).add_modifier(Modifier::BOLD),
            Role::Key => plain.add_modifier(Modifier::BOLD),
            Role::Good => self.fg(GREEN),
            Role::Warning => self.fg(AMBER).add_modifier(Modifier::BOLD),
            Role::Bad => self.fg(RED).add_modifier(Modifier::BOLD),
            Role::Alarm => self.reverse(RED),
            Role::Selected => plain.add_modifier(Modifier::REVERSED),
            Role::Hardware => self.reverse(AMBER),
            Role::SeriesA => self.fg(CYAN),
            Role::SeriesB => self.fg(VIOLET),
            Role::ShadeImpulse => self.bg(NIGHT_IMPULSE),
            Role::ShadeFlight => self.bg(NIGHT_FLIGHT),
            Role::ShadeLanding => self.bg(NIGHT_LANDING),
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

    /// Dark text on the colour; reversed where there are no colours.
    fn reverse(&self, shade: Shade) -> Style {
        match self.colours {
            Colours::None => Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD),
            _ => self.bg(shade).patch(self.fg(BLACK)).add_modifier(Modifier::BOLD),
        }
    }
}

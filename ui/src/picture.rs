//! The robot's picture in pixels: when it takes the place of the characters.
//!
//! Pixels cost kilobytes, and characters of a robot that moves a few hundred bytes a frame. So pixels are sent once the
//! picture has been still for a moment, never during a trial, and at a bounded rate.

use std::rc::Rc;
use std::time::{Duration, Instant};

use crossterm::terminal::WindowSize;
use quadfrog::telemetry::Mode;
use ratatui::layout::{Rect, Size};

use crate::graphics::{EncodedPicture, GraphicsProtocol, GraphicsSupport};
use crate::model::Model;
use crate::theme::Theme;
use crate::view::{self, Drawing};

/// Time for which the picture is unchanged before pixels are sent.
const STILL: Duration = Duration::from_millis(500);
/// Most that pictures send on average, bits per second: after one, the next waits for as long as it would have taken.
const BITS_PER_SECOND: f64 = 10_000.0;
/// Most pixels in a direction. xterm does not draw larger pictures in sixel ("maxGraphicSize"), and larger ones of the other
/// protocols are sent in a part of the resolution.
const LARGEST: u16 = 1000;

/// Width and height of a cell, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct CellSize {
    width: u16,
    height: u16,
}

impl CellSize {
    /// The size by the terminal's report; none where it reports no pixels.
    fn of(window: &WindowSize) -> Option<CellSize> {
        let (width, height) = (window.width.checked_div(window.columns)?, window.height.checked_div(window.rows)?);
        (width > 0 && height > 0).then_some(CellSize { width, height })
    }
}

/// A picture before its encoding.
#[derive(Debug, Clone)]
struct Subject {
    area: Rect,
    theme: Theme,
    drawing: Drawing,
}

impl Subject {
    fn resembles(&self, other: &Subject) -> bool {
        self.area == other.area && self.theme == other.theme && self.drawing.resembles(&other.drawing)
    }
}

/// Decides which picture of pixels the screen shows.
pub(crate) struct PictureSchedule {
    support: GraphicsSupport,
    cell: Option<CellSize>,
    /// The last picture in characters, and the time since which it is still.
    still: Option<(Subject, Instant)>,
    shown: Option<(Subject, Rc<EncodedPicture>)>,
    /// Earliest time of the next picture.
    not_before: Option<Instant>,
}

impl PictureSchedule {
    pub fn new(support: GraphicsSupport) -> PictureSchedule {
        PictureSchedule { support, cell: None, still: None, shown: None, not_before: None }
    }

    /// Takes the size of the terminal in pixels and in cells.
    pub fn resize(&mut self, window: Option<WindowSize>) {
        self.cell = window.as_ref().and_then(CellSize::of);
    }

    /// Whether the terminal's attributes decide: the question for them is worth asking.
    pub fn asks(&self) -> bool {
        self.support == GraphicsSupport::Asked && self.cell.is_some()
    }

    /// Takes the answer, whether the terminal shows sixel.
    pub fn answer(&mut self, sixel: bool) {
        if self.support == GraphicsSupport::Asked && sixel {
            self.support = GraphicsSupport::Protocol(GraphicsProtocol::Sixel);
        }
    }

    /// Whether pictures are possible, now or after the terminal's answer.
    pub fn possible(&self) -> bool {
        self.support != GraphicsSupport::Cells && self.cell.is_some()
    }

    /// The picture on a screen of `size` at the time `now`; none for characters.
    pub fn picture(&mut self, model: &Model, size: Size, now: Instant) -> Option<Rc<EncodedPicture>> {
        let Some((subject, protocol, cell)) = self.subject(model, size) else {
            (self.still, self.shown) = (None, None);
            return None;
        };
        if let Some((shown, picture)) = &self.shown
            && shown.resembles(&subject)
        {
            return Some(picture.clone());
        }
        self.shown = None;
        let since = match &self.still {
            Some((still, since)) if still.resembles(&subject) => *since,
            _ => {
                self.still = Some((subject.clone(), now));
                now
            }
        };
        if now.duration_since(since) < STILL || self.not_before.is_some_and(|not_before| now < not_before) {
            return None;
        }
        let picture = Rc::new(encode(&subject, protocol, cell)?);
        self.not_before = Some(now + Duration::from_secs_f64(8.0 * picture.show.len() as f64 / BITS_PER_SECOND));
        self.shown = Some((subject, picture.clone()));
        Some(picture)
    }

    /// The present picture with its protocol and the size of its cells; none while characters show it better.
    fn subject(&self, model: &Model, size: Size) -> Option<(Subject, GraphicsProtocol, CellSize)> {
        let (GraphicsSupport::Protocol(protocol), Some(cell)) = (self.support, self.cell) else { return None };
        if moves(model.mode()) || model.snapshot.tick.trial.is_some() {
            return None;
        }
        let mut area = view::robot_area(size, model)?;
        if protocol == GraphicsProtocol::Sixel {
            area = within(area, cell);
        }
        let drawing = view::robot_drawing(area, f64::from(cell.height) / f64::from(cell.width), model)?;
        Some((Subject { area, theme: model.theme, drawing }, protocol, cell))
    }
}

/// Whether the robot moves by itself in this mode, or is about to.
fn moves(mode: Mode) -> bool {
    matches!(mode, Mode::StandUp | Mode::Countdown | Mode::Jump | Mode::Settle | Mode::SitDown)
}

/// The middle of an area as large as a picture may be.
fn within(area: Rect, cell: CellSize) -> Rect {
    let (width, height) = (area.width.min(LARGEST / cell.width), area.height.min(LARGEST / cell.height));
    Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height }
}

/// The bytes of a picture; none if the library for PNG refuses it.
fn encode(subject: &Subject, protocol: GraphicsProtocol, cell: CellSize) -> Option<EncodedPicture> {
    let Subject { area, theme, drawing } = subject;
    let pixels = |cells: u16, pixels: u16| u32::from(cells) * u32::from(pixels);
    let (width, height) = (pixels(area.width, cell.width), pixels(area.height, cell.height));
    let divisor = match protocol {
        GraphicsProtocol::Sixel => 1,
        GraphicsProtocol::Kitty | GraphicsProtocol::Iterm2 => width.max(height).div_ceil(LARGEST.into()),
    };
    let size = ((width / divisor) as usize, (height / divisor) as usize);
    let raster = drawing.draw_pixels(size, f64::from(cell.height) / f64::from(divisor), theme);
    EncodedPicture::new(protocol, &raster, *area, theme.background).ok()
}

//! Drawing. Every panel is a free function of the part of the model that it draws; nothing here changes the model.
//!
//! ```text
//!  READY      SIM  forward   trial #8   7 of 20 counted   best 0.642 m (#3)     REC 03:12  <- frame, never covered
//!  STOP Space F12    loop 0 late, worst 0.1 ms    link 0 ms    motors 31 C
//!  1 Live   2 Trials   3 Optimizer   4 Override   5 Health   6 Log        ? help : actions
//! ┌─────────────────────────────────────────────────────────────────────────────────────┐
//! │ the open view, with dialogs over it                                                  │
//! └─────────────────────────────────────────────────────────────────────────────────────┘
//!  ──o──x──o───│────o──!──────                       <- in a replay: its trials, faults and the playhead
//!  override Fx = 120 N: done                                                  <- the newest answer, up to three rows
//!  Press g twice to jump  ·  o override  ·  n skip  ·  D sit down             <- the next possible step
//! ```

mod beside;
mod chart;
mod compact;
mod countdown;
mod densities;
mod dialogs;
mod dots;
mod drawing;
mod health;
mod health_history;
mod last_line;
mod live;
mod log;
pub mod next_step;
mod objective;
mod optimizer;
mod overrides;
mod parameter_axes;
mod points;
mod proposal;
mod questions;
mod queue;
mod robot_shape;
mod row_keys;
mod scene;
mod series_style;
mod status_bar;
mod timeline;
mod trials;
mod wireframe;

use ratatui::Frame;
use ratatui::layout::{Rect, Size};

use crate::draw;
use crate::layout::{Areas, areas, compact_areas};
use crate::model::{Model, View};
pub(crate) use drawing::Drawing;

/// The cells of the robot's picture on a screen of that size; none where the picture is not shown or something may cover it.
pub(crate) fn robot_area(size: Size, model: &Model) -> Option<Rect> {
    let body = areas(size, model).filter(|_| model.view == View::Live && model.dialog.is_none())?.body;
    wireframe::picture_area(live::robot_panel(body, model)?)
}

/// The robot's picture for an area whose rows are as high as `row_height` columns are wide; none where the robot is not known.
pub(crate) fn robot_drawing(area: Rect, row_height: f64, model: &Model) -> Option<Drawing> {
    wireframe::drawing(area, row_height, model)
}

/// Draws everything. Texts of persons and of files may hold characters that turn the direction of a line; they are left out.
pub fn render(frame: &mut Frame, model: &Model) {
    render_parts(frame, model);
    draw::remove_unprintable(frame.buffer_mut());
}

fn render_parts(frame: &mut Frame, model: &Model) {
    let size = frame.area().as_size();
    let Some(Areas { frame: top, tabs, body, timeline, message, next_step }) = areas(size, model) else {
        return match compact_areas(size) {
            Some(areas) => compact::render(frame, areas, model),
            None => status_bar::render_small(frame, frame.area(), model),
        };
    };
    status_bar::render(frame, top, model);
    status_bar::render_tabs(frame, tabs, model);
    match model.view {
        View::Live => live::render(frame, body, model),
        View::Trials => trials::render(frame, body, model),
        View::Optimizer => optimizer::render(frame, body, &model.session, &model.theme),
        View::Override => overrides::render(frame, body, model),
        View::Health => health::render(frame, body, model),
        View::Log => log::render(frame, body, model),
    }
    dialogs::render(frame, body, model);
    countdown::render(frame, body, model);
    timeline::render(frame, timeline, model);
    status_bar::render_message(frame, message, model);
    last_line::render(frame, next_step, model);
}

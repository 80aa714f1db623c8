//! State of the live view: chart mode, window, freeze, ghost, comparison.

use std::time::Duration;

use super::comparison::Comparison;
use super::history::SignalHistory;
use crate::series::{SETS, Series};
use crate::settings::ChartMode;

/// State of the live view.
#[derive(Debug, Clone)]
pub struct LiveView {
    pub mode: ChartMode,
    /// Time that a chart shows, s.
    pub window_s: f64,
    /// Whether the sweep's cursor is drawn as a line; without it the gap ahead of the newest value shows the same with
    /// less to send.
    pub cursor_line: bool,
    pub panel: Panel,
    /// Drawn series, in the order of the charts.
    pub series: Vec<Series>,
    /// The operator's own choice of series, of the settings or the list: a set beside those of the program.
    pub chosen_series: Option<Vec<Series>>,
    /// The history at the moment of freezing, and that moment on the console's clock.
    pub frozen: Option<(SignalHistory, Duration)>,
    /// Time under the cursor while frozen, ns.
    pub cursor_ns: u64,
    /// The trial laid under the charts of a jump.
    pub ghost: Option<u32>,
    /// Two trials in place of the present; none shows the present.
    pub comparison: Option<Comparison>,
    /// Whether the charts show the present although a trial waits for its verdict.
    pub present_in_review: bool,
    /// Time under the cursor on the trial that waits for its verdict, ns; none without a cursor.
    pub landed_cursor_ns: Option<u64>,
}

impl LiveView {
    /// Draws `series`, and keeps it as the operator's choice if it is one.
    pub fn choose(&mut self, series: Vec<Series>) {
        if let Some(chosen) = own_choice(&series) {
            self.chosen_series = Some(chosen);
        }
        self.series = series;
    }
}

/// The series if they are none of the program's sets.
pub fn own_choice(series: &[Series]) -> Option<Vec<Series>> {
    (!SETS.contains(&series)).then(|| series.to_vec())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Panel {
    Charts,
    /// Torque and speed of the joints, and the robot as a wireframe.
    Joints,
    /// The robot, as large as there is room.
    Robot,
}

//! The objective over the trials, with the best so far.

use quadfrog::trial::{PredictedTrial, TrialRecord, Verdict};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};

use super::draw::{cell_at, heading, heading_width, number, sign};
use super::parameter_axes::LEAST_SPAN;
use crate::model::session::SessionModel;
use crate::model::trials::{BestValue, accepted_value};
use crate::theme::{Role, Theme};

const SCALE: u16 = 6;
/// Rows of the plot from which the numbers of the trials have one.
const NUMBERS_FROM_ROWS: u16 = 6;

/// The title of a panel with the objective upwards: `J (m) over f0`.
pub fn objective_over(what: &str, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    format!("J{unit} over {what}")
}

pub fn render(frame: &mut Frame, area: Rect, session: &SessionModel, theme: &Theme) {
    let best = session.trials.best();
    let aside = match session.trials.best_value() {
        Some(BestValue { trial, value, by_hand, chosen }) => {
            format!("best {} {}{by_hand} #{trial}{chosen}", number(value), session.info.unit)
        }
        None => "none accepted yet".to_owned(),
    };
    let mut title = objective_over("trials", &session.info.unit);
    if heading_width(&title, &aside) > usize::from(area.width) {
        // The best value is worth more than the words.
        title = title.trim_end_matches(" over trials").to_owned();
    }
    let plot = heading(frame, area, theme, &title, &aside);
    let numbers = u16::from(plot.height >= NUMBERS_FROM_ROWS);
    let [plot, trials] = Layout::vertical([Constraint::Fill(1), Constraint::Length(numbers)]).areas(plot);
    if plot.height < 2 || plot.width <= SCALE || session.trials.records.is_empty() {
        return;
    }
    let values = || session.trials.records.values().filter_map(|trial| trial.value);
    let low = values().fold(0.0, f64::min);
    let high = values().fold(0.0, f64::max).max(low + LEAST_SPAN);
    let buffer = frame.buffer_mut();
    // Falls and void trials alone have no scale.
    if high > low + LEAST_SPAN {
        buffer.set_string(plot.x, plot.y, number(high), theme.style(Role::Quiet));
    }
    let bottom = plot.bottom() - 1;
    buffer.set_string(plot.x, bottom, if low < 0.0 { number(low) } else { "0".to_owned() }, theme.style(Role::Quiet));
    let last = session.trials.records.keys().next_back().map_or(0, |trial| trial + 1);
    let slots = usize::try_from(last.max(session.budget()).max(1)).unwrap_or(1);
    let width = usize::from(plot.width - SCALE);
    // From the left to the right end of the plot.
    let column = |trial: u32| {
        let at = trial as usize * (width - 1) / slots.saturating_sub(1).max(1);
        plot.x + SCALE + at.min(width - 1) as u16
    };
    let row = |value: f64| plot.y + cell_at((high - value) / (high - low), plot.height);
    if numbers > 0 {
        let last = format!("#{}", slots - 1);
        buffer.set_string(plot.x + SCALE, trials.y, "#0", theme.style(Role::Quiet));
        buffer.set_string(trials.right().saturating_sub(last.len() as u16), trials.y, last, theme.style(Role::Quiet));
    }
    // Best so far: a level line from each new best to the next.
    let bests: Vec<&TrialRecord> = session.trials.best_so_far().collect();
    for (index, trial) in bests.iter().enumerate() {
        let Some(value) = trial.value else { continue };
        let from = column(trial.trial);
        let to = match bests.get(index + 1) {
            Some(next) => column(next.trial).saturating_sub(1),
            None => column(last.max(1) - 1),
        }
        .max(from);
        let line = theme.line().repeat(usize::from(to - from) + 1);
        buffer.set_string(from, row(value), line, theme.style(Role::Quiet));
    }
    // What the sampler's model says of each point: its mean and one standard deviation to both sides.
    let predicted = session.insight.iter().flat_map(|insight| &insight.predicted);
    for PredictedTrial { trial, value, deviation } in predicted {
        let (top, low) = (row(value + deviation), row(value - deviation));
        for y in top..=low {
            buffer.set_string(column(*trial), y, theme.bar(), theme.style(Role::Quiet));
        }
    }
    for trial in session.trials.records.values().filter(|trial| !trial.was_not_run()) {
        let (symbol, role) = sign(trial.verdict);
        let y = match trial.verdict {
            Some(Verdict::Void) => bottom,
            _ => row(trial.value.or(trial.hand_value).unwrap_or(0.0)),
        };
        buffer.set_string(column(trial.trial), y, symbol, theme.style(role));
    }
    if let Some((trial, value)) = best.and_then(|best| Some((best, accepted_value(best)?))) {
        buffer.set_string(column(trial.trial), row(value), "*", theme.style(Role::Good));
    }
}

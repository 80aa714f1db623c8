//! The timeline of a replay: trials with their verdicts, faults, lost parts and the playhead on one line.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;

use super::draw::{cell_at, sign, span};
use crate::model::Model;
use crate::theme::Role;

/// Marks by rank; of several in a cell the highest is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Mark {
    Nothing,
    Looped,
    Trial { fell: bool, later: bool, index: usize },
    Lost,
    Fault { later: bool },
    Playhead,
}

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let (Some(replay), Some(timeline)) = (&model.replay, &model.timeline) else { return };
    let width = area.width.saturating_sub(2);
    if area.height == 0 || width == 0 {
        return;
    }
    let theme = &model.theme;
    let cell = |time_ns: u64| usize::from(cell_at(time_ns as f64 / replay.duration_ns.max(1) as f64, width));
    let mut marks = vec![Mark::Nothing; usize::from(width)];
    let mut put = |at: usize, mark: Mark| marks[at] = marks[at].max(mark);
    for (index, trial) in timeline.trials.iter().enumerate() {
        let later = trial.begin_ns > replay.time_ns;
        put(cell(trial.begin_ns), Mark::Trial { fell: timeline.falls.contains(&trial.trial), later, index });
        if replay.looping == Some(trial.trial) {
            (cell(trial.begin_ns)..=cell(trial.end_ns)).for_each(|at| put(at, Mark::Looped));
        }
    }
    for (from_ns, to_ns) in &timeline.lost_ns {
        (cell(*from_ns)..=cell(*to_ns)).for_each(|at| put(at, Mark::Lost));
    }
    for time_ns in &timeline.faults_ns {
        put(cell(*time_ns), Mark::Fault { later: *time_ns > replay.time_ns });
    }
    put(cell(replay.time_ns), Mark::Playhead);
    let best = model.session.trials.best().map(|best| best.trial);
    let role_at = |later: bool, role: Role| if later { Role::Quiet } else { role };
    let spans = marks.into_iter().map(|mark| match mark {
        Mark::Nothing => span(theme, Role::Quiet, theme.line()),
        Mark::Looped => span(theme, Role::Warning, "="),
        Mark::Trial { later, index, .. } => {
            let trial = timeline.trials[index].trial;
            // At the playhead an earlier trial may have another verdict than at the end: the table's.
            let played = model.session.trials.records.get(&trial).and_then(|row| row.verdict).filter(|_| !later);
            let (symbol, role) = sign(played.or(timeline.verdict(trial)));
            let symbol = if best == Some(trial) { "*" } else { symbol };
            span(theme, role_at(later, role), symbol)
        }
        Mark::Lost => span(theme, Role::Bad, "#"),
        Mark::Fault { later } => span(theme, role_at(later, Role::Bad), "!"),
        Mark::Playhead => span(theme, Role::Selected, theme.bar()),
    });
    let line = std::iter::once(span(theme, Role::Text, " ")).chain(spans).collect::<Vec<_>>();
    frame.render_widget(Line::from(line), area);
}

//! View 2, Trials: the whole table. Its newest rows are the lower part of Live.

use quadfrog::trial::{JudgedBy, TrialRecord, Verdict};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{clock, columns, heading, heading_width, measured_number, number, sign, span, truncate};
use crate::action::Action;
use crate::column::Column;
use crate::layout::first_row;
use crate::model::Model;
use crate::model::comparison::Comparison;
use crate::model::table_columns::{CellContent, ShownColumn, number_digits, shown_columns};
use crate::model::trials::{SortBy, value_is_by_hand};
use crate::text::remark;
use crate::theme::Role;

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let later = model.later_trials().count();
    let title = if later > 0 { format!("Trials, {later} after the playhead (+)") } else { "Trials".to_owned() };
    let (rows, room) = (model.trial_rows().len(), usize::from(area.height).saturating_sub(2));
    let number = if rows > room { format!(" ({room} of {rows})") } else { String::new() };
    let legend = match &model.live.comparison {
        Some(Comparison { b, .. }) if b.recording.is_none() => ", A and B compared",
        Some(_) => ", A compared",
        None if model.live.ghost.is_some() => ", ~ under the charts",
        None => "",
    };
    let titles = [format!("{title}{legend}{number}"), format!("{title}{number}"), title];
    let summaries = summaries(model);
    // The most important form that has room: the number of rows gives way before a verdict's count.
    let mut headings =
        summaries.iter().flat_map(|summary| titles.iter().map(move |title| (title.as_str(), summary.as_str())));
    let fits = |(title, summary): &(&str, &str)| heading_width(title, summary) <= usize::from(area.width);
    let (title, summary) = headings.find(fits).unwrap_or((&titles[2], ""));
    let body = heading(frame, area, &model.theme, title, summary);
    render_table(frame, body, model, true);
}

/// The character behind the number of a trial: `A` and `B` as the charts name two that are compared, `+` after the playhead of a
/// replay, `~` under the charts.
fn mark(model: &Model, trial: u32) -> &'static str {
    match &model.live.comparison {
        Some(Comparison { a, .. }) if a.trial == trial => "A",
        Some(Comparison { b, .. }) if b.trial == trial && b.recording.is_none() => "B",
        _ if model.is_later(trial) => "+",
        None if model.live.ghost == Some(trial) => "~",
        _ => " ",
    }
}

/// Most columns of the path of a configuration.
const CONFIGURATION_WIDTH: usize = 24;

/// The path, or its end from a `/` on with `..` before it: that names the folder. A name that is longer than `width` is cut itself.
fn end_of_path(path: &str, width: usize) -> String {
    if columns(path) <= width {
        return path.to_owned();
    }
    let path = path.trim_end_matches('/');
    let mut ends = path.match_indices('/').map(|(at, _)| &path[at..]);
    match ends.find(|end| columns(end) + 2 <= width) {
        Some(end) => format!("..{end}"),
        None => truncate(path.rsplit('/').next().unwrap_or(path), width),
    }
}

/// The number of each verdict with the order, filter and columns of the table, from the longest to the shortest: shorter keys before
/// fewer counts. Where the trials are judged again, the result of that.
fn summaries(model: &Model) -> Vec<String> {
    if let Some(table) = &model.rejudged {
        let name = end_of_path(&table.configuration, CONFIGURATION_WIDTH);
        return vec![format!("new by {name}: {}", table.summary())];
    }
    let trials = &model.session.trials;
    let mut counts = Verdict::ALL.map(|verdict| (trials.count(verdict), verdict.name())).to_vec();
    counts.push((trials.records.values().filter(|trial| trial.was_not_run()).count(), "not run"));
    let in_words = |(count, name): &(usize, &str)| format!("{count} {name}");
    // Those that are zero give way first; that of the trials that were not run is never shown as zero.
    let found: Vec<String> = counts.iter().filter(|(count, _)| *count > 0).map(in_words).collect();
    counts.retain(|(count, name)| *count > 0 || *name != "not run");
    let all: Vec<String> = counts.iter().map(in_words).collect();
    let view = &model.trial_table;
    let (shown, by_filter) = match (view.best_only, view.filter) {
        (true, _) => ("best only".to_owned(), Action::BestOnly),
        (false, Some(filter)) => (format!("only {}", filter.name()), Action::Filter),
        (false, None) => ("all".to_owned(), Action::Filter),
    };
    let sort = match view.sort {
        SortBy::Number => "number",
        SortBy::Parameter(index) => {
            model.session.info.parameters.get(index).map_or("number", |info| info.name.as_str())
        }
        SortBy::Column(column) => column.name(),
    };
    let turned = if view.reversed { " reversed" } else { "" };
    let [by, only, columns] = [Action::Sort, by_filter, Action::Columns].map(|action| model.keymap.key(action));
    let keys = format!("by {sort}{turned} ({by}), {shown} ({only}), columns ({columns})");
    let short_keys = format!("{by} by {sort}{turned}, {only} {shown}, {columns} columns");
    let mut forms = vec![
        format!("{}; {keys}", all.join(", ")),
        format!("{}; {keys}", found.join(", ")),
        format!("{}; {short_keys}", found.join(", ")),
    ];
    // `..` stands for counts that are left out.
    forms.extend((1..found.len()).rev().map(|count| format!("{}, ..; {short_keys}", found[..count].join(", "))));
    forms.extend([short_keys, format!("{only} {shown}")]);
    forms.retain(|form| !form.starts_with(';'));
    forms
}

/// The table, scrolled so that the selected row is seen. `full` shows the choice; without it the rows around the newest trial.
pub fn render_table(frame: &mut Frame, area: Rect, model: &Model, full: bool) {
    if area.height < 2 {
        return;
    }
    let theme = &model.theme;
    let width = usize::from(area.width);
    let columns = shown_columns(model, width, full);
    let titles: Vec<String> = columns.iter().map(|column| padded(&column.title, column.width)).collect();
    let digits = number_digits(model);
    let title = format!(" {:>digits$} {}", "#", titles.join(" "));
    // In the whole table the line above says it.
    let later = if !full && model.later_trials().next().is_some() { " + later" } else { "" };
    let mut title = truncate(&title, width);
    // In its place only whole titles.
    while !later.is_empty() && title.trim_end().chars().count() + later.len() > width {
        let shorter = title.trim_end().rsplit_once(' ').map_or("", |(whole, _)| whole);
        title = shorter.trim_end_matches([' ', '|']).to_owned();
    }
    let (heading, later) = (span(theme, Role::Heading, title), span(theme, Role::Quiet, later));
    let areas = Layout::horizontal([Constraint::Fill(1), Constraint::Length(later.width() as u16)]);
    let [left, right] = areas.areas(Rect { height: 1, ..area });
    frame.render_widget(Line::from(heading), left);
    frame.render_widget(Line::from(later), right);
    let rows: Vec<&TrialRecord> = match full {
        true => model.trial_rows(),
        false => {
            let mut rows: Vec<_> = model.session.trials.records.values().chain(model.later_trials()).collect();
            rows.sort_by_key(|row| row.trial);
            rows
        }
    };
    if rows.is_empty() {
        let below = Rect { y: area.y + 1, height: area.height - 1, ..area };
        return render_empty(frame, below, model);
    }
    let selected_trial = if full { model.selected_trial().map(|trial| trial.trial) } else { None };
    // The rows around the newest trial at the playhead are shown, where there are later ones.
    let newest = || model.session.trials.newest().or(rows.first().copied()).map(|trial| trial.trial);
    let middle = if full { selected_trial } else { newest() };
    let position = middle.and_then(|number| rows.iter().position(|row| row.trial == number));
    let first = first_row(rows.len(), position, usize::from(area.height) - 1);
    let best = model.session.trials.best().map(|trial| trial.trial);
    for (line, trial) in rows.iter().skip(first).take(usize::from(area.height) - 1).enumerate() {
        let selected = selected_trial == Some(trial.trial);
        let style = if selected { theme.style(Role::Selected) } else { Style::new() };
        let area = Rect { y: area.y + 1 + line as u16, height: 1, ..area };
        let later = model.is_later(trial.trial);
        let mark = mark(model, trial.trial);
        let cursor = if selected && model.chooses_row() { ">" } else { " " };
        let number = format!("{cursor}{:>digits$}{mark}", trial.trial);
        let mut spans = vec![span(theme, if later { Role::Quiet } else { Role::Text }, number)];
        for column in &columns {
            let (text, role) = cell(model, trial, column, best == Some(trial.trial));
            let role = if later { Role::Quiet } else { role };
            spans.push(span(theme, role, padded(&text, column.width)));
            spans.push(Span::raw(" "));
        }
        frame.render_widget(Line::from(spans).style(style), area);
    }
}

fn padded(text: &str, width: usize) -> String {
    let text = truncate(text, width);
    // The last column takes the rest of the line and needs no filling.
    let filling = if width > 40 { 0 } else { width.saturating_sub(columns(&text)) };
    text + &" ".repeat(filling)
}

/// The text in place of the rows: before the first trial, the keys of a trial.
fn render_empty(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    if !model.session.trials.records.is_empty() {
        return frame.render_widget(Line::from(span(theme, Role::Quiet, "     no trial passes the filter")), area);
    }
    if model.replay.is_some() || model.session.info.observe {
        return frame.render_widget(Line::from(span(theme, Role::Quiet, "     no trial yet")), area);
    }
    let step = |number: &str, keys: &[(Action, &str)]| {
        let mut spans = vec![span(theme, Role::Quiet, format!("   {number} "))];
        for (action, text) in keys {
            spans.push(span(theme, Role::Key, model.keymap.all_keys(*action)));
            spans.push(span(theme, Role::Quiet, format!(" {text}   ")));
        }
        Line::from(spans)
    };
    let judge = [(Action::Accept, "accept"), (Action::Fall, "fall"), (Action::Void, "void"), (Action::Rerun, "re-run")];
    let session = &model.session;
    let arm = match session.info.is_hardware() {
        true => format!("arm: type {}, it stands up", session.arming_confirmation()),
        false if session.jumps_without_question() => "arm: it stands up and jumps".to_owned(),
        false => "arm: it stands up".to_owned(),
    };
    let approve = match session.info.is_hardware() {
        true => {
            let again = model.keymap.key(Action::Approve);
            format!("approve the jump; y: the area is clear; {again}: countdown and jump")
        }
        false => Action::Approve.info().help.to_owned(),
    };
    let lines = vec![
        step("before", &[(Action::Arm, &arm), (Action::Override, "override"), (Action::Skip, "skip")]),
        step("jump  ", &[(Action::Approve, &approve)]),
        step("after ", &[&judge[..], &[(Action::Undo, "undo")]].concat()),
        step(
            "always",
            &[(Action::Stop, "STOP: damp all motors at once"), (Action::Quit, "quit"), (Action::Help, "all keys")],
        ),
    ];
    frame.render_widget(Paragraph::new(lines), area);
}

fn cell(model: &Model, trial: &TrialRecord, column: &ShownColumn, best: bool) -> (String, Role) {
    let (symbol, role) = sign(trial.verdict);
    let column = match &column.cell {
        CellContent::Parameter(name) => {
            let value = trial.parameters.get(name);
            return (format!("{:>7}", value.map_or("-".to_owned(), number)), Role::Text);
        }
        CellContent::Of(column) => *column,
        CellContent::NewValue => {
            let value = model.rejudged.as_ref().and_then(|table| table.value(trial.trial));
            return (format!("{:>9}", value.map_or("-".to_owned(), number)), Role::Text);
        }
        CellContent::NewVerdict => {
            let Some(again) = model.rejudged.as_ref().and_then(|table| table.trials.get(&trial.trial)) else {
                return (String::new(), Role::Quiet);
            };
            let (symbol, role) = sign(again.new.verdict);
            let changed = if again.old.verdict == again.new.verdict { "" } else { " !" };
            return (format!("{symbol} {}{changed}", again.new.verdict.map_or("open", Verdict::name)), role);
        }
    };
    match column {
        Column::Parameters => (String::new(), Role::Text),
        Column::Dx | Column::Dy | Column::Yaw | Column::Rise | Column::Air => {
            (format!("{:>7}", measured_number(trial, column)), Role::Text)
        }
        Column::Value => {
            let hand = if value_is_by_hand(trial) { "h" } else { " " };
            (format!("{:>8}{hand}", trial.value.map_or("-".to_owned(), number)), Role::Text)
        }
        Column::Verdict => {
            let verdict = match (trial.verdict, trial.suggested) {
                (Some(verdict), _) => trial.verdict_name().unwrap_or(verdict.name()).to_owned(),
                (None, Some(suggested)) => format!("{}?", suggested.name()),
                (None, None) => "runs".to_owned(),
            };
            let text = match (verdict.len() > 7, best) {
                (false, true) => format!("{symbol} {verdict:<7}*"),
                // The column has no room behind it.
                (true, true) => format!("* {verdict}"),
                (_, false) => format!("{symbol} {verdict}"),
            };
            (text, role)
        }
        Column::JudgedBy => (trial.judged_by.map_or("", JudgedBy::name).to_owned(), Role::Quiet),
        Column::Source => (trial.origin(), Role::Quiet),
        Column::Risk => {
            let risk = trial.risk.filter(|risk| risk.neighbours > 0);
            (risk.map_or("-".to_owned(), |risk| format!("{}/{}", risk.falls, risk.neighbours)), Role::Quiet)
        }
        Column::Time => {
            let begun = model.session.trials.ran.get(&trial.trial).map(|ran| clock(ran.begun_ns));
            (format!("{:>6}", begun.unwrap_or("-".to_owned())), Role::Quiet)
        }
        Column::Cause => (remark(trial), Role::Quiet),
    }
}

//! Dialogs over the view. A dialog stays inside the view's area: the frame, the message and the next step remain visible.
//!
//! ```text
//!          ┌ Jump? ──────────────────────────────────────────┐
//!          │ Trial 8: f0 1.243 Hz, Fx 118.2 N, Fz 243.9 N    │
//!          │ Is the area clear of people and objects?        │
//!          │                                                 │
//!          │ [Cancel: Enter]     g jump                      │
//!          └─────────────────────────────────────────────────┘
//! ```

use quadfrog::session::operator_request::OperatorCheck;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Task, counted, six_digits};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::symbols::border;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph};
use tui_input::Input;

use super::draw::{columns, number, scale, span, truncate};
use super::questions::last_verdict_stays;
use super::{log, questions, queue};
use crate::action::Action;
use crate::layout::MIN_COLUMNS;
use crate::legal::palette;
use crate::model::Model;
use crate::model::dialog::{APPROVAL_PAUSE, Choice, Dialog, MAX_WIDTH, OverrideForm, Problem, Purpose};
use crate::text::range_example;
use crate::theme::{Glyphs, Role, Theme};
use crate::wrap::{wrap, wrap_all};
use crate::{arming, details, help};

/// Columns before the text of an action: its key and its name.
const PALETTE_INDENT: usize = 26;

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let Some(dialog) = &model.dialog else { return };
    match dialog {
        Dialog::Approve { trial, pressed_at, area_clear, .. } => {
            let waited = model.clock.saturating_sub(*pressed_at) >= APPROVAL_PAUSE;
            popup(frame, area, model, "Jump?", 72, questions::approve(model, *trial, waited, *area_clear));
        }
        Dialog::TakeControl => popup(frame, area, model, "Take control?", 66, questions::take_control(model)),
        Dialog::Arm { typed, .. } => popup(frame, area, model, "Arm?", 60, questions::arm(model, *typed)),
        Dialog::ArmingChecks { selected, scroll } => render_checks(frame, area, model, *selected, *scroll),
        Dialog::Confirm(question) => {
            let (title, lines) = questions::confirm(model, question);
            popup(frame, area, model, title, 66, lines);
        }
        Dialog::Export { shown, all } => {
            popup(frame, area, model, "Export", 66, questions::export(model, *shown, *all))
        }
        Dialog::Quit => popup(frame, area, model, "Quit?", 58, questions::quit(model)),
        Dialog::Override(form) => {
            // The whole width of the smallest terminal: nothing of the view stands beside it there.
            let lines = overrides(model, form, usize::from(area.width.min(MIN_COLUMNS).saturating_sub(4)));
            text_box(frame, area, model, &format!("Override trial #{}", form.trial), lines)
        }
        Dialog::Field { purpose, input, replaces, problem } => {
            let lines = field(model, *purpose, (input, *replaces), problem.as_ref());
            text_box(frame, area, model, &field_title(model, *purpose), lines);
        }
        Dialog::Palette { input, selected } => render_palette(frame, area, model, input, *selected),
        Dialog::Choose { subject, selected } => render_choice(frame, area, model, *subject, *selected),
        Dialog::Queue { selected } => {
            // Within the border and its margins.
            let width = usize::from(area.width.min(MAX_WIDTH).saturating_sub(4));
            let (lines, of_selected) = queue::lines(model, model.session.queue_row(*selected), width);
            // The selected point stays in sight.
            let scroll = (of_selected.end + 2).saturating_sub(usize::from(area.height));
            render_lines(frame, area, model, ("Queue", MAX_WIDTH, "Up Down Home End"), lines, scroll);
        }
        Dialog::Help { scroll } => {
            let width = area.width.min(MAX_WIDTH);
            let lines = wrap_all(&help::lines(model), usize::from(width.saturating_sub(4)), help::INDENT);
            render_lines(frame, area, model, ("Keys", width, "Up Down Home End"), lines, *scroll)
        }
        Dialog::Report { lines, scroll } => {
            let width = area.width.min(MAX_WIDTH);
            // The terminal may have become narrower since.
            let lines: Vec<Line> = lines.iter().cloned().map(Line::from).collect();
            let lines = wrap_all(&lines, usize::from(width.saturating_sub(4)), 0);
            render_lines(frame, area, model, ("Study", width, "Up Down Home End"), lines, *scroll);
        }
        Dialog::Details { trial, scroll } => render_details(frame, area, model, *trial, *scroll),
        Dialog::LogLine { scroll } => {
            // Margins on both sides, and a readable length of a line.
            let width = area.width.saturating_sub(4).min(120);
            let Some(lines) = log::whole_line(model, usize::from(width.saturating_sub(4))) else { return };
            let rows = u16::try_from(lines.len()).unwrap_or(u16::MAX);
            let inner = open_box(frame, area, model, "Line of the log", width, rows.saturating_add(2).min(area.height));
            let scroll = (*scroll).min(lines.len().saturating_sub(usize::from(inner.height)));
            frame.render_widget(Paragraph::new(lines.into_iter().skip(scroll).collect::<Vec<_>>()), inner);
        }
    }
}

/// The arming checks, each whole; those of the operator can be selected.
fn render_checks(frame: &mut Frame, area: Rect, model: &Model, selected: usize, scroll: usize) {
    let width = area.width.min(MAX_WIDTH);
    let chosen = OperatorCheck::ALL.get(selected).copied().filter(|_| model.session.info.is_hardware());
    let (lines, of_chosen) = arming::whole(model, usize::from(width.saturating_sub(4)), chosen);
    let room = usize::from(area.height.saturating_sub(2));
    // Until the list is paged, the chosen item is visible.
    let scroll = scroll.checked_sub(1).unwrap_or(of_chosen.end.saturating_sub(room));
    let title = arming::title(model, area.width < MIN_COLUMNS);
    render_lines(frame, area, model, (&title, width, "PgUp PgDn Home End"), lines, scroll);
}

/// The details of a trial; the paging keys scroll.
fn render_details(frame: &mut Frame, area: Rect, model: &Model, trial: u32, scroll: usize) {
    let Some(record) = model.final_row(trial) else { return };
    let width = area.width.min(MAX_WIDTH);
    let lines = details::lines(model, trial, usize::from(width.saturating_sub(4))).unwrap_or_default();
    let at_playhead = model.session.trials.records.get(&trial);
    let time = if at_playhead == Some(record) { "" } else { ", at the end of the recording" };
    render_lines(frame, area, model, (&format!("Trial #{trial}{time}"), width, "PgUp PgDn Home End"), lines, scroll);
}

/// Draws an empty bordered box; returns its inside. Where Space types although the robot is energised, the frame has the
/// colour of STOP and names the keys that stop.
fn open_box(frame: &mut Frame, area: Rect, model: &Model, title: &str, width: u16, height: u16) -> Rect {
    let theme = &model.theme;
    const ASCII: border::Set = border::Set {
        top_left: "+",
        top_right: "+",
        bottom_left: "+",
        bottom_right: "+",
        vertical_left: "|",
        vertical_right: "|",
        horizontal_top: "-",
        horizontal_bottom: "-",
    };
    let set = if theme.glyphs == Glyphs::Ascii { ASCII } else { border::PLAIN };
    let (width, height) = (width.min(area.width), height.min(area.height));
    let at = Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    let role = if model.space_bar_is_text_while_energised() { Role::Alarm } else { Role::Heading };
    let title = span(theme, role, format!(" {title} "));
    let mut block = Block::bordered().border_set(set).border_style(theme.style(role)).title(title);
    if model.space_bar_is_text_while_energised() {
        block = block.title_bottom(span(theme, role, " Space types here. STOP: F12 or Ctrl-C "));
    }
    let inner = block.inner(at);
    frame.render_widget(Clear, at);
    frame.render_widget(block, at);
    Rect { x: inner.x + 1, width: inner.width.saturating_sub(2), ..inner }
}

/// Draws a box that is at least `width` wide, and wider for a longer line as far as the terminal goes.
fn popup(frame: &mut Frame, area: Rect, model: &Model, title: &str, width: u16, lines: Vec<Line<'static>>) {
    let longest = lines.iter().map(Line::width).max().unwrap_or(0) as u16 + 4;
    let width = longest.clamp(width, MAX_WIDTH.max(width)).min(area.width);
    fixed_box(frame, area, model, (title, width), &lines);
}

/// Draws a box in which text is typed: as wide as the smallest terminal, whatever is typed or answered.
fn text_box(frame: &mut Frame, area: Rect, model: &Model, title: &str, lines: Vec<Line<'static>>) {
    fixed_box(frame, area, model, (title, MIN_COLUMNS.min(area.width)), &lines);
}

fn fixed_box(frame: &mut Frame, area: Rect, model: &Model, (title, width): (&str, u16), lines: &[Line]) {
    let mut lines = wrap_all(lines, usize::from(width.saturating_sub(4)), 0);
    if lines.len() + 2 > usize::from(area.height) {
        // Room for every sentence.
        lines.retain(|line| line.width() > 0);
    }
    let inner = open_box(frame, area, model, title, width, lines.len() as u16 + 2);
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Columns of a value of the form, and of its place between its bounds.
const VALUE_WIDTH: usize = 8;
const SCALE_WIDTH: usize = 14;

/// The rows of the form; a number that is typed takes what the rest of its row leaves of `width` columns.
fn overrides(model: &Model, form: &OverrideForm, width: usize) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let mut lines = Vec::new();
    for (index, row) in form.rows.iter().enumerate() {
        if row.gain && !form.rows[index.saturating_sub(1)].gain {
            lines.push(Line::from(span(theme, Role::Quiet, "  gains, for this trial alone; its J counts")));
        }
        let selected = index == form.selected;
        let symbol = if selected { ">" } else { " " };
        let mut spans =
            vec![span(theme, if selected { Role::Key } else { Role::Text }, format!("{symbol} {:<8}", row.name))];
        let mut after = vec![
            span(theme, Role::Quiet, format!(" {:<9}", row.unit)),
            span(theme, Role::Quiet, format!(" {:>6} ", number(row.low))),
            span(theme, Role::Quiet, scale(theme, row.value, row.low, row.high, SCALE_WIDTH)),
            span(theme, Role::Quiet, format!(" {:<6}", number(row.high))),
        ];
        if row.value != row.before {
            let was = format!(" was {}", number(row.before));
            let others: usize = spans.iter().chain(&after).map(Span::width).sum();
            match others + VALUE_WIDTH + was.len() <= width {
                true => after.push(span(theme, Role::Warning, was)),
                // In place of the scale: a second line of the row would have no room.
                false => after[2] = span(theme, Role::Warning, format!("{was:^SCALE_WIDTH$}")),
            }
        }
        match &form.typing {
            Some(input) if selected => {
                let others: usize = spans.iter().chain(&after).map(Span::width).sum();
                let room = width.saturating_sub(others).max(VALUE_WIDTH);
                // As wide as the number that it replaces, so that the line does not shift.
                let typed = match form.replaces && columns(input.value()) <= room {
                    true => vec![span(theme, Role::Selected, input.value())],
                    false => edited_within(theme, input, room),
                };
                let columns = typed.iter().map(Span::width).sum();
                spans.push(Span::raw(" ".repeat(VALUE_WIDTH.saturating_sub(columns))));
                spans.extend(typed);
            }
            _ => spans.push(Span::raw(format!("{:>VALUE_WIDTH$}", number(row.value)))),
        }
        spans.extend(after);
        lines.push(Line::from(spans));
    }
    let note = "This does not move the robot: it is approved like any other proposal.";
    let below = match (&form.problem, &form.dropped) {
        (Some(problem), _) => span(theme, Role::Bad, problem.text.as_str()),
        (None, Some(number)) => span(theme, Role::Warning, dropped(number, form)),
        (None, None) => span(theme, Role::Quiet, note),
    };
    lines.extend([Line::default(), Line::from(below)]);
    lines
}

/// The number of the form that Esc has dropped, and the effect of the next Esc.
fn dropped(typed: &str, form: &OverrideForm) -> String {
    let value = form
        .rows
        .get(form.selected)
        .map_or(String::new(), |row| format!("{} stays {} {}", row.name, number(row.value), row.unit));
    let what = if typed.is_empty() { "Nothing was typed".to_owned() } else { format!("{typed} was dropped") };
    let values = if form.is_changed() { "closes the form and drops its values" } else { "closes the form" };
    format!("{what}: {value}. Esc again {values}.")
}

fn edited(theme: &Theme, input: &Input) -> Vec<Span<'static>> {
    edited_within(theme, input, usize::MAX)
}

/// The text with its cursor; of one longer than `room` columns the part around the cursor, with `<` and `>` for the rest.
fn edited_within(theme: &Theme, input: &Input, room: usize) -> Vec<Span<'static>> {
    let text: Vec<char> = input.value().chars().collect();
    let at = input.cursor().min(text.len());
    let columns_of = |c: &char| columns(c.encode_utf8(&mut [0; 4]));
    let mut used = text.get(at).map_or(1, columns_of);
    let mut fits = |c: &&char| {
        let columns = columns_of(c);
        let fits = used + columns <= room;
        used += if fits { columns } else { 0 };
        fits
    };
    let first = at - text[..at].iter().rev().take_while(&mut fits).count();
    let end = (at + 1 + text.iter().skip(at + 1).take_while(&mut fits).count()).min(text.len());
    let (cut_before, cut_behind) = (first > 0, at + 1 < end && end < text.len());
    let part = |from: usize, to: usize| text.get(from..to).unwrap_or_default().iter().collect::<String>();
    let rest = |cut: bool, sign: &'static str| span(theme, Role::Quiet, if cut { sign } else { "" });
    vec![
        rest(cut_before, "<"),
        Span::raw(part(first + usize::from(cut_before), at)),
        span(theme, Role::Selected, text.get(at).map_or(" ".to_owned(), char::to_string)),
        Span::raw(part(at + 1, end - usize::from(cut_behind))),
        rest(cut_behind, ">"),
    ]
}

fn field_title(model: &Model, purpose: Purpose) -> String {
    match purpose {
        Purpose::Note(trial) => format!("Note on trial #{trial}"),
        Purpose::HandValue(trial) => format!("Trial #{trial}, measured by hand"),
        Purpose::Continue => "How many more trials?".to_owned(),
        Purpose::Fix { parameter, value } => {
            let info = model.session.info.parameters.get(parameter);
            let (name, unit) = info.map_or(("", ""), |info| (&info.name, &info.unit));
            format!("Fix {name} at {} {unit} for how many trials?", number(value))
        }
        Purpose::Bounds { parameter } => {
            format!("Search {} from .. to", model.session.info.parameters.get(parameter).map_or("", |info| &info.name))
        }
        Purpose::ConfirmBest => "How many repeats at most, to confirm the best?".to_owned(),
        Purpose::VoidReason { trial, .. } => format!("Why is trial #{trial} void?"),
        Purpose::ChangeVerdict { trial, verdict } => {
            let before = model.session.trials.records.get(&trial).and_then(|row| row.verdict_name()).unwrap_or("-");
            format!("Trial #{trial}: {before} becomes {}. Why?", verdict.name())
        }
        Purpose::TrialNumber => "Go to trial".to_owned(),
        Purpose::LogSearch => "Search the log".to_owned(),
        Purpose::Seek => "Go to a time or a trial".to_owned(),
        Purpose::Rejudge => "Judge all trials again by the configuration in".to_owned(),
        Purpose::Beside => {
            let present = model.replay.as_ref().and_then(|replay| replay.present);
            format!("Which trial beside {}?", present.map_or("it".to_owned(), |trial| format!("#{trial}")))
        }
    }
}

fn field(
    model: &Model,
    purpose: Purpose,
    (input, replaces): (&Input, bool),
    problem: Option<&Problem>,
) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let mut spans = match replaces {
        true => vec![span(theme, Role::Selected, input.value())],
        false => edited(theme, input),
    };
    if matches!(purpose, Purpose::HandValue(_)) {
        spans.push(span(theme, Role::Quiet, format!(" {}", model.session.info.unit)));
    }
    let hint = match purpose {
        Purpose::HandValue(trial) => by_hand(model, trial),
        Purpose::Bounds { parameter } => {
            let info = model.session.present_parameter(parameter);
            let searched = info.as_ref().and_then(|info| model.session.searched(&info.name));
            let allowed = searched.map_or(String::new(), |p| {
                format!("; safety.toml allows {} to {}", six_digits(p.least), six_digits(p.most))
            });
            let example = info.as_ref().map_or(String::new(), range_example);
            format!("write it as {example}, without a space{allowed}; past trials stay")
        }
        Purpose::Fix { parameter, .. } => {
            let name = model.session.info.parameters.get(parameter).map_or("it", |info| &info.name);
            format!("the others are still proposed; a trial that is void or has another {name} uses up none")
        }
        Purpose::ConfirmBest => {
            let needed = match model.least_repeats() {
                least if least > 0 => format!("; to compare them takes {}", counted(least, "repeat")),
                _ => String::new(),
            };
            let begins = match model.session.jumps_without_question() {
                true => "the jumps follow without a question, the first at once if the robot stands, and do not",
                false => "each repeat is approved, and does not",
            };
            let last = last_verdict_stays(model).map_or(String::new(), |sentence| format!(" {sentence}"));
            format!("The best points run again until one leads{needed}; {begins} count for the budget.{last}")
        }
        Purpose::LogSearch => "empty: all lines".to_owned(),
        Purpose::Seek if model.space_bar_is_text() => {
            "12:34, 1:02:03.5, 75.5 s, #7 or trial 7, best of the recording, fall".to_owned()
        }
        Purpose::Seek => "12:34, 1:02:03.5, 75.5, #7, best of the recording, fall".to_owned(),
        Purpose::Rejudge => "a folder as for --config; empty: the defaults; the file is not changed".to_owned(),
        Purpose::Beside => match model.timeline.as_ref().and_then(|timeline| timeline.second.as_ref()) {
            Some(second) => format!("its number in {}", second.name),
            None => "its number in this recording".to_owned(),
        },
        purpose if purpose.is_remark() && model.space_bar_must_stop() => {
            "the robot is energised: Space is STOP, _ writes a space".to_owned()
        }
        Purpose::VoidReason { .. } => "it tripped a limit: by the rules that is a fall of its parameters".to_owned(),
        Purpose::ChangeVerdict { trial, verdict } => {
            let key = model.keymap.key(if model.mode() == Mode::Ready { Action::Approve } else { Action::Arm });
            let room = match model.session.makes_room(trial, verdict) {
                true => format!("; the study then has room for a further trial, which waits for {key}"),
                false => String::new(),
            };
            format!("the sampler proposes again from the changed trials; the journal keeps the old verdict{room}")
        }
        Purpose::Continue => {
            let (counted, budget) = (model.session.counted(), model.session.budget());
            format!("1 to 1000, added to the budget of {budget}; {counted} of them count so far")
        }
        Purpose::Note(_) | Purpose::TrialNumber => String::new(),
    };
    let below =
        problem.map_or_else(|| span(theme, Role::Quiet, hint), |problem| span(theme, Role::Bad, problem.text.as_str()));
    vec![Line::from(spans), Line::default(), Line::from(below)]
}

/// Meaning of a value by hand, and the value that the robot has measured.
fn by_hand(model: &Model, trial: u32) -> String {
    let info = &model.session.info;
    let along = match info.task.filter(|task| task.unit() == info.unit) {
        Some(Task::Forward) => "displacement forward, start to rest",
        Some(Task::LateralLeft) => "displacement to the left, start to rest",
        Some(Task::LateralRight) => "displacement to the right, start to rest",
        Some(Task::TwistCcw) => "turn counterclockwise, start to rest",
        Some(Task::TwistCw) => "turn clockwise, start to rest",
        None => "J",
    };
    match model.session.measured_objective_of(trial) {
        Some(value) => format!("{along}; the robot measured {} {}; empty: back to that", number(value), info.unit),
        None => format!("{along}; the robot measured nothing"),
    }
}

fn render_palette(frame: &mut Frame, area: Rect, model: &Model, input: &Input, selected: Option<Action>) {
    let theme = &model.theme;
    let actions = palette(input.value(), model);
    let number = actions.iter().position(|(info, _)| Some(info.action) == selected).map_or(0, |at| at + 1);
    let title = format!("Actions ({number} of {}, Up Down PgUp PgDn Home End)", actions.len());
    let inner = open_box(frame, area, model, &title, area.width.min(MAX_WIDTH), area.height.min(24));
    let mut spans = vec![span(theme, Role::Key, ":")];
    spans.extend(edited(theme, input));
    frame.render_widget(Line::from(spans), Rect { height: 1, ..inner });
    let list = Rect { y: inner.y + 2, height: inner.height.saturating_sub(2), ..inner };
    let mut lines = Vec::new();
    let mut end_of_selected = 0;
    for (info, legal) in actions {
        let selected = Some(info.action) == selected;
        let (key, name) = (model.keymap.key(info.action), info.name);
        let text = match &legal {
            Ok(()) => help::text_of(info, model).to_owned(),
            Err(reason) => format!("({reason})"),
        };
        let role = if legal.is_ok() { Role::Text } else { Role::Quiet };
        let style = if selected { theme.style(Role::Selected) } else { theme.style(role) };
        let row = Line::from(Span::styled(format!("{key:<9} {name:<16}{text}"), style));
        lines.extend(wrap(&row, usize::from(list.width), PALETTE_INDENT));
        if selected {
            end_of_selected = lines.len();
        }
    }
    if lines.is_empty() {
        lines.push(Line::from(span(theme, Role::Quiet, "no action matches")));
    }
    // The selected action stays in sight.
    let first = end_of_selected.saturating_sub(usize::from(list.height));
    frame.render_widget(Paragraph::new(lines.into_iter().skip(first).collect::<Vec<_>>()), list);
}

fn render_choice(frame: &mut Frame, area: Rect, model: &Model, subject: Choice, selected: usize) {
    let theme = &model.theme;
    let title = match subject {
        Choice::Series => "Series of the charts",
        Choice::Columns => "Columns of the trial table",
    };
    let rows = model.choices(subject);
    let name_width = rows.iter().map(|(name, ..)| name.chars().count()).max().unwrap_or_default().max(11);
    // A terminal that is too low shows the lines around the chosen one.
    let room = usize::from(area.height.saturating_sub(2)).min(rows.len());
    let first = (selected + 1).saturating_sub(room);
    let title = match rows.len() > room {
        true => format!("{title} ({}-{} of {}, Up Down Home End)", first + 1, first + room, rows.len()),
        false => title.to_owned(),
    };
    // The symbol, two spaces, the border and its margins.
    let longest = rows.iter().map(|(_, help, _)| name_width + help.chars().count() + 9).max().unwrap_or_default();
    let width = (longest as u16).clamp(66, MAX_WIDTH).min(area.width);
    let inner = open_box(frame, area, model, &title, width, rows.len() as u16 + 2);
    for (line, (index, (name, help, on))) in
        rows.iter().enumerate().skip(first).take(usize::from(inner.height)).enumerate()
    {
        let area = Rect { y: inner.y + line as u16, height: 1, ..inner };
        let symbol = if *on { "[x]" } else { "[ ]" };
        let text = truncate(&format!("{symbol} {name:<name_width$} {help}"), usize::from(inner.width));
        let role = match (index == selected, on) {
            (true, _) => Role::Selected,
            (false, true) => Role::Text,
            (false, false) => Role::Quiet,
        };
        frame.render_widget(Line::from(span(theme, role, text)), area);
    }
}

/// Draws lines that scroll in a box with a title and a width; `keys` scroll.
fn render_lines(
    frame: &mut Frame,
    area: Rect,
    model: &Model,
    (title, width, keys): (&str, u16, &str),
    lines: Vec<Line>,
    scroll: usize,
) {
    let height = usize::from(area.height).min(lines.len() + 2) as u16;
    let room = usize::from(height.saturating_sub(2));
    let scroll = scroll.min(lines.len().saturating_sub(room));
    let shown = format!("{}-{} of {}", scroll + 1, scroll + room, lines.len());
    // Within the corners and the spaces beside the title; the line below names the keys, too.
    let fits = |title: &String| columns(title) + 4 <= usize::from(width.min(area.width));
    let title = match lines.len() > room {
        true => Some(format!("{title} ({shown}, {keys})")).filter(fits).unwrap_or(format!("{title} ({shown})")),
        false => title.to_owned(),
    };
    let inner = open_box(frame, area, model, &title, width, height);
    let shown: Vec<Line> = lines.into_iter().skip(scroll).take(room).collect();
    frame.render_widget(Paragraph::new(shown), inner);
}

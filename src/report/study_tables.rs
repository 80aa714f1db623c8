//! Tables of studies.

use super::page::{Cell, Column, Table};
use super::study::{ReportedStudy, StudyGroup, mean_and_deviation};
use super::study_figures::DrawnTrial;
use crate::robot::JOINT_NAMES;
use crate::trial::{Task, TrialRecord, Verdict, counted as in_words, parameter_unit};

/// Numbers of trials at which the best so far is listed.
const CHECKPOINTS: [usize; 6] = [5, 10, 20, 50, 100, 200];

/// Mark of a value that was measured by hand, as in the console.
const BY_HAND: &str = "h";

/// Decimal places of a parameter: about four significant digits of its largest value, of its smallest where its range is several powers
/// of ten.
fn digits(low: f64, high: f64) -> usize {
    let most = low.abs().max(high.abs());
    let size = if low > 0.0 && high / low >= 1000.0 { low } else { most };
    match size {
        _ if size >= 1000.0 => 0,
        _ if size >= 10.0 => 1,
        _ if size >= 0.1 || size == 0.0 => 3,
        _ => 2 + (-size.log10()).ceil() as usize,
    }
}

fn parameter_columns(study: &ReportedStudy) -> impl Iterator<Item = Column> {
    study.parameters.iter().map(|parameter| Column::number(parameter.name.clone(), parameter.unit.clone()))
}

fn parameter_cells(study: &ReportedStudy, row: &TrialRecord) -> impl Iterator<Item = Cell> {
    study.parameters.iter().map(|p| Cell::optional(row.parameters.get(&p.name), digits(p.low, p.high)))
}

/// The value of a trial, marked where it was measured by hand.
fn value(row: &TrialRecord) -> Cell {
    Cell::optional(row.value, 3).marked(if row.counts_by_hand() { BY_HAND } else { "" })
}

/// Returns the end of a caption that explains the mark, where one of the trials has it.
fn explained<'a>(mut rows: impl Iterator<Item = &'a TrialRecord>) -> String {
    if rows.any(TrialRecord::counts_by_hand) { format!(" {BY_HAND}: measured by hand.") } else { String::new() }
}

/// Studies with counts of their trials and their best values. The unit is in the header where all have the same one: the
/// table fits a terminal of 80 columns.
pub fn studies(studies: &[ReportedStudy]) -> Table {
    let unit = studies.first().map_or("", |study| &study.unit);
    let several_units = studies.iter().any(|study| study.unit != unit);
    let counts = ["trials", "accepted", "falls", "repeats", "void"].map(|name| Column::number(name, ""));
    let columns = [Column::text("study")].into_iter().chain(counts);
    let columns = columns.chain([Column::number("best J", if several_units { "" } else { unit })]);
    let columns = columns.chain(several_units.then(|| Column::text("unit"))).chain([Column::number("trial", "")]);
    let sum = |count: fn(&ReportedStudy) -> usize| studies.iter().map(count).sum::<usize>();
    let (trials, counted) = (sum(|study| study.trials().count()), sum(|study| study.counted().count()));
    let waiting = sum(|study| study.trials().filter(|row| row.verdict.is_none()).count());
    let waiting = if waiting > 0 { format!(", {waiting} without a verdict") } else { String::new() };
    let caption = format!(
        "Studies. {}, {counted} counted{waiting}: repeats that confirm the best and void trials do not count. A proposal that \
         was not run is no trial.{}",
        in_words(trials, "trial"),
        explained(studies.iter().filter_map(ReportedStudy::best_row))
    );
    let mut table = Table::new(caption, columns);
    for study in studies {
        let counted = |verdict| Cell::count(study.counted().filter(|row| row.verdict == Some(verdict)).count());
        let repeats = study.rows.iter().filter(|row| row.confirms_best());
        let best = study.best_row();
        let cells = [
            Cell::text([title(study), study.robot.clone()].join(", ").trim_end_matches(", ")),
            Cell::count(study.trials().count()),
            counted(Verdict::Accept),
            counted(Verdict::Fall),
            Cell::count(repeats.count()),
            Cell::count(study.with(Verdict::Void).count()),
            best.map_or(Cell::Missing, value),
        ];
        let unit = several_units.then(|| Cell::text(study.unit.clone()));
        let trial = best.map_or(Cell::Missing, |row| Cell::count(row.trial as usize));
        table.rows.push(cells.into_iter().chain(unit).chain([trial]).collect());
    }
    table
}

/// Task and seed, or the name of a study of another program.
pub fn title(study: &ReportedStudy) -> String {
    study.task.map_or_else(|| study.name.clone(), |task| format!("{}, {}", task.name(), study.label()))
}

/// Best so far after some numbers of trials, mean and deviation over the studies of each group; none without a trial that counts.
pub fn checkpoints(groups: &[StudyGroup]) -> Option<Table> {
    let studies = || groups.iter().flat_map(|group| &group.studies);
    let longest = studies().map(|study| study.best_so_far().len()).max().filter(|longest| *longest > 0)?;
    let mut at: Vec<usize> = CHECKPOINTS.into_iter().filter(|count| *count < longest).collect();
    at.push(longest);
    let columns = [Column::text("task"), Column::number("studies", "")].into_iter();
    let columns = columns.chain(at.iter().map(|count| Column::number(in_words(*count, "trial"), "")));
    let caption = format!(
        "Best value of a single trial so far: mean and standard deviation over the studies, in the unit of J.{}",
        explained(studies().flat_map(|study| study.best_so_far_rows()).flatten())
    );
    let mut table = Table::new(caption, columns);
    for group in groups {
        let curves: Vec<Vec<_>> = group.studies.iter().map(|study| study.best_so_far_rows().collect()).collect();
        let cell = |count: &usize| {
            let at = |curve: &Vec<Option<&TrialRecord>>| {
                let best = curve.get(*count - 1).copied().flatten()?;
                Some((best.value.filter(|value| value.is_finite())?, best.counts_by_hand()))
            };
            let best: Option<Vec<(f64, bool)>> = curves.iter().map(at).collect();
            best.filter(|best| !best.is_empty()).map_or(Cell::Missing, |best| {
                let (values, by_hand): (Vec<f64>, Vec<bool>) = best.into_iter().unzip();
                let (mean, deviation) = mean_and_deviation(&values);
                let spread = if values.len() > 1 { format!(" +- {deviation:.3}") } else { String::new() };
                let mark = if by_hand.contains(&true) { format!(" {BY_HAND}") } else { String::new() };
                Cell::text(format!("{mean:.3}{spread}{mark}"))
            })
        };
        let cells = [Cell::text(group.name_with_unit()), Cell::count(group.studies.len())].into_iter();
        let cells = cells.chain(at.iter().map(cell));
        table.rows.push(cells.collect());
    }
    Some(table)
}

/// Agreement of the expectations of the sampler's model with the results; none without an expectation.
pub fn expectations(studies: &[&ReportedStudy]) -> Option<Table> {
    let unit = studies[0].unit.as_str();
    let columns = [
        Column::text("study"),
        Column::number("trials", ""),
        Column::number("J - expected, mean", unit),
        Column::number("root mean square", unit),
        Column::number("expected falls", ""),
        Column::number("falls", ""),
    ];
    let caption = "Trials with an expectation: difference of the value of those accepted and the expected one, sum of their \
                   probabilities of a fall, and the falls.";
    let mut table = Table::new(caption, columns);
    for study in studies {
        let trials = study.expecting().count();
        if trials == 0 {
            continue;
        }
        let accepted = study.expecting().filter(|(row, _)| row.verdict == Some(Verdict::Accept));
        let errors: Vec<f64> = accepted.filter_map(|(row, expected)| Some(row.value? - expected.value)).collect();
        let (mean, _) = mean_and_deviation(&errors);
        let (square, _) = mean_and_deviation(&errors.iter().map(|error| error * error).collect::<Vec<_>>());
        let some = |value: f64| Cell::optional(Some(value).filter(|value| value.is_finite()), 3);
        table.rows.push(vec![
            Cell::text(study.label()),
            Cell::count(trials),
            some(mean),
            some(square.sqrt()),
            Cell::number(study.expecting().map(|(_, expected)| 1.0 - expected.p_stand).sum(), 1),
            Cell::count(study.expecting().filter(|(row, _)| row.verdict == Some(Verdict::Fall)).count()),
        ]);
    }
    (!table.rows.is_empty()).then_some(table)
}

/// The best trial of each study of a group.
pub fn best(StudyGroup { name, studies: group }: &StudyGroup) -> Table {
    let columns = [Column::text("study"), Column::number("trial", ""), Column::number("J", group[0].unit.as_str())];
    let by_model = group.iter().any(|study| study.model_best.is_some());
    let model = ["mean by the model", "deviation"].map(|label| Column::number(label, group[0].unit.as_str()));
    let columns = columns.into_iter().chain(model.into_iter().filter(|_| by_model));
    let columns = columns.chain(parameter_columns(group[0])).chain([
        Column::number("dx", "m"),
        Column::number("dy", "m"),
        Column::number("dyaw", "rad"),
        Column::number("rise", "m"),
        Column::number("air", "s"),
    ]);
    let chosen = if by_model {
        " With a model of the sampler the best one by this model: a single jump may be luck."
    } else {
        ""
    };
    let by_hand = explained(group.iter().filter_map(|study| study.best_row()));
    let mut table = Table::new(format!("Best trial of each study, {name}.{chosen}{by_hand}"), columns);
    for study in group {
        let Some(row) = study.best_row() else { continue };
        let own = parameter_cells(group[0], row);
        let cells = [Cell::text(study.label()), Cell::count(row.trial as usize), value(row)];
        let best = study.model_best;
        let model = [best.map(|best| best.value), best.map(|best| best.deviation)];
        let model = model.into_iter().filter(|_| by_model).map(|value| Cell::optional(value, 3));
        table.rows.push(cells.into_iter().chain(model).chain(own).chain(measured(row)).collect());
    }
    table
}

fn measured(row: &TrialRecord) -> [Cell; 5] {
    let jump = row.measured.as_ref();
    [
        Cell::optional(jump.map(|jump| jump.dx_m), 3),
        Cell::optional(jump.map(|jump| jump.dy_m), 3),
        Cell::optional(jump.map(|jump| jump.dyaw_rad), 3),
        Cell::optional(jump.map(|jump| jump.apex_m), 3),
        Cell::optional(jump.map(|jump| jump.air_s), 3),
    ]
}

/// The jumps of the drawn trials of several jumps in a row; none without such a trial.
pub fn jumps(study: &ReportedStudy, drawn: &[DrawnTrial]) -> Option<Table> {
    let numbers =
        [("start", "s"), ("x", "m"), ("y", "m"), ("yaw", "rad"), ("tilt", "rad"), ("rise", "m"), ("air", "s")];
    let columns = [Column::text("trial"), Column::number("jump", "")].into_iter();
    let columns = columns.chain(numbers.map(|(name, unit)| Column::number(name, unit)));
    let columns = columns.chain([Column::number("value", study.task.map_or("", Task::unit))]);
    let caption = "Jumps in a row: time, position, turn and tilt at the start of each impulse; rise, longest flight and \
                   share of the objective up to the next.";
    let mut table = Table::new(caption, columns);
    for trial in drawn {
        let jumps = trial.row.measured.iter().flat_map(|measured| &measured.jumps);
        let several = trial.row.measured.as_ref().is_some_and(|measured| measured.jumps.len() > 1);
        for (index, jump) in jumps.enumerate().filter(|_| several) {
            let numbers =
                [jump.time_s, jump.x_m, jump.y_m, jump.yaw_rad, jump.tilt_rad, jump.rise_m, jump.air_s, jump.value];
            let cells = [Cell::text(trial.label.clone()), Cell::count(index + 1)].into_iter();
            table.rows.push(cells.chain(numbers.map(|number| Cell::number(number, 3))).collect());
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// Take-off, torque and power of the drawn trials; none without ticks.
pub fn takeoff(study: &ReportedStudy, drawn: &[DrawnTrial]) -> Option<Table> {
    let kinds = |what: &str, unit: &str| JOINT_NAMES.map(|name| Column::number(format!("{what} {name}"), unit));
    let columns = [
        Column::text("trial"),
        Column::number("take-off", "s"),
        Column::number("speed", "m/s"),
        Column::number("angle of v", "deg"),
        Column::number("angle of F", "deg"),
    ];
    let columns = columns.into_iter().chain(kinds("push torque", "N m")).chain(kinds("landing torque", "N m"));
    let columns = columns.chain([Column::number("push power", "W"), Column::number("joint power", "W")]);
    let caption = "Take-off, peak torque of each kind of joint before and after it, largest sum of positive joint powers \
                   and largest power of one joint before it.";
    let mut table = Table::new(caption, columns);
    for trial in drawn {
        let Some(jump) = study.recorded(trial.row.trial).and_then(|recorded| recorded.quantities) else { continue };
        let mut cells = vec![
            Cell::text(trial.label.clone()),
            Cell::number(jump.takeoff_s, 3),
            Cell::number(jump.takeoff_speed_m_s, 2),
            Cell::number(jump.takeoff_angle_rad.to_degrees(), 1),
            Cell::optional(study.force_angle_rad(trial.row).map(f64::to_degrees), 1),
        ];
        cells.extend(jump.push_torque_n_m.iter().chain(&jump.landing_torque_n_m).map(|value| Cell::number(*value, 1)));
        cells.push(Cell::number(jump.push_power_w, 0));
        cells.push(Cell::number(jump.joint_power_w.iter().copied().fold(0.0, f64::max), 0));
        table.rows.push(cells);
    }
    (!table.rows.is_empty()).then_some(table)
}

/// All trials of a study.
pub fn trials(study: &ReportedStudy) -> Table {
    let expects = study.expecting().next().is_some();
    let expected = [Column::number("expected J", study.unit.as_str()), Column::number("P(stand)", "")];
    let columns = [Column::number("trial", "")].into_iter().chain(parameter_columns(study));
    let columns = columns.chain(expected.into_iter().filter(|_| expects)).chain([
        Column::number("J", study.unit.as_str()),
        Column::number("dx", "m"),
        Column::number("dy", "m"),
        Column::number("dyaw", "rad"),
        Column::number("rise", "m"),
        Column::number("air", "s"),
        Column::text("verdict"),
    ]);
    // A study of an earlier version has no origins of its verdicts.
    let origins = study.rows.iter().any(|row| row.judged_by.is_some());
    let known = !study.recordings.files.is_empty();
    let columns = columns.chain(origins.then(|| Column::text("judged by"))).chain([Column::text("source")]);
    let columns = columns.chain(known.then(|| Column::text("ticks")));
    let mut table = Table::new(format!("Trials of {}.", title(study)), columns);
    for row in &study.rows {
        let mut verdict = row.verdict_name().unwrap_or("not judged").to_owned();
        for (holds, text) in [(row.counts_by_hand(), ", J by hand"), (study.best == Some(row.trial), ", best")] {
            verdict += if holds { text } else { "" };
        }
        let cells = std::iter::once(Cell::count(row.trial as usize)).chain(parameter_cells(study, row));
        let expected = [row.expected.map(|expected| expected.value), row.expected.map(|expected| expected.p_stand)];
        let expected = expected.into_iter().zip([3, 2]).filter(|_| expects);
        let cells = cells.chain(expected.map(|(value, digits)| Cell::optional(value, digits)));
        let cells = cells.chain([Cell::optional(row.value, 3)]).chain(measured(row));
        let judged_by = origins.then(|| row.judged_by.map_or(Cell::Missing, |by| Cell::text(by.name())));
        let cells = cells.chain([Cell::text(verdict)]).chain(judged_by).chain([Cell::text(row.origin())]);
        table.rows.push(cells.chain(known.then(|| Cell::text(study.ticks_of(row.trial)))).collect());
    }
    table
}

/// Falls, void trials, verdicts that differ from the suggested ones, and notes; none if there are none.
pub fn remarks(studies: &[ReportedStudy]) -> Option<Table> {
    let columns = ["study", "trial", "verdict", "cause", "note"].map(Column::text);
    let mut table =
        Table::new("Falls, void trials and verdicts other than suggested, with their causes, and notes.", columns);
    for study in studies {
        for row in &study.rows {
            let explained = matches!(row.verdict, Some(Verdict::Fall | Verdict::Void)) || row.is_overruled();
            if explained || !row.note.is_empty() {
                table.rows.push(vec![
                    Cell::text(title(study)),
                    Cell::text(row.trial.to_string()),
                    Cell::text(row.verdict_name().unwrap_or("not judged")),
                    Cell::text(if explained { row.cause.clone() } else { String::new() }),
                    Cell::text(row.note.clone()),
                ]);
            }
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// Values that operators have set in place of proposed ones; none if there are none.
pub fn overrides(studies: &[ReportedStudy]) -> Option<Table> {
    let columns = [Column::text("study"), Column::number("trial", ""), Column::text("value")].into_iter();
    let columns = columns.chain(["proposed", "set"].map(|name| Column::number(name, "")));
    let mut table = Table::new("Values that an operator has set in place of the proposed ones.", columns);
    for study in studies {
        for row in &study.rows {
            for p in study.recordings.overrides.of(row) {
                let name = format!("{} ({})", p.name, parameter_unit(&p.name));
                let cells = [Cell::text(title(study)), Cell::count(row.trial as usize), Cell::text(name)];
                table.rows.push(cells.into_iter().chain([p.proposed, p.value].map(|v| Cell::number(v, 3))).collect());
            }
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// Keys of a configuration that differ from the defaults; none without a difference.
pub fn configuration(study: &ReportedStudy) -> Option<Table> {
    let mut table = Table::new("Keys that differ from the defaults.", ["key", "default", "value"].map(Column::text));
    table.rows.extend(study.changed.iter().map(|changed| {
        let shown = |text: &str| if text.is_empty() { Cell::Missing } else { Cell::text(text) };
        vec![Cell::text(changed.key.clone()), shown(&changed.default), shown(&changed.value)]
    }));
    (!table.rows.is_empty()).then_some(table)
}

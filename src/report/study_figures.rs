//! Figures of studies: convergence, parameters, landings, motion, force, torque and power.

use super::figure::{Axis, FALL_STYLE, Figure, Panel, Series, Shape};
use super::jump::JumpCurves;
use super::study::{ReportedStudy, StudyGroup, TrialChoice, mean_best_so_far};
use crate::control::force_profile::{Oscillator, amplitudes_leg, force_leg};
use crate::robot::{JOINT_NAMES, Leg};
use crate::trial::{ExpectedResult, TrialRecord, Verdict};

/// Styles of studies or trials, without those of falls and limits.
const STYLES: [usize; 4] = [0, 2, 3, 4];
/// Style of the first touchdown.
const TOUCHDOWN_STYLE: usize = 5;
/// Points of a force profile.
const PROFILE_POINTS: usize = 200;

/// Figures of a group of studies.
pub struct GroupFigures<'a> {
    /// Studies, at least one.
    pub studies: &'a [&'a ReportedStudy],
    /// Name of the group in file names and captions.
    pub name: &'a str,
}

/// A trial that is drawn over time: its row, its label, and its curves if its ticks were recorded.
pub struct DrawnTrial<'a> {
    /// Row of the trial.
    pub row: &'a TrialRecord,
    /// Label in the legend.
    pub label: String,
    /// Number of its style.
    pub style: usize,
    /// Curves.
    pub curves: Option<&'a JumpCurves>,
}

/// Returns the chosen trials of a study, each once, with styles of their own; the first fall has that of falls.
pub fn drawn<'a>(study: &'a ReportedStudy, choices: &[TrialChoice]) -> Vec<DrawnTrial<'a>> {
    let mut drawn: Vec<DrawnTrial<'a>> = Vec::new();
    for (row, label) in choices.iter().filter_map(|choice| choice.of(study)) {
        if drawn.iter().any(|trial| trial.row.trial == row.trial) {
            continue;
        }
        let fell = row.verdict == Some(Verdict::Fall) && drawn.iter().all(|trial| trial.style != FALL_STYLE);
        let style = if fell { FALL_STYLE } else { STYLES[drawn.len() % STYLES.len()] };
        let curves = study.recorded(row.trial).map(|recorded| &recorded.curves);
        drawn.push(DrawnTrial { row, label, style, curves });
    }
    drawn
}

impl<'a> GroupFigures<'a> {
    /// Figures of a group.
    pub fn new(group: &'a StudyGroup<'a>) -> GroupFigures<'a> {
        GroupFigures { studies: &group.studies, name: &group.name }
    }

    /// Name for a file: lower-case letters, digits and hyphens.
    fn file(&self, what: &str) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
        format!("{}-{what}", self.name.chars().map(plain).collect::<String>())
    }

    fn unit(&self) -> &str {
        self.studies.first().map_or("", |study| study.unit.as_str())
    }

    /// Axis of the numbers of the trials.
    fn trial_axis(&self) -> Axis {
        let most = self.studies.iter().flat_map(|study| &study.rows).map(|row| row.trial).max().unwrap_or(0);
        Axis::new("Trial", "").within(-0.5, f64::from(most) + 0.5)
    }

    fn style(&self, index: usize) -> usize {
        if self.studies.len() <= STYLES.len() { STYLES[index % STYLES.len()] } else { STYLES[0] }
    }

    fn label(&self, index: usize) -> String {
        match self.studies.len() {
            1 => "accepted".to_owned(),
            count if count <= STYLES.len() => format!("accepted, {}", self.studies[index].label()),
            _ => "accepted".to_owned(),
        }
    }

    /// Best so far over the trials that count, with mean and deviation over several studies, and the value of each trial.
    pub fn convergence(&self) -> Figure {
        let mut panel = Panel::new(
            "",
            Axis::new("Trials that count (accepted or fallen)", ""),
            Axis::new("Objective J", self.unit()),
        );
        let several = self.studies.len() > 1;
        let mean = mean_best_so_far(self.studies);
        let most = self.studies.iter().map(|study| study.counted().count()).max().unwrap_or(0);
        panel.x.range = Some([0.5, most as f64 + 0.5]);
        if several {
            let label = "best so far, mean and standard deviation";
            panel.series.push(Series::band(label, 0, mean.iter().map(|&(k, mean, spread)| [k as f64, mean, spread])));
        }
        let number = |index: usize| (index + 1) as f64;
        for (index, study) in self.studies.iter().enumerate() {
            let value = |verdict: Verdict| {
                let rows = study.counted().enumerate().filter(move |(_, row)| row.verdict == Some(verdict));
                rows.filter_map(|(at, row)| Some([(at + 1) as f64, row.value?])).collect::<Vec<_>>()
            };
            panel.series.push(Series::points(self.label(index), self.style(index), value(Verdict::Accept)));
            panel.series.push(Series::points("fall (J = 0)", FALL_STYLE, value(Verdict::Fall)));
            if !several {
                let best = study.best_so_far();
                let steps =
                    best.iter().enumerate().map(|(at, best)| [number(at), *best]).filter(|[_, y]| y.is_finite());
                panel.series.push(Series::step("best so far", 0, steps));
            }
        }
        let over = if several { format!(" over {} studies", self.studies.len()) } else { String::new() };
        let caption = format!("Convergence, {}{over}: value of each trial and best accepted value so far.", self.name);
        Figure::new(self.file("convergence"), caption, 1, [panel])
    }

    /// Expectation of the sampler beside the result of each trial: the value with its deviation and the spread of the
    /// simulated robots, and the probability of standing. None without an expectation.
    pub fn expectations(&self) -> Option<Figure> {
        let expecting = self.studies.iter().filter(|study| study.expecting().next().is_some());
        let panels = expecting.flat_map(|study| {
            let title = if self.studies.len() > 1 { study.label() } else { String::new() };
            let mut value = Panel::new(title.clone(), self.trial_axis(), Axis::new("Objective J", self.unit()));
            let expected = || study.expecting().map(|(row, expected)| (f64::from(row.trial), row, expected));
            let band = expected().map(|(trial, _, expected)| [trial, expected.value, expected.deviation]);
            value.series.push(Series::band("expected, mean and standard deviation", 0, band));
            for (label, of) in [
                ("least of the simulated robots", (|e| e.simulated_least) as fn(&ExpectedResult) -> Option<f64>),
                ("greatest of the simulated robots", |e| e.simulated_most),
            ] {
                let points: Vec<_> = expected().filter_map(|(trial, _, e)| Some([trial, of(e)?])).collect();
                if !points.is_empty() {
                    value.series.push(Series::marks(label, STYLES[3], points));
                }
            }
            let mut stands =
                Panel::new(title, self.trial_axis(), Axis::new("Probability of standing", "").within(0.0, 1.05));
            for (label, verdict, style) in
                [("accepted", Verdict::Accept, STYLES[1]), ("fall", Verdict::Fall, FALL_STYLE)]
            {
                let of = || expected().filter(|(_, row, _)| row.verdict == Some(verdict));
                let values = of().filter_map(|(trial, row, _)| Some([trial, row.value?]));
                value.series.push(Series::points(label, style, values));
                stands.series.push(Series::points(label, style, of().map(|(trial, _, e)| [trial, e.p_stand])));
            }
            [value, stands]
        });
        let panels: Vec<Panel> = panels.collect();
        let caption = format!("Expectation of the sampler's model before each trial of {}, and what came.", self.name);
        (!panels.is_empty()).then(|| Figure::new(self.file("expectations"), caption, 2, panels))
    }

    /// Each parameter over the trials, between its bounds.
    pub fn parameters(&self) -> Figure {
        let first = self.studies.first();
        let panels = first.iter().flat_map(|study| &study.parameters).map(|parameter| {
            let y = Axis::new(parameter.name.clone(), parameter.unit.clone());
            let mut panel = Panel::new("", self.trial_axis(), y.within(parameter.low, parameter.high));
            for (index, study) in self.studies.iter().enumerate() {
                let of = |verdict: Verdict| {
                    let point = |row: &TrialRecord| Some([f64::from(row.trial), row.parameters.get(&parameter.name)?]);
                    study.with(verdict).filter_map(point).collect::<Vec<_>>()
                };
                panel.series.push(Series::points(self.label(index), self.style(index), of(Verdict::Accept)));
                panel.series.push(Series::points("fall", FALL_STYLE, of(Verdict::Fall)));
            }
            // Values outside of the present bounds, from before the operator narrowed them.
            let values = || panel.series.iter().flat_map(Series::extent).map(|[_, y]| y);
            let margin = 0.05 * (parameter.high - parameter.low);
            let low = values().fold(parameter.low, f64::min) - margin;
            let high = values().fold(parameter.high, f64::max) + margin;
            panel.y.range = Some([low, high]);
            panel
        });
        let caption = format!("Parameters per trial, {}. The vertical axes span the bounds of the search.", self.name);
        Figure::new(self.file("parameters"), caption, 2, panels)
    }

    /// Displacement at the end of each trial with the turn as an arrow.
    pub fn landings(&self) -> Figure {
        let axis = |label: &str| Axis::new(label, "m");
        let mut panel = Panel::new("", axis("Displacement forward dx"), axis("Displacement to the left dy"));
        (panel.equal, panel.height) = (true, Some(380));
        panel.series.push(Series::points("start", 6, [[0.0, 0.0]]));
        for (index, study) in self.studies.iter().enumerate() {
            let of = |verdict: Verdict| {
                let rows = study.with(verdict).filter_map(|row| row.measured.as_ref());
                rows.map(|jump| [jump.dx_m, jump.dy_m, jump.dyaw_rad]).collect::<Vec<_>>()
            };
            let accepted = study.with(Verdict::Accept).filter_map(|row| row.measured.as_ref()?.touchdown);
            let touchdowns = accepted.map(|at| [at.dx_m, at.dy_m]);
            panel.series.push(Series::points("first touchdown", TOUCHDOWN_STYLE, touchdowns));
            panel.series.push(Series::arrows(self.label(index), self.style(index), of(Verdict::Accept)));
            panel.series.push(Series::arrows("fall", FALL_STYLE, of(Verdict::Fall)));
        }
        // Markers and arrows need room at the edges.
        let extent: Vec<[f64; 2]> = panel.series.iter().flat_map(Series::extent).collect();
        for (axis, at) in [(&mut panel.x, 0), (&mut panel.y, 1)] {
            let [low, high] = extent.iter().fold([0.0f64, 0.0], |[l, h], p| [l.min(p[at]), h.max(p[at])]);
            axis.range = Some([low - 0.08, high + 0.08]);
        }
        let caption = format!(
            "Landings, {}, seen from above: trunk at the end of each trial relative to its start, with its heading as an \
             arrow, and at the first touchdown of accepted trials.",
            self.name
        );
        Figure::new(self.file("landings"), caption, 1, [panel])
    }

    /// Angles of take-off velocity and force of all recorded trials.
    pub fn angles(&self) -> Option<Figure> {
        let mut panel = Panel::new("", self.trial_axis(), Axis::new("Angle from the horizontal", "deg"));
        for study in self.studies {
            let velocity = study.recordings.trials.iter().filter_map(|(trial, recorded)| {
                Some([f64::from(*trial), recorded.quantities?.takeoff_angle_rad.to_degrees()])
            });
            panel.series.push(Series::points("velocity at take-off", 0, velocity));
            let recorded = study.rows.iter().filter(|row| study.recorded(row.trial).is_some());
            let force =
                recorded.filter_map(|row| Some([f64::from(row.trial), study.force_angle_rad(row)?.to_degrees()]));
            panel.series.push(Series::points("force of the profile", 4, force));
        }
        let empty = panel.series.iter().all(|series| series.extent().is_empty());
        let caption =
            format!("Angles of take-off velocity and of the profile's force, {}, recorded trials.", self.name);
        (!empty).then(|| Figure::new(self.file("angles"), caption, 1, [panel]))
    }

    /// Force profile of the drawn trials.
    pub fn force(&self, study: &ReportedStudy, drawn: &[DrawnTrial]) -> Option<Figure> {
        let task = study.task?;
        let axis = |label: &str| Axis::new(label, "N");
        let time = || Axis::new("Time since the impulse began", "s");
        let mut panels = [
            Panel::new("", time(), axis("Force on the trunk, x")),
            Panel::new("", time(), axis("Force on the trunk, y")),
            Panel::new("", time(), axis("Force on the trunk, z")),
        ];
        for trial in drawn {
            let jump = study.jump(trial.row);
            if jump.f0_hz <= 0.0 {
                continue;
            }
            let oscillator = Oscillator { f0_hz: jump.f0_hz, f1_hz: if study.jumps > 1 { jump.f1_hz } else { 0.0 } };
            let amplitude = amplitudes_leg(&jump, task)[Leg::FR as usize];
            let pause = if study.jumps > 1 { oscillator.period_s() } else { 0.0 };
            let end = f64::from(study.jumps.saturating_sub(1)) * pause + oscillator.impulse_s() * 1.3;
            let force = |axis: usize| {
                (0..=PROFILE_POINTS)
                    .map(move |at| end * at as f64 / PROFILE_POINTS as f64)
                    .map(move |time| [time, -force_leg(&amplitude, oscillator.theta_rad(time))[axis]])
            };
            for (axis, panel) in panels.iter_mut().enumerate() {
                panel.series.push(Series::line(trial.label.clone(), trial.style, force(axis)));
            }
        }
        // Directions without force are left out.
        let used = |panel: &Panel| panel.series.iter().flat_map(Series::extent).any(|[_, force]| force.abs() > 1e-9);
        let panels: Vec<Panel> = panels.into_iter().filter(used).collect();
        let caption = format!(
            "Force profile, {} (equation 2 of the paper): reaction of the front right foot's force.",
            self.name
        );
        (!panels.is_empty()).then(|| Figure::new(self.file("force"), caption, 2, panels))
    }

    /// Roll, pitch and the heights of the four feet of the drawn trials.
    pub fn motion(&self, drawn: &[DrawnTrial]) -> Option<Figure> {
        let roll = overlaid("Roll", "rad", drawn, |curves| &curves.roll_rad);
        let pitch = overlaid("Pitch", "rad", drawn, |curves| &curves.pitch_rad);
        let feet = Leg::ALL.map(|leg| {
            let label = format!("Height of foot {}", leg.name());
            overlaid(&label, "m", drawn, move |curves| &curves.foot_height_m[leg as usize])
        });
        let caption = format!(
            "Roll, pitch and heights of the feet, {}, overlaid on the time since the impulse began. Heights are above \
             those at time 0.",
            self.name
        );
        let panels = [roll, pitch].into_iter().chain(feet);
        (!drawn.iter().all(|trial| trial.curves.is_none()))
            .then(|| Figure::new(self.file("motion"), caption, 2, panels))
    }

    /// Torque of the joints and power of the drawn trials, against the limits.
    pub fn torque(&self, study: &ReportedStudy, drawn: &[DrawnTrial]) -> Option<Figure> {
        let mut panels: Vec<Panel> = JOINT_NAMES
            .iter()
            .enumerate()
            .map(|(kind, name)| {
                let label = format!(
                    "Torque, largest of 4 {}",
                    if *name == "calf" { "calves".into() } else { format!("{name}s") }
                );
                let mut panel = overlaid(&label, "N m", drawn, move |curves| &curves.torque_n_m[kind]);
                if let Some([torque, _]) = study.limits {
                    panel.limit("torque limit", torque[kind]);
                }
                panel
            })
            .collect();
        panels.push(overlaid("Sum of positive powers", "W", drawn, |curves| &curves.positive_power_w));
        let caption = format!(
            "Joint torques and power, {}. Torque: largest absolute value of the four joints of a kind; power: sum of the \
             joints that drive.",
            self.name
        );
        (!drawn.iter().all(|trial| trial.curves.is_none()))
            .then(|| Figure::new(self.file("torque"), caption, 2, panels))
    }

    /// Peak torque and power of each kind of joint of the drawn trials, against the limits.
    pub fn peaks(&self, study: &ReportedStudy, drawn: &[DrawnTrial]) -> Option<Figure> {
        let mut torque =
            Panel::new("", Axis::named("Joint", JOINT_NAMES), Axis::new("Peak torque before take-off", "N m"));
        let mut power = Panel::new("", Axis::named("Joint", JOINT_NAMES), Axis::new("Peak power before take-off", "W"));
        if let Some([torques, speeds]) = study.limits {
            torque.series.push(Series::marks(
                "torque limit",
                6,
                torques.iter().enumerate().map(|(k, t)| [k as f64, *t]),
            ));
            let product = torques.iter().zip(speeds).enumerate().map(|(kind, (t, s))| [kind as f64, t * s]);
            power.series.push(Series::marks("torque limit times no-load speed", 6, product));
        }
        for (index, trial) in drawn.iter().enumerate() {
            let Some(jump) = study.recorded(trial.row.trial).and_then(|recorded| recorded.quantities) else { continue };
            let style = trial.style;
            let aside = 0.1 * (index as f64 - (drawn.len() as f64 - 1.0) / 2.0);
            let place = |values: [f64; 3]| {
                values.into_iter().enumerate().map(move |(kind, value)| [kind as f64 + aside, value])
            };
            torque.series.push(Series::points(trial.label.clone(), style, place(jump.push_torque_n_m)));
            power.series.push(Series::points(trial.label.clone(), style, place(jump.joint_power_w)));
        }
        let points = |panel: &Panel| panel.series.iter().any(|series| matches!(series.shape, Shape::Points(_)));
        if !points(&torque) {
            return None;
        }
        for panel in [&mut torque, &mut power] {
            let most = panel.series.iter().flat_map(Series::extent).map(|[_, y]| y).fold(0.0, f64::max);
            panel.y.range = Some([0.0, most * 1.08]);
        }
        let caption = format!(
            "Peak torque and peak power of one joint of each kind, {}, from the impulse to take-off.",
            self.name
        );
        Some(Figure::new(self.file("peaks"), caption, 2, [torque, power]))
    }
}

/// A panel with one curve of each drawn trial.
fn overlaid(label: &str, unit: &str, drawn: &[DrawnTrial], curve: impl Fn(&JumpCurves) -> &Vec<[f64; 2]>) -> Panel {
    let mut panel = Panel::new("", Axis::new("Time since the impulse began", "s"), Axis::new(label, unit));
    for trial in drawn {
        if let Some(curves) = trial.curves {
            let points = curve(curves).iter().copied();
            panel.series.push(Series::line(trial.label.clone(), trial.style, points));
        }
    }
    panel
}

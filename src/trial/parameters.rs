//! Parameters of a jump and gains of the controller: names, units, bounds, values.

use serde::{Deserialize, Serialize};

/// The gains of the controller, in table order, with their units.
pub const GAIN_UNITS: [(&str, &str); 4] = [("kp", "N/m"), ("kd", "N s/m"), ("kd_joint", "N m s/rad"), ("k_att", "N/m")];

/// Whether `name` is a gain of the controller.
pub fn is_gain(name: &str) -> bool {
    GAIN_UNITS.iter().any(|(gain, _)| *gain == name)
}

/// Returns the unit of an optimized parameter; empty for an unknown name.
pub fn parameter_unit(name: &str) -> &'static str {
    match name {
        "f0" | "f1" => "Hz",
        "Fx" | "Fy" | "Fz" => "N",
        _ => GAIN_UNITS.iter().find(|(gain, _)| *gain == name).map_or("", |(_, unit)| unit),
    }
}

/// Values by name, in table order: the parameters of a point, or the gains of a trial.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ParameterValues(Vec<(String, f64)>);

impl ParameterValues {
    /// Returns the value of that name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
    }
}

/// The optimizer's plain pairs.
impl std::ops::Deref for ParameterValues {
    type Target = [(String, f64)];

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl From<Vec<(String, f64)>> for ParameterValues {
    fn from(pairs: Vec<(String, f64)>) -> ParameterValues {
        ParameterValues(pairs)
    }
}

impl FromIterator<(String, f64)> for ParameterValues {
    fn from_iter<I: IntoIterator<Item = (String, f64)>>(pairs: I) -> ParameterValues {
        ParameterValues(pairs.into_iter().collect())
    }
}

impl<'a> IntoIterator for &'a ParameterValues {
    type Item = &'a (String, f64);
    type IntoIter = std::slice::Iter<'a, (String, f64)>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// The force profile of one jump: frequencies and amplitudes (paper, equations 1 and 2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JumpParameters {
    /// Frequency of the impulse phase, Hz: the impulse lasts 1 / (2 f0).
    pub f0_hz: f64,
    /// Frequency of the off phase, Hz, for continuous jumping: the pause lasts 1 / (2 f1). Zero for single jumps.
    pub f1_hz: f64,
    /// Amplitude along x, N per foot; positive, or of either sign where the task moves along y.
    pub fx_n: f64,
    /// Amplitude along y, N per foot; positive, or of either sign where the task moves along x.
    pub fy_n: f64,
    /// Amplitude along z, N per foot, positive.
    pub fz_n: f64,
}

impl JumpParameters {
    /// Returns the jump of a point; `f1_hz` holds where the point has no `f1`, and an amplitude that it lacks is 0.
    pub fn from_values(values: &ParameterValues, f1_hz: f64) -> JumpParameters {
        let value = |name: &str| values.get(name).unwrap_or(0.0);
        JumpParameters {
            f0_hz: value("f0"),
            f1_hz: values.get("f1").unwrap_or(f1_hz),
            fx_n: value("Fx"),
            fy_n: value("Fy"),
            fz_n: value("Fz"),
        }
    }
}

impl JumpParameters {
    /// Duration of one impulse, s.
    pub fn impulse_s(&self) -> f64 {
        0.5 / self.f0_hz
    }

    /// Duration of one impulse and the pause after it, s; infinite without a pause.
    pub fn period_s(&self) -> f64 {
        self.impulse_s() + if self.f1_hz > 0.0 { 0.5 / self.f1_hz } else { f64::INFINITY }
    }

    /// Returns the number of impulses that begin within `duration_s`, at least one.
    pub fn within(&self, duration_s: f64) -> u32 {
        ((duration_s / self.period_s()).ceil() as u32).max(1)
    }
}

/// Gains of the leg controller (paper, equation 4 and the Virtual Model Control).
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Gains {
    /// Cartesian stiffness Kp, N/m, the same along all axes.
    pub kp: f64,
    /// Cartesian damping Kd, N s/m.
    pub kd: f64,
    /// Joint damping Kd,joint, N m s/rad.
    pub kd_joint: f64,
    /// Attitude gain of the Virtual Model Control k_att, N/m.
    pub k_att: f64,
}

impl Gains {
    /// Returns the gains by name, in table order.
    pub fn values(&self) -> ParameterValues {
        let Gains { kp, kd, kd_joint, k_att } = *self;
        GAIN_UNITS.iter().zip([kp, kd, kd_joint, k_att]).map(|((name, _), value)| ((*name).to_owned(), value)).collect()
    }

    /// Returns these gains with the values of `values` in place of their own.
    pub fn with(&self, values: &ParameterValues) -> Gains {
        let value = |name: &str, own| values.get(name).unwrap_or(own);
        Gains {
            kp: value("kp", self.kp),
            kd: value("kd", self.kd),
            kd_joint: value("kd_joint", self.kd_joint),
            k_att: value("k_att", self.k_att),
        }
    }
}

/// Returns in words the gains that differ from those of a configuration, `other gains: kp 500 (configured 400)`, where `called` is
/// `configured`; empty where none does. Those that are searched as parameters are not among them.
pub fn other_gains(
    gains: &ParameterValues,
    (called, configured): (&str, &ParameterValues),
    is_searched: impl Fn(&str) -> bool,
) -> String {
    let different: Vec<String> = configured
        .iter()
        .filter(|(name, _)| !is_searched(name))
        .filter_map(|(name, usual)| {
            let value = gains.get(name)?;
            (value != *usual).then(|| format!("{name} {value} ({called} {usual})"))
        })
        .collect();
    if different.is_empty() { String::new() } else { format!("other gains: {}", different.join(", ")) }
}

/// One optimized parameter, or one gain.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterInfo {
    /// Name, for example `Fx`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

impl ParameterInfo {
    /// Returns whether `value` is within the bounds; false for NaN.
    pub fn contains(&self, value: f64) -> bool {
        value >= self.low && value <= self.high
    }
}

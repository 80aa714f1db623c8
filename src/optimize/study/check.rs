//! Checks of a study against its options, and of parameters against the space.

use super::{Study, StudyError, StudyOptions};
use crate::optimize::ask::Direction;
use crate::optimize::space::Parameter;
use crate::optimize::trial::Distribution;

impl Study {
    pub(super) fn check_compatible(&self) -> Result<(), StudyError> {
        let StudyOptions { name, direction, space, .. } = &self.options;
        let record = self.record();
        if record.directions != [*direction as u64] {
            let names = ["not set", Direction::Minimize.into(), Direction::Maximize.into()];
            let text = |d: &u64| names.get(*d as usize).map_or_else(|| d.to_string(), |name| (*name).to_owned());
            let stored = record.directions.iter().map(text).collect::<Vec<_>>().join(", ");
            return Err(StudyError::Direction { name: name.clone(), stored, asked: (*direction).into() });
        }
        for Parameter { name: parameter, range } in space.parameters() {
            let scale = |log: bool| if log { "a logarithmic float" } else { "a linear float" };
            let stored = match record.trials.iter().find_map(|t| t.distribution(parameter)) {
                Some(Distribution::Float(stored)) if stored.log != range.log => scale(stored.log).to_owned(),
                Some(Distribution::Foreign { kind, .. }) if kind != "FloatDistribution" => kind.clone(),
                _ => continue,
            };
            let (name, parameter) = (name.clone(), parameter.clone());
            return Err(StudyError::Incompatible { name, parameter, stored, asked: scale(range.log) });
        }
        Ok(())
    }

    pub(super) fn check_parameters(&self, parameters: &[(String, f64)]) -> Result<(), StudyError> {
        for (name, value) in parameters {
            let Some(range) = self.options.space.range(name) else {
                let known: Vec<&str> = self.options.space.parameters().iter().map(|p| p.name.as_str()).collect();
                let (study, parameter, known) = (self.options.name.clone(), name.clone(), known.join(", "));
                return Err(StudyError::UnknownParameter { study, parameter, known });
            };
            let expected = match value {
                value if !value.is_finite() => "finite number",
                value if range.log && *value <= 0.0 => "number above 0: its search is logarithmic",
                _ => continue,
            };
            return Err(StudyError::Value { quantity: format!("parameter `{name}`"), value: *value, expected });
        }
        Ok(())
    }
}

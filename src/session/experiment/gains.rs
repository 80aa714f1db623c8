//! The controller's gains by name, as screens and files have them.

use crate::trial::Gains;

/// The gains by name, in table order.
pub fn listed(gains: &Gains) -> Vec<(String, f64)> {
    let Gains { kp, kd, kd_joint, k_att } = *gains;
    [("kp", kp), ("kd", kd), ("kd_joint", kd_joint), ("k_att", k_att)].map(|(n, v)| (n.to_owned(), v)).to_vec()
}

/// The gains of a list; those that it lacks are as in `otherwise`.
pub fn of_list(list: &[(String, f64)], otherwise: &Gains) -> Gains {
    let value = |name: &str, otherwise| list.iter().find(|(n, _)| n == name).map_or(otherwise, |(_, value)| *value);
    Gains {
        kp: value("kp", otherwise.kp),
        kd: value("kd", otherwise.kd),
        kd_joint: value("kd_joint", otherwise.kd_joint),
        k_att: value("k_att", otherwise.k_att),
    }
}

/// What differs from the configuration's gains, in words: `kp 500 (400)`; empty where nothing does.
pub fn difference(list: &[(String, f64)], configured: &Gains) -> String {
    let foreign: Vec<String> = listed(configured)
        .into_iter()
        .filter_map(|(name, usual)| {
            let value = list.iter().find(|(n, _)| *n == name)?.1;
            (value != usual).then(|| format!("{name} {value} (configured {usual})"))
        })
        .collect();
    foreign.join(", ")
}

//! The default files, embedded, and the keys that they leave out.

use toml::Table;

/// The files of a configuration folder and their defaults.
pub const FILES: [(&str, &str); 6] = [
    ("control.toml", include_str!("../../config/control.toml")),
    ("safety.toml", include_str!("../../config/safety.toml")),
    ("optimize.toml", include_str!("../../config/optimize.toml")),
    ("simulator.toml", include_str!("../../config/simulator.toml")),
    ("prior.toml", include_str!("../../config/prior.toml")),
    ("console.toml", include_str!("../../config/console.toml")),
];

/// Optional keys, which the defaults leave out, each with an example of its kind.
pub const OPTIONAL: [(&str, &str); 3] = [
    (
        "simulator.toml",
        "[terrain]
friction_range = [1.0, 1.0]
[terrain.blocks]
area_m = [0.0, 0.0, 0.0, 0.0]
friction_range = [1.0, 1.0]
",
    ),
    (
        "control.toml",
        "[tasks]
forward = { duration_s = 1.0 }
lateral-left = { duration_s = 1.0 }
lateral-right = { duration_s = 1.0 }
twist-ccw = { duration_s = 1.0 }
twist-cw = { duration_s = 1.0 }
",
    ),
    (
        "optimize.toml",
        "objective = \"truth\"
[sampler]
startup_trials = 10
[first]
forward = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0, kp = 1.0, kd = 1.0, kd_joint = 1.0, k_att = 1.0 }
lateral-left = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0, kp = 1.0, kd = 1.0, kd_joint = 1.0, k_att = 1.0 }
lateral-right = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0, kp = 1.0, kd = 1.0, kd_joint = 1.0, k_att = 1.0 }
twist-ccw = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0, kp = 1.0, kd = 1.0, kd_joint = 1.0, k_att = 1.0 }
twist-cw = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0, kp = 1.0, kd = 1.0, kd_joint = 1.0, k_att = 1.0 }
",
    ),
];

/// Parses a default file; its keys are the known keys.
pub fn template(text: &str) -> Table {
    text.parse().unwrap_or_default()
}

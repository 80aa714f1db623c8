//! The configurations of the experiments: the folders of `examples/`, compiled in, and what an experiment adds to them.
//! `ui/data` has links to the files of the repository that this package contains.

use quadfrog::config::{Config, ConfigError, ConfigLayer};
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

/// The files of an example: path from the root of the repository, and text.
type ExampleFiles = &'static [(&'static str, &'static str)];

macro_rules! example {
    ($($path:literal),+) => {
        &[$(($path, include_str!(concat!("../../../data/", $path)))),+]
    };
}

const CONTINUOUS: ExampleFiles = example!(
    "examples/continuous/control.toml",
    "examples/continuous/optimize.toml",
    "examples/continuous/simulator.toml"
);
const CONTINUOUS_FAST: ExampleFiles = example!(
    "examples/continuous_fast/control.toml",
    "examples/continuous_fast/optimize.toml",
    "examples/continuous_fast/simulator.toml"
);
const CONTINUOUS_TWIST: ExampleFiles = example!(
    "examples/continuous_twist/control.toml",
    "examples/continuous_twist/optimize.toml",
    "examples/continuous_twist/simulator.toml"
);
const HARDWARE_LIKE: ExampleFiles = example!("examples/hardware_like/simulator.toml");
const HIGH_TWIST: ExampleFiles = example!("examples/high_twist/control.toml", "examples/high_twist/safety.toml");
const ROUGH_TERRAIN: ExampleFiles = example!(
    "examples/rough_terrain/control.toml",
    "examples/rough_terrain/optimize.toml",
    "examples/rough_terrain/simulator.toml"
);
/// The point of the rough terrain, low jumps.
const LOW_JUMPS: ExampleFiles = example!("examples/rough_terrain/optimize.toml");
const STABLE_LANDING: ExampleFiles = example!("examples/stable_landing/control.toml");

/// All examples.
pub const EXAMPLES: [ExampleFiles; 7] =
    [CONTINUOUS, CONTINUOUS_FAST, CONTINUOUS_TWIST, HARDWARE_LIKE, HIGH_TWIST, ROUGH_TERRAIN, STABLE_LANDING];

/// Objective and controller from the estimator, as on a robot.
const ESTIMATE: ExampleFiles = &[("optimize.toml", "objective = \"estimate\"\n")];
/// The paper's controller without added terms.
const PAPER_CONTROLLER: ExampleFiles = &[(
    "control.toml",
    "[tasks.forward]\nattitude_rate_gain = 0.0\nfoot_placement_s = 0.0\ncutoff = \"none\"\ncutoff_lost_s = 0.02\nlanding_spread_m = 0.0\n",
)];
/// A flat floor.
const FLAT: ExampleFiles = &[("simulator.toml", "[terrain]\nkind = \"flat\"\n")];
/// Five jumps in a row to the left.
const SIDEWAYS: ExampleFiles = &[("control.toml", "[tasks.lateral-left]\njumps = 5\nf1_hz = 0.9\n")];

/// A configuration of the experiments.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr, VariantArray,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum ExperimentConfiguration {
    /// The defaults: the paper's controller in the ideal simulation.
    Ideal,
    /// Motors, friction and sensor noise as of a robot; the true state for objective and controller.
    HardwareLike,
    /// The same with the estimator's state, as on a robot.
    HardwareLikeEstimate,
    /// Stance and limits of the high twist.
    HighTwist,
    /// Five jumps forward in a row.
    Continuous,
    /// Five low jumps forward in a row.
    ContinuousLow,
    /// Five jumps in a row to the left.
    ContinuousLateral,
    /// Five fast jumps forward in a row; J is per second.
    ContinuousFast,
    /// Five twists in a row.
    ContinuousTwist,
    /// Blocks, with the added terms of the example.
    RoughTerrain,
    /// Blocks, with the paper's controller.
    RoughTerrainPaper,
    /// The rough terrain's point and controller on a flat floor.
    RoughTerrainFlat,
    /// The ideal simulation with the added terms.
    StableLanding,
    /// Hardware-like simulation, estimator's state, added terms.
    StableLandingEstimate,
}

impl ExperimentConfiguration {
    /// Returns the name in files and tables.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Returns the layers over the defaults.
    fn layers(self) -> &'static [ExampleFiles] {
        match self {
            ExperimentConfiguration::Ideal => &[],
            ExperimentConfiguration::HardwareLike => &[HARDWARE_LIKE],
            ExperimentConfiguration::HardwareLikeEstimate => &[HARDWARE_LIKE, ESTIMATE],
            ExperimentConfiguration::HighTwist => &[HIGH_TWIST],
            ExperimentConfiguration::Continuous => &[CONTINUOUS],
            ExperimentConfiguration::ContinuousLow => &[CONTINUOUS, LOW_JUMPS],
            ExperimentConfiguration::ContinuousLateral => &[SIDEWAYS],
            ExperimentConfiguration::ContinuousFast => &[CONTINUOUS_FAST],
            ExperimentConfiguration::ContinuousTwist => &[CONTINUOUS_TWIST],
            ExperimentConfiguration::RoughTerrain => &[ROUGH_TERRAIN],
            ExperimentConfiguration::RoughTerrainPaper => &[ROUGH_TERRAIN, PAPER_CONTROLLER],
            ExperimentConfiguration::RoughTerrainFlat => &[ROUGH_TERRAIN, FLAT],
            ExperimentConfiguration::StableLanding => &[STABLE_LANDING],
            ExperimentConfiguration::StableLandingEstimate => &[HARDWARE_LIKE, ESTIMATE, STABLE_LANDING],
        }
    }

    /// Returns path and text of the files over the defaults, later ones over earlier ones.
    pub fn files(self) -> impl Iterator<Item = &'static (&'static str, &'static str)> {
        self.layers().iter().flat_map(|files| files.iter())
    }

    /// Loads the configuration.
    ///
    /// # Errors
    /// When a file does not fit the defaults.
    pub fn load(self) -> Result<Config, ConfigError> {
        let layer = |&(origin, text): &(&'static str, &'static str)| {
            let file = origin.rsplit('/').next().unwrap_or(origin);
            ConfigLayer { file, origin, text }
        };
        Config::layered(&self.files().map(layer).collect::<Vec<_>>())
    }
}

//! Which study: a new one, or one that is continued.

use std::path::{Path, PathBuf};

use quadfrog::engine::{STUDY_FILE, stored_study};
use quadfrog::realtime::command::Task;
use quadfrog::robot::description::RobotDescription;

use super::Failure;

/// A study to be run: its task, its seed and its folder.
pub struct Chosen {
    /// The task.
    pub task: Task,
    /// The seed.
    pub seed: u32,
    /// The folder; it exists already if the study is continued.
    pub folder: PathBuf,
}

/// The study that `folder` holds, whatever was asked for besides, as long as it does not contradict.
pub fn continued(
    folder: &Path,
    task: Option<Task>,
    seed: Option<u32>,
    robot: &RobotDescription,
) -> Result<Chosen, Failure> {
    let file = folder.join(STUDY_FILE);
    if !file.is_file() {
        let message = format!(
            "{}: there is no {STUDY_FILE} in this folder; give the folder of an earlier study, as it was printed when it ended",
            folder.display()
        );
        return Err(Failure::Input(message));
    }
    let stored = stored_study(&file).map_err(Failure::input)?;
    if task.is_some_and(|task| task != stored.task) {
        let message = format!(
            "--task: {} holds a study of {}; leave --task away to continue it",
            file.display(),
            stored.task.name()
        );
        return Err(Failure::Input(message));
    }
    if seed.is_some_and(|seed| seed != stored.seed) {
        let message = format!(
            "--seed: {} holds a study of seed {}; leave --seed away to continue it",
            file.display(),
            stored.seed
        );
        return Err(Failure::Input(message));
    }
    if robot.name != stored.robot {
        let message = format!(
            "--model {}: {} holds a study of the {}; give --model {}",
            robot.name,
            file.display(),
            stored.robot,
            stored.robot
        );
        return Err(Failure::Input(message));
    }
    Ok(Chosen { task: stored.task, seed: stored.seed, folder: folder.to_owned() })
}

//! The study that a command names, opened with its own configuration.

use clap::Args;
use clap_complete::ArgValueCandidates;
use quadfrog::config::Config;
use quadfrog::engine::{Opened, open_stored};
use quadfrog::optimize::study::Storage;

use crate::subcommand::arguments::last_config;
use crate::subcommand::completion;
use crate::subcommand::failure::Failure;
use crate::subcommand::selection::parse_storage;

#[derive(Debug, Args)]
pub struct StudySelector {
    /// Folder of a study, its study.log, any Optuna journal, or redis://HOST:PORT/DB
    #[arg(value_name = "STUDY", add = ArgValueCandidates::new(completion::studies))]
    pub place: String,
    /// Name of the study, if the journal holds several
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
}

impl StudySelector {
    /// Returns the last configuration that the study ran with, if its folder holds one, else the built-in one.
    pub fn config(&self) -> Result<Config, Failure> {
        let own = match parse_storage(&self.place) {
            // A folder of studies may have one of the name `config`.
            Storage::File(file) if file.is_file() => file.parent().and_then(last_config),
            _ => None,
        };
        Ok(Config::load(own.as_deref())?)
    }

    /// Opens the study.
    pub fn open(&self) -> Result<Opened, Failure> {
        Ok(open_stored(&parse_storage(&self.place), self.name.as_deref(), &self.config()?)?)
    }
}

/// Says of a study that has all of its trials what makes a queued point run; empty for another study. No console has a study on a server.
pub fn until_continued(selector: &StudySelector, opened: &Opened) -> &'static str {
    // Also one whose verdict its session can still take back.
    let counted = opened.rows().iter().filter(|row| row.counts() && !row.confirms_best()).count();
    let budget = opened.ours.as_ref().and_then(|ours| ours.budget);
    match (budget.is_some_and(|budget| counted >= budget as usize), parse_storage(&selector.place)) {
        (false, _) => "",
        (true, Storage::Redis(_)) => {
            "; the study has all of its trials: what is queued runs once a worker joins with more --trials"
        }
        (true, _) => "; the study has all of its trials: what is queued runs once `C` in the console gives more",
    }
}

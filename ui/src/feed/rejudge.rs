//! The trials of a recording judged again, in a thread of its own: a long recording is read for a minute.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};

use quadfrog::engine::{Rejudging, config_for_recorded};

use crate::message::RejudgeNews;

/// Judges the trials of the files by the configuration in a folder, or by the defaults. The thread ends when the receiver is
/// dropped, at the end of the trial that it reads.
pub fn rejudge(files: Vec<PathBuf>, folder: Option<PathBuf>) -> Receiver<RejudgeNews> {
    let (sender, news) = channel();
    let in_thread = sender.clone();
    let named = folder.as_ref().map_or_else(String::new, |folder| folder.display().to_string());
    let failed = move |reason: String| RejudgeNews::Failed { folder: named, reason };
    let failed_in_thread = failed.clone();
    let judge = move || {
        if let Err(reason) = judge(&files, folder, &in_thread) {
            let _ = in_thread.send(failed_in_thread(reason));
        }
    };
    if let Err(error) = std::thread::Builder::new().name("rejudge".into()).spawn(judge) {
        let _ = sender.send(failed(error.to_string()));
    }
    news
}

/// Sends every judged trial.
///
/// # Errors
/// The reason when the configuration or the recording cannot be used.
fn judge(files: &[PathBuf], folder: Option<PathBuf>, news: &Sender<RejudgeNews>) -> Result<(), String> {
    let config = config_for_recorded(files, folder.as_deref()).map_err(|error| error.to_string())?;
    let rejudging = Rejudging::open(files, &config).map_err(|error| error.to_string())?;
    let configuration = folder.map_or("the defaults".to_owned(), |folder| folder.display().to_string());
    let (unit, trials) = (rejudging.unit().to_owned(), rejudging.measured_trials());
    let begun = RejudgeNews::Begun { configuration, unit, trials };
    let judged = rejudging.map(|trial| RejudgeNews::Trial(Box::new(trial)));
    for item in std::iter::once(begun).chain(judged).chain([RejudgeNews::Done]) {
        if news.send(item).is_err() {
            break;
        }
    }
    Ok(())
}

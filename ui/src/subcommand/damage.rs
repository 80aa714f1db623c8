//! Damage of recordings, as the commands report it that use what is left.

use std::fmt::Display;
use std::path::PathBuf;

use anyhow::anyhow;
use quadfrog::printable::shell_word;
use quadfrog::recording::player::Damage;

use super::failure::Failure;

/// Fails for damaged recordings, with the text of [`damage_text`]; exit status 1.
pub fn require_no_damage(damage: &[Damage], done: &str) -> Result<(), Failure> {
    require_whole(damage, Vec::new(), done)
}

/// Fails for damaged recordings, and for recovered ones that lack something; exit status 1. `lost_before` holds a line for each loss
/// before a recovery, with the file's name.
pub fn require_whole(damage: &[Damage], lost_before: Vec<String>, done: &str) -> Result<(), Failure> {
    if damage.is_empty() && lost_before.is_empty() {
        return Ok(());
    }
    Err(Failure::Other(anyhow!(text(&[lost_before, lines(damage)].concat(), done))))
}

/// Returns the damage of each file with the command that repairs it, then `done`: the use that the command makes of the rest.
pub fn damage_text(damage: &[Damage], done: &str) -> String {
    text(&lines(damage), done)
}

fn lines(damage: &[Damage]) -> Vec<String> {
    damage.iter().map(|damage| with_repair(damage, damage)).collect()
}

/// Returns a text about damage with the command that repairs it, if there is one.
pub fn with_repair(text: &impl Display, damage: &Damage) -> String {
    match damage.is_recoverable {
        true => format!("{text}; `quadfrog recover {}` keeps what can be read", shell_word(&damage.path)),
        false => text.to_string(),
    }
}

fn text(lines: &[String], done: &str) -> String {
    format!("{}\n  {done}", lines.join("\n"))
}

/// Removes the damage of files that are `written` by a session and lack nothing but their end. `cuts` are the missing ends of all
/// files, each with the file's name.
pub fn without_present_ends(damage: &mut Vec<Damage>, written: &[PathBuf], cuts: &[String]) {
    damage.retain(|damage| !(written.contains(&damage.path) && cuts.contains(&damage.to_string())));
}

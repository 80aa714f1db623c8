//! The table and figures of README.md and the comparison in docs/paper.md, made from results.

use std::path::Path;

use quadfrog::report::figure::Figure;
use quadfrog::report::svg;

use super::claims::{PaperClaim, claims};
use super::figures;
use super::page::size_text;
use super::plan::PaperExperiment;
use super::results::ReproduceResults;
use crate::subcommand::failure::{Failure, not_written};
use crate::subcommand::output_file::write_text;

/// The results in a checkout from which table and figures are made.
const REDUCED_FILE: &str = "docs/reproduced.json";
/// Lines around a generated table.
const MARKERS: [&str; 2] = [
    "<!-- begin: written by `quadfrog reproduce --readme` -->",
    "<!-- end: written by `quadfrog reproduce --readme` -->",
];

/// Checks that `checkout` has the texts whose tables are renewed, and that `given` results have every experiment.
///
/// # Errors
/// When an experiment, a text or its markers are missing.
pub fn check(checkout: &Path, given: Option<&ReproduceResults>) -> Result<(), Failure> {
    let all = <PaperExperiment as clap::ValueEnum>::value_variants();
    if given.is_some_and(|results| !all.iter().all(|experiment| results.has(*experiment))) {
        return Err(Failure::input("--readme: needs every experiment; give results that were made without --only"));
    }
    texts().iter().try_for_each(|(name, _)| parts(&checkout.join(name)).map(drop))
}

/// A text of the checkout and the rows of its table.
type GeneratedText = (&'static str, fn(&ReproduceResults, &[PaperClaim]) -> String);

fn texts() -> [GeneratedText; 2] {
    [("README.md", short_table), ("docs/paper.md", whole_table)]
}

/// Writes tables, figures and the reduced results into `checkout`.
///
/// # Errors
/// When a text has lost its markers, or a file cannot be written.
pub fn renew(results: &ReproduceResults, checkout: &Path) -> Result<(), Failure> {
    let reduced = results.reduced();
    let claims = claims(&reduced);
    for (name, table) in texts() {
        let path = checkout.join(name);
        let (before, after) = parts(&path)?;
        let size = size_text(&reduced);
        let table = table(&reduced, &claims);
        write_text(&path, &format!("{before}{}\n\n{table}\n{size}\n\n{}{after}", MARKERS[0], MARKERS[1]))?;
    }
    for figure in drawn(&reduced) {
        write_text(&checkout.join(format!("docs/{}.svg", figure.name)), &svg::draw(&figure))?;
    }
    let path = checkout.join(REDUCED_FILE);
    reduced.write(&path).map_err(|error| not_written(&path, &error))
}

/// Returns the text before and after the markers.
fn parts(path: &Path) -> Result<(String, String), Failure> {
    let input = |error: &dyn std::fmt::Display| {
        Failure::input(format!("--readme: {}: {error}; give the root of a checkout", path.display()))
    };
    let text = std::fs::read_to_string(path).map_err(|error| input(&error))?;
    let (before, rest) = text.split_once(MARKERS[0]).ok_or_else(|| input(&"has no begin marker"))?;
    let (_, after) = rest.split_once(MARKERS[1]).ok_or_else(|| input(&"has no end marker"))?;
    Ok((before.to_owned(), after.to_owned()))
}

/// Returns the figures of README.md; that of the blocks only where there is a run to draw.
fn drawn(results: &ReproduceResults) -> Vec<Figure> {
    [Some(figures::convergence(results)), figures::rough_terrain(results)].into_iter().flatten().collect()
}

fn short_table(results: &ReproduceResults, claims: &[PaperClaim]) -> String {
    let mut table = "| quantity | paper | quadfrog, simulated | |\n|---|---|---|---|\n".to_owned();
    for claim in claims.iter().filter(|claim| claim.short) {
        table += &format!("| {} | {} | {} | {} |\n", claim.name, claim.paper, claim.ours, claim.judgement.text());
    }
    for Figure { name, caption, .. } in drawn(results) {
        table += &format!("\n![{caption}](docs/{name}.svg)\n\n{caption}\n");
    }
    table
}

fn whole_table(_: &ReproduceResults, claims: &[PaperClaim]) -> String {
    let mut table = "| quantity | the paper states | place | the program computes | judgement and criterion |\n|---|---|---|---|---|\n".to_owned();
    for claim in claims {
        let judgement = claim.reason();
        table +=
            &format!("| {} | \"{}\" | {} | {} | {judgement} |\n", claim.name, claim.sentence, claim.place, claim.ours);
    }
    table
}

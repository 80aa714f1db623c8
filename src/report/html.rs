//! A page as one HTML file that opens without a network: style and figures inside, no scripts, no links.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::page::{Block, Cell, Column, Page, Table};
use super::svg;
use crate::printable::{is_unprintable, printable};

/// Marks a file as a report, which may be overwritten by the next one.
pub const GENERATOR: &str = "quadfrog report";

const STYLE: &str = include_str!("page.css");

/// Returns the page as an HTML document.
pub fn render(page: &Page) -> String {
    let mut numbers = Numbers::default();
    let document = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                (PreEscaped(generator()))
                title { (printable(&page.title)) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    header {
                        h1 { (printable(&page.title)) }
                        @if !page.subtitle.is_empty() { p.subtitle { (printable(&page.subtitle)) } }
                    }
                    @for section in &page.sections {
                        section {
                            h2 { (printable(&section.heading)) }
                            @for part in &section.blocks { (block(part, &mut numbers)) }
                        }
                    }
                }
            }
        }
    };
    document.into_string()
}

/// Whether a text is the beginning of a file that [`render`] made.
pub fn is_report(text: &str) -> bool {
    text.starts_with("<!DOCTYPE html>") && text.contains(&generator())
}

fn generator() -> String {
    format!("<meta name=\"generator\" content=\"{GENERATOR}\">")
}

/// Numbers of the last figure and table.
#[derive(Default)]
struct Numbers {
    figure: u32,
    table: u32,
}

fn block(block: &Block, numbers: &mut Numbers) -> Markup {
    match block {
        Block::Paragraph(text) => html! { p { (printable(text)) } },
        Block::Equation(text) => html! { p.equation { (equation(&printable(text))) } },
        Block::Quote { text, source } => html! {
            blockquote { p { (printable(text)) } footer { (printable(source)) } }
        },
        Block::Table(table) => {
            numbers.table += 1;
            self::table(table, numbers.table)
        }
        Block::Figure(figure) => {
            numbers.figure += 1;
            html! {
                figure id=(figure.name) {
                    div.plot { (PreEscaped(svg::inline(figure))) }
                    figcaption { b { "Figure " (numbers.figure) ". " } (printable(&figure.caption)) }
                }
            }
        }
        Block::Folded { summary, text } => html! {
            details { summary { (printable(summary)) } pre { (lines(text)) } }
        },
    }
}

/// Returns an equation with the words after underscores as indices.
fn equation(text: &str) -> Markup {
    let mut parts = text.split('_');
    let first = parts.next().unwrap_or_default();
    html! {
        (first)
        @for part in parts {
            @let end = part.find(|c: char| !c.is_alphanumeric() && c != '-').unwrap_or(part.len());
            sub { (part[..end]) } (part[end..].replace(" - ", " \u{2212} ").replace("= -", "= \u{2212}"))
        }
    }
}

/// Returns a text with its line breaks and without other control characters.
fn lines(text: &str) -> String {
    let shown = |c: char| if c != '\n' && is_unprintable(c) { printable(&c.to_string()) } else { c.to_string() };
    text.chars().map(shown).collect()
}

fn table(table: &Table, number: u32) -> Markup {
    let class = |column: &Column| if column.text { "text" } else { "number" };
    html! {
        div.table {
            table {
                caption { b { "Table " (number) ". " } (printable(&table.caption)) }
                thead {
                    tr {
                        @for column in &table.columns {
                            th scope="col" class=(class(column)) {
                                (printable(&column.name))
                                @if !column.unit.is_empty() { " " span.unit { "(" (printable(&column.unit)) ")" } }
                            }
                        }
                    }
                }
                tbody {
                    @for row in &table.rows {
                        tr {
                            @for (column, cell) in table.columns.iter().zip(row) {
                                td class=(class(column)) { (shown(column, cell)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Returns a cell as it is shown, with the signs of print in columns of numbers.
fn shown(column: &Column, cell: &Cell) -> String {
    match cell {
        Cell::Text(text) if !column.text => printable(text).replace("+-", "\u{b1}"),
        Cell::Number { .. } => cell.shown().replace('-', "\u{2212}"),
        Cell::Missing => "\u{2013}".to_owned(),
        Cell::Text(_) => printable(&cell.shown()),
    }
}

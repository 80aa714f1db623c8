//! A page as text for a terminal.

use std::collections::BTreeSet;

use super::page::{Block, Cell, Column, Page, Table};
use crate::printable::{is_unprintable, printable};

/// Least width of a column of wrapped text, characters.
const LEAST_TEXT: usize = 16;

/// Returns the page as lines of at most `width` characters where its words allow that; no figures, no folded texts, no
/// control characters but line breaks.
pub fn render(page: &Page, width: usize) -> String {
    let mut text = heading(&page.title, '=');
    if !page.subtitle.is_empty() {
        text += &paragraph(&page.subtitle, width, "");
    }
    for section in &page.sections {
        let parts: Vec<String> = section.blocks.iter().filter_map(|part| block(part, width)).collect();
        if !parts.is_empty() {
            text += &format!("\n{}{}", heading(&section.heading, '-'), parts.join("\n"));
        }
    }
    text
}

fn heading(title: &str, underline: char) -> String {
    let title = printable(title);
    let line: String = std::iter::repeat_n(underline, title.chars().count()).collect();
    format!("{title}\n{line}\n")
}

fn block(block: &Block, width: usize) -> Option<String> {
    match block {
        Block::Paragraph(text) => Some(paragraph(text, width, "")),
        Block::Equation(text) => Some(paragraph(text, width, "    ")),
        Block::Quote { text, source } => Some(paragraph(&format!("\"{text}\" ({source})"), width, "  | ")),
        Block::Table(table) => Some(self::table(table, width)),
        Block::Figure(_) | Block::Folded { .. } => None,
    }
}

fn paragraph(text: &str, width: usize, indent: &str) -> String {
    let lines = text.lines().flat_map(|line| wrapped(line, width.saturating_sub(indent.len()).max(LEAST_TEXT)));
    lines.map(|line| format!("{indent}{line}\n")).collect()
}

/// Returns the lines of a text, broken at spaces; a longer word has a line of its own.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let text: String =
        text.chars().map(|c| if is_unprintable(c) { printable(&c.to_string()) } else { c.into() }).collect();
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("there is a first line");
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

/// Returns a table in columns; one that is wider than `width` continues below with the columns that name a row repeated.
fn table(table: &Table, width: usize) -> String {
    let cell = |row: &[Cell], at: usize| row.get(at).map_or_else(String::new, |cell| printable(&cell.shown()));
    let natural: Vec<usize> = (0..table.columns.len())
        .map(|at| {
            let cells = table.rows.iter().map(|row| cell(row, at).chars().count());
            cells.max().unwrap_or(0).max(header_width(&table.columns[at]))
        })
        .collect();
    let mut text = if table.caption.is_empty() { String::new() } else { paragraph(&table.caption, width, "") };
    for (part, group) in groups(&natural, table, width).into_iter().enumerate() {
        if part > 0 {
            text.push('\n');
        }
        let others: usize = group.iter().filter(|&&at| !table.columns[at].text).map(|&at| natural[at] + 2).sum();
        let texts = group.iter().filter(|&&at| table.columns[at].text).count().max(1);
        let share = (width.saturating_sub(others) / texts).saturating_sub(2).max(LEAST_TEXT);
        let fits = group.iter().map(|&at| natural[at] + 2).sum::<usize>() <= width + 2;
        let widths: Vec<usize> = group
            .iter()
            .map(|&at| if table.columns[at].text && !fits { natural[at].min(share) } else { natural[at] })
            .collect();
        let head = group.iter().zip(&widths).map(|(&at, &width)| header(&table.columns[at], width)).collect();
        let rows = table
            .rows
            .iter()
            .map(|row| group.iter().zip(&widths).map(|(&at, &width)| wrapped(&cell(row, at), width)).collect());
        for (number, cells) in std::iter::once::<Vec<Vec<String>>>(head).chain(rows).enumerate() {
            for line in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
                let mut whole = String::new();
                for ((cell, &width), &at) in cells.iter().zip(&widths).zip(&group) {
                    let part = cell.get(line).map_or("", String::as_str);
                    whole +=
                        &if table.columns[at].text { format!("{part:<width$}  ") } else { format!("{part:>width$}  ") };
                }
                text += whole.trim_end();
                text.push('\n');
            }
            if number == 0 {
                let rule: Vec<String> = widths.iter().map(|&width| "-".repeat(width)).collect();
                text += &(rule.join("  ") + "\n");
            }
        }
    }
    text
}

/// Least width of a column's header: its longest word, or its unit.
fn header_width(column: &Column) -> usize {
    let longest = printable(&column.name).split_whitespace().map(|word| word.chars().count()).max().unwrap_or(0);
    longest.max(unit(column).chars().count())
}

fn unit(column: &Column) -> String {
    if column.unit.is_empty() { String::new() } else { format!("({})", printable(&column.unit)) }
}

/// Returns the lines of a column's header; the unit is on a line of its own where it does not fit.
fn header(column: &Column, width: usize) -> Vec<String> {
    let mut lines = wrapped(&column.name, width);
    let unit = unit(column);
    if let Some(last) = lines.last_mut()
        && !unit.is_empty()
    {
        if last.chars().count() + 1 + unit.chars().count() <= width {
            *last += &format!(" {unit}");
        } else {
            lines.push(unit);
        }
    }
    lines
}

/// Returns the number of columns that name a row: the first one, and the columns of text after it that tell rows with equal names
/// apart; the first one alone where none do.
fn name_columns(table: &Table) -> usize {
    let texts = table.columns.iter().skip(1).take_while(|column| column.text).count();
    let differ = |count: &usize| {
        let name = |row: &Vec<Cell>| row.iter().take(*count).map(Cell::shown).collect::<Vec<_>>();
        let names: BTreeSet<_> = table.rows.iter().map(name).collect();
        names.len() == table.rows.len()
    };
    (1..=1 + texts).find(differ).unwrap_or(1)
}

/// Returns the columns that stand side by side; the columns that name a row begin each group.
fn groups(natural: &[usize], table: &Table, width: usize) -> Vec<Vec<usize>> {
    let (columns, names) = (&table.columns, name_columns(table));
    let needed = |at: usize| if columns[at].text { natural[at].min(LEAST_TEXT) } else { natural[at] } + 2;
    let mut groups: Vec<Vec<usize>> = vec![Vec::new()];
    let mut used = 0;
    for at in 0..natural.len() {
        if used + needed(at) > width + 2 && groups.last().is_some_and(|group| group.len() > names) {
            groups.push((0..names).collect());
            used = (0..names).map(needed).sum();
        }
        used += needed(at);
        groups.last_mut().expect("there is a first group").push(at);
    }
    groups
}

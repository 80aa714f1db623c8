//! A report's page as data: sections of paragraphs, equations, quotes, tables, figures and folded texts.
//!
//! ```text
//! Page { title, subtitle, sections }
//!   Section { heading, blocks }
//!     Block = Paragraph | Equation | Quote | Table | Figure | Folded
//!       Table { caption, columns: [Column { name, unit, text }], rows: [[Cell]] }
//!         Cell = Text | Number { value, digits, mark } | Missing
//! ```
//!
//! Texts are plain: no markup, any characters. `src/report/html.rs` and `src/report/text.rs` escape them.
//!
//! ```
//! use quadfrog::report::page::{Block, Cell, Column, Page, Section, Table};
//! let mut table = Table::new("Best of each study.", [Column::text("study"), Column::number("J", "m")]);
//! table.rows.push(vec![Cell::text("forward, seed 0"), Cell::number(0.712, 3)]);
//! let mut section = Section::new("Results");
//! section.blocks.push(Block::Table(table));
//! let page = Page { sections: vec![section], ..Page::new("Report", "simulated") };
//! assert!(quadfrog::report::html::render(&page).contains("0.712"));
//! assert!(quadfrog::report::text::render(&page, 80).contains("0.712"));
//! ```

use serde::{Serialize, Serializer};
use serde_json::Value;

use super::figure::Figure;

/// Short name, for modules that fill tables.
pub use self::TableColumn as Column;

/// A page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Page {
    /// Title.
    pub title: String,
    /// Line below the title.
    pub subtitle: String,
    /// Sections in their order.
    pub sections: Vec<Section>,
}

impl Page {
    /// A page without sections.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Page {
        Page { title: title.into(), subtitle: subtitle.into(), sections: Vec::new() }
    }

    /// All figures in their order.
    pub fn figures(&self) -> impl Iterator<Item = &Figure> {
        self.sections.iter().flat_map(|section| &section.blocks).filter_map(|block| match block {
            Block::Figure(figure) => Some(figure),
            _ => None,
        })
    }

    /// Returns the page as JSON: the same shape, numbers unrounded, a missing number as null.
    pub fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("a page is made of texts, numbers and lists")
    }
}

/// A headed section.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Section {
    /// Heading.
    pub heading: String,
    /// Contents in their order.
    pub blocks: Vec<Block>,
}

impl Section {
    /// A section without contents.
    pub fn new(heading: impl Into<String>) -> Section {
        Section { heading: heading.into(), blocks: Vec::new() }
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, text: impl Into<String>) {
        self.blocks.push(Block::Paragraph(text.into()));
    }
}

/// One part of a section.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Block {
    /// A paragraph.
    Paragraph(String),
    /// A displayed equation, as plain text.
    Equation(String),
    /// A sentence of another document.
    #[expect(missing_docs, reason = "the names say it")]
    Quote { text: String, source: String },
    /// A table.
    Table(Table),
    /// A figure; left out of text.
    Figure(Figure),
    /// A long text that is folded below its summary in HTML, and left out of text for a terminal.
    #[expect(missing_docs, reason = "the names say it")]
    Folded { summary: String, text: String },
}

/// A table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Caption; empty for none.
    pub caption: String,
    /// Columns.
    pub columns: Vec<Column>,
    /// Rows of as many cells as there are columns.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(caption: impl Into<String>, columns: impl IntoIterator<Item = Column>) -> Table {
        Table { caption: caption.into(), columns: columns.into_iter().collect(), rows: Vec::new() }
    }
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableColumn {
    /// Name.
    pub name: String,
    /// Unit; empty for a text or a pure number.
    pub unit: String,
    /// Whether it holds texts, which are left-aligned.
    pub text: bool,
}

impl TableColumn {
    /// A column of texts.
    pub fn text(name: impl Into<String>) -> Column {
        Column { name: name.into(), unit: String::new(), text: true }
    }

    /// A column of numbers.
    pub fn number(name: impl Into<String>, unit: impl Into<String>) -> Column {
        Column { name: name.into(), unit: unit.into(), text: false }
    }

    /// Name with the unit in brackets.
    pub fn header(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A text.
    Text(String),
    /// A number, shown with so many decimal places and a mark behind it, often none; one that is not finite is shown as missing.
    #[expect(missing_docs, reason = "the names say it")]
    Number { value: f64, digits: usize, mark: &'static str },
    /// No value.
    Missing,
}

impl Cell {
    /// A text.
    pub fn text(text: impl Into<String>) -> Cell {
        Cell::Text(text.into())
    }

    /// A number.
    pub fn number(value: f64, digits: usize) -> Cell {
        Cell::optional(Some(value), digits)
    }

    /// A count.
    pub fn count(value: usize) -> Cell {
        Cell::number(value as f64, 0)
    }

    /// A number, or none.
    pub fn optional(value: Option<f64>, digits: usize) -> Cell {
        value.map_or(Cell::Missing, |value| Cell::Number { value, digits, mark: "" })
    }

    /// The same number with a mark behind it.
    pub fn marked(mut self, with: &'static str) -> Cell {
        if let Cell::Number { mark, .. } = &mut self {
            *mark = with;
        }
        self
    }

    /// Returns the cell as it is shown; `-` where a value is missing.
    pub fn shown(&self) -> String {
        match self {
            Cell::Text(text) => text.clone(),
            Cell::Number { value, digits, mark } if value.is_finite() => {
                let text = format!("{value:.digits$}");
                let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
                let space = if mark.is_empty() { "" } else { " " };
                format!("{}{space}{mark}", if zero { text.trim_start_matches('-') } else { &text })
            }
            Cell::Number { .. } | Cell::Missing => "-".to_owned(),
        }
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Cell::Text(text) => serializer.serialize_str(text),
            Cell::Number { value, digits: 0, .. } if value.abs() < 1e15 && value.fract() == 0.0 => {
                serializer.serialize_i64(*value as i64)
            }
            Cell::Number { value, .. } => serializer.serialize_f64(*value),
            Cell::Missing => serializer.serialize_none(),
        }
    }
}

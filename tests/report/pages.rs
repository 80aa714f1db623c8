//! Figures and pages of reports: well-formed, self-contained, legible without colour, texts escaped.

use quadfrog::report::figure::{Axis, Figure, Panel, Series, Style, thinned};
use quadfrog::report::page::{Block, Cell, Column, Page, Section, Table};
use quadfrog::report::{html, svg, text};
use xml::reader::{EventReader, XmlEvent};

const HOSTILE: &str = "<script>alert('x')</script> & \"quoted\" \u{1b}[2J\u{202e} end";

/// The elements of an XML document; fails where it is not well-formed.
fn elements(document: &str) -> Vec<String> {
    let mut names = Vec::new();
    for event in EventReader::from_str(document) {
        match event.unwrap_or_else(|error| panic!("{error}:\n{document}")) {
            XmlEvent::StartElement { name, .. } => names.push(name.local_name),
            _ => continue,
        }
    }
    names
}

fn figure() -> Figure {
    let mut curve = Panel::new(HOSTILE, Axis::new("Time since the impulse", "s"), Axis::new("Pitch", "rad"));
    curve.series.push(Series::line(HOSTILE, 0, (0..5000).map(|i| [f64::from(i) * 1e-3, f64::from(i % 700).sin()])));
    curve.series.push(Series::line("gap", 2, [[0.0, 0.0], [1.0, f64::NAN], [2.0, 0.3], [3.0, 0.1]]));
    curve.series.push(Series::band("mean and spread", 3, [[0.0, 0.1, 0.1], [4.0, 0.4, 0.2]]));
    curve.limit("limit", 0.9);
    let mut map = Panel::new("", Axis::new("x", "m"), Axis::new("y", "m"));
    map.equal = true;
    map.series.push(Series::arrows("landed", 0, [[0.5, 0.0, 0.1], [0.6, 0.02, f64::INFINITY]]));
    map.series.push(Series::points("fell", 1, [[0.1, -0.1]]));
    let mut peak = Panel::new("", Axis::named("Joint", ["hip", "thigh", "calf"]), Axis::new("Torque", "N m"));
    peak.series.push(Series::marks("largest", 6, [[0.0, 23.7], [1.0, 23.7], [2.0, 35.55]]));
    peak.series.push(Series::step("", 4, [[0.0, 3.0], [1.0, 4.0]]));
    Figure::new("all-shapes", HOSTILE, 2, [curve, map, peak, Panel::new("", Axis::new("a", "m"), Axis::new("b", "N"))])
}

#[test]
fn a_figure_is_a_well_formed_svg_with_the_unit_of_every_axis() {
    let drawn = svg::draw(&figure());
    let names = elements(&drawn);
    for name in ["svg", "title", "polyline", "circle", "polygon", "rect", "text"] {
        assert!(names.iter().any(|known| known == name), "there is no <{name}>");
    }
    assert!(!names.iter().any(|name| name == "script"));
    for label in ["Time since the impulse (s)", "Pitch (rad)", "x (m)", "y (m)", "Torque (N m)", "hip", "calf"] {
        assert!(drawn.contains(&format!("\n{label}\n")), "there is no label {label}");
    }
    assert!(!drawn.contains("NaN") && !drawn.contains("inf") && !drawn.contains('\u{1b}'));
}

/// Regression: ticks between -0.1 and 0 had lost their sign.
#[test]
fn the_labels_of_a_narrow_axis_keep_their_sign() {
    let mut roll = Panel::new("", Axis::new("Time", "s"), Axis::new("Roll", "rad"));
    roll.series.push(Series::line("", 0, [[0.0, -0.045], [1.0, 0.045]]));
    let drawn = svg::draw(&Figure::new("roll", "", 1, [roll]));
    for label in ["\u{2212}0.04", "\u{2212}0.02", "0.00", "0.02", "0.04"] {
        assert_eq!(drawn.matches(&format!("\n{label}\n")).count(), 1, "{label}");
    }
}

#[test]
fn no_two_styles_look_the_same_without_colour() {
    for a in 0..7 {
        for b in 0..a {
            let [first, second] = [a, b].map(Style::of);
            assert!((first.dash, first.marker) != (second.dash, second.marker), "{a} and {b}");
            assert_ne!(first.dash, second.dash, "lines {a} and {b}");
        }
    }
}

#[test]
fn a_thinned_line_keeps_its_peaks_and_its_order() {
    let mut points: Vec<[f64; 2]> = (0..3000).map(|i| [f64::from(i), 0.0]).collect();
    points[1234][1] = 7.0;
    points[1235][1] = -7.0;
    let kept = thinned(&points, 100);
    assert!(kept.len() <= 200 && kept.contains(&[1234.0, 7.0]) && kept.contains(&[1235.0, -7.0]));
    assert!(kept.windows(2).all(|pair| pair[0][0] < pair[1][0]));
}

fn page() -> Page {
    let columns = [Column::text("trial"), Column::number("J", "m"), Column::text("note")];
    let mut table = Table::new(HOSTILE, columns);
    table.rows.push(vec![Cell::text("3"), Cell::number(0.712_345_678, 3), Cell::text(HOSTILE.repeat(4))]);
    table.rows.push(vec![Cell::text("4"), Cell::Missing, Cell::text("")]);
    table.rows.push(vec![Cell::text("5"), Cell::number(-0.000_01, 3), Cell::text("")]);
    let mut section = Section::new(HOSTILE);
    section.paragraph(HOSTILE);
    section.blocks.extend([
        Block::Equation("J = x_final - x_init".into()),
        Block::Quote { text: HOSTILE.into(), source: HOSTILE.into() },
        Block::Table(table),
        Block::Figure(figure()),
        Block::Folded { summary: HOSTILE.into(), text: format!("{HOSTILE}\nsecond line") },
    ]);
    Page { sections: vec![section], ..Page::new(HOSTILE, HOSTILE) }
}

#[test]
fn a_page_is_one_html_file_without_scripts_and_references() {
    let document = html::render(&page());
    assert!(html::is_report(&document) && !html::is_report("<!DOCTYPE html><html></html>"));
    for reference in ["<script", "http:", "https:", "src=", "href=", "url(", "@import", "\u{1b}", "\u{202e}"] {
        assert!(!document.contains(reference), "the page contains {reference}");
    }
    assert!(document.contains("&lt;script&gt;") && document.contains("\\u001b[2J"));
    // HTML without void elements is XML.
    let closed = document.replace("<!DOCTYPE html>", "").replace("\">", "\" >");
    let closed = closed.split("<meta").map(|part| part.to_owned()).collect::<Vec<_>>();
    let xml: String = closed
        .iter()
        .enumerate()
        .map(|(i, part)| if i == 0 { part.clone() } else { format!("<meta{}", part.replacen(" >", "/>", 1)) })
        .collect();
    let names = elements(&xml);
    for name in ["title", "h1", "h2", "table", "caption", "figure", "svg", "figcaption", "blockquote", "details"] {
        assert!(names.iter().any(|known| known == name), "there is no <{name}>");
    }
}

#[test]
fn a_page_as_text_is_narrow_and_has_no_control_characters() {
    let shown = text::render(&page(), 80);
    assert!(shown.chars().all(|c| c == '\n' || !c.is_control()), "{shown}");
    assert!(!shown.contains('\u{202e}') && shown.contains("\\u001b[2J"));
    for line in shown.lines().skip(2) {
        assert!(line.chars().count() <= 80 || line.chars().all(|c| c == '-'), "{line}");
    }
    assert!(shown.contains("0.712") && shown.contains("  0.000"), "{shown}");
}

#[test]
fn a_table_wider_than_the_terminal_continues_below_with_its_first_column() {
    let columns =
        [Column::text("trial")].into_iter().chain((0..12).map(|i| Column::number(format!("quantity {i}"), "m")));
    let mut table = Table::new("", columns);
    table.rows.push([Cell::text("first")].into_iter().chain((0..12).map(|i| Cell::number(f64::from(i), 2))).collect());
    let mut section = Section::new("Wide");
    section.blocks.push(Block::Table(table));
    let shown = text::render(&Page { sections: vec![section], ..Page::new("Page", "") }, 80);
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
    assert_eq!(shown.matches("first").count(), 2, "{shown}");
    assert!(shown.contains("(m)") && shown.contains("11.00"), "{shown}");
}

/// Regression: a continued table repeated its first column alone, so that rows were alike.
#[test]
fn a_continued_table_repeats_every_column_that_names_a_row() {
    let names = ["configuration", "task"].map(Column::text);
    let columns = names.into_iter().chain((0..12).map(|i| Column::number(format!("quantity {i}"), "m")));
    let mut table = Table::new("", columns);
    for task in ["forward", "lateral"] {
        let names = ["noisy", task].map(Cell::text);
        table.rows.push(names.into_iter().chain((0..12).map(|i| Cell::number(f64::from(i), 2))).collect());
    }
    let mut section = Section::new("Wide");
    section.blocks.push(Block::Table(table));
    let shown = text::render(&Page { sections: vec![section], ..Page::new("Page", "") }, 80);
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
    let parts = shown.matches("configuration").count();
    assert!(parts > 1, "{shown}");
    for task in ["forward", "lateral"] {
        assert_eq!(shown.matches(&format!("noisy          {task}")).count(), parts, "{shown}");
    }
}

#[test]
fn a_page_as_json_has_unrounded_numbers_and_null_for_none() {
    let json = page().to_json();
    let table = &json["sections"][0]["blocks"][3]["table"];
    assert_eq!(table["rows"][0][1], 0.712_345_678);
    assert!(table["rows"][1][1].is_null());
    assert_eq!(table["columns"][1]["unit"], "m");
    assert!(json["sections"][0]["blocks"][4]["figure"]["panels"][0]["series"][0]["shape"]["line"].is_array());
}

//! The bytes of changed cells, as a terminal draws them.

use std::num::NonZeroU16;

use proptest::prelude::*;
use quadfrog_console::cell_encoder::{PlacedCell, encode};
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::buffer::Cell;
use ratatui::style::{Color, Modifier};

const COLUMNS: u16 = 30;
const ROWS: u16 = 8;

fn colours() -> impl Strategy<Value = Color> {
    prop_oneof![
        Just(Color::Reset),
        Just(Color::Cyan),
        Just(Color::LightRed),
        Just(Color::DarkGray),
        Just(Color::White),
        any::<u8>().prop_map(Color::Indexed),
        any::<(u8, u8, u8)>().prop_map(|(r, g, b)| Color::Rgb(r, g, b)),
    ]
}

/// Cells of few styles at random places, in the order of rows, as ratatui gives them.
fn frames() -> impl Strategy<Value = Vec<(u16, u16, Cell)>> {
    // Bold and dim together mean different things to different terminals.
    let faint = Modifier::all().difference(Modifier::BOLD);
    let modifiers = vec![Modifier::empty(), Modifier::BOLD, Modifier::DIM, Modifier::REVERSED, faint];
    let style = (colours(), colours(), proptest::sample::select(modifiers));
    let symbols = proptest::sample::select(vec!["a", " ", "7", "─", "░", "⣿", "é", "≥", "→"]);
    let place = (0..COLUMNS, 0..ROWS);
    proptest::collection::vec(style, 1..5).prop_flat_map(move |styles| {
        let cell = (symbols.clone(), 0..styles.len());
        proptest::collection::btree_map(place.clone(), cell, 0..120).prop_map(move |cells| {
            let mut cells: Vec<_> = cells
                .into_iter()
                .map(|((x, y), (symbol, style))| {
                    let (fg, bg, modifier) = styles[style];
                    let mut cell = Cell::default();
                    cell.set_symbol(symbol).set_fg(fg).set_bg(bg);
                    cell.modifier = modifier;
                    (x, y, cell)
                })
                .collect();
            cells.sort_by_key(|(x, y, _)| (*y, *x));
            cells
        })
    })
}

fn placed(cells: &[(u16, u16, Cell)]) -> Vec<PlacedCell<'_>> {
    cells.iter().map(|(x, y, cell)| (*x, *y, cell)).collect()
}

/// The bytes as the library of the terminal writes them.
fn reference(cells: &[(u16, u16, Cell)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    CrosstermBackend::new(&mut bytes).draw(placed(cells).into_iter()).expect("a vector takes every byte");
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Two frames one after the other, drawn by both encodings, give the same screen.
    #[test]
    fn the_screen_is_that_of_the_library((first, second) in (frames(), frames())) {
        let size = |n| NonZeroU16::new(n).expect("the terminal has cells");
        let mut ours = vt100::Parser::new(size(ROWS), size(COLUMNS), 0);
        let mut theirs = vt100::Parser::new(size(ROWS), size(COLUMNS), 0);
        for cells in [&first, &second] {
            ours.process(&encode(&placed(cells)));
            theirs.process(&reference(cells));
        }
        for (row, column) in (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column))) {
            let (ours, theirs) = (ours.screen().cell(row, column), theirs.screen().cell(row, column));
            prop_assert_eq!(ours, theirs, "column {}, row {}", column, row);
        }
    }
}

/// No cell, no byte.
#[test]
fn an_unchanged_screen_costs_nothing() {
    assert!(encode(&[]).is_empty());
}

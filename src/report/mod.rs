//! Reports: typed figures and pages, and their forms as SVG, HTML, text and JSON; tables of trials.
//!
//! A [`page::Page`] has headed sections of paragraphs, equations, quotes, [`page::Table`]s, [`figure::Figure`]s and folded
//! texts. It is data alone: a report fills pages and figures and never writes markup.
//!
//! | function | form |
//! |---|---|
//! | [`svg::draw`] | one figure as an SVG document |
//! | [`html::render`] | a page as one HTML file: figures inline, nothing from elsewhere, no scripts |
//! | [`text::render`] | a page for a terminal: tables, no figures, control characters replaced |
//! | [`page::Page::to_json`] | a page as JSON, numbers unrounded |

pub mod columns;
pub mod configuration;
pub mod figure;
pub mod html;
pub mod jump;
pub mod page;
pub mod recorded;
pub mod signals;
pub mod study;
pub mod study_figures;
pub mod study_page;
mod study_tables;
pub mod svg;
pub mod table;
pub mod text;
pub mod ticks;
pub mod trial_columns;

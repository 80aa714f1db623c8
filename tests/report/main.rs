//! Tests of pages and tables of a report, as one program: each file is a module.

mod configuration;
mod pages;
mod signals;
mod study;
mod ticks;

//! Tests of the simulator: contact, flight, terrain, devices, robots, as one program: each file is a module.

#[path = "../support/mod.rs"]
mod support;

mod contact;
mod devices;
mod flight;
mod robots;
mod terrain;
mod terrain_search;

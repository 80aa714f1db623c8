//! Pictures of pixels in terminals that show them: choice of the protocol, and its bytes.
//!
//! Protocols: the terminal graphics protocol of kitty (<https://sw.kovidgoyal.net/kitty/graphics-protocol/>), sixel (DEC
//! STD 070, chapter "Sixel Graphics"), inline images of iTerm2 (<https://iterm2.com/documentation-images.html>).

pub mod raster;
mod sixel;

use std::fmt::Write as _;
use std::io;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use png::{BitDepth, ColorType, Compression, Filter};
use ratatui::layout::Rect;
use serde::Deserialize;

use crate::theme::{Background, Colours, Glyphs, Theme};
use raster::Raster;

/// Pictures of pixels by the settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GraphicsChoice {
    /// As the environment says, or as the terminal reports its abilities.
    Auto,
    /// None: characters.
    Cells,
    /// The terminal graphics protocol of kitty.
    Kitty,
    /// Sixel.
    Sixel,
    /// Inline images of iTerm2.
    Iterm2,
}

/// Protocol of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum GraphicsProtocol {
    Kitty,
    Sixel,
    Iterm2,
}

/// The protocol of a terminal, as far as the settings and the environment decide it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GraphicsSupport {
    /// None: characters.
    Cells,
    /// The terminal shows pictures of this protocol.
    Protocol(GraphicsProtocol),
    /// Sixel, if the terminal reports it in its primary device attributes.
    Asked,
}

impl GraphicsSupport {
    /// Chooses the protocol from the settings and the environment; `variable` returns an environment variable.
    ///
    /// A multiplexer keeps pictures to itself and its clients differ: within one only a setting chooses a protocol.
    pub fn detect(
        choice: GraphicsChoice,
        theme: &Theme,
        low_bandwidth: bool,
        variable: impl Fn(&str) -> Option<String>,
    ) -> GraphicsSupport {
        if low_bandwidth || theme.glyphs == Glyphs::Ascii || theme.colours == Colours::None {
            return GraphicsSupport::Cells;
        }
        let filled = |name: &str| variable(name).filter(|value| !value.is_empty());
        let term = filled("TERM").unwrap_or_default();
        let program = filled("TERM_PROGRAM").unwrap_or_default();
        let multiplexed = ["TMUX", "STY", "ZELLIJ"].into_iter().any(|name| filled(name).is_some())
            || ["screen", "tmux"].into_iter().any(|name| term.starts_with(name));
        match choice {
            GraphicsChoice::Cells => GraphicsSupport::Cells,
            GraphicsChoice::Kitty => GraphicsSupport::Protocol(GraphicsProtocol::Kitty),
            GraphicsChoice::Sixel => GraphicsSupport::Protocol(GraphicsProtocol::Sixel),
            GraphicsChoice::Iterm2 => GraphicsSupport::Protocol(GraphicsProtocol::Iterm2),
            GraphicsChoice::Auto if multiplexed || term.is_empty() || term == "dumb" || term == "linux" => {
                GraphicsSupport::Cells
            }
            GraphicsChoice::Auto if ["xterm-kitty", "xterm-ghostty"].contains(&term.as_str()) => {
                GraphicsSupport::Protocol(GraphicsProtocol::Kitty)
            }
            GraphicsChoice::Auto
                if ["iTerm.app", "WezTerm"].contains(&program.as_str())
                    || filled("LC_TERMINAL").is_some_and(|name| name == "iTerm2") =>
            {
                GraphicsSupport::Protocol(GraphicsProtocol::Iterm2)
            }
            GraphicsChoice::Auto if term.starts_with("foot") || term.starts_with("mlterm") => {
                GraphicsSupport::Protocol(GraphicsProtocol::Sixel)
            }
            GraphicsChoice::Auto => GraphicsSupport::Asked,
        }
    }
}

/// Identifier of the console's picture in the protocol of kitty.
const KITTY_ID: u32 = 0x7166;
/// Longest part of a picture in one sequence of kitty, characters.
const KITTY_PART: usize = 4096;

/// A picture in the bytes of a protocol.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedPicture {
    /// Cells below the picture.
    pub area: Rect,
    /// Shows the picture.
    pub show: Vec<u8>,
    /// Removes it and leaves blank cells.
    pub remove: Vec<u8>,
}

impl EncodedPicture {
    /// A picture over the cells of `area`. Its lines fade into black or white, by `background`, where the protocol has no
    /// opacity.
    ///
    /// # Errors
    /// When the library for PNG refuses the picture.
    pub fn new(
        protocol: GraphicsProtocol,
        raster: &Raster,
        area: Rect,
        background: Background,
    ) -> io::Result<EncodedPicture> {
        let mut show = to_place(area.x, area.y);
        let remove = match protocol {
            GraphicsProtocol::Kitty => {
                write_kitty(&mut show, &BASE64.encode(png_of(raster)?), area);
                format!("\x1b_Ga=d,d=I,i={KITTY_ID},q=2\x1b\\").into_bytes()
            }
            GraphicsProtocol::Iterm2 => {
                let file = png_of(raster)?;
                let _ = write!(
                    show,
                    "\x1b]1337;File=inline=1;size={};width={};height={};preserveAspectRatio=0;doNotMoveCursor=1:{}\x07",
                    file.len(),
                    area.width,
                    area.height,
                    BASE64.encode(&file)
                );
                erase(area)
            }
            GraphicsProtocol::Sixel => {
                sixel::write(&mut show, raster, background);
                erase(area)
            }
        };
        Ok(EncodedPicture { area, show: show.into_bytes(), remove })
    }
}

/// Moves the cursor to a cell, from 0 (ECMA-48, CUP).
fn to_place(column: u16, row: u16) -> String {
    format!("\x1b[{};{}H", row + 1, column + 1)
}

/// Blanks the cells of an area without colours (ECMA-48, ECH).
fn erase(area: Rect) -> Vec<u8> {
    let rows = (area.top()..area.bottom()).map(|row| format!("{}\x1b[{}X", to_place(area.x, row), area.width));
    format!("\x1b[0m{}", rows.collect::<String>()).into_bytes()
}

/// Writes a PNG file in base 64 as the picture of kitty over an area, in parts; the cursor stays and no answer is sent.
fn write_kitty(to: &mut String, file: &str, area: Rect) {
    let mut controls = format!("a=T,f=100,i={KITTY_ID},p=1,q=2,C=1,c={},r={},", area.width.max(1), area.height.max(1));
    let mut rest = file;
    loop {
        let (part, next) = rest.split_at(rest.len().min(KITTY_PART));
        let more = u8::from(!next.is_empty());
        let _ = write!(to, "\x1b_G{controls}m={more};{part}\x1b\\");
        // The further parts need only this one, which suppresses the answers.
        controls = "q=2,".to_owned();
        rest = next;
        if next.is_empty() {
            return;
        }
    }
}

/// The picture as a PNG file with a palette.
fn png_of(raster: &Raster) -> io::Result<Vec<u8>> {
    let palette = raster.palette();
    let (width, height) = raster.size;
    let (depth, bits) = if palette.len() <= 16 { (BitDepth::Four, 4) } else { (BitDepth::Eight, 8) };
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(depth);
    encoder.set_palette(palette.iter().flat_map(|((red, green, blue), _)| [*red, *green, *blue]).collect::<Vec<u8>>());
    encoder.set_trns(palette.iter().map(|(_, opacity)| (opacity * 255.0).round() as u8).collect::<Vec<u8>>());
    encoder.set_compression(Compression::High);
    // Rows of indices resemble each other, but their differences mean nothing.
    encoder.set_filter(Filter::NoFilter);
    let rows = raster.pixels.chunks(width.max(1));
    let packed: Vec<u8> = match bits {
        4 => rows.flat_map(|row| row.chunks(2).map(|pair| pair[0] << 4 | pair.get(1).copied().unwrap_or(0))).collect(),
        _ => rows.flatten().copied().collect(),
    };
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&packed)?;
    writer.finish()?;
    Ok(file)
}

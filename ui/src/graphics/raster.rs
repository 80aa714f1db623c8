//! Pixels of a few colours on a transparent ground, and anti-aliased lines on them.

use nalgebra::Point2;

/// Steps of opacity of a colour: with five colours and the ground 16 values, four bits of a PNG.
pub const OPACITIES: u8 = 3;
/// Most entries of the palette: an index has one byte.
const LARGEST_PALETTE: usize = 256;

/// Colour and width of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ink {
    /// Red, green, blue.
    pub rgb: (u8, u8, u8),
    /// 0 to 1.
    pub opacity: f64,
    /// Width of a line and diameter of a dot, pixels.
    pub width: f64,
}

/// A picture of indexed pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Raster {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Row by row from the top: 0 is transparent, `1 + OPACITIES * colour + step` a colour with one of its opacities.
    pub pixels: Vec<u8>,
    colours: Vec<(u8, u8, u8)>,
}

impl Raster {
    /// A transparent picture of `size` columns and rows.
    pub fn new(size: (usize, usize)) -> Raster {
        Raster { size, pixels: vec![0; size.0 * size.1], colours: Vec::new() }
    }

    /// Colour and opacity, 0 to 1, of every value of a pixel.
    pub fn palette(&self) -> Vec<((u8, u8, u8), f64)> {
        let steps = |colour: &(u8, u8, u8)| {
            let colour = *colour;
            (1..=OPACITIES).map(move |step| (colour, f64::from(step) / f64::from(OPACITIES)))
        };
        std::iter::once(((0, 0, 0), 0.0)).chain(self.colours.iter().flat_map(steps)).collect()
    }

    /// Draws a line with round ends; one without length is a dot. Parts outside of the picture are left out.
    pub fn line(&mut self, ink: &Ink, from: Point2<f64>, to: Point2<f64>) {
        let finite = from.coords.iter().chain(to.coords.iter()).all(|value| value.is_finite());
        let Some(colour) = self.colour(ink.rgb).filter(|_| finite) else { return };
        let along = to - from;
        let steep = along.y.abs() > along.x.abs();
        // (main, across): the axis of the longer side, and the other one.
        let axes = |x: f64, y: f64| if steep { (y, x) } else { (x, y) };
        let (main_size, across_size) = if steep { (self.size.1, self.size.0) } else { self.size };
        let ((main_from, across_from), (main_along, across_along)) = (axes(from.x, from.y), axes(along.x, along.y));
        let reach = ink.width / 2.0 + 0.5;
        // The line is at most 45 degrees steep: its border is at most sqrt(2) as far away across.
        let across_reach = reach * std::f64::consts::SQRT_2;
        let main_to = main_from + main_along;
        for main in range(main_from.min(main_to) - reach, main_from.max(main_to) + reach, main_size) {
            let share = if main_along == 0.0 { 0.0 } else { (main as f64 + 0.5 - main_from) / main_along };
            let middle = across_from + share.clamp(0.0, 1.0) * across_along;
            for across in range(middle - across_reach, middle + across_reach, across_size) {
                let (x, y) = if steep { (across, main) } else { (main, across) };
                let center = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
                let nearest = match along.norm_squared() {
                    0.0 => from,
                    length2 => from + along * ((center - from).dot(&along) / length2).clamp(0.0, 1.0),
                };
                let covered = (reach - (center - nearest).norm()).clamp(0.0, 1.0);
                self.set(colour, covered * ink.opacity, x, y);
            }
        }
    }

    /// The index of a colour; none when the palette is full.
    fn colour(&mut self, rgb: (u8, u8, u8)) -> Option<usize> {
        let known = self.colours.iter().position(|colour| *colour == rgb);
        let room = (self.colours.len() + 1) * usize::from(OPACITIES) < LARGEST_PALETTE;
        known.or_else(|| {
            room.then(|| {
                self.colours.push(rgb);
                self.colours.len() - 1
            })
        })
    }

    /// Sets a pixel, unless one of more opacity is there.
    fn set(&mut self, colour: usize, opacity: f64, x: usize, y: usize) {
        let step = (opacity * f64::from(OPACITIES)).round() as u8;
        let pixel = &mut self.pixels[y * self.size.0 + x];
        let present = if *pixel == 0 { 0 } else { (*pixel - 1) % OPACITIES + 1 };
        if step > 0 && step >= present {
            *pixel = colour as u8 * OPACITIES + step;
        }
    }
}

/// The pixels whose centers lie between two places, inside of the picture.
fn range(from: f64, to: f64, size: usize) -> std::ops::Range<usize> {
    let bound = |value: f64| value.clamp(0.0, size as f64) as usize;
    bound((from - 0.5).ceil())..bound((to - 0.5).floor() + 1.0)
}

//! False-colour pictures with a legend, of roulette factors, costs and path counts.
//!
//! The legend is a strip below the picture: a bar of all colours with a tick for every label. Values outside the scale
//! have the colour of its end; pixels without a value are grey.

use embedded_graphics::mono_font::{MonoTextStyle, ascii::FONT_6X10};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{Drawable, Pixel, Point, RgbColor};
use embedded_graphics::text::{Alignment, Text};
use embedded_graphics::{draw_target::DrawTarget, geometry::OriginDimensions, geometry::Size};
use std::convert::Infallible;

/// sRGB stops at equal distances. Red, white, blue: `RdBu` of ColorBrewer with its centre made white.
const DIVERGING: [[u8; 3]; 9] = [
    [103, 0, 31],
    [178, 24, 43],
    [214, 96, 77],
    [244, 165, 130],
    [255, 255, 255],
    [146, 197, 222],
    [67, 147, 195],
    [33, 102, 172],
    [5, 48, 97],
];

/// Dark to light with even steps for the eye: `viridis` of matplotlib.
const SEQUENTIAL: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [40, 174, 128],
    [94, 201, 98],
    [173, 220, 48],
    [253, 231, 37],
];

const NO_VALUE: [u8; 3] = [128; 3];
const PAPER: [u8; 3] = [255; 3];

/// Smallest picture with room for labels.
const NARROWEST: usize = 200;
/// Rows of the legend.
pub const LEGEND: usize = 30;
const MARGIN: usize = 16;
/// First and last row of the bar, from the top of the legend.
const BAR: [usize; 2] = [4, 13];
const TICK: usize = 3;
/// Pixels between two labels, at least, and columns of a character.
const GAP: usize = 6;
const CHARACTER: usize = 6;

/// A logarithmic scale of colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    low: f32,
    high: f32,
    diverging: bool,
}

impl Scale {
    /// Scale of roulette factors, 1/20 to 20: red ends paths, white leaves them, blue splits them.
    pub const FACTORS: Self = Self { low: 0.05, high: 20.0, diverging: true };

    /// Scale of numbers above 0, from the smallest to the 99.9th percentile, widened to 1, 2 or 5 times a power of ten.
    pub fn sequential(values: &[f32]) -> Self {
        // the clamp keeps the ends, and what is computed from them, finite
        let positive = values.iter().filter(|x| **x > 0.0 && x.is_finite());
        let mut sorted: Vec<_> = positive.map(|x| x.clamp(1e-30, 1e30)).collect();
        sorted.sort_by(f32::total_cmp);
        let (Some(&low), Some(&high)) = (sorted.first(), sorted.get(sorted.len() * 999 / 1000)) else {
            return Self { low: 1.0, high: 10.0, diverging: false };
        };
        // rounding must not push a round number to the next one
        let low = round_numbers(low).take_while(|x| *x <= low * 1.0001).last().unwrap_or(low);
        let high = round_numbers(high.max(low)).find(|x| *x >= high * 0.9999 && *x > low).unwrap_or(low * 10.0);
        Self { low, high, diverging: false }
    }

    /// The colour of a value, sRGB; grey for what is not above 0.
    pub fn color(&self, x: f32) -> [u8; 3] {
        if x.is_nan() || x <= 0.0 { NO_VALUE } else { self.at((x / self.low).ln() / (self.high / self.low).ln()) }
    }

    /// The colour at a place of the bar, 0 to 1.
    fn at(&self, t: f32) -> [u8; 3] {
        let stops = if self.diverging { DIVERGING } else { SEQUENTIAL };
        let x = t.clamp(0.0, 1.0) * (stops.len() - 1) as f32;
        let i = (x as usize).min(stops.len() - 2);
        std::array::from_fn(|c| {
            let [a, b] = [stops[i][c], stops[i + 1][c]].map(f32::from);
            (a + (b - a) * (x - i as f32)).round() as u8
        })
    }

    /// Values that are marked, the most important first: ends, middle, powers of ten, others.
    fn ticks(&self) -> Vec<f32> {
        if self.diverging {
            return vec![1.0, 0.05, 20.0, 5.0, 0.2, 2.0, 0.5, 10.0, 0.1];
        }
        let from = round_numbers(self.low).filter(|x| *x >= self.low * 0.999);
        let mut ticks: Vec<_> = from.take_while(|x| *x <= self.high * 1.001).collect();
        let rank = |x: f32| {
            let end = (x / self.low).ln().abs() < 0.01 || (x / self.high).ln().abs() < 0.01;
            let power = (x.log10() - x.log10().round()).abs() < 0.01;
            (!end, !power)
        };
        ticks.sort_by_key(|x| rank(*x));
        ticks
    }

    fn label(&self, x: f32) -> String {
        if self.diverging && x < 0.999 {
            format!("1/{}", (1.0 / x).round())
        } else if !(1e-3..1e4).contains(&x) {
            format!("{x:.0e}")
        } else {
            format!("{}", (f64::from(x) * 1e4).round() / 1e4)
        }
    }
}

/// 1, 2 and 5 times powers of ten, from a little below `x`.
fn round_numbers(x: f32) -> impl Iterator<Item = f32> {
    let first = x.log10().floor() as i32 - 1;
    (first..first + 80).flat_map(|e| [1.0, 2.0, 5.0].map(|m| (m * 10f64.powi(e)) as f32))
}

/// An sRGB picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Columns: those of the values, or what the legend needs.
    pub width: usize,
    /// Rows: those of the values and [`LEGEND`].
    pub height: usize,
    /// Pixels, row by row.
    pub pixels: Vec<[u8; 3]>,
}

/// Draws `values`, rows of `width`, in the top left corner, and the legend with a title below.
pub fn draw(values: &[f32], width: usize, scale: &Scale, title: &str) -> Drawing {
    let rows = values.len() / width.max(1);
    let mut drawing = Drawing::blank(width.max(NARROWEST), rows + LEGEND);
    for (i, x) in values.iter().enumerate() {
        drawing.set(i % width, i / width, scale.color(*x));
    }
    drawing.legend(rows, scale, title);
    drawing
}

impl Drawing {
    fn blank(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![PAPER; width * height] }
    }

    fn set(&mut self, x: usize, y: usize, color: [u8; 3]) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = color;
        }
    }

    /// Below row `top`: the title at the left, then the bar as wide as there is room.
    fn legend(&mut self, top: usize, scale: &Scale, title: &str) {
        self.text(2, top + 3, title, Alignment::Left);
        let first = 2 + title.len() * CHARACTER + MARGIN;
        let last = self.width.saturating_sub(MARGIN).max(first + 1);
        let place = |x: usize| (x - first) as f32 / (last - first) as f32;
        for x in first..=last {
            (BAR[0]..=BAR[1]).for_each(|y| self.set(x, top + y, scale.at(place(x))));
        }
        let mut taken: Vec<[usize; 2]> = Vec::new();
        for tick in scale.ticks() {
            let t = (tick / scale.low).ln() / (scale.high / scale.low).ln();
            let x = first + (t.clamp(0.0, 1.0) * (last - first) as f32).round() as usize;
            (BAR[1]..=BAR[1] + TICK).for_each(|y| self.set(x, top + y, [0; 3]));
            let label = scale.label(tick);
            let half = label.len() * CHARACTER / 2;
            let span = [x.saturating_sub(half), x + half];
            // the most important come first
            if taken.iter().all(|t| span[0] >= t[1] + GAP || span[1] + GAP <= t[0]) {
                taken.push(span);
                self.text(x, top + BAR[1] + TICK + 2, &label, Alignment::Center);
            }
        }
    }

    /// Text whose top is row `y`.
    fn text(&mut self, x: usize, y: usize, text: &str, alignment: Alignment) {
        let style = MonoTextStyle::new(&FONT_6X10, Rgb888::BLACK);
        // the baseline of this font is its eighth row
        let place = Point::new(x as i32, y as i32 + 7);
        let Ok(_) = Text::with_alignment(text, place, style, alignment).draw(self);
    }
}

impl OriginDimensions for Drawing {
    fn size(&self) -> Size {
        Size::new(self.width as u32, self.height as u32)
    }
}

impl DrawTarget for Drawing {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(p, color) in pixels {
            if let (Ok(x), Ok(y)) = (usize::try_from(p.x), usize::try_from(p.y)) {
                self.set(x, y, [color.r(), color.g(), color.b()]);
            }
        }
        Ok(())
    }
}

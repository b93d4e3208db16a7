//! What all figures share: sizes, colours, texts, and SVG in two widths.
//!
//! Figures are drawn in the colours of the light theme, each of which stands for a variable of the page's style sheet:
//! [`Figure::inline`] puts the variables in their places, so that the page's dark theme holds for figures, too. Files
//! of their own keep the colours.

use super::super::tables::number;
use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;

pub(super) type Fault = Box<dyn Error>;
/// The whole of a figure.
pub(super) type Sheet<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Units of the drawing for each pixel of the page: what is drawn has whole coordinates.
pub(super) const UNIT: u32 = 2;

/// Colours, and the variables that they stand for.
const THEME: [(RGBColor, &str); 13] = [
    (INK, "ink"),
    (FAINT, "faint"),
    (GRID, "grid"),
    (PAPER, "paper"),
    (SERIES[0], "s0"),
    (SERIES[1], "s1"),
    (SERIES[2], "s2"),
    (SERIES[3], "s3"),
    (SERIES[4], "s4"),
    (SERIES[5], "s5"),
    (SERIES[6], "s6"),
    (SERIES[7], "s7"),
    (SERIES[8], "s8"),
];

pub(super) const INK: RGBColor = RGBColor(0x1f, 0x23, 0x28);
pub(super) const FAINT: RGBColor = RGBColor(0x59, 0x63, 0x6e);
pub(super) const GRID: RGBColor = RGBColor(0xe1, 0xe4, 0xe8);
pub(super) const PAPER: RGBColor = RGBColor(0xfe, 0xfe, 0xfd);
/// Colours of what is compared, told apart with any colour vision as far as nine can be.
pub(super) const SERIES: [RGBColor; 9] = [
    RGBColor(0xc9, 0x3a, 0x1e),
    RGBColor(0x1f, 0x5f, 0xbf),
    RGBColor(0x12, 0x80, 0x5c),
    RGBColor(0x8a, 0x4f, 0xc7),
    RGBColor(0x0b, 0x8f, 0xa8),
    RGBColor(0xa8, 0x7b, 0x00),
    RGBColor(0xc0, 0x3a, 0x86),
    RGBColor(0x6b, 0x72, 0x80),
    RGBColor(0x6a, 0x8f, 0x1f),
];

/// Colour of a strategy: the same in all figures.
pub(super) fn color_of(name: &str) -> RGBColor {
    SERIES[series_of(name)]
}

/// Number of the colour of a strategy.
pub(crate) fn series_of(name: &str) -> usize {
    const KNOWN: [&str; 8] = ["ears", "classic", "adrrs", "albedo", "throughput", "ears, at most", "threshold", "none"];
    // longer names first: they begin with shorter ones
    let known = KNOWN.iter().enumerate().filter(|(_, k)| name.starts_with(**k)).max_by_key(|(_, k)| k.len());
    known.map_or_else(|| 8 - name.len() % 2 * 3, |(i, _)| i)
}

/// A chart over numbers.
pub(super) type Chart<'a, 'b, X, Y> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, Y>>;

/// Values with labels on a logarithmic scale: 1, 2 and 5 of each power of ten, or fewer, at most `most`.
pub(super) fn log_ticks([low, high]: [f64; 2], most: usize) -> Vec<f64> {
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let of = |digits: &[f64]| -> Vec<f64> {
        let all = powers.clone().flat_map(|p| digits.iter().map(move |d| d * 10f64.powi(p)));
        all.filter(|x| (low..=high).contains(x)).collect()
    };
    let sets = [&[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0][..], &[1.0, 2.0, 5.0], &[1.0, 3.0], &[1.0]];
    let fits = sets.iter().map(|digits| of(digits)).find(|ticks| ticks.len() <= most);
    fits.unwrap_or_else(|| {
        let all = of(&[1.0]);
        let step = all.len().div_ceil(most.max(1));
        all.into_iter().step_by(step).collect()
    })
}

/// Lines and labels at values of a horizontal axis that ends at `y` below and `top` above.
pub(super) fn x_ticks<X: Ranged<ValueType = f64>, Y: Ranged<ValueType = f64>>(
    sheet: &Sheet<'_>,
    chart: &Chart<'_, '_, X, Y>,
    ticks: &[f64],
    [y, top]: [f64; 2],
) -> Result<(), Fault> {
    for x in ticks {
        let (from, to) = (chart.backend_coord(&(*x, y)), chart.backend_coord(&(*x, top)));
        sheet.draw(&PathElement::new([from, to], GRID.stroke_width(UNIT)))?;
        let below = (from.0, from.1 + Layout::px(6) as i32);
        sheet.draw(&Text::new(number(*x), below, text(FAINT, HPos::Center, VPos::Top)))?;
    }
    Ok(())
}

/// The same of a vertical axis.
pub(super) fn y_ticks<X: Ranged<ValueType = f64>, Y: Ranged<ValueType = f64>>(
    sheet: &Sheet<'_>,
    chart: &Chart<'_, '_, X, Y>,
    ticks: &[f64],
    [x, end]: [f64; 2],
) -> Result<(), Fault> {
    for y in ticks {
        let (from, to) = (chart.backend_coord(&(x, *y)), chart.backend_coord(&(end, *y)));
        sheet.draw(&PathElement::new([from, to], GRID.stroke_width(UNIT)))?;
        let beside = (from.0 - Layout::px(6) as i32, from.1);
        sheet.draw(&Text::new(number(*y), beside, text(FAINT, HPos::Right, VPos::Center)))?;
    }
    Ok(())
}

/// Labels beside points, each where no other label is, if there is such a place.
#[derive(Default)]
pub(super) struct Labels(Vec<[i32; 4]>);

impl Labels {
    /// Keeps a point free.
    pub(super) fn keep(&mut self, (x, y): (i32, i32), around: u32) {
        let r = Layout::px(around) as i32;
        self.0.push([x - r, y - r, x + r, y + r]);
    }

    /// Keeps an area free: left, top, right, bottom.
    pub(super) fn keep_area(&mut self, area: [i32; 4]) {
        self.0.push(area);
    }

    /// Draws a label beside a point.
    pub(super) fn draw(&mut self, sheet: &Sheet<'_>, label: &str, (x, y): (i32, i32)) -> Result<(), Fault> {
        // about the width of a text
        let (half, height) = (Layout::px(4) as i32 * label.chars().count() as i32, Layout::px(TEXT) as i32);
        let step = Layout::px(15) as i32;
        let beside = half + Layout::px(8) as i32;
        let places =
            [(0, step), (0, -step), (beside, 0), (-beside, 0), (beside, step), (-beside, step), (beside, -step)];
        let far = (2..7).flat_map(|n| [(0, n * step), (0, -n * step), (beside, n * step), (-beside, -n * step)]);
        let area = |(dx, dy): (i32, i32)| {
            let (x, y) = (x + dx, y + dy);
            [x - half, y - height / 2, x + half, y + height / 2]
        };
        let free = |a: &[i32; 4]| self.0.iter().all(|b| a[0] >= b[2] || b[0] >= a[2] || a[1] >= b[3] || b[1] >= a[3]);
        let area = places.into_iter().chain(far).map(area).find(free).unwrap_or_else(|| area(places[0]));
        self.0.push(area);
        let middle = ((area[0] + area[2]) / 2, (area[1] + area[3]) / 2);
        sheet.draw(&Text::new(label.to_string(), middle, text(INK, HPos::Center, VPos::Center)))?;
        Ok(())
    }
}

/// A figure in two widths.
#[derive(Clone, Debug)]
pub(crate) struct Figure {
    /// Name of its file, and its place in the page.
    pub(crate) name: String,
    pub(crate) title: String,
    /// What it shows, for those who do not see it.
    pub(crate) caption: String,
    wide: String,
    narrow: String,
}

/// Layout of one of the widths.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Size in pixels of the page.
    pub(super) size: [u32; 2],
    pub(super) narrow: bool,
}

impl Layout {
    /// Units of so many pixels.
    pub(super) fn px(pixels: u32) -> u32 {
        pixels * UNIT
    }
}

/// A chart on the sheet, with this much room for labels at the left and for marks at the right.
pub(super) fn framed<'a, 'b>(sheet: &'a Sheet<'b>, left: u32, right: u32) -> ChartBuilder<'a, 'a, SVGBackend<'b>> {
    let mut chart = ChartBuilder::on(sheet);
    chart.margin(Layout::px(8)).margin_right(right).x_label_area_size(Layout::px(40)).y_label_area_size(left);
    chart
}

/// Size of texts, pixels.
const TEXT: u32 = 13;

/// Text in one colour at one side of a point.
pub(super) fn text<'a>(color: RGBColor, h: HPos, v: VPos) -> TextStyle<'a> {
    ("sans-serif", TEXT * UNIT).into_font().color(&color).pos(Pos::new(h, v))
}

/// Texts of axes.
pub(super) fn axis_text<'a>() -> TextStyle<'a> {
    ("sans-serif", TEXT * UNIT).into_font().color(&FAINT)
}

impl Figure {
    /// Draws a figure: `heights` of the wide and of the narrow one, pixels.
    pub(super) fn draw(
        name: &str,
        title: &str,
        caption: &str,
        heights: [u32; 2],
        f: impl Fn(&Sheet<'_>, Layout) -> Result<(), Fault>,
    ) -> Result<Self, Fault> {
        let at = |layout: Layout| -> Result<String, Fault> {
            let mut svg = String::new();
            {
                let size = (Layout::px(layout.size[0]), Layout::px(layout.size[1]));
                let sheet = SVGBackend::with_string(&mut svg, size).into_drawing_area();
                f(&sheet, layout)?;
                sheet.present()?;
            }
            Ok(svg)
        };
        Ok(Self {
            name: name.into(),
            title: title.into(),
            caption: caption.into(),
            wide: at(Layout { size: [680, heights[0]], narrow: false })?,
            narrow: at(Layout { size: [350, heights[1]], narrow: true })?,
        })
    }

    /// The file of the wide figure, on paper.
    pub(crate) fn file(&self) -> String {
        let (head, rest) = split(&self.wide);
        let fill = format!("<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>", hex(PAPER));
        format!("{head}\n<title>{}</title>\n{fill}{rest}", escaped(&self.title))
    }

    /// Both widths for the page, which shows one of them.
    pub(crate) fn inline(&self) -> String {
        let one = |svg: &str, class: &str| {
            let (head, rest) = split(svg);
            let label = escaped(&format!("{}. {}", self.title, self.caption));
            let view = head.split("viewBox=").nth(1).and_then(|v| v.split('"').nth(1)).unwrap_or("");
            let mut rest = rest.to_string();
            for (color, variable) in THEME {
                rest = rest.replace(&format!("\"{}\"", hex(color)), &format!("\"var(--{variable})\""));
            }
            format!("<svg class=\"{class}\" viewBox=\"{view}\" role=\"img\" aria-label=\"{label}\">{rest}")
        };
        format!("{}{}", one(&self.wide, "wide"), one(&self.narrow, "narrow"))
    }
}

/// The opening tag of an SVG, and the rest.
fn split(svg: &str) -> (&str, &str) {
    let end = svg.find('>').map_or(0, |i| i + 1);
    svg.split_at(end)
}

fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// Text of an attribute or element.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a colour without a variable, a file without its paper.
    #[test]
    fn colours_are_variables_in_the_page_and_colours_in_files() {
        let figure = Figure::draw("a", "A < B", "", [100, 80], |sheet, _| {
            for (i, (color, _)) in THEME.iter().enumerate() {
                sheet.draw(&Circle::new((10 + i as i32, 10), 4, color.filled()))?;
            }
            Ok(())
        });
        let figure = figure.unwrap();
        let inline = figure.inline();
        assert!(!inline.contains('#'), "{inline}");
        assert_eq!(inline.matches("var(--").count(), 2 * THEME.len());
        assert!(inline.contains("viewBox=\"0 0 1360 200\"") && inline.contains("viewBox=\"0 0 700 160\""));
        assert!(figure.file().contains("A &lt; B") && !figure.file().contains("var(--"));
    }

    /// Killed by: ticks outside of the axis, none on a short one, too many on a long one.
    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(log_ticks([0.9, 12.0], 6), [1.0, 2.0, 5.0, 10.0]);
        assert_eq!(log_ticks([0.25, 4.0], 4), [0.5, 1.0, 2.0]);
        assert_eq!(log_ticks([0.9, 2.4], 8), [1.0, 1.5, 2.0]);
        assert_eq!(log_ticks([1e-6, 1e6], 5).len(), 5);
    }

    /// Killed by: a longer name that gets the colour of a shorter one.
    #[test]
    fn strategies_keep_their_colours() {
        let of = ["ears", "ears, at most 4 segments", "classic", "threshold:0.1", "none"].map(series_of);
        assert_eq!(of, [0, 5, 1, 6, 7]);
        assert!(["adrr", "bolin-meyer", "winners", "contribution", "ear"].iter().all(|n| series_of(n) < 9));
    }
}

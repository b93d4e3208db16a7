//! What changes of a setting change, and what operations take: a row each.

use super::super::ledger::{Component, SceneRecord};
use super::super::tables::change;
use super::canvas::*;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// Ratios are shown up to this and its inverse.
const WIDEST: f64 = 16.0;

/// Time, error and their product after a change of one setting, over the default.
pub(super) fn knobs(name: &str, scene: &SceneRecord) -> Result<Option<Figure>, Fault> {
    let mut rows: Vec<_> = scene.knobs.iter().map(|k| (k, change(k))).collect();
    rows.retain(|(_, c)| c.iter().all(|r| r.middle > 0.0));
    rows.sort_by(|a, b| b.1[2].middle.total_cmp(&a.1[2].middle));
    if rows.is_empty() {
        return Ok(None);
    }
    let n = rows.len() as u32;
    let ends = rows.iter().flat_map(|r| &r.1).flat_map(|r| [r.low, r.high, 1.0 / r.low, 1.0 / r.high]);
    let widest = ends.filter(|x| x.is_finite()).fold(1.5, f64::max).min(WIDEST);
    let caption = "Change from the default by one setting, with the same samples and seeds: ratio of the time, of the \
                   error, and of both together, logarithmic, with 95 % intervals. Left of 1 is better. What is biased \
                   has a star.";
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let names = Layout::px(if layout.narrow { 132 } else { 190 });
        let mut chart = framed(sheet, names, Layout::px(18))
            .margin_top(Layout::px(26))
            .build_cartesian_2d((1.0 / widest..widest).log_scale(), -0.6..f64::from(n) - 0.4)?;
        chart
            .configure_mesh()
            .disable_y_axis()
            .disable_mesh()
            .x_desc("ratio to the default")
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .draw()?;
        let ticks = log_ticks([1.0 / widest, widest], if layout.narrow { 4 } else { 8 });
        x_ticks(sheet, &chart, &ticks, [-0.6, f64::from(n) - 0.4])?;
        let one = [(1.0, -0.6), (1.0, f64::from(n) - 0.4)];
        chart.draw_series([PathElement::new(one, FAINT.stroke_width(UNIT))])?;
        let kinds = [("time", SERIES[1], 0.26), ("error", SERIES[0], 0.0), ("error x time", INK, -0.26)];
        for (i, (label, color, _)) in kinds.iter().enumerate() {
            let left = if layout.narrow { Layout::px(16) } else { names };
            let x = left as i32 + Layout::px(12 + 74 * i as u32) as i32;
            sheet.draw(&Circle::new((x, Layout::px(13) as i32), 4 * UNIT as i32, color.filled()))?;
            let beside = (x + Layout::px(8) as i32, Layout::px(13) as i32);
            sheet.draw(&Text::new(*label, beside, text(*color, HPos::Left, VPos::Center)))?;
        }
        for (i, (knob, ratios)) in rows.iter().enumerate() {
            let y = f64::from(n) - 1.0 - i as f64;
            let (_, at) = chart.backend_coord(&(1.0, y));
            let star = if knob.biased { " *" } else { "" };
            let beside = (names as i32 + Layout::px(2) as i32, at);
            let label = Text::new(format!("{}{star}", knob.name), beside, text(INK, HPos::Right, VPos::Center));
            sheet.draw(&label)?;
            let inside = |x: f64| x.clamp(1.0 / widest, widest);
            for (ratio, (_, color, offset)) in ratios.iter().zip(kinds) {
                let y = y + offset;
                let line = [(inside(ratio.low), y), (inside(ratio.high), y)];
                chart.draw_series([PathElement::new(line, color.stroke_width(2 * UNIT))])?;
                chart.draw_series([Circle::new((inside(ratio.middle), y), 4 * UNIT as i32, color.filled())])?;
            }
        }
        Ok(())
    };
    let height = 84 + 34 * n;
    Figure::draw(name, &format!("What settings change: {}", scene.name), caption, [height; 2], draw).map(Some)
}

/// What is shown of one group: operations in the first arithmetic that there is, without what is done once for several
/// of them, and without densities alone where a value has its own.
fn shown<'a>(group: &str, components: &'a [Component]) -> Vec<&'a Component> {
    let build = |c: &'a Component| (&c.arithmetic, &c.instruction_set);
    let first = components.first().map(build);
    let left_out = |c: &Component| match &*c.operation {
        "gather" | "albedo" => true,
        "pdf" => group == "scattering",
        _ => false,
    };
    components.iter().filter(|c| c.group == group && first == Some(build(c)) && !left_out(c)).collect()
}

/// Name of a row, and its colour.
fn row(c: &Component, layout: Layout) -> (String, RGBColor) {
    let name = if layout.narrow {
        c.name.replace(", compensated", " c.").replace(", all layers", " +")
    } else {
        c.name.clone()
    };
    let color = if c.operation == "sample" || c.operation == "flight" { SERIES[1] } else { SERIES[4] };
    (format!("{name}: {}", c.operation), color)
}

/// Pixels of the names at the left.
fn names_of(layout: Layout) -> u32 {
    Layout::px(if layout.narrow { 176 } else { 240 })
}

/// Largest and mean errors of the operations of one group against f64.
pub(super) fn twins(group: &str, components: &[Component]) -> Result<Option<Figure>, Fault> {
    let rows: Vec<_> = shown(group, components).into_iter().map(|c| (c, c.against_twin)).collect();
    let errors = rows.iter().filter_map(|r| r.1).flat_map(|t| [t.max, t.mean, t.noise.unwrap_or(t.max)]);
    let Some(largest) = errors.clone().filter(|e| *e > 0.0).reduce(f64::max) else { return Ok(None) };
    let (low, high) = (1e-8, (largest * 3.0).max(1e-5));
    let n = rows.len() as u32;
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let names = names_of(layout);
        let mut chart = framed(sheet, names, Layout::px(26))
            .build_cartesian_2d((low..high).log_scale(), -0.6..f64::from(n) - 0.4)?;
        chart
            .configure_mesh()
            .disable_y_axis()
            .disable_mesh()
            .x_desc("relative error against f64")
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .draw()?;
        let ticks = log_ticks([low, high], if layout.narrow { 3 } else { 6 });
        x_ticks(sheet, &chart, &ticks, [-0.6, f64::from(n) - 0.4])?;
        // the rounding of f32
        let rounding = [(U, -0.6), (U, f64::from(n) - 0.4)];
        chart.draw_series(DashedLineSeries::new(rounding, 4, 6, FAINT.stroke_width(UNIT)))?;
        for (i, (c, twin)) in rows.iter().enumerate() {
            let y = f64::from(n) - 1.0 - i as f64;
            let (_, at) = chart.backend_coord(&(low, y));
            let (name, color) = row(c, layout);
            let beside = (names as i32 + Layout::px(2) as i32, at);
            sheet.draw(&Text::new(name, beside, text(INK, HPos::Right, VPos::Center)))?;
            let Some(twin) = twin else {
                chart.draw_series([Text::new("no twin", (low * 1.2, y), text(FAINT, HPos::Left, VPos::Center))])?;
                continue;
            };
            let [mean, max] = [twin.mean, twin.max].map(|x| x.clamp(low, high));
            if let Some(noise) = twin.noise {
                // hollow: random means, which are off by about their standard error
                let ends = [(low, y), (noise.clamp(low, high), y)];
                chart.draw_series([PathElement::new(ends, color.mix(0.35).stroke_width(UNIT))])?;
                chart.draw_series([Circle::new((mean, y), 4 * UNIT as i32, color.stroke_width(UNIT))])?;
                continue;
            }
            chart.draw_series([PathElement::new([(mean, y), (max, y)], color.stroke_width(2 * UNIT))])?;
            chart.draw_series([Circle::new((mean, y), 3 * UNIT as i32, color.filled())])?;
            chart.draw_series([Circle::new((max, y), 5 * UNIT as i32, color.filled())])?;
        }
        Ok(())
    };
    let caption = if group == "media" {
        "Hollow: results are random, so that their means are compared; the line is as long as the standard error."
    } else {
        "Small dot: mean error. Large dot: largest error. The dashed line is the rounding of f32."
    };
    let title = format!("{}{}: error against f64", group[..1].to_uppercase(), &group[1..]);
    Figure::draw(&format!("twins-{group}"), &title, caption, [64 + 22 * n; 2], draw).map(Some)
}

/// Half the spacing of f32 at 1.
const U: f64 = 1.0 / 16_777_216.0;

/// Nanoseconds of the operations of one group.
pub(super) fn components(group: &str, components: &[Component]) -> Result<Option<Figure>, Fault> {
    let rows = shown(group, components);
    let top = rows.iter().map(|c| c.ns.high).fold(0.0, f64::max) * 1.12;
    if rows.is_empty() || top <= 0.0 {
        return Ok(None);
    }
    let n = rows.len() as u32;
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let names = names_of(layout);
        let mut chart = framed(sheet, names, Layout::px(26)).build_cartesian_2d(0.0..top, -0.6..f64::from(n) - 0.4)?;
        chart
            .configure_mesh()
            .disable_y_axis()
            .disable_y_mesh()
            .x_desc("ns for 8 lanes")
            .x_labels(if layout.narrow { 4 } else { 8 })
            .x_label_formatter(&|x| format!("{x:.0}"))
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (i, c) in rows.iter().enumerate() {
            let y = f64::from(n) - 1.0 - i as f64;
            let (_, at) = chart.backend_coord(&(0.0, y));
            let (name, color) = row(c, layout);
            let beside = (names as i32 + Layout::px(2) as i32, at);
            sheet.draw(&Text::new(name, beside, text(INK, HPos::Right, VPos::Center)))?;
            chart.draw_series([Rectangle::new([(0.0, y - 0.28), (c.ns.middle, y + 0.28)], color.filled())])?;
            let quarters = [(c.ns.low, y), (c.ns.high, y)];
            chart.draw_series([PathElement::new(quarters, INK.stroke_width(UNIT))])?;
        }
        Ok(())
    };
    let caption = "Nanoseconds for eight lanes: median, with quarters.";
    let height = 64 + 22 * n;
    let name = format!("components-{group}");
    let title = format!("{}{}", group[..1].to_uppercase(), &group[1..]);
    Figure::draw(&name, &format!("{title}: time"), caption, [height; 2], draw).map(Some)
}

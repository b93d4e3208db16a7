//! Functions by error and time, stated intervals by how often they hold, predicted times by how right they are.

use super::super::ledger::{Group, Kernel, Ledger};
use super::super::tables::calibration;
use super::canvas::*;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// Errors of functions that are shown; larger ones stand at the top.
const SHOWN: [f64; 2] = [0.25, 64.0];

/// The same of tests and sums.
const SHOWN_PRIMITIVES: [f64; 2] = [0.01, 1e5];

/// Colours of variants in their order.
const COLORS: [usize; 9] = [0, 7, 2, 3, 4, 1, 5, 6, 8];

/// Elementary functions.
pub(super) fn functions(ledger: &Ledger) -> Result<Option<Figure>, Fault> {
    let caption = "Largest error, in units in the last place of the exact value, over nanoseconds for eight lanes, \
                   both logarithmic: further down is more accurate, further left is faster. A line joins the variants \
                   of a function. What is above 64 ULP stands at the top.";
    let all: Vec<&Kernel> = ledger.kernels.iter().filter(|k| k.group == Group::Function && k.max_ulp > 0.0).collect();
    kernels("kernels", "Elementary functions: error and time", caption, &all, SHOWN)
}

/// Tests of triangles and boxes, sums of pixels.
pub(super) fn primitives(ledger: &Ledger) -> Result<Option<Figure>, Fault> {
    let caption = "Largest error over nanoseconds for eight lanes, both logarithmic: further down is more accurate, \
                   further left is faster. A line joins the variants. What is below 0.01 ULP stands at the bottom. \
                   What leaks is in the table.";
    let all: Vec<&Kernel> = ledger.kernels.iter().filter(|k| k.group == Group::Primitive).collect();
    kernels("primitives", "Triangles, boxes, sums: error and time", caption, &all, SHOWN_PRIMITIVES)
}

/// Largest error by time of every function, with what computes it.
fn kernels(
    name: &str,
    title: &str,
    caption: &str,
    all: &[&Kernel],
    [least, highest]: [f64; 2],
) -> Result<Option<Figure>, Fault> {
    let shown: Vec<&Kernel> = all.iter().copied().filter(|k| k.ns.middle > 0.0).collect();
    let variant_of = |k: &Kernel| match k.group {
        Group::Function => k.variant.clone(),
        // channels are in the table, the product's own arithmetic goes without saying
        Group::Primitive => {
            let name = k.variant.split(':').next().unwrap_or_default();
            name.replace(", reproducible", "").replace(", one channel", "")
        }
    };
    let mut functions: Vec<&str> = Vec::new();
    shown.iter().for_each(|k| {
        if !functions.contains(&&*k.function) {
            functions.push(&k.function)
        }
    });
    let mut variants: Vec<String> = Vec::new();
    shown.iter().for_each(|k| {
        if !variants.contains(&variant_of(k)) {
            variants.push(variant_of(k))
        }
    });
    let Some(slowest) = shown.iter().map(|k| k.ns.high).reduce(f64::max) else { return Ok(None) };
    let fastest = shown.iter().map(|k| k.ns.low).fold(f64::INFINITY, f64::min).max(0.05);
    let top = shown.iter().map(|k| k.max_ulp).filter(|e| e.is_finite()).fold(4.0, f64::max).min(highest);
    let place = |k: &Kernel| (k.ns.middle, k.max_ulp.clamp(least * 1.3, top));
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let columns = if layout.narrow { 1 } else { 3 };
        let keys = Layout::px(20 * (variants.len() as u32).div_ceil(columns) + 8);
        let mut chart = framed(sheet, Layout::px(56), Layout::px(40))
            .margin_top(keys + Layout::px(6))
            .build_cartesian_2d((fastest / 1.4..slowest * 1.6).log_scale(), (least..top * 1.6).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("ns for 8 lanes")
            .y_desc("largest error, ULP")
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .y_labels(0)
            .y_label_formatter(&|_| String::new())
            .disable_mesh()
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        let ends = [fastest / 1.4, slowest * 1.6];
        x_ticks(sheet, &chart, &log_ticks(ends, if layout.narrow { 5 } else { 9 }), [least, top * 1.6])?;
        y_ticks(sheet, &chart, &log_ticks([least, top * 1.6], 9), ends)?;
        let mut labels = Labels::default();
        // where the axis has its own
        let (corner, end) = (chart.backend_coord(&(ends[0], least)), chart.backend_coord(&(ends[1], least)));
        labels.keep_area([0, corner.1, end.0, corner.1 + Layout::px(40) as i32]);
        shown.iter().for_each(|k| labels.keep(chart.backend_coord(&place(k)), 5));
        for function in &functions {
            let of: Vec<_> = shown.iter().filter(|k| k.function == **function).collect();
            chart.draw_series([PathElement::new(
                of.iter().map(|k| place(k)).collect::<Vec<_>>(),
                GRID.stroke_width(2 * UNIT),
            )])?;
            for k in &of {
                let variant = variants.iter().position(|v| *v == variant_of(k)).unwrap_or(0);
                let color = SERIES[COLORS[variant.min(8)]];
                chart.draw_series([Circle::new(place(k), 5 * UNIT as i32, color.filled())])?;
            }
            if let Some(first) = of.first() {
                labels.draw(sheet, function, chart.backend_coord(&place(first)))?;
            }
        }
        for (i, variant) in variants.iter().enumerate() {
            let (column, row) = (i as u32 % columns, i as u32 / columns);
            let (x, y) = (Layout::px(66 + 210 * column) as i32, Layout::px(14 + 20 * row) as i32);
            let color = SERIES[COLORS[i.min(8)]];
            sheet.draw(&Circle::new((x, y), 5 * UNIT as i32, color.filled()))?;
            sheet.draw(&Text::new(
                variant.as_str(),
                (x + Layout::px(10) as i32, y),
                text(INK, HPos::Left, VPos::Center),
            ))?;
        }
        Ok(())
    };
    Figure::draw(name, title, caption, [420, 380], draw).map(Some)
}

/// How often intervals of a level hold the picture's error.
pub(super) fn reliability(ledger: &Ledger) -> Result<Option<Figure>, Fault> {
    let lines = calibration(ledger);
    if lines.is_empty() {
        return Ok(None);
    }
    let caption = "Share of renders whose interval of the stated level holds the picture's error, over all scenes and \
                   numbers of samples: on the grey line a level is what it says, below it intervals are too narrow.";
    let draw = |sheet: &Sheet<'_>, _: Layout| -> Result<(), Fault> {
        let mut chart = framed(sheet, Layout::px(56), Layout::px(16)).build_cartesian_2d(0.0..100.0, 0.0..100.0)?;
        chart
            .configure_mesh()
            .x_desc("stated level, %")
            .y_desc("intervals that hold, %")
            .x_labels(6)
            .y_labels(6)
            .x_label_formatter(&|x| format!("{x:.0}"))
            .y_label_formatter(&|y| format!("{y:.0}"))
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        chart.draw_series([PathElement::new([(0.0, 0.0), (100.0, 100.0)], FAINT.stroke_width(UNIT))])?;
        for (i, (strategy, line)) in lines.iter().enumerate() {
            let color = color_of(strategy);
            let points: Vec<_> = line.iter().map(|p| (100.0 * p.level, 100.0 * p.share)).collect();
            chart.draw_series(LineSeries::new(points.clone(), color.stroke_width(2 * UNIT)))?;
            for (p, at) in line.iter().zip(points) {
                let ends = p.interval.map(|s| (at.0, 100.0 * s));
                chart.draw_series([PathElement::new(ends, color.mix(0.5).stroke_width(UNIT))])?;
                chart.draw_series([Circle::new(at, 4 * UNIT as i32, color.filled())])?;
            }
            let row = 93.0 - 8.0 * i as f64;
            chart.draw_series([Circle::new((5.0, row), 5 * UNIT as i32, color.filled())])?;
            let (x, y) = chart.backend_coord(&(5.0, row));
            let beside = (x + Layout::px(10) as i32, y);
            sheet.draw(&Text::new(strategy.as_str(), beside, text(INK, HPos::Left, VPos::Center)))?;
        }
        Ok(())
    };
    Figure::draw("reliability", "How often stated intervals hold", caption, [400, 340], draw).map(Some)
}

/// Predicted over true time, by the share of it that had passed.
pub(super) fn forecasts(ledger: &Ledger) -> Result<Option<Figure>, Fault> {
    let runs = || ledger.scenes.iter().flat_map(|s| &s.forecasts).filter(|f| f.seconds > 0.0);
    let point = |seconds: f64, (passed, f): &(f64, super::super::ledger::ForecastRecord)| {
        (passed / seconds, f.seconds / seconds)
    };
    let lines: Vec<(usize, Vec<(f64, f64)>)> = runs()
        .map(|r| (series_of(&r.strategy), r.made.iter().map(|m| point(r.seconds, m)).filter(|p| p.0 < 0.999).collect()))
        .collect();
    let points = || lines.iter().flat_map(|l| &l.1);
    let Some(least) = points().map(|p| p.0).reduce(f64::min) else { return Ok(None) };
    let widest = points().map(|p| p.1.max(1.0 / p.1)).fold(1.6, f64::max).min(8.0);
    let caption = "Renders that stop at a given error: the time that was predicted, over the time it took, by the \
                   share of the time that had passed. The band is 25 %; the vertical line is a third. Colours are \
                   those of the strategies.";
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let start = (least / 1.1).min(0.3);
        let mut chart = framed(sheet, Layout::px(56), Layout::px(16))
            .build_cartesian_2d((start..1.0).log_scale(), (1.0 / widest..widest).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("share of the time that had passed")
            .y_desc("predicted / true time")
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .y_labels(0)
            .y_label_formatter(&|_| String::new())
            .disable_mesh()
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        x_ticks(sheet, &chart, &log_ticks([start, 1.0], if layout.narrow { 5 } else { 9 }), [1.0 / widest, widest])?;
        y_ticks(sheet, &chart, &log_ticks([1.0 / widest, widest], 9), [start, 1.0])?;
        chart.draw_series([Rectangle::new([(start, 0.75), (1.0, 1.25)], FAINT.mix(0.12).filled())])?;
        chart.draw_series([PathElement::new([(start, 1.0), (1.0, 1.0)], FAINT.stroke_width(UNIT))])?;
        let third = [(1.0 / 3.0, 1.0 / widest), (1.0 / 3.0, widest)];
        chart.draw_series([PathElement::new(third, FAINT.stroke_width(UNIT))])?;
        let inside = |p: &(f64, f64)| (p.0, p.1.clamp(1.0 / widest, widest));
        for (series, line) in &lines {
            let color = SERIES[*series];
            let line: Vec<_> = line.iter().map(inside).collect();
            chart.draw_series(LineSeries::new(line.clone(), color.mix(0.5).stroke_width(UNIT)))?;
            chart.draw_series(line.iter().map(|p| Circle::new(*p, 3 * UNIT as i32, color.filled())))?;
        }
        Ok(())
    };
    Figure::draw("forecasts", "How right predicted times are", caption, [360, 320], draw).map(Some)
}

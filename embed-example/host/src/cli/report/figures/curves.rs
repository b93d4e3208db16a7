//! Error over core-seconds, time to an error, and path lengths.

use super::super::ledger::{Curve, SceneRecord};
use super::super::sums::{log_interpolate, quantile};
use super::super::tables::{Reached, reached};
use super::canvas::*;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// The error to which times are given.
pub(crate) const LEVEL: f64 = 0.01;

/// Places of a curve.
const STEPS: usize = 32;

/// A curve over the seeds: time, lower end of the band, middle, upper end.
type Band = Vec<(f64, [f64; 3])>;

/// Median of the runs at times that all of them reach, with the second smallest and largest of ten, or all of fewer.
fn band(curve: &Curve) -> Band {
    let lines: Vec<Vec<(f64, f64)>> = curve
        .runs
        .iter()
        .map(|r| r.points.iter().filter(|p| p.spp > 1.5).map(|p| (p.core_seconds, p.rel_mse)).collect())
        .collect();
    let lines: Vec<_> = lines.into_iter().filter(|l| l.len() > 1).collect();
    let first = lines.iter().map(|l| l[0].0).fold(0.0, f64::max);
    let last = lines.iter().map(|l| l[l.len() - 1].0).fold(f64::INFINITY, f64::min);
    if lines.is_empty() || !(first > 0.0 && last > first) {
        return Vec::new();
    }
    let (low, high) = if lines.len() < 10 { (0.0, 1.0) } else { (0.1, 0.9) };
    let at = |i: usize| {
        let t = first * (last / first).powf(i as f64 / (STEPS - 1) as f64);
        // the ends are reached but for rounding
        let t = t.clamp(first, last);
        let errors: Vec<f64> = lines.iter().filter_map(|l| log_interpolate(l, t)).collect();
        (errors.len() * 2 > lines.len()).then(|| (t, [low, 0.5, high].map(|q| quantile(&errors, q))))
    };
    (0..STEPS).filter_map(at).filter(|(_, e)| e[0] > 0.0).collect()
}

/// Ends of all values above 0, a little further apart.
fn range(values: impl Iterator<Item = f64>, more: f64) -> Option<[f64; 2]> {
    let ends =
        values.filter(|x| *x > 0.0 && x.is_finite()).fold([f64::INFINITY, 0.0f64], |[a, b], x| [a.min(x), b.max(x)]);
    (ends[1] > 0.0).then_some([ends[0] / more, ends[1] * more])
}

/// relMSE over core-seconds.
pub(super) fn errors(name: &str, scene: &SceneRecord) -> Result<Option<Figure>, Fault> {
    let bands: Vec<_> = scene.curves.iter().map(|c| (c, band(c))).collect();
    let points = || bands.iter().flat_map(|(_, b)| b);
    let Some([t0, t1]) = range(points().map(|p| p.0), 1.05) else { return Ok(None) };
    let Some([e0, e1]) = range(points().map(|p| p.1[1]), 1.25) else { return Ok(None) };
    // what more samples do not take away, where it is told from noise
    let floor = |c: &Curve| c.bias_error.filter(|e| c.biased && c.bias > 2.0 * e).map(|_| c.bias);
    let floors = bands.iter().filter_map(|(c, _)| Some((*c, floor(c)?))).collect::<Vec<_>>();
    let lowest = floors.iter().map(|f| f.1).fold(e0, f64::min).max(e0 / 30.0);
    let (e0, e1) = ((lowest * 0.8).min(LEVEL * 0.8), e1.max(LEVEL * 1.2));
    let caption = "relMSE against the reference over core-seconds, both logarithmic: median of the seeds, and the band \
                   in which they lie. A grey line falls as 1 / time. Biased variants are dashed; a dotted line in \
                   their colour is the floor that they do not pass, however long they run, where it is told from noise.";
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let mut chart = framed(sheet, Layout::px(56), Layout::px(16))
            .build_cartesian_2d((t0..t1).log_scale(), (e0..e1).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("core-seconds")
            .y_desc("relMSE")
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
        x_ticks(sheet, &chart, &log_ticks([t0, t1], if layout.narrow { 5 } else { 9 }), [e0, e1])?;
        y_ticks(sheet, &chart, &log_ticks([e0, e1], 9), [t0, t1])?;
        // through the middle of the picture
        let guide = (t0 * t1).sqrt() * (e0 * e1).sqrt();
        let inside = |t: f64| (guide / t > e0 && guide / t < e1).then_some((t, guide / t));
        let steps = (0..=60).map(|i| t0 * (t1 / t0).powf(f64::from(i) / 60.0));
        chart.draw_series(LineSeries::new(steps.filter_map(inside), FAINT.mix(0.6).stroke_width(UNIT)))?;
        chart.draw_series(DashedLineSeries::new([(t0, LEVEL), (t1, LEVEL)], 4, 8, FAINT.stroke_width(UNIT)))?;
        let label = Text::new("1 %", (t1, LEVEL), text(FAINT, HPos::Right, VPos::Bottom));
        chart.draw_series([label])?;
        let clamp = |e: f64| e.clamp(e0, e1);
        for (curve, band) in &bands {
            let color = color_of(&curve.name);
            let upper = band.iter().map(|(t, e)| (*t, clamp(e[2])));
            let around: Vec<_> = upper.chain(band.iter().rev().map(|(t, e)| (*t, clamp(e[0])))).collect();
            chart.draw_series([Polygon::new(around, color.mix(0.12).filled())])?;
        }
        for (curve, floor) in floors.iter().filter(|f| f.1 > e0) {
            let style = color_of(&curve.name).stroke_width(UNIT);
            chart.draw_series(DashedLineSeries::new([(t0, *floor), (t1, *floor)], 3, 7, style))?;
        }
        for (curve, band) in &bands {
            let style = color_of(&curve.name).stroke_width(2 * UNIT);
            let middle: Vec<_> = band.iter().map(|(t, e)| (*t, e[1])).collect();
            if curve.biased {
                chart.draw_series(DashedLineSeries::new(middle, 10, 6, style))?;
            } else {
                chart.draw_series(LineSeries::new(middle, style))?;
            }
        }
        Ok(())
    };
    Figure::draw(name, &format!("Error over time: {}", scene.name), caption, [420, 330], draw).map(Some)
}

/// Core-seconds to the level, with intervals.
pub(super) fn times(name: &str, scene: &SceneRecord) -> Result<Option<Figure>, Fault> {
    let rows: Vec<_> = scene.curves.iter().map(|c| (c, reached(c, LEVEL))).collect();
    let ends = rows.iter().flat_map(|(_, r)| match r {
        Reached::In { seconds, interval, .. } => vec![*seconds, interval[0], interval[1]],
        Reached::Never => vec![],
    });
    let Some([t0, t1]) = range(ends, 1.3) else { return Ok(None) };
    let n = rows.len() as u32;
    let caption = "Core-seconds to a relMSE of 0.01, logarithmic: mean of the seeds with 95 % interval by bootstrap. \
                   Hollow: the renders ended before, and the error goes on as 1 / time.";
    let draw = |sheet: &Sheet<'_>, layout: Layout| -> Result<(), Fault> {
        let names = Layout::px(if layout.narrow { 118 } else { 180 });
        let mut chart =
            framed(sheet, names, Layout::px(18)).build_cartesian_2d((t0..t1).log_scale(), -0.6..f64::from(n) - 0.4)?;
        chart
            .configure_mesh()
            .disable_y_axis()
            .disable_mesh()
            .x_desc("core-seconds to 1 % relMSE")
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        let ticks = log_ticks([t0, t1], if layout.narrow { 4 } else { 8 });
        x_ticks(sheet, &chart, &ticks, [-0.6, f64::from(n) - 0.4])?;
        for (i, (curve, reached)) in rows.iter().enumerate() {
            let (y, color) = (f64::from(n) - 1.0 - i as f64, color_of(&curve.name));
            let (_, at) = chart.backend_coord(&(t0, y));
            let shown = short(&curve.name, layout.narrow);
            let beside = (names as i32 + Layout::px(2) as i32, at);
            sheet.draw(&Text::new(shown, beside, text(INK, HPos::Right, VPos::Center)))?;
            match reached {
                Reached::In { seconds, interval: [a, b], extrapolated } => {
                    chart.draw_series([PathElement::new([(*a, y), (*b, y)], color.stroke_width(2 * UNIT))])?;
                    let fill = if *extrapolated { PAPER } else { color };
                    let size = 5 * UNIT as i32;
                    chart.draw_series([Circle::new((*seconds, y), size, color.filled())])?;
                    chart.draw_series([Circle::new((*seconds, y), size - 2 * UNIT as i32, fill.filled())])?;
                }
                Reached::Never => {
                    let says = if layout.narrow { "bias floor" } else { "not reached: bias floor" };
                    chart.draw_series([Text::new(says, (t0, y), text(FAINT, HPos::Left, VPos::Center))])?;
                }
            }
        }
        Ok(())
    };
    let heights = [70 + 30 * n, 70 + 30 * n];
    Figure::draw(name, &format!("Time to 1 % relMSE: {}", scene.name), caption, heights, draw).map(Some)
}

/// A name that fits beside a narrow figure.
pub(super) fn short(name: &str, narrow: bool) -> String {
    if narrow { name.replace(", at most ", " <= ").replace(" segments", "") } else { name.into() }
}

/// Energy and time by path length.
pub(super) fn depths(name: &str, scene: &SceneRecord) -> Result<Option<Figure>, Fault> {
    let Some(last) = scene.depths.last().filter(|d| d.luminance > 0.0 && d.core_seconds > 0.0) else { return Ok(None) };
    if scene.depths.len() < 3 {
        return Ok(None);
    }
    let of = |f: fn(&super::super::ledger::Depth) -> f64| {
        let whole = f(last);
        scene.depths.iter().map(move |d| (f64::from(d.max_depth), 100.0 * f(d) / whole)).collect::<Vec<_>>()
    };
    let lines = [
        ("light", of(|d| d.luminance), SERIES[0]),
        ("core-seconds", of(|d| d.core_seconds), SERIES[1]),
        ("rays", of(|d| d.rays as f64), SERIES[4]),
    ];
    let end = f64::from(last.max_depth) * 1.05;
    let top = lines.iter().flat_map(|l| &l.1).map(|p| p.1).fold(100.0, f64::max) * 1.05;
    let caption = "Share of the light, of the time and of the rays that paths of at most so many segments have, \
                   classic, the same samples.";
    let draw = |sheet: &Sheet<'_>, _: Layout| -> Result<(), Fault> {
        let mut chart =
            framed(sheet, Layout::px(56), Layout::px(16)).build_cartesian_2d((1.0..end).log_scale(), 0.0..top)?;
        chart
            .configure_mesh()
            .x_desc("segments of a path, at most")
            .y_desc("share of all, %")
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .y_labels(6)
            .y_label_formatter(&|y| format!("{y:.0}"))
            .label_style(axis_text())
            .axis_desc_style(axis_text())
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        let ticks: Vec<f64> = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0].into_iter().filter(|x| *x < end).collect();
        x_ticks(sheet, &chart, &ticks, [0.0, top])?;
        // named at the lower right, where no line comes
        for (i, (label, line, color)) in lines.iter().enumerate() {
            chart.draw_series(LineSeries::new(line.clone(), color.stroke_width(2 * UNIT)))?;
            chart.draw_series(line.iter().map(|p| Circle::new(*p, 3 * UNIT as i32, color.filled())))?;
            let at = (end, top * (0.06 + 0.09 * i as f64));
            chart.draw_series([Text::new(*label, at, text(*color, HPos::Right, VPos::Center))])?;
        }
        Ok(())
    };
    Figure::draw(name, &format!("Light and time by path length: {}", scene.name), caption, [300, 280], draw).map(Some)
}

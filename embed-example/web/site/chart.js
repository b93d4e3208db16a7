// Estimated error over time, both axes logarithmic: one curve for each strategy, the present one with its way to the
// target.

const [LEFT, RIGHT, TOP, BOTTOM] = [34, 4, 6, 18];

/** @param curves [{ color, points: [{ seconds, relMse }], current }] */
export function draw(svg, curves, target) {
  const { clientWidth: width, clientHeight: height } = svg;
  const points = curves.flatMap((c) => c.points);
  const parts = [];
  const last = curves.find((c) => c.current)?.points.at(-1);
  const end = last && last.relMse > target ? Math.min(last.seconds * last.relMse / target, last.seconds * 1e4) : null;
  const seconds = [...points.map((p) => p.seconds), ...(end ? [end] : [])];
  const errors = [...points.map((p) => p.relMse), target];
  const decades = (values, least) => {
    const logs = values.filter((x) => x > 0).map(Math.log10);
    const [low, high] = [Math.floor(Math.min(...logs)), Math.ceil(Math.max(...logs))];
    return [low, Math.max(high, low + least)];
  };
  const [x0, x1] = seconds.length ? decades(seconds, 2) : [-1, 1];
  const [y0, y1] = decades(errors, 2);
  const x = (s) => LEFT + (Math.log10(s) - x0) / (x1 - x0) * (width - LEFT - RIGHT);
  const y = (e) => TOP + (y1 - Math.log10(e)) / (y1 - y0) * (height - TOP - BOTTOM);

  for (let d = x0; d <= x1; d++) {
    const at = x(10 ** d).toFixed(1);
    parts.push(`<line class="grid" x1="${at}" x2="${at}" y1="${TOP}" y2="${height - BOTTOM}"/>`);
    const anchor = d === x0 ? 'start' : d === x1 ? 'end' : 'middle';
    const label = `${+(10 ** d).toFixed(3)} s`;
    parts.push(`<text x="${at}" y="${height - 4}" text-anchor="${anchor}">${label}</text>`);
  }
  for (let d = y0; d <= y1; d++) {
    const at = y(10 ** d).toFixed(1);
    parts.push(`<line class="grid" x1="${LEFT}" x2="${width - RIGHT}" y1="${at}" y2="${at}"/>`);
    const label = d < -3 ? `1e${d}` : String(+(10 ** d).toFixed(4));
    parts.push(`<text x="${LEFT - 5}" y="${+at + 3.5}" text-anchor="end">${label}</text>`);
  }
  const goal = y(target).toFixed(1);
  parts.push(`<line class="target" x1="${LEFT}" x2="${width - RIGHT}" y1="${goal}" y2="${goal}"/>`);
  for (const { color, points, current } of curves) {
    if (!points.length) continue;
    const line = points.map((p) => `${x(p.seconds).toFixed(1)},${y(p.relMse).toFixed(1)}`).join(' ');
    parts.push(`<polyline class="curve${current ? '' : ' old'}" stroke="${color}" points="${line}"/>`);
    const p = points.at(-1);
    if (current) parts.push(`<circle r="3.5" fill="${color}" cx="${x(p.seconds)}" cy="${y(p.relMse)}"/>`);
    if (current && end) {
      const at = [x(p.seconds), y(p.relMse), x(end), y(p.relMse * p.seconds / end)].map((n) => n.toFixed(1));
      parts.push(`<polyline class="ahead" stroke="${color}" points="${at[0]},${at[1]} ${at[2]},${at[3]}"/>`);
    }
  }
  svg.innerHTML = parts.join('');
}

/** Seconds in few characters. */
export function short(seconds) {
  if (seconds < 1) return `${+(seconds * 1000).toPrecision(2)} ms`;
  if (seconds < 100) return `${+seconds.toPrecision(2)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  if (seconds < 172800) return `${+(seconds / 3600).toPrecision(2)} h`;
  return `${Math.round(seconds / 86400)} d`;
}

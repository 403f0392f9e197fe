// Curves over time, and methods as points of run time and error, as SVG.

const WIDE = 640;
const HIGH = 330;
const EDGE = { left: 58, right: 12, top: 10, bottom: 40 };

function svg(tag, attributes = {}, ...children) {
  const node = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function numberText(x) {
  if (x === 0) return '0';
  const size = Math.abs(x);
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, power] = x.toExponential(1).split('e');
    const raised = [...String(Number(power))].map((c) => '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.indexOf(c)]).join('');
    return (Number(mantissa) === 1 ? '10' : `${Number(mantissa)}×10`) + raised;
  }
  return String(Number(x.toPrecision(3))).replace('-', '−');
}

function linearTicks(low, high) {
  const step = roundUp((high - low) / 6);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-12) + 1e-12; k++) found.push(k * step);
  return found;
}

function logTicks(low, high) {
  const decades = Math.log10(high / low);
  const every = Math.max(1, Math.round(decades / 6));
  const found = [];
  for (let k = Math.floor(Math.log10(low)); k <= Math.log10(high); k++) {
    if (decades < 2.2) found.push(...[1, 2, 5].map((factor) => factor * 10 ** k));
    else if (k % every === 0) found.push(10 ** k);
  }
  return found.filter((x) => x >= low && x <= high);
}

// An axis: position on the picture of a value, and its ticks.
function axis(low, high, first, last, logarithmic) {
  const warp = logarithmic ? Math.log10 : (x) => x;
  const [a, b] = [warp(low), warp(high)];
  const ticks = logarithmic ? logTicks(low, high) : linearTicks(low, high);
  const unwarp = (y) => (logarithmic ? 10 ** y : y);
  return {
    low, high, ticks,
    at: (x) => first + ((warp(x) - a) / (b - a)) * (last - first),
    value: (place) => unwarp(a + ((place - first) / (last - first)) * (b - a)),
  };
}

function frameOf(x, y, title, words) {
  const [right, bottom] = [WIDE - EDGE.right, HIGH - EDGE.bottom];
  const root = svg('svg', { viewBox: `0 0 ${WIDE} ${HIGH}`, role: 'group', 'aria-label': words });
  for (const tick of x.ticks) {
    const place = x.at(tick);
    root.append(svg('line', { class: 'grid', x1: place, x2: place, y1: EDGE.top, y2: bottom }));
    root.append(svg('g', { class: 'tick' }, svg('text', { x: place, y: bottom + 16, 'text-anchor': 'middle' }, numberText(tick))));
  }
  for (const tick of y.ticks) {
    const place = y.at(tick);
    root.append(svg('line', { class: 'grid', x1: EDGE.left, x2: right, y1: place, y2: place }));
    root.append(svg('g', { class: 'tick' }, svg('text', { x: EDGE.left - 6, y: place + 4, 'text-anchor': 'end' }, numberText(tick))));
  }
  root.append(svg('path', { class: 'axis', d: `M${EDGE.left} ${EDGE.top}V${bottom}H${right}` }));
  root.append(svg('text', { x: (EDGE.left + right) / 2, y: HIGH - 6, 'text-anchor': 'middle', class: 'soft' }, title));
  return root;
}

// The colour of a method, legible on either page: greys turn over on a dark one, other colours are lightened
// there, and pale ones are darkened on a light one.
function inkOf(method) {
  const dark = matchMedia('(prefers-color-scheme: dark)').matches;
  const parts = [1, 3, 5].map((k) => parseInt(method.colour.slice(k, k + 2), 16));
  const light = (0.3 * parts[0] + 0.59 * parts[1] + 0.11 * parts[2]) / 255;
  let mixed = parts;
  if (dark && Math.max(...parts) === Math.min(...parts)) mixed = parts.map((x) => 240 - 0.85 * x);
  else if (dark) mixed = parts.map((x) => x + (Math.max(0.52 - light, 0) / (1 - light)) * (255 - x));
  else if (light > 0.62) mixed = parts.map((x) => (x * 0.62) / light);
  return `rgb(${mixed.map(Math.round).join(',')})`;
}

// series: [{label, colour, times, values}]. Returns the picture and what moves its cursor to a time.
function curvesPlot(series, unit, seek) {
  const finite = series.flatMap((one) => [...one.values].filter(Number.isFinite));
  const low = Math.min(0, ...finite);
  const high = Math.max(...finite, low + 1e-9 + 1e-6 * Math.abs(low));
  const end = Math.max(...series.map((one) => one.times[one.times.length - 1]), 1e-3);
  const x = axis(0, end, EDGE.left, WIDE - EDGE.right, false);
  const y = axis(low, high + 0.04 * (high - low), HIGH - EDGE.bottom, EDGE.top, false);
  const root = frameOf(x, y, 'time [s]', `Curves over time [${unit}]`);
  for (const one of series) {
    let path = '';
    let pen = 'M';
    one.values.forEach((value, k) => {
      if (Number.isFinite(value)) path += `${pen}${x.at(one.times[k]).toFixed(1)} ${y.at(value).toFixed(1)}`;
      pen = Number.isFinite(value) ? 'L' : 'M';
    });
    const line = svg('path', { d: path, fill: 'none', stroke: one.colour, 'stroke-width': 1.8 });
    line.append(svg('title', {}, one.label));
    root.append(line);
  }
  const cursor = svg('line', { class: 'cursor', y1: EDGE.top, y2: HIGH - EDGE.bottom });
  root.append(cursor);
  root.addEventListener('click', (event) => {
    const box = root.getBoundingClientRect();
    seek(x.value(((event.clientX - box.left) / box.width) * WIDE));
  });
  const moveTo = (time) => {
    cursor.setAttribute('x1', x.at(time));
    cursor.setAttribute('x2', x.at(time));
  };
  return { root, moveTo };
}

const GLYPHS = {
  network: (x, y, r) => `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`,
  baseline: (x, y, r) => `M${x} ${y - 1.3 * r}L${x + 1.3 * r} ${y}L${x} ${y + 1.3 * r}L${x - 1.3 * r} ${y}Z`,
  solver: (x, y, r) => `M${x - r} ${y - r}H${x + r}V${y + r}H${x - r}Z`,
  other: (x, y, r) => `M${x} ${y - 1.2 * r}L${x + 1.2 * r} ${y + r}H${x - 1.2 * r}Z`,
};

// panel: points [method, time, error, spread of time, of error]; shown: names; canShow: whether a click helps.
function errorPlot(panel, plot, methods, shown, canShow, choose) {
  const drawn = panel.points.filter((point) => point[2] > 0);
  const errors = drawn.map((point) => point[2]);
  const times = [...panel.points.map((point) => point[1]), ...(plot.reference ? [plot.reference] : [])];
  const least = Math.max(Math.min(...errors), Math.max(...errors) * 1e-9, panel.band / 10);
  const x = axis(Math.min(...times) / 1.5, Math.max(...times) * 1.5, EDGE.left, WIDE - EDGE.right, true);
  const y = axis(least / 2, Math.max(...errors) * 2, HIGH - EDGE.bottom, EDGE.top, true);
  const root = frameOf(x, y, plot.time, panel.title);
  const place = (point) => [x.at(point[1]), y.at(Math.max(point[2], y.low * 1.15))];
  if (panel.band > y.low) {
    const top = y.at(Math.min(panel.band, y.high));
    const size = { x: EDGE.left, width: WIDE - EDGE.right - EDGE.left, y: top, height: HIGH - EDGE.bottom - top };
    root.prepend(svg('rect', { ...size, fill: 'var(--band)' }));
  }
  if (plot.reference) {
    const line = x.at(plot.reference);
    const dotted = { x1: line, x2: line, y1: EDGE.top, y2: HIGH - EDGE.bottom, 'stroke-dasharray': '2 4' };
    root.append(svg('line', { ...dotted, class: 'cursor' }, svg('title', {}, 'the converged simulation')));
  }
  const families = new Map();
  for (const point of panel.points) {
    const family = methods[point[0]].family;
    if (family) families.set(family, [...(families.get(family) || []), point]);
  }
  for (const members of families.values()) {
    members.sort((a, b) => methods[a[0]].level - methods[b[0]].level);
    const line = members.map((point) => place(point).map((v) => v.toFixed(1)).join(' ')).join('L');
    root.append(svg('path', { d: `M${line}`, fill: 'none', stroke: inkOf(methods[members[0][0]]), opacity: 0.6 }));
  }
  const names = [];
  for (const point of panel.points) {
    const method = methods[point[0]];
    const [px, py] = place(point);
    const isShown = shown.includes(point[0]);
    const able = canShow(point[0]);
    const glyph = (GLYPHS[method.role] || GLYPHS.other)(px, py, 5);
    const said = `${method.label}: ${numberText(point[1])} ms, ${numberText(point[2])}`;
    const mark = svg('path', { d: glyph, fill: inkOf(method), 'data-method': point[0] });
    mark.append(svg('title', {}, able ? said : `${said} (its roll-out is not in this page)`));
    if (able) {
      const button = { class: 'point', tabindex: 0, role: 'button', 'aria-pressed': isShown, 'aria-label': said };
      for (const [name, value] of Object.entries(button)) mark.setAttribute(name, value);
      mark.addEventListener('click', () => choose(point[0]));
      mark.addEventListener('keydown', (event) => {
        if (event.key === 'Enter') choose(point[0]);
      });
    } else mark.setAttribute('opacity', 0.4);
    root.append(mark);
    if (isShown) {
      root.append(svg('path', { class: 'halo', d: (GLYPHS[method.role] || GLYPHS.other)(px, py, 9) }));
      names.push([px, py, method.label]);
    }
  }
  let above = -HIGH; // of a name above another
  for (const [px, py, label] of names.sort((a, b) => a[1] - b[1])) {
    const left = px > WIDE * 0.6;
    above = Math.max(py + 4, above + 14);
    const spot = { x: left ? px - 13 : px + 13, y: above, 'text-anchor': left ? 'end' : 'start', class: 'name' };
    root.append(svg('text', spot, label));
  }
  return root;
}

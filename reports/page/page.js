// What is chosen, and everything that follows from it.

const MOST = matchMedia('(max-width: 560px)').matches ? 1 : 4; // a phone has room for one
const SEQUENTIAL = [[52, 84, 122], [62, 137, 140], [150, 176, 104], [228, 190, 88], [214, 110, 50], [160, 28, 38]];
const FROM_ZERO = [[112, 132, 156], [240, 208, 110], [222, 118, 52], [150, 22, 40]]; // most of it is 0
const COLOURS = {
  plain: { title: 'None' },
  curvature: { title: 'Mean curvature', unit: '1/m', stops: SEQUENTIAL },
  step: { title: 'One-step error', unit: 'mm', stops: SEQUENTIAL, missing: 'step not judged' },
  distance: { title: 'Distance to the simulation', unit: 'mm', stops: SEQUENTIAL },
  depth: { title: 'Depth under the skin', unit: 'mm', stops: FROM_ZERO, through: true }, // the skin would hide it
};
const BRIGHTEST = 0.98; // share of the values of all panes below the end of the scale
const HOLD = 500; // at the end, before it starts again [ms]
const byId = (id) => document.getElementById(id);
const state = { scene: '', methods: [], frame: 0, colour: 'distance', playing: false, opened: false };
let content;
let view = null;
let times = new Float32Array(1);
let arrays = [];
let cursor = null;
let turn = 0; // of loading: what was asked for before comes too late

function complain(error) {
  const place = byId('problem');
  place.textContent = error.message || String(error);
  place.hidden = false;
}

// With a capital and a full stop.
function sentence(words) {
  return words && `${words[0].toUpperCase()}${words.slice(1)}.`;
}

function options(select, pairs, chosen) {
  select.replaceChildren(...pairs.map(([value, text]) => element('option', { value }, text)));
  if (pairs.some(([value]) => value === chosen)) select.value = chosen;
}

function dot(method) {
  const node = element('span', { class: 'dot', 'aria-hidden': 'true' });
  node.style.background = inkOf(content.methods[method]);
  return node;
}

// At first: the reference, a baseline, SNUG and PBNS, of one alone SNUG; else other networks, then whatever.
function firstMethods(available) {
  const role = (name) => available.filter((method) => content.methods[method].role === name);
  const subjects = ['snug', 'pbns'].filter((method) => available.includes(method));
  const first = MOST > 1 ? [...role('reference'), ...role('baseline').slice(0, 1)] : [];
  const wanted = [...first, ...subjects, ...role('external'), ...role('network'), ...available];
  const kept = [...new Set(wanted)].slice(0, MOST);
  return available.filter((method) => kept.includes(method));
}

function chooseScene(name, frame = -1) {
  state.scene = name;
  byId('scene').value = name;
  const available = Object.keys(content.scenes[name].methods);
  const still = state.methods.filter((method) => available.includes(method));
  state.methods = still.length ? still : firstMethods(available);
  byId('methods').replaceChildren(...available.map((method) => {
    const box = element('input', { type: 'checkbox', value: method });
    box.addEventListener('change', () => toggle(method));
    return element('label', {}, box, dot(method), content.methods[method].label);
  }));
  const panels = Object.entries((content.plots[name] || { panels: {} }).panels);
  options(byId('error'), panels.map(([key, panel]) => [key, panel.title]), byId('error').value);
  state.frame = frame;
  return load();
}

// Show a method or hide it; the fifth takes the place of the last.
function toggle(method) {
  const shown = state.methods.includes(method);
  if (shown && state.methods.length > 1) state.methods = state.methods.filter((name) => name !== method);
  else if (!shown) state.methods = [...state.methods.slice(0, MOST - 1), method];
  return load();
}

// The same from the plot, which is drawn anew: the point keeps the focus.
async function togglePoint(method) {
  await toggle(method);
  const points = [...byId('errors').querySelectorAll('[data-method]')];
  points.find((point) => point.dataset.method === method)?.focus();
}

// Read what is chosen and show it.
async function load() {
  const own = ++turn;
  for (const box of byId('methods').querySelectorAll('input')) box.checked = state.methods.includes(box.value);
  const scene = content.scenes[state.scene];
  const [skin, ...cloths] = await Promise.all([
    scene.body && readPack(scene.body), ...state.methods.map((method) => readPack(scene.methods[method])),
  ]);
  if (own !== turn) return;
  arrays = cloths;
  times = cloths.reduce((best, one) => (one.times.length > best.length ? one.times : best), cloths[0].times);
  byId('time').max = times.length - 1;
  if (state.frame < 0) state.frame = times.length >> 1;
  state.frame = Math.min(state.frame, times.length - 1);
  const have = Object.keys(COLOURS).filter((key) => key === 'plain' || cloths.some((one) => one[key]));
  options(byId('colour'), have.map((key) => [key, COLOURS[key].title]), state.colour);
  state.colour = byId('colour').value;
  makePanes(scene);
  if (view) {
    view.show(panesShown(), skin);
    colourScale();
  }
  makeCurves();
  makeErrors();
  goTo(state.frame);
  if (state.opened) rememberAddress();
}

function makePanes(scene) {
  const panes = byId('panes');
  panes.style.gridTemplateColumns = `repeat(${state.methods.length > 1 ? 2 : 1}, minmax(0, 1fr))`;
  panes.style.gridTemplateRows = `repeat(${state.methods.length > 2 ? 2 : 1}, minmax(0, 1fr))`;
  panes.replaceChildren(...state.methods.map((method) => {
    const ending = scene.methods[method].ending;
    const pane = element('div', { class: 'pane' }, dot(method), content.methods[method].label);
    pane.append(element('small', { class: 'ended', 'data-ending': ending }));
    return pane;
  }));
}

function panesShown() {
  const elements = [...byId('panes').children];
  return arrays.map((own, k) => ({ arrays: own, element: elements[k], values: own[state.colour] || null }));
}

// One scale for all panes: up to what nearly all values of the shown methods lie below, or as it was moved.
function colourScale() {
  const own = COLOURS[state.colour];
  const values = arrays.map((one) => one[state.colour]).filter(Boolean);
  byId('scale').hidden = byId('limits').hidden = !own.stops;
  view.through = own.through;
  if (!own.stops) return;
  const limit = roundUp((quantile(values, BRIGHTEST) || 1) * 1.6 ** Number(byId('limit').value), [1, 1.5, 2, 3, 4, 5, 6, 8]);
  view.limit = limit;
  view.drawing.setColours(own.stops);
  byId('scale-title').textContent = `${own.title} [${own.unit}]`;
  byId('scale-low').textContent = '0';
  byId('scale-high').textContent = `${numberText(limit)} and more`;
  const stops = own.stops.map((stop) => `rgb(${stop.join(',')})`);
  byId('scale-bar').style.background = `linear-gradient(to right, ${stops.join(',')})`;
}

function makeCurves() {
  const names = [...new Set(arrays.flatMap((one) => Object.keys(one)))].filter((name) => content.curves[name]);
  const title = (name) => `${content.curves[name][0]} [${content.curves[name][1]}]`;
  const wanted = byId('curve').value || 'energy/total';
  options(byId('curve'), names.map((name) => [name, title(name)]), wanted);
  drawCurves();
}

function drawCurves() {
  const name = byId('curve').value;
  const series = state.methods.flatMap((method, k) => (arrays[k][name] ? [{
    label: content.methods[method].label, colour: inkOf(content.methods[method]),
    times: arrays[k].times, values: arrays[k][name],
  }] : []));
  cursor = series.length ? curvesPlot(series, content.curves[name][1], (time) => goTo(frameAt(times, time))) : null;
  byId('curves').replaceChildren(cursor ? cursor.root : 'No numbers per frame were kept of these roll-outs.');
  cursor?.moveTo(times[Math.max(state.frame, 0)]);
}

function makeErrors() {
  const plot = content.plots[state.scene];
  const panel = plot?.panels[byId('error').value];
  byId('error-said').textContent = panel
    ? `${sentence(panel.definition)} Circles are networks, diamonds baselines, squares solvers; a click shows or hides one.`
      + (plot.reference ? ' Dotted: the time of the simulation.' : '')
      + (panel.band ? ' Shaded: as near as equally valid simulations are to each other.' : '')
    : '';
  const can = (method) => method in content.scenes[state.scene].methods;
  const positive = panel?.points.some((point) => point[2] > 0);
  byId('errors').replaceChildren(
    positive ? errorPlot(panel, plot, content.methods, state.methods, can, togglePoint)
      : panel ? 'No error above 0.' : 'Nothing was timed in this scene.',
  );
}

function goTo(frame) {
  state.frame = Math.max(0, Math.min(times.length - 1, frame));
  const time = times[state.frame];
  byId('time').value = state.frame;
  byId('clock').textContent = `${time.toFixed(2)} s · ${state.frame + 1} of ${times.length}`;
  cursor?.moveTo(time);
  [...byId('panes').children].forEach((pane, k) => {
    const note = pane.querySelector('small');
    const own = arrays[k].times;
    const over = own[own.length - 1] < time - 1e-6;
    const unknown = arrays[k][state.colour]?.unknown.has(frameAt(own, time));
    if (over) note.textContent = `ended at ${own[own.length - 1].toFixed(2)} s`;
    else note.textContent = (unknown && COLOURS[state.colour].missing) || note.dataset.ending;
  });
  view?.draw(time);
}

let since = 0;
let from = 0;

function play(on) {
  state.playing = on;
  byId('play').textContent = on ? '❚❚' : '▶';
  byId('play').setAttribute('aria-label', on ? 'Pause' : 'Play');
  if (!on) {
    rememberAddress();
    return;
  }
  if (state.frame >= times.length - 1) goTo(0);
  [since, from] = [performance.now(), times[state.frame]];
  requestAnimationFrame(tick);
}

function tick() {
  if (!state.playing) return;
  const now = performance.now();
  requestAnimationFrame(tick);
  if (now < since) return; // held on the last frame
  const time = from + ((now - since) / 1000) * Number(byId('speed').value);
  const frame = frameAt(times, time);
  if (frame !== state.frame) goTo(frame);
  if (frame >= times.length - 1) [since, from] = [now + HOLD, times[0]];
}

// The address bar says what is shown; while it plays, what was shown before.
function rememberAddress() {
  history.replaceState(null, '', `#${addressOf(state)}`);
}

// The frame to go to; playing goes on from there.
function seek(frame) {
  goTo(frame);
  rememberAddress();
  [since, from] = [performance.now(), times[state.frame]];
}

function onKey(event) {
  const pressed = event.target.closest('select, button, input:not([type=range]), [role=button]');
  const moved = event.target.closest('select, input[type=range], [role=region]');
  if ((event.key === ' ' ? pressed : moved) || event.ctrlKey || event.altKey || event.metaKey) return;
  const steps = { ArrowLeft: -1, ArrowRight: 1, Home: -1e9, End: 1e9 };
  if (event.key === ' ') play(!state.playing);
  else if (event.key in steps) seek(state.frame + steps[event.key] * (event.shiftKey ? 10 : 1));
  else return;
  event.preventDefault();
}

function listen() {
  const on = (id, kind, act) => byId(id).addEventListener(kind, act);
  const redraw = () => {
    if (view) [view.withBody, view.follows] = [byId('body').checked, byId('follow').checked];
    view?.draw();
  };
  const recolour = () => {
    state.colour = byId('colour').value;
    panesShown().forEach((pane, k) => {
      if (view) view.shown[k].values = pane.values;
    });
    if (view) colourScale();
    goTo(state.frame);
    redraw();
    rememberAddress();
  };
  on('controls', 'submit', (event) => event.preventDefault());
  on('scene', 'change', () => chooseScene(byId('scene').value));
  on('colour', 'change', recolour);
  on('limit', 'input', recolour);
  on('body', 'change', redraw);
  on('follow', 'change', redraw);
  on('play', 'click', () => play(!state.playing));
  on('picture', 'click', () => savePicture(
    byId('canvas'), [...byId('panes').children], `${state.scene}-${state.frame + 1}`.replaceAll('/', '-'),
  ));
  on('address', 'click', () => copyText(location.href));
  on('time', 'input', () => seek(Number(byId('time').value)));
  on('speed', 'change', () => seek(state.frame));
  on('curve', 'change', drawCurves);
  on('error', 'change', makeErrors);
  document.addEventListener('keydown', onKey);
  for (const button of document.querySelectorAll('[data-turn]')) {
    button.addEventListener('click', () => {
      view?.home();
      if (view) view.yaw = Number(button.dataset.turn);
      view?.draw();
    });
  }
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => chooseScene(state.scene, state.frame));
  redraw();
}

function listTables() {
  const select = byId('table');
  content.tables.forEach((table, k) => {
    if (select.lastElementChild?.label !== table.group) select.append(element('optgroup', { label: table.group }));
    select.lastElementChild.append(element('option', { value: String(k) }, table.title));
  });
  for (const button of document.querySelectorAll('[data-copy]')) {
    button.addEventListener('click', async () => {
      await copyText(tableText(content.tables[Number(select.value)], button.dataset.copy));
      byId('copied').textContent = `Copied as ${button.textContent}.`;
    });
  }
  const show = () => showTable(
    content.tables[Number(select.value)], document.querySelector('#scroll table'), byId('definition'), byId('note'),
  );
  select.addEventListener('change', () => {
    byId('copied').textContent = '';
    show();
  });
  if (content.tables.length) show();
  byId('numbers').hidden = !content.tables.length;
}

async function start() {
  content = await readContent();
  listTables();
  const scenes = Object.keys(content.scenes);
  if (!scenes.length) {
    document.querySelector('main').hidden = true;
    return;
  }
  try {
    view = new View(byId('canvas'), byId('panes'));
  } catch (error) {
    complain(error);
    byId('views').hidden = byId('scale').hidden = true;
  }
  listen();
  options(byId('scene'), scenes.map((name) => [name, content.scenes[name].title]), scenes[0]);
  const asked = readAddress(location.hash, content.scenes);
  if (asked) [state.methods, state.colour] = [asked.methods, asked.colour];
  await chooseScene(asked ? asked.scene : scenes[0], asked ? asked.frame : -1);
  state.opened = true; // the address is that of a choice, not of what a page opens with
  if (!asked && !matchMedia('(prefers-reduced-motion: reduce)').matches) play(true);
}

start().catch(complain);

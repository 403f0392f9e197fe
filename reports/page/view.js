// Up to four panes on one canvas, one camera for all of them.

const CLOTH = [0.66, 0.36, 0.28];
const SKIN = [0.7, 0.69, 0.68];
const ANGLE = 0.42; // of the view from bottom to top [rad]

class View {
  constructor(canvas, panes) {
    this.canvas = canvas;
    this.panes = panes;
    this.drawing = new Drawing(canvas);
    this.shown = [];
    this.skin = null;
    this.asked = false;
    this.home();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(panes);
  }

  home() {
    this.yaw = 25;
    this.pitch = 8;
    this.zoom = 1;
    this.shift = [0, 0, 0];
  }

  // shown: of each pane its element, arrays, and values or null; skin: arrays of the body or null.
  show(shown, skin) {
    for (const pane of this.shown) this.drawing.free(pane.mesh);
    if (this.skin) this.drawing.free(this.skin.mesh);
    const made = (arrays) => this.drawing.mesh(arrays.faces, arrays.positions.count);
    this.shown = shown.map((pane) => ({ ...pane, mesh: made(pane.arrays) }));
    this.skin = skin && { arrays: skin, mesh: made(skin) };
    this.reach = this.shown.length ? reachOf(this.shown[0].arrays.positions) : null;
  }

  // Draw at the next chance, at this time [s] where one is given.
  draw(time) {
    if (time !== undefined) this.time = time;
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.paint();
    });
  }

  paint() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!this.shown.length || !width) return;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const outer = this.panes.getBoundingClientRect();
    const background = cssColour('--stage');
    if (this.skin) this.update(this.skin);
    for (const pane of this.shown) this.update(pane);
    const centre = this.centre();
    for (const pane of this.shown) {
      const box = pane.element.getBoundingClientRect();
      this.drawing.begin([box.left - outer.left, box.top - outer.top, box.width, box.height], background);
      const camera = this.camera(centre, box.width / box.height);
      if (this.skin && this.withBody) this.drawing.draw(this.skin.mesh, camera, SKIN, null, 1);
      if (this.through) this.drawing.forgetDepth();
      const known = pane.values && !pane.values.unknown.has(pane.mesh.frame);
      this.drawing.draw(pane.mesh, camera, CLOTH, known ? pane.values : null, this.limit);
    }
  }

  update(item) {
    const frame = frameAt(item.arrays.times, this.time);
    this.drawing.update(item.mesh, item.arrays.positions, frame, item.values);
  }

  // What the camera looks at: the middle of the first cloth, now or over all its frames.
  centre() {
    const middle = this.follows ? middleOf(this.shown[0].mesh.positions) : this.reach.middle;
    return middle.map((x, k) => x + this.shift[k]);
  }

  axes() {
    const [yaw, pitch] = [(this.yaw * Math.PI) / 180, (this.pitch * Math.PI) / 180];
    const [s, c, t, u] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    return { right: [c, 0, -s], up: [-s * t, u, -c * t], back: [s * u, t, c * u] };
  }

  // The height of what is seen at the centre [m].
  height() {
    return (1.12 * (this.follows ? this.reach.size : this.reach.all)) / this.zoom;
  }

  camera(centre, aspect) {
    const { right, up, back } = this.axes();
    const room = aspect < 1 ? this.height() / aspect : this.height();
    const far = room / 2 / Math.tan(ANGLE / 2);
    const eye = centre.map((x, k) => x + far * back[k]);
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    const [near, end, f] = [Math.max(far - 3, far * 0.05), far + 6, 1 / Math.tan(ANGLE / 2)];
    const [a, b] = [(end + near) / (near - end), (2 * end * near) / (near - end)];
    const rows = [[...right, dot(right)], [...up, dot(up)], [...back, dot(back)]];
    const project = [];
    for (let k = 0; k < 4; k++) {
      const depth = a * rows[2][k] + (k === 3 ? b : 0);
      project.push((f / aspect) * rows[0][k], f * rows[1][k], depth, -rows[2][k]);
    }
    const turn = [0, 1, 2].flatMap((k) => [right[k], up[k], back[k]]);
    return { project, turn };
  }

  turn(dx, dy) {
    this.yaw -= 0.4 * dx;
    this.pitch = Math.max(-85, Math.min(85, this.pitch + 0.4 * dy));
    this.draw();
  }

  move(dx, dy) {
    const { right, up } = this.axes();
    const size = this.height() / this.shown[0].element.clientHeight;
    this.shift = this.shift.map((x, k) => x - size * (dx * right[k] - dy * up[k]));
    this.draw();
  }

  closer(factor) {
    this.zoom = Math.max(0.2, Math.min(30, this.zoom * factor));
    this.draw();
  }

  listen() {
    const held = new Map();
    const spot = () => {
      const [a, b] = [...held.values()];
      return b ? { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) } : a;
    };
    this.panes.addEventListener('pointerdown', (event) => {
      this.panes.setPointerCapture(event.pointerId);
      held.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    this.panes.addEventListener('pointermove', (event) => {
      if (!held.has(event.pointerId)) return;
      const before = spot();
      held.set(event.pointerId, { x: event.clientX, y: event.clientY });
      const now = spot();
      const moves = held.size > 1 || event.shiftKey || event.buttons === 2;
      this[moves ? 'move' : 'turn'](now.x - before.x, now.y - before.y);
      if (held.size > 1 && before.apart) this.closer(now.apart / before.apart);
    });
    for (const kind of ['pointerup', 'pointercancel']) {
      this.panes.addEventListener(kind, (event) => held.delete(event.pointerId));
    }
    this.panes.addEventListener('contextmenu', (event) => event.preventDefault());
    this.panes.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.closer(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    this.panes.addEventListener('dblclick', () => {
      this.home();
      this.draw();
    });
  }
}

function middleOf(positions) {
  const sum = [0, 0, 0];
  for (let k = 0; k < positions.length; k++) sum[k % 3] += positions[k];
  return sum.map((x) => (3 * x) / positions.length);
}

// The size [m] of a cloth in its first frame, and its middle and size over all frames.
function reachOf(array) {
  const box = (first, last) => {
    const [low, high] = [[65535, 65535, 65535], [0, 0, 0]];
    for (let k = first; k < last; k++) {
      low[k % 3] = Math.min(low[k % 3], array.steps[k]);
      high[k % 3] = Math.max(high[k % 3], array.steps[k]);
    }
    const size = Math.hypot(...high.map((x, k) => array.step * (x - low[k])));
    return { middle: low.map((x, k) => array.low[k] + (array.step * (x + high[k])) / 2), size };
  };
  const all = box(0, array.steps.length);
  return { middle: all.middle, all: all.size, size: box(0, 3 * array.count).size };
}

function cssColour(name) {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
}

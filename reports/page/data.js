// What embedded_roll_outs.py wrote, as arrays again.

async function inflated(id) {
  const letters = atob(document.getElementById(id).textContent);
  const bytes = new Uint8Array(letters.length);
  for (let k = 0; k < letters.length; k++) bytes[k] = letters.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function readContent() {
  return JSON.parse(new TextDecoder().decode(await inflated('content')));
}

// The steps of positions: each frame foretold from the two before, what was left in two planes of bytes.
function readPositions(bytes, entry) {
  const [frames, count] = entry.shape;
  const size = 3 * count;
  const steps = new Uint16Array(frames * size);
  for (let k = 0; k < steps.length; k++) {
    const coded = bytes[entry.at + k] | (bytes[entry.at + steps.length + k] << 8);
    const left = (coded >>> 1) ^ -(coded & 1);
    const before = k >= size ? steps[k - size] : 0;
    const moved = k >= 2 * size ? before - steps[k - 2 * size] : 0;
    steps[k] = before + moved + left;
  }
  return { frames, count, steps, low: entry.low, step: entry.step };
}

function readValues(bytes, entry) {
  const [frames, count] = entry.shape;
  const levels = bytes.slice(entry.at, entry.at + frames * count);
  for (let k = count; k < levels.length; k++) levels[k] += levels[k - count];
  return { frames, count, levels, full: entry.full, unknown: new Set(entry.unknown) };
}

const READERS = {
  positions: readPositions,
  values: readValues,
  numbers: (bytes, entry) => new Float32Array(bytes.slice(entry.at, entry.at + 4 * entry.shape[0]).buffer),
  indices: (bytes, entry) => new Uint32Array(bytes.slice(entry.at, entry.at + 12 * entry.shape[0]).buffer),
};

const packs = new Map();

// The arrays of a pack by name; each text is read once.
function readPack(where) {
  if (!packs.has(where.text)) {
    packs.set(where.text, inflated(where.text).then((bytes) => {
      const found = {};
      for (const [name, entry] of Object.entries(where.arrays)) found[name] = READERS[entry.kind](bytes, entry);
      return found;
    }));
  }
  return packs.get(where.text);
}

// The last frame that is not after the time [s].
function frameAt(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time + 1e-6) low = middle; else high = middle - 1;
  }
  return low;
}

// One frame of positions [m] into `out`.
function positionsAt(array, frame, out) {
  const size = 3 * array.count;
  const start = frame * size;
  for (let k = 0; k < size; k++) out[k] = array.low[k % 3] + array.step * array.steps[start + k];
}

function normalsOf(positions, faces, out) {
  out.fill(0);
  for (let k = 0; k < faces.length; k += 3) {
    const a = 3 * faces[k];
    const b = 3 * faces[k + 1];
    const c = 3 * faces[k + 2];
    const ux = positions[b] - positions[a];
    const uy = positions[b + 1] - positions[a + 1];
    const uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a];
    const vy = positions[c + 1] - positions[a + 1];
    const vz = positions[c + 2] - positions[a + 2];
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    for (const corner of [a, b, c]) {
      out[corner] += nx;
      out[corner + 1] += ny;
      out[corner + 2] += nz;
    }
  }
}

// The value below which this share of the levels lies.
function quantile(arrays, share) {
  const found = [];
  for (const array of arrays) {
    for (let k = 0; k < array.levels.length; k += 7) {
      const part = array.levels[k] / 255;
      if (part !== 0) found.push(part * part * array.full);
    }
  }
  found.sort((x, y) => x - y);
  return found.length ? found[Math.floor(share * (found.length - 1))] : 0;
}

// The least of these factors times a power of ten that is not below x.
function roundUp(x, factors = [1, 2, 5]) {
  const power = 10 ** Math.floor(Math.log10(x));
  const found = [...factors, 10].find((factor) => factor * power >= x * 0.999);
  return Number((found * power).toPrecision(3));
}

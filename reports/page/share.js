// What a reader takes along: the address of what is shown, a table as text, a picture of the panes.

const NO_FORMULA = /^(?![=@+-])|^-$|^[+-]?[0-9.]+(e[+-]?[0-9]+)?$/;

// Heads and lines of a table as texts, numbers as they are printed or exact; infinity is written as 1e300.
function tableCells(table, exact) {
  const heads = table.columns.map((column) => (column.unit ? `${column.title} [${column.unit}]` : column.title));
  const text = (cell) => {
    const [shown, value] = Array.isArray(cell) ? cell : [cell, null];
    return exact && value !== null && Math.abs(value) < 1e300 ? String(value) : shown.trim();
  };
  return [heads, ...table.rows.map((row) => row.map(text))];
}

const FORMATS = {
  csv: (lines) => {
    const safe = (cell) => (NO_FORMULA.test(cell) ? cell : `'${cell}`);
    const quoted = (cell) => (/[",\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
    return lines.map((line) => line.map((cell) => quoted(safe(cell))).join(',')).join('\n');
  },
  markdown: (lines) => {
    const row = (line) => `| ${line.map((cell) => cell.replace(/[|\\]/g, '\\$&')).join(' | ')} |`;
    return [row(lines[0]), row(lines[0].map(() => '---')), ...lines.slice(1).map(row)].join('\n');
  },
};

function tableText(table, format) {
  return FORMATS[format](tableCells(table, format === 'csv'));
}

// To the clipboard; where the browser gives none to a page from disk, by a selection.
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = element('textarea', { 'aria-hidden': 'true' });
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand('copy');
    area.remove();
  }
}

// The part of the address behind #: scene, methods, colour of the cloth, frame.
function addressOf(shown) {
  return new URLSearchParams({
    scene: shown.scene, methods: shown.methods.join(','), colour: shown.colour, frame: String(shown.frame),
  }).toString();
}

// What an address asks for, as far as the run has it.
function readAddress(address, scenes) {
  const asked = new URLSearchParams(address.replace(/^#/, ''));
  const scene = asked.get('scene');
  if (!(scene in scenes)) return null;
  const has = (method) => method in scenes[scene].methods;
  const methods = (asked.get('methods') || '').split(',').filter(has).slice(0, MOST);
  return { scene, methods, colour: asked.get('colour') || '', frame: Math.max(0, Number(asked.get('frame')) || 0) };
}

// A PNG of the panes with their names, as they are on the screen.
function savePicture(canvas, panes, name) {
  const copy = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
  const pen = copy.getContext('2d');
  const scale = canvas.width / canvas.clientWidth;
  const style = getComputedStyle(document.body);
  pen.fillStyle = getComputedStyle(canvas.parentElement).backgroundColor;
  pen.fillRect(0, 0, copy.width, copy.height);
  pen.drawImage(canvas, 0, 0);
  pen.font = `600 ${14 * scale}px ${style.fontFamily}`;
  pen.fillStyle = style.color;
  for (const pane of panes) pen.fillText(pane.textContent, (pane.offsetLeft + 10) * scale, (pane.offsetTop + 22) * scale);
  const link = element('a', { download: `${name}.png`, href: copy.toDataURL('image/png') });
  link.click();
  return link;
}

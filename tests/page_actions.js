// Put into a page by a test: uses it as a person would and writes what came of it into the document.
(() => {
  const wrong = [];
  const found = {};
  addEventListener('error', (event) => wrong.push(event.message));
  addEventListener('unhandledrejection', (event) => wrong.push(String(event.reason)));
  addEventListener('securitypolicyviolation', (event) => wrong.push(`policy: ${event.violatedDirective}`));
  console.error = (...words) => wrong.push(words.join(' '));
  const byId = (id) => document.getElementById(id);
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const frame = () => Number(byId('time').value);
  const panes = () => [...document.querySelectorAll('.pane')].map((pane) => pane.childNodes[1].textContent);
  const key = async (name) => {
    document.body.dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true, cancelable: true }));
    await wait(150);
  };
  const set = async (id, value, kind = 'change') => {
    byId(id).value = value;
    byId(id).dispatchEvent(new Event(kind, { bubbles: true }));
    await wait(300);
  };
  const picture = () => {
    const canvas = byId('canvas');
    const copy = Object.assign(document.createElement('canvas'), { width: 60, height: 60 });
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0, 60, 60);
    return [...context.getImageData(0, 0, 60, 60).data];
  };
  const distinct = () => new Set(picture().filter((x, k) => k % 4 === 0)).size;
  const column = (k) => [...document.querySelectorAll('#scroll tbody tr:not(.printed)')].map((row) => row.children[k].textContent);

  async function act() {
    for (let k = 0; k < 100 && !panes().length; k++) await wait(50);
    await wait(300);
    found.panes = panes();
    found.shades = distinct();
    found.first = frame();
    await key('ArrowRight');
    found.right = frame();
    await key('Home');
    found.home = frame();
    await set('speed', '0.1');
    await key(' ');
    found.playing = byId('play').getAttribute('aria-label');
    const seen = new Set();
    for (let k = 0; k < 20000 && seen.size < 2; k++) { // the browser's time is not real: frames are few
      await wait(7);
      seen.add(frame());
    }
    found.played = seen.size;
    await key(' ');
    found.paused = byId('play').getAttribute('aria-label');
    await set('time', '2', 'input');
    found.clock = byId('clock').textContent;
    const unchecked = document.querySelector('#methods input:not(:checked)');
    found.added = unchecked.value;
    unchecked.click();
    await wait(300);
    found.withAdded = panes();
    const point = document.querySelector('#errors [role=button][aria-pressed=false]');
    found.pointed = point?.dataset.method;
    point?.dispatchEvent(new MouseEvent('click', { bubbles: true }));
    await wait(300);
    found.withPointed = [...document.querySelectorAll('#methods input:checked')].map((box) => box.value);
    const before = picture();
    document.querySelector('[data-turn="180"]').click();
    await wait(200);
    found.turned = picture().some((x, k) => x !== before[k]);
    found.colours = [...byId('colour').options].map((option) => option.value);
    await set('colour', 'curvature');
    found.scale = byId('scale-title').textContent;
    const heads = [...document.querySelectorAll('#scroll thead button')];
    const last = heads.length - 1;
    heads[last].click();
    found.up = [document.querySelectorAll('#scroll th')[last].getAttribute('aria-sort'), column(last)];
    heads[last].click();
    found.down = [document.querySelectorAll('#scroll th')[last].getAttribute('aria-sort'), column(last)];
    heads[last].focus();
    found.definition = byId('definition').textContent;
    await set('scene', byId('scene').options[byId('scene').options.length - 1].value);
    found.scene = byId('scene').value;
    found.panesThere = panes();
    found.curves = document.querySelectorAll('#curves path[stroke]').length;
    for (const name of byId('table').options) await set('table', name.value);
  }

  addEventListener('DOMContentLoaded', () => {
    act().catch((error) => wrong.push(String(error.stack))).finally(() => {
      const note = document.createElement('pre');
      note.id = 'found';
      note.textContent = JSON.stringify({ ...found, wrong, hacked: window.hacked || false });
      document.body.append(note);
    });
  });
})();

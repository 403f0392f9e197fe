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
  // The browser's time is not real and passes faster than frames come.
  const until = async (holds) => {
    for (let k = 0; k < 3000 && !holds(); k++) await wait(20);
    return holds();
  };
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
  const column = (k) => [...document.querySelectorAll('#scroll tbody tr')].map((row) => row.children[k].textContent);

  async function act() {
    await until(() => panes().length && byId('clock').textContent && distinct() > 8);
    found.opens = [byId('play').getAttribute('aria-label'), byId('colour').value, location.hash];
    await key(' ');
    await set('scene', 'tshirt/walk@clip'); // has one-step errors
    await set('time', '2', 'input');
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
    found.played = await until(() => frame() > 0);
    await key(' ');
    found.paused = byId('play').getAttribute('aria-label');
    await set('time', '2', 'input');
    found.clock = byId('clock').textContent;
    const unchecked = document.querySelector('#methods input:not(:checked)');
    found.added = unchecked.value;
    unchecked.click();
    await until(() => panes().length && panes()[3] !== found.panes[3]);
    found.withAdded = panes();
    const point = document.querySelector('#errors [role=button][aria-pressed=false]');
    found.pointed = point?.dataset.method;
    point?.dispatchEvent(new MouseEvent('click', { bubbles: true }));
    await until(() => document.activeElement.dataset.method === found.pointed);
    found.withPointed = [...document.querySelectorAll('#methods input:checked')].map((box) => box.value);
    found.focused = document.activeElement.dataset.method;
    const before = picture();
    document.querySelector('[data-turn="180"]').click();
    found.turned = await until(() => picture().some((x, k) => x !== before[k]));
    found.colours = [...byId('colour').options].map((option) => option.value);
    const notes = () => [...document.querySelectorAll('.pane small')].map((note) => note.textContent);
    await set('colour', 'step');
    await set('time', 0, 'input');
    found.unjudged = notes();
    await set('time', 3, 'input');
    found.judged = notes();
    await set('colour', 'curvature');
    found.scale = byId('scale-title').textContent;
    const heads = [...document.querySelectorAll('#scroll thead button')];
    const last = heads.findIndex((head) => head.textContent.startsWith('Inference'));
    heads[last].click();
    found.up = [document.querySelectorAll('#scroll th')[last].getAttribute('aria-sort'), column(last)];
    heads[last].click();
    found.down = [document.querySelectorAll('#scroll th')[last].getAttribute('aria-sort'), column(last)];
    heads[last].focus();
    found.definition = byId('definition').textContent;
    found.copied = {};
    let kind = '';
    Object.defineProperty(navigator, 'clipboard', { value: { writeText: async (text) => { found.copied[kind] = text; } } });
    for (const button of document.querySelectorAll('[data-copy]')) {
      kind = button.dataset.copy;
      button.click();
      await wait(50);
    }
    HTMLAnchorElement.prototype.click = function saved() { found.picture = [this.download, this.href.slice(0, 22), this.href.length > 3000]; };
    byId('picture').click();
    found.address = decodeURIComponent(location.hash);
    await set('scene', byId('scene').options[byId('scene').options.length - 1].value);
    found.scene = byId('scene').value;
    await until(() => panes().length === 4 && document.querySelectorAll('#curves path[stroke]').length === 4);
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

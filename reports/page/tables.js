// The tables of the run: sorted by a click on the head of a column, with what the column means.

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function sortKey(cell) {
  return Array.isArray(cell) ? cell[1] : cell;
}

// What has no number stands last, whichever way the column is sorted.
function sorted(rows, column, direction) {
  const compare = (a, b) => {
    const [x, y] = [sortKey(a[column]), sortKey(b[column])];
    if (x === null || y === null) return (x === null) - (y === null);
    const order = typeof x === 'string' || typeof y === 'string'
      ? String(x).localeCompare(String(y), 'en', { numeric: true })
      : x - y;
    return direction * order;
  };
  return [...rows].sort(compare);
}

function showTable(table, root, definition, note) {
  let [column, direction] = [-1, 1];
  const [caption, head, body] = [root.caption, root.tHead, root.tBodies[0]];
  caption.textContent = table.caption;
  note.textContent = table.note;
  definition.textContent = '';
  const titles = table.columns.map((own, k) => {
    const button = element('button', { type: 'button' }, own.title);
    if (own.unit) button.append(' ', element('small', {}, `[${own.unit}]`));
    const cell = element('th', { scope: 'col', class: own.words ? 'words' : '' }, button);
    if (own.definition) cell.title = own.definition;
    const say = () => {
      definition.textContent = own.definition ? `${own.title}: ${own.definition}.` : '';
    };
    button.addEventListener('pointerenter', say);
    button.addEventListener('focus', say);
    button.addEventListener('click', () => {
      direction = column === k ? -direction : 1;
      column = k;
      fill();
    });
    return cell;
  });
  const fill = () => {
    titles.forEach((cell, k) => {
      if (k === column) cell.setAttribute('aria-sort', direction > 0 ? 'ascending' : 'descending');
      else cell.removeAttribute('aria-sort');
      const arrow = k === column ? (direction > 0 ? ' ▴' : ' ▾') : '';
      cell.querySelector('.arrow')?.remove();
      if (arrow) cell.firstChild.append(element('span', { class: 'arrow', 'aria-hidden': 'true' }, arrow));
    });
    const rows = column < 0 ? table.rows : sorted(table.rows, column, direction);
    body.replaceChildren(...rows.map((row) => lineOf(row, table)));
  };
  head.replaceChildren(element('tr', {}, ...titles));
  fill();
}

function lineOf(row, table) {
  const cells = row.map((cell, k) => {
    const [text, , spread, mark, link, picture] = Array.isArray(cell) ? cell : [cell, null, '', ''];
    const shown = text + (mark || '');
    const node = element('td', { class: table.columns[k].words ? 'words' : '' }, link ? element('a', { href: link }, shown) : shown);
    if (picture) node.prepend(element('img', { src: picture, alt: '', height: 80 }), element('br'));
    if (spread) node.append(element('small', {}, spread));
    return node;
  });
  return element('tr', {}, ...cells);
}

// The page of entries: its tables one below the other.

for (const table of JSON.parse(document.getElementById('content').textContent)) {
  const root = element('table', {}, element('caption'), element('thead'), element('tbody'));
  const note = element('p', { class: 'hint' });
  document.getElementById('tables').append(root, note);
  showTable(table, root, document.getElementById('definition'), note);
}

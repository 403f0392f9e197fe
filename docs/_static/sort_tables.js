// A click on the head of a column sorts the table by it; another click turns the order round.
document.addEventListener("DOMContentLoaded", () => {
  const number = (text) => {
    const [, value, power] = /^([−-]?[\d,.]+)(?:×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?/.exec(text) || [];
    if (value === undefined) return NaN;
    const digits = (power || "").replace("⁻", "-").replace(/[⁰¹²³⁴⁵⁶⁷⁸⁹]/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(d));
    return Number(value.replace("−", "-").replaceAll(",", "")) * 10 ** Number(digits || 0);
  };
  const compare = (a, b) => {
    const [x, y] = [number(a), number(b)];
    if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
    return Number.isNaN(x) ? a.localeCompare(b) : x - y;
  };
  for (const head of document.querySelectorAll("article table thead th")) {
    head.style.cursor = "pointer";
    head.title = "sort by this column";
    head.addEventListener("click", () => {
      const body = head.closest("table").tBodies[0];
      const text = (row) => row.cells[head.cellIndex].textContent.trim();
      const sign = head.dataset.order === "up" ? -1 : 1;
      head.dataset.order = sign > 0 ? "up" : "down";
      body.append(...[...body.rows].sort((a, b) => sign * compare(text(a), text(b))));
    });
  }
});

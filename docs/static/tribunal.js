/* Adds a filter by verdict and kind to tables of class "tribunal". */
"use strict";

const VERDICTS = ["impossible", "possible", "below", "not decided"];

/* Returns a function that says whether a row has a verdict. */
function judge(heads) {
  const numbers = heads.indexOf("numbers");
  const verdict = heads.indexOf("verdict");
  return (row, wanted) => {
    if (numbers >= 0) {
      return row.cells[numbers].textContent.split("/")[VERDICTS.indexOf(wanted)] > 0;
    }
    return row.cells[verdict].textContent.startsWith(wanted);
  };
}

/* Returns a group of buttons of which one is chosen. */
function choices(words, changed) {
  const group = document.createElement("span");
  group.setAttribute("role", "group");
  for (const word of ["all", ...words]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = word;
    button.setAttribute("aria-pressed", String(word === "all"));
    button.addEventListener("click", () => {
      for (const other of group.children) {
        other.setAttribute("aria-pressed", String(other === button));
      }
      changed(word);
    });
    group.append(button);
  }
  return group;
}

for (const box of document.querySelectorAll("div.tribunal")) {
  const table = box.querySelector("table");
  const heads = [...table.tHead.rows[0].cells].map((cell) => cell.textContent.trim());
  const has = judge(heads);
  const kind = heads.indexOf("kind");
  const rows = [...table.tBodies[0].rows];
  const chosen = { verdict: "all", kind: "all" };
  const count = document.createElement("span");
  count.setAttribute("role", "status");
  const show = () => {
    let shown = 0;
    for (const row of rows) {
      const right =
        (chosen.verdict === "all" || has(row, chosen.verdict)) &&
        (chosen.kind === "all" || row.cells[kind].textContent.trim() === chosen.kind);
      row.hidden = !right;
      shown += right;
    }
    count.textContent = `${shown} of ${rows.length} rows`;
  };
  const bar = document.createElement("div");
  bar.className = "tribunal-filter";
  bar.append(choices(VERDICTS, (word) => { chosen.verdict = word; show(); }));
  if (kind >= 0) {
    const kinds = [...new Set(rows.map((row) => row.cells[kind].textContent.trim()))];
    bar.append(choices(kinds, (word) => { chosen.kind = word; show(); }));
  }
  bar.append(count);
  box.prepend(bar);
  show();
}

// The arbiter's table, to try out: the reader chooses a state and conditions, and sees the row that counts.
// It reads the rows from the table of the page, which a test compares with the code.

/** Return the entries of a cell; "-" stands for none. */
function entries(text) {
  return text.trim() === "-" ? [] : text.split(",").map((entry) => entry.trim());
}

/** Return a row of the table from the texts of its cells. */
function rowOf([number, states, needs, unless, target, reason]) {
  return { number, states: entries(states), needs: entries(needs), unless: entries(unless), target, reason };
}

/** Return the first row that fits, or undefined: the state stays. */
function firstRow(rows, state, conditions) {
  const holds = (condition) => conditions.includes(condition);
  return rows.find((row) => row.states.includes(state) && row.needs.every(holds) && !row.unless.some(holds));
}

function textsOf(line) {
  return [...line.cells].map((cell) => cell.textContent.trim());
}

function choice(kind, name, checked) {
  const label = document.createElement("label");
  const input = Object.assign(document.createElement("input"), { type: kind, name: `arbiter-${kind}`, value: name, checked });
  label.append(input, ` ${name}`);
  return label;
}

function group(title, labels) {
  const set = document.createElement("fieldset");
  const legend = document.createElement("legend");
  legend.textContent = title;
  set.append(legend, ...labels);
  return set;
}

function play() {
  const place = document.getElementById("arbiter");
  if (!place) return;
  const [stateTable, rowTable] = ["output", "if all of"].map((heading) =>
    [...document.querySelectorAll("table")].find((table) => textsOf(table.rows[0]).includes(heading)));
  const outputs = Object.fromEntries([...stateTable.tBodies[0].rows].map(textsOf));
  const lines = [...rowTable.tBodies[0].rows];
  const rows = lines.map((line) => rowOf(textsOf(line)));
  const conditions = [...new Set(rows.flatMap((row) => [...row.needs, ...row.unless]))].sort();
  const usual = ["transmitter ready", "commands fresh", "own pose seen", "own pose seen in the air"];
  const form = document.createElement("form");
  const answer = document.createElement("p");
  const goOn = Object.assign(document.createElement("button"), { type: "button", className: "md-button" });
  answer.setAttribute("aria-live", "polite");
  form.append(
    group("in", Object.keys(outputs).map((state) => choice("radio", state, state === "ARMED"))),
    group("if", conditions.map((condition) => choice("checkbox", condition, usual.includes(condition)))),
  );
  place.append(form, answer, goOn);

  let next = "";
  function show() {
    const state = form.querySelector("input[type=radio]:checked").value;
    const row = firstRow(rows, state, [...form.querySelectorAll("input[type=checkbox]:checked")].map((input) => input.value));
    next = row ? row.target : state;
    answer.textContent = row
      ? `${state} becomes ${next} by row ${row.number}: ${row.reason}. Output: ${outputs[next]}.`
      : `It stays ${state}: no row fits. Output: ${outputs[state]}.`;
    goOn.textContent = `Go on in ${next}`;
    goOn.style.display = row ? "" : "none";
    lines.forEach((line, index) => line.classList.toggle("arbiter-counts", rows[index] === row));
  }
  form.addEventListener("change", show);
  goOn.addEventListener("click", () => {
    form.querySelector(`input[value="${next}"]`).checked = true;
    show();
  });
  show();
}

if (globalThis.document) document.addEventListener("DOMContentLoaded", play);

const all = [...document.querySelectorAll("article")];
const field = (a, name) => a.querySelector(`[name=${name}]`);
const key = a => ["nrdob", document.body.dataset.key, a.dataset.set, a.dataset.problem,
                  a.dataset.code].join("/");
const written = a => field(a, "points").defaultValue + "/" + field(a, "comment").defaultValue;
let unsaved = false;
function look() {
  let done = 0, bad = 0;
  for (const a of all) {
    const points = field(a, "points"), text = points.value.trim(), most = +a.dataset.of;
    const value = Number(text.replace(",", "."));
    const wrong = text !== "" && !(value >= 0 && value <= most);
    points.classList.toggle("bad", wrong);
    points.setAttribute("aria-invalid", wrong);
    a.classList.toggle("done", text !== "" && !wrong);
    done += text !== "" && !wrong; bad += wrong;
  }
  document.getElementById("state").textContent = `${done} of ${all.length} marked` +
    (bad ? `, ${bad} not between 0 and the points there are` : "");
}
function keep(a) {
  unsaved = true;
  const kept = ["points", "comment"].map(name => field(a, name).value);
  try { localStorage.setItem(key(a), JSON.stringify([...kept, written(a)])); } catch {}
}
function download() {
  const quoted = text => '"' + text.replaceAll('"', '""') + '"';
  const rows = all.map(a => [a.dataset.code, a.dataset.set, a.dataset.problem, a.dataset.of,
                             field(a, "points").value.trim(), field(a, "comment").value]);
  const text = [["code", "set", "problem", "of", "points", "comment"], ...rows]
    .map(row => row.map(quoted).join(",")).join("\n") + "\n";
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], {type: "text/csv"}));
  link.download = "marked.csv";
  link.click();
  unsaved = false;
}
for (const a of all) {
  try {
    const kept = JSON.parse(localStorage.getItem(key(a)) || "null");
    if (kept && kept[2] === written(a)) {  // else the grading has gone on since
      field(a, "points").value = kept[0];
      field(a, "comment").value = kept[1];
    }
  } catch {}
  a.addEventListener("input", () => { keep(a); look(); });
}
document.addEventListener("keydown", event => {
  if ((event.ctrlKey || event.metaKey) && event.key === "s") { event.preventDefault(); download(); }
  if (event.key === "Enter" && event.target.name === "points") {
    const fields = all.map(a => field(a, "points"));
    const next = fields[fields.indexOf(event.target) + (event.shiftKey ? -1 : 1)];
    if (next) { next.focus(); next.closest("article").scrollIntoView({block: "center"}); }
  }
});
document.getElementById("download").addEventListener("click", download);
window.addEventListener("beforeunload", event => { if (unsaved) event.preventDefault(); });
look();

// Finds nodes by their names, kinds, servers and files.

const find = (id) => document.getElementById(id);

export function create_search(app) {
  const query = find("query"),
    found = { hits: new Set(), search };
  let hits = [],
    at = -1;
  function search() {
    const wanted = query.value.trim().toLowerCase();
    hits = wanted ? app.run.order.filter((node) => node.words.includes(wanted)) : [];
    found.hits = new Set(hits.map((node) => node.id));
    at = -1;
    find("found").textContent = wanted ? String(hits.length) : "";
    app.touch();
  }
  query.addEventListener("input", search);
  find("find").addEventListener("submit", (event) => event.preventDefault());
  query.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      query.value = "";
      search();
      query.blur();
    }
    if (event.key !== "Enter" || !hits.length) return;
    at = (at + (event.shiftKey ? -1 : 1) + hits.length) % hits.length;
    find("found").textContent = `${at + 1} of ${hits.length}`;
    app.let_go();
    app.select(hits[at].id, { reveal: true });
  });
  return found;
}

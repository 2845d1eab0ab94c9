// The bar at the top of a drawn tree: the search, and light or dark.

const find = (id) => document.getElementById(id);

// `told` is told which nodes are searched for, and `go` goes to one.
export function create_search(nodes, told, go) {
  const query = find("query");
  let hits = [],
    at = -1;
  query.addEventListener("input", () => {
    const wanted = query.value.trim().toLowerCase();
    hits = wanted ? nodes.filter((node) => node.words.includes(wanted)) : [];
    at = -1;
    find("found").textContent = wanted ? `${hits.length} found` : "";
    told(hits);
  });
  find("search").addEventListener("submit", (event) => event.preventDefault());
  query.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || !hits.length) return;
    at = (at + (event.shiftKey ? -1 : 1) + hits.length) % hits.length;
    find("found").textContent = `${at + 1} of ${hits.length}`;
    go(hits[at]);
  });
}

export function create_theme() {
  const system = matchMedia("(prefers-color-scheme: dark)"),
    page = document.documentElement,
    button = find("theme");
  const is_dark = () => (page.dataset.theme ? page.dataset.theme === "dark" : system.matches);
  const tell = () => button.setAttribute("aria-pressed", is_dark());
  button.addEventListener("click", () => {
    page.dataset.theme = is_dark() ? "light" : "dark";
    tell();
  });
  system.addEventListener("change", tell);
  tell();
}

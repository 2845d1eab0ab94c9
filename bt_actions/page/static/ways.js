// Ways through the page: to what runs, to a failure, to a pane, and which nodes are folded.

const find = (id) => document.getElementById(id);

export const ways = (app, panes) => ({
  refolded() {
    panes.tree.layout();
    if (app.view === "graph") panes.graph.layout();
    app.touch();
  },
  open_above(n) {
    let changed = false;
    for (let up = app.run.nodes[n].parent; up >= 0; up = app.run.nodes[up].parent)
      if (app.folded.delete(up)) changed = true;
    if (changed) app.refolded();
  },
  jump_running() {
    const list = app.run.leaves(app.s),
      at = list.indexOf(app.sel);
    if (list.length) app.select(list[(at + 1) % list.length], { reveal: true });
  },
  first_failure() {
    const { causes, stopped, passed } = app.run.failures(app.s),
      [one] = [...causes, ...stopped, ...passed];
    if (one) app.select(one.n, { reveal: true });
  },
  fold_inactive() {
    const { run, s } = app,
      kept = new Set();
    const { causes, passed } = run.failures(s);
    for (const n of [...s.running, ...[...causes, ...passed].map((one) => one.n)])
      for (let up = n; up >= 0 && !kept.has(up); up = run.nodes[up].parent) kept.add(up);
    app.folded = new Set(
      run.order.filter((node) => node.children.length && node.parent >= 0 && !kept.has(node.id)).map((node) => node.id),
    );
  },
  go_view(view, tell = true) {
    app.view = view;
    find("outline").hidden = view !== "outline";
    find("graph").hidden = view === "outline";
    find("as-outline").setAttribute("aria-pressed", view === "outline");
    find("as-graph").setAttribute("aria-pressed", view === "graph");
    if (view === "graph") {
      if (tell && !app.folded.size && app.run.order.length > 100) app.fold_inactive();
      app.open_above(app.sel);
      panes.graph.layout();
    } else {
      panes.tree.layout();
      panes.tree.show(app.sel);
    }
    if (tell) app.remember();
    app.touch();
  },
  go_tab(tab, tell = true) {
    app.tab = tab;
    find("side").dataset.tab = tab;
    for (const id of ["details", "values", "log"]) {
      find(`tab-${id}`).setAttribute("aria-selected", id === tab);
      find(`tab-${id}`).tabIndex = id === tab ? 0 : -1;
    }
    if (tell) app.remember();
    app.touch();
  },
  go_pane(pane, tell = true) {
    app.pane = pane;
    document.body.dataset.pane = pane;
    if (["details", "values", "log"].includes(pane)) app.go_tab(pane, false);
    for (const button of document.querySelectorAll("#dock button"))
      button.setAttribute("aria-current", button.dataset.go === pane);
    if (tell) app.remember();
    app.touch();
  },
});

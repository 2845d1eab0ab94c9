// What a node of a tree looks like, in every picture and page: look.py reads this table as JSON, for Graphviz's pictures, and
// says the same of a node. Shapes are py_trees' own.

// oxfmt-ignore
export const TABLE = {
  "letters": 28,
  "looks": {
    "sequence": {"shape": "box", "fill": "#ffc46b"},
    "fallback": {"shape": "octagon", "fill": "#8ee3ea"},
    "parallel": {"shape": "parallelogram", "fill": "#ffe070"},
    "action": {"shape": "ellipse", "fill": "#bfd7ff"},
    "decorator": {"shape": "ellipse", "fill": "#f4f4fc"},
    "leaf": {"shape": "ellipse", "fill": "#d4d8dd"}
  }
};

export function look(node) {
  const word = node.kind.replace(/^reactive /, "").split(",")[0];
  const name = node.server
    ? "action"
    : ["sequence", "fallback", "parallel"].includes(word)
      ? word
      : node.children.length
        ? "decorator"
        : "leaf";
  return { name, ...TABLE.looks[name] };
}

// The lines of a node's name, of so many letters at most, and the smaller ones below.
export function label(node) {
  const lines = [""];
  for (const word of node.name.split(/\s+/).filter(Boolean)) {
    for (let at = 0; at < word.length; at += TABLE.letters) {
      const part = word.slice(at, at + TABLE.letters),
        line = `${lines.at(-1)} ${part}`.trim();
      if (line.length > TABLE.letters || at) lines.push(part);
      else lines[lines.length - 1] = line;
    }
  }
  return { lines, under: [...(node.server ? [node.server, node.type].filter(Boolean) : [node.kind]), ...node.gates] };
}

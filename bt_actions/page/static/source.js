// The lines of the file around a node, with those that made it; colours say key, value, comment.

import { el } from "./dom.js";
import { place } from "./words.js";

export function source(files, node) {
  const text = files[node.file];
  if (!text || !node.line)
    return el("p", {
      class: "none-yet",
      text: node.line ? "This file is not recorded." : "This node was made in Python.",
    });
  const lines = text.split("\n"),
    from = Math.max(1, node.line - 2),
    to = Math.min(lines.length, node.line + 8);
  const made = el("pre", { class: "yaml", tabindex: "0", "aria-label": `${place(node)}` });
  for (let k = from; k <= to; k++)
    made.append(el("div", { class: k === node.line ? "at" : "" }, el("span", { text: k }), colour(lines[k - 1] || "")));
  return made;
}

function colour(line) {
  const out = el("span"),
    at = line.search(/(^|\s)#/),
    code = at < 0 ? line : line.slice(0, at),
    rest = at < 0 ? "" : line.slice(at);
  const found = code.match(/^(\s*(?:- )?)([\w]+)(:)(.*)$/);
  if (found)
    out.append(
      found[1],
      el("span", { class: "ky", text: found[2] }),
      found[3],
      ...found[4]
        .split(/(\$\w[\w.]*)/)
        .map((part) => (part.startsWith("$") ? el("span", { class: "va", text: part }) : part)),
    );
  else out.append(code);
  if (rest) out.append(el("span", { class: "cm", text: rest }));
  return out;
}

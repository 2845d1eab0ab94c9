"""The site of these pages, for Sphinx: `make site` builds it in build/site, and rosdoc2 where ROS's
pages are built. The Markdown stays as GitHub shows it: what only the site needs is added here."""

from __future__ import annotations

from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

README = Path(__file__).resolve().parent.parent / "README.md"

project = html_title = "bt_actions"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_show_copyright = html_show_sphinx = False

myst_heading_anchors = 4  # links lead to headings by the names that GitHub gives them
suppress_warnings = ["misc.highlighting_failure"]  # a tree that is wrong on purpose (rules.md)

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_inherit_docstrings = False
default_role = "code"

NAVIGATION = {
    "Learn": [
        "tutorials/first_tree",
        "tutorials/own_action",
        "tutorials/it_failed_at_night",
        "tutorials/leaf_by_leaf",
        "recipes",
    ],
    "Use": ["yaml", "rules", "editors", "import", "running", "events", "recording", "view"],
    "Try and test": ["simulation", "testing"],
    "In your system": [
        *("embedding", "python", "interfaces", "serving", "security"),
        *("launch", "workspace", "reliability-settings"),
    ],
    "Trust": ["promises", "reliability", "rare-cases", "performance", "weaker"],
    "You know another tool": [
        f"coming_from/{name}"
        for name in ("py_trees_ros", "nav2", "behaviortree_cpp", "yasmin", "scenario_execution")
    ],
    "How it is made": ["CONTRIBUTING", "architecture", "goal", "glossary"],
}


def front_page(index: str) -> str:
    """Return the README, all pages below it, and the navigation at the side."""
    readme = README.read_text(encoding="utf-8").replace("](docs/", "](")
    parts = [readme, index.replace("# All pages", "## All pages", 1)]
    for caption, names in NAVIGATION.items():
        parts.append("\n".join(["```{toctree}", ":hidden:", f":caption: {caption}", "", *names]))
        parts.append("```")
    return "\n".join(parts)


def read(_app: Sphinx, name: str, source: list[str]) -> None:
    """Make of a page of the repository a page of the site."""
    text = front_page(source[0]) if name == "index" else source[0]
    source[0] = text.replace("](../README.md", "](index.md")


def setup(app: Sphinx) -> None:
    """Connect what is above."""
    app.connect("source-read", read)
    for language in ("mermaid", "osc"):
        app.add_lexer(language, TextLexer)

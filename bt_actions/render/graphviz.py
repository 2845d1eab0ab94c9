"""Layout and drawing of dot with the Graphviz libraries inside the pygraphviz wheel.

All work is done in this process: no `dot` on the PATH is started. Knows nothing of behaviour trees.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator

_POINTS_PER_INCH = 72.0
_DOTS_PER_INCH = 144.0
_FEWEST_DOTS_PER_INCH = 10.0
_LONGEST_SIDE = 30_000.0
"""In pixels; cairo draws no bitmap with a side of 32,768 or more."""
_MOST_PIXELS = 120e6


class RenderError(Exception):
    """A picture that cannot be made or written; the text says why and what to do."""


def draw(dot: str, form: str) -> bytes:
    """Return a graph in the dot language as the bytes of an "svg" or "png" file.

    Raises RenderError when pygraphviz is missing or Graphviz refuses to draw.
    """
    try:
        import pygraphviz
    except ImportError as error:
        raise RenderError(
            f"{form} needs pygraphviz, which cannot be imported here ({error}); "
            "`pip install pygraphviz`, or write .txt or .dot"
        ) from error
    with _quiet() as said:
        try:
            graph = pygraphviz.AGraph(string=dot)
            if form == "png":
                graph.layout(prog="dot")
                graph.graph_attr["dpi"] = str(_dots_per_inch(str(graph.graph_attr["bb"])))
            image = graph.draw(format=form, prog="dot")
        except (ValueError, OSError) as error:
            raise RenderError(
                f"Graphviz cannot draw this tree: {error} {said()}".strip()
            ) from error
    if not isinstance(image, bytes) or not image:
        raise RenderError("Graphviz drew nothing")
    return _centred(image.decode()).encode() if form == "svg" else image


def _dots_per_inch(bounding_box: str) -> float:
    left, bottom, right, top = (float(edge) for edge in bounding_box.split(","))
    width, height = max(right - left, 1.0), max(top - bottom, 1.0)
    longest = _LONGEST_SIDE * _POINTS_PER_INCH / max(width, height)
    area = _POINTS_PER_INCH * math.sqrt(_MOST_PIXELS / (width * height))
    dots = min(_DOTS_PER_INCH, longest, area)
    if dots < _FEWEST_DOTS_PER_INCH:
        raise RenderError(
            "a .png of this tree would be too small to read; show fewer levels of it (--depth), "
            "or write .html, .svg or .txt"
        )
    return dots


def _centred(svg: str) -> str:
    """Centre each node's text in its shape.

    Graphviz places lines of two font sizes by the left edge that it measured with this machine's
    font; where the reader's font is narrower they would hang to the left.
    """

    def centre(group: re.Match[str]) -> str:
        node = group.group()
        ellipse = re.search(r'<ellipse [^>]*cx="(-?[\d.]+)"', node)
        polygon = re.search(r'<polygon [^>]*points="([^"]+)"', node)
        if ellipse:
            middle = ellipse.group(1)
        elif polygon:
            across = [float(point.split(",")[0]) for point in polygon.group(1).split()]
            middle = f"{(min(across) + max(across)) / 2:.2f}"
        else:
            return node
        return re.sub(r'text-anchor="start" x="[^"]*"', f'text-anchor="middle" x="{middle}"', node)

    return re.sub(r'<g id="node\d+" class="node">.*?</text>\n</a>', centre, svg, flags=re.DOTALL)


@contextlib.contextmanager
def _quiet() -> Iterator[Callable[[], str]]:
    """Keep the output of C libraries on file descriptor 2; yield a function that returns it.

    Fontconfig reports its own configuration's oddities there, on every machine that has any.
    """
    with tempfile.TemporaryFile() as kept:

        def said() -> str:
            kept.seek(0)
            return kept.read().decode(errors="replace")

        sys.stderr.flush()
        before = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            with contextlib.redirect_stderr(io.StringIO()):
                yield said
        finally:
            os.dup2(before, 2)
            os.close(before)

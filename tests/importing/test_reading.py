"""XML from strangers is read as tinyxml2 reads it, within bounds, with the places of the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.importing import reading
from bt_actions.importing.convert import convert
from bt_actions.importing.reading import XmlError, parse
from bt_actions.importing.report import Verdict


def told(text: str) -> str:
    with pytest.raises(XmlError) as caught:
        parse(text, "f.xml")
    return str(caught.value)


def test_bare_signs_stand_in_attributes_and_places_are_those_of_the_file() -> None:
    text = """<root>
 <A x="a<b && c>d" y='&lt;&#65;&amp;&no;'/><B/>&
 <!-- a -- & < -->
 <C/></root>"""
    first, second, third = parse(text, "f.xml").children
    assert first.attributes == {"x": "a<b && c>d", "y": "<A&&no;"}
    assert (first.line, first.column) == (2, 2)
    assert (second.line, second.column) == (2, text.splitlines()[1].index("<B/>") + 1)
    assert third.comments == [" a -- & < "]
    assert (third.line, third.column) == (4, 2)


def test_a_place_behind_bare_signs_is_that_of_the_file() -> None:
    assert told('<root><A x="<<&&"/></B></root>').startswith("f.xml:1:22: mismatched tag")


@pytest.mark.parametrize(
    "doctype",
    [
        '<!DOCTYPE x [<!ENTITY a "b">]>',
        '<!DOCTYPE x SYSTEM "file:///etc/passwd">',
        '<!DOCTYPE x [<!ENTITY % e SYSTEM "http://localhost/"> %e;]>',
    ],
)
def test_no_entity_is_declared_or_fetched(doctype: str) -> None:
    assert "a DOCTYPE, which may hold entities" in told(f"<?xml version='1.0'?>\n{doctype}<x/>")


def test_elements_inside_of_each_other_are_bounded() -> None:
    assert f"nested deeper than {reading.DEEPEST} elements" in told("<a>" * 10_000)


def test_a_large_file_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    file = tmp_path / "large.xml"
    with file.open("wb") as stream:
        stream.truncate(100_000_000)
    (error,) = convert([file]).failed
    assert str(error) == f"{file}:1:1: this is larger than 32 MiB"
    assert "more than 4,000,000 characters" in told("<a/>" + " " * 4_000_000)


@pytest.mark.parametrize(
    "text",
    ["", "no XML", "<root>", "<root><!-- ", '<root a="', "<?xml", "<a></b>", "\ufeff<a", "<a/>&"],
)
def test_what_is_no_xml_is_refused_with_its_place(text: str) -> None:
    assert told(text).startswith("f.xml:1:")


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "f.xml"
    file.write_bytes(b"<root>\n<A x='\xff'/></root>")
    (error,) = convert([file]).failed
    assert str(error) == f"{file}:2:7: byte 0xff is no UTF-8"


@pytest.mark.parametrize("path", ["../secret.xml", "/etc/passwd", "link.xml", "a/../../secret.xml"])
def test_an_include_leads_to_no_other_folder(path: str, tmp_path: Path) -> None:
    (tmp_path / "secret.xml").write_text(
        '<root><BehaviorTree ID="Secret"><A/></BehaviorTree></root>'
    )
    folder = tmp_path / "trees"
    folder.mkdir()
    (folder / "a").mkdir()
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    main = folder / "main.xml"
    main.write_text(
        f'<root>\n<include path="{path}"/><BehaviorTree ID="M"><A/></BehaviorTree></root>'
    )
    imported = convert([main])
    assert [*imported.files] == ["M.yaml", "leaves_to_write.py"]
    refused = [entry for entry in imported.report if entry.verdict is Verdict.REFUSED]
    assert [(entry.line, entry.name) for entry in refused] == [(2, f"include {path}")]


def test_an_include_beside_the_file_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    part = tmp_path / "parts" / "part.xml"
    part.write_text(
        '<root><include path="../main.xml"/>'
        '<BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree></root>'
    )
    main = tmp_path / "main.xml"
    main.write_text(
        '<root><include path="parts/part.xml"/><include path="parts/part.xml"/>'
        '<BehaviorTree ID="M"><SubTree ID="Part"/></BehaviorTree></root>'
    )
    assert [*convert([main]).files] == ["M.yaml", "Part.yaml"]

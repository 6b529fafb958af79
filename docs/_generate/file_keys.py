"""Directive `file-keys`: a table per struct of a TOML file, taken from the msgspec struct that reads the file.

    ```{file-keys} fenchel.dem.scene.Scene
    ```

Key, type, unit, default and meaning all come from the struct, so that the page cannot say anything else than the program does.
"""

from __future__ import annotations

import importlib
import json
from typing import Any

import msgspec
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

HEADS = ("key", "type", "unit", "default", "meaning")
BOUNDS = {"minimum": "≥ {}", "exclusiveMinimum": "> {}", "maximum": "≤ {}", "exclusiveMaximum": "< {}"}
NAMES = {"string": "text", "integer": "integer", "number": "number", "boolean": "true or false"}


class FileKeys(SphinxDirective):
    """One section per table of the file, the outermost first."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        module, _, name = self.arguments[0].rpartition(".")
        self.struct = getattr(importlib.import_module(module), name)
        schema = msgspec.json.schema(self.struct)
        self.definitions = schema.get("$defs", {})
        return self.sections(self.resolve(schema), "")

    def resolve(self, schema: dict[str, Any]) -> dict[str, Any]:
        """The definition behind a reference, with the words said beside the reference taking precedence."""
        while "$ref" in schema:
            beside = {key: value for key, value in schema.items() if key != "$ref"}
            schema = {**self.definitions[schema["$ref"].rpartition("/")[2]], **beside}
        return schema

    def table_of(self, schema: dict[str, Any]) -> dict[str, Any] | None:
        """The struct inside a property, if it is one (also as one of several choices, or as the items of a list)."""
        whole = self.resolve(schema)
        if "properties" in whole:
            return whole
        choices = [*whole.get("anyOf", ()), *([whole["items"]] if isinstance(whole.get("items"), dict) else [])]
        inner = [self.resolve(choice) for choice in choices]
        return next((choice for choice in inner if "properties" in choice), None)

    def sections(self, struct: dict[str, Any], path: str) -> list[nodes.Node]:
        title = f"[{path}]" if path else "Top level"
        identifier = nodes.make_id(f"{self.struct.__module__}-{self.struct.__name__}-{path or 'top'}")
        section = nodes.section("", nodes.title(text=title), ids=[identifier], names=[identifier])
        if struct.get("description"):
            section += paragraph(struct["description"])
        tables, rows = [], []
        for key, schema in struct["properties"].items():
            inner = self.table_of(schema)
            if inner is not None:
                tables.append((f"{path}.{key}" if path else key, inner))
            else:
                rows.append(self.row(key, self.resolve(schema), key in struct.get("required", ())))
        if rows:
            section += table(rows)
        if tables:
            listed = ", ".join(f"[{name}]" for name, _ in tables)
            section += nodes.paragraph(text=f"Tables: {listed}.")
        out: list[nodes.Node] = [section]
        for name, inner in tables:
            out += self.sections(inner, name)
        return out

    def row(self, key: str, schema: dict[str, Any], required: bool) -> tuple[str, ...]:
        missing = [word for word in ("description",) if not schema.get(word)]
        if missing:
            raise self.error(f"{self.struct.__name__}: the key {key} has no description")
        default = "required" if required else json.dumps(schema.get("default"), ensure_ascii=False)
        return (
            key,
            self.kind(schema),
            schema.get("unit", schema.get("units", "")),
            default.replace("null", "–"),
            schema["description"],
        )

    def kind(self, schema: dict[str, Any]) -> str:
        schema = self.resolve(schema)
        if "enum" in schema:
            return " | ".join(json.dumps(value, ensure_ascii=False) for value in schema["enum"])
        if "anyOf" in schema:
            return " or ".join(self.kind(choice) for choice in schema["anyOf"] if choice.get("type") != "null")
        if schema.get("type") == "array":
            return self.kind_of_array(schema)
        if isinstance(schema.get("type"), list):
            word = " or ".join(NAMES.get(name, name) for name in schema["type"] if name != "null")
        else:
            word = NAMES.get(schema.get("type", ""), schema.get("type", "any"))
        bounds = [text.format(schema[name]) for name, text in BOUNDS.items() if name in schema]
        return ", ".join([word, *bounds])

    def kind_of_array(self, schema: dict[str, Any]) -> str:
        if "prefixItems" in schema:
            return "[" + ", ".join(self.kind(item) for item in schema["prefixItems"]) + "]"
        items = schema.get("items")
        return f"list of {self.kind(items)}" if isinstance(items, dict) else "list"


def paragraph(text: str) -> nodes.paragraph:
    """A paragraph in which what stands between backticks is a literal."""
    out = nodes.paragraph()
    for place, piece in enumerate(text.split("`")):
        if piece:
            out += nodes.literal(text=piece) if place % 2 else nodes.Text(piece)
    return out


def table(rows: list[tuple[str, ...]]) -> nodes.table:
    """A table with the heads of this file."""
    group = nodes.tgroup(cols=len(HEADS))
    for width in (18, 20, 10, 16, 46):
        group += nodes.colspec(colwidth=width)
    head, body = nodes.thead(), nodes.tbody()
    head += line([nodes.Text(word) for word in HEADS])
    for key, kind, unit, default, meaning in rows:
        body += line(
            [nodes.literal(text=key), nodes.Text(kind), nodes.Text(unit), nodes.Text(default), nodes.Text(meaning)]
        )
    group += head
    group += body
    return nodes.table("", group)


def line(cells: list[nodes.Node]) -> nodes.row:
    """A row of one-paragraph cells."""
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", nodes.paragraph("", "", cell))
    return row


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    sphinx.add_directive("file-keys", FileKeys)
    return {"parallel_read_safe": True, "version": "1"}

"""Pieces of the HTML reports: one style, tables, pictures inside the file, the page. Nothing is fetched from anywhere."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

__all__ = ["figure_html", "page_html", "table_html"]

CSS = """
:root{color-scheme:light}
body{margin:0 auto;max-width:46rem;padding:1rem;font:16px/1.5 Georgia,"Times New Roman",serif;color:#222;background:#fff}
h1{font-size:1.5rem;line-height:1.2;margin:.5rem 0}h2{font-size:1.1rem;margin:2rem 0 .5rem}
ul.findings{padding-left:1.1rem}ul.findings li{margin:.3rem 0}ul.findings li.first{font-weight:bold}
figure{margin:1.2rem 0}figure img{width:100%;height:auto}figcaption,caption{font-size:.9rem;color:#555;text-align:left}
.scroll{overflow-x:auto;margin:1rem 0}
table{border-collapse:collapse;font:13px/1.4 system-ui,sans-serif;font-variant-numeric:tabular-nums}
th,td{padding:.2rem .7rem .2rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #eee}
th{font-weight:600;color:#555}td:not(:first-child){white-space:nowrap}
summary{cursor:pointer;font-size:.9rem;color:#555}footer{margin:2rem 0;font-size:.85rem;color:#777}
code{font-size:.85em}
"""


def table_html(
    key: str, caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], *, folded: bool = False
) -> str:
    """A table that scrolls where it is wide; `folded` behind its caption. Cells are text."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    title = "" if folded else f"<caption>{escape(caption)}</caption>"
    inside = f"{title}<thead><tr>{top}</tr></thead><tbody>{body}</tbody>"
    html = f'<div class="scroll"><table id="{key}">{inside}</table></div>'
    return f"<details><summary>{escape(caption)}</summary>{html}</details>" if folded else html


def figure_html(key: str, caption: str, data: bytes, kind: str = "svg") -> str:
    """A picture with its caption, inside the page."""
    mime = "image/svg+xml" if kind == "svg" else "image/png"
    return (
        f'<figure id="figure-{key}"><img alt="{escape(caption)}" src="data:{mime};base64,{b64encode(data).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def page_html(title: str, body: str, *, style: str = "") -> str:
    """The whole page; `style` is added to that of all reports."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{CSS}{style}</style></head><body>{body}</body></html>\n"
    )

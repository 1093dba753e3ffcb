"""Looks of the page for which viser has no setting: names, a status of fixed height, room for the scene on a phone."""

from html import escape
from json import dumps

import viser

from abs_service.display.page.readouts.words import STALE_COLOR

#: Time without renewal after which a status turns grey, with the reason above it; the browser does so by itself [s].
GONE_S = 5

#: Width of a screen up to which viser's panel lies at its bottom [em], and the most that it then takes [%].
NARROW_EM, SHEET = 36, 50

#: What holds the scene and, on a narrow screen, viser's panel, which is put below the scene and no more over it.
_ROOM = "div:has(> .mantine-Paper-root .abs-status)"

#: A button that another one follows; the two stand side by side.
_NEXT = "div:has(> .mantine-Button-root):has(+ div > .mantine-Button-root)"

STYLE = f"""<style>
@keyframes abs-gone {{ to {{ visibility: visible; max-height: 20em; padding: 8px 12px; margin: 6px 8px }} }}
@keyframes abs-old {{ to {{ filter: grayscale(1) opacity(.5) }} }}
.abs-gone {{ visibility: hidden; max-height: 0; animation: abs-gone 0s {GONE_S}s forwards; background: {STALE_COLOR};
  color: white; border-radius: 6px; overflow: hidden }}
.abs-status {{ animation: abs-old 0s {GONE_S}s forwards }}
div:has(> .abs-status) {{ height: 8.5em; overflow-y: auto; overscroll-behavior: contain; scrollbar-width: thin;
  box-sizing: border-box; padding-bottom: 1.2em; mask-image: linear-gradient(black calc(100% - 1.2em), transparent) }}
{_NEXT}, {_NEXT} + div:has(> .mantine-Button-root) {{ display: inline-block; box-sizing: border-box; width: 50%;
  margin-inline: 0 !important; padding-inline: 8px }}
pre {{ white-space: pre-wrap !important }}
@media (max-width: {NARROW_EM}em) {{
  div:has(> .abs-status) {{ height: 7em }}
  {_ROOM} {{ flex-direction: column }}
  {_ROOM} > div:has(canvas):not(.mantine-Paper-root) {{ height: auto !important; min-height: 0 }}
  {_ROOM} > .mantine-Paper-root {{ position: relative !important; flex: none; width: 100% !important;
    max-height: {SHEET}% !important }}
  {_ROOM} > .mantine-Paper-root [style*="width: 20em"] {{ width: 100% !important }}
}}
</style>"""

GONE = """<div class='abs-gone'><b>This page has lost its connection</b><br>Does abs-service still run?
It connects again by itself; what it shows is old.</div>"""


def show_name(gui: viser.GuiApi, name: str) -> None:
    """Names a page, in its panel and in the browser's tab, where viser has its own name and no setting."""
    gui.set_panel_label(name)
    title = escape(f"document.title = {dumps(f'{name} · abs-service')}")
    gui.add_html(f'<img src="data:," onerror="{title}" hidden>')  # a script would not run

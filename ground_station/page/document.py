"""The document of the page and its files: served by a process, or saved as one file that needs none."""

import re
from base64 import b64encode
from collections.abc import Mapping
from functools import cache
from html import escape
from pathlib import Path
from typing import Final
from zlib import compress

from msgspec.json import encode

from rcopterx.ground_station.page.sentences import Words

WEB: Final = Path(__file__).parent / "web"
_CONTROLS: Final = re.compile("<!--controls-->.*?<!--/controls-->", re.DOTALL)  # parts of the document
_LINKS: Final = re.compile("<!--links-->.*?<!--/links-->", re.DOTALL)
_IMPORT: Final = re.compile(r"""^(import .*?|import )'\./(\w+\.js)';""", re.MULTILINE)


@cache
def web_files() -> Mapping[str, bytes]:
    """Style sheets and scripts by their paths."""
    paths = (path for path in WEB.rglob("*") if path.suffix in (".css", ".js"))
    return {path.relative_to(WEB).as_posix(): path.read_bytes() for path in paths}


def document(name: str, sentence: Words, steers: bool) -> str:
    """Return the document with its first sentence; with controls only if it `steers`."""
    text = (WEB / "index.html").read_text("utf-8")
    text = text if steers else _CONTROLS.sub("", text)
    for part, content in (("name", name), ("sentence", sentence.text), ("level", sentence.level)):
        text = text.replace(f"{{{part}}}", escape(content))
    return text


def saved(title: str, recorded: str, films: object, figures: str, folded: str) -> str:
    """Return the page of recorded flights as one file, which opens without a server.

    `recorded` says in the bar what is shown, `films` is what `web/film.js` plays; `figures` and `folded` are
    HTML above and below.
    """
    text = document(title, Words("", "off"), steers=False)
    parts = {"<!--recorded-->": f'<p id="recorded">{escape(recorded)}</p>', "<!--figures-->": figures}
    parts |= {"<!--folded-->": folded, "<body>": '<body class="recorded">'}
    for mark, content in parts.items():
        text = text.replace(mark, content)
    return _LINKS.sub(lambda _: _inlined(films), text)


def _inlined(films: object) -> str:
    """Style sheets, scripts and films; modules are data that an import map names, as no file has paths."""
    files = {name: content.decode() for name, content in web_files().items()}
    styles = (f"<style>{content}</style>" for name, content in files.items() if name.endswith(".css"))
    libraries = (
        f"<script>{files[name]}</script>"
        for name in files
        if name.startswith("vendor/") and name.endswith(".js")
    )
    modules = {name: _IMPORT.sub(r"\1'\2';", content) for name, content in files.items() if "/" not in name}
    addresses = {
        name: f"data:text/javascript;base64,{b64encode(content.encode()).decode()}"
        for name, content in modules.items()
        if name.endswith(".js")
    }
    data = b64encode(compress(encode(films), 9)).decode()
    return "\n".join((
        *styles, *libraries, f'<script type="importmap">{encode({"imports": addresses}).decode()}</script>',
        f'<script type="application/octet-stream" id="films">{data}</script>',
        "<script type=\"module\">import 'main.js';</script>",
    ))  # fmt: skip

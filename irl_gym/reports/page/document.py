"""One file with everything in it: templates, style, scripts, data, and Plotly once.

Nothing is fetched: the page's own policy forbids it. Scripts are allowed by their digest, and text of the run is data in json
or escaped by the template. The same content makes the same bytes: there is no date and no random name.
"""

import base64
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from irl_gym.files.run_folder import write_text

HERE = Path(__file__).parent / "assets"


def write_page(path: str | os.PathLike, template: str, context: Mapping[str, Any], data: Any, scripts: Sequence[str]) -> None:
    """Write a page beside, then rename; where that fails nothing is left beside.

    Args:
        path: of the file.
        template: its name in this folder.
        context: what the template shows.
        data: json values for the scripts.
        scripts: names of scripts in this folder, run in this order after Plotly.

    Raises:
        InvalidParameter: there is a folder of the file's own name.
        OSError: the system refused.
    """
    code = "\n".join(_asset(name) for name in scripts)
    plotly = get_plotlyjs()
    embedded = {
        "style": Markup("\n".join(_asset(name) for name in ("page.css", "parts.css"))),
        "plotly": Markup(plotly),
        "code": Markup(code),
        "digests": Markup(" ".join(f"'{_digest(one)}'" for one in (plotly, code))),
        "data": Markup(embedded_json(data)),
    }
    text = _templates().get_template(template).render(**context, **embedded)
    write_text(Path(path), text)


def embedded_json(data: Any) -> str:
    """Json that may stand inside a script element: no `<`, `>` or `&` is left in it."""
    text = json.dumps(data, sort_keys=True, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


@cache
def _templates() -> Environment:
    return Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )


@cache
def _asset(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")


def _digest(code: str) -> str:
    """How a content security policy names a script: the digest of exactly what stands in its element."""
    return f"sha256-{base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()}"

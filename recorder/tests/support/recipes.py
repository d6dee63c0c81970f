"""The recipes of docs/transparent-proxy.md, read from the page."""

import re
from dataclasses import dataclass
from pathlib import Path

from scaraspec_recorder.tap.routes import Mode

PAGE = Path(__file__).parents[3] / "docs" / "transparent-proxy.md"

_TITLES = {Mode.REDIRECT: "REDIRECT", Mode.TPROXY: "TPROXY"}
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Recipe:
    """The code blocks of one section of the page.

    Attributes:
        file_name: The file name of the script.
        script: The nftables script.
        record: The command that starts the recorder.
        install: The commands that install the rules.
        remove: The commands that remove them.
    """

    file_name: str
    script: str
    record: str
    install: str
    remove: str


def recipe(mode: Mode, controller: str = "192.168.1.2") -> Recipe:
    """Return the recipe of a mode, with the address of the controller."""
    if mode is Mode.EXPLICIT:
        return Recipe("", "", "", "", "")
    _, _, section = PAGE.read_text("utf-8").partition(f"\n## {_TITLES[mode]}\n")
    text = section.partition("\n## ")[0].replace("192.168.1.2", controller)
    (script,) = (block for language, block in _BLOCK.findall(text) if language == "nft")
    record, install, remove = (
        block for language, block in _BLOCK.findall(text) if language == "sh"
    )
    return Recipe(f"{mode.value}.nft", script, record, install, remove)

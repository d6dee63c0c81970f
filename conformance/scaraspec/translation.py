"""Translation of messages when they are displayed: on the terminal, in help texts and on pages.

A message is translated where it is shown, never where it is made. What programs read stays in
English: results.json, JUnit, CTRF, fingerprints and machine-readable logs. The catalogues are in
``locale/zh/LC_MESSAGES``, one for each part of the code; the English template is the key. English
needs no catalogue. docs/translation.md describes how to add a translation.
"""

import os
import re
from enum import Enum
from functools import cache
from pathlib import Path
from string import Formatter
from typing import TYPE_CHECKING, Any, Final

from scaraspec.operating_system import user_locale
from scaraspec.user_message import UserMessage, sentence_of

if TYPE_CHECKING:
    from gettext import NullTranslations

LOCALE: Final = Path(__file__).with_name("locale")
"""The folder of the catalogues."""
VARIABLE: Final = "SCARASPEC_LANGUAGE"
"""The environment variable that selects the language."""
CLICK_DOMAIN: Final = "click"
"""The catalogue of the words of click, which uses gettext itself."""


class Language(Enum):
    """A language of messages and pages."""

    ENGLISH = "en"
    CHINESE = "zh"


class _Display:
    """The language of the terminal, which belongs to the process, as the locale does."""

    language = Language.ENGLISH


def preferred_language() -> Language:
    """Return the language that the environment variable or the locale of the user selects."""
    chosen = os.environ.get(VARIABLE) or user_locale()
    return Language.CHINESE if chosen.lower().startswith("zh") else Language.ENGLISH


def display_language() -> Language:
    """Return the language in which messages are displayed."""
    return _Display.language


def set_display_language(language: Language) -> None:
    """Set the language in which messages are displayed, also those of click."""
    import gettext  # noqa: PLC0415 - click has imported it, other users of the package need it not

    _Display.language = language
    if language is Language.ENGLISH:
        gettext.textdomain("messages")
    else:
        gettext.bindtextdomain(CLICK_DOMAIN, f"{LOCALE}")
        gettext.textdomain(CLICK_DOMAIN)
        os.environ["LANGUAGE"] = language.value  # the only way to tell gettext


def localized(template: str, /, **values: Any) -> str:
    """Return a sentence in the display language.

    Args:
        template: A message, a constant sentence, or a template of the values.
        values: The values by name; values that are messages are translated, too.
    """
    message = UserMessage(template, **values) if values else template
    return translate(message, display_language())


def localized_value(value: str) -> str:
    """Return a value in the display language: a message or a phrase, but not a name."""
    return _translated_value(value, display_language())


def translate(message: str, language: Language) -> str:
    """Return a message in a language; in English if it has no translation.

    Args:
        message: A `UserMessage` or a constant sentence.
        language: The language.
    """
    if language is Language.ENGLISH:
        return f"{message}"
    if not isinstance(message, UserMessage):
        return _translated_template(message, language) or message
    if (template := _translated_template(message.template, language)) is None:
        return f"{message}"
    values = {name: _translated_value(text, language) for name, text in message.values.items()}
    try:
        return _FORMATTER.vformat(template, (), values)
    except (KeyError, ValueError):  # read from a file of another version
        return f"{message}"


def translated_error(error: BaseException) -> str:
    """Return the sentence of an error in the display language."""
    return localized(sentence_of(error))


def _translated_template(template: str, language: Language) -> str | None:
    """Return the translation of a template, or of the templates that were joined to it."""
    if (whole := _looked_up(template, language)) is not None:
        return whole
    for cut in reversed([seam.start() for seam in _SEAM.finditer(template)]):
        last = _looked_up(template[cut:], language)
        if last is not None and (first := _translated_template(template[:cut], language)):
            return first + last
    return None if _WORD.search(_FIELD.sub("", template)) else template


_SEAM: Final = re.compile(r" \(|[,;:.] | completely| in \{")
"""Where a template may have been joined to another one."""
_FIELD: Final = re.compile(r"\{[^{}]*\}")
_WORD: Final = re.compile(r"[A-Za-z]")
"""What a template has outside of its fields, unless it is the same in every language."""


def _looked_up(text: str, language: Language) -> str | None:
    if not text:  # the key of the header of a catalogue
        return None
    translation = _catalogue(language).gettext(text)
    return None if translation == text else translation


def _translated_value(text: str, language: Language) -> str:
    """Return a value; a message or a phrase is translated, a name is not."""
    is_phrase = isinstance(text, UserMessage) or " " in text
    return translate(text, language) if is_phrase else text


class _TextFormatter(Formatter):
    """Formats values that are text already, as those of a message are."""

    def format_field(self, value: Any, format_spec: str) -> Any:
        """Format a value; a number is read from the text first."""
        if not format_spec:
            return value
        is_integer = format_spec[-1] in "dxX"
        return format(int(value) if is_integer else float(value), format_spec)


_FORMATTER: Final = _TextFormatter()


@cache
def _catalogue(language: Language) -> "NullTranslations":
    """Return the translations of all catalogues except that of click."""
    from gettext import GNUTranslations, NullTranslations  # noqa: PLC0415 - see above

    catalogue = NullTranslations()
    for file in (LOCALE / language.value / "LC_MESSAGES").glob("*.mo"):
        if file.stem != CLICK_DOMAIN:
            with file.open("rb") as stream:
                catalogue.add_fallback(GNUTranslations(stream))
    return catalogue

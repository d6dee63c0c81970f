"""User message: a sentence for the user, kept with its template and its named values.

The template identifies the message, as the source text does in gettext. So results can be compared
by template and values, and `translation` translates them when they are displayed. A constant
sentence is its own template and needs no `UserMessage`.
"""

from collections.abc import Iterable
from functools import reduce
from typing import Any, Self


class UserMessage(str):
    """A sentence made of a template and named values.

    Args:
        template: The sentence in English, with a replacement field ``{name}`` for each value.
        values: The values by name.

    Attributes:
        template: See above.
        values: The values by name, as they are shown; a value that is a message stays one.

    Raises:
        KeyError: The template names a value that is not given.
    """

    __slots__ = ("template", "values")

    template: str
    values: dict[str, str]

    def __new__(cls, template: str, /, **values: Any) -> Self:
        """Format the template."""
        shown = {name: _shown(value) for name, value in values.items()}
        return cls.of(template.format(**values), template, shown)

    @classmethod
    def of(cls, text: str, template: str, values: dict[str, str]) -> Self:
        """Return a message that was formatted before, such as one that was read from a file."""
        message = super().__new__(cls, text)
        message.template, message.values = template, values
        return message

    @classmethod
    def joined(cls, message: str, template: str, /, **values: Any) -> Self:
        """Return a message followed by a further template; it keeps the values of both.

        Args:
            message: The first part, a `UserMessage` or a constant sentence.
            template: The second part, with its leading space.
            values: The values of the second part; their names differ from those of the first.
        """
        suffix = UserMessage(template, **values)
        if isinstance(message, UserMessage):
            first_template, first_values = message.template, message.values
        else:
            first_template, first_values = message.replace("{", "{{").replace("}", "}}"), {}
        shown = first_values | suffix.values
        return cls.of(message + suffix, first_template + template, shown)

    @classmethod
    def word(cls, value: str) -> Self:
        """Return a value such as ``nothing-tested`` as a message; its words are the template."""
        return cls.of(value, value.replace("-", " "), {})

    @classmethod
    def listed(cls, words: Iterable[str], *, semicolons: bool = False) -> str:
        """Return words as a list with commas or semicolons; each word stays a message."""
        return reduce(_with_semicolon if semicolons else _with_comma, words, "")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the rendered text: a value that became text does not fit ``{value:.1f}``."""
        return self.of, (str(self), self.template, self.values)


def sentence_of(error: BaseException) -> str:
    """Return the message of an error, with its template if it has one."""
    sentence = error.args[0] if len(error.args) == 1 else None
    return sentence if isinstance(sentence, UserMessage) else f"{error}"


def _with_comma(words: str, word: str) -> str:
    return UserMessage("{words}, {word}", words=words, word=word) if words else word


def _with_semicolon(words: str, word: str) -> str:
    return UserMessage("{words}; {word}", words=words, word=word) if words else word


def _shown(value: object) -> str:
    if isinstance(value, BaseException):
        return sentence_of(value)
    return value if isinstance(value, UserMessage) else str(value)

"""User messages: templates with named values."""

import pickle

import pytest

from scaraspec.user_message import UserMessage


def test_a_message_keeps_template_and_values() -> None:
    """A message is the formatted sentence, with its template and values as attributes."""
    message = UserMessage("{name} took {time_s:.1f} s", name="jog", time_s=1.25)
    assert message == "jog took 1.2 s"
    assert message.template == "{name} took {time_s:.1f} s"
    assert message.values == {"name": "jog", "time_s": "1.25"}


def test_a_message_can_be_sent_to_another_process() -> None:
    """Text, template and values survive."""
    message = UserMessage("{time_s:.1f} s", time_s=1.25)
    copy = pickle.loads(pickle.dumps(message))
    assert (copy, copy.template, copy.values) == (message, message.template, message.values)


def test_a_joined_message_keeps_both_templates() -> None:
    """A message or a constant sentence, and a further template with its own values."""
    joined = UserMessage.joined(UserMessage("{time_s:.1f} s", time_s=1.25), " ({times})", times=3)
    assert joined == "1.2 s (3)"
    assert joined.template == "{time_s:.1f} s ({times})"
    assert joined.values == {"time_s": "1.25", "times": "3"}
    constant = UserMessage.joined("a {brace}", " ({times})", times=3)
    assert (constant, constant.template) == ("a {brace} (3)", "a {{brace}} ({times})")


def test_a_missing_value_is_an_error() -> None:
    """Each field of a template must have a value."""
    with pytest.raises(KeyError, match="name"):
        UserMessage("{name}")

"""User messages: templates with named values."""

import pickle

import pytest

from scaraspec.user_message import UserMessage


def test_a_message_keeps_template_and_values() -> None:
    """It is the formatted sentence, and knows what it was made of."""
    message = UserMessage("{name} took {time_s:.1f} s", name="jog", time_s=1.25)
    assert message == "jog took 1.2 s"
    assert message.template == "{name} took {time_s:.1f} s"
    assert message.values == {"name": "jog", "time_s": "1.25"}


def test_a_message_can_be_sent_to_another_process() -> None:
    """Text, template and values survive."""
    message = UserMessage("{time_s:.1f} s", time_s=1.25)
    copy = pickle.loads(pickle.dumps(message))
    assert (copy, copy.template, copy.values) == (message, message.template, message.values)


def test_a_missing_value_is_an_error() -> None:
    """A template that names a value must get it."""
    with pytest.raises(KeyError, match="name"):
        UserMessage("{name}")

"""Faults of clause 4.28: the jog's byte and its direction."""

from typing import Final

from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests

_JOG: Final = "jog"


@mutant("jog-in-two-digits", "4.28/1")
class JogInTwoDigits(AltersRequests):
    """The direction of a jog is sent in two digits."""

    name = _JOG

    def altered(self, data: bytes) -> bytes:
        """Fill it up."""
        return b"0" + data


@mutant("jog-in-words", "4.28/1")
class JogInWords(AltersRequests):
    """The direction of a jog is sent as sign and axis."""

    name = _JOG

    def altered(self, data: bytes) -> bytes:
        """Name it."""
        return (b"+y", b"-y", b"+x", b"-x")[int(data) - 1]


@mutant("later-jogs-say-more", "4.28/1", subtle=True)
class LaterJogsSayMore(AltersRequests):
    """From the second jog on a 0 follows the direction."""

    name = _JOG
    _count = 0

    def altered(self, data: bytes) -> bytes:
        """Count."""
        self._count += 1
        return data + b"0" if self._count > 1 else data


@mutant("jog-counts-from-zero", "4.28/2")
class JogCountsFromZero(AltersRequests):
    """Directions are counted from 0."""

    name = _JOG

    def altered(self, data: bytes) -> bytes:
        """Count so."""
        return b"%d" % (int(data) - 1)


@mutant("jog-in-letters", "4.28/2")
class JogInLetters(AltersRequests):
    """Directions are told by the letters a to d."""

    name = _JOG

    def altered(self, data: bytes) -> bytes:
        """Choose one."""
        return b"abcd"[int(data) - 1 : int(data)]


@mutant("jog-in-two-forms", "4.28/2", subtle=True)
class JogInTwoForms(AltersRequests):
    """Directions are sent as digits four times, and as numbers from then on."""

    name = _JOG
    _count = 0

    def altered(self, data: bytes) -> bytes:
        """Change over."""
        self._count += 1
        return bytes([int(data)]) if self._count > 4 else data


@mutant("jog-begins-with-x", "4.28/3")
class JogBeginsWithX(AltersRequests):
    """Directions are counted from +X, as is usual."""

    name = _JOG

    def altered(self, data: bytes) -> bytes:
        """Count so."""
        return data.translate(bytes.maketrans(b"1234", b"3412"))


@mutant("jog-mixes-up-signs", "4.28/3")
class JogMixesUpSigns(AltersRequests):
    """The negative direction comes first."""

    name = _JOG

    def altered(self, data: bytes) -> bytes:
        """Count so."""
        return data.translate(bytes.maketrans(b"1234", b"2143"))


@mutant("second-jog-turns-back", "4.28/3", subtle=True)
class SecondJogTurnsBack(AltersRequests):
    """The second jog in the same direction goes the other way."""

    name = _JOG
    _before = b""

    def altered(self, data: bytes) -> bytes:
        """Turn back."""
        if data == self._before:
            self._before = b""
            return data.translate(bytes.maketrans(b"1234", b"2143"))
        self._before = data
        return data

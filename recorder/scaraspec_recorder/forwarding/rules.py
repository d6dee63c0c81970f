"""Rules: how Linux leads clients to a recorder that they know nothing of.

Lives here: the nftables rules of each mode as text, what installs and removes them, and how the
mode fails while no recorder runs. Nothing is executed here; what takes the clients stands in
`routes`.

A rule that leads aside asks for the first packet of a connection (SYN without ACK), not merely for
one that connection tracking calls new: tracking may begin with these very rules, and would then
call live sessions new.
"""

import ipaddress
from dataclasses import dataclass
from textwrap import wrap
from typing import Final

from scaraspec_recorder.forwarding import tcp
from scaraspec_recorder.forwarding.routes import GUARD_MARK, Mode

_FIRST: Final = "tcp flags & (syn | ack) == syn"

_PURPOSES: Final = {
    Mode.EXPLICIT: "No rules are needed: clients connect to {listen}, and the recorder to "
    "{controller}. The controller sees the recorder's address.",
    Mode.REDIRECT: "Leads clients of {controller} to the recorder on {listen}: {clients}. "
    "The controller sees the recorder's address.",
    Mode.TPROXY: "Leads clients of {controller} to the recorder on {listen}: those whose packets "
    "this machine forwards, both ways. The controller sees the client's own address.",
}
_FAILURES: Final = {
    Mode.EXPLICIT: "it fails closed: clients are refused.",
    Mode.REDIRECT: "it fails closed: clients are refused until the rules are removed.",
    Mode.TPROXY: "it fails open: clients pass straight through, unrecorded, where this machine "
    "forwards packets (net.ipv4.ip_forward=1), and stay unrecorded until they connect anew.",
}
_WIDTH: Final = 78


@dataclass(frozen=True, slots=True)
class Rules:
    """The rules of one recorder; several may stand beside each other.

    Args:
        mode: How clients come to it.
        listen: Where it listens: address and port.
        controller: Where clients connect, or believe to: address and port.

    Raises:
        ValueError: The mode cannot work with these; the text is a sentence for the user.
    """

    mode: Mode
    listen: tuple[str, int]
    controller: tuple[str, int]

    def __post_init__(self) -> None:
        if self.mode is Mode.EXPLICIT:
            return
        for host, _ in (self.listen, self.controller):
            try:
                ipaddress.IPv4Address(host)
            except ValueError:
                raise ValueError(
                    f"the mode {self.mode} needs IPv4 addresses, and {host!r} is none"
                ) from None
        if self.mode is Mode.TPROXY and not self._listens_inside:
            raise ValueError(
                "the mode tproxy needs no address that others can reach: listen on 127.0.0.1"
            )

    @property
    def nft(self) -> str:
        """A script for ``nft -f``; to load it again replaces the rules. Empty in explicit mode."""
        if self.mode is Mode.EXPLICIT:
            return ""
        chains = self._redirect() if self.mode is Mode.REDIRECT else self._tproxy()
        table = f"table ip {self._table}"
        return f"{table}\ndelete {table}\n{table} {{\n{chains}}}\n"

    @property
    def install(self) -> tuple[str, ...]:
        """Commands for a shell that put the rules in force; FILE stands for the script's name."""
        load = ("nft -f FILE",) if self.nft else ()
        return (*self._routing("add"), *load)

    @property
    def remove(self) -> tuple[str, ...]:
        """Commands for a shell that undo `install`."""
        drop = (f"nft delete table ip {self._table}",) if self.nft else ()
        return (*drop, *self._routing("del"))

    @property
    def failure(self) -> str:
        """What clients meet while no recorder runs."""
        return _FAILURES[self.mode]

    def __str__(self) -> str:
        """The script, and all else as its comment: ``nft -f`` loads it as it stands."""
        everybody = "those whose packets this machine forwards, and its own"
        purpose = _PURPOSES[self.mode].format(
            listen=tcp.address_text(self.listen),
            controller=tcp.address_text(self.controller),
            clients="this machine's own" if self._listens_inside else everybody,
        )
        lines = [*wrap(purpose, _WIDTH), ""]
        if self.install:
            lines += ["Install, as root, where FILE holds this text:"]
            lines += [f"  {command}" for command in self.install]
            lines += ["Sessions that live by then are left alone, and unrecorded.", ""]
            lines += ["Remove, once no client is connected, for its session would break:"]
            lines += [f"  {command}" for command in self.remove] + [""]
        lines += wrap(f"While no recorder runs, {self.failure}", _WIDTH)
        return "".join(f"# {line}".rstrip() + "\n" for line in lines) + self.nft

    @property
    def _listens_inside(self) -> bool:
        return self.listen[0].startswith("127.")

    @property
    def _table(self) -> str:
        return f"scaraspec_{self.listen[1]}"

    @property
    def _mark(self) -> str:
        """Marks the packets that are for this recorder, and names the table that routes them."""
        return hex(GUARD_MARK | self.listen[1])

    def _routing(self, verb: str) -> tuple[str, ...]:
        if self.mode is not Mode.TPROXY:
            return ()
        return (
            f"ip rule {verb} fwmark {self._mark} lookup {self._mark}",
            f"ip route {verb} local 0.0.0.0/0 dev lo table {self._mark}",
        )

    def _redirect(self) -> str:
        host, port = self.controller
        lead = f"ip daddr {host} tcp dport {port} {_FIRST} redirect to :{self.listen[1]}"
        forwarded = _chain("nat", "prerouting", -100, lead)
        own = _chain("nat", "output", -100, f"meta mark != {hex(GUARD_MARK)} {lead}")
        return own if self._listens_inside else forwarded + own

    def _tproxy(self) -> str:
        host, port = self.controller
        mark = f"meta mark set {self._mark}"
        return _chain(
            "filter",
            "prerouting",
            -150,
            f"ip daddr {host} tcp dport {port} {_FIRST} "
            f"tproxy to {tcp.address_text(self.listen)} {mark} accept",
            f"ip daddr {host} tcp dport {port} socket transparent 1 {mark}",
            f"ip saddr {host} tcp sport {port} socket transparent 1 {mark}",
        )


def text(mode: Mode, listen: tuple[str, int], controller: tuple[str, int]) -> str:
    """Return the rules of a recorder as a commented script; see `Rules`.

    Raises:
        ValueError: See `Rules`.
    """
    return str(Rules(mode, listen, controller))


def _chain(kind: str, hook: str, priority: int, *statements: str) -> str:
    # nft 1.0.6 wants each statement ended before a closing brace
    body = "".join(f"    {statement};\n" for statement in statements)
    return f"  chain {hook} {{\n    type {kind} hook {hook} priority {priority};\n{body}  }}\n"

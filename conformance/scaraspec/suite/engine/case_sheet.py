"""Case sheet: what the test specification states about a case. Nothing is run for it.

Everything is derived: from the decorator, the docstring and the checks of the case, from the
requirements that it judges, and from a run that passed (`recorded_runs.json`, made by
`mutants.recorded_runs`).
"""

import ast
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.collection import CASES, cases_in
from scaraspec.suite.engine.hooks import HOOKS
from scaraspec.suite.engine.plan import Options, is_selected
from scaraspec.user_message import UserMessage

RECORDED_RUNS: Final = Path(__file__).with_name("recorded_runs.json")

_ROOT: Final = Path(__file__).parents[3]
_CHECK: Final = "expect"
"""The beginning of the names of functions that report a failure."""
_KINDS: Final = {
    "examples": "listed: {values}",
    "given": "drawn: {values}",
    "example": "always tried: {values}",
}
"""Functions that receive the values of a case."""
_HOUR_S: Final = 3600
_MAX_EXPRESSION: Final = 200


@dataclass(frozen=True, slots=True)
class Duration:
    """How long a case lasted in a run that passed, on the simulated clock.

    The messages take no time there: on a real link each step adds the reply time of the subject.

    Attributes:
        waits_s: The time that the case waits, in seconds.
        steps: The number of steps.
    """

    waits_s: float
    steps: int

    @property
    def sentence(self) -> str:
        """The duration in words."""
        steps = UserMessage("1 step" if self.steps == 1 else "{count} steps", count=self.steps)
        if not self.waits_s:
            return steps
        hours = self.waits_s / _HOUR_S
        return UserMessage(
            "{waits} and {steps}",
            waits=f"{hours:.3g} h" if hours > 1 else f"{self.waits_s:g} s",
            steps=steps,
        )


@dataclass(frozen=True, slots=True)
class CaseSheet:
    """What the test specification states about a case.

    Attributes:
        case: The case.
        location: File and line of the function.
        preconditions: What the run, the ICS and the subject must provide; a sentence each.
        values: The values that the case tries: its parameters, and what it lists or draws, as
            expressions of Python.
        examples: How many values the recorded run tried; 0 for a single try.
        criteria: What fails the case besides a violation of its requirements.
        steps: The requests and final results of the recorded run, in order.
        duration: The duration of the recorded run.
    """

    case: Case
    location: str
    preconditions: tuple[str, ...]
    values: tuple[str, ...]
    examples: int
    criteria: tuple[str, ...]
    steps: str
    duration: Duration


def case_sheets(role: Role, options: Options | None = None) -> list[CaseSheet]:
    """Return the sheets of the cases that the options select, in the order of execution.

    Args:
        role: The role of the subject.
        options: Their selection; None for all cases.

    Raises:
        SuiteError: The suite is defective.
    """
    chosen = options or Options()
    recorded = _recorded_runs()[role.value]
    return [
        _sheet(case, file, recorded[case.id])
        for case, file in cases_in(CASES[role], role)
        if is_selected(case, chosen)
    ]


def operator_requests(cases: Iterable[Case]) -> int:
    """Return how many requests these cases make to an operator, in a run that passes."""
    recorded = _recorded_runs()
    return sum(recorded[case.role.value][case.id].get("asked", 0) for case in cases)


@cache
def _recorded_runs() -> Mapping[str, Mapping[str, Any]]:
    runs: Mapping[str, Mapping[str, Any]] = json.loads(RECORDED_RUNS.read_text("utf-8"))
    return runs


def _sheet(case: Case, file: Path, recorded: Mapping[str, Any]) -> CaseSheet:
    source = _source(file)
    own = [*_reached(case.function, source)]
    return CaseSheet(
        case=case,
        location=f"{file.name}:{source.functions[case.function].lineno}",
        preconditions=(*_preconditions(case), *_skips(own)),
        values=tuple(
            dict.fromkeys([*filter(None, [case.parameters]), *_values(own, source.constants)])
        ),
        examples=recorded["examples"],
        criteria=tuple(dict.fromkeys(_criteria(own))),
        steps=recorded["steps"],
        duration=Duration(recorded["waits_s"], recorded["count"]),
    )


def _preconditions(case: Case) -> Iterator[str]:
    if named := ",".join(h.value for h in Hazard if h in case.hazards - {Hazard.READ_ONLY}):
        yield f"--allow {named}"
    if case.undefined:
        yield "--undefined-opcodes: it sends undefined opcodes"
    if case.slow:
        yield "--exhaustive, or --only: it is slow, and other cases judge its requirements, too"
    for hook in case.needs:
        yield UserMessage("the hook {hook} of the ICS: it {effect}", hook=hook, effect=HOOKS[hook])
    if case.last:
        yield "it runs after all other cases, because the subject may be off afterwards"
    elif case.turn:
        yield "it runs after the cases of other clauses, because it may crash the subject"
    if case.attended:
        replaced = UserMessage("a driver")
        if case.role is Role.CONTROLLER:
            replaced = UserMessage("a hook, with --attended")
        yield UserMessage("an operator can take the place of {replaced}", replaced=replaced)


# ---------------------------------------------------------------------- what the source contains


class _Source(NamedTuple):
    """The functions, the constants and the imported checks of a file of the suite, by name."""

    functions: Mapping[str, ast.FunctionDef]
    constants: Mapping[str, ast.expr]
    checks: Mapping[str, Path]


@cache
def _source(file: Path) -> _Source:
    body = ast.parse(file.read_text("utf-8")).body
    functions = {node.name: node for node in body if isinstance(node, ast.FunctionDef)}
    checks = {
        alias.name: _ROOT.joinpath(*node.module.split(".")).with_suffix(".py")
        for node in body
        if isinstance(node, ast.ImportFrom) and node.module and ".harness." in node.module
        for alias in node.names
        if alias.name.startswith(_CHECK)
    }
    return _Source(functions, dict(_assigned(body)), checks)


def _assigned(nodes: Iterable[ast.AST]) -> Iterator[tuple[str, ast.expr]]:
    for node in nodes:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            yield node.targets[0].id, node.value


@cache
def _nodes(function: ast.FunctionDef) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(function))


def _reached(name: str, source: _Source) -> Iterator[ast.FunctionDef]:
    """Yield a function, those of the same file that it uses, and shared checks, each once."""
    waiting, reached = [(name, source)], {name}
    while waiting:
        name, source = waiting.pop(0)
        function = source.functions[name]
        yield function
        for node in _nodes(function):
            if not isinstance(node, ast.Name) or node.id in reached:
                continue
            if node.id in source.functions:
                waiting.append((node.id, source))
            elif node.id in source.checks:
                waiting.append((node.id, _source(source.checks[node.id])))
            else:
                continue
            reached.add(node.id)


def _calls(functions: Iterable[ast.FunctionDef]) -> Iterator[tuple[str, ast.Call]]:
    for function in functions:
        for node in _nodes(function):
            if isinstance(node, ast.Call):
                match node.func:
                    case ast.Name(id=name) | ast.Attribute(attr=name):
                        yield name, node


def _criteria(functions: Iterable[ast.FunctionDef]) -> Iterator[str]:
    for name, call in _calls(functions):
        if not (name.startswith(_CHECK) or name == "CaseFailed"):
            continue
        texts = [text for text in map(_text, call.args) if text.count(" ") > 1]
        expected = next((_text(k.value) for k in call.keywords if k.arg == "expected"), "")
        if name == "expect_equal" and isinstance(call.args[1], ast.Constant):
            expected = ast.unparse(call.args[1])
        if texts:
            yield _with_expected(texts[-1], expected) if expected else texts[-1]


def _with_expected(message: str, expected: str) -> UserMessage:
    word = expected if "{" in expected else UserMessage.of(expected, expected, {})
    return UserMessage("{message} (expected: {expected})", message=message, expected=word)


def _skips(functions: Iterable[ast.FunctionDef]) -> Iterator[str]:
    for name, call in _calls(functions):
        if name == "CaseSkipped" and call.args and (message := _text(call.args[0])):
            yield UserMessage("it is skipped if: {message}", message=message)
        elif name == "patient":
            yield "--patience, if it waits longer; otherwise it is skipped"


def _values(
    functions: Iterable[ast.FunctionDef], constants: Mapping[str, ast.expr]
) -> Iterator[str]:
    for function in functions:
        known = {**constants, **dict(_assigned(_nodes(function)))}
        for name, call in _calls([function]):
            if kind := _KINDS.get(name):
                given = [*call.args, *(keyword.value for keyword in call.keywords)]
                yield UserMessage(kind, values=", ".join(_expression(e, known) for e in given))


def _text(node: ast.expr) -> str:
    """Return the text of a message; values that are known only in a run are in braces."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(_text(part) for part in parts)
        case ast.FormattedValue(value=value):
            return f"{{{ast.unparse(value)}}}"
        case ast.Call(func=ast.Name(id="UserMessage"), args=[template, *_]):
            return _text(template)
    return ""


def _expression(node: ast.expr, known: Mapping[str, ast.expr]) -> str:
    """Return an expression as Python; a name by the value that was assigned to it."""
    if isinstance(node, ast.Name):
        node = known.get(node.id, node)
    text = ast.unparse(node)
    return text if len(text) <= _MAX_EXPRESSION else f"{text[:_MAX_EXPRESSION]}…"

"""Mutants of clauses 4.15 and 4.16: programs that are run or simulated."""

from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.messages import (
    request_after,
    request_data,
    request_frame,
    request_over_last,
)
from scaraspec.protocol.commands import BY_NAME

row(
    "runs-without-extension",
    "4.15/1",
    "The name of the program to run is sent without its extension.",
    request_data("run_program", lambda data: data.rpartition(b".")[0] or data),
)
row(
    "runs-padded-names",
    "4.15/1",
    "The name of the program to run is padded with spaces to 30 bytes.",
    request_data("run_program", lambda data: data.ljust(30)),
)
row(
    "runs-short-names",
    "4.15/1",
    "The name of the program to run is cut to 16 bytes.",
    request_data("run_program", lambda data: data[:16]),
    subtle=True,
)
row(
    "runs-with-the-rest-of-longer-names",
    "4.15/1",
    "The name of the program to run, if shorter than the previous one, ends like that one.",
    request_over_last("run_program"),
    subtle=True,
)
row(
    "runs-up-to-the-first-blank",
    "4.15/1",
    "The name of the program to run is cut at its first space.",
    request_data("run_program", lambda data: data.partition(b" ")[0]),
    subtle=True,
)
row(
    "runs-instead-of-simulating",
    "4.16/1",
    "A simulation is requested as a run.",
    request_frame(
        "simulate_program", lambda frame: frame._replace(opcode=BY_NAME["run_program"].opcode)
    ),
)
row(
    "simulation-is-marked",
    "4.16/1",
    "The name of the program to simulate is sent with a second field.",
    request_data("simulate_program", lambda data: data + b"|1"),
)
row(
    "simulates-what-ran-last",
    "4.16/1",
    "A simulation is requested for the program that was run last.",
    request_after("simulate_program", "run_program", lambda data, last: last or data),
    subtle=True,
)

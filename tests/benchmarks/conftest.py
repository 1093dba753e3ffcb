"""Prints what the kernels cost per vertex and candidate, and in units of the yardstick, below the benchmarks."""

import pytest

KEY = "ns_per_vertex_and_candidate"


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    session = getattr(config, "_benchmarksession", None)
    costs = {
        bench.name: bench.extra_info[KEY] for bench in getattr(session, "benchmarks", ()) if KEY in bench.extra_info
    }
    if not costs:
        return
    yardstick = costs.get("test_yardstick", float("nan"))
    terminalreporter.write_sep("-", "kernels: minimum, ns per vertex and candidate, ratio to the yardstick")
    for name, cost in costs.items():
        terminalreporter.write_line(f"{name.removeprefix('test_'):<44} {cost:7.2f} ns {cost / yardstick:6.2f}")

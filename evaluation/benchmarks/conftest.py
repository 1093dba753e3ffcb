"""Prints one table of everything that was measured, and adds it to what `--benchmark-json` writes."""

from collections.abc import Iterator
from typing import Any

import pytest

#: Where a benchmark leaves rows of its own: {part: {threads: ns per vertex and candidate}}.
KEY = "kernels"

#: Likewise whole frames: {threads: {part: {ms, cpu_ms, search_share}}}.
FRAMES = "frames"

Row = dict[str, str | float]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    session = getattr(config, "_benchmarksession", None)
    rows = list(_rows(getattr(session, "benchmarks", ())))
    if not rows or not session or session.disabled:
        return
    terminalreporter.write_sep("-", "minima; ns per vertex and candidate, ratio to the C++ yardstick")
    heads = ("part", "ms", "CPU ms", "search share", "1 thread, ns", "ratio", "2 threads, ns", "ratio")
    terminalreporter.write_line(f"{heads[0]:<58}" + "".join(f"{head:>15}" for head in heads[1:]))
    for row in rows:
        cells = [row.get(key) for key in ("ms", "cpu_ms", "search_share", "ns_1", "ratio_1", "ns_2", "ratio_2")]
        line = f"{row['part']:<58}" + "".join(f"{'' if cell is None else f'{cell:.3g}':>15}" for cell in cells)
        terminalreporter.write_line(line.rstrip())


def pytest_benchmark_update_json(config: pytest.Config, benchmarks: list[Any], output_json: dict[str, Any]) -> None:
    output_json["table"] = list(_rows(benchmarks))


def _rows(benchmarks: Any) -> Iterator[Row]:
    """A row for each kernel, with the time of both numbers of threads, and one for each other benchmark."""
    for bench in benchmarks:
        kernels = bench.extra_info.get(KEY, {})
        for part, times in kernels.items():
            row: Row = {"part": part}
            for threads, ns in times.items():
                row |= {f"ns_{threads}": ns, f"ratio_{threads}": ns / kernels["yardstick"][threads]}
            yield row
        frames = bench.extra_info.get(FRAMES, {})
        for threads, parts in frames.items():
            yield from ({"part": f"{part}, {threads} thr."} | measured for part, measured in parts.items())
        if not (kernels or frames):
            yield {"part": bench.name.removeprefix("test_"), "ms": 1e3 * bench.stats.min}

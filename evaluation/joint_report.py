"""One report of several experiments: all goals in one place, and the evidence of each under its name."""

from collections.abc import Mapping

from abs_service.report.content import Level, Report, Section, Verdict
from abs_service.report.provenance import Provenance
from evaluation.experiment import GOALS


def joined(made: Mapping[str, Report], missing: Mapping[str, str], provenance: Provenance) -> Report:
    """Reports of several experiments as one.

    Args:
        made: reports by name, in the order in which they are shown; at least one.
        missing: experiments that could not run here, and why.
        provenance: command, date and version.
    """
    verdicts = (
        Verdict(one.level, one.text, one.advice, f"{name}:") for name, report in made.items() for one in report.verdicts
    )
    open_ones = (Verdict(Level.DOUBTFUL, why, about=f"{name}:") for name, why in missing.items())
    sections = (
        Section(f"{name}: {section.title}", section.blocks)
        for name, report in made.items()
        for section in report.sections
    )
    pages = tuple(f"{name}: {report.title} ({name}/report.html)" for name, report in made.items())
    return Report(
        title=f"Evaluation: {', '.join((*made, *missing))}",
        provenance=provenance,
        verdicts=(*verdicts, *open_ones),
        sections=(Section("Experiments", pages), *sections),
        values={name: report.values for name, report in made.items()},
        wording=GOALS,
        exit_code=max(report.exit_code or 0 for report in made.values()),
    )

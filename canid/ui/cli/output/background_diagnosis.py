"""--diagnose: what a diagnosis of the drive so far says, in the view; and that of the whole drive, as a page at the end."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from canid.io.recording.controls import Controls
from canid.ui.cli.options import report_option
from canid.ui.cli.output import complete_files, output_kinds
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info
from canid.values.types import DIAGNOSIS, Event

if TYPE_CHECKING:
    from pathlib import Path

    from canid.analysis.session.diagnosis_process import Diagnosing, DriveSoFar
    from canid.signals.vehicle import Vehicle
    from canid.values.findings import Provenance

# s that a session on a bus waits for the diagnosis of the whole drive, after the recording is complete
SESSION_PATIENCE_S = 20.0


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    report_option.add(
        parser,
        "diagnose the drive so far every two minutes, or with key d, in a process of lowest priority, and write the "
        "diagnosis at the end as a page",
        ("--diagnose",),
        "LOG.diagnosis.html",
    )


def output(args: argparse.Namespace, verb: str, log: str | None) -> Output | None:
    """The page of --diagnose; None: not asked for. Raises ConfigError where its name is not that of a page."""
    if args.diagnose is None:
        return None
    name = report_option.page_name(verb, args.diagnose, log, "diagnosis", "--diagnose", stem=verb)
    return Output("--diagnose", name, output_kinds.PAGE)


class BackgroundDiagnosis:
    """What a session or a replay does with --diagnose; without it all of this does nothing."""

    def __init__(self, page: Output | None, process: Diagnosing | None, controls: Controls) -> None:
        """See `running`."""
        self._page, self._process, self._controls = page, process, controls
        self._failure_said = False

    def put(self, item: object) -> None:
        """Take an output of the pipeline."""
        if self._process is not None:
            self._process.put(item)

    def events(self) -> Iterator[Event]:
        """What is new: the first sentence of a diagnosis, or that there will be none; asks for one where a person did."""
        asked = self._controls.take_diagnose()
        if self._process is None:
            return
        if asked:
            self._process.ask()
        for diagnosed in self._process.diagnoses():
            yield Event(diagnosed.t, DIAGNOSIS, sentence(diagnosed))
        if self._process.failure and not self._failure_said:
            self._failure_said = True
            yield Event(
                math.nan,
                "diagnosis_ended",
                f"no further diagnosis of the drive so far: {self._process.failure}",
            )

    def finish(
        self,
        provenance: Callable[[], Provenance],
        show: Callable[[str], None],
        patience_s: float = math.inf,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Show the answer for the whole drive and write the page; where time runs out, of the drive up to the last one.

        Args:
            provenance: of the page.
            show: prints a line.
            patience_s: s.
            stopped: a person does not want to wait.

        Raises:
            OutputError: the page cannot be written.
        """
        process, page = self._process, self._page
        if process is None or page is None:
            return
        if not process.is_whole():
            info("the whole drive is diagnosed")
            process.finish(patience_s, stopped)
        latest, whole = process.latest(), process.is_whole() and not process.failure
        process.close()
        if latest is None:
            why = process.failure or (
                "there was nothing to diagnose" if whole else "there was not enough time"
            )
            info(f"{page.path} is not written: {why}; see `canid diagnose`")
            return
        from canid.ui.views.diagnosis_report import diagnosis_answer
        from canid.ui.views.diagnosis_report.diagnosis_document import page as document

        report = latest.report
        if not whole:
            info(f"diagnosed are the first {latest.t / 60:.0f} min; `canid diagnose` takes the whole log")
        report = report._replace(provenance=provenance())
        for line in diagnosis_answer.summary(report):
            show(line)
        complete_files.write(page, partial(document, report))
        info(f"{page.path} written")


@contextmanager
def running(
    page: Output | None, vehicle: Vehicle | str | Path | None, controls: Controls
) -> Iterator[BackgroundDiagnosis]:
    """A diagnosis in the background where `page` is asked for; its process ends with the context."""
    if page is None or vehicle is None:
        yield BackgroundDiagnosis(None, None, controls)
        return
    from canid.analysis.session.diagnosis_process import Diagnosing
    from canid.signals.vehicle import Vehicle

    process = Diagnosing(vehicle.driver if isinstance(vehicle, Vehicle) else vehicle)
    try:
        yield BackgroundDiagnosis(page, process, controls)
    finally:
        process.close()


def sentence(diagnosed: DriveSoFar) -> str:
    """The first sentence of a diagnosis, what it rests on, and how much longer the next cause takes to be decided."""
    from canid.ui.views.diagnosis_report import diagnosis_answer
    from canid.values.findings import used_time

    first = diagnosis_answer.answer(diagnosed.report)[0]
    more = diagnosis_answer.more_minutes(diagnosed.report)
    minutes = used_time(diagnosed.report) / 60
    return " ".join(filter(None, [f"diagnosis of the drive so far ({minutes:.0f} min used): {first}", more]))

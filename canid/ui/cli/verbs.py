"""The verbs of the command line, in the order of `canid --help`.

A new verb is a module canid.ui.cli.commands.NAME with `arguments(parser)`, `run(args) -> exit code` and, where it writes
JSON, `results()` -> {name of the schema: type}, and a line here. `python docs/reference_of_commands.py` then writes its row
of the README, its part of docs/commands.md and of the man page, and its keys in docs/json.md.
"""

from __future__ import annotations

from canid.ui.cli.verb import Shown, Verb

VERBS = (
    Verb(
        "demo",
        "try canid without hardware: a simulated drive with known parameters on a virtual bus",
        (Shown("canid demo", "try it without hardware"),),
    ),
    Verb(
        "live",
        "record a bus and estimate the driver's parameters live; listens only",
        (
            Shown(
                "canid live -i socketcan -c can0 --vehicle generic --record drive.blf --web",
                "record, estimate, display; in the terminal, on a [page](docs/web.md)",
            ),
        ),
    ),
    Verb(
        "record",
        "record a bus without loss; listens only",
        (
            Shown(
                "canid record -i pcan -c PCAN_USBBUS1 -b 500000 -o drive.blf",
                "record without loss; [triggers](docs/triggers.md), rotation",
            ),
        ),
    ),
    Verb(
        "replay",
        "show a recorded log in the live view, or send it to a virtual bus",
        (
            Shown("canid replay demo_out/demo.blf --vehicle generic", "the live view of a log"),
            Shown("canid replay demo_out/demo.blf --onto -i socketcan -c vcan0", "a log onto a virtual bus"),
        ),
    ),
    Verb(
        "identify",
        "estimate the driver's parameters from logs, as text and JSON",
        (
            Shown(
                "canid identify demo_out/demo.blf --vehicle generic --json drive.json --report drive.html",
                "K, τ, θ of a drive",
            ),
        ),
    ),
    Verb(
        "diagnose",
        "find what the simulation gets wrong and why, and how much a better model gains",
        (
            Shown(
                "canid diagnose demo_out/hidden_recorded.blf --vehicle generic --report --json report.json",
                "what the simulation gets wrong, and why",
            ),
        ),
    ),
    Verb(
        "compare",
        "compare two drivers: which parameters and causes differ, by how much, beyond chance or not",
        (
            Shown(
                "canid compare demo_out/demo.blf following_mixed.blf --vehicle generic",
                "do two drivers differ ([how](docs/compare.md))",
            ),
        ),
    ),
    Verb(
        "fleet",
        "analyse many drives of many drivers, on all cores or on Dask",
        (
            Shown(
                "canid fleet demo_out -o fleet_out --vehicle generic",
                "many drives of many drivers, on all cores or on Dask, into Parquet ([how](docs/fleet.md))",
            ),
        ),
        {
            "causes": "diagnose the drives of each driver, and of each car, together",
            "query": "ask the tables of a fleet in SQL, or one of the ready questions",
            "report": "write one page on a fleet: drivers side by side, causes, worst data, what to drive next",
            "prior": "write what a fleet teaches on a new driver as [fopdt.prior]",
            "export": "write the drivers of a fleet as vehicle types of a traffic simulator",
        },
    ),
    Verb(
        "study",
        "check both papers behind canid, and repeat their analysis on logs next to canid's",
        (Shown("canid study prints grover", "the papers behind canid, recomputed"),),
    ),
    Verb(
        "simulate",
        "write a log of a simulated drive with known parameters",
        (
            Shown(
                "canid simulate drive7.blf --seed 7 --minutes 1 --profile motorway --noise resonant",
                "a log with known truth",
            ),
            Shown(
                "canid simulate again.blf --model report.json --lead following_mixed.blf",
                "the identified driver behind another lead",
            ),
        ),
    ),
    Verb(
        "look",
        "show what a log contains: ids, rates, changing bits; with DBC files their signals over time",
        (
            Shown(
                "canid look demo_out/demo.blf --dbc generic.dbc",
                "what a log contains, without a vehicle file ([look](docs/look.md))",
            ),
        ),
    ),
    Verb(
        "decode",
        "decode the frames of a log or a bus by DBC files: a line for each frame, or CSV",
        (
            Shown(
                "canid decode demo_out/demo.blf --dbc generic.dbc --stop 1",
                "message, signals and units of each frame, from a log or, with `-i` and `-c`, from a bus",
            ),
        ),
    ),
    Verb(
        "check",
        "check that a vehicle file fits a log or bus, and list what is missing",
        (
            Shown(
                "canid check demo_out/demo.blf --vehicle generic",
                "does the vehicle file fit, and what is missing",
            ),
        ),
    ),
    Verb(
        "init",
        "propose a vehicle file from DBC files and a log",
        (Shown("canid init generic.dbc -o mine.toml --force", "propose a vehicle file"),),
    ),
    Verb(
        "recover",
        "write a clean copy of a damaged log, and report what is missing in it",
        (Shown("canid recover demo_out/demo.blf -o recovered.blf", "a clean copy of a damaged log"),),
    ),
    Verb(
        "export",
        "write samples, estimates and signals as CSV, Parquet, .mat, .mf4, .mcap, .vbo or for PlotJuggler",
        (
            Shown(
                "canid export demo_out/demo.blf --vehicle generic --to csv -o drive --force",
                "tables for other programs",
            ),
        ),
    ),
    Verb(
        "schema",
        "print the JSON Schema of what a verb writes with --json",
        (Shown("canid schema identify", "the [JSON](docs/json.md) Schema of what a verb writes"),),
    ),
)

"""Plan of a test: sensors, exciters, frequency lines."""

from __future__ import annotations

import click

from femtune.steps.step import EIGENSOLVER, FILE, FRESH, JSON, Command, Page, ReportSection, Step, given_words

STEP = Step(
    "plan",
    tables=("plan",),
    command=Command(
        group="Test",
        help=(
            "Plan a test: sensors for target modes of the model.\n\n"
            "PATH is a study file (.toml) or a Nastran deck; no test is needed. Options replace keys of "
            "[plan] in the study."
        ),
        params=(
            click.Argument(["path"], type=FILE),
            click.Option(["--modes"], metavar="LIST", help='Numbers of the target modes: "7 THRU 20".'),
            click.Option(
                ["--band", "band_hz"], type=(float, float), metavar="LOW HIGH", help="Target modes of this band, Hz."
            ),
            click.Option(["--triaxial"], type=int, help="Number of triaxial sensors to place."),
            click.Option(["--uniaxial"], type=int, help="Number of uniaxial sensors to place."),
            click.Option(["--visualisation"], type=int, help="Number of further sensors that complete the picture."),
            click.Option(
                ["--aim"], metavar="WORD", help="modes, or parameters: sensors that determine the parameters best."
            ),
            click.Option(["--data"], metavar="WORD", help="What the calibration compares: modes, or frfs."),
            click.Option(["--exciters"], type=int, help="Number of exciters to place."),
            click.Option(
                ["--placed"], multiple=True, metavar="SENSOR", help="Given sensor: 101, or 101Z+; repeatable."
            ),
            click.Option(["--nodes"], metavar="LIST", help='Grid points that are candidates: "101 THRU 300".'),
            click.Option(["--exclude"], metavar="LIST", help="Grid points to exclude."),
            click.Option(["--method"], metavar="NAME", help="expansion or elimination."),
            click.Option(
                ["--configuration"], metavar="NAME", help="Configuration to be tested, if the study has several."
            ),
            click.Option(
                ["--uff"], type=FILE, metavar="FILE", help="Write points, axes and trace lines (Universal File, 2411)."
            ),
            click.Option(["--csv"], type=FILE, metavar="FILE", help="Write a table of the sensors."),
            click.Option(
                ["--lines"], type=FILE, metavar="FILE", help="Write the lines for an identification, in Hz, one a row."
            ),
            click.Option(
                ["--units"], metavar="m-kg-s", help="Units, if a deck is given instead of a study; for --uff."
            ),
            click.Option(
                ["--report", "page"],
                type=FILE,
                metavar="PAGE",
                help="Write an HTML page with a picture of the sensors.",
            ),
            EIGENSOLVER,
            FRESH,
            JSON,
        ),
        asked=given_words,
        document="plan.page:plan_document",
    ),
    page=Page(
        record="plan",
        genre="Test plan",
        verdict="plan.page:plan_verdict",
        sections=(
            ReportSection("plan_summary", "Test plan", "plan.page:plan_summary"),
            ReportSection(
                "plan_sensors",
                "Sensors",
                "plan.page:plan_sensors",
                intro=(
                    "Grey lines connect neighbouring measured points along the structure: they are the trace "
                    "lines of the test. A hollow mark is on a surface that is turned away from the viewer. "
                    "Positions and directions are in the basic coordinate system."
                ),
            ),
            ReportSection("plan_modes", "Target modes", "plan.page:plan_modes"),
            ReportSection(
                "plan_parameters", "Expected standard deviations of the parameters", "plan.page:plan_parameters"
            ),
            ReportSection("plan_setup", "Frequency lines, masses of the sensors, suspension", "plan.page:plan_setup"),
            ReportSection("plan_method", "Method", "plan.page:plan_method"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)

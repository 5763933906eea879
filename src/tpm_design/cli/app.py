"""The commands and their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tpm_design.cli.guard import guarded, run_to_the_end

app = typer.Typer(
    name="tpm-design",
    help="Dimensions for translational parallel robots: reachable, well conditioned, far from singularities.",
    epilog="Start with `tpm-design init`, then `tpm-design optimize study.yaml` and `tpm-design report`. "
    "Exit codes: 0 done, 1 internal error, 2 wrong usage or invalid study, 3 no feasible design, 4 outside "
    "tolerance of a baseline or of stored results, 5 requirement refuted or not proved, 6 points of a sweep "
    "failed, 130 interrupted: --resume goes on.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Study = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (YAML).", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="Machine-readable output on standard output.")]
AllowCode = Annotated[
    bool,
    typer.Option(
        "--allow-code", help="Run the Python file that a study names as its mechanism; read it first."
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS|local",
        help="Evaluate on the Dask cluster of this scheduler, or on processes of this machine.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print results only, no progress.")]


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        print(f"tpm-design {version('tpm-design')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options of the program itself."""


@app.command()
@guarded
def init(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Name of the study.")] = "study",
    mechanism: Annotated[str, typer.Option(help="Mechanism to start from.")] = "uru",
) -> int | None:
    """Write a commented study, NAME.yaml, that runs as it is."""
    from tpm_design.cli.commands import init_study

    return init_study(name, mechanism)


@app.command()
@guarded
def validate(
    study: Study,
    resolved: Annotated[bool, typer.Option("--resolved", help="Print the study with every default.")] = False,
    allow_code: AllowCode = False,
    quiet: Quiet = False,
) -> int | None:
    """Check a study completely; run nothing."""
    from tpm_design.cli.commands import validate_study

    return validate_study(study, resolved=resolved, allow_code=allow_code, quiet=quiet)


@app.command()
@guarded
def schema() -> int | None:
    """Print the JSON Schema of study files, for editors."""
    from tpm_design.cli.commands import print_schema

    return print_schema()


@app.command("list")
@guarded
def list_(
    what: Annotated[
        str | None,
        typer.Argument(metavar="[WHAT]", help="mechanisms, metrics, optimizers or regions; all if left out."),
    ] = None,
    as_json: Json = False,
) -> int | None:
    """List mechanisms, metrics, optimizers and regions."""
    from tpm_design.cli.catalogue import list_things

    return list_things(what, as_json=as_json)


@app.command()
@guarded
def show(
    name: Annotated[
        str, typer.Argument(help="A mechanism, metric, optimizer or region, or a mechanism's Python file.")
    ],
    drawing: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a labelled line drawing of a mechanism: FILE.svg or FILE.png."
        ),
    ] = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> int | None:
    """Explain one of them: parameters, units, options, source of its equations."""
    from tpm_design.cli.catalogue import show_thing

    return show_thing(name, drawing, allow_code=allow_code, as_json=as_json)


@app.command()
@guarded
def evaluate(
    study: Annotated[Path, typer.Argument(metavar="STUDY|RUN", help="Study file or run folder.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Value in the study's units; may be repeated."),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Joint values, Jacobian and margins at this pose instead."),
    ] = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Evaluate one design: every metric with its unit and numeric error."""
    from tpm_design.cli.commands import evaluate_one

    return evaluate_one(study, settings or [], at, allow_code=allow_code, as_json=as_json, quiet=quiet)


@app.command()
@guarded
def optimize(
    study: Study,
    seed: Annotated[int | None, typer.Option(help="Seed of random methods, instead of the study's.")] = None,
    budget: Annotated[int | None, typer.Option(help="Number of evaluations, instead of the study's.")] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Threads, with --dask local processes; one per processor if left out."),
    ] = None,
    dask: Dask = None,
    resume: Annotated[
        str | None,
        typer.Option(
            metavar="RUN|latest",
            help="Go on in this run folder, or in the study's newest one: after an interruption, a crash, "
            "a full disk, or with a larger budget.",
        ),
    ] = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for run folders.")] = Path("results"),
    allow_code: AllowCode = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Search the design space of a study; the run is written below results/."""
    from tpm_design.cli.commands import optimize_one

    return optimize_one(
        study,
        seed,
        budget,
        workers,
        dask,
        resume,
        output,
        allow_code=allow_code,
        as_json=as_json,
        quiet=quiet,
    )


@app.command()
@guarded
def sweep(
    study: Study,
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Every N-th point, from the I-th; `merge` joins the shards.")
    ] = "1/1",
    workers: Annotated[
        int | None,
        typer.Option(help="Threads, with --dask local processes; one per processor if left out."),
    ] = None,
    dask: Dask = None,
    resume: Annotated[
        str | None,
        typer.Option(
            metavar="RUN|latest",
            help="Go on in this run folder, or in the newest one of the same shard: after an interruption, a "
            "crash or a full disk.",
        ),
    ] = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for run folders.")] = Path("results"),
    allow_code: AllowCode = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Evaluate every design of the study's `sweep:`; the run is written below results/."""
    from tpm_design.cli.sweep import sweep_one

    return sweep_one(
        study, shard, workers, dask, resume, output, allow_code=allow_code, as_json=as_json, quiet=quiet
    )


@app.command()
@guarded
def merge(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN ...", help="Run folders of all shards.", show_default=False)
    ],
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for run folders.")] = Path("results"),
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> int | None:
    """Join the shards of a sweep into one run."""
    from tpm_design.cli.sweep import merge_shards

    return merge_shards(runs, output, allow_code=allow_code, as_json=as_json)


@app.command()
@guarded
def certify(
    study: Annotated[
        Path | None, typer.Argument(metavar="[STUDY|RUN]", help="Study file or run folder.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Value in the study's units; may be repeated."),
    ] = None,
    max_tolerance: Annotated[
        bool,
        typer.Option(
            "--max-tolerance", help="Find the largest factor on the tolerances instead; writes no file."
        ),
    ] = False,
    check: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Prove a certificate again, by other means; may take minutes."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The certificate; if left out, in the run, or ./certificate.json for a study or with --set.",
        ),
    ] = None,
    workers: Annotated[int | None, typer.Option(help="One per processor if left out.")] = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Prove or refute every constraint, over the whole region and for all machines within tolerance."""
    from tpm_design.cli.certify import certify_one

    return certify_one(
        study,
        settings or [],
        max_tolerance,
        check,
        output,
        workers,
        allow_code=allow_code,
        as_json=as_json,
        quiet=quiet,
    )


@app.command()
@guarded
def inscribe(
    study: Annotated[Path, typer.Argument(metavar="STUDY|RUN", help="Study file or run folder.")],
    body: Annotated[str, typer.Option(help="box, sphere, cylinder (axis along z) or ellipsoid.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Value in the study's units; may be repeated."),
    ] = None,
    margin: Annotated[
        float, typer.Option(help="Least distance of every determinant from 0, dimensionless.")
    ] = 0.0,
    proportions: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Proportions of the sizes along x, y and z; free if left out."),
    ] = None,
    certify: Annotated[
        bool, typer.Option("--certify", help="Shrink it until it is proved; writes a certificate.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The certificate, instead of ./certificate.json.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Threads of the proof; one per processor if left out.")
    ] = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Find the largest body in the singularity-free region of one design: within reach and joint limits of
    the mode, in any of its aspects. The study's own region and constraints play no part."""
    from tpm_design.cli.inscribe import inscribe_one

    return inscribe_one(
        study,
        settings or [],
        body,
        margin,
        proportions,
        certify,
        output,
        workers,
        allow_code=allow_code,
        as_json=as_json,
        quiet=quiet,
    )


@app.command()
@guarded
def report(
    runs: Annotated[
        list[Path] | None, typer.Argument(metavar="[RUN ...]", help="Run folders; the newest if left out.")
    ] = None,
    allow_code: AllowCode = False,
    quiet: Quiet = False,
) -> int | None:
    """Write report.md and figures/*.png into run folders."""
    from tpm_design.cli.commands import report_runs

    return report_runs(runs or [], allow_code=allow_code, quiet=quiet)


@app.command()
@guarded
def compare(
    baseline: Annotated[
        Path, typer.Argument(metavar="BASELINE", help="Folder of a run or a baseline.", show_default=False)
    ],
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.", show_default=False)],
    rtol: Annotated[float, typer.Option(help="Allowed share of the baseline's value.")] = 1e-6,
    atol: Annotated[float, typer.Option(help="Allowed besides, in each column's own unit.")] = 0.0,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write JUnit XML, a test case for each column.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a summary for a pull request.")
    ] = None,
    update_baseline: Annotated[
        bool, typer.Option("--update-baseline", help="Show what deviates, then make RUN the baseline.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Compare a run with an earlier one: everything outside tolerance; exit code 4 where there is any."""
    from tpm_design.baselines.deviations import Tolerance
    from tpm_design.cli.baselines import compare_runs

    return compare_runs(
        baseline,
        run,
        Tolerance(rtol, atol),
        junit,
        markdown,
        update=update_baseline,
        as_json=as_json,
        quiet=quiet,
    )


@app.command()
@guarded
def reproduce(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder or baseline.", show_default=False)],
    allow_code: AllowCode = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int | None:
    """Evaluate the designs a run ended with again; exit code 4 where they do not come back."""
    from tpm_design.cli.baselines import reproduce_run

    return reproduce_run(run, allow_code=allow_code, as_json=as_json, quiet=quiet)


def main() -> None:
    """Entry point of `tpm-design`."""
    run_to_the_end(app)

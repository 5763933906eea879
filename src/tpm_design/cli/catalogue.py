"""`list` and `show`: what there is, read from the registries."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from tpm_design.cli.text import table
from tpm_design.errors import UsageError, did_you_mean
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Metric, Option
from tpm_design.optimizers import OPTIMIZERS
from tpm_design.optimizers.base import Optimizer
from tpm_design.report.facts import CONVENTION, mechanism_facts
from tpm_design.study.plug_in import kind_in_file
from tpm_design.workspace.regions import REGIONS, RegionForm

Thing = MechanismKind | Metric | Optimizer | RegionForm
ROOMS: Mapping[str, Mapping[str, Thing]] = {
    "mechanisms": MECHANISMS,
    "metrics": METRICS,
    "optimizers": OPTIMIZERS,
    "regions": REGIONS,
}


def list_things(what: str | None, *, as_json: bool) -> int | None:
    if what is not None and what not in ROOMS:
        raise UsageError(f"There are no {what!r}.", remedy=did_you_mean(what, ROOMS))
    rooms = {room: things for room, things in ROOMS.items() if what in (None, room)}
    if as_json:
        data = {room: {name: summary(t) for name, t in things.items()} for room, things in rooms.items()}
        print(json.dumps(data, ensure_ascii=False))
        return None
    texts = []
    for room, things in rooms.items():
        measured = any(map(unit_text, things.values()))
        rows = [
            [name, *([unit_text(thing)] if measured else []), summary(thing)]
            for name, thing in things.items()
        ]
        texts.append(table([room, *(["unit"] if measured else []), "what it is"], rows))
    print("\n\n".join(texts))
    return None


def unit_text(thing: Thing) -> str:
    return thing.unit if isinstance(thing, Metric) else ""


def summary(thing: Thing) -> str:
    """One line."""
    return thing.title if isinstance(thing, MechanismKind) else thing.description


def show_thing(name: str, drawing: Path | None, *, allow_code: bool, as_json: bool) -> int | None:
    thing = _from_file(Path(name), allow_code) if name.endswith(".py") else _registered(name)
    if drawing is not None:
        return _write_drawing(name, thing, drawing)
    if as_json:
        print(json.dumps(_data(thing), ensure_ascii=False))
    elif isinstance(thing, MechanismKind):
        print(_mechanism_text(thing))
    elif isinstance(thing, Metric):
        print(_metric_text(thing))
    elif isinstance(thing, Optimizer):
        print(_optimizer_text(thing))
    else:
        print(table(["region", thing.name], [["keys", thing.keys], ["what it is", thing.description]]))
    return None


def _registered(name: str) -> Thing:
    found = [things[name] for things in ROOMS.values() if name in things]
    if not found:
        everything = [known for things in ROOMS.values() for known in things]
        raise UsageError(f"There is no {name!r}.", remedy=did_you_mean(name, everything))
    return found[0]


def _from_file(path: Path, allow_code: bool) -> MechanismKind:
    if not allow_code:
        raise UsageError(
            "To show a mechanism's Python file is to run it, and that was not allowed.",
            where=str(path),
            remedy="It can do whatever you can. Read it; if you trust it, add --allow-code.",
        )
    return kind_in_file(path)


def _write_drawing(name: str, thing: Thing, path: Path) -> int | None:
    if not isinstance(thing, MechanismKind):
        raise UsageError(
            f"{name} is not a mechanism: there is nothing to draw.",
            where="--drawing",
            remedy=f"Known mechanisms: {', '.join(MECHANISMS)}.",
        )
    from tpm_design.report import write_drawing

    write_drawing(thing, path)
    print(f"Wrote {path}.")
    return None


def _mechanism_text(kind: MechanismKind) -> str:
    facts = mechanism_facts(kind)
    lines = [f"{kind.name}: {kind.title}", f"Source: {kind.source}"]
    lines += [f"{name}: {words}" for name, words in facts.lines]
    lines += [CONVENTION, f"Drawing: tpm-design show {kind.name} --drawing {kind.name}.svg"]
    remarks = ["Remarks:\n" + "\n".join(f"- {remark}" for remark in facts.remarks)] if facts.remarks else []
    return "\n\n".join(
        ["\n".join(lines), *(table(one.headings, one.rows) for one in facts.tables if one.rows), *remarks]
    )


def _metric_text(metric: Metric) -> str:
    rows = [[option.name, _values(option), _default(option), option.description] for option in metric.options]
    text = (
        f"{metric.name} [{metric.unit}]: {metric.description}\nSource: {metric.source}\n"
        f"Better: {metric.better}. Violation scale: {metric.scale:g} {metric.unit}. "
        f"{_region_text(metric)}"
        f"{'' if metric.differentiable else 'May jump with the design: no gradient methods.'}"
    ).rstrip()
    return text + ("\n\n" + table(["option", "values", "default", "what it is"], rows) if rows else "")


def _region_text(metric: Metric) -> str:
    if not metric.needs_region:
        return ""
    return "Needs a region, but over: aspect does not. " if metric.option("over") else "Needs a region. "


def _values(option: Option) -> str:
    if option.kind == "choice":
        return " | ".join(option.choices)
    if option.kind == "point":
        return "[x, y, z] (length)"
    if option.kind == "length":
        return "length"
    if math.isfinite(option.minimum) and math.isfinite(option.maximum):
        return f"{option.minimum:g} … {option.maximum:g}"
    return "number"


def _default(option: Option) -> str:
    if option.required:
        return "required"
    return "none" if option.default is None else str(option.default)


def _optimizer_text(method: Optimizer) -> str:
    able = method.abilities
    most = "any" if able.largest_dimension is None else str(able.largest_dimension)
    rows = [
        ["searches", "the whole space" if able.whole_space else "locally, from the initial design"],
        ["constraints", "handles them itself" if able.constraints else "by an exact penalty"],
        ["discrete parameters", "yes" if able.discrete else "no"],
        ["needs gradients of every metric", "yes" if able.derivatives else "no"],
        ["random", "yes, by the seed" if able.random else "no"],
        ["workers help", "yes" if able.batch else "no"],
        ["variables", f"{able.smallest_dimension} to {most}"],
    ]
    if able.relaxation:
        rows[1] = ["constraints", "leaves out all but reach, and says which its designs miss"]
        rows.append(["needs", "least total_link_length as objective, a region to be reached as a whole"])
    return f"{method.name}: {method.description}\nSource: {method.source}\n\n" + table(["ability", ""], rows)


def _data(thing: Thing) -> dict[str, Any]:
    """Every plain field, for --json."""
    return {
        f.name: _plain(getattr(thing, f.name)) for f in fields(thing) if not callable(getattr(thing, f.name))
    }


def _plain(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        return _data(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return value if not isinstance(value, float) or math.isfinite(value) else None

"""The study's JSON Schema, from the models and the registries, so that editors complete every name."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics.base import Metric, Option
from tpm_design.optimizers import default_method
from tpm_design.study.comparison import SHARED_ONLY
from tpm_design.study.model import ARCHITECTURES, NAME, PYTHON_FILE, StudyModel
from tpm_design.study.registries import Registries, registries

Schema = dict[str, Any]


def study_schema() -> Schema:
    """JSON Schema (draft 2020-12) of a study: what ``load_study`` accepts in form and names.

    Rules between values (min below max, labels apart, domains) are beyond it; ``load_study`` checks those.
    """
    known = registries()
    schema: Schema = copy.deepcopy(StudyModel.model_json_schema())
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "tpm-design study",
    }
    _without_titles(schema)
    definitions = schema["$defs"]
    _mechanisms(definitions["MechanismModel"], known)
    for name in ("ObjectiveModel", "ConstraintModel", "RecordModel"):
        _metrics(definitions[name], known)
    method = definitions["OptimizerModel"]["properties"]
    method["method"] = {
        "description": f"by default {default_method(1)}, for several objectives {default_method(2)}",
        "enum": [*sorted(known.optimizers), None],
        "default": None,
    }
    local = [name for name, optimizer in known.optimizers.items() if not optimizer.abilities.whole_space]
    method["polish"] = {"enum": [*sorted(local), None], "default": None}
    _architectures(schema)
    return schema


def _architectures(schema: Schema) -> None:
    """A comparison says once what is shared, and each architecture the rest."""
    own = [key for key in schema["properties"] if key not in SHARED_ONLY]
    part = {
        "type": "object",
        "properties": {key: {"$ref": f"#/properties/{key}"} for key in own},
        "additionalProperties": False,
    }
    schema["if"] = {"required": [ARCHITECTURES]}
    schema["then"] = {"required": list(SHARED_ONLY)}
    schema["else"] = {"required": schema.pop("required")}
    schema["properties"][ARCHITECTURES] = {
        "description": "in a comparison: label → what this architecture does not share with the others",
        "type": "object",
        "minProperties": 2,
        "propertyNames": {"pattern": NAME},
        "additionalProperties": part,
    }


def _without_titles(node: Any) -> None:
    """Drops the titles that only repeat the keys."""
    if isinstance(node, dict):
        if (
            "title" in node
            and isinstance(node["title"], str)
            and ("type" in node or "oneOf" in node or "anyOf" in node)
        ):
            del node["title"]
        for item in node.values():
            _without_titles(item)
    elif isinstance(node, list):
        for item in node:
            _without_titles(item)


def _when(key: str, value: str, then: Schema) -> Schema:
    return {"if": {"properties": {key: {"const": value}}, "required": [key]}, "then": then}


def _mechanisms(definition: Schema, known: Registries) -> None:
    """Type by name; parameters, mode fields and limits by type. What a file defines is not known here."""
    properties = definition["properties"]
    properties["type"] = {"enum": sorted(known.mechanisms)}
    properties["file"] = {
        "type": "string",
        "pattern": PYTHON_FILE,
        "description": "a Python file beside the study that defines the mechanism; needs --allow-code",
    }
    properties["sha256"] = {
        "type": "string",
        "pattern": "^[0-9a-f]{64}$",
        "description": "the SHA-256 that the file must have",
    }
    definition["oneOf"] = [{"required": ["type"]}, {"required": ["file"]}]
    definition["dependentRequired"] = {"sha256": ["file"]}
    definition["allOf"] = [
        _when("type", name, {"properties": _mechanism(kind, definition)})
        for name, kind in known.mechanisms.items()
    ]


_LIMITS: Mapping[str, Schema] = {
    "range": {"$ref": "#/$defs/Limits"},
    "number": {"type": "number", "minimum": 0},
    "switch": {"type": "boolean"},
}


def _mechanism(kind: MechanismKind, definition: Schema) -> Schema:
    quantity = definition["properties"]["parameters"]["additionalProperties"]
    parameters: Schema = {}
    for name in kind.parameter_names():
        parameter = kind.parameter(name)
        description = parameter.description if parameter else name
        parameters[name] = {"description": description, **quantity}
    fields: Schema = {}
    for field in kind.mode_fields:
        signs = {"type": "string", "pattern": f"^[+-]{{{field.length}}}$"}
        choices = [signs, {"const": "any"}] if field.any_allowed else [signs]
        fields[field.name] = {"description": field.description, "anyOf": choices}
    limits = {
        limit.name: {
            "description": limit.description,
            **_LIMITS[limit.kind],
        }
        for limit in kind.limits
    }
    return {
        "parameters": {"properties": parameters, "propertyNames": {"enum": list(parameters)}},
        "mode": {
            "anyOf": [
                {"const": "best"},
                {"type": "object", "properties": fields, "additionalProperties": False},
                {"type": "null"},
            ]
        },
        "limits": {"properties": limits, "propertyNames": {"enum": list(limits)}},
    }


def _metrics(definition: Schema, known: Registries) -> None:
    """Metric by name; options by metric."""
    definition["properties"]["metric"] = {
        "enum": sorted(known.metrics),
        "description": "see `tpm-design list metrics`",
    }
    definition["allOf"] = [_when("metric", name, _metric(metric)) for name, metric in known.metrics.items()]
    del definition["additionalProperties"]
    definition["unevaluatedProperties"] = False  # additionalProperties does not see the options in allOf


def _metric(metric: Metric) -> Schema:
    schema: Schema = {"description": f"{metric.description} [{metric.unit}]"}
    if metric.options:
        schema["properties"] = {option.name: _option(option) for option in metric.options}
        required = [option.name for option in metric.options if option.required]
        if required:
            schema["required"] = required
    return schema


def _option(option: Option) -> Schema:
    schema: Schema = {"description": option.description}
    if option.default is not None:
        schema["default"] = option.default
    if option.kind == "choice":
        numbers = [int(choice) for choice in option.choices if choice.isdigit()]
        return schema | {"enum": [*option.choices, *numbers]}
    if option.kind == "number":
        bounds = {"minimum": option.minimum, "maximum": option.maximum}
        return schema | {
            "type": "number",
            **{key: bound for key, bound in bounds.items() if abs(bound) != float("inf")},
        }
    if option.kind == "length":
        return schema | {"type": "number", "exclusiveMinimum": 0}
    return schema | {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}

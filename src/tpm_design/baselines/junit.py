"""Deviations as JUnit XML: one test case for each column, and one for the rows.

A continuous integration shows names of failed cases: ``conditioning_min [-]`` says more than a row's number,
and the number of cases does not grow with a sweep.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime
from xml.etree import ElementTree as Xml

from tpm_design.baselines.deviations import Deviations, Exceedance
from tpm_design.baselines.words import exceedance_text

# what XML 1.0 cannot hold
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_xml(deviations: Deviations, study: str, remarks: Sequence[str], time: datetime) -> str:
    """A document of one suite, by the schema of Ant's JUnit reports (JUnit.xsd of Windy Road)."""
    by_case: dict[str, list[Exceedance]] = {"rows": [], **{column: [] for column in deviations.columns}}
    for exceedance in deviations.exceedances:
        by_case[exceedance.column or "rows"].append(exceedance)
    root = Xml.Element("testsuites")
    suite = Xml.SubElement(
        root,
        "testsuite",
        {
            "id": "0",
            "package": "tpm-design",
            "name": _clean(study) or "study",
            "timestamp": time.strftime("%Y-%m-%dT%H:%M:%S"),
            "hostname": "localhost",
            "tests": str(len(by_case)),
            "failures": str(sum(bool(found) for found in by_case.values())),
            "errors": "0",
            "time": "0",
        },
    )
    Xml.SubElement(suite, "properties")
    class_name = f"{_clean(study)}.{deviations.file.removesuffix('.csv')}"
    for name, found in by_case.items():
        case = Xml.SubElement(suite, "testcase", {"name": _clean(name), "classname": class_name, "time": "0"})
        if found:
            lines = [_clean(exceedance_text(exceedance)) for exceedance in found]
            more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
            failure = Xml.SubElement(
                case, "failure", {"type": "outside tolerance", "message": f"{lines[0]}{more}"}
            )
            failure.text = "\n".join(lines)
    Xml.SubElement(suite, "system-out").text = _clean("\n".join(remarks))
    Xml.SubElement(suite, "system-err")
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _clean(words: str) -> str:
    return _UNPRINTABLE.sub("?", words)

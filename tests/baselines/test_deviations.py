"""Tables compared cell by cell, and what people and programs are told."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tpm_design.baselines.deviations import Deviations, Exceedance, Tolerance, compare_tables
from tpm_design.baselines.junit import junit_xml
from tpm_design.baselines.tables import ResultTable, metric_of_error, parse_table, unit_of
from tpm_design.baselines.words import MOST_IN_MARKDOWN, comparison_markdown
from tpm_design.errors import UsageError
from tpm_design.runs.tables import csv_line, number

HEADINGS = ["rank", "id", "status", "f [mm]", "grip [-]", "grip error [-]", "grip_locus", "violation [-]"]
ROW = ["1", "7", "feasible", "200.0", "0.3", "4e-12", "actuation", "0.0"]
DESIGNS, EVALUATIONS = Path("designs.csv"), Path("evaluations.csv")
EXACT = Tolerance(0.0, 0.0)
# no subnormal numbers: there is no room for a relative deviation of 1e-6 among them
NUMBERS = st.floats(1e-200, 1e200) | st.floats(-1e200, -1e-200)


def table(*rows: Sequence[str], headings: Sequence[str] = HEADINGS, path: Path = DESIGNS) -> ResultTable:
    return parse_table("".join(map(csv_line, [headings, *rows])), path)


def changed(**cells: str) -> list[str]:
    """ROW with other cells, by the first word of their headings."""
    names = [heading.split(" [")[0].replace(" ", "_") for heading in HEADINGS]
    assert set(cells) <= set(names)
    return [cells.get(name, cell) for name, cell in zip(names, ROW, strict=True)]


def compared(before: ResultTable, now: ResultTable, tolerance: Tolerance = EXACT) -> Deviations:
    return compare_tables(before, now, tolerance.allowed)


def test_a_table_is_equal_to_itself_and_to_other_spellings_of_its_numbers() -> None:
    spelt = changed(f="2e2", grip="0.30", violation="-0")
    for now in (table(ROW), table(spelt)):
        found = compared(table(ROW), now)
        assert found == Deviations("designs.csv", found.columns, 1, 6, 6, ())
        assert found.columns == tuple(HEADINGS[2:])


@given(value=NUMBERS, share=st.floats(1e-6, 0.5), sign=st.sampled_from((-1.0, 1.0)))
def test_a_number_may_deviate_by_a_share_of_the_baseline_s(value: float, share: float, sign: float) -> None:
    now = table(changed(f=number(value * (1.0 + sign * share))))
    before = table(changed(f=number(value)))
    assert compared(before, now, Tolerance(1.001 * share, 0.0)).within
    (found,) = compared(before, now, Tolerance(0.999 * share, 0.0)).exceedances
    assert (found.row, found.column, found.baseline) == ("rank 1", "f [mm]", f"{value!r} mm")
    assert found.relative == pytest.approx(share, rel=1e-6)
    assert found.deviation == pytest.approx(share * abs(value), rel=1e-6)
    assert found.allowed == pytest.approx(0.999 * share * abs(value), rel=1e-12)


@given(value=st.floats(-1e3, 1e3), rtol=st.floats(0.0, 0.5), atol=st.floats(1e-6, 1e3))
def test_absolute_and_relative_tolerance_add_up(value: float, rtol: float, atol: float) -> None:
    before, allowed = table(changed(f=number(value))), atol + rtol * abs(value)
    inside, outside = (table(changed(f=number(value + share * allowed))) for share in (0.999, 1.001))
    assert compared(before, inside, Tolerance(rtol, atol)).within
    assert not compared(before, outside, Tolerance(rtol, atol)).within


def test_next_to_zero_only_the_absolute_tolerance_counts() -> None:
    before, now = table(changed(violation="0.0")), table(changed(violation="1e-9"))
    (found,) = compared(before, now, Tolerance(0.5, 0.0)).exceedances
    assert (found.deviation, found.allowed, found.relative) == (1e-9, 0.0, None)
    assert compared(before, now, Tolerance(0.0, 2e-9)).within


def test_a_numeric_error_is_measured_by_its_metric() -> None:
    before, now = table(ROW), table(changed(grip_error="9e-12"))
    assert compared(before, now, Tolerance(1e-6, 0.0)).within
    (found,) = compared(before, table(changed(grip_error="4e-7")), Tolerance(1e-6, 0.0)).exceedances
    assert found.column == "grip error [-]"
    assert found.allowed == pytest.approx(3e-7)


@pytest.mark.parametrize(
    ("cells", "column", "values"),
    [
        ({"status": "infeasible"}, "status", ("feasible", "infeasible")),
        ({"grip_locus": "none"}, "grip_locus", ("actuation", "none")),
        ({"grip_locus": ""}, "grip_locus", ("actuation", "–")),
        ({"f": ""}, "f [mm]", ("200.0 mm", "–")),
    ],
)
def test_texts_and_missing_numbers_deviate_at_any_tolerance(
    cells: Mapping[str, str], column: str, values: tuple[str, str]
) -> None:
    for before, now, expected in (
        (ROW, changed(**cells), values),
        (changed(**cells), ROW, values[::-1]),
    ):
        (found,) = compared(table(before), table(now), Tolerance(1e9, 1e9)).exceedances
        assert found == Exceedance("rank 1", column, *expected)


def test_rows_and_columns_of_one_table_alone_deviate() -> None:
    without = [heading for heading in HEADINGS if heading != "grip_locus"]
    short = [cell for heading, cell in zip(HEADINGS, ROW, strict=True) if heading in without]
    before, now = table(ROW, ["2", *ROW[1:]]), table(short, ["3", *short[1:]], headings=without)
    assert compared(before, now).exceedances == (
        Exceedance("", "grip_locus", "there", "–"),
        Exceedance("rank 2", "", "there", "–"),
        Exceedance("rank 3", "", "–", "there"),
    )
    metres = [heading.replace("[mm]", "[m]") for heading in HEADINGS]
    found = compared(table(ROW), table(ROW, headings=metres)).exceedances
    assert [(one.column, one.run) for one in found] == [("f [mm]", "–"), ("f [m]", "there")]


def test_what_a_search_went_through_is_no_part_of_its_result() -> None:
    assert compared(table(ROW), table(changed(id="9"))).within
    headings = ["id", "round", "status", "reason", "f [mm]", "seconds [s]"]
    before = ["0", "1", "failed", "cannot be built", "200", "0.5"]
    first, second = (
        table(row, headings=headings, path=EVALUATIONS) for row in (before, [*before[:-1], "9.0"])
    )
    assert compared(first, second).within
    other = table([*before[:3], "out of reach", *before[4:]], headings=headings, path=EVALUATIONS)
    (found,) = compared(first, other).exceedances
    assert (found.row, found.column) == ("id 0", "reason")


def test_rows_are_paired_by_key_whatever_their_order() -> None:
    first, second = ROW, ["2", *changed(f="300.0")[1:]]
    assert compared(table(first, second), table(second, first)).within


def test_units_and_errors_are_read_off_the_headings() -> None:
    assert unit_of("velocity_max [mm/deg]") == "mm/deg"
    assert unit_of("grip_locus") is None
    assert metric_of_error("velocity_max error [mm/deg]") == "velocity_max [mm/deg]"
    assert metric_of_error("velocity_max [mm/deg]") is None


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([], "designs.csv:1: .*no column 'rank'"),
        ([["rank", "f [mm]"]], "no column 'status'"),
        ([[*HEADINGS, "f [mm]"]], r"'f \[mm\]' is there twice"),
        ([HEADINGS, ROW, ROW], "designs.csv:3: .*rank 1 is there twice"),
        ([HEADINGS, ROW[:-1]], "designs.csv:2: .*7 cells under 8 headings"),
        ([HEADINGS, changed(f="long")], r"'long' under 'f \[mm\]' is not a number"),
        ([HEADINGS, changed(f="inf")], "'inf' under"),
        ([HEADINGS, changed(rank="first")], "'first' under 'rank' is not a whole number"),
    ],
)
def test_a_damaged_table_is_one_message_with_its_line(rows: list[list[str]], said: str) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        parse_table("".join(map(csv_line, rows)), DESIGNS)
    assert "Restore the file" in caught.value.message


WHEN = datetime(2024, 5, 6, 7, 8, 9)
TOKEN = re.compile(r"\S+( \S+)*\Z")


def check_schema(document: str) -> Xml.Element:
    """The rules of Ant's schema (JUnit.xsd of Windy Road) for a document of one suite: which attributes and
    children there must be, and their order."""
    root = Xml.fromstring(document)
    assert (root.tag, root.attrib) == ("testsuites", {})
    (suite,) = root
    assert suite.tag == "testsuite"
    assert set(suite.attrib) == {
        *("id", "package", "name", "timestamp", "hostname", "tests", "failures", "errors", "time")
    }
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", suite.attrib["timestamp"])
    cases = suite.findall("testcase")
    order = ["properties", *["testcase"] * len(cases), "system-out", "system-err"]
    assert [child.tag for child in suite] == order
    for case in cases:
        assert set(case.attrib) == {"name", "classname", "time"}
        assert [child.tag for child in case] in ([], ["failure"])
        assert all(set(failure.attrib) == {"type", "message"} for failure in case)
    for element in (suite, *cases):
        assert TOKEN.match(element.attrib["name"])
        assert math.isfinite(float(element.attrib["time"]))
    failures = sum(len(case) for case in cases)
    counts = [suite.attrib[name] for name in ("tests", "failures", "errors")]
    assert counts == [str(len(cases)), str(failures), "0"]
    return suite


def test_junit_has_a_case_for_each_column_and_one_for_the_rows() -> None:
    now = table(changed(f="201.0", status="infeasible"), ["2", *changed(f="202.0")[1:]])
    found = compared(table(ROW, ["2", *ROW[1:]], ["3", *ROW[1:]]), now)
    suite = check_schema(junit_xml(found, "cube", ["Other versions."], WHEN))
    cases = {case.attrib["name"]: case for case in suite.findall("testcase")}
    assert list(cases) == ["rows", *HEADINGS[2:]]
    assert {case.attrib["classname"] for case in cases.values()} == {"cube.designs"}
    failed = {name: case[0] for name, case in cases.items() if len(case)}
    assert set(failed) == {"rows", "status", "f [mm]"}
    lines = (failed["f [mm]"].text or "").splitlines()
    assert [line.split(",")[0] for line in lines] == ["rank 1", "rank 2"]
    assert "200.0 mm → 201.0 mm, deviates by 1 mm (0.005 of it), allowed 0 mm" in lines[0]
    assert failed["f [mm]"].attrib["message"].endswith("(and 1 more)")
    assert suite.findtext("system-out") == "Other versions."


@given(words=st.text(max_size=30))
def test_whatever_a_table_holds_junit_is_xml_and_markdown_is_one_table(words: str) -> None:
    found = Deviations(
        "designs.csv", ("status",), 1, 1, 0, (Exceedance("rank 1", "status", words, words[::-1]),)
    )
    check_schema(junit_xml(found, "cube", [words], WHEN))
    lines = comparison_markdown(found, "cube", EXACT, [], updated=False).splitlines()
    (row,) = [line for line in lines if line.startswith("| rank 1")]
    assert len(re.findall(r"(?<!\\)\|", row.replace("\\\\", ""))) == 7


def test_the_markdown_summary_has_a_largest_size() -> None:
    many = tuple(Exceedance(f"id {number}", "status", "feasible", "failed") for number in range(150))
    found = Deviations("evaluations.csv", ("status",), 150, 150, 0, many)
    text = comparison_markdown(found, "a_study", Tolerance(), ["Other versions."], updated=True)
    assert text.startswith("### a\\_study: outside tolerance, 150 exceedances\n")
    assert text.count("| id ") == MOST_IN_MARKDOWN
    assert "And 50 more." in text
    assert "Other versions." in text
    assert "The run is the baseline now." in text

"""The table of promises is made of what pytest reports."""

from __future__ import annotations

from pathlib import Path

from tools.reliability import BEGIN, END, PAGE, Row, kept_lines, rows_of, table_of

ROOT = Path(__file__).resolve().parents[2]
REPORT = """<testsuites><testsuite>
<testcase classname="test.a.test_b" name="test_c[1]"><properties>
<property name="promise" value="It holds"/><property name="tried" value="1000"/>
</properties></testcase>
<testcase classname="test.a.test_b" name="test_c[2]"><properties>
<property name="promise" value="It holds"/><property name="tried" value="234"/>
</properties></testcase>
<testcase classname="test.a.test_b" name="test_d"><properties>
<property name="promise" value="It fails"/><property name="tried" value="7"/>
</properties><failure/></testcase>
<testcase classname="test.a.test_b" name="test_other"/>
</testsuite></testsuites>"""


def test_a_row_is_a_function_and_its_promise(tmp_path: Path) -> None:
    (tmp_path / "report.xml").write_text(REPORT)
    rows = rows_of(tmp_path / "report.xml")
    assert rows == [
        Row("It holds", "test/a/test_b.py::test_c", 1234),
        Row("It fails", "test/a/test_b.py::test_d", 7, 1),
    ]
    page = table_of(rows)
    assert "| It holds | `test/a/test_b.py::test_c` | 1,234 | all |" in page
    assert "| It fails | `test/a/test_b.py::test_d` | 7 | **no: 1 failed** |" in page


def test_rows_of_tests_that_did_not_run_stay() -> None:
    old = [
        Row("It holds", "test/a/test_b.py::test_c", 5),
        Row("Too", "test/d/test_e.py::test_f", 6),
    ]
    page = f"{BEGIN}\n{table_of(old)}\n{END}\n`other`"
    assert kept_lines(page, []) == []
    kept = kept_lines(page, ["test/a", "test/x.py"])
    assert kept == [old[1].line()]
    new = Row("It holds", "test/a/test_b.py::test_c", 7)
    assert table_of([new], kept) == table_of([new, old[1]])


def test_every_test_in_the_table_is_there() -> None:
    table = (ROOT / PAGE).read_text().split(BEGIN)[1].split(END)[0]
    rows = [line.split("|") for line in table.splitlines() if "`" in line]
    assert rows
    for _, promise, test, tried, survived, _ in rows:
        file, _, name = test.strip(" `").partition("::")
        text = (ROOT / file).read_text()
        assert f"def {name}(" in text
        assert f'"{promise.strip()}"' in text
        assert int(tried.replace(",", "")) > 0
        assert survived.strip() == "all"

"""The table of promises is made of what pytest reports."""

from __future__ import annotations

from pathlib import Path

from lab.tools.reliability import BEGIN, END, PAGE, Row, rows_of, table_of

ROOT = Path(__file__).resolve().parents[3]
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


def test_a_row_is_a_promise(tmp_path: Path) -> None:
    (tmp_path / "report.xml").write_text(REPORT)
    rows = rows_of(tmp_path / "report.xml")
    assert rows == [Row("It fails", 7, 1), Row("It holds", 1234)]
    page = table_of(rows)
    assert "| It holds | 1,234 |" in page
    assert "| It fails | 7 (**1 tests failed**) |" in page


def test_every_promise_of_the_table_has_a_test() -> None:
    table = (ROOT / PAGE).read_text().split(BEGIN)[1].split(END)[0]
    rows = [line.split("|")[1:3] for line in table.splitlines()[3:] if line]
    tests = "\n".join(path.read_text() for path in (ROOT / "test").rglob("*.py"))
    assert rows
    for promise, tried in rows:
        assert f'"{promise.strip()}"' in tests
        assert int(tried.replace(",", "")) > 0

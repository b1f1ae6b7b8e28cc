"""A wrong case file says which key, which value, what was expected, what is near."""

import pytest

from tidemesh.errors import FormatError, InputError
from tidemesh.pipeline.case import read_case


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("sizing.node=5", ["sizing.node", 'did you mean "nodes"', "keys of [sizing]"]),
        ("sizing.nodes=-5", ["sizing.nodes = -5", "expected int >= "]),
        ("sizing.nodes=many", ['sizing.nodes = "many"', "expected int, got str"]),
        ("sizing.rule=hesian", ['sizing.rule = "hesian"', 'did you mean "hessian"']),
        ("domain.ocean.kind=arch", ['"arch"', '"arc"', "domain.ocean.kind"]),
        ("domian.box_deg=[1]", ["domian", 'did you mean "domain"']),
        ("domain.box_deg=[1,2]", ["domain.box_deg", "length 4"]),
        ("depth.sources=[]", ["depth.sources is empty", "at least one"]),
        ("domain.min_spacing_deg=0.1", ["exactly one of min_spacing_m"]),
        ("nodes", ["section.key=value"]),
    ],
)
def test_messages(island, override, parts):
    with pytest.raises(InputError) as caught:
        read_case(island, [override])
    for part in parts:
        assert part in str(caught.value)


def test_line_is_named(island):
    text = island.read_text().replace("nodes = 800", "noodles = 800")
    island.write_text(text)
    line = 1 + text.splitlines().index("noodles = 800")
    with pytest.raises(InputError, match=rf"line {line}: sizing.noodles: unknown key"):
        read_case(island)


def test_missing_section_is_named(island):
    text = island.read_text()
    assert "[base_grid]\nspacing_m = 2000.0\n" in text
    island.write_text(text.replace("[base_grid]\nspacing_m = 2000.0\n", ""))
    with pytest.raises(InputError, match=r"base_grid: required key is missing"):
        read_case(island)


def test_not_toml(island):
    island.write_text("title = \n")
    with pytest.raises(FormatError, match=r"island.toml: line 1: not valid TOML"):
        read_case(island)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such case file"):
        read_case(tmp_path / "nowhere.toml")


def test_override_types(island):
    case = read_case(
        island, ["sizing.nodes=500", "sizing.rule=uniform", 'title="Bay, 2"']
    )
    assert (case.sizing.nodes, case.sizing.rule, case.title) == (
        500,
        "uniform",
        "Bay, 2",
    )


@pytest.mark.parametrize("name", ["south_carolina", "as_published", "fine"])
def test_shipped_cases_are_valid(examples, name):
    case = read_case(examples / "south_carolina" / f"{name}.toml")
    assert case.domain.ocean.radius_deg == 1.59031


@pytest.mark.parametrize("written", ["1998-03-24", '"1998-03-24"'])
def test_dates_need_no_quotes(island, written):
    assert read_case(island, [f"tide.date={written}"]).tide.date == "1998-03-24"

"""The reference of the case file is that of the code."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_reference_is_up_to_date():
    made = runpy.run_path(str(DOCS / "make_case_reference.py"))["main"]()
    message = "run python docs/make_case_reference.py"
    assert (DOCS / "case.md").read_text(encoding="utf-8") == made, message
    for key in ("`nodes`", "`radius_deg`", "`friction`", "`channel_elements`"):
        assert key in made

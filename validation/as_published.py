"""The paper's numbers beside ours, from a run of the as-published case.

tidemesh run examples/south_carolina/as_published.toml -o out/as_published
python validation/as_published.py out/as_published
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from tidemesh.pipeline import store


def main(output: str = "out/as_published") -> None:
    """Print one table."""
    folder = Path(output)
    summary = json.loads((folder / "summary.json").read_text())
    measured = store.load(folder / "stages" / "truncation.npz")
    base = store.load(folder / "stages" / "base_grid.npz")
    error = measured["error"][0]
    known = np.isfinite(error)
    peak = int(np.nanargmax(error))
    place = base.projection.inverse(base.points[peak][None])[0]
    against = summary["against_base_grid"]
    radii = summary["sizing"]["rule_spacing_m"]
    shares = np.percentile(error[known], [50, 90, 99, 99.9])
    rows = [
        ("base grid, nodes", "69,816", f"{summary['base_grid']['nodes']:,}"),
        ("nodes with an error", "", f"{int(known.sum()):,}"),
        ("peak error (m/s2)", "7.90e-06", f"{error[peak]:.2e}"),
        ("  at depth (m)", "", f"{base.depth[peak]:.1f}"),
        ("  at", "", f"{place[0]:.3f}, {place[1]:.3f}"),
        ("error, 50 / 90 / 99 / 99.9 %", "", " ".join(f"{v:.1e}" for v in shares)),
        (
            "radii (km)",
            "0.9 - 55.89",
            f"{radii[0] / 1e3:.2f} - {radii[1] / 1e3:.2f}",
        ),
        ("final mesh, nodes", "10,013", f"{summary['nodes']:,}"),
        ("reduction", "7.0", f"{against['base_nodes_per_node']:.1f}"),
        (
            "M2 against base grid, outside strip",
            "",
            f"{against['M2']['relative_l2_outside_strip']:.2%}",
        ),
        ("  everywhere", "", f"{against['M2']['relative_l2']:.2%}"),
        ("finest segment (m)", "300", f"{summary['edge_length_m'][0]:.0f}"),
    ]
    print(f"{'':36} {'paper':>14} {'here':>34}")
    for name, paper, here in rows:
        print(f"{name:36} {paper:>14} {here:>34}")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Draw a good and a bad example of each plot of the page, for docs/findings.md: `python docs/draw_plots.py`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import fit_details
from basecal.cell import Cell
from basecal.reporting.cell_view.picture import picture
from basecal.reporting.cell_view.scene import scene
from basecal.reporting.decision.outlook import component_figure
from basecal.reporting.figures.camera_points import points_by_camera
from basecal.reporting.figures.image_grid import image_coverage, lens_uncertainty
from basecal.reporting.figures.residual_map import residual_map
from basecal.reporting.figures.rings import orientation_figure, residual_polar
from basecal.simulation import Scenario, simulate

FOLDER = Path(__file__).parent / "figures"
SIZE_PX = (1280, 720)
BASE = "eye_base_from_hand_base"
RECIPES = {
    "three_robots": Scenario(samples=12, layout="chain", target="points"),
    "two_cameras": Scenario(samples=12, layout="two_cameras"),
    "camera_beside": Scenario(samples=12, layout="eye_to_hand"),
}
STYLE = """
text{font:13px system-ui,sans-serif;fill:#5b6470}.frame{fill:#f0f2f5;stroke:#d9dde3}.tile{fill:#3d7fb8}
.arrows,.mark path{stroke:#1f6fb2;stroke-width:1.3;fill:none}.mark circle{fill:#1f6fb2}
.ruler{stroke:#1b1f24;stroke-width:3}.ring,.rule{fill:none;stroke:#d9dde3}
.cloud{stroke:#1f6fb2;stroke-width:3;stroke-linecap:round;stroke-opacity:.45;fill:none}
.left-out{stroke:#9a5500;stroke-width:4;stroke-linecap:round;fill:none}
.contour{fill:none;stroke:#1b1f24;stroke-opacity:.65}.contour-label{fill:#1b1f24;paint-order:stroke;stroke:#fff;stroke-width:3px}
.allowed{fill:#1a7f45;fill-opacity:.16}.interval{fill:none;stroke:#1f6fb2;stroke-width:2.5}.interval.beyond{stroke:#b3261e}
:where(.scene path){fill:none;stroke-width:1.5;stroke-linecap:round;stroke-linejoin:round}
.scene text{text-anchor:middle}
.floor{stroke:#d9dde3;stroke-dasharray:6 5}.trail{stroke-width:3.5;opacity:.75}.links{stroke-width:7;opacity:.55}
.robot-2{stroke:#6a4fb3}
.robot-0{stroke:#b5541c}.robot-1{stroke:#1f6fb2}text.robot-0,text.robot-1,text.robot-2{stroke:none}
.axis-x{stroke:#d0342c}.axis-y{stroke:#1f9447}.axis-z{stroke:#2f62d9}.ellipsoid{stroke:#9a5500}
.camera{stroke:#1b1f24}.target{stroke:#6a4fb3}
"""


def standalone(svg: str, kind: str = "plot") -> str:
    """A drawing of a page as a file: its style in it, on white."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="{kind}" style="background:#fff" '
    return str(svg).replace("<svg ", head, 1).replace(">", f"><style>{STYLE}</style>", 1) + "\n"


def with_flat_lens(cell: Cell) -> Cell:
    """The cell with lenses that are said to have no distortion."""
    cameras = {}
    for name, camera in cell.cameras.items():
        assert camera.intrinsics is not None
        assert camera.intrinsics.camera is not None
        lens = camera.intrinsics.camera
        flat = lens.with_parameters(np.where(np.arange(lens.parameters.size) < 4, lens.parameters, 0.0))
        cameras[name] = replace(camera, intrinsics=replace(camera.intrinsics, camera=flat))
    return replace(cell, cameras=cameras)


def plots(scenario: Scenario, is_flat: bool = False) -> Iterator[tuple[str, str]]:
    """Names and drawings of the plots of a simulated cell."""
    made = simulate(scenario, 4)
    cell = with_flat_lens(made.cell) if is_flat else made.cell
    calibration = calibrate(cell, made.recording)
    details = fit_details(cell, made.recording, calibration)
    yield "scene", picture(scene(cell, made.recording.samples, calibration))
    if BASE not in calibration.transforms or not details.points:
        return
    points = points_by_camera(details.points)["wrist"]
    yield "residual_map", residual_map(SIZE_PX, points).svg
    yield "residual_polar", residual_polar(points).svg
    yield "coverage", image_coverage(SIZE_PX, points).svg
    yield "orientations", orientation_figure(details.views[0]).svg
    yield "components", component_figure(BASE, calibration[BASE], 3e-3).svg
    for name, lens in calibration.cameras.items():
        uncertain = lens_uncertainty(name, *lens)
        if uncertain is not None:
            yield "lens", uncertain.svg


def drawings() -> dict[str, str]:
    """All files by their names."""
    wide = Scenario(samples=25, robot_noise=(1e-4, 2e-4), intrinsics="free", joints=True)
    good = dict(plots(wide))
    narrow = dict(plots(replace(wide, samples=10, spread_rad=0.15, position_m=0.02)))
    flat = dict(plots(replace(wide, intrinsics="fixed"), is_flat=True))
    bad = {**narrow, **{name: flat[name] for name in ("residual_map", "residual_polar")}}
    files = {f"plot_{name}_good.svg": svg for name, svg in good.items() if name != "scene"}
    files |= {f"plot_{name}_bad.svg": svg for name, svg in bad.items() if name != "scene"}
    files = {name: standalone(svg) for name, svg in files.items()}
    scenes = {"scene": good["scene"], **{name: dict(plots(of))["scene"] for name, of in RECIPES.items()}}
    return {**files, **{f"plot_{name}.svg": standalone(svg, "scene") for name, svg in scenes.items()}}


if __name__ == "__main__":
    for name, svg in drawings().items():
        (FOLDER / name).write_text(svg, encoding="utf-8")

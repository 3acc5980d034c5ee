"""docs/benchmarks.md from results/*.json, so that no number stands there that no command gave."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import (
    arm_errors,
    arrays,
    bag,
    batch,
    blurred_views,
    calibrate,
    capture,
    capture_pictures,
    certificate,
    clean_kinds,
    clocks,
    cluster,
    confounding,
    consistency,
    detectors,
    error_map,
    false_alarms,
    few_pictures,
    held_out,
    journeys,
    live,
    local_fits,
    meeting,
    mutants,
    mutations,
    outliers,
    page,
    pictures_and_poses,
    plan,
    published,
    real,
    ring,
    robot_model,
    robots,
    rolling_shutter,
    running_check,
    sag,
    scaling,
    scene,
    scene_recordings,
    semi_synthetic,
    stated_numbers,
    stopping,
    stops,
    study,
    target_poses,
    touch,
    trouble,
    two_arms,
    verify,
    widths,
    wrong_answers,
)
from benchmarks.common import RESULTS, table
from benchmarks.peers import tables as peers
from benchmarks.slips import trial

PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"

Result = dict[str, Any]

INTRODUCTION = """\
---
search: {exclude: true}
---

# Benchmarks

The numbers of each section were written by the command that it begins with (`make bench` runs them all;
`python -m benchmarks.report` makes this page of their results). Times are of one thread, on the machine named.
"""


def _real(result: Result) -> str:
    about = """\
What is asked of each recording, and what is measured, without a guess. Of boards nothing is known but their shape; with
one corner as a light the lens too, from the whole board. A loop is `(A X B).inverse() @ Y C Z`, B from the view alone.
The UR5e and RCT recordings ship in `examples/`. The base published of the UR5e is what robots taken for exact give, and
its own error is not told. A light in ten views leaves five equations more than there are unknowns: sigmas are 6 to 28
mm."""
    return f"{about}\n\n{table(real.HEAD, map(real.row, result['figures']))}"


def _held_out(result: Result) -> str:
    about = f"""\
Recordings of one robot, one camera and one target, nothing stated of any noise. Held-out error of the target over
{held_out.FOLDS} folds, ours beside the best of OpenCV's seven methods in hindsight on the same folds (the median of the
ratios of {result["shuffles"]} divisions); squared Mahalanobis distance between halves, {result["halves"]} of each kind:
5.3 where covariances are true. Asked: ratios of at most {held_out.MOST_RATIO:g}, distances of at most
{held_out.MOST_M2:g}.

rct_10x10 and visp_franka_in_hand are doubted for the size of their boards, rightly: by the lengths of the arms one is
2 % smaller, as printers make it that fit a page, the other 14 % larger than stated, whatever is assumed of lens, bow
and aspect, and whichever sample is left out; the same Franka and camera see a tag of the stated size. With these
sizes the noise of the arms is a fifth, or half, of what it is with those stated."""
    return f"{about}\n\n{table(held_out.HEAD, map(held_out.row, result['rows']))}"


def _two_arms(result: Result) -> str:
    ratios = np.array([each["ratios"] for each in result["rows"]])
    about = f"""\
Two NAO humanoids. From one run with the hand still and one with the eye still, nothing stated of any noise, all three
transforms: ours from both runs together, OpenCV's by two calibrations concatenated, the best of seven methods and two
chains in hindsight. The loops of 298 further poses, with both in motion, are held out. Median of the ratios:
{np.median(ratios[:, 0]):.2f} of millimetres, {np.median(ratios[:, 1]):.2f} of degrees."""
    return f"{about}\n\n{table(two_arms.HEAD, map(two_arms.row, result['rows']))}"


def _semi_synthetic(result: Result) -> str:
    draws = max(row["draws"] for row in result["rows"])
    about = f"""\
Recordings with the poses of real ones and with their errors, dealt out anew about a known truth: does the 95 %
ellipsoid of what is asked hold it? `real`: errors of stops and of whole views as in the recording, with their tails
and with what neighbouring points have in common. `student`: what was measured scatters by Student's t of
{semi_synthetic.FREEDOMS} freedoms. `common`: by a normal, and all points of a view by as much again together. Nothing
is stated, but for `x 0.3` and `x 3`: normal errors, and sigmas so many times the true ones. Up to {draws} draws of each
kind. Asked: {100 * semi_synthetic.LEAST:g} to {100 * semi_synthetic.MOST:g} % of 300 held (of fewer as many
standard errors from 95 %); of sigmas that are not so no coverage, but the finding in
{100 * semi_synthetic.NAMED:.0f} %, and too small ones never good. The answer of rct_10x10, here the truth, has a lens
whose p1 is 3.5 sigmas from what real lenses have, by which a free lens is held. Errors that are smooth in the arms'
poses are dealt out like others and thus in no draw, while covariances keep them open, as halves of the recordings
themselves need it: where rows hold more than asked, this is why."""
    rows = (row for found in result["rows"] for row in semi_synthetic.rows(found))
    return f"{about}\n\n{table(semi_synthetic.HEAD, rows)}"


def _few_pictures(result: Result) -> str:
    low, high = few_pictures.BAND
    about = f"""\
Images of a board on one arm by a camera on another, rendered, detected and thinned to few; recorded poses of both
arms off by {1e3 * few_pictures.NOISE[0]:g} mm and {1e3 * few_pictures.NOISE[1]:g} mrad per axis and stop, nothing
stated of any noise, both mounts unknown. Asked of the base: from {few_pictures.ENOUGH} images on a mean NEES/6 in
[{low:g}, {high:g}]; with fewer the truth in the 95 % ellipsoid, or no answer, in
{few_pictures.LEAST_HELD * 40:.0f} of 40. Findings: warnings and errors, with the number of cells."""
    return f"{about}\n\n{table(few_pictures.HEAD, map(few_pictures.row, result['rows']))}"


def _calibrate(result: Result) -> str:
    about = f"""\
`calibrate` whole, in process, what images show known beforehand. The unit is the time of {calibrate.PRODUCTS} products
of a {calibrate.ROWS} x {calibrate.COLUMNS} matrix with its transpose, taken between the runs; `before` is the same
before the work was batched. Asked: {calibrate.MOST_UNITS[True]:.0f} units where there are at most
{calibrate.MOST_VIEWS} views, else {calibrate.MOST_UNITS[False]:.0f}; of ten thousand simulated samples of which
no sigma is stated {calibrate.MOST_UNITS_OF_MANY:.0f}, which is 15 s where a unit takes 8 ms.
`basecal calibrate --verbose` tells the stages."""
    return f"{about}\n\n{table(calibrate.HEAD, map(calibrate.row, result['rows']))}"


def _starts(result: Result) -> str:
    about = f"""\
{result["cells"]} simulated cells of 15 to 30 samples (0.2 px, orientations within 0.6 rad), each solved without a guess
and from the truth: do both descents end at one optimum (1e-6 m and rad)? Asked: {100 * result["target"]:.1f} %."""
    rows = []
    for of in result["kinds"]:
        rate = "" if of["rate"] is None else f"{100 * of['rate']:.2f} %"
        seeds = "" if of["kind"] == "all" else " ".join(str(seed) for _, seed in of["failing"])
        times = f"{of['median_ms']:.0f}", f"{of['slowest_ms']:.0f}"
        rows.append((of["kind"], of["same"], of["other"], of["unseen"], rate, *times, seeds))
    head = ("kind", "same", "another", "not observable", "rate", "median [ms]", "slowest [ms]", "failing seeds")
    return f"{about}\n\n{table(head, rows)}"


def _consistency(result: Result) -> str:
    count, (low, high) = result["cells"], result["band"]
    largest = f"{1e3 * consistency.SMALL_M:g} mm or {1e3 * consistency.SMALL_RAD:g} mrad"
    about = f"""\
Is the covariance true? Over the {count:,} simulated cells of a scenario, xi' C^-1 xi / 6 of the base must have mean
1: with {6 * count:,} degrees of freedom within [{low:.3f}, {high:.3f}], 3.5 standard errors to either side. Of all
cells 1 % lie beyond the 99 % point by right. All scenarios share their seeds, and so their scenes: their means are not
independent. The sigmas are stated: 0.2 px; where there is robot noise, 0.3 mm and 0.5 mrad for boards, 0.1 mm and
0.1 mrad for lights, per axis and stop. Priors: 5 mm and 0.05 rad. `benchmarks/consistency.py` has the reasons.

Beside it the root mean square of the base's errors over the cell's own (Bayesian) Cramer-Rao bound, of shifts, of
turns, and of both whitened by it: at most {consistency.MOST} is asked where a scenario is well-posed, which is said of
the bound alone: in 99 of 100 cells no sigma of it above {largest}."""
    estimated = f"""\
Sigmas that are not stated are estimated: one factor for the pixels', by the marginal likelihood the robots' (true:
0.3 mm and 0.5 mrad), these in {consistency.CELLS_OF_ROBOTS} cells at most. Theory: nu / (nu - 2), nu the degrees of
freedom of the covariance (the median cell's), which the measured mean must meet within {consistency.ERRORS} of its
standard errors."""
    tables = (
        table(consistency.HEAD, map(consistency.row, result["scenarios"])),
        table(consistency.ESTIMATED_HEAD, map(consistency.estimated_row, result["estimated"])),
    )
    return "\n\n".join([about, tables[0], estimated, tables[1]])


def _mutations(result: Result) -> str:
    cells = [c for c in result["clean"] if c["simulated"]]
    bad = sum(c["verdict"] != "good" for c in cells)
    about = f"""\
Mix-ups done to the lines of four real recordings and {len(cells)} simulated cells of various kinds. Named: a finding
holds the code and the names of what was done, or of what is exactly exchangeable with it. Harmless: the answer stays
within three of its sigmas. Asked: {100 * result["asked"]:.0f} % of the others named, and none good that moved the
answer further. Clean simulated cells not good: {bad} of {len(cells)}. The reasons: [the test](conventions_test.md)."""
    return f"{about}\n\n{table(mutations.HEAD, map(mutations.told, result['summary']))}"


def _wrong_answers(result: Result) -> str:
    rows, asked = result["rows"], result["asked"]
    cells = sum(row["cells"] for row in rows)
    passed = sum(row["good_and_wrong"] for row in rows)
    clean = [row for row in rows if row["kind"].startswith("clean")]
    good = sum(row["good"] for row in clean) / sum(row["cells"] for row in clean)
    about = f"""\
{cells} cells with more amiss than noise, up to {rows[0]["cells"]} of each kind, on seeds of their own; robots'
noise of 0.1 mm and 0.2 mrad is stated in every second one. Wrong: what was asked is outside its own 99.9 % ellipsoid.
Named first: the finding that stands first, infos of other codes apart. Asked: at most
{100 * asked["good_and_wrong"]:.0f} % good and wrong, the cause first in {100 * asked["named"]:.0f} %, clean cells good
in {100 * asked["clean"]:.0f} %. Good and wrong: {passed} of {cells}; clean cells good: {100 * good:.1f} %."""
    return f"{about}\n\n{table(wrong_answers.HEAD, map(wrong_answers.told, rows))}"


def _solve(result: Result) -> str:
    ours = result["median_ms"]["basecal"]
    rows = []
    for name, ms in sorted(result["median_ms"].items(), key=lambda item: item[1]):
        agreement = result["agreement"].get(name)
        differs = f"{agreement['cost_differs']:.0e}" if agreement else ""
        rows.append((name, f"{ms:.2f}", f"{result['least_ms'][name]:.2f}", f"{ms / ours:.2f}", differs))
    head = ("solver", "median [ms]", "least [ms]", "over ours", "cost differs by")
    faster, start = result["times_faster_than_fastest_peer"], result["start_over_solve"]
    about = f"""\
From a start near the answer to the covariance: {result["samples"]} samples of 36 points, three free mounts, all solvers
in turn, {result["repeats"]} rounds. The fastest of the others, {result["fastest_peer"]}, takes {faster:.2f} times our
time; the closed-form start takes {start:.2f} times our solve."""
    return f"{about}\n\n{table(head, rows)}"


def _batch(result: Result) -> str:
    about = f"""\
Draws of one structure solved side by side, {batch.CHUNK} at a time, with their covariance: 30 samples of 24 points, two
mounts and the base free. The difference is that of transforms [m, rad] and covariances [of their sigmas] from the
solution of the same draw by itself."""
    return f"{about}\n\n{table(batch.HEAD, map(batch.row, result['rows']))}"


def _scaling(result: Result) -> str:
    about = """\
From a start near the answer to the covariance, by the number of samples of 4 points: time of the processor, and the
most memory held at once above the packed recording. A slope of 1 in these axes is linear; with few samples the calls
themselves count, which do not grow, so that slopes are given from 1,000 samples on as well."""
    slopes = table(scaling.SLOPE_HEAD, map(scaling.slope_row, result["slopes"]))
    figure = """\
![Time over the number of samples](figures/scaling_time.svg)
![Peak memory over the number of samples](figures/scaling_memory.svg)"""
    return f"{about}\n\n{figure}\n\n{slopes}\n\n{table(scaling.HEAD, map(scaling.row, result['rows']))}"


def _detectors(result: Result) -> str:
    about = """\
Points found in rendered images of 1280 x 720 pixels beside plain OpenCV on the same images, by noise [grey levels] and
blur [px]. Error over sigma is 1 where the sigma that a detector states is true. Of lights the error is given over the
Cramer-Rao bound of the data used, one image or the pair with the light on and off."""
    corners = [
        (c["kind"], c["noise"], c["blur_px"], c["detector"], f"{c['rms_px']:.4f}", _ratio(c["ratio"]))
        for c in result["corners"]
    ]
    head = ("kind", "noise", "blur", "detector", "rms [px]", "error / sigma")
    lights = table(detectors.LIGHT_HEAD, map(detectors.light_row, result["lights"]))
    return f"{about}\n\n{table(head, corners)}\n\n{lights}"


def _peers(result: Result) -> str:
    about = f"""\
What today's practice, SciPy and ours make of the same pixels: {result["cells"]} simulated cells a row, a board of 6 x 6
corners 30 mm apart, nothing known but its shape and the lens. Errors are rms of position [mm] / rotation [mrad]. Asked:
ours smallest in every row, and from pixels {result["times"]:g} times smaller than today's practice.

- **OpenCV**: its seven methods on poses by `solvePnP` (IPPE, refined, the better of its two). For two arms its users
  calibrate twice and concatenate, as easy_handeye's FAQ answers: while the hand is still, the camera to the eye's
  flange; while the eye is still, the camera to the hand's base. The two meet at the camera or at the target: of each
  method the chain that is better in the row is shown. `default` is TSAI, which OpenCV and easy_handeye take unasked;
  `best` is the best of all in hindsight, which no user knows. With both arms moving no method of OpenCV applies.
- **SciPy**: `least_squares` on how well the same poses close the loop, translations and rotations weighed by their rms
  after a first round, from the best of OpenCV's results (where both arms move, from the truth).
- **Ours** is told the sigmas of pixels or poses, and of the robots; under "no sigma stated", nothing: it then takes
  the robots for exact, which costs more from pixels than from poses; and from poses it minimises what SciPy does. The
  last column, of 30 samples, estimates the robots' noise, as `calibrate` does from twelve stops on.
- **Predicted** is what the covariance of ours from pixels says of its errors: `best / predicted` is about the most that
  an unbiased estimate could be ahead. Robots' noise is per axis, of each recorded pose, once a stop.

An error of many metres is that of cells in one of which a method broke down; the medians are in the results."""
    return f"{about}\n\n{peers.text(result['rows'])}"


def _certificate(result: Result) -> str:
    total = sum(p["proven"] for p in result["posed"]) / sum(p["cells"] for p in result["posed"])
    about = f"""\
Views are poses; arms and views have that rotation noise per axis, stated, and 2 mm. Times are of the processor, for
30 samples. Asked: {100 * result["target"]:.0f} % of what is well posed. Proven: {100 * total:.1f} % of all of these,
{100 * result["rate"]:.1f} % of those where arms turn by {result["well_posed_rad"]:g} rad or more."""
    foes = f"""\
Cells made to deceive, half of them hand-eye and half two arms, of 4 to 15 samples. Each claim is held against a
thousand random starts of everything and a thousand more of the rotations alone. A claim is false where a start leads to
a cost that is less by more than {result["better"]:g} of it."""
    tables = (
        table(certificate.HEAD, map(certificate.row, result["posed"])),
        table(certificate.TIME_HEAD, map(certificate.time_row, result["times"])),
        table(certificate.FOE_HEAD, map(certificate.foe_row, result["foes"])),
    )
    return f"{about}\n\n{tables[0]}\n\n{tables[1]}\n\n{foes}\n\n{tables[2]}"


def _robot_model(result: Result) -> str:
    held = ", ".join(result["held_by_prior"])
    about = f"""\
{result["cells"]} cells of two arms of six axes, a board, 60 samples, 0.2 px, and joints whose zeros are off by 0.2 deg,
one sigma, drawn from the prior that the solver is told. Errors of `camera_from_target` are those at 30 configurations
that the solver has not seen, rms over the cells: {result["times_better"]:.0f} times smaller with the offsets estimated.
By their prior alone: {held}; the sigma of the base contains them:
NEES / 6 is {result["nees_over_6"]:.3f}, by chance within [0.857, 1.143]. Of the 95 % intervals of the
{result["offsets_seen"]:,} seen offsets {100 * result["coverage_95"]:.1f} % hold the truth."""
    choices = """\
The model chosen on samples left out, where robots are as stated, have offsets of 0.2 deg, or links off by 0.5 mm and
1 mrad:"""
    kinds = table(robot_model.CHOICE_HEAD, robot_model.choice_rows(result["choices"]))
    return f"{about}\n\n{table(robot_model.HEAD, robot_model.rows(result))}\n\n{choices}\n\n{kinds}"


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _outliers(result: Result) -> str:
    about = f"""\
In each of {result["cells"]} simulated cells a case 30 % of the samples, or 20 % of the points, are gross outliers: at
least 8 sigma, whitened by the noise of pixels and robots at the true state. Both: a fifth of the samples are of another
instant, and in a third of the views a tenth of the points are {outliers.BOTH_PX:.0f} px off, in
{outliers.CELLS_OF_BOTH} cells a case. The oracle is the plain solver, given the clean ones only, and estimates noise
that is not stated, too; the ratio is that of the base's rms error over the cells, ours to the oracle's, the larger of
translation and rotation. Asked over all: at most {outliers.MOST_RATIO}; {100 * outliers.LEAST_FOUND:.0f} % found; at
most {100 * outliers.MOST_LOST:.0f} % of the clean samples and of the clean points lost."""
    shared = " Other programs had the cores meanwhile, too: times are longer than those of one thread alone."
    told = about + (shared if result.get("shared") else "")
    return f"{told}\n\n{table(outliers.HEAD, map(outliers.row, result['cases']))}"


def _mutants(result: Result) -> str:
    runs = result["runs"]
    about = """\
One expression of one file changed at a time: does a test of its own room fail? Mutants are drawn from all that there
are in these packages. Asked: 90 % of those that are not equivalent. What survived was looked at one by one; where it
showed a gap a test was written, and the survivors were judged again (`--again`). Seed 11 was the first. Each later seed
was drawn when tests for those before had been written, and none for its own mutants: `killed` is by the tests as they
stood then. For most survivors of seeds 12 to 14 tests have been written since; only where it is told have these judged
them."""
    parts = [about]
    for run in runs:
        parts += [_about_run(run), table(mutants.HEAD, mutants.rows(run))]
    return "\n\n".join((*parts, table(mutants.HEAD_OF_SURVIVORS, mutants.survivors(runs))))


def _about_run(run: Result) -> str:
    judged, short = sum(run["mutants"].values()), run.get("by_own_tests_alone", 0)
    drawn = f"{judged} of {run['drawn']} drawn" if run.get("drawn", judged) > judged else f"{judged} drawn"
    left = f"; {short} that the tests of their own name left count as survived, the rest of their room not run"
    who = f"{run['judged_again']} of its survivors" if "judged_again" in run else "survivors"
    again = f"; {who} judged again at commit {run['again']}" if "again" in run else ""
    tests = f" with the tests of {run['tests']}" if "tests" in run else ""
    return f"Seed {run['seed']}, commit {run['commit']}{tests}, {drawn}{left if short else ''}{again}:"


def _bag(result: Result) -> str:
    about = """Bags of a tenth of 2 GB and of 2 GB, images of 1280 x 720 at 30 and poses at 50 a second, imported by
stops and as streams: memory is not to grow with them."""
    return f"{about}\n\n{table(bag.HEAD, result['rows'])}"


def _rolling_shutter(result: Result) -> str:
    low, high = (1e6 * side for side in result["lines_s"])
    about = f"""Moving recordings as above, by a camera whose rows are seen {low:g} to {high:g} us after one
another: the line time stated, stated with a sigma of {100 * result["prior"]:g} %, and left out. NEES/6 of the
base is to be about 1 where it is stated."""
    return f"{about}\n\n{table(rolling_shutter.HEAD, [rolling_shutter.row(n, of) for n, of in result['rows'].items()])}"


def _clocks(result: Result) -> str:
    about = f"""\
Recordings of two arms in motion, poses at 50 a second and views at five in lines of their own, the stamps of the views
off by up to {1e3 * result["offset_s"]:g} ms. The offset's 95 % interval is to hold the truth in {100 * clocks.LOW:g} to
{100 * clocks.HIGH:g} % of {clocks.ALL}, and NEES/6 of the base to be within {clocks.NEES_LOW:g} and
{clocks.NEES_HIGH:g}, the offset free."""
    return f"{about}\n\n{table(clocks.HEAD, [clocks.row(name, of) for name, of in result['rows'].items()])}"


def _live(result: Result) -> str:
    memory, cores = result["memory_mb"], result["cores"]
    about = f"""\
{result["minutes"]:g} minutes of {live.JOINTS_HZ} joint states and {live.PICTURES_HZ} images of {live.SIZE_PX[0]} x \
{live.SIZE_PX[1]} a second, sent by another process over DDS on
this computer and taken by the driver `ros2`, each with its own stamp written into it. States and images that wait
while another is taken are passed over: a capture asks for the newest. The load of the machine was {result["load"]:g} \
(both processes ran before others, at niceness {result["niceness"]}); the
driver took {cores["this"]:.2f} of a core, the sender {cores["sender"]:.2f}; memory was {memory["after_warm_up"]:g} MB \
after ten seconds, {memory["end"]:g} MB at the end and {memory["largest"]:g} MB at most."""
    return f"{about}\n\n{table(live.HEAD, result['rows'])}"


def _verify(result: Result) -> str:
    about = f"""\
Cells calibrated from {verify.CALIBRATED} simulated samples and checked with one to {verify.MOST_NEW} more. Asked: false
alarms in at most {100 * verify.MOST_ALARMS:g} %, shifts of the length that is called detectable seen in
{100 * verify.LOW:g} to {100 * verify.HIGH:g} %, what moved named first in {100 * verify.NAMED:g} % at three times that
length, with {verify.FEWEST_NAMED} samples and more. Then real recordings, halved at random: one half calibrated, the
other checked, all of it or its first {verify.MOST_NEW} samples, and again with a mount shifted by the larger of
{1e3 * verify.LEAST_SHIFT_M:g} mm and twice the detectable length.
Asked of these: as calibrated in {100 * verify.AS_CALIBRATED:g} % of {verify.SPLITTINGS}; a check that cannot tell, as
the half that was calibrated knows too little, counts as one that fails."""
    if "simulated_at" in result:
        about += f" Simulated cells were measured at commit {result['simulated_at']}."
    for at in sorted({of["commit"] for of in result["real"] if "commit" in of}):
        names = dict.fromkeys(of["recording"] for of in result["real"] if of.get("commit") == at)
        about += f" At commit {at}: {', '.join(names)}."
    rows = [verify.row(name, of) for name, of in result["rows"].items()]
    real_rows = map(verify.row_real, result["real"])
    return f"{about}\n\n{table(verify.HEAD, rows)}\n\n{table(verify.HEAD_REAL, real_rows)}"


def _study(result: Result) -> str:
    about = """\
Calibrations through `basecal study`, by the clock: cells, draws, starts, processes and the table among it. At pixel
level 30 samples of 24 points, three free mounts, with the covariance, 256 draws of a cell from one start; the paper's
closed form; OpenCV's robot-world solver on such samples."""
    return f"{about}\n\n{table(study.HEAD, map(study.row, result['rows']))}"


def _robots(result: Result) -> str:
    about = f"""\
Rings of robots, each seeing the next and the next but one: from a recording's arrays to every base and its covariance
relative to every other, robots' noise stated. Asked of 100 robots and 10,000 samples: {robots.MOST_SECONDS:g} s. NEES
is of one recording, whose bases err together."""
    slopes = ", ".join(f"{name.replace('_bytes', ' memory')} {value:.2f}" for name, value in result["slopes"].items())
    rows = map(robots.row, [*result["by_robots"], *result["by_samples"]])
    return f"{about}\n\n{table(robots.HEAD, rows)}\n\nSlopes (asked: {robots.MOST_SLOPE:g}): {slopes}."


def _ring(result: Result) -> str:
    about = """\
`basecal calibrate` of a ring of robots in a cell folder, from the files to the page: the answer, all its tests. Noise
of robots and pixels is stated, or estimated. The machine did other work beside: the time of the processor tells."""
    return f"{about}\n\n{table(ring.HEAD, map(ring.row, result['rows']))}"


def _published(result: Result) -> str:
    about = """\
Noise on all three poses of A X B = Y C Z, as in Sui and Ding 2023, beside the errors of the base printed there.
How far poses reach, and along which axes the noise is drawn, is not stated there: a guide, no test."""
    noise = f"kappa {published.LANGEVIN_KAPPA:g}, {1e3 * published.LANGEVIN_M:g} mm"
    certified = f"""\
The certified solver of A X = Y B of Wise et al. 2025 (arXiv 2507.23045): views with isotropic Langevin noise ({noise}),
robots exact. What is open: how many views there are, how poses reach, which of them bear the noise, which of the two is
called X, and whether kappa is that of exp(kappa tr R), as here, or half of it. X is the camera's mount, Y where the
target stands; `linear` is OpenCV's method of Shah on the same views, beside the linear one printed, and `their
objective` the minimum of what the certified solver minimises, on the same views: with this noise the likelihood.

By how much any solver beats the linear one depends on how far arms turn. Of arms that turn far the linear method has
the target's rotation nearly as well as the views hold it, and no solver gains much; of arms that turn by
{published.TURNS_RAD[-1]:g} rad both ratios are below those printed."""
    tables = (
        table(published.HEAD, map(published.row, result["rows"])),
        certified,
        table(published.CERTIFIED_HEAD, map(published.certified_row, result["certified"])),
    )
    return "\n\n".join([about, *tables])


def _cluster(result: Result) -> str:
    first, dead = result["rows"][0], result["killed"]
    trials, least = f"{result['trials']:,}", f"{cluster.MOST_BYTES / 2**30:g} GiB"
    share = f"{cluster.MOST_OVERHEAD:.0%}"
    about = f"""\
A study of {trials} trials by processes of this machine and by local Dask workers in turn, each from nothing to all
its chunks on the disk. The machine did other work beside: the time of the processor, of all who work and of who asks,
is what to compare. Asked: Dask at most {share} more than processes, and at most {least}. Numbers are those of the
table but for times, to the last digit."""
    many = result["many"]
    held = f"{result['many_trials']:,} trials by one process hold at most {many['peak_bytes'] / 1e6:.0f} MB."
    killed = f"""\
Of {result["killed_trials"]:,} trials, one who works is killed midway (`kill -9`), or the whole command, which is then
started again."""
    ways = table(cluster.HEAD, [cluster.row(each, first) for each in result["rows"]])
    deaths = table(cluster.KILLED_HEAD, [cluster.killed_row(each, dead[0]) for each in dead])
    return "\n\n".join([about, ways, held, killed, deaths])


SECTIONS: dict[str, tuple[str, Callable[[Result], str]]] = {
    "held_out": ("Held-out error on real recordings", _held_out),
    "two_arms": ("Held-out loops of two real arms", _two_arms),
    "semi_synthetic": ("Truth put into real recordings", _semi_synthetic),
    "few_pictures": ("Few images", _few_pictures),
    "real": ("Real recordings", _real),
    "widths": ("What makes the width of a sigma", widths.section),
    "calibrate": ("Time of the whole command", _calibrate),
    "starts": ("Starts without a guess", _starts),
    "consistency": ("Consistency", _consistency),
    "robot_model": ("Robots whose joints are off", _robot_model),
    "outliers": ("Outliers", _outliers),
    "mutations": ("Conventions mixed up", _mutations),
    "wrong_answers": ("Answers that are wrong and look good", _wrong_answers),
    "false_alarms": ("Clean cells in which a rule finds something", false_alarms.section),
    "trouble": ("Cells with one trouble each", trouble.section),
    "clean_kinds": ("Clean recordings of ten kinds", clean_kinds.section),
    "stated_numbers": ("Stated numbers", stated_numbers.section),
    "confounding": ("Effects that move the data alike", confounding.section),
    "sag": ("Sag", sag.section),
    "arrays": ("Arrays of poses", arrays.section),
    "journeys": ("Newcomers with what they have", journeys.section),
    "slips": ("Slips", trial.section),
    "target_poses": ("Poses of targets by PnP", target_poses.section),
    "touch": ("Touches", touch.section),
    "capture": ("Captures", capture.section),
    "stops": ("Arms that are told to stop", stops.section),
    "scene": ("A scene without a target", scene.section),
    "scene_recordings": ("A scene in place of a board", scene_recordings.section),
    "running_check": ("The running check of a capture", running_check.section),
    "arm_errors": ("Errors of arms that can be told", arm_errors.section),
    "capture_pictures": ("Images of captures", capture_pictures.section),
    "pictures_and_poses": ("Images and their poses", pictures_and_poses.section),
    "blurred_views": ("Blurred views", blurred_views.section),
    "clocks": ("Clocks", _clocks),
    "rolling_shutter": ("Rolling shutters", _rolling_shutter),
    "bag": ("Bags", _bag),
    "verify": ("Whether anything has moved", _verify),
    "live": ("A running ROS 2", _live),
    "plan": ("Planned samples", plan.section),
    "stopping": ("Samples that a goal needs", stopping.section),
    "error_map": ("The map of errors", error_map.section),
    "meeting": ("Meetings", meeting.section),
    "local_fits": ("Local or global", local_fits.section),
    "page": ("Pages in a browser", page.section),
    "solve": ("Speed beside other solvers", _solve),
    "batch": ("Calibrations a second", _batch),
    "study": ("Studies", _study),
    "ring": ("A ring of robots, the whole command", _ring),
    "cluster": ("Studies on a cluster", _cluster),
    "scaling": ("Time and memory", _scaling),
    "robots": ("Many robots", _robots),
    "detectors": ("Detectors beside OpenCV", _detectors),
    "peers": ("Errors beside today's practice", _peers),
    "published": ("Errors beside published ones", _published),
    "certificate": ("Certificate", _certificate),
    "mutants": ("Faults that tests find", _mutants),
}


def _machine(result: Result) -> str:
    on = result["machine"]
    return f"{on['cpu']}, {on['cores']} cores, Python {on['python']}, NumPy {on['numpy']}"


def _section(name: str) -> str:
    title, write = SECTIONS[name]
    path = RESULTS / f"{name}.json"
    command = f"    python -m benchmarks.{name}"
    if not path.exists():
        return f"## {title}\n\n{command}\n\nNot run yet.\n"
    result = json.loads(path.read_text(encoding="utf-8"))
    when = f"commit {result['commit']}" if result.get("commit") else "before solver and noise model were written anew"
    return f"## {title}\n\n{command}\n\n{write(result)}\n\nMeasured on: {_machine(result)}; {when}.\n"


def page() -> str:
    """The text of docs/benchmarks.md."""
    return "\n".join([INTRODUCTION, *map(_section, SECTIONS)])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"written: {PAGE.name}")

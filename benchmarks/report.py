"""Generate docs/benchmarks.md from results/*.json, so that every number comes from a command."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tests.shared import machine_unit as unit

from benchmarks import (
    arm_errors,
    arrays,
    bag,
    batch,
    blurred_views,
    calibrate,
    capture,
    capture_images,
    certificate,
    clean_kinds,
    clocks,
    cluster,
    confounding,
    consistency,
    detectors,
    error_map,
    false_alarms,
    few_images,
    held_out,
    images_and_poses,
    journeys,
    live,
    local_fits,
    meeting,
    mutants,
    mutations,
    outliers,
    page,
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
from benchmarks.common import RESULTS, label, table
from benchmarks.peers import tables as peers
from benchmarks.slips import trial

PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
COLUMNS = 120
_NO_BREAK = "\xa0"

Result = dict[str, Any]

INTRODUCTION = """\
---
search: {exclude: true}
---

# Benchmarks

Each section begins with the command that measured its numbers. `make bench` runs all of them, and
`python -m benchmarks.report` makes this page from their results. Times are of one thread, or of the processes that a
table counts, on the machine named.
"""


def _real(result: Result) -> str:
    about = """\
What is required of each recording, and what is measured without a guess. Of a board only its shape is known. With one
corner as an LED the lens is known, too, from the whole board. A loop is `(A X B).inverse() @ Y C Z`, with B from the
view alone. The UR5e and RCT recordings ship in `examples/`.

The published base of the UR5e is the result of robots assumed exact, and its own error is not stated. An LED in ten
views gives five equations more than there are unknowns, and sigmas of 6 to 28 mm."""
    return f"{about}\n\n{table(real.HEAD, map(real.row, result['figures']))}"


def _held_out(result: Result) -> str:
    about = f"""\
Recordings of one robot, one camera and one target, with no noise stated. The held-out error of the target over
{held_out.FOLDS} folds is compared with the best of OpenCV's seven methods in hindsight, on the same folds. Each ratio
is the median over {result["shuffles"]} divisions into folds. The columns of halves give the squared Mahalanobis
distance between the mounts from two halves, the median over {result["halves"]} divisions of each kind. It is 5.3 if
the covariances are true. Blocked halves are divided by the place of the flange. Required: ratios of at most
{held_out.MOST_RATIO:g} and distances of at most {held_out.MOST_M2:g}.

rct_10x10 and visp_franka_in_hand are doubtful because of the sizes of their boards. These sizes are indeed wrong. By
the lengths of the arms, the first board is 2 % smaller than stated, as if a printer had fitted it to a page. The
second is 14 % larger than stated. This holds for every assumption on lens, bow and aspect, and for every sample left
out. The same Franka and camera see a tag of the stated size. With the estimated sizes the noise of the arms is a
fifth, or half, of the noise with the stated sizes."""
    return f"{about}\n\n{table(held_out.HEAD, map(held_out.row, result['rows']))}"


def _two_arms(result: Result) -> str:
    ratios = np.array([each["ratios"] for each in result["rows"]])
    about = f"""\
Two NAO humanoids. All three transforms are calibrated from one run with the hand still and one with the eye still, with
no noise stated. Ours uses both runs together. OpenCV's is two calibrations concatenated, the best of seven methods and
two chains in hindsight. The loops of 298 further poses, with both arms in motion, are held out. Median of the ratios:
{np.median(ratios[:, 0]):.2f} of millimetres, {np.median(ratios[:, 1]):.2f} of degrees."""
    return f"{about}\n\n{table(two_arms.HEAD, map(two_arms.row, result['rows']))}"


def _semi_synthetic(result: Result) -> str:
    draws = max(row["draws"] for row in result["rows"])
    about = f"""\
Recordings have the poses of real ones, and their errors are resampled about a known truth. Does the 95 % ellipsoid of
each requested transform contain this truth? The kinds of errors are:

- `real`: errors of stops and of whole views as in the recording, with their tails and the correlation of neighbouring
  points.
- `student`: measurements scatter by Student's t with {semi_synthetic.FREEDOMS} degrees of freedom.
- `common`: measurements scatter normally, and all points of a view share a further error of the same size.
- `x 0.3` and `x 3`: normal errors, and stated sigmas that are so many times the true ones.

The other kinds state no sigma. There are up to {draws} draws of each kind. Required: the ellipsoids of
{100 * semi_synthetic.LEAST_HELD:g} to {100 * semi_synthetic.MOST_HELD:g} % of 300 draws contain the truth, for every
transform of the recording. For fewer draws the limits are as many standard errors from 95 %. Wrong sigmas need
no coverage, but `poor-fit` in {100 * semi_synthetic.LEAST_NAMED:.0f} % of draws; with too small ones no draw may be
good.

The truth of rct_10x10 is its own answer. The p1 of its lens is 3.5 sigmas from zero in the prior of real lenses,
which constrains a free lens. Errors that are smooth in the arms' poses are resampled like others, so that no draw
contains them. The covariances allow for them, because the halves of the recordings require it. Rows that hold more
than required do so for this reason."""
    rows = (row for found in result["rows"] for row in semi_synthetic.rows(found))
    return f"{about}\n\n{table(semi_synthetic.HEAD, rows)}"


def _few_images(result: Result) -> str:
    low, high = few_images.BAND
    about = f"""\
A camera on one arm takes images of a board on another. The images are rendered, the board is detected, and all but a
few images are left out. The recorded poses of both arms have errors of {1e3 * few_images.NOISE[0]:g} mm and
{1e3 * few_images.NOISE[1]:g} mrad per axis and stop. No noise is stated, and both mounts are unknown. Required of
the base from {few_images.FEWEST_FOR_BAND} images on: a mean NEES/6 in [{low:g}, {high:g}]. Required with fewer images:
the truth in the 95 % ellipsoid, or no answer, in {few_images.LEAST_HELD * 40:.0f} of 40 cells. Findings are warnings
and errors, with the number of cells."""
    return f"{about}\n\n{table(few_images.HEAD, map(few_images.row, result['rows']))}"


def _calibrate(result: Result) -> str:
    about = f"""\
CPU time of the whole `calibrate`, in process, with the detections of images known beforehand. The unit is the time of
{unit.PRODUCTS} products of a {unit.ROWS} x {unit.COLUMNS} matrix with its transpose, measured between
the runs. `before` is the number of units before the work was batched. Required for at most a hundred
views: at most {calibrate.MOST_UNITS:.0f} units; of the larger recordings as stated. Ten thousand simulated samples
without any stated sigma may take {calibrate.MOST_UNITS_OF[calibrate.SIMULATED_NAME]:.0f} units, which is 15 s if a unit
takes 8 ms. `basecal calibrate --verbose` prints the
stages."""
    return f"{about}\n\n{table(calibrate.HEAD, map(calibrate.row, result['rows']))}"


def _starts(result: Result) -> str:
    about = f"""\
{result["cells"]} simulated cells of 15 to 30 samples (0.2 px, orientations within 0.6 rad) are each solved without a
guess and from the truth. Do both descents end at the same optimum (1e-6 m and rad)? Required:
{100 * result["target"]:.1f} %."""
    rows = []
    for of in result["kinds"]:
        rate = "" if of["rate"] is None else f"{100 * of['rate']:.2f} %"
        seeds = "" if of["kind"] == "all" else " ".join(str(seed) for _, seed in of["failing"])
        times = f"{of['median_ms']:.0f}", f"{of['slowest_ms']:.0f}"
        rows.append((label(of["kind"]), of["same"], of["other"], of["unseen"], rate, *times, seeds))
    head = ("kind", "same", "another", "unobservable", "rate", "median [ms]", "slowest [ms]", "failing seeds")
    return f"{about}\n\n{table(head, rows)}"


def _consistency(result: Result) -> str:
    count, (low, high) = result["cells"], result["band"]
    largest = f"{1e3 * consistency.SMALL_M:g} mm or {1e3 * consistency.SMALL_RAD:g} mrad"
    about = f"""\
Is the covariance true? Then xi' C^-1 xi / 6 of the base has the mean 1 over the {count:,} simulated cells of a
scenario. With {6 * count:,} degrees of freedom the mean must be within [{low:.3f}, {high:.3f}], 3.5 standard errors to
either side. By chance 1 % of all cells are beyond the 99 % point. All scenarios share their seeds, and so their
scenes: their means are not independent.

The sigma of pixels is stated as 0.2 px. Robot noise is stated per axis and stop: 0.3 mm and 0.5 mrad with boards and
tags, 0.1 mm and 0.1 mrad with LEDs. Priors have sigmas of 5 mm and 0.05 rad. `benchmarks/consistency.py` gives the
reasons.

Three columns give the root mean square of the base's errors over the cell's own (Bayesian) Cramer-Rao bound. They are
of translations, of rotations, and of both whitened by the bound. Required: at most {consistency.MOST} if the scenario
is well-posed. A scenario is well-posed if in 99 of 100 cells no sigma of the bound is above {largest}. Only the bound
decides this."""
    estimated = f"""\
Unstated sigmas are estimated: those of pixels by one factor, those of robots by the marginal likelihood (true: 0.3 mm
and 0.5 mrad). Scenarios that estimate robots' sigmas have at most {consistency.CELLS_OF_ROBOTS} cells. `theory` is nu
/ (nu - 2), with nu the degrees of freedom of the covariance in the median cell. Required: the measured mean is within
{consistency.ERRORS} of its standard errors from `theory`."""
    tables = (
        table(consistency.HEAD, map(consistency.row, result["scenarios"])),
        table(consistency.ESTIMATED_HEAD, map(consistency.estimated_row, result["estimated"])),
    )
    return "\n\n".join([about, tables[0], estimated, tables[1]])


def _mutations(result: Result) -> str:
    cells = [c for c in result["clean"] if c["simulated"]]
    bad = sum(c["verdict"] != "good" for c in cells)
    about = f"""\
Mix-ups are applied to the lines of four real recordings and of {len(cells)} simulated cells of various kinds. A
mix-up is named if a finding has its code and its names, or those of an exactly exchangeable mix-up. It is harmless if
the answer stays within three of its sigmas. Required: {100 * result["asked"]:.0f} % of the others are named, and none
that moves the answer further is good. Clean simulated cells that are not good: {bad} of {len(cells)}. The page on
[the test](conventions_test.md) gives the reasons."""
    return f"{about}\n\n{table(mutations.HEAD, map(mutations.row, result['summary']))}"


def _wrong_answers(result: Result) -> str:
    rows, asked = result["rows"], result["asked"]
    cells = sum(row["cells"] for row in rows)
    passed = sum(row["good_and_wrong"] for row in rows)
    clean = [row for row in rows if row["kind"].startswith("clean")]
    good = sum(row["good"] for row in clean) / sum(row["cells"] for row in clean)
    about = f"""\
{cells} cells, up to {rows[0]["cells"]} of each kind, with seeds of their own. Clean cells have noise alone; all others
have a further error. Robots' noise of 0.1 mm and 0.2 mrad is stated in every second cell. An answer is wrong if a
requested transform is outside its own 99.9 % ellipsoid. `named first` counts cells whose first finding has the code of
the row, without infos of other codes. Required:

- at most {100 * asked["good_and_wrong"]:.0f} % good and wrong: {passed} of {cells} are;
- the cause named first in {100 * asked["named"]:.0f} %: see the table;
- clean cells good in {100 * asked["clean"]:.0f} %: {100 * good:.1f} % are."""
    return f"{about}\n\n{table(wrong_answers.HEAD, map(wrong_answers.row, rows))}"


def _solve(result: Result) -> str:
    ours = result["median_ms"]["basecal"]
    rows = []
    for name, ms in sorted(result["median_ms"].items(), key=lambda item: item[1]):
        agreement = result["agreement"].get(name)
        differs = f"{agreement['cost_differs']:.0e}" if agreement else ""
        rows.append((name, f"{ms:.2f}", f"{result['least_ms'][name]:.2f}", f"{ms / ours:.2f}", differs))
    head = ("solver", "median [ms]", "least [ms]", "over ours", "difference in cost")
    faster, start = result["times_faster_than_fastest_peer"], result["start_over_solve"]
    about = f"""\
Time from a start near the answer to the covariance, for {result["samples"]} samples of 36 points and three free mounts.
All solvers run in turn, in {result["repeats"]} rounds. The fastest of the others, {result["fastest_peer"]}, takes
{faster:.2f} times our time. The closed-form start takes {start:.2f} times our solve."""
    return f"{about}\n\n{table(head, rows)}"


def _batch(result: Result) -> str:
    about = f"""\
Draws of one structure are solved side by side, {batch.CHUNK} at a time, with their covariance. Each has 30 samples of
24 points, with two mounts and the base free. The last column is the largest difference from a separate solution of
the same draw, in transforms [m, rad] and covariances [of their sigmas]."""
    return f"{about}\n\n{table(batch.HEAD, map(batch.row, result['rows']))}"


def _scaling(result: Result) -> str:
    about = """\
CPU time and peak memory from a start near the answer to the covariance, by the number of samples of 4 points. The
memory is what is held at once beyond the packed recording. A slope of 1 in these axes is linear. With few samples the
constant time of the calls counts. Slopes are therefore also given from 1,000 samples on."""
    slopes = table(scaling.SLOPE_HEAD, map(scaling.slope_row, result["slopes"]))
    figure = """\
![Time over the number of samples](figures/scaling_time.svg)
![Peak memory over the number of samples](figures/scaling_memory.svg)"""
    return f"{about}\n\n{figure}\n\n{slopes}\n\n{table(scaling.HEAD, map(scaling.row, result['rows']))}"


def _detectors(result: Result) -> str:
    about = """\
Points found in rendered images of 1280 x 720 pixels, compared with plain OpenCV on the same images, by noise [grey
levels] and blur [px]. Error over sigma is 1 if the sigma that a detector states is true. For LEDs the error is given
over the Cramer-Rao bound of the data used: one image, or the pair with the LED on and off."""
    corners = [
        (c["kind"], c["noise"], c["blur_px"], c["detector"], f"{c['rms_px']:.4f}", _ratio(c["ratio"]))
        for c in result["corners"]
    ]
    head = ("kind", "noise", "blur", "detector", "rms [px]", "error / sigma")
    lights = table(detectors.LIGHT_HEAD, map(detectors.light_row, result["lights"]))
    return f"{about}\n\n{table(head, corners)}\n\n{lights}"


def _peers(result: Result) -> str:
    about = f"""\
Errors of today's practice, of SciPy and of ours from the same pixels. A row is {result["cells"]} simulated cells with
a board of 6 x 6 corners 30 mm apart. Only the shape of the board and the lens are known. Errors are rms of position
[mm] / rotation [mrad]. Required: ours smallest in every row, and from pixels {result["times"]:g} times smaller than
today's practice.

- **OpenCV**: its seven methods on poses by `solvePnP` (IPPE, refined, the better of its two). For two arms its users
  calibrate twice and concatenate, as the FAQ of easy_handeye advises. While the hand is still they calibrate the
  camera to the eye's flange. While the eye is still they calibrate the camera to the hand's base. The two meet at the
  camera or at the target. The table shows the better chain of each method in the row. `default` is TSAI, the default
  of OpenCV and of easy_handeye. `best` is the best of all in hindsight, which no user knows. If both arms move, no
  method of OpenCV applies.
- **SciPy**: `least_squares` on how well the same poses close the loop. Translations and rotations are weighted by
  their rms after a first round. It starts from the best of OpenCV's results, or from the truth if both arms move.
- **Ours** is given the sigmas of pixels or poses, and of the robots. Under "no sigma stated" it is given none and
  assumes the robots exact. This costs more from pixels than from poses. From poses it then minimises what SciPy does.
  The last column, of 30 samples, estimates the robots' noise, as `calibrate` does from twelve stops on.
- **Predicted** is the error that the covariance of ours from pixels predicts. `best / predicted` is about the largest
  possible lead of an unbiased estimate. Robots' noise is per axis, of each recorded pose, once a stop.

An error of many metres is that of cells in one of which a method broke down. The results hold the medians."""
    return f"{about}\n\n{peers.text(result['rows'])}"


def _certificate(result: Result) -> str:
    total = sum(p["proven"] for p in result["posed"]) / sum(p["cells"] for p in result["posed"])
    about = f"""\
Views are poses. The noise of arms and views is stated: the rotation noise of the table and 2 mm, per axis. The first
table gives CPU times for 30 samples. Required: {100 * result["target"]:.0f} % of the well-posed cells proven. Proven:
{100 * total:.1f} % of all cells of the table, and {100 * result["rate"]:.1f} % of those whose arms rotate by
{result["well_posed_rad"]:g} rad or more."""
    foes = f"""\
Adversarial cells have 4 to 15 samples; half are hand-eye and half two arms. Each claim is tested by a thousand random
starts of all unknowns, which the table counts, and by a thousand more of the rotations alone. A claim is false if a
start leads to a cost that is lower by more than {result["better"]:g} of it."""
    tables = (
        table(certificate.HEAD, map(certificate.row, result["posed"])),
        table(certificate.TIME_HEAD, map(certificate.time_row, result["times"])),
        table(certificate.ADVERSARIAL_HEAD, map(certificate.adversarial_row, result["foes"])),
    )
    return f"{about}\n\n{tables[0]}\n\n{tables[1]}\n\n{foes}\n\n{tables[2]}"


def _robot_model(result: Result) -> str:
    held = ", ".join(result["held_by_prior"])
    about = f"""\
{result["cells"]} cells have two arms of six axes, a board, 60 samples and 0.2 px. The joint offsets have a sigma of
0.2 deg, and are drawn from the prior that the solver is given. Errors of `camera_from_target` are those at 30
configurations that the solver has not seen, rms over the cells. They are {result["times_better"]:.0f} times smaller
with the offsets estimated.

Offsets constrained by their prior alone: {held}. The sigma of the base contains them: NEES / 6 is
{result["nees_over_6"]:.3f}, by chance within [0.857, 1.143]. Of the 95 % intervals of the {result["offsets_seen"]:,}
observable offsets {100 * result["coverage_95"]:.1f} % hold the truth."""
    choices = """\
The robot model is chosen by samples left out. The true robots are as stated, or have offsets of 0.2 deg, or links off
by 0.5 mm and 1 mrad. The columns count the models chosen."""
    kinds = table(robot_model.CHOICE_HEAD, robot_model.choice_rows(result["choices"]))
    return f"{about}\n\n{table(robot_model.HEAD, robot_model.rows(result))}\n\n{choices}\n\n{kinds}"


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _outliers(result: Result) -> str:
    about = f"""\
In {result["cells"]} simulated cells a case, 30 % of the samples or 20 % of the points are gross outliers. Gross is at
least 8 sigma, whitened by the noise of pixels and robots at the true state. The cases `both` have
{outliers.CELLS_OF_BOTH} cells. In these a fifth of the samples are of another instant. In a third of the views a tenth
of the points are {outliers.BOTH_PX:.0f} px off as well.

The oracle is the plain solver, which is given only the clean data and estimates unstated noise, too. The ratio is
that of the base's rms error over the cells, ours to the oracle's, the larger of translation and rotation. Required
over all cases:

- a ratio of at most {outliers.MOST_RATIO};
- {100 * outliers.LEAST_FOUND:.0f} % of the outliers found;
- at most {100 * outliers.MOST_LOST:.0f} % of the clean samples and of the clean points lost."""
    shared = (
        "\n\nOther programs used the cores at the same time, so that times are longer than those of one thread alone."
    )
    told = about + (shared if result.get("shared") else "")
    return f"{told}\n\n{table(outliers.HEAD, map(outliers.row, result['cases']))}"


def _mutants(result: Result) -> str:
    runs = result["runs"]
    about = """\
One expression of one file is changed at a time. Does a test fail in the test folder that mirrors the folder of the
file? Mutants are drawn from all possible ones in these packages. Required: 90 % of the mutants that are not equivalent
are killed. Each survivor was inspected. If it showed a gap, a test was written, and the survivors were judged again
(`--again`). `by all tests` adds those that tests of other folders kill, within a minute of the processor each
(`--elsewhere`).

Seed 11 was the first. Each later seed was drawn when tests for the earlier ones had been written, and none for its own
mutants. `killed` is the count by the tests of that time. For most survivors of seeds 12 to 14 tests have been written
since. These tests have judged them only if the line above the table says so."""
    parts = [about]
    for run in runs:
        parts += [_about_run(run), table(mutants.HEAD, mutants.rows(run))]
    return "\n\n".join((*parts, table(mutants.HEAD_OF_SURVIVORS, mutants.survivors(runs))))


def _about_run(run: Result) -> str:
    judged, short = sum(run["mutants"].values()), run.get("by_own_tests_alone", 0)
    drawn = f"{judged} of {run['drawn']} drawn" if run.get("drawn", judged) > judged else f"{judged} drawn"
    left = f" {short} were judged by the tests under the name of their file alone, and count as survivors."
    who = f"{run['judged_again']} of its survivors" if "judged_again" in run else "The survivors"
    again = f" {who} were judged again at commit {run['again']}." if "again" in run else ""
    tests = f" with the tests of {run['tests']}" if "tests" in run else ""
    return f"Seed {run['seed']}, commit {run['commit']}{tests}: {drawn}.{left if short else ''}{again}"


def _bag(result: Result) -> str:
    about = f"""\
Bags of {bag.SHORT_SHARE * bag.GIGABYTES:g} GB and of {bag.GIGABYTES:g} GB hold 30 images of 1280 x 720 and 50 poses a
second. They are imported by stops and as streams. Required: the memory does not grow with the bag."""
    return f"{about}\n\n{table(bag.HEAD, result['rows'])}"


def _rolling_shutter(result: Result) -> str:
    low, high = (1e6 * side for side in result["lines_s"])
    about = f"""\
Recordings in motion as in the section before, by a camera whose rows are exposed {low:g} to {high:g} us one after the
other. The line time is stated exactly, stated with a sigma of {100 * result["prior"]:g} %, or left out. Required:
NEES/6 of the base is about 1 if the line time is stated."""
    return f"{about}\n\n{table(rolling_shutter.HEAD, [rolling_shutter.row(n, of) for n, of in result['rows'].items()])}"


def _clocks(result: Result) -> str:
    about = f"""\
Recordings of two arms in motion, with 50 poses and five views a second in lines of their own. The stamps of the views
are off by up to {1e3 * result["offset_s"]:g} ms, and the offset is free. Required:

- the 95 % interval of the offset holds the truth in {100 * clocks.LOW:g} to {100 * clocks.HIGH:g} % of {clocks.ALL}
  recordings;
- NEES/6 of the base is between {clocks.NEES_LOW:g} and {clocks.NEES_HIGH:g}. It is less where the covariance contains
  errors that these arms have not.

The time from row to row of the camera is open too. The offset is that of its first row, and its sigma contains this."""
    return f"{about}\n\n{table(clocks.HEAD, [clocks.row(name, of) for name, of in result['rows'].items()])}"


def _live(result: Result) -> str:
    memory, cores = result["memory_mb"], result["cores"]
    about = f"""\
For {result["minutes"]:g} minutes another process sends {live.JOINTS_HZ} joint states and {live.IMAGES_HZ} images of
{live.SIZE_PX[0]} x {live.SIZE_PX[1]} a second over DDS on this computer. Each has its own stamp written into it. The
driver `ros2` takes them. States and images that wait while another is taken are skipped, since a capture requests the
newest.

The load of the machine was {result["load"]:g}, and both processes ran at niceness {result["niceness"]}, before
others. The driver took {cores["this"]:.2f} of a core, and the sender {cores["sender"]:.2f}. The memory was
{memory["after_warm_up"]:g} MB after ten seconds, {memory["end"]:g} MB at the end and {memory["largest"]:g} MB at
most."""
    return f"{about}\n\n{table(live.HEAD, ((label(name), *counts) for name, *counts in result['rows']))}"


def _verify(result: Result) -> str:
    about = f"""\
Cells are calibrated from {verify.CALIBRATED} simulated samples and checked with one to {verify.MOST_NEW} more.
Required:

- false alarms in at most {100 * verify.MOST_ALARMS:g} %;
- shifts of the length that is reported as detectable seen in {100 * verify.LOW:g} to {100 * verify.HIGH:g} %;
- the moved part named first in {100 * verify.LEAST_NAMED:g} % at three times that length, with {verify.FEWEST_NAMED}
  samples and more.

Real recordings are divided at random into halves. One half is calibrated. The other is checked, all of it or its first
{verify.MOST_NEW} samples. The check is repeated with a mount shifted by the larger of {1e3 * verify.LEAST_SHIFT_M:g} mm
and twice the detectable length. Required: {100 * verify.LEAST_UNCHANGED:g} % of the checks report no change, in up to
{verify.SPLITTINGS} divisions a recording. A check is undecided if the calibrated half determines too little. It then
counts as failed."""
    if "simulated_at" in result:
        about += f" Simulated cells were measured at commit {result['simulated_at']}."
    for at in sorted({of["commit"] for of in result["real"] if "commit" in of}):
        names = dict.fromkeys(of["recording"] for of in result["real"] if of.get("commit") == at)
        about += f" Measured at commit {at}: {', '.join(names)}."
    rows = [verify.row(name, of) for name, of in result["rows"].items()]
    real_rows = map(verify.row_real, result["real"])
    return f"{about}\n\n{table(verify.HEAD, rows)}\n\n{table(verify.HEAD_REAL, real_rows)}"


def _study(result: Result) -> str:
    about = """\
Calibrations a second through `basecal study`, by wall time, with cells, draws, starts, processes and the table:

- `maximum_likelihood`: 30 samples of 24 points, three free mounts, with the covariance, and 256 draws of a cell from
  one start.
- `closed_form`: the closed form of the paper.
- `opencv`: OpenCV's robot-world solver on 30 samples of 24 points."""
    return f"{about}\n\n{table(study.HEAD, map(study.row, result['rows']))}"


def _robots(result: Result) -> str:
    about = f"""\
Rings of robots, each seeing the next and the next but one, with the robots' noise stated. Times are from the arrays
of a recording to every base and its covariance relative to every other. Required for 100 robots and 10,000 samples:
at most {robots.MOST_SECONDS:g} s. NEES is of one recording, in which the errors of the bases are correlated."""
    slopes = ", ".join(f"{name.replace('_bytes', ' memory')} {value:.2f}" for name, value in result["slopes"].items())
    rows = map(robots.row, [*result["by_robots"], *result["by_samples"]])
    return f"{about}\n\n{table(robots.HEAD, rows)}\n\nSlopes (required: at most {robots.MOST_SLOPE:g}): {slopes}."


def _ring(result: Result) -> str:
    about = """\
`basecal calibrate` of a ring of robots in a cell folder, from the files to the page, with the answer and all its tests.
Noise of robots and pixels is stated, or estimated. The machine also did other work, so that CPU time is what counts."""
    return f"{about}\n\n{table(ring.HEAD, map(ring.row, result['rows']))}"


def _published(result: Result) -> str:
    about = """\
All three poses of A X B = Y C Z have noise, as in Sui and Ding 2023. The table compares the errors of the base with
those published there. The paper does not state how far the poses reach, and along which axes the noise is drawn. The
comparison is a guide, not a test."""
    noise, small = f"kappa {published.LANGEVIN_KAPPA:g}, {1e3 * published.LANGEVIN_M:g} mm", published.TURNS_RAD[-1]
    below = [published.beats_published(of) for of in result["certified"] if of["turn_rad"] == small]
    certified = f"""\
The certified solver of A X = Y B of Wise et al. 2025 (arXiv 2507.23045): here views have isotropic Langevin noise
({noise}), and robots are exact. Of its protocol these points are not known:

- how many views there are, how far the poses reach, and which of them have the noise;
- which of the two transforms is called X;
- whether kappa is that of exp(kappa tr R), as here, or half of it.

X is the mount of the camera, and Y the pose of the target. `linear` is OpenCV's method of Shah on the same views, to
compare with the published linear one (`its linear`). `their objective` is the minimum of the certified solver's
objective on the same views. With this noise that objective is the likelihood.

How far any solver beats the linear one depends on how far the arms rotate. If they rotate far, the linear method gives
the target's rotation nearly as well as the views allow, and no solver gains much. If they rotate by up to
{small:g} rad, both ratios are below the published ones in {sum(below)} of {len(below)} rows."""
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
A study of {trials} trials is run by processes of this machine and by local Dask workers in turn. Each run begins with
nothing and ends with all chunks on the disk. The machine also did other work, so that CPU times are to be compared,
those of all workers and of the client. Required: Dask takes at most {share} more than processes, and at most {least}.
`numbers` compares the results to the last digit, except for times."""
    many = result["many"]
    held = f"{result['many_trials']:,} trials by one process need at most {many['peak_bytes'] / 1e6:.0f} MB of memory."
    killed = f"""\
In a study of {result["killed_trials"]:,} trials a worker is killed midway (`kill -9`), or the whole command, which is
then started again."""
    ways = table(cluster.HEAD, [cluster.row(each, first) for each in result["rows"]])
    deaths = table(cluster.KILLED_HEAD, [cluster.killed_row(each, dead[0]) for each in dead])
    return "\n\n".join([about, ways, held, killed, deaths])


SECTIONS: dict[str, tuple[str, Callable[[Result], str]]] = {
    "held_out": ("Held-out error on real recordings", _held_out),
    "two_arms": ("Held-out loops of two real arms", _two_arms),
    "semi_synthetic": ("Semi-synthetic recordings", _semi_synthetic),
    "few_images": ("Few images", _few_images),
    "real": ("Real recordings", _real),
    "widths": ("Contributions to the sigmas", widths.section),
    "calibrate": ("Time of the whole command", _calibrate),
    "starts": ("Starts without a guess", _starts),
    "consistency": ("Consistency", _consistency),
    "robot_model": ("Robots with joint offsets", _robot_model),
    "outliers": ("Outliers", _outliers),
    "mutations": ("Mixed-up conventions", _mutations),
    "wrong_answers": ("Wrong answers that are called good", _wrong_answers),
    "false_alarms": ("False alarms in clean cells", false_alarms.section),
    "trouble": ("Cells with one error each", trouble.section),
    "clean_kinds": ("Clean recordings of ten kinds", clean_kinds.section),
    "stated_numbers": ("Stated numbers", stated_numbers.section),
    "confounding": ("Confounded effects", confounding.section),
    "sag": ("Sag", sag.section),
    "arrays": ("Arrays of poses", arrays.section),
    "journeys": ("First-time users", journeys.section),
    "slips": ("Slips", trial.section),
    "target_poses": ("Target poses by PnP", target_poses.section),
    "touch": ("Touches", touch.section),
    "capture": ("Captures", capture.section),
    "stops": ("Stops of the other arm after a fault", stops.section),
    "scene": ("A scene without a target", scene.section),
    "scene_recordings": ("A scene in place of a board", scene_recordings.section),
    "running_check": ("The running check of a capture", running_check.section),
    "arm_errors": ("Detectable errors of arms", arm_errors.section),
    "capture_images": ("Images of captures", capture_images.section),
    "images_and_poses": ("Images and their poses", images_and_poses.section),
    "blurred_views": ("Blurred views", blurred_views.section),
    "clocks": ("Clocks", _clocks),
    "rolling_shutter": ("Rolling shutters", _rolling_shutter),
    "bag": ("Bags", _bag),
    "verify": ("Detection of moved parts", _verify),
    "live": ("A running ROS 2", _live),
    "plan": ("Planned samples", plan.section),
    "stopping": ("Samples needed for a goal", stopping.section),
    "error_map": ("The map of errors", error_map.section),
    "meeting": ("Meetings", meeting.section),
    "local_fits": ("Local or global calibration", local_fits.section),
    "page": ("Pages in a browser", page.section),
    "solve": ("Speed compared with other solvers", _solve),
    "batch": ("Calibrations a second", _batch),
    "study": ("Studies", _study),
    "ring": ("A ring of robots, the whole command", _ring),
    "cluster": ("Studies on a cluster", _cluster),
    "scaling": ("Time and memory", _scaling),
    "robots": ("Many robots", _robots),
    "detectors": ("Detectors compared with OpenCV", _detectors),
    "peers": ("Errors compared with today's practice", _peers),
    "published": ("Errors compared with published ones", _published),
    "certificate": ("Certificate", _certificate),
    "mutants": ("Mutation tests", _mutants),
}


def _machine(result: Result) -> str:
    on = result["machine"]
    return f"{on['cpu']}, {on['cores']} cores, Python {on['python']}, NumPy {on['numpy']}"


def _filled(text: str) -> str:
    """Fill paragraphs and items of lists to `COLUMNS`, and leave tables, figures and headings as they are."""
    return "\n\n".join(map(_filled_block, text.split("\n\n")))


def _filled_block(block: str) -> str:
    if block.startswith(("|", "!", "#")):
        return block
    wrap = textwrap.TextWrapper(COLUMNS, break_long_words=False, break_on_hyphens=False)
    lines = []
    for item in re.split(r"\n(?=- )", block):
        wrap.subsequent_indent = "  " if item.startswith("- ") else ""
        lines += wrap.wrap(" ".join(item.split()).replace(" %", f"{_NO_BREAK}%"))
    return "\n".join(lines).replace(_NO_BREAK, " ")


def _section(name: str) -> str:
    title, write = SECTIONS[name]
    path = RESULTS / f"{name}.json"
    command = f"    python -m benchmarks.{name}"
    if not path.exists():
        return f"## {title}\n\n{command}\n\nNot run yet.\n"
    result = json.loads(path.read_text(encoding="utf-8"))
    when = (
        f"commit {result['commit']}" if result.get("commit") else "before the solver and the noise model were rewritten"
    )
    return f"## {title}\n\n{command}\n\n{_filled(write(result))}\n\nMeasured on: {_machine(result)}; {when}.\n"


def make_page() -> str:
    """The text of docs/benchmarks.md."""
    return "\n".join([INTRODUCTION, *map(_section, SECTIONS)])


if __name__ == "__main__":
    PAGE.write_text(make_page(), encoding="utf-8")
    print(f"written: {PAGE.name}")

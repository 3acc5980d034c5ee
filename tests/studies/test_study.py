"""Tests of the points and chunks of a study."""

from __future__ import annotations

from itertools import pairwise

from basecal.studies.solvers.registry import SOLVERS
from basecal.studies.study import _MOST_CELLS, BLOCK, _abbreviate, axis_label
from study_example import BOARD, study


def test_points_are_all_combinations() -> None:
    """The last axis varies fastest, and settings under `hold` are in all points."""
    made = study(hold="pixel_px: 0.5", axes="samples: [5, 6], layout: [dual, eye_in_hand]")
    assert [tuple(point.at.values()) for point in made.points] == [
        (5, "dual"),
        (5, "eye_in_hand"),
        (6, "dual"),
        (6, "eye_in_hand"),
    ]
    assert {point.settings["pixel_px"] for point in made.points} == {0.5}


def test_chunks_contain_every_trial_once() -> None:
    """Trials of a point are numbered through its chunks and distributed over its cells as evenly as possible."""
    made = study(trials=2 * BLOCK + 3, cells=2, axes="samples: [5, 6]")
    for point in made.points:
        pieces = [piece for chunk in made.chunks if chunk.point == point for piece in chunk.pieces]
        numbers = [n for piece in pieces for n in range(piece.first, piece.first + piece.count)]
        assert numbers == list(range(made.trials))
        of_cells = [sum(p.count for p in pieces if p.cell == cell) for cell in range(made.cells)]
        assert max(of_cells) - min(of_cells) <= 1
        assert max(piece.count for piece in pieces) <= BLOCK


def test_identity_depends_on_numbers_alone() -> None:
    """The identity is independent of title, comments and stated defaults. Seed, trials and settings change it."""
    first = study().identity
    assert study(more="title: other  # said").identity == first
    assert study(hold="samples: 30").identity == first
    assert len({first, study(more="seed: 1").identity, study(9).identity, study(hold="samples: 31").identity}) == 4


def test_boards_are_labelled_by_kind_and_sizes() -> None:
    """The label of a board has its kind and sizes. Labels are strings or numbers."""
    made = study(axes="board: [{kind: chessboard, corners: [4, 3], square_m: 0.06}], samples: [5]")
    assert made.points[0].label == {"board": "chessboard 4x3 0.06", "samples": 5}
    assert BOARD.startswith("board")


def test_pieces_are_numbered_by_cell_and_block() -> None:
    """Of 515 trials the first of two cells has one more. Each block, and the remainder, has its own generator."""
    made = study(trials=2 * BLOCK + 3, cells=2)
    pieces = [piece for chunk in made.chunks for piece in chunk.pieces]
    assert [(piece.cell, piece.block, piece.first, piece.count) for piece in pieces] == [
        (0, 0, 0, BLOCK),
        (0, 1, BLOCK, 2),
        (1, 0, BLOCK + 2, BLOCK),
        (1, 1, 2 * BLOCK + 2, 1),
    ]


def test_chunks_are_limited_by_solver_blocks() -> None:
    """Chunks are numbered, have at most the trials of the solver's blocks, and combine several pieces."""
    made = study(trials=4 * BLOCK, cells=64, axes="solver: [maximum_likelihood, closed_form]", hold="layout: shifts")
    assert [chunk.index for chunk in made.chunks] == list(range(len(made.chunks)))
    for point in made.points:
        own = [chunk for chunk in made.chunks if chunk.point == point]
        most = BLOCK * SOLVERS[point.settings["solver"]].blocks
        assert max(chunk.trials for chunk in own) <= most
        assert sum(chunk.trials for chunk in own) == made.trials
        for chunk, after in pairwise(own):
            cells = {piece.cell for piece in (*chunk.pieces, after.pieces[0])}
            assert chunk.trials + after.pieces[0].count > most or len(cells) > _MOST_CELLS


def test_labels_are_short() -> None:
    """Labels of boards have no truth values and no long lists. Other values are their own labels."""
    boards = "{kind: charuco, squares: [5, 7], square_m: 0.03, marker_m: 0.0225, dictionary: DICT_4X4_50}"
    made = study(axes=f"board: [{boards}]")
    assert [point.label["board"] for point in made.points] == ["charuco 5x7 0.03 0.0225 DICT_4X4_50"]
    assert axis_label(True) is True


def test_a_generator_draws_256_trials() -> None:
    """The numbers of a study depend on the trial at which the next generator begins: 256 trials per generator."""
    pieces = {count: study(trials=count, cells=1).chunks for count in (256, 257)}
    assert [[piece.count for chunk in chunks for piece in chunk.pieces] for chunks in pieces.values()] == [
        [256],
        [256, 1],
    ]


def test_chunk_size_depends_on_the_solver() -> None:
    """A chunk has one generator of the estimator or 64 of the closed form, and trials of at most twenty cells."""
    shifts = "layout: shifts, solver: closed_form"
    for trials, cells, hold, counts in (
        (257, 1, "", [256, 1]),
        (64 * 256, 1, shifts, [64 * 256]),
        (64 * 256 + 1, 1, shifts, [64 * 256, 1]),
        (20, 20, "", [20]),
        (42, 21, "", [40, 2]),
    ):
        assert [chunk.trials for chunk in study(trials=trials, cells=cells, hold=hold).chunks] == counts


def test_identity_depends_on_axis_order_and_cells() -> None:
    """The same values in another order are other points."""
    made = study(axes="samples: [5, 6]")
    assert [point.settings["samples"] for point in made.points] == [5, 6]
    assert made.identity == study(axes="samples: [5, 6]", hold="pixel_px: 0.2").identity
    assert made.identity != study(axes="samples: [6, 5]").identity
    assert made.identity != study(axes="samples: [5, 6]", cells=1).identity


def test_labels_abbreviate_options() -> None:
    """Numbers of a list are joined by an x. Words and numbers are unchanged, and truth values and None are empty."""
    assert [_abbreviate(option) for option in ([1, 2.5, "a"], 0.25, 3, "DICT", None, False)] == [
        "1x2.5",
        "0.25",
        "3",
        "DICT",
        "",
        "",
    ]

"""Points and chunks of a study."""

from __future__ import annotations

from itertools import pairwise

from basecal.studies.solvers.registry import SOLVERS
from basecal.studies.study import _MOST_CELLS, BLOCK, _abbreviate, axis_label
from study_example import BOARD, study


def test_points_are_all_combinations() -> None:
    """The last axis varies fastest, and what is held is in every point's settings."""
    made = study(hold="pixel_px: 0.5", axes="samples: [5, 6], layout: [dual, eye_in_hand]")
    assert [tuple(point.at.values()) for point in made.points] == [
        (5, "dual"),
        (5, "eye_in_hand"),
        (6, "dual"),
        (6, "eye_in_hand"),
    ]
    assert {point.settings["pixel_px"] for point in made.points} == {0.5}


def test_chunks_have_every_trial_once() -> None:
    """Trials of a point are numbered through its chunks, spread over its cells as evenly as they go."""
    made = study(trials=2 * BLOCK + 3, cells=2, axes="samples: [5, 6]")
    for point in made.points:
        pieces = [piece for chunk in made.chunks if chunk.point == point for piece in chunk.pieces]
        numbers = [n for piece in pieces for n in range(piece.first, piece.first + piece.count)]
        assert numbers == list(range(made.trials))
        of_cells = [sum(p.count for p in pieces if p.cell == cell) for cell in range(made.cells)]
        assert max(of_cells) - min(of_cells) <= 1
        assert max(piece.count for piece in pieces) <= BLOCK


def test_identity_is_of_numbers_alone() -> None:
    """Title and comments change nothing; seed, trials and settings do, also where they are as by default."""
    first = study().identity
    assert study(more="title: other  # said").identity == first
    assert study(hold="samples: 30").identity == first
    assert len({first, study(more="seed: 1").identity, study(9).identity, study(hold="samples: 31").identity}) == 4


def test_boards_are_labelled_by_kind_and_sizes() -> None:
    """A label is a word or a number."""
    made = study(axes="board: [{kind: chessboard, corners: [4, 3], square_m: 0.06}], samples: [5]")
    assert made.points[0].label == {"board": "chessboard 4x3 0.06", "samples": 5}
    assert BOARD.startswith("board")


def test_pieces_are_numbered_by_cell_and_generator() -> None:
    """Of 515 trials the first of two cells has one more: a generator each for a block, and for the rest."""
    made = study(trials=2 * BLOCK + 3, cells=2)
    pieces = [piece for chunk in made.chunks for piece in chunk.pieces]
    assert [(piece.cell, piece.block, piece.first, piece.count) for piece in pieces] == [
        (0, 0, 0, BLOCK),
        (0, 1, BLOCK, 2),
        (1, 0, BLOCK + 2, BLOCK),
        (1, 1, 2 * BLOCK + 2, 1),
    ]


def test_chunks_are_numbered_and_have_few_blocks() -> None:
    """Never more trials than the solver's blocks, and not one chunk for each piece."""
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
    """Without truth values and long lists."""
    boards = "{kind: charuco, squares: [5, 7], square_m: 0.03, marker_m: 0.0225, dictionary: DICT_4X4_50}"
    made = study(axes=f"board: [{boards}]")
    assert [point.label["board"] for point in made.points] == ["charuco 5x7 0.03 0.0225 DICT_4X4_50"]
    assert axis_label(True) is True


def test_a_generator_draws_256_trials() -> None:
    """The numbers of a study depend on where the next generator begins."""
    pieces = {count: study(trials=count, cells=1).chunks for count in (256, 257)}
    assert [[piece.count for chunk in chunks for piece in chunk.pieces] for chunks in pieces.values()] == [
        [256],
        [256, 1],
    ]


def test_a_chunk_has_the_trials_that_its_solver_does_in_seconds() -> None:
    """A generator of the estimator, 64 generators of the closed form, and the trials of at most twenty cells."""
    shifts = "layout: shifts, solver: closed_form"
    for trials, cells, hold, counts in (
        (257, 1, "", [256, 1]),
        (64 * 256, 1, shifts, [64 * 256]),
        (64 * 256 + 1, 1, shifts, [64 * 256, 1]),
        (20, 20, "", [20]),
        (42, 21, "", [40, 2]),
    ):
        assert [chunk.trials for chunk in study(trials=trials, cells=cells, hold=hold).chunks] == counts


def test_identity_holds_the_order_of_an_axis_and_the_cells() -> None:
    """The same values in another order are other points."""
    made = study(axes="samples: [5, 6]")
    assert [point.settings["samples"] for point in made.points] == [5, 6]
    assert made.identity == study(axes="samples: [5, 6]", hold="pixel_px: 0.2").identity
    assert made.identity != study(axes="samples: [6, 5]").identity
    assert made.identity != study(axes="samples: [5, 6]", cells=1).identity


def test_labels_leave_out_lists_of_four() -> None:
    """A list of three numbers is written with an x between, words and numbers as they are."""
    assert [_abbreviate(option) for option in ([1, 2.5, "a"], 0.25, 3, "DICT", None, False)] == [
        "1x2.5",
        "0.25",
        "3",
        "DICT",
        "",
        "",
    ]

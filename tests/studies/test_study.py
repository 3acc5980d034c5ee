"""Points and chunks of a study."""

from __future__ import annotations

from basecal.studies.study import BLOCK
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

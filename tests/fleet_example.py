"""Rows of a small fleet for tests."""

from __future__ import annotations

from dataclasses import asdict

from basecal.studies.fleet.row import Row

ROWS = [
    asdict(Row("a", "good", samples=30, transform="eye_base_from_hand_base", sigma_mm=0.5, sigma_deg=0.1, time_s=2.0)),
    asdict(
        Row("b", "doubtful", "drift few-images", "it moved", 30, "eye_base_from_hand_base", sigma_mm=1.5, time_s=4.0)
    ),
    asdict(Row("<c>", "unreadable", said="cell.yaml:1: <gossip>", time_s=0.1)),
    asdict(Row("d", "doubtful", "drift", "it moved, too", 30, "eye_base_from_hand_base", sigma_mm=2.5, time_s=3.0)),
]

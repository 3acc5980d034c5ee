"""Bases placed by relations of pairs."""

from __future__ import annotations

import numpy as np

from basecal.estimation.start.base_graph import place_bases
from basecal.geometry import SE3


def test_bases_are_placed_by_the_fewest_relations(rng) -> None:
    """From either end of a relation; a longer way with an error is not gone."""
    bases = {None: SE3.identity(), **{f"b{k}": SE3.exp(rng.uniform(-1, 1, 6)) for k in range(4)}}
    between = {(a, b): bases[a].inverse() @ bases[b] for a, b in ((None, "b0"), ("b2", "b1"), ("b1", None))}
    off = bases["b0"].inverse() @ bases["b2"] @ SE3.exp(np.full(6, 0.1))
    found = place_bases({}, {("b0", "b3"): off, ("b3", "b2"): SE3.identity(), **between})
    for name in ("b0", "b1", "b2"):
        np.testing.assert_allclose(found[name].matrix, bases[name].matrix, atol=1e-12)


def test_what_is_known_stays_and_leads_on(rng) -> None:
    """A base that no relation names stays; one that leads nowhere is not placed."""
    at, relation = SE3.exp(rng.uniform(-1, 1, 6)), SE3.exp(rng.uniform(-1, 1, 6))
    found = place_bases({"a": at}, {("b", "a"): relation, ("c", "d"): relation, ("a", None): relation})
    assert found.keys() == {"a", "b"}
    assert found["a"] is at
    np.testing.assert_allclose(found["b"].matrix, (at @ relation.inverse()).matrix, atol=1e-12)

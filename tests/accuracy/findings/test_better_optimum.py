"""`better-optimum`."""

from types import SimpleNamespace

from basecal.accuracy.findings.better_optimum import better_optimum


def test_only_where_the_answer_is_another_than_the_start_led_to(evidence):
    """Both costs are told, that of the start first."""
    same = evidence()
    same.robust.solution = same.solution
    assert better_optimum(same) == []
    other = evidence({"cost": 40.5}, robust=SimpleNamespace(solution=SimpleNamespace(cost=99.25)))
    (found,) = better_optimum(other)
    assert (found.code, found.severity) == ("better-optimum", "info")
    assert "of cost 99.25, the certificate to one of 40.5:" in found.message

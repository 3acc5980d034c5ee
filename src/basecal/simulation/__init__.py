"""Cells with known truth, and recordings of them."""

from basecal.simulation.scenario import Scenario, SimulatedCell
from basecal.simulation.testbed import simulate

__all__ = ["Scenario", "SimulatedCell", "simulate"]

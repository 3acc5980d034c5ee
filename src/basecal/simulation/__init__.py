"""Simulated cells with known truth, and their recordings."""

from basecal.simulation.scenario import Scenario, SimulatedCell
from basecal.simulation.testbed import simulate

__all__ = ["Scenario", "SimulatedCell", "simulate"]

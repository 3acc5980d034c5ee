"""Tests of the commands in the recipes and the tutorial."""

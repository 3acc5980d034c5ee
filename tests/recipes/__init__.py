"""The recipes and the tutorial: what they tell users to type."""

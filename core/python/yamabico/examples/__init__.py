"""Example plugins."""
